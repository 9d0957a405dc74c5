//! Form factor between two polygons that see each other whole.
//!
//! F₁₂ = 1/A₁ ∫ F(x) dx over the first polygon, with Lambert's closed form F inside: Gauss-Legendre rules of growing
//! order where the integrand is smooth, and where it is not, that is near contact and where one polygon reaches behind
//! the other, Stokes' theorem on both sides ([`super::contour`]), which turns the singularity into an integrable
//! logarithm along the edges.

use super::Row;
use super::contour::contour_factor;
use super::polygon::point_to_polygon;
use glam::DVec3;

/// A convex planar polygon with its measures, in any length unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    corners: Vec<DVec3>,
    normal: DVec3,
    area: f64,
}

impl Polygon {
    /// `corners` are convex, planar, and wind counter-clockwise seen from the front. None for fewer than three, for
    /// anything not finite and for an area of zero.
    pub fn new(corners: Vec<DVec3>) -> Option<Self> {
        let first = *corners.first()?;
        let doubled: DVec3 =
            corners[1..].windows(2).map(|edge| (edge[0] - first).cross(edge[1] - first)).sum();
        let normal = doubled.try_normalize()?;
        Some(Self { corners, normal, area: 0.5 * doubled.length() })
    }

    /// Corners, counter-clockwise seen from the front.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// Unit normal on the front.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Area, squared length units.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// The part before the plane of `other`, as corners; fewer than three where nothing is.
    fn before(&self, other: &Self) -> Vec<DVec3> {
        let height = |corner: DVec3| (corner - other.corners[0]).dot(other.normal);
        let mut kept = Vec::with_capacity(self.corners.len() + 1);
        let mut a = self.corners[self.corners.len() - 1];
        for &b in &self.corners {
            let (height_a, height_b) = (height(a), height(b));
            if (height_a > 0.0) != (height_b > 0.0) && height_a != height_b {
                kept.push(a + (b - a) * (height_a / (height_a - height_b)));
            }
            if height_b > 0.0 {
                kept.push(b);
            }
            a = b;
        }
        kept
    }
}

/// A form factor and what it may be off by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AreaFactor {
    /// F₁₂: the share of the power that leaves the first polygon's front and arrives at the second's front.
    pub factor: f64,
    /// Bound on the absolute error: the difference to the next coarser rule, whose own error it measures and which
    /// exceeds that of the finer one wherever the rules converge, plus the rounding of the largest terms.
    pub error: f64,
}

/// Form factor from one polygon to another with nothing in between, to a relative `tolerance` (1e-12 to 0.1; 1e-6 for
/// the matrix). Both radiate from their fronts alone.
pub fn polygon_to_polygon(from: &Polygon, to: &Polygon, tolerance: f64) -> AreaFactor {
    let tolerance = tolerance.clamp(1e-12, 0.1);
    let (seen_from, seen_to) = (from.before(to), to.before(from));
    if seen_from.len() < 3 || seen_to.len() < 3 {
        return AreaFactor::default();
    }
    // By reciprocity either may be integrated over: the smaller one is the easier.
    let from_side = Side { corners: &seen_from, normal: from.normal, extent: extent(&seen_from) };
    let to_side = Side { corners: &seen_to, normal: to.normal, extent: extent(&seen_to) };
    let smaller_first =
        if from_side.extent <= to_side.extent { (&from_side, &to_side) } else { (&to_side, &from_side) };
    let mut best = AreaFactor { factor: 0.0, error: f64::INFINITY };
    if separation(&from_side, &to_side) > SMOOTH_SEPARATION * smaller_first.0.extent {
        best = by_gauss(smaller_first.0, smaller_first.1, from.area, tolerance);
        if best.error <= tolerance * best.factor {
            return best;
        }
    }
    let contour = contour_factor(&seen_from, &seen_to, from.area, tolerance);
    if contour.error < best.error { contour } else { best }
}

/// The same by one product rule of 4 × 4 points on the first polygon and no second look: within 1 % where squares of one
/// size have an edge in common at right angles or more, and better the farther they are apart.
pub fn polygon_to_polygon_by_rule(from: &Polygon, to: &Polygon) -> f64 {
    let (seen_from, seen_to) = (from.before(to), to.before(from));
    if seen_from.len() < 3 || seen_to.len() < 3 {
        return 0.0;
    }
    gauss_factor(&seen_from, from.normal, &seen_to, &GAUSS_4) / from.area
}

/// The point factor varies over lengths of about the distance to the other polygon. Nearer than this share of its own
/// extent a polygon is not integrated by Gauss rules: they would agree with each other on what they all step over.
const SMOOTH_SEPARATION: f64 = 0.5;

