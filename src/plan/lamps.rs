//! Which lamps light anything that counts.

use super::rooms::{Rooms, meet};
use super::{Side, Sides};
use crate::scene::{Cone, LampKind, Scene};
use glam::{DVec3, Vec3};

/// Why a lamp is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Idle {
    /// It sends no light.
    Black,
    /// It is sealed off from all that is lightmapped.
    SealedOff,
    /// Its range ends, or its cone passes by, before anything is lit.
    OutOfReach,
    /// It is behind the plane of every triangle that takes light.
    FacingAway,
}

/// The most triangles that are asked whether lamps are behind them, all lamps together.
const MOST_PLANES: usize = 100_000_000;
/// How far elements stray from their triangles, as a share of the object: on curved surfaces by the bulge of the shape.
const BULGE: f64 = 0.05;
/// The same by rounding, as a share of the coordinates.
const ROUNDING: f64 = 1e-5;

/// For every lamp why it is left out, if it is.
pub(super) fn idle(scene: &Scene, sides: &[Sides], rooms: &Rooms, seen: &[u32]) -> Vec<Option<Idle>> {
    let lit = |surface: usize| sides[surface].front != Side::Dark || sides[surface].back != Side::Dark;
    let boxes: Vec<(usize, [DVec3; 2])> = (0..scene.surfaces.len())
        .filter(|&surface| lit(surface))
        .map(|surface| (surface, bounds(&scene.surfaces[surface].position_world)))
        .collect();
    let mut planes = MOST_PLANES;
    let mut in_front =
        |lamp: &LampKind, within: &[u32]| is_in_front(scene, sides, rooms, lamp, within, &mut planes);
    scene
        .lamps
        .iter()
        .zip(&rooms.of_lamp)
        .map(|(lamp, within)| match lamp.kind {
            LampKind::Sun { irradiance, .. } if irradiance.0.max_element() <= 0.0 => Some(Idle::Black),
            LampKind::Point { intensity, .. } if intensity.0.max_element() <= 0.0 => Some(Idle::Black),
            _ if !meet(within, seen) => Some(Idle::SealedOff),
            LampKind::Sun { .. } => (!in_front(&lamp.kind, within)).then_some(Idle::FacingAway),
            LampKind::Point { position_world, range_m, cone, .. } => {
                let reached = |&(surface, bounds): &(usize, [DVec3; 2])| {
                    rooms.of_side[surface].iter().any(|side| meet(side, within))
                        && in_reach(position_world, range_m, cone.as_ref(), bounds)
                };
                match boxes.iter().any(reached) {
                    false => Some(Idle::OutOfReach),
                    true => (!in_front(&lamp.kind, within)).then_some(Idle::FacingAway),
                }
            }
        })
        .collect()
}

/// Whether any part of a lamp is in front of any triangle that takes light in its rooms, or so it seems: light from
/// behind a triangle's plane does not count, wherever its shading normal points.
fn is_in_front(
    scene: &Scene,
    sides: &[Sides],
    rooms: &Rooms,
    lamp: &LampKind,
    within: &[u32],
    planes: &mut usize,
) -> bool {
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let lit = |side: usize| {
            sides[index].both()[side] != Side::Dark && meet(&rooms.of_side[index][side], within)
        };
        let lit = [lit(0), lit(1)];
        if lit == [false; 2] {
            continue;
        }
        let geometry = scene.geometry(surface);
        let Some(left) = planes.checked_sub(geometry.triangles.len()) else { return true };
        *planes = left;
        let [low, high] = bounds(&surface.position_world);
        let coordinate = low.abs().max(high.abs()).max_element();
        let slack = ROUNDING * coordinate + if geometry.smooth { BULGE * low.distance(high) } else { 0.0 };
        for triangle in 0..geometry.triangles.len() as u32 {
            let [a, b, c] = scene.corners_world(surface, triangle).map(|corner| corner.as_dvec3());
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            // How far in front it is, and how far parts of it may be.
            let (height, reach) = match *lamp {
                LampKind::Sun { toward_world, angle_rad, .. } => (
                    normal.dot(toward_world.as_dvec3()),
                    f64::from((angle_rad / 2.0).clamp(0.0, 1.5)).sin() + ROUNDING,
                ),
                LampKind::Point { position_world, radius_m, .. } => {
                    let to = position_world.as_dvec3() - a;
                    (normal.dot(to), f64::from(radius_m.max(0.0)) + slack + ROUNDING * to.abs().max_element())
                }
            };
            // What is not a number may be anywhere.
            let behind = |height: f64| height <= -reach;
            if lit[0] && !behind(height) || lit[1] && !behind(-height) {
                return true;
            }
        }
    }
    false
}

fn bounds(points: &[Vec3]) -> [DVec3; 2] {
    let finite = points.iter().filter(|p| p.is_finite()).map(|p| p.as_dvec3());
    finite.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}

/// Whether the lamp's light gets to any point of a box, or so it seems.
fn in_reach(position: Vec3, range_m: Option<f32>, cone: Option<&Cone>, [low, high]: [DVec3; 2]) -> bool {
    if low.x > high.x {
        return false;
    }
    let position = position.as_dvec3();
    // Elements lie off their triangles by rounding, and on curved surfaces by the bulge of the shape.
    let slack = BULGE * low.distance(high) + ROUNDING * position.abs().max_element();
    let nearest = position.clamp(low, high).distance(position) - slack;
    if range_m.is_some_and(|range| range > 0.0 && nearest > f64::from(range)) {
        return false;
    }
    let Some(cone) = cone else { return true };
    let (middle, radius) = ((low + high) / 2.0, low.distance(high) / 2.0 + slack);
    let to = middle - position;
    let distance = to.length();
    if distance <= radius {
        return true;
    }
    let off_axis = (cone.direction_world.as_dvec3().dot(to) / distance).clamp(-1.0, 1.0).acos();
    off_axis - (radius / distance).asin() <= f64::from(cone.outer_rad) + 1e-4
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SpotFalloff;

    #[test]
    fn range_and_cone_end_where_they_end() {
        let unit = [DVec3::splat(-0.5), DVec3::splat(0.5)];
        let at = Vec3::X * 4.0;
        assert!(in_reach(at, None, None, unit) && in_reach(at, Some(3.6), None, unit));
        assert!(!in_reach(at, Some(3.3), None, unit));
        let cone = |direction_world| Cone {
            direction_world,
            inner_rad: 0.1,
            outer_rad: 0.2,
            falloff: SpotFalloff::Blender,
        };
        assert!(in_reach(at, None, Some(&cone(-Vec3::X)), unit));
        assert!(!in_reach(at, None, Some(&cone(Vec3::Y)), unit));
        assert!(in_reach(Vec3::ZERO, None, Some(&cone(Vec3::Y)), unit), "from inside");
    }
}
