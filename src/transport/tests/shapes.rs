//! Meshes and rays for the tests, from a fixed sequence.

use super::super::{Hit, Ray, World};
use crate::transport::shear::Sheared;
use crate::transport::tree::LANES;
use glam::{DVec3, Vec3};

/// PCG32 (O'Neill 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }

    /// In `[0, 1)`.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }

    /// In `[-1, 1)` per axis.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            if v.length_squared() > 0.01 && v.length_squared() <= 1.0 {
                return v.as_dvec3().normalize().as_vec3();
            }
        }
    }
}

/// Triangles of random place and shape in a unit cube.
pub fn soup(random: &mut Random, count: usize, size: f32) -> Vec<[Vec3; 3]> {
    (0..count)
        .map(|_| {
            let middle = random.cube();
            [0; 3].map(|_| middle + random.cube() * size)
        })
        .collect()
}

/// The nearest hit by the same triangle test, every triangle tried; ties to the lowest index.
pub fn brute_force(world: &World, ray: &Ray) -> Option<Hit> {
    let sheared = Sheared::new(ray)?;
    let mut met = Vec::new();
    for leaf in world.tree.leaves() {
        for k in 0..leaf.count() {
            met.extend(sheared.meet(leaf.block(k / LANES * LANES), k % LANES));
        }
    }
    let met = met.into_iter().map(|meeting| meeting.to_hit(&sheared));
    let nearer = |a: &Hit, b: &Hit| (a.t, a.triangle).partial_cmp(&(b.t, b.triangle)).unwrap();
    met.filter(|hit| hit.t < ray.t_max).min_by(nearer)
}

/// Distance to a triangle by Cramer's rule in f64 with the smallest weight: an independent answer.
pub fn independent(ray: &Ray, corners: &[Vec3; 3]) -> Option<(f64, f64)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (e, f, s): (DVec3, DVec3, DVec3) = (b - a, c - a, o - a);
    let det = e.dot(d.cross(f));
    let v = s.dot(d.cross(f)) / det;
    let w = d.dot(s.cross(e)) / det;
    let t = f.dot(s.cross(e)) / det;
    let inside = v.min(w).min(1.0 - v - w);
    (det != 0.0 && inside >= 0.0 && t > 0.0).then_some((t, inside))
}
