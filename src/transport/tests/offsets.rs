//! Rays start and end on surfaces without meeting them, in millimetres and in thousands of kilometres.

use super::shapes::{Random, cube, icosphere, placed, tries};
use crate::transport::{OpaqueTracer, Ray, Tracer, World, segment_to_surface};
use glam::{DVec3, Vec3};

const SCALES: [f64; 4] = [1e-3, 1.0, 555.5, 1e6];
const AWAY: [f64; 3] = [0.0, 3.0, 700.0];

/// A point of a triangle, computed as everyone does, and the normal that faces in.
fn point(random: &mut Random, world: &World) -> (u32, Vec3, Vec3) {
    let triangle = random.bits() % world.len() as u32;
    let [a, b, c] = world.corners(triangle);
    let (mut u, mut v) = (random.unit(), random.unit());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    // Off the edges: beside a neighbour, a point raised above its own plane is under the other's.
    let keep = |x: f32| 0.01 + 0.97 * x;
    (triangle, a + (b - a) * keep(u) + (c - a) * keep(v), world.normal(triangle))
}

fn rooms() -> impl Iterator<Item = (String, World)> {
    let meshes = [("cube", cube()), ("sphere", icosphere(tries(2, 0)))];
    let places = SCALES.into_iter().flat_map(|scale| AWAY.map(|away| (scale, away)));
    places.flat_map(move |(scale, away)| {
        meshes.clone().map(|(name, mesh)| {
            let middle = DVec3::new(1.0, -0.6, 0.3) * away * scale;
            (format!("{name} of {scale} m, {away} sizes away"), World::opaque(placed(&mesh, scale, middle)))
        })
    })
}

#[test]
fn a_ray_that_leaves_a_surface_does_not_meet_it() {
    let mut random = Random::new(31);
    for (what, world) in rooms() {
        let tracer = OpaqueTracer::new(&world);
        for _ in 0..tries(10_000, 5) {
            let (triangle, position, normal) = point(&mut random, &world);
            let mut direction = random.direction();
            // Half of them graze: up to a thousandth above the plane.
            if random.bits().is_multiple_of(2) {
                direction =
                    (direction - normal * direction.dot(normal) + normal * 1e-3 * random.unit()).normalize();
            }
            if direction.as_dvec3().dot(normal.as_dvec3()) < 1e-6 {
                continue;
            }
            let origin = world.offset_origin(triangle, position, normal);
            let hit = tracer.closest(&Ray::unbounded(origin, direction));
            // From inside a convex room it meets another wall: neither its own nor nothing.
            assert!(hit.is_some_and(|hit| hit.triangle != triangle), "{what}: {hit:?}, {triangle}");
        }
    }
}

#[test]
fn a_segment_to_a_surface_ends_before_it() {
    let mut random = Random::new(32);
    for (what, world) in rooms() {
        let tracer = OpaqueTracer::new(&world);
        for _ in 0..tries(10_000, 5) {
            let (from, start, normal) = point(&mut random, &world);
            let (to, end, normal_end) = point(&mut random, &world);
            let toward = (end - start).as_dvec3().normalize();
            // Of one plane, or nearly so: the segment lies in the surface.
            if toward.dot(normal.as_dvec3()) < 1e-3 || toward.dot(normal_end.as_dvec3()) > -1e-3 {
                continue;
            }
            let origin = world.offset_origin(from, start, normal);
            let ray = segment_to_surface(origin, end, normal_end, &world.corners(to));
            // All points of a convex room see each other.
            assert!(!tracer.occluded(&ray), "{what}: {ray:?} from {from} to {to}");
            // The end stands above the surface by what it was raised and rounded.
            let above = (ray.at(ray.t_max) - end).length();
            let slope = -ray.direction.dot(normal_end);
            let longer = Ray { t_max: ray.t_max + 2.0 * above / slope, ..ray };
            assert!(tracer.occluded(&longer), "{what}: {ray:?} from {from} beyond {to}");
        }
    }
}
