//! A row of form factors from a hemicube (Cohen & Greenberg 1985): half a cube of pixels around a point of the patch.
//!
//! Every pixel's share of the hemisphere (its delta form factor) is the exact integral over the pixel, so that all of
//! them add up to 1 to the last digit, however coarse the cube. What a pixel sees is found by one ray through its
//! middle: a BVH stands where the original had a z-buffer. The error is aliasing, of the order of the pixels that an
//! edge cuts, and the patch being represented by few points of its own: contact with other patches wants several.

use super::{Landings, Row, SurfacePoint, tangents};
use crate::transport::Ray;
use glam::{Vec2, Vec3};
use std::f64::consts::TAU;

/// The pixels of a hemicube about +z, with the share of the hemisphere that each stands for.
#[derive(Clone, Debug)]
pub struct Hemicube {
    pixels: Vec<(Vec3, f64)>,
}

impl Hemicube {
    /// `resolution` pixels along an edge of the top face, made even; 3 · resolution² pixels in all. 2 to 2,048.
    pub fn new(resolution: u32) -> Self {
        let resolution = (resolution.clamp(2, 2048) + 1) & !1;
        let at = |index: u32| 2.0 * f64::from(index) / f64::from(resolution) - 1.0;
        let mut pixels = Vec::with_capacity(3 * (resolution * resolution) as usize);
        for row in 0..resolution {
            for column in 0..resolution {
                let (x, y) = ([at(column), at(column + 1)], [at(row), at(row + 1)]);
                let middle = glam::dvec3(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), 1.0);
                pixels.push((middle, rectangle(top_corner, x, y)));
                // The same rows stand on the sides, from the base at z = 0 up.
                if row >= resolution / 2 {
                    let share = rectangle(side_corner, x, y);
                    for turn in 0..4 {
                        let quarter = glam::dvec2(1.0, middle.x);
                        let turned = (0..turn).fold(quarter, |at, _| at.perp());
                        pixels.push((turned.extend(middle.y), share));
                    }
                }
            }
        }
        // Rounding leaves about 1e-13 to 1.
        let sum: f64 = pixels.iter().map(|pixel| pixel.1).sum();
        let pixels = pixels.into_iter().map(|(at, share)| (at.normalize().as_vec3(), share / sum)).collect();
        Self { pixels }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Never: there are twelve pixels at least.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Fills `row` with the form factors of a patch, from a cube over each of `points`, which stand for equal areas
    /// of it. `land` as in [`super::rays::ray_row`].
    ///
    /// Cubes are turned about the normal from point to point by the golden angle: patches side by side would
    /// otherwise share their aliasing, and show it as a pattern.
    pub fn row(
        &self,
        patch: u32,
        points: &[SurfacePoint],
        land: impl Fn(&Ray, &mut Landings),
        landings: &mut Landings,
        row: &mut Row,
    ) {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        landings.clear();
        let weight = 1.0 / points.len().max(1) as f64;
        for (index, point) in points.iter().enumerate() {
            let number = f64::from(patch) * points.len() as f64 + index as f64;
            // A quarter turn maps the cube onto itself.
            let spin = Vec2::from_angle((0.25 * TAU * (number * GOLDEN).fract()) as f32);
            let (right, up) = tangents(point.normal);
            let (right, up) = (right * spin.x + up * spin.y, up * spin.x - right * spin.y);
            for &(at, share) in &self.pixels {
                landings.ray = share * weight;
                let direction = (right * at.x + up * at.y + point.normal * at.z).normalize();
                land(&Ray { origin: point.position_world, direction, t_max: f32::INFINITY }, landings);
            }
        }
        landings.write(row);
    }
}

/// Integral over a rectangle, from the integral from the origin to a corner, which is odd in both coordinates.
fn rectangle(corner: fn(f64, f64) -> f64, x: [f64; 2], y: [f64; 2]) -> f64 {
    corner(x[1], y[1]) - corner(x[0], y[1]) - corner(x[1], y[0]) + corner(x[0], y[0])
}

/// Configuration factor of the rectangle from (0, 0) to (x, y) on the top face z = 1.
fn top_corner(x: f64, y: f64) -> f64 {
    let (a, b) = (x.hypot(1.0), y.hypot(1.0));
    (x / a * (y / a).atan() + y / b * (x / b).atan()) / TAU
}

/// Configuration factor of the rectangle from (0, 0) to (y, z) on the side face x = 1.
fn side_corner(y: f64, z: f64) -> f64 {
    let a = z.hypot(1.0);
    (y.atan() - (y / a).atan() / a) / TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_faces_hold_their_closed_form_shares() {
        for resolution in [2, 3, 16, 100] {
            let cube = Hemicube::new(resolution);
            assert_eq!(cube.pixels.len() % 3, 0);
            let sum = |on: fn(&Vec3) -> bool| -> f64 {
                cube.pixels.iter().filter(|pixel| on(&pixel.0)).map(|pixel| pixel.1).sum()
            };
            // Four times the corner values of parallel and perpendicular unit rectangles at unit distance.
            let top = sum(|at| at.z > at.x.abs() && at.z > at.y.abs());
            assert!((top - 4.0 * 0.138_531_605_994_893).abs() < 1e-12, "{top}");
            let side = sum(|at| at.x > at.z && at.x > at.y.abs());
            assert!((side - 2.0 * 0.055_734_197_002_553_5).abs() < 1e-12, "{side}");
            assert!((sum(|_| true) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn every_pixel_is_worth_about_its_cosine_and_solid_angle() {
        let resolution = 64;
        let cube = Hemicube::new(resolution);
        let pixel_area = f64::from(2.0 / resolution as f32).powi(2);
        for (at, share) in &cube.pixels {
            // Cohen & Greenberg's midpoint values: z / (π r³) times the distance to the face, which is 1/max|at|.
            let at = at.as_dvec3();
            let largest = at.abs().max_element();
            let midpoint = at.z * largest.powi(3) / std::f64::consts::PI * pixel_area;
            // The midpoint rule misses a share h²/24 (f_yy + f_zz)/f of f = z/r⁴, 16/24 h² at most.
            assert!((share / midpoint - 1.0).abs() < 0.7 * pixel_area, "{at} {share} {midpoint}");
        }
    }

    #[test]
    fn an_open_hemisphere_is_missed_whole() {
        let point = SurfacePoint { position_world: Vec3::ZERO, normal: Vec3::new(0.6, 0.0, -0.8) };
        let mut row = Row::default();
        let land = |ray: &Ray, landings: &mut Landings| {
            assert!(ray.direction.dot(point.normal) > 0.0);
            landings.miss(1.0, [1.0, 0.0, 2.0]);
        };
        Hemicube::new(32).row(5, &[point, point], land, &mut Landings::default(), &mut row);
        assert!(row.column.is_empty());
        assert!((row.miss - 1.0).abs() < 1e-12 && (row.beyond[2] - 2.0).abs() < 1e-12);
    }
}
