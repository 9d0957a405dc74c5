//! Form factors pair by pair: Lambert's closed form for what two patches would exchange with nothing in between, times
//! the share of rays between them that pass.

use super::coarse::Surfaces;
use super::facets::{Facet, Facets};
use crate::elements::Elements;
use crate::sampling::seeded;
use crate::transport::form_factors::Row;
use crate::transport::form_factors::area::polygon_to_polygon_by_rule;
use crate::transport::form_factors::polygon::point_to_polygon;
use crate::transport::{Tracer, segment_to_surface};

/// Farther than this many of its radii from the larger facet a point stands for the smaller one. The point's form factor
/// varies over lengths of the distance, so that the middle is off by (radius/distance)²/6 at most, 1 %: a quarter of
/// the second derivative's 2/distance² times the mean square of the offsets, radius²/3.
const FAR_RADII: f64 = 4.0;
/// Rays that look whether one patch sees another, for form factors up to each of these; more beyond.
const LOOKS: [(f64, u32); 2] = [(1e-3, 1), (1e-2, 4)];
const MOST_LOOKS: u32 = 16;

/// Patches that are this near, in radii of both together, may be taken out of a sampled row: form factors are 1/20 and
/// more there, and 64 rays know them to 20 % and worse.
const NEAR_RADII: f64 = 1.0;
/// Points of each of two near patches that must all see each other.
const NEAR_LOOKS: u32 = 8;
/// Standard deviations by which the rays of a row may differ from a closed form that takes their place. Where they
/// differ more, something stands in between that no look has met.
const DEVIATIONS: f64 = 2.0;

/// The pairs of all patches.
pub(super) struct Pairs<'a, T> {
    elements: &'a Elements,
    surfaces: &'a Surfaces<'a, T>,
    facets: Facets,
    /// Of the looks.
    seed: u32,
}

impl<'a, T: Tracer> Pairs<'a, T> {
    pub fn new(surfaces: &'a Surfaces<'a, T>, facets: Facets, seed: u32) -> Self {
        Self { elements: surfaces.elements, surfaces, facets, seed }
    }

    /// Puts closed forms in the place of all of a row's sampled factors; returns the rays that took.
    ///
    /// What the samples know better is the sum: how much stays in the scene. In a closed room they know it exactly. So
    /// the closed forms are scaled as far as it takes to bring their sum within two standard deviations, each
    /// √(s(1 − s)) rays^(−5/8), of the share s of rays that landed on patches.
    pub fn replace_all(&self, patch: u32, rays_in_row: u64, row: &mut Row) -> u64 {
        let share = row.weight.iter().sum::<f64>().min(1.0);
        let deviation = deviation(share, rays_in_row);
        row.column.clear();
        row.weight.clear();
        let (mut rays, mut sum) = (0, 0.0);
        let area = self.surfaces.patches.area[patch as usize];
        for other in 0..self.surfaces.patches.len() as u32 {
            let open = self.open_exchange(patch, other);
            if open <= 0.0 {
                continue;
            }
            // Asked in the same order from both ends, so that both get the same answer.
            let factor = open / area.min(self.surfaces.patches.area[other as usize]);
            let looks = LOOKS.iter().find(|look| factor <= look.0).map_or(MOST_LOOKS, |look| look.1);
            let passed = self.transmitted(patch.min(other), patch.max(other), looks, &mut rays);
            if passed > 0.0 {
                row.column.push(other);
                row.weight.push(open * passed / area);
                sum += open * passed / area;
            }
        }
        let wanted =
            sum.clamp((share - 2.0 * deviation).max(0.0), (share + 2.0 * deviation).min(1.0 - row.miss));
        if sum > 0.0 {
            row.weight.iter_mut().for_each(|weight| *weight *= wanted / sum);
        }
        rays
    }

    /// Puts closed forms in the place of the sampled factors between patches of one facet that are near and wholly
    /// visible to each other, and scales the others so that the sum stays; returns the rays that took.
    pub fn replace_near(&self, patch: u32, rays_in_row: u64, row: &mut Row) -> u64 {
        let [own] = self.facets.of(patch) else { return 0 };
        let (mut rays, mut closed, mut sampled) = (0, 0.0, 0.0);
        let mut found: Vec<(usize, f64)> = Vec::new();
        for (at, &other) in row.column.iter().enumerate() {
            let [facet] = self.facets.of(other) else { continue };
            let reach = NEAR_RADII * (own.radius + facet.radius);
            if other == patch || own.centre.distance_squared(facet.centre) > reach * reach {
                continue;
            }
            if self.transmitted(patch.min(other), patch.max(other), NEAR_LOOKS, &mut rays) < 1.0 {
                continue;
            }
            let factor = exchange(own, facet) / own.polygon.area();
            let allowed = DEVIATIONS * deviation(factor, rays_in_row);
            if factor > 0.0 && (factor - row.weight[at]).abs() <= allowed {
                found.push((at, factor));
                closed += factor;
                sampled += row.weight[at];
            }
        }
        let rest = row.weight.iter().sum::<f64>() - sampled;
        let scale = (rest + sampled - closed) / rest;
        if !found.is_empty() && rest > 0.0 && scale > 0.0 {
            row.weight.iter_mut().for_each(|weight| *weight *= scale);
            found.iter().for_each(|&(at, factor)| row.weight[at] = factor);
        }
        rays
    }

