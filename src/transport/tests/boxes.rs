//! No box is missed that holds a triangle the hit test meets.

use super::shapes::{Random, tries};
use crate::transport::Ray;
use crate::transport::build::{Binary, padded};
#[cfg(target_arch = "x86_64")]
use crate::transport::lanes::Avx2;
use crate::transport::lanes::{Lanes, Portable, Processor};
use crate::transport::shear::{Sheared, Slabs};
use crate::transport::tree::{Node, Tree, WIDTH};
use glam::Vec3;

/// Triangles that touch their boxes' faces and corners: half of them lie in planes of two axes, with legs along both.
fn triangles(random: &mut Random, scale: f32) -> Vec<[Vec3; 3]> {
    let one = |k: usize| {
        let corner = random.cube() * scale;
        let size = scale * 10.0f32.powf(-4.0 * random.unit());
        if k < WIDTH / 2 {
            let mut legs = [Vec3::ZERO; 2];
            legs[0][k % 3] = size * random.unit();
            legs[1][(k + 1) % 3] = size * random.unit();
            [corner, corner + legs[0], corner + legs[1]]
        } else {
            [corner, corner + random.cube() * size, corner + random.cube() * size]
        }
    };
    (0..WIDTH).map(one).collect()
}

fn node_over(corners: &[[Vec3; 3]]) -> Node {
    let mut node = Node::EMPTY;
    for (k, triangle) in corners.iter().enumerate() {
        let (low, high) = padded(triangle);
        for axis in 0..3 {
            (node.bounds[2 * axis][k], node.bounds[2 * axis + 1][k]) = (low[axis], high[axis]);
        }
    }
    node
}

/// A ray to a corner or a point of an edge, from near and far, a quarter of them almost along a plane of two axes.
fn ray_to(random: &mut Random, [a, b, _]: [Vec3; 3], scale: f32) -> Ray {
    let target = if random.bits().is_multiple_of(2) { a } else { a + (b - a) * random.unit() };
    let mut toward = random.direction();
    if random.bits().is_multiple_of(4) {
        toward[random.bits() as usize % 3] *= [0.0, 1e-9, 1e-7, 1e-6, 1e-5][random.bits() as usize % 5];
    }
    let from_afar = target - toward * (scale * 10.0f32.powf(3.0 * random.unit() - 2.0));
    // At the world's origin no rounding of the origin's coordinates hides what the boxes lack.
    let origin = if random.bits().is_multiple_of(2) { random.cube() * 1e-6 * scale } else { from_afar };
    Ray::unbounded(origin, (target - origin).as_dvec3().normalize().as_vec3())
}

#[test]
fn boxes_hold_what_the_hit_test_meets() {
    let mut random = Random::new(41);
    let (mut met, all): (usize, Vec<u32>) = (0, (0..WIDTH as u32).collect());
    for scale in [1e-3, 1.0, 1e6] {
        for _ in 0..tries(500, 2) {
            let corners = triangles(&mut random, scale);
            let tree = Tree::new(&Binary::new(&corners, &all), &corners, |_| false);
            let (node, block) = (node_over(&corners), tree.tiny().block(0));
            for _ in 0..tries(400, 20) {
                let triangle = corners[random.bits() as usize % WIDTH];
                let ray = ray_to(&mut random, triangle, scale);
                let sheared = Sheared::new(&ray).unwrap();
                let slabs = Slabs::new(&ray);
                for lane in 0..WIDTH {
                    let Some(hit) = sheared.meet(block, lane) else { continue };
                    let (k, what) =
                        (block.id(lane), format!("{ray:?} to {:?}", corners[block.id(lane) as usize]));
                    let (mask, enters) = Portable::enter(&Portable::boxes(&slabs), &node, 0.0, hit.t);
                    assert!(mask >> k & 1 != 0 && enters[k as usize] <= hit.t, "{what}");
                    met += 1;
                    #[cfg(target_arch = "x86_64")]
                    if Processor::detect() == Processor::Avx2 {
                        let (mask, enters) = Avx2::enter(&Avx2::boxes(&slabs), &node, 0.0, hit.t);
                        assert!(mask >> k & 1 != 0 && enters[k as usize] <= hit.t, "{what}, AVX2");
                    }
                }
            }
        }
    }
    // Corners and edges are met by about half of the rays: the target itself was rounded.
    assert!(met > tries(500 * 400, 2 * 20), "{met}");
}
