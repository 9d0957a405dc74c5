//! Texels per metre, and how stretched they are.

use super::layout::{NO_CHART, Side};
use crate::scene::Scene;
use glam::{DVec2, DVec3, Vec3};
use serde::Serialize;

/// Texels per metre of an object, weighted by area.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Density {
    /// √(texels / m²).
    pub texels_per_m: f64,
    /// A twentieth of the surface has less.
    pub low: f64,
    /// A twentieth of the surface has more.
    pub high: f64,
    /// Nineteen twentieths of the surface have texels that are at most so many times longer than wide.
    pub stretch: f64,
    /// World area, m².
    pub area_m2: f64,
}

/// The texels of one triangle: mean texels per metre, stretch, world area; `None` when it has no area in the world.
pub(super) fn of_triangle(world: [Vec3; 3], texels: [glam::Vec2; 3]) -> Option<(f64, f64, f64)> {
    let [a, b, c] = world.map(Vec3::as_dvec3);
    let (ab, ac) = (b - a, c - a);
    let x = ab.try_normalize()?;
    let normal: DVec3 = ab.cross(ac);
    let y = normal.try_normalize()?.cross(x);
    let area = normal.length() / 2.0;
    // Columns of the map from metres in the plane to texels: J = T · W⁻¹ with W = [ab ac] in the axes x, y.
    let (w, h, s) = (ab.length(), ac.dot(y), ac.dot(x));
    let [p, q, r] = texels.map(|t| t.as_dvec2());
    let along_x: DVec2 = (q - p) / w;
    let along_y: DVec2 = ((r - p) - along_x * s) / h;
    // Singular values of a 2×2 matrix from its invariants.
    let sum = along_x.length_squared() + along_y.length_squared();
    let determinant = along_x.perp_dot(along_y).abs();
    let root = (sum * sum - 4.0 * determinant * determinant).max(0.0).sqrt();
    let (most, least) = (((sum + root) / 2.0).sqrt(), ((sum - root).max(0.0) / 2.0).sqrt());
    let stretch = if least > 0.0 { most / least } else { f64::INFINITY };
    (area > 0.0 && area.is_finite()).then_some((determinant.sqrt(), stretch, area))
}

/// The density of an object's sides.
pub(super) fn of(scene: &Scene, sides: &[&Side]) -> Density {
    let mut rows: Vec<(f64, f64, f64)> = Vec::new();
    for side in sides {
        let surface = &scene.surfaces[side.surface];
        let lit =
            side.corners.iter().zip(&side.chart).enumerate().filter(|(_, (_, chart))| **chart != NO_CHART);
        rows.extend(
            lit.filter_map(|(t, (texels, _))| of_triangle(scene.corners_world(surface, t as u32), *texels)),
        );
    }
    let area: f64 = rows.iter().map(|row| row.2).sum();
    let texels: f64 = rows.iter().map(|row| row.0 * row.0 * row.2).sum();
    if area <= 0.0 {
        return Density::default();
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (low, high) = (
        quantile(rows.iter().map(|r| (r.0, r.2)), 0.05 * area),
        quantile(rows.iter().map(|r| (r.0, r.2)), 0.95 * area),
    );
    rows.sort_by(|a, b| a.1.total_cmp(&b.1));
    let stretch = quantile(rows.iter().map(|r| (r.1, r.2)), 0.95 * area);
    Density { texels_per_m: (texels / area).sqrt(), low, high, stretch, area_m2: area }
}

/// The value at which the running sum of weights reaches `at`; the values must rise.
pub(super) fn quantile(rows: impl Iterator<Item = (f64, f64)>, at: f64) -> f64 {
    let (mut sum, mut last) = (0.0, 0.0);
    for (value, weight) in rows {
        sum += weight;
        last = value;
        if sum >= at {
            break;
        }
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    #[test]
    fn a_triangle_s_texels_are_counted_along_its_own_plane() {
        // 2 m × 1 m in a tilted plane, 20 × 30 texels: 10 along one side, 30 along the other.
        let tilt = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.8, -1.1);
        let world = [Vec3::ZERO, tilt * Vec3::new(2.0, 0.0, 0.0), tilt * Vec3::new(0.0, 1.0, 0.0)];
        let texels = [Vec2::new(5.0, 5.0), Vec2::new(5.0, 25.0), Vec2::new(35.0, 5.0)];
        let (density, stretch, area) = of_triangle(world, texels).unwrap();
        assert!(
            (density - 300.0_f64.sqrt()).abs() < 1e-4 && (stretch - 3.0).abs() < 1e-5,
            "{density} {stretch}"
        );
        assert!((area - 1.0).abs() < 1e-6);
        assert_eq!(of_triangle([Vec3::ZERO; 3], texels), None);
        assert_eq!(of_triangle(world, [Vec2::ZERO; 3]).unwrap().0, 0.0);
    }

    #[test]
    fn quantiles_go_by_weight() {
        let rows = || [(1.0, 1.0), (2.0, 8.0), (9.0, 1.0)].into_iter();
        assert_eq!([quantile(rows(), 0.5), quantile(rows(), 5.0), quantile(rows(), 9.5)], [1.0, 2.0, 9.0]);
    }
}
