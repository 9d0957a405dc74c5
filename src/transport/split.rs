//! Cutting the boxes of large, slanted triangles into smaller ones before the tree is built.
//!
//! Only boxes are cut: the triangle in the leaf is whole, in several leaves. A piece's box holds all of the triangle
//! between the cutting planes, rounded outward, so that no ray slips through between two pieces.

use super::shear::BOX_PAD;
use glam::{DVec3, Vec3};

/// A box over a triangle or a piece of it.
#[derive(Clone, Copy)]
pub(super) struct Fragment {
    pub low: Vec3,
    pub high: Vec3,
    pub triangle: u32,
}

/// Boxes more than triangles, as a share of the triangles.
const EXTRA: f64 = 0.3;

/// Most cuts of one triangle.
const MOST_CUTS: usize = 255;

/// Cuts until there are about `1 + EXTRA` times as many boxes as triangles.
///
/// Pieces go by how much a cut is worth, as Karras and Aila, "Fast Parallel Construction of High-Quality Bounding
/// Volume Hierarchies", HPG 2013, section 4.2 have it: a triangle's share of the budget grows with the area its box
/// has in excess of what the triangle needs. Planes are those of a grid over the world that halves itself, so that
/// neighbours are cut alike.
pub(super) fn fragments(
    corners: &[[Vec3; 3]],
    triangles: &[u32],
    may_split: impl Fn(u32) -> bool,
) -> Vec<Fragment> {
    let whole = |&triangle: &u32| {
        let (low, high) = bounds(&corners[triangle as usize]);
        Fragment { low, high, triangle }
    };
    let mut fragments: Vec<Fragment> = triangles.iter().map(whole).collect();
    let world_low = fragments.iter().fold(Vec3::INFINITY, |low, f| low.min(f.low));
    let world_high = fragments.iter().fold(Vec3::NEG_INFINITY, |high, f| high.max(f.high));
    let grid = Grid { low: world_low.as_dvec3(), size: (world_high - world_low).as_dvec3() };
    let worth: Vec<f64> = fragments
        .iter()
        .map(|f| if may_split(f.triangle) { grid.worth(f, &corners[f.triangle as usize]) } else { 0.0 })
        .collect();
    let budget = EXTRA * triangles.len() as f64;
    let scale = budget_scale(&worth, budget);
    for i in 0..triangles.len() {
        let mut cuts = (worth[i] * scale) as usize;
        if cuts == 0 {
            continue;
        }
        cuts = cuts.min(MOST_CUTS);
        // Largest piece first.
        let mut pieces = vec![fragments[i]];
        let corners = &corners[fragments[i].triangle as usize];
        while cuts > 0 {
            let Some(k) = (0..pieces.len()).max_by(|&a, &b| area(&pieces[a]).total_cmp(&area(&pieces[b])))
            else {
                break;
            };
            let Some((left, right)) = grid.cut(&pieces[k], corners) else { break };
            pieces[k] = left;
            pieces.push(right);
            cuts -= 1;
        }
        fragments[i] = pieces[0];
        fragments.extend_from_slice(&pieces[1..]);
    }
    for f in &mut fragments {
        let (low, high) = bounds(&corners[f.triangle as usize]);
        (f.low, f.high) = pad(f.low, f.high, high - low);
    }
    fragments
}

fn bounds([a, b, c]: &[Vec3; 3]) -> (Vec3, Vec3) {
    (a.min(*b).min(*c), a.max(*b).max(*c))
}

/// The box as the ray's test wants it, see [`super::shear::Slabs`]; `extent` is that of the whole triangle.
fn pad(low: Vec3, high: Vec3, extent: Vec3) -> (Vec3, Vec3) {
    let pad = extent.max_element() * BOX_PAD;
    ((low - pad).map(f32::next_down), (high + pad).map(f32::next_up))
}

