//! Seams made invisible: bilinear lookups from both sides are made equal by least squares (Iwanicki, Lighting
//! Technology of The Last of Us, 2013; Rioux-Lavoie, Lightmap Seam Fixing).
//!
//! Unknown are the changes d of the texels that lookups along seams touch. Minimised is
//! Σ_s w_s (a_s·(x + d))² + Σ_i m_i d_i², where a_s is the difference of the two lookups at a point of a seam and m_i
//! holds the texel where it is. The normal equations are solved by conjugate gradients with the diagonal as
//! preconditioner, three channels side by side, all sums in fixed order.

use super::canvas::{Canvas, NO_CHART};
use super::seams::{Border, Seam};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Lookups that are made equal: two for every texel of a seam's length, so that each lies in another footprint.
const PER_TEXEL: f32 = 2.0;
/// How firmly a texel that a chart covers stays what it is, against 1 for a lookup pair.
const HOLD_COVERED: f64 = 0.05;
/// The same for texels beside charts: nothing but lookups at borders sees them.
const HOLD_BESIDE: f64 = 0.005;
/// Sides that differ by more than this share of their mean begin to be left alone; beyond the second nothing is done.
/// There a wall stands on the seam, or it is no seam of one surface at all: blending would leak light.
const DISTRUST: [f32; 2] = [0.6, 1.2];
/// Conjugate gradients stop at this residual, as a share of the first, or after this many steps.
const TOLERANCE: f64 = 1e-4;
const MOST_STEPS: usize = 100;
/// Terms of a dot product that are summed by one task.
const CHUNK: usize = 4096;

/// The difference of two lookups: up to eight unknowns with their factors.
#[derive(Clone, Copy)]
struct Pair {
    unknown: [u32; 8],
    factor: [f32; 8],
    weight: f32,
}

/// One lookup: four texels of a canvas and their weights.
struct Footprint {
    canvas: usize,
    texels: [usize; 4],
    weights: [f32; 4],
}

/// Changes the canvases so that lookups on both sides of every seam agree; returns the root mean square difference
/// along seams before and after.
pub(super) fn stitch(
    canvases: &mut [Canvas],
    seams: &[Seam],
    covered: impl Fn(usize, usize) -> bool,
) -> [f64; 2] {
    let mut system = System::default();
    let mut numbers: Vec<Vec<u32>> =
        canvases.iter().map(|canvas| vec![u32::MAX; canvas.value.len()]).collect();
    let of_page = |page: u32| canvases.iter().position(|canvas| canvas.page == page);
    for seam in seams {
        let [Some(a), Some(b)] = seam.map(|border| of_page(border.page)) else { continue };
        let length = |border: &Border| border.uv_texels[0].distance(border.uv_texels[1]);
        let longer = length(&seam[0]).max(length(&seam[1]));
        if !longer.is_finite() {
            continue;
        }
        let count = (longer * PER_TEXEL).ceil().clamp(1.0, 1e5) as u32;
        for k in 0..count {
            let t = (k as f32 + 0.5) / count as f32;
            let lookup = |i: usize, canvas: usize| {
                let [from, to] = seam[i].uv_texels;
                footprint(canvases, canvas, from.lerp(to, t))
            };
            if let (Some(one), Some(other)) = (lookup(0, a), lookup(1, b)) {
                system.add(canvases, &mut numbers, &covered, &one, &other);
            }
        }
    }
    if system.pairs.is_empty() {
        return [0.0; 2];
    }
    let values: Vec<DVec3> = system.places.iter().map(|&(c, t)| canvases[c].value[t].as_dvec3()).collect();
    let start = system.difference(&values);
    let changes = system.solve(&start);
    let mut changed = Vec::with_capacity(values.len());
    for ((&(canvas, texel), value), change) in system.places.iter().zip(&values).zip(&changes) {
        let new = (*value + *change).max(DVec3::ZERO);
        let new = if new.is_finite() { new } else { *value };
        canvases[canvas].value[texel] = new.as_vec3();
        changed.push(new);
    }
    let rms =
        |differences: &[DVec3]| (sum(differences, |d| d.length_squared()) / differences.len() as f64).sqrt();
    [rms(&start), rms(&system.difference(&changed))]
}

