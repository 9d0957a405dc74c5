//! No ray leaves a closed mesh.

use super::shapes::{Random, cube, icosphere, placed, tries};
use crate::transport::lanes::Processor;
use crate::transport::{OpaqueTracer, Ray, Tracer, World};
use glam::{DVec3, Vec3};

/// Sizes of the meshes in metres, and how far they stand from the origin in their own sizes.
const SCALES: [f64; 5] = [1e-3, 0.037, 1.0, 1234.5, 1e6];
const AWAY: [f64; 3] = [0.0, 3.0, 700.0];

/// Where on a triangle rays are aimed: corners, points of edges, and of the inside.
fn target(random: &mut Random, [a, b, c]: [Vec3; 3]) -> Vec3 {
    match random.bits() % 8 {
        0..3 => a,
        3..7 => a + (b - a) * random.unit(),
        _ => a + (b - a) * (0.5 * random.unit()) + (c - a) * (0.5 * random.unit()),
    }
}

/// Rays from inside, most of them to corners and edges, an eighth of them along the axes through corners.
fn leaks(world: &World, random: &mut Random, middle: Vec3, inner: f32, count: usize) -> usize {
    let tracer = OpaqueTracer::new(world);
    let mut lost = 0;
    for _ in 0..count {
        let corners = world.corners(random.bits() % world.len() as u32);
        let origin = middle + random.cube() * inner;
        let ray = if random.bits().is_multiple_of(8) {
            // From the plane through the middle, where the corner is above it.
            let axis = random.bits() as usize % 3;
            let mut origin = corners[0];
            origin[axis] = middle[axis];
            let mut direction = Vec3::ZERO;
            direction[axis] = (corners[0][axis] - middle[axis]).signum();
            if direction[axis] * (corners[0][axis] - middle[axis]) < inner {
                continue;
            }
            Ray::unbounded(origin, direction)
        } else {
            let toward = (target(random, corners) - origin).as_dvec3();
            Ray::unbounded(origin, toward.normalize().as_vec3())
        };
        let closed = tracer.closest(&ray).is_some_and(|hit| hit.t.is_finite());
        lost += usize::from(!closed || !tracer.occluded(&ray));
    }
    lost
}

/// A million rays and more; the portable lanes get a tenth of them.
#[test]
fn no_ray_leaves_a_closed_mesh() {
    let mut random = Random::new(11);
    // Meshes with and without a tree. Points of the inner cube are inside the mesh with room to spare.
    let meshes =
        [("cube", cube(), 0.5), ("icosahedron", icosphere(0), 0.4), ("sphere", icosphere(tries(3, 1)), 0.5)];
    for (name, mesh, inner) in &meshes {
        for scale in SCALES {
            for &away in &AWAY[..tries(3, 1)] {
                let middle = DVec3::new(1.0, -0.6, 0.3) * away * scale;
                let mut world = World::opaque(placed(mesh, scale, middle));
                let inner = (inner * scale) as f32;
                let what = format!("{name} of {scale} m, {away} sizes away");
                assert_eq!(
                    leaks(&world, &mut random, middle.as_vec3(), inner, tries(24_000, 6)),
                    0,
                    "{what}"
                );
                world.tree.processor = Processor::Portable;
                assert_eq!(
                    leaks(&world, &mut random, middle.as_vec3(), inner, tries(2_400, 3)),
                    0,
                    "{what}, portable"
                );
            }
        }
    }
}

/// Rays along the diagonals of squares, where both triangles and both of their shared corners are at stake.
#[test]
fn no_ray_passes_a_grid_of_squares() {
    let corner = |x: i32, y: i32| Vec3::new(x as f32, y as f32, 0.0) * 0.1;
    let square = |x: i32, y: i32| {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        [[a, b, c], [a, c, d]]
    };
    let half = tries(10, 3) as i32;
    let grid = (-half..half).flat_map(|x| (-half..half).flat_map(move |y| square(x, y)));
    let world = World::opaque(grid.collect());
    let tracer = OpaqueTracer::new(&world);
    let along = || (1 - half..half).step_by(tries(1, 2));
    for (x, y) in along().flat_map(|x| along().map(move |y| (x, y))) {
        for (k, direction) in
            [Vec3::NEG_Z, Vec3::new(-0.0, 0.0, -1.0), Vec3::new(1e-30, -1e-30, -1.0)].into_iter().enumerate()
        {
            // Straight above the corner and points of the diagonal; sums of tenths are not tenths.
            for share in [0.0, 0.25, 0.5] {
                let from = corner(x, y).lerp(corner(x + 1, y + 1), share) + Vec3::Z * 5.0;
                let ray = Ray::unbounded(from, direction);
                assert!(tracer.closest(&ray).is_some() && tracer.occluded(&ray), "{x} {y} {k} {share}");
            }
        }
    }
}