    /// A_i F_ij with nothing in between, m².
    fn open_exchange(&self, patch: u32, other: u32) -> f64 {
        let (from, to) = (self.facets.of(patch.min(other)), self.facets.of(patch.max(other)));
        let mut sum = 0.0;
        for (i, a) in from.iter().enumerate() {
            for (j, b) in to.iter().enumerate() {
                if patch != other || i != j {
                    sum += exchange(a, b);
                }
            }
        }
        sum
    }

    /// The share of light that passes between two patches, by `looks` rays between their elements. Rays count by what
    /// the points at their ends exchange.
    fn transmitted(&self, from: u32, to: u32, looks: u32, rays: &mut u64) -> f64 {
        let patches = self.surfaces.patches;
        let (here, there) = (patches.elements_of(from), patches.elements_of(to));
        let [from_key, to_key] = [from, to].map(|patch| patches.key[patch as usize]);
        let own = from_key.wrapping_mul(0x9e37_79b9) ^ to_key.wrapping_mul(0x85eb_ca6b);
        let turn = seeded(self.seed, own);
        let (mut passed, mut all) = (0.0, 0.0);
        for k in 0..looks {
            // Hammersley points, turned and scrambled by the pair's numbers; both lists lie along Z-order curves.
            let unit = 1.0 / f64::from(u32::MAX);
            let along = (f64::from(k) + 0.5) / f64::from(looks) + f64::from(turn) * unit;
            let across = f64::from(k.reverse_bits() ^ turn.rotate_left(16)) * unit;
            let pick =
                |list: &[u32], at: f64| list[((at.fract() * list.len() as f64) as usize).min(list.len() - 1)];
            let (weight, through) = self.look(pick(here, along), pick(there, across), rays);
            all += weight;
            passed += weight * through;
        }
        if all > 0.0 { passed / all } else { 0.0 }
    }

    /// Kernel of the form factor between two elements, and the share of light that passes between them.
    fn look(&self, from: u32, to: u32, rays: &mut u64) -> (f64, f64) {
        let (elements, world) = (self.elements, self.surfaces.tracer.world());
        let (i, j) = (from as usize, to as usize);
        let toward = elements.position_world[j] - elements.position_world[i];
        let leaving = toward.dot(elements.normal_geometric[i]);
        let arriving = -toward.dot(elements.normal_geometric[j]);
        if !(leaving > 0.0 && arriving > 0.0) {
            return (0.0, 0.0);
        }
        // Elements in contact exchange no more than all they have.
        let spread = toward.length_squared() + elements.area[i].0.max(elements.area[j].0);
        let origin = world.offset_origin(
            elements.triangle[i],
            elements.position_world[i],
            elements.normal_geometric[i],
        );
        let corners = world.corners(elements.triangle[j]);
        let end = elements.position_world[j];
        let ray = segment_to_surface(origin, end, elements.normal_geometric[j], &corners);
        *rays += 1;
        let through = self.surfaces.tracer.transmittance(&ray).element_sum() / 3.0;
        (f64::from(leaving * arriving / (spread * spread)), f64::from(through))
    }
}

/// Standard deviation of the share of a row's rays that land somewhere. Hits are the indicator of a region of the
/// four-dimensional cube; for those, that of scrambled nets falls as N^(−1/2 − 1/(2·4)), from √(F(1 − F)) at one ray on.
fn deviation(factor: f64, rays: u64) -> f64 {
    (factor * (1.0 - factor)).max(0.0).sqrt() * (rays.max(1) as f64).powf(-0.625)
}

/// A₁F₁₂ of two facets with nothing in between, m²; the same in both directions up to the order of sums.
fn exchange(a: &Facet, b: &Facet) -> f64 {
    let toward = b.centre - a.centre;
    if toward.dot(a.polygon.normal()) <= -b.radius || -toward.dot(b.polygon.normal()) <= -a.radius {
        return 0.0;
    }
    let (small, large) = if a.radius <= b.radius { (a, b) } else { (b, a) };
    let height = (small.centre - large.centre).dot(large.polygon.normal());
    let separation = (toward.length() - large.radius).max(height);
    let factor = if separation > FAR_RADII * small.radius {
        point_to_polygon(small.centre, small.polygon.normal(), large.polygon.corners())
    } else {
        polygon_to_polygon_by_rule(&small.polygon, &large.polygon)
    };
    factor * small.polygon.area()
}
