//! Wide instructions change nothing but the time.

use super::shapes::{Random, soup, tries};
use crate::transport::build::Binary;
use crate::transport::lanes::Processor;
use crate::transport::traverse::{Ask, Solid};
use crate::transport::tree::Tree;
use crate::transport::{Hit, Ray};
use glam::Vec3;

fn bits(hit: Option<Hit>) -> Option<[u32; 5]> {
    hit.map(|h| [h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits(), u32::from(h.front)])
}

fn random_ray(random: &mut Random, scale: f32) -> Ray {
    let origin = random.cube() * 1.5 * scale;
    let mut direction = random.direction();
    if random.bits().is_multiple_of(4) {
        direction[random.bits() as usize % 3] = [0.0, -0.0, 1e-20, -1e-9][random.bits() as usize % 4];
        direction = direction.normalize();
    }
    let t_max = if random.bits().is_multiple_of(2) { f32::INFINITY } else { random.unit() * 3.0 * scale };
    Ray { origin, direction, t_max }
}

/// Every bit of every answer, also where triangles are asked, with and without a tree, in small and large worlds.
/// (Where the processor has no wide instructions both are the same lanes.)
#[test]
fn all_processors_give_the_same_bits() {
    let mut random = Random::new(21);
    let shapes = [(3, 1.0), (48, 0.5), (49, 0.5), (700, 0.3), (20_000, 0.05)];
    let shapes = &shapes[..tries(5, 3)];
    for ((count, size), scale) in shapes.iter().flat_map(|&s| [1e-4, 1.0, 1e7].map(|scale| (s, scale))) {
        let corners: Vec<[Vec3; 3]> =
            soup(&mut random, count, size).into_iter().map(|t| t.map(|c| c * scale)).collect();
        let all: Vec<u32> = (0..count as u32).collect();
        let best = Tree::new(&Binary::new(&corners, &all), &corners, |t| t % 3 == 0);
        let mut portable = best.clone();
        portable.processor = Processor::Portable;
        // Lets two of three rays pass, by a rule that looks at the whole hit.
        let solid = |hit: &Hit| (hit.t.to_bits() ^ hit.u.to_bits()).is_multiple_of(3);
        for _ in 0..tries(4000, 6) {
            let ray = random_ray(&mut random, scale);
            let t_min = if random.bits().is_multiple_of(2) { 0.0 } else { random.unit() * scale };
            let closest = |tree: &Tree| {
                (bits(tree.closest(&ray, t_min, Solid)), bits(tree.closest(&ray, t_min, Ask(solid))))
            };
            assert_eq!(closest(&best), closest(&portable), "{count} {ray:?}");
            let any = |tree: &Tree| {
                let mut product = 1.0f32;
                let mut seen = |hit: &Hit| {
                    product *= 1.0 - 0.5 * hit.u;
                    product < 0.2
                };
                let asked = tree.any(&ray, Ask(&mut seen));
                (tree.any(&ray, Solid), asked, product.to_bits())
            };
            assert_eq!(any(&best), any(&portable), "{count} {ray:?}");
        }
    }
}
