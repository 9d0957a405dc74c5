//! How the triangles of a geometry hang together: welding, degenerate triangles, neighbours, smooth regions.

use crate::scene::Geometry;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// No neighbour across this edge: the border of the mesh, a hard edge, or an edge that is not a clean joint of two.
pub(super) const NONE: u32 = u32::MAX;

/// Edges where the shading normals of the two sides differ by more are hard: charts end there, so that no texel
/// mixes the light of both sides. Milder creases are left to the chart growing, which prefers to cut there.
const HARD_NORMALS_COS: f32 = 0.766; // 40°

/// Facts about the triangles of one geometry, all in its local space.
pub(super) struct Topology {
    /// Unit normal of each triangle; zero where degenerate.
    pub normal: Vec<Vec3>,
    /// Area of each triangle; zero where degenerate.
    pub area: Vec<f64>,
    /// Triangle across the edge from corner k to k + 1, or [`NONE`].
    pub neighbour: Vec<[u32; 3]>,
    /// Triangles of each smooth region, ascending; regions by their lowest triangle. Degenerate ones are in none.
    pub regions: Vec<Vec<u32>>,
}

impl Topology {
    /// Looks at a geometry. Indices out of range and non-finite positions make a triangle degenerate.
    pub fn of(geometry: &Geometry) -> Self {
        let welded = weld(&geometry.position_local);
        let (normal, area): (Vec<Vec3>, Vec<f64>) =
            geometry.triangles.par_iter().map(|t| frame(geometry, &welded, t)).unzip();
        let neighbour = neighbours(geometry, &welded, &normal);
        let regions = flood(&neighbour, &area);
        Self { normal, area, neighbour, regions }
    }
}

/// For each vertex the lowest vertex at the very same position.
fn weld(position: &[Vec3]) -> Vec<u32> {
    // Adding zero turns -0 into 0.
    let key = |i: u32| (position[i as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..position.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| (key(i), i));
    let mut welded = vec![0; position.len()];
    let mut first = 0;
    for (n, &i) in order.iter().enumerate() {
        if n == 0 || key(i) != key(first) {
            first = i;
        }
        welded[i as usize] = first;
    }
    welded
}

/// Normal and area of a triangle, zero when its corners lie on a line within the rounding of their coordinates.
fn frame(geometry: &Geometry, welded: &[u32], triangle: &[u32; 3]) -> (Vec3, f64) {
    let nothing = (Vec3::ZERO, 0.0);
    let count = geometry.position_local.len();
    if triangle.iter().any(|&i| i as usize >= count) {
        return nothing;
    }
    let [i, j, k] = triangle.map(|i| welded[i as usize]);
    let corners = triangle.map(|i| geometry.position_local[i as usize].as_dvec3());
    if i == j || j == k || k == i || !corners.iter().all(|p| p.is_finite()) {
        return nothing;
    }
    let [a, b, c] = corners;
    let doubled = (b - a).cross(c - a);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let rounding =
        f64::from(f32::EPSILON) * 0.5 * corners.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let length = doubled.length();
    // The height over the longest edge must stand out of the rounding.
    if length <= longest * rounding || !(doubled / length).is_finite() {
        return nothing;
    }
    ((doubled / length).as_vec3(), length * 0.5)
}

#[derive(Clone, Copy)]
struct Edge {
    low: u32,
    high: u32,
    /// Triangle·3 + corner where the edge starts.
    corner: u32,
    /// Whether it runs from low to high.
    forward: bool,
}

fn neighbours(geometry: &Geometry, welded: &[u32], normal: &[Vec3]) -> Vec<[u32; 3]> {
    let mut edges: Vec<Edge> = Vec::with_capacity(3 * geometry.triangles.len());
    for (t, triangle) in geometry.triangles.iter().enumerate() {
        if normal[t] == Vec3::ZERO {
            continue;
        }
        for k in 0..3 {
            let [from, to] = [triangle[k], triangle[(k + 1) % 3]].map(|i| welded[i as usize]);
            let corner = (3 * t + k) as u32;
            edges.push(Edge { low: from.min(to), high: from.max(to), corner, forward: from < to });
        }
    }
    edges.par_sort_unstable_by_key(|e| (e.low, e.high, e.corner));
    let mut neighbour = vec![[NONE; 3]; geometry.triangles.len()];
    for joint in edges.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high)) {
        match joint {
            [a, b] => join(geometry, normal, *a, *b, &mut neighbour),
            [] | [_] => {}
            many if many.len() <= 16 => join_many(geometry, normal, many, &mut neighbour),
            _ => {}
        }
    }
    neighbour
}

