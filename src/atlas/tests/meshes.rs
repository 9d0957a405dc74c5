//! Shapes to unwrap.

use crate::scene::Geometry;
use glam::{Vec2, Vec3};

/// A geometry whose normals are the triangles' own: every triangle has its own three vertices.
pub(crate) fn flat(name: &str, corners: &[[Vec3; 3]]) -> Geometry {
    let mut geometry = Geometry { name: name.into(), unindexed: true, ..Geometry::default() };
    for (i, &[a, b, c]) in corners.iter().enumerate() {
        let normal = (b - a).cross(c - a).normalize_or_zero();
        geometry.position_local.extend([a, b, c]);
        geometry.normal_local.extend([normal; 3]);
        geometry.triangles.push([0, 1, 2].map(|k| 3 * i as u32 + k));
    }
    geometry
}

/// A geometry with one vertex a position and averaged normals.
pub(crate) fn smooth(name: &str, position: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Geometry {
    let mut normal = vec![Vec3::ZERO; position.len()];
    for t in &triangles {
        let [a, b, c] = t.map(|i| position[i as usize]);
        for &i in t {
            normal[i as usize] += (b - a).cross(c - a);
        }
    }
    let normal_local = normal.into_iter().map(|n| n.try_normalize().unwrap_or(Vec3::Y)).collect();
    Geometry {
        name: name.into(),
        position_local: position,
        normal_local,
        triangles,
        smooth: true,
        ..Geometry::default()
    }
}

/// The two triangles of a parallelogram.
pub(crate) fn quad(corner: Vec3, along_u: Vec3, along_v: Vec3) -> [[Vec3; 3]; 2] {
    let [a, b, c, d] = [corner, corner + along_u, corner + along_u + along_v, corner + along_v];
    [[a, b, c], [a, c, d]]
}

/// The twelve triangles of a box, outward.
pub(crate) fn box_triangles(low: Vec3, size: Vec3) -> Vec<[Vec3; 3]> {
    let [x, y, z] = [Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z];
    let high = low + size;
    [
        quad(low, y, x),
        quad(low, x, z),
        quad(low, z, y),
        quad(high, -x, -y),
        quad(high, -z, -x),
        quad(high, -y, -z),
    ]
    .concat()
}

pub(crate) fn cube() -> Geometry {
    flat("cube", &box_triangles(Vec3::ZERO, Vec3::ONE))
}

/// A sphere of `20·4^levels` triangles.
pub(crate) fn ico_sphere(levels: u32, radius: f32) -> Geometry {
    let g = (1.0 + 5f32.sqrt()) / 2.0;
    let mut position: Vec<Vec3> = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .map(|p| Vec3::from(p).normalize())
    .to_vec();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middle = std::collections::BTreeMap::new();
        let mut split = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let mut mid = |i: u32, j: u32| {
                *middle.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    position.push((position[i as usize] + position[j as usize]).normalize());
                    position.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (mid(a, b), mid(b, c), mid(c, a));
            split.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = split;
    }
    smooth("sphere", position.into_iter().map(|p| p * radius).collect(), triangles)
}

/// `nu × nv` quads of a surface over the unit square; `closed` joins the last column or row to the first.
pub(crate) fn sheet(
    name: &str,
    [nu, nv]: [u32; 2],
    closed: [bool; 2],
    point: impl Fn(Vec2) -> Vec3,
) -> Geometry {
    let columns = if closed[0] { nu } else { nu + 1 };
    let rows = if closed[1] { nv } else { nv + 1 };
    let at = |i: u32, j: u32| (j % rows) * columns + i % columns;
    let grid = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
    let position = grid.map(|(i, j)| point(Vec2::new(i as f32 / nu as f32, j as f32 / nv as f32))).collect();
    let mut triangles = Vec::new();
    for (i, j) in (0..nv).flat_map(|j| (0..nu).map(move |i| (i, j))) {
        triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
    smooth(name, position, triangles)
}

pub(crate) fn torus(nu: u32, nv: u32) -> Geometry {
    let turn = std::f32::consts::TAU;
    sheet("torus", [nu, nv], [true, true], |p| {
        let (a, b) = (p.x * turn, p.y * turn);
        let ring = 2.0 + 0.7 * b.cos();
        Vec3::new(ring * a.cos(), 0.7 * b.sin(), -ring * a.sin())
    })
}

/// Rolling hills with ridges, about `2·n²` triangles on 100 m × 100 m.
pub(crate) fn terrain(n: u32) -> Geometry {
    sheet("terrain", [n, n], [false, false], |p| {
        let q = p * 100.0;
        let mut height = 0.0;
        let (mut step, mut high) = (0.05, 8.0);
        for k in 0..5 {
            let k = k as f32;
            height += high * ((q.x * step + 1.7 * k).sin() * (q.y * step * 1.3 + 0.9 * k).cos()).abs();
            step *= 2.1;
            high *= 0.45;
        }
        Vec3::new(q.x, height, -q.y)
    })
}

/// Numbers in `[0, 1)`, the same every time.
pub(crate) fn random(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Triangles that share nothing.
pub(crate) fn soup(n: usize) -> Geometry {
    let mut next = random(7);
    let mut point = |size: f32| Vec3::new(next(), next(), next()) * size;
    let corners: Vec<[Vec3; 3]> = (0..n)
        .map(|_| {
            let p = point(10.0);
            [p, p + point(1.0), p + point(1.0)]
        })
        .collect();
    flat("soup", &corners)
}

/// Boxes of many sizes in a row.
pub(crate) fn boxes(n: usize) -> Geometry {
    let mut next = random(11);
    let corners: Vec<[Vec3; 3]> = (0..n)
        .flat_map(|i| {
            let size = Vec3::new(0.1 + next(), 0.1 + next(), 0.1 + next());
            box_triangles(Vec3::new(2.0 * i as f32, 0.0, 0.0), size)
        })
        .collect();
    flat("boxes", &corners)
}