/// The box of a whole triangle, padded.
pub(super) fn padded(corners: &[Vec3; 3]) -> (Vec3, Vec3) {
    let (low, high) = bounds(corners);
    pad(low, high, high - low)
}

fn budget_scale(worth: &[f64], budget: f64) -> f64 {
    let spent = |scale: f64| worth.iter().map(|w| (w * scale).floor().min(MOST_CUTS as f64)).sum::<f64>();
    let total: f64 = worth.iter().sum();
    if total <= 0.0 || budget <= 0.0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, budget / total);
    for _ in 0..20 {
        if spent(high) >= budget {
            break;
        }
        (low, high) = (high, high * 2.0);
    }
    for _ in 0..20 {
        let middle = (low + high) / 2.0;
        if spent(middle) <= budget { low = middle } else { high = middle }
    }
    low
}

fn area(f: &Fragment) -> f32 {
    let d = f.high - f.low;
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// Planes that halve the world's box again and again.
struct Grid {
    low: DVec3,
    size: DVec3,
}

impl Grid {
    /// The coarsest plane strictly inside the box along its longest axis: axis and coordinate.
    fn plane(&self, f: &Fragment) -> Option<(usize, f32, i32)> {
        let extent = f.high - f.low;
        let axis = extent.max_position();
        let (low, size) = (self.low[axis], self.size[axis]);
        let (from, to) = ((f64::from(f.low[axis]) - low) / size, (f64::from(f.high[axis]) - low) / size);
        // The level at which the two ends fall into different cells.
        let mut level = 1;
        while level < 40 {
            let cells = (1u64 << level) as f64;
            let cell = (from * cells).floor() + 1.0;
            if cell < to * cells {
                let plane = (low + size * (cell / cells)) as f32;
                return (plane > f.low[axis] && plane < f.high[axis]).then_some((axis, plane, level));
            }
            level += 1;
        }
        None
    }

    /// How much cutting a triangle is worth.
    fn worth(&self, f: &Fragment, corners: &[Vec3; 3]) -> f64 {
        let Some((_, _, level)) = self.plane(f) else { return 0.0 };
        let [a, b, c] = corners.map(|c| c.as_dvec3());
        let n = (b - a).cross(c - a).abs();
        let ideal = n.x + n.y + n.z;
        let excess = (2.0 * f64::from(area(f)) - ideal).max(0.0);
        (excess / (self.size.x * self.size.y) * 4f64.powi(-level).sqrt()).cbrt()
    }

    /// The two sides of the box at its plane.
    fn cut(&self, f: &Fragment, corners: &[Vec3; 3]) -> Option<(Fragment, Fragment)> {
        let (axis, plane, _) = self.plane(f)?;
        let side = |keep: &dyn Fn(f64) -> bool| {
            let mut low = DVec3::INFINITY;
            let mut high = DVec3::NEG_INFINITY;
            let mut add = |p: DVec3| (low, high) = (low.min(p), high.max(p));
            let at = f64::from(plane);
            for k in 0..3 {
                let (p, q) = (corners[k].as_dvec3(), corners[(k + 1) % 3].as_dvec3());
                if keep(p[axis]) {
                    add(p);
                }
                if (p[axis] < at) != (q[axis] < at) {
                    add(p + (q - p) * ((at - p[axis]) / (q[axis] - p[axis])));
                }
            }
            (low.as_vec3().map(f32::next_down), high.as_vec3().map(f32::next_up))
        };
        let (mut left, mut right) = (*f, *f);
        let (low, high) = side(&|x| x <= f64::from(plane));
        (left.low, left.high) = (f.low.max(low), f.high.min(high));
        left.high[axis] = plane;
        let (low, high) = side(&|x| x >= f64::from(plane));
        (right.low, right.high) = (f.low.max(low), f.high.min(high));
        right.low[axis] = plane;
        let lawful = left.low.cmple(left.high).all() && right.low.cmple(right.high).all();
        lawful.then_some((left, right))
    }
}