/// The four texels that a bilinear lookup reads, clamped to the page; `None` when one of them has no value, or they
/// belong to two charts.
fn footprint(canvases: &[Canvas], index: usize, p: Vec2) -> Option<Footprint> {
    let canvas = &canvases[index];
    let corner = (p - 0.5).floor();
    let f = p - 0.5 - corner;
    let last = canvas.size as f32 - 1.0;
    let texel = |x: f32, y: f32| y.clamp(0.0, last) as usize * canvas.size + x.clamp(0.0, last) as usize;
    let (x, y) = (corner.x, corner.y);
    let texels = [texel(x, y), texel(x + 1.0, y), texel(x, y + 1.0), texel(x + 1.0, y + 1.0)];
    let weights = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
    let mut read = texels.iter().zip(weights).filter(|(_, w)| *w > 0.0).map(|(&t, _)| canvas.owner[t]);
    let owner = read.next()?;
    (owner != NO_CHART && read.all(|other| other == owner)).then_some(Footprint {
        canvas: index,
        texels,
        weights,
    })
}

#[derive(Default)]
struct System {
    pairs: Vec<Pair>,
    /// Canvas and texel of every unknown.
    places: Vec<(usize, usize)>,
    /// How firmly each unknown is held.
    hold: Vec<f64>,
}

/// Which pairs each unknown takes part in, with the factors: the transposed matrix.
struct Transposed {
    first: Vec<u32>,
    pair: Vec<u32>,
    factor: Vec<f32>,
}

impl System {
    fn add(
        &mut self,
        canvases: &[Canvas],
        numbers: &mut [Vec<u32>],
        covered: &impl Fn(usize, usize) -> bool,
        one: &Footprint,
        other: &Footprint,
    ) {
        let value = |lookup: &Footprint| -> Vec3 {
            let values = lookup.texels.map(|t| canvases[lookup.canvas].value[t]);
            values.iter().zip(lookup.weights).map(|(v, w)| *v * w).sum()
        };
        let (a, b) = (value(one), value(other));
        let mean = 0.5 * (a + b).element_sum();
        let apart = (a - b).abs().element_sum();
        let distrust = ((apart - DISTRUST[0] * mean) / ((DISTRUST[1] - DISTRUST[0]) * mean)).clamp(0.0, 1.0);
        let weight = 1.0 - distrust;
        // Also where both sides are black.
        if weight.is_nan() || weight <= 0.0 {
            return;
        }
        let mut pair = Pair { unknown: [0; 8], factor: [0.0; 8], weight };
        let sides = [(one, 1.0), (other, -1.0)];
        let terms = sides.iter().flat_map(|&(lookup, sign)| (0..4).map(move |i| (lookup, i, sign)));
        for (slot, (lookup, i, sign)) in terms.enumerate() {
            let (canvas, texel) = (lookup.canvas, lookup.texels[i]);
            let number = &mut numbers[canvas][texel];
            if *number == u32::MAX {
                *number = self.places.len() as u32;
                self.places.push((canvas, texel));
                self.hold.push(if covered(canvas, texel) { HOLD_COVERED } else { HOLD_BESIDE });
            }
            pair.unknown[slot] = *number;
            pair.factor[slot] = lookup.weights[i] * sign;
        }
        self.pairs.push(pair);
    }

    /// a_s·x of every pair.
    fn difference(&self, x: &[DVec3]) -> Vec<DVec3> {
        let of = |pair: &Pair| {
            pair.unknown.iter().zip(pair.factor).map(|(&i, f)| x[i as usize] * f64::from(f)).sum::<DVec3>()
        };
        self.pairs.par_iter().map(of).collect()
    }

