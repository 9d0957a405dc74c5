//! Lambert's polygon formula: the configuration factor of a polygon seen from a point, in closed form.
//!
//! F = −1/(2π) Σ θᵢ n·ĉᵢ over the edges, with c = a × b for the edge's ends a and b relative to the receiver and
//! θ = atan2(|c|, a·b) (Lambert 1760; Cohen & Wallace, *Radiosity and Realistic Image Synthesis*, eq. 4.17).
//! A diffuse polygon of radiance L then gives the irradiance E = π L F.
//!
//! All of it runs in f64: at a distance of 1,000 sizes or at grazing incidence the edge terms cancel, and f32 loses
//! up to everything. The angle comes from both sine and cosine: `acos` alone loses half of the digits of small angles.

use super::lambert::{far_rule, is_far, lambert, lambert_of_four};
use glam::DVec3;

/// Polygons with more corners are cut into fans of this many.
const FAN_CORNERS: usize = 8;

/// Room for the corners of one fan after clipping: every horizon adds at most one.
const CLIPPED_CORNERS: usize = FAN_CORNERS + 2;

/// The configuration factor of a polygon seen from a point of a surface, in `[0, 1]`: the share of what leaves the
/// surface element at `position` (any length unit) with unit `normal` that arrives at the polygon. E = π L F.
///
/// The polygon is planar and convex and emits from its front alone, the side from which `corners` wind
/// counter-clockwise: 0 from behind, from its own plane, for fewer than three corners, for a polygon without area,
/// and for anything not finite. The part below the horizon of the receiver is clipped away.
///
/// Beyond 40 sizes of the polygon a cubature rule takes over, whose error is below 1e-6 of the factor a receiver
/// facing the polygon would have, and below 1e-5 of the factor itself at any angle.
///
/// ```
/// use glam::dvec3;
/// use lightkiln::transport::form_factors::polygon::point_to_polygon;
/// // A unit square lamp one metre above a floor, facing down; the receiver is under one of its corners.
/// let lamp = [dvec3(0., 0., 1.), dvec3(0., 1., 1.), dvec3(1., 1., 1.), dvec3(1., 0., 1.)];
/// let factor = point_to_polygon(dvec3(0., 0., 0.), dvec3(0., 0., 1.), &lamp);
/// assert!((factor - 0.138531605994893).abs() < 1e-14);
/// ```
pub fn point_to_polygon(position: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
    if let 3 | 4 = corners.len()
        && let Some(factor) = unclipped(position, normal, corners)
    {
        return as_factor(factor);
    }
    as_factor(sum_over_fans(corners, |fan| {
        let Some(mut polygon) = Relative::facing(position, fan) else { return 0.0 };
        if polygon.clip(normal) { polygon.factor(normal) } else { 0.0 }
    }))
}

/// The short way for a triangle or a quadrilateral that lies above the horizon, or is seen from behind; None when it
/// has to be clipped.
#[inline]
fn unclipped(position: DVec3, normal: DVec3, corners: &[DVec3]) -> Option<f64> {
    // Closed, with an edge without length after a triangle's three.
    let at: [DVec3; 5] =
        std::array::from_fn(|i| (if i < corners.len() { corners[i] } else { corners[0] }) - position);
    let area_vector = (at[2] - at[0]).cross(at[3] - at[1]);
    let lowest = at[..4].iter().map(|corner| corner.dot(normal)).fold(f64::INFINITY, f64::min);
    let depth = area_vector.dot(at[0]);
    if depth >= 0.0 {
        return Some(0.0);
    }
    if lowest < 0.0 {
        return None;
    }
    let corners = &at[..corners.len()];
    Some(if is_far(corners) { far_rule(corners, normal) } else { lambert_of_four(&at, normal) })
}

