//! Where rays start and end on surfaces, from the rounding errors there are and no others.
//!
//! With u = 2⁻²⁴ the unit roundoff of f32, all to first order:
//! - A position `a + (b − a)v + (c − a)w` computed in f32 leaves its plane by at most 10um per axis, m being the
//!   largest coordinate of that axis among the corners and the point: each difference is off by 2um, its product by
//!   as much, each of the two sums by um. Corners that were rounded once, after the scene's origin was subtracted
//!   in f64, add um for positions that were found from the exact ones. Adding the offset rounds once more, um.
//!   Together 12um per axis.
//! - The hit test sees each corner moved sideways by at most 2u|A_x| + 4u|A_z|, A being the corner minus the ray's
//!   origin (see `shear`): at most 6ur per axis, r being the largest |A| of any axis. The test is exact otherwise.
//!
//! Along the unit normal n these are at most `u Σ |n_k| (12 m_k + 6 r)`: a ray that starts that far above its plane
//! and leads away from it does not meet it. Nothing is excluded by name and there is no smallest distance.

use super::Ray;
use super::shear::UNIT;
use glam::Vec3;

/// The start of a ray that leaves a triangle: `position`, a point of the triangle, moved to the side of
/// `normal_geometric` (unit) by the bound above. Metres.
pub fn offset_origin(position: Vec3, normal_geometric: Vec3, corners: &[Vec3; 3]) -> Vec3 {
    raised(position, normal_geometric, corners, position)
}

/// The ray from one point to another, neither of them on a surface (or already moved off it).
///
/// `t_max` ends 8u of the distance early, for the rounding of the direction and the distance themselves. Points
/// that coincide give a ray that meets nothing.
pub fn segment(from: Vec3, to: Vec3) -> Ray {
    let toward = to - from;
    let distance = toward.length();
    if distance > 0.0 && distance.is_finite() {
        Ray { origin: from, direction: toward / distance, t_max: distance * (1.0 - 8.0 * UNIT) }
    } else {
        Ray { origin: from, direction: Vec3::Z, t_max: 0.0 }
    }
}

/// The ray from a point to a point of a triangle, ending before that triangle.
///
/// The end is moved to the side of `normal_geometric` (unit, towards `from`) by the bound above, r being taken from
/// `from`, where the hit test stands, and 4u of the distance more per axis for the rounding of the direction.
pub fn segment_to_surface(from: Vec3, to: Vec3, normal_geometric: Vec3, corners: &[Vec3; 3]) -> Ray {
    segment(from, raised(to, normal_geometric, corners, from))
}

/// `position` raised above its triangle so far that a ray from `viewer` tells the two apart.
fn raised(position: Vec3, normal: Vec3, corners: &[Vec3; 3], viewer: Vec3) -> Vec3 {
    let coordinate = corners.iter().fold(position.abs(), |most, c| most.max(c.abs()));
    let reach = corners.iter().fold(0.0f32, |most, &c| most.max((c - viewer).abs().max_element()));
    let travel = (position - viewer).abs().max_element();
    let per_axis = coordinate * 12.0 + Vec3::splat(6.0 * reach + 7.0 * travel);
    position + normal * (UNIT * normal.abs().dot(per_axis))
}