fn join(geometry: &Geometry, normal: &[Vec3], a: Edge, b: Edge, neighbour: &mut [[u32; 3]]) {
    let [s, t] = [a.corner / 3, b.corner / 3];
    if a.forward != b.forward && s != t && !hard(geometry, normal, a, b) {
        neighbour[s as usize][a.corner as usize % 3] = t;
        neighbour[t as usize][b.corner as usize % 3] = s;
    }
}

/// More than two triangles at one edge, as where sheets are modelled back to back: those that continue each other best
/// are joined, ties to the lowest.
fn join_many(geometry: &Geometry, normal: &[Vec3], edges: &[Edge], neighbour: &mut [[u32; 3]]) {
    let mut pairs: Vec<(f32, Edge, Edge)> = Vec::new();
    for &a in edges.iter().filter(|e| e.forward) {
        for &b in edges.iter().filter(|e| !e.forward) {
            let straight = normal[a.corner as usize / 3].dot(normal[b.corner as usize / 3]);
            pairs.push((straight, a, b));
        }
    }
    pairs.sort_by(|x, y| y.0.total_cmp(&x.0).then((x.1.corner, x.2.corner).cmp(&(y.1.corner, y.2.corner))));
    let mut taken: Vec<u32> = Vec::new();
    for (_, a, b) in pairs {
        if !taken.contains(&a.corner) && !taken.contains(&b.corner) {
            taken.extend([a.corner, b.corner]);
            join(geometry, normal, a, b, neighbour);
        }
    }
}

/// Whether light may not be shared across the edge.
fn hard(geometry: &Geometry, normal: &[Vec3], a: Edge, b: Edge) -> bool {
    let [s, t] = [a.corner as usize / 3, b.corner as usize / 3];
    if normal[s].dot(normal[t]) < 0.0 {
        return true;
    }
    let shading = |corner: u32, step: usize| {
        let triangle = geometry.triangles[corner as usize / 3];
        let i = triangle[(corner as usize + step) % 3] as usize;
        geometry.normal_local.get(i).copied().unwrap_or(Vec3::ZERO)
    };
    // The edges run against each other: the start of one is the end of the other.
    [(0, 1), (1, 0)].into_iter().any(|(p, q)| {
        let [m, n] = [shading(a.corner, p), shading(b.corner, q)];
        m != n && m.dot(n) < HARD_NORMALS_COS
    })
}

fn flood(neighbour: &[[u32; 3]], area: &[f64]) -> Vec<Vec<u32>> {
    let mut seen: Vec<bool> = area.iter().map(|&a| a == 0.0).collect();
    let mut regions = Vec::new();
    for start in 0..neighbour.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut region = vec![start as u32];
        let mut next = 0;
        while let Some(&t) = region.get(next) {
            next += 1;
            for n in neighbour[t as usize] {
                if n != NONE && !seen[n as usize] {
                    seen[n as usize] = true;
                    region.push(n);
                }
            }
        }
        region.sort_unstable();
        regions.push(region);
    }
    regions
}

/// Two unit vectors that span the plane below a unit normal; u × v = normal.
pub(super) fn plane_axes(normal: DVec3) -> [DVec3; 2] {
    let u = normal.any_orthonormal_vector();
    [u, normal.cross(u)]
}