    /// Σ_s a_s w_s y_s.
    fn gather(&self, transposed: &Transposed, y: &[DVec3]) -> Vec<DVec3> {
        let of = |i: usize| {
            let range = transposed.first[i] as usize..transposed.first[i + 1] as usize;
            let terms = transposed.pair[range.clone()].iter().zip(&transposed.factor[range]);
            terms.map(|(&s, &f)| y[s as usize] * f64::from(f * self.pairs[s as usize].weight)).sum::<DVec3>()
        };
        (0..self.places.len()).into_par_iter().map(of).collect()
    }

    fn transposed(&self) -> Transposed {
        let mut first = vec![0_u32; self.places.len() + 1];
        let terms = || {
            (0_u32..).zip(&self.pairs).flat_map(|(s, pair)| {
                pair.unknown
                    .iter()
                    .zip(pair.factor)
                    .filter(|(_, f)| *f != 0.0)
                    .map(move |(&i, f)| (s, i as usize, f))
            })
        };
        terms().for_each(|(_, i, _)| first[i + 1] += 1);
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut next = first.clone();
        let total = first.last().map_or(0, |&n| n as usize);
        let (mut pair, mut factor) = (vec![0; total], vec![0.0; total]);
        for (s, i, f) in terms() {
            let at = next[i] as usize;
            (pair[at], factor[at]) = (s, f);
            next[i] += 1;
        }
        Transposed { first, pair, factor }
    }

    /// The changes that minimise the sum, given the differences before.
    fn solve(&self, start: &[DVec3]) -> Vec<DVec3> {
        let transposed = self.transposed();
        let diagonal = |i: usize| {
            let range = transposed.first[i] as usize..transposed.first[i + 1] as usize;
            let terms = transposed.pair[range.clone()].iter().zip(&transposed.factor[range]);
            let own: f32 = terms.map(|(&s, &f)| f * f * self.pairs[s as usize].weight).sum();
            self.hold[i] + f64::from(own)
        };
        let diagonal: Vec<f64> = (0..self.places.len()).into_par_iter().map(diagonal).collect();
        let apply = |d: &[DVec3]| {
            let mut out = self.gather(&transposed, &self.difference(d));
            out.par_iter_mut().zip(d).zip(&self.hold).for_each(|((out, d), hold)| *out += *d * *hold);
            out
        };
        let precondition = |r: &[DVec3]| r.iter().zip(&diagonal).map(|(r, d)| *r / *d).collect::<Vec<_>>();

        let mut x = vec![DVec3::ZERO; self.places.len()];
        let mut r: Vec<DVec3> = self.gather(&transposed, start).into_iter().map(|g| -g).collect();
        let mut z = precondition(&r);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        let enough = rz.element_sum() * TOLERANCE * TOLERANCE;
        for _ in 0..MOST_STEPS {
            if rz.element_sum() <= enough {
                break;
            }
            let q = apply(&p);
            let step = quotient(rz, dot(&p, &q));
            for i in 0..x.len() {
                x[i] += p[i] * step;
                r[i] -= q[i] * step;
            }
            z = precondition(&r);
            let next = dot(&r, &z);
            let turn = quotient(next, rz);
            rz = next;
            for i in 0..p.len() {
                p[i] = z[i] + p[i] * turn;
            }
        }
        x
    }
}

/// Channel by channel; 0 where a channel has nothing left to solve.
fn quotient(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::select(b.cmpgt(DVec3::ZERO), a / b, DVec3::ZERO)
}

fn dot(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    let parts: Vec<DVec3> = a
        .par_chunks(CHUNK)
        .zip(b.par_chunks(CHUNK))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>())
        .collect();
    parts.into_iter().sum()
}

fn sum(values: &[DVec3], of: impl Fn(&DVec3) -> f64 + Sync) -> f64 {
    let parts: Vec<f64> = values.par_chunks(CHUNK).map(|chunk| chunk.iter().map(&of).sum()).collect();
    parts.into_iter().sum()
}