/// The same where the cosine is taken with `shading_normal`, and both hemispheres must be open: nothing below the
/// horizon of the geometry, nor below that of the shading normal, arrives. Equal to [`point_to_polygon`] where the
/// two normals are.
pub fn point_to_polygon_shaded(
    position: DVec3,
    geometric_normal: DVec3,
    shading_normal: DVec3,
    corners: &[DVec3],
) -> f64 {
    as_factor(sum_over_fans(corners, |fan| {
        let Some(mut polygon) = Relative::facing(position, fan) else { return 0.0 };
        if polygon.clip(geometric_normal) && polygon.clip(shading_normal) {
            polygon.factor(shading_normal)
        } else {
            0.0
        }
    }))
}

/// Clamps what rounding pushed out of `[0, 1]`; NaN becomes 0.
fn as_factor(sum: f64) -> f64 {
    if sum > 0.0 { sum.min(1.0) } else { 0.0 }
}

/// Cuts a convex polygon into fans of at most [`FAN_CORNERS`] corners, which are convex again, and adds them up.
fn sum_over_fans(corners: &[DVec3], mut factor: impl FnMut(&[DVec3]) -> f64) -> f64 {
    if corners.len() <= FAN_CORNERS {
        return if corners.len() < 3 { 0.0 } else { factor(corners) };
    }
    let mut fan = [corners[0]; FAN_CORNERS];
    let mut sum = 0.0;
    let mut first = 1;
    while first + 1 < corners.len() {
        let count = (corners.len() - first).min(FAN_CORNERS - 1);
        fan[1..=count].copy_from_slice(&corners[first..first + count]);
        sum += factor(&fan[..=count]);
        first += count - 1;
    }
    sum
}

/// A polygon seen from the receiver, which is the origin.
struct Relative {
    corners: [DVec3; CLIPPED_CORNERS],
    len: usize,
}

impl Relative {
    /// None where the receiver is behind the polygon or in its plane: light leaves no surface sideways.
    fn facing(position: DVec3, fan: &[DVec3]) -> Option<Self> {
        let mut area_vector = DVec3::ZERO;
        for edge in fan[1..].windows(2) {
            area_vector += (edge[0] - fan[0]).cross(edge[1] - fan[0]);
        }
        let depth = area_vector.dot(fan[0] - position);
        if depth >= 0.0 || depth.is_nan() {
            return None;
        }
        let mut corners = [DVec3::ZERO; CLIPPED_CORNERS];
        for (to, from) in corners.iter_mut().zip(fan) {
            *to = *from - position;
        }
        Some(Self { corners, len: fan.len() })
    }

    fn corners(&self) -> &[DVec3] {
        &self.corners[..self.len]
    }

    /// Keeps the part above the plane through the origin with this normal; false when nothing is left.
    fn clip(&mut self, normal: DVec3) -> bool {
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in self.corners() {
            let height = corner.dot(normal);
            lowest = lowest.min(height);
            highest = highest.max(height);
        }
        if lowest < 0.0 && highest > 0.0 {
            self.cut(normal);
        }
        highest > 0.0 && self.len > 2
    }

    /// Sutherland & Hodgman 1974, for one plane.
    #[cold]
    fn cut(&mut self, normal: DVec3) {
        let whole = self.corners;
        let height = whole.map(|corner| corner.dot(normal));
        let count = self.len;
        let mut kept = 0;
        let mut previous = count - 1;
        for current in 0..count {
            if (height[previous] > 0.0) != (height[current] > 0.0) && kept < CLIPPED_CORNERS {
                // From the lower end always, so that two polygons with a common edge cut it at the same point.
                let (low, high) = if height[previous] < height[current] {
                    (previous, current)
                } else {
                    (current, previous)
                };
                let along = height[low] / (height[low] - height[high]);
                self.corners[kept] = whole[low] + (whole[high] - whole[low]) * along;
                kept += 1;
            }
            if height[current] > 0.0 && kept < CLIPPED_CORNERS {
                self.corners[kept] = whole[current];
                kept += 1;
            }
            previous = current;
        }
        self.len = kept;
    }

