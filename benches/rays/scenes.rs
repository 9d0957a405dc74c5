//! Scenes and rays, from a fixed sequence.

use glam::{DVec3, Vec3};
use lightkiln::transport::{Ray, World, segment_to_surface};
use std::f64::consts::TAU;
use std::path::Path;

/// Triangles with a name.
pub struct Setting {
    pub name: String,
    pub triangles: Vec<[Vec3; 3]>,
}

/// Which rays.
#[derive(Clone, Copy, PartialEq)]
pub enum RayKind {
    /// One cosine-distributed ray from each of many surface points, uniform by area, in random order.
    Scattered,
    /// Sixty-four from each point.
    Gathered,
    /// Between two surface points, any hit, as the direct light asks.
    Shadow,
}

impl RayKind {
    pub const ALL: [Self; 3] = [Self::Scattered, Self::Gathered, Self::Shadow];

    pub fn name(self) -> &'static str {
        match self {
            Self::Scattered => "closest, 1 a point",
            Self::Gathered => "closest, 64 a point",
            Self::Shadow => "any hit",
        }
    }
}

const RAYS: usize = 200_000;

impl Setting {
    pub fn rays(&self, world: &World, kind: RayKind) -> Vec<Ray> {
        let mut random = Random(1);
        let mut total = 0.0;
        let reached: Vec<f64> = (0..world.len() as u32)
            .map(|triangle| {
                total += f64::from(world.area(triangle));
                total
            })
            .collect();
        let point = |random: &mut Random| loop {
            let wanted = random.unit() * total;
            let triangle = reached.partition_point(|&area| area <= wanted) as u32;
            let [a, b, c] = world.corners(triangle);
            let (mut u, mut v) = (random.unit() as f32, random.unit() as f32);
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let normal = world.normal(triangle);
            if normal != Vec3::ZERO {
                return (triangle, a + (b - a) * u + (c - a) * v, normal);
            }
        };
        let mut rays = Vec::with_capacity(RAYS);
        while rays.len() < RAYS {
            let (triangle, position, normal) = point(&mut random);
            let origin = world.offset_origin(triangle, position, normal);
            match kind {
                RayKind::Scattered => rays.push(Ray::unbounded(origin, random.cosine(normal))),
                RayKind::Gathered => {
                    rays.extend((0..64).map(|_| Ray::unbounded(origin, random.cosine(normal))));
                }
                RayKind::Shadow => {
                    let (other, end, normal) = point(&mut random);
                    let toward = normal * normal.dot(origin - end).signum();
                    rays.push(segment_to_surface(origin, end, toward, &world.corners(other)));
                }
            }
        }
        rays
    }
}

/// The scenes built here.
pub fn all() -> Vec<Setting> {
    vec![cornell(), boxes(), hall(), spheres(), leaves()]
}

/// All triangles of a glTF file, taken as opaque.
pub fn from_file(path: &Path) -> Setting {
    let (_, scene) = lightkiln::import::load(path, &Default::default()).expect("the file can be read");
    let world = World::new(&scene);
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Setting { name, triangles: (0..world.len() as u32).map(|t| world.corners(t)).collect() }
}

/// A room with two boxes and a lamp: 36 triangles.
fn cornell() -> Setting {
    let mut triangles = Vec::new();
    cuboid(&mut triangles, DVec3::ZERO, DVec3::ONE, 0.0, true);
    cuboid(&mut triangles, DVec3::new(-0.35, -0.4, -0.3), DVec3::new(0.3, 0.6, 0.3), 0.3, false);
    cuboid(&mut triangles, DVec3::new(0.35, -0.7, 0.3), DVec3::splat(0.3), -0.3, false);
    Setting { name: "cornell".into(), triangles }
}

/// A room with thirteen boxes: 168 triangles.
fn boxes() -> Setting {
    let mut random = Random(9);
    let mut triangles = Vec::new();
    cuboid(&mut triangles, DVec3::ZERO, DVec3::ONE, 0.0, true);
    for _ in 0..13 {
        let middle = DVec3::new(random.unit(), random.unit(), random.unit()) * 1.6 - 0.8;
        cuboid(&mut triangles, middle, DVec3::splat(0.2), random.unit(), false);
    }
    Setting { name: "boxes".into(), triangles }
}

