//! A row of form factors from rays: what fraction of a patch's cosine-distributed rays lands where.
//!
//! The rays of a patch are Sobol points in four dimensions, two for the place on the patch and two for the direction
//! (Malley's method: uniform on the disc below the hemisphere), scrambled by the patch's number. A count of N rays
//! gives factors k/N: exact in f32 for a power of two, so the factors of a closed scene add up to 1 exactly, and the
//! white furnace holds whatever the noise. The standard deviation of a factor F is √(F(1 − F)/N) for independent
//! rays; low-discrepancy ones stay below.

use super::{Landings, Row, SurfacePoint, sobol, tangents};
use crate::transport::Ray;
use glam::Vec3;

/// The rays of a row, before the patch's own scrambling.
#[derive(Clone, Debug)]
pub struct RaySet {
    /// Digits of the points, in an order that keeps similar directions together, whatever the scrambling.
    points: Vec<[u32; 4]>,
}

impl RaySet {
    /// `rays` rays a row, rounded up to a power of two, 65,536 at most.
    pub fn new(rays: u32) -> Self {
        let count = rays.clamp(1, 1 << 16).next_power_of_two();
        let mut points: Vec<_> = (0..count).map(sobol::mirrored).collect();
        // Scrambling moves whole boxes of the first two dimensions: what shares one stays together.
        points.sort_by_cached_key(|point| {
            (0..16).fold(0u32, |code, k| code << 2 | (point[0] >> k & 1) << 1 | point[1] >> k & 1)
        });
        Self { points }
    }

    /// Number of rays of a row.
    pub fn len(&self) -> u32 {
        self.points.len() as u32
    }

    /// Never: there is one ray at least.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Fills `row` with the form factors of `patch`.
    ///
    /// `sample` gives the point of the patch that belongs to two coordinates in `[0, 1)²`, uniform by area. `land`
    /// follows a ray and tells [`Landings`] where its light goes. `landings` is scratch space.
    pub fn row(
        &self,
        patch: u32,
        sample: impl Fn([f32; 2]) -> SurfacePoint,
        land: impl Fn(&Ray, &mut Landings),
        landings: &mut Landings,
        row: &mut Row,
    ) {
        let scramble = sobol::Scramble::new(sobol::hash(patch ^ 0x9e37_79b9));
        landings.clear();
        landings.ray = 1.0 / self.points.len() as f64;
        for point in &self.points {
            // The first pair of dimensions is the best stratified: it goes where the integrand varies most.
            let at = |dimension| scramble.coordinate(point, dimension);
            let place = sample([at(2), at(3)]);
            let local = cosine_direction(at(0), at(1));
            let (right, up) = tangents(place.normal);
            let direction = (right * local.x + up * local.y + place.normal * local.z).normalize();
            land(&Ray { origin: place.position_world, direction, t_max: f32::INFINITY }, landings);
        }
        landings.write(row);
    }
}

/// One row from `rays` rays; see [`RaySet::row`], which is for many.
pub fn ray_row(
    patch: u32,
    rays: u32,
    sample: impl Fn([f32; 2]) -> SurfacePoint,
    land: impl Fn(&Ray, &mut Landings),
    landings: &mut Landings,
    row: &mut Row,
) {
    RaySet::new(rays).row(patch, sample, land, landings, row);
}

/// Unit vector about +z, with a density in proportion to its z (concentric map of Shirley & Chiu 1997, lifted).
fn cosine_direction(u: f32, v: f32) -> Vec3 {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let (radius, angle) = if a.abs() > b.abs() {
        (a, std::f32::consts::FRAC_PI_4 * (b / a))
    } else if b != 0.0 {
        (b, std::f32::consts::FRAC_PI_2 - std::f32::consts::FRAC_PI_4 * (a / b))
    } else {
        (0.0, 0.0)
    };
    let (sine, cosine) = angle.sin_cos();
    // 1 − r² as a product keeps the digits near the rim.
    let height = ((1.0 - radius) * (1.0 + radius)).max(0.0).sqrt();
    Vec3::new(radius * cosine, radius * sine, height)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn floor([x, y]: [f32; 2]) -> SurfacePoint {
        SurfacePoint { position_world: Vec3::new(x, y, 0.0), normal: Vec3::Z }
    }

    /// In a closed scene all rays land: counts over a power of two add up to exactly 1.
    #[test]
    fn factors_of_a_closed_scene_add_up_to_one() {
        let mut row = Row::default();
        for rays in [1, 2, 64, 1000, 4096] {
            let by_octant = |ray: &Ray, landings: &mut Landings| {
                landings.hit(u32::from(ray.direction.x > 0.0) + 2 * u32::from(ray.direction.y > 0.0), 1.0);
            };
            ray_row(7, rays, floor, by_octant, &mut Landings::default(), &mut row);
            assert_eq!(row.weight.iter().sum::<f64>(), 1.0);
            assert_eq!(row.miss, 0.0);
            assert!(row.column.is_sorted());
        }
    }

    /// The share of rays within an angle α of the normal is sin² α: every ring of equal projected area holds its
    /// number of rays up to the strips that its border cuts.
    #[test]
    fn directions_follow_the_cosine() {
        let count = 4096;
        for patch in 0..10 {
            let mut row = Row::default();
            let by_ring = |ray: &Ray, landings: &mut Landings| {
                let sine_squared = 1.0 - ray.direction.z * ray.direction.z;
                landings.hit((sine_squared * 16.0) as u32, 1.0);
            };
            ray_row(patch, count, floor, by_ring, &mut Landings::default(), &mut row);
            for (&ring, &weight) in row.column.iter().zip(&row.weight) {
                // A (0, 2)-net of N points has a discrepancy of order log N / N on boxes, √ of that on rings.
                assert!((weight * 16.0 - 1.0).abs() < 0.06, "ring {ring}: {weight}");
            }
        }
    }

    #[test]
    fn what_comes_from_beyond_is_averaged() {
        let mut row = Row::default();
        let half = |ray: &Ray, landings: &mut Landings| {
            if ray.direction.x > 0.0 {
                landings.miss(1.0, [2.0, 4.0, 8.0]);
            } else {
                landings.miss(0.5, [2.0, 4.0, 8.0]);
                landings.hit(3, 0.25);
            }
        };
        ray_row(0, 1024, floor, half, &mut Landings::default(), &mut row);
        assert_eq!(row.column, [3]);
        assert!((row.weight[0] - 0.125).abs() < 0.01 && (row.miss - 0.75).abs() < 0.01);
        assert!((row.beyond[2] - 6.0).abs() < 0.05, "{:?}", row.beyond);
    }
}
