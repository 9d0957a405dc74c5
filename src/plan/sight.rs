//! What surfaces can see at all, as far as planes tell.
//!
//! A triangle stands between two points only if they are on different sides of its plane. So where nothing at all is in
//! front of a triangle's plane, nothing is seen from it and nothing shades it; and where every plane of a room has
//! everything on one side of it, every point of the room sees every other: the room is convex and empty.
//!
//! Where another object touches the plane, rays that graze it meet the other or not as rounding has it: such a side is not called open.

use super::rooms::{Rooms, meet};
use super::{Side, Sides};
use crate::scene::{LampKind, Role, Scene};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The most pairs of a plane and a point that are looked at, all rooms together.
const MOST_PAIRS: usize = 300_000_000;
/// The most different sets of rooms that are looked at.
const MOST_SETS: usize = 64;
/// A point is on a plane within this share of the largest coordinate: what rounding to f32 moves both.
const ON_PLANE: f64 = 4.0 * f32::EPSILON as f64;
/// Beyond these coordinates triangles are not met by rays, metres.
const FARTHEST: f32 = 1e15;

const OPEN: [u8; 2] = [1, 2];
const CLEAR: [u8; 2] = [4, 8];

/// What is known of the view from every triangle, numbered as in [`crate::transport::World`]: surface by surface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sight {
    /// Empty where nothing is known.
    of_triangle: Vec<u8>,
}

impl Sight {
    /// Whether nothing is in front of a side (0 front, 1 back) of a triangle: all its rays leave the scene.
    #[inline]
    pub fn is_open(&self, triangle: u32, side: usize) -> bool {
        self.of_triangle.get(triangle as usize).is_some_and(|bits| bits & OPEN[side] != 0)
    }

    /// Whether nothing stands between a side of a triangle and the lights that reach it.
    #[inline]
    pub fn is_clear(&self, triangle: u32, side: usize) -> bool {
        let bits = OPEN[side] | CLEAR[side];
        self.of_triangle.get(triangle as usize).is_some_and(|known| known & bits != 0)
    }

    /// Without what is known of certain lights only: others are asked as well.
    pub(super) fn open_alone(mut self) -> Self {
        self.of_triangle.iter_mut().for_each(|bits| *bits &= OPEN[0] | OPEN[1]);
        self
    }

    /// Of the sides that take light: how many triangles have one, on how many all of them are open, and are clear.
    pub(super) fn count(&self, scene: &Scene, sides: &[Sides]) -> [usize; 3] {
        let mut count = [0; 3];
        let mut triangle = 0;
        for (surface, sides) in scene.surfaces.iter().zip(sides) {
            for _ in &scene.geometry(surface).triangles {
                for (side, lit) in [sides.front, sides.back].into_iter().enumerate() {
                    if lit != Side::Dark {
                        count[0] += 1;
                        count[1] += usize::from(self.is_open(triangle, side));
                        count[2] += usize::from(self.is_clear(triangle, side));
                    }
                }
                triangle += 1;
            }
        }
        count
    }
}

/// A triangle of the scene with an area.
struct Plane {
    /// World number.
    triangle: u32,
    surface: u32,
    corner: DVec3,
    normal: DVec3,
}

/// Looks at every side that takes light. `lamps` and `sky` tell what shines; `suns_in_sky` whether the sky has parts
/// that are shot like suns.
pub(super) fn sight(
    scene: &Scene,
    sides: &[Sides],
    rooms: &Rooms,
    lamps: &[bool],
    suns_in_sky: bool,
) -> Sight {
    let (planes, triangles) = planes(scene);
    let mut sets: BTreeMap<&[u32], Vec<(u32, usize)>> = BTreeMap::new();
    for (surface, lit) in (0..).zip(sides) {
        for (side, lit) in [lit.front, lit.back].into_iter().enumerate() {
            if lit != Side::Dark {
                sets.entry(&rooms.of_side[surface as usize][side]).or_default().push((surface, side));
            }
        }
    }
    let mut sight = Sight { of_triangle: vec![0; triangles] };
    if sets.len() > MOST_SETS {
        return Sight::default();
    }
    let mut pairs = MOST_PAIRS;
    for (set, receivers) in sets {
        let within = |surface: u32| rooms.of_side[surface as usize].iter().any(|side| meet(side, set));
        let here: Vec<&Plane> = planes.iter().filter(|plane| within(plane.surface)).collect();
        let points = points(scene, &within);
        let Some(found) = look(scene, &here, &points, &mut pairs) else { continue };
        let lamps: Vec<(DVec3, f64)> = scene
            .lamps
            .iter()
            .enumerate()
            .filter(|&(i, _)| lamps[i] && meet(&rooms.of_lamp[i], set))
            .map(|(_, lamp)| match lamp.kind {
                LampKind::Point { position_world, radius_m, .. } => {
                    (position_world.as_dvec3(), f64::from(radius_m))
                }
                // Seen from both sides of some plane, unless there is none.
                LampKind::Sun { .. } => (DVec3::NAN, 0.0),
            })
            .collect();
        let distant =
            lamps.iter().any(|lamp| lamp.0.is_nan()) || suns_in_sky && set.contains(&Rooms::OUTSIDE);
        let one_sided = |(plane, seen): (&&Plane, &Seen)| {
            let beyond = |side: f64| {
                lamps.iter().any(|&(at, radius)| side * plane.normal.dot(at - plane.corner) > -radius)
            };
            !(seen.beyond[0] || beyond(1.0)) || !(seen.beyond[1] || beyond(-1.0))
        };
        let convex = !distant && here.iter().zip(&found).all(one_sided);
        let mut lit: Vec<[bool; 2]> = vec![[false; 2]; scene.surfaces.len()];
        receivers.iter().for_each(|&(surface, side)| lit[surface as usize][side] = true);
        for (plane, seen) in here.iter().zip(&found) {
            let bits = &mut sight.of_triangle[plane.triangle as usize];
            for side in 0..2 {
                if lit[plane.surface as usize][side] {
                    *bits |= if seen.touching[side] { 0 } else { OPEN[side] };
                    *bits |= if convex { CLEAR[side] } else { 0 };
                }
            }
        }
    }
    sight
}