/// A room with four hundred thin, tilted columns of sixty-four sides: 100,812 triangles.
fn hall() -> Setting {
    let mut random = Random(2);
    let mut triangles = Vec::new();
    cuboid(&mut triangles, DVec3::ZERO, DVec3::new(20.0, 3.0, 20.0), 0.0, true);
    for i in 0..400 {
        let foot = DVec3::new(f64::from(i % 20) * 1.9 - 18.0, -3.1, f64::from(i / 20) * 1.9 - 18.0);
        let tilt = DVec3::new(random.unit() - 0.5, 6.2, random.unit() - 0.5);
        let ring = |k: usize, height: f64| {
            let (sin, cos) = (TAU * k as f64 / 64.0).sin_cos();
            (foot + tilt * height + DVec3::new(cos, 0.0, sin) * 0.25).as_vec3()
        };
        for k in 0..64 {
            let [a, b, c, d] = [ring(k, 0.0), ring(k + 1, 0.0), ring(k + 1, 1.0), ring(k, 1.0)];
            triangles.extend([[a, c, b], [a, d, c]]);
        }
        for k in 1..63 {
            triangles.push([ring(0, 0.0), ring(k, 0.0), ring(k + 1, 0.0)]);
            triangles.push([ring(0, 1.0), ring(k + 1, 1.0), ring(k, 1.0)]);
        }
    }
    Setting { name: "hall".into(), triangles }
}

/// A room with two hundred spheres: 256,012 triangles.
fn spheres() -> Setting {
    let mut random = Random(3);
    let mut triangles = Vec::new();
    cuboid(&mut triangles, DVec3::ZERO, DVec3::splat(10.0), 0.0, true);
    let sphere = icosphere();
    for _ in 0..200 {
        let middle = DVec3::new(random.unit(), random.unit(), random.unit()) * 18.0 - 9.0;
        let radius = 0.3 + 0.7 * random.unit();
        triangles.extend(sphere.iter().map(|t| t.map(|p| (middle + p * radius).as_vec3())));
    }
    Setting { name: "spheres".into(), triangles }
}

/// A court with a tree of 60,000 leaves, a square each, that overlap and face all ways: 120,012 triangles.
fn leaves() -> Setting {
    let mut random = Random(4);
    let mut triangles = Vec::new();
    cuboid(&mut triangles, DVec3::new(0.0, 6.0, 0.0), DVec3::new(12.0, 6.0, 12.0), 0.0, true);
    while triangles.len() < 120_012 {
        let place = DVec3::new(random.unit(), random.unit(), random.unit()) * 2.0 - 1.0;
        let outward = DVec3::new(random.unit(), random.unit(), random.unit()) * 2.0 - 1.0;
        if place.length_squared() > 1.0 || outward.length_squared() < 0.01 {
            continue;
        }
        let middle = place * 4.0 + DVec3::Y * 6.0;
        let (s, t) = outward.normalize().any_orthonormal_pair();
        let corner = |x: f64, y: f64| (middle + (s * x + t * y) * 0.12).as_vec3();
        let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    Setting { name: "leaves".into(), triangles }
}

/// The unit sphere in 1,280 triangles.
fn icosphere() -> Vec<[DVec3; 3]> {
    let g = (1.0 + 5.0f64.sqrt()) / 2.0;
    let corner = |i: usize| {
        let (s, t) = ([-1.0, 1.0][i % 2], [-g, g][i / 2 % 2]);
        [DVec3::new(s, t, 0.0), DVec3::new(0.0, s, t), DVec3::new(t, 0.0, s)][i / 4].normalize()
    };
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(corner);
                let short = |x: DVec3, y: DVec3| x.distance(y) < 1.1;
                if short(p, q) && short(q, r) && short(r, p) {
                    let outward = (q - p).cross(r - p).dot(p) > 0.0;
                    faces.push(if outward { [p, q, r] } else { [p, r, q] });
                }
            }
        }
    }
    for _ in 0..3 {
        let split = |[a, b, c]: [DVec3; 3]| {
            let [d, e, f] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        faces = faces.into_iter().flat_map(split).collect();
    }
    faces
}

/// Twelve triangles, facing in or out, turned about the upright axis.
fn cuboid(to: &mut Vec<[Vec3; 3]>, middle: DVec3, half: DVec3, turn: f64, inward: bool) {
    let (sin, cos) = turn.sin_cos();
    let corner = |i: usize| {
        let p = DVec3::new((i % 2) as f64, (i / 2 % 2) as f64, (i / 4) as f64) * 2.0 - 1.0;
        let p = p * half;
        (middle + DVec3::new(p.x * cos - p.z * sin, p.y, p.x * sin + p.z * cos)).as_vec3()
    };
    for side in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        let [a, b, c, d] = side.map(corner);
        to.extend(if inward { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] });
    }
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn cosine(&mut self, normal: Vec3) -> Vec3 {
        let (radius, angle) = (self.unit().sqrt(), TAU * self.unit());
        let n = normal.as_dvec3().normalize();
        let (s, t) = n.any_orthonormal_pair();
        let up = (1.0 - radius * radius).sqrt();
        (s * (radius * angle.cos()) + t * (radius * angle.sin()) + n * up).normalize().as_vec3()
    }
}
