//! Meshes and rays for the tests, from a fixed sequence.

use super::super::{Hit, Ray, World};
use crate::transport::shear::Sheared;
use crate::transport::tree::LANES;
use glam::{DVec3, Vec3};

/// How often to try: seldom under Miri, which takes thousands of times as long and for which each ray is a trial of
/// every access it makes.
pub fn tries(many: usize, under_miri: usize) -> usize {
    if cfg!(miri) { under_miri } else { many }
}

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

/// The unit sphere of an icosahedron halved `times` times: 20 · 4ⁿ triangles, facing in, corners shared to the bit.
pub fn icosphere(times: usize) -> Vec<[DVec3; 3]> {
    let golden = (1.0 + 5.0f64.sqrt()) / 2.0;
    let corner = |i: usize| {
        let (s, t) = ([-1.0, 1.0][i % 2], [-golden, golden][i / 2 % 2]);
        [DVec3::new(s, t, 0.0), DVec3::new(0.0, s, t), DVec3::new(t, 0.0, s)][i / 4].normalize()
    };
    let mut faces = Vec::new();
    for (a, b, c) in (0..12).flat_map(|a| (a + 1..12).flat_map(move |b| (b + 1..12).map(move |c| (a, b, c))))
    {
        let [p, q, r] = [a, b, c].map(corner);
        let neighbours = |x: DVec3, y: DVec3| x.distance(y) < 1.1;
        if neighbours(p, q) && neighbours(q, r) && neighbours(r, p) {
            let outward = (q - p).cross(r - p).dot(p) > 0.0;
            faces.push(if outward { [p, r, q] } else { [p, q, r] });
        }
    }
    for _ in 0..times {
        let quarters = |[a, b, c]: [DVec3; 3]| {
            let [d, e, f] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        faces = faces.into_iter().flat_map(quarters).collect();
    }
    faces
}

/// The cube from −1 to 1, 12 triangles facing in.
pub fn cube() -> Vec<[DVec3; 3]> {
    let corner = |i: usize| DVec3::new((i % 2) as f64, (i / 2 % 2) as f64, (i / 4) as f64) * 2.0 - 1.0;
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    sides
        .iter()
        .flat_map(|side| [[side[0], side[2], side[1]], [side[0], side[3], side[2]]])
        .map(|t| t.map(corner))
        .collect()
}

/// The mesh scaled, moved and rounded to f32.
pub fn placed(mesh: &[[DVec3; 3]], scale: f64, middle: DVec3) -> Vec<[Vec3; 3]> {
    mesh.iter().map(|corners| corners.map(|c| (middle + c * scale).as_vec3())).collect()
}
