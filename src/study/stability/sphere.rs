//! Spheres of triangles.

use glam::{DVec3, dvec3};

/// Corners and triangles of a sphere seen from inside, or from outside, or of the half `above` or below z = 0: an octahedron,
/// each face cut into n² triangles.
pub fn sphere(n: u32, radius: f64, inside: bool, above: Option<bool>) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut position, mut triangles) = (Vec::new(), Vec::new());
    for octant in 0..8 {
        let sign = dvec3(
            if octant & 1 == 0 { 1.0 } else { -1.0 },
            if octant & 2 == 0 { 1.0 } else { -1.0 },
            if octant & 4 == 0 { 1.0 } else { -1.0 },
        );
        if above.is_some_and(|above| above != (octant & 4 == 0)) {
            continue;
        }
        let first = position.len() as u32;
        let mut number = vec![];
        for i in 0..=n {
            for j in 0..=n - i {
                number.push((i, j));
                let k = n - i - j;
                let at = dvec3(f64::from(i), f64::from(j), f64::from(k));
                position.push((at * sign).normalize() * radius);
            }
        }
        let at = |i: u32, j: u32| first + number.iter().position(|&n| n == (i, j)).unwrap_or(0) as u32;
        let mut add = |a: u32, b: u32, c: u32| {
            let [p, q, r] = [a, b, c].map(|v| position[v as usize]);
            let outward = (q - p).cross(r - p).dot(p) > 0.0;
            triangles.push(if outward == inside { [a, c, b] } else { [a, b, c] });
        };
        for i in 0..n {
            for j in 0..n - i {
                add(at(i, j), at(i + 1, j), at(i, j + 1));
                if i + j + 1 < n {
                    add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                }
            }
        }
    }
    (position, triangles)
}
