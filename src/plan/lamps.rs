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
}

/// For every lamp why it is left out, if it is.
pub(super) fn idle(scene: &Scene, sides: &[Sides], rooms: &Rooms, seen: &[u32]) -> Vec<Option<Idle>> {
    let lit = |surface: usize| sides[surface].front != Side::Dark || sides[surface].back != Side::Dark;
    let boxes: Vec<(usize, [DVec3; 2])> = (0..scene.surfaces.len())
        .filter(|&surface| lit(surface))
        .map(|surface| (surface, bounds(&scene.surfaces[surface].position_world)))
        .collect();
    scene
        .lamps
        .iter()
        .zip(&rooms.of_lamp)
        .map(|(lamp, within)| match lamp.kind {
            LampKind::Sun { irradiance, .. } if irradiance.0.max_element() <= 0.0 => Some(Idle::Black),
            LampKind::Point { intensity, .. } if intensity.0.max_element() <= 0.0 => Some(Idle::Black),
            _ if !meet(within, seen) => Some(Idle::SealedOff),
            LampKind::Sun { .. } => None,
            LampKind::Point { position_world, range_m, cone, .. } => {
                let reached = |&(surface, bounds): &(usize, [DVec3; 2])| {
                    rooms.of_side[surface].iter().any(|side| meet(side, within))
                        && in_reach(position_world, range_m, cone.as_ref(), bounds)
                };
                (!boxes.iter().any(reached)).then_some(Idle::OutOfReach)
            }
        })
        .collect()
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
    let slack = 0.05 * low.distance(high) + 1e-5 * position.abs().max_element();
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