/// The part of a polygon that the other one sees.
struct Side<'a> {
    corners: &'a [DVec3],
    normal: DVec3,
    extent: f64,
}

fn extent(corners: &[DVec3]) -> f64 {
    corners.iter().map(|corner| corner.distance(corners[0])).fold(0.0, f64::max)
}

/// A lower bound on the distance between two polygons: between spheres about them, or from one's plane.
fn separation(a: &Side, b: &Side) -> f64 {
    let height = |over: &Side, corners: &[DVec3]| {
        let height = |corner: &DVec3| (*corner - over.corners[0]).dot(over.normal);
        corners.iter().map(height).fold(f64::INFINITY, f64::min)
    };
    let apart = a.corners[0].distance(b.corners[0]) - a.extent - b.extent;
    apart.max(height(a, b.corners)).max(height(b, a.corners))
}

/// Gauss rules of growing order over `outer`, the total divided by `area`.
fn by_gauss(outer: &Side, inner: &Side, area: f64, tolerance: f64) -> AreaFactor {
    // Far from its polygon the point factor is a rule itself, good to 1e-6 where it counts.
    let distance = outer.corners[0].distance(inner.corners[0]) + outer.extent;
    let point_error = if distance > 16.0 * inner.extent { 1e-6 } else { 0.0 };
    let integrate = |rule| gauss_factor(outer.corners, outer.normal, inner.corners, rule) / area;
    let mut coarser = integrate(&GAUSS_2[..]);
    let mut best = AreaFactor { factor: coarser, error: f64::INFINITY };
    for rule in [&GAUSS_4[..], &GAUSS_8[..]] {
        let factor = integrate(rule);
        best = AreaFactor { factor, error: (factor - coarser).abs() + point_error * factor };
        if best.error <= tolerance * factor {
            break;
        }
        coarser = factor;
    }
    best
}

/// Nodes and weights on `[0, 1]`.
type Gauss = [(f64, f64)];

const GAUSS_2: [(f64, f64); 2] = [(0.2113248654051871, 0.5), (0.7886751345948129, 0.5)];
const GAUSS_4: [(f64, f64); 4] = [
    (0.06943184420297371, 0.17392742256872692),
    (0.33000947820757187, 0.32607257743127305),
    (0.6699905217924281, 0.32607257743127305),
    (0.9305681557970263, 0.17392742256872692),
];
const GAUSS_8: [(f64, f64); 8] = [
    (0.019855071751231884, 0.05061426814518813),
    (0.10166676129318664, 0.11119051722668724),
    (0.2372337950418355, 0.15685332293894363),
    (0.4082826787521751, 0.181341891689181),
    (0.591717321247825, 0.181341891689181),
    (0.7627662049581645, 0.15685332293894363),
    (0.8983332387068134, 0.11119051722668724),
    (0.9801449282487681, 0.05061426814518813),
];

/// ∫ F(x) dx over a convex polygon, cut into quadrilaterals (the last may have two corners in one place), with a
/// product rule on each.
fn gauss_factor(from: &[DVec3], normal: DVec3, to: &[DVec3], rule: &Gauss) -> f64 {
    let mut sum = 0.0;
    let mut second = 1;
    while second + 1 < from.len() {
        let corners = [from[0], from[second], from[second + 1], from[(second + 2).min(from.len() - 1)]];
        for &(u, weight_u) in rule {
            let (left, right) = (corners[0].lerp(corners[3], u), corners[1].lerp(corners[2], u));
            for &(v, weight_v) in rule {
                let du = (corners[3] - corners[0]).lerp(corners[2] - corners[1], v);
                let jacobian = (right - left).cross(du).length();
                sum += weight_u * weight_v * jacobian * point_to_polygon(left.lerp(right, v), normal, to);
            }
        }
        second += 2;
    }
    sum
}

/// Fills `row` with the form factors of polygon `from` to all `polygons`, each to a relative `tolerance`. Right where
/// nothing stands between any two of them: the walls of an empty convex room. What no polygon takes escapes.
pub fn polygon_row(polygons: &[Polygon], from: usize, tolerance: f64, row: &mut Row) {
    row.clear();
    let mut sum = 0.0;
    for (to, polygon) in polygons.iter().enumerate() {
        let factor = polygon_to_polygon(&polygons[from], polygon, tolerance).factor;
        if factor > 0.0 {
            row.column.push(to as u32);
            row.weight.push(factor);
            sum += factor;
        }
    }
    // Within their errors the factors of a closed room may add up to more than 1; then they are off by that share.
    if sum > 1.0 {
        row.weight.iter_mut().for_each(|weight| *weight /= sum);
    }
    row.miss = (1.0 - sum).max(0.0);
}