/// Planes of all triangles that rays can meet, and the number of all triangles.
fn planes(scene: &Scene) -> (Vec<Plane>, usize) {
    let mut planes = Vec::new();
    let mut count = 0_usize;
    for (index, surface) in (0..).zip(&scene.surfaces) {
        let triangles = scene.geometry(surface).triangles.len() as u32;
        for triangle in 0..triangles {
            let corners = scene.corners_world(surface, triangle);
            let [a, b, c] = corners.map(|corner| corner.as_dvec3());
            let lawful = corners.iter().all(|corner| corner.abs().max_element() <= FARTHEST);
            let normal =
                (b - a).cross(c - a).try_normalize().filter(|_| lawful && surface.role != Role::Emits);
            planes.extend(normal.map(|normal| Plane {
                triangle: count as u32 + triangle,
                surface: index,
                corner: a,
                normal,
            }));
        }
        count += triangles as usize;
    }
    (planes, count)
}

/// A corner of something.
#[derive(Clone, Copy)]
struct Point {
    at: DVec3,
    /// glTF node.
    owner: usize,
}

/// What there is before and behind a plane.
#[derive(Clone, Copy, Default)]
struct Seen {
    /// Anything in front, behind.
    beyond: [bool; 2],
    /// The same, or another object on the plane.
    touching: [bool; 2],
}

/// Corners of everything within, each once.
fn points(scene: &Scene, within: &dyn Fn(u32) -> bool) -> Vec<Point> {
    let mut bits: Vec<([u32; 3], usize)> = Vec::new();
    for (index, surface) in (0..).zip(&scene.surfaces) {
        if within(index) {
            let lawful = surface.position_world.iter().filter(|p| p.abs().max_element() <= FARTHEST);
            bits.extend(lawful.map(|p| (p.to_array().map(f32::to_bits), surface.origin.node)));
        }
    }
    bits.sort_unstable();
    bits.dedup();
    let point = |(bits, owner): ([u32; 3], usize)| Point {
        at: DVec3::from_array(bits.map(|x| f64::from(f32::from_bits(x)))),
        owner,
    };
    bits.into_iter().map(point).collect()
}

/// What is in front of, and behind, each plane; `None` where that costs too much to find out.
fn look(scene: &Scene, planes: &[&Plane], points: &[Point], pairs: &mut usize) -> Option<Vec<Seen>> {
    let size = points.iter().fold(0.0_f64, |size, p| size.max(p.at.abs().max_element()));
    let near = ON_PLANE * size;
    // Most planes have an extreme point on either side.
    let directions =
        (0..27).map(|i| DVec3::new(f64::from(i % 3 - 1), f64::from(i / 3 % 3 - 1), f64::from(i / 9 - 1)));
    let farthest = |direction: DVec3| {
        let by_reach = |a: &&Point, b: &&Point| direction.dot(a.at).total_cmp(&direction.dot(b.at));
        points.iter().max_by(by_reach).copied()
    };
    let extremes: Vec<Point> = directions.filter_map(farthest).collect();
    let seen = |plane: &Plane, among: &[Point]| {
        let own = scene.surfaces[plane.surface as usize].origin.node;
        let mut seen = Seen::default();
        for point in among {
            let height = plane.normal.dot(point.at - plane.corner);
            let other = point.owner != own;
            for (side, height) in [height, -height].into_iter().enumerate() {
                seen.beyond[side] |= height > near;
                seen.touching[side] |= height > near || other && height >= -near;
            }
            if seen.beyond == [true; 2] {
                break;
            }
        }
        seen
    };
    let mut found: Vec<Seen> = planes.par_iter().map(|plane| seen(plane, &extremes)).collect();
    let open = found.iter().filter(|seen| seen.beyond != [true; 2]).count();
    *pairs = pairs.checked_sub(open.checked_mul(points.len())?)?;
    let unsure = found.par_iter_mut().zip(planes).filter(|(found, _)| found.beyond != [true; 2]);
    unsure.for_each(|(found, plane)| *found = seen(plane, points));
    Some(found)
}