    /// The configuration factor of what is left, all of it above the horizon.
    fn factor(&self, normal: DVec3) -> f64 {
        let corners = self.corners();
        if is_far(corners) { far_rule(corners, normal) } else { lambert(corners, normal) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lambert::test_numbers::Numbers;
    use super::*;
    use glam::dvec3;

    const UP: DVec3 = DVec3::Z;

    /// A rectangle at z = `height` facing down.
    fn ceiling(x: [f64; 2], y: [f64; 2], height: f64) -> [DVec3; 4] {
        [
            dvec3(x[0], y[0], height),
            dvec3(x[0], y[1], height),
            dvec3(x[1], y[1], height),
            dvec3(x[1], y[0], height),
        ]
    }

    /// The six faces of the cube `[0, 1]³`, facing inwards.
    fn cube() -> [[DVec3; 4]; 6] {
        let ceiling = ceiling([0.0, 1.0], [0.0, 1.0], 1.0);
        let turn = |p: DVec3| dvec3(p.y, p.z, p.x);
        let mirror = |p: DVec3| 1.0 - p;
        let reversed = |face: [DVec3; 4]| [face[3], face[2], face[1], face[0]];
        let x = ceiling.map(turn);
        let y = x.map(turn);
        [ceiling, x, y, reversed(ceiling.map(mirror)), reversed(x.map(mirror)), reversed(y.map(mirror))]
    }

    #[test]
    fn a_room_is_all_that_a_point_inside_sees() {
        let mut numbers = Numbers(3);
        for _ in 0..20_000 {
            let position = dvec3(numbers.next(), numbers.next(), numbers.next());
            let normal = numbers.direction();
            let sum: f64 = cube().iter().map(|face| point_to_polygon(position, normal, face)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{position} {normal}: {sum}");
        }
    }

    #[test]
    fn cutting_a_polygon_changes_nothing() {
        let mut numbers = Numbers(4);
        for _ in 0..20_000 {
            let cut = numbers.next();
            let height = 10f64.powf(2.0 - 8.0 * numbers.next());
            let position = dvec3(numbers.next() * 3.0 - 1.0, numbers.next() * 3.0 - 1.0, 0.0);
            let normal = (numbers.direction() + UP).normalize();
            let factor = |x| point_to_polygon(position, normal, &ceiling(x, [0.0, 1.0], height));
            let (whole, parts) = (factor([0.0, 1.0]), factor([0.0, cut]) + factor([cut, 1.0]));
            // Where far rules take part they are off by 1e-5 at most.
            assert!((whole - parts).abs() <= 2e-5 * whole + 1e-15, "{whole} {parts}");
        }
    }

    #[test]
    fn degenerate_polygons_and_receivers_give_zero() {
        let square = ceiling([0.0, 1.0], [0.0, 1.0], 1.0);
        let back: Vec<_> = square.iter().rev().copied().collect();
        let below = dvec3(0.3, 0.4, 0.0);
        let zero = |position, normal, corners: &[DVec3]| {
            assert_eq!(point_to_polygon(position, normal, corners).to_bits(), 0, "{position} {corners:?}");
        };
        zero(below, UP, &back);
        zero(below, -UP, &square);
        zero(dvec3(3.0, 0.5, 1.0), UP, &square);
        zero(dvec3(0.5, 0.5, 1.0), UP, &square);
        zero(below, UP, &[]);
        zero(below, UP, &square[..2]);
        zero(below, UP, &[UP, UP, UP]);
        zero(below, UP, &[UP, UP + DVec3::X, UP + DVec3::X * 3.0, UP + DVec3::X * 2.0]);
        zero(below * f64::NAN, UP, &square);
        zero(below, UP * f64::NAN, &square);
        zero(below, UP, &[UP, UP * f64::INFINITY, DVec3::NAN]);
    }

    /// A point on an edge, on a corner or on the line of an edge sees no angle along that edge.
    #[test]
    fn touching_edges_are_finite_and_continuous() {
        let wall = [dvec3(0., -1e3, 0.), dvec3(0., 1e3, 0.), dvec3(0., 1e3, 1e3), dvec3(0., -1e3, 1e3)];
        for (distance, expected) in [(1e-3, 0.5), (1e-9, 0.5), (1e-100, 0.5)] {
            let factor = point_to_polygon(dvec3(distance, 0.0, 0.0), UP, &wall);
            // What is missing to a half is the part of the plane that the wall does not cover.
            assert!((factor - expected).abs() < distance / 1e3 + 1e-15, "{distance}: {factor}");
        }
        let square = ceiling([0.0, 1.0], [0.0, 1.0], 1.0);
        for on_edge in
            [dvec3(0.0, 0.0, 1.0), dvec3(0.5, 0.0, 1.0), dvec3(0.0, 0.25, 1.0), dvec3(0.0, 7.0, 1.0)]
        {
            assert_eq!(point_to_polygon(on_edge, UP, &square), 0.0);
        }
        // On the line of one edge, in front of the plane.
        let needle = [dvec3(0., 0., 1.), dvec3(0., 1., 3.), dvec3(1., 0., 2.)];
        let below = dvec3(0.0, 0.0, 0.0);
        let near = point_to_polygon(below + dvec3(1e-12, 1e-12, 0.0), UP, &needle);
        assert!((point_to_polygon(below, UP, &needle) - near).abs() < 1e-11);
    }

    #[test]
    fn a_receiver_that_touches_the_lamp_sees_it_alone() {
        for height in [1e-3, 1e-6, 1e-12, 1e-100] {
            let square = ceiling([-0.5, 0.5], [-0.5, 0.5], height);
            let factor = point_to_polygon(DVec3::ZERO, UP, &square);
            assert!(factor <= 1.0 && factor > 1.0 - 5.0 * height * height - 1e-15, "{height}: {factor}");
        }
    }

    #[test]
    fn a_thousand_corners_are_a_disc() {
        // A disc of radius 1/2, 2 above the receiver, 1 off its axis.
        let count = 4000;
        let disc: Vec<_> = (0..count)
            .map(|i| {
                let (sine, cosine) = (-std::f64::consts::TAU * f64::from(i) / f64::from(count)).sin_cos();
                dvec3(0.5 * cosine, 0.5 * sine, 2.0)
            })
            .collect();
        let factor = point_to_polygon(dvec3(1.0, 0.0, 0.0), UP, &disc);
        let z: f64 = 1.0 + 2.0 * 2.0 + 0.5 * 0.5;
        let exact = 0.5 * (1.0 - (z - 2.0 * 0.25) / (z * z - 4.0 * 0.25).sqrt());
        // The polygon lacks a share 2π²/(3n²) = 4e-7 of the disc's area.
        assert!((factor / exact - 1.0).abs() < 1e-6, "{factor} {exact}");
    }

    #[test]
    fn size_does_not_matter_to_the_bit() {
        let mut numbers = Numbers(5);
        for power in [-300, -60, -10, 10, 60, 300] {
            let scale = 2f64.powi(power);
            let position = dvec3(numbers.next(), numbers.next(), 0.0);
            let square = ceiling([0.0, 2.0], [0.0, 1.0], numbers.next());
            let factor = point_to_polygon(position, UP, &square);
            let scaled = point_to_polygon(position * scale, UP, &square.map(|corner| corner * scale));
            // Fourth powers of lengths must stay inside f64.
            if power.abs() < 240 {
                assert_eq!(factor, scaled);
            } else {
                assert!(scaled.is_finite());
            }
        }
    }

    #[test]
    fn two_horizons_leave_what_both_leave() {
        let mut numbers = Numbers(6);
        let square = ceiling([-1.0, 1.0], [-1.0, 1.0], 0.5);
        for _ in 0..1000 {
            let (geometric, shading) = (numbers.direction(), numbers.direction());
            let shaded = point_to_polygon_shaded(DVec3::ZERO, geometric, shading, &square);
            assert!(shaded <= point_to_polygon(DVec3::ZERO, shading, &square) + 1e-15);
            let same = point_to_polygon_shaded(DVec3::ZERO, shading, shading, &square);
            assert!((same - point_to_polygon(DVec3::ZERO, shading, &square)).abs() < 1e-15);
        }
    }
}
