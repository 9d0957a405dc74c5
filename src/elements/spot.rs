//! A sample's point in the world: position, normals, footprint.

use super::charts::{ChartPlan, Mapped};
use super::probe::Probe;
use super::texel::{Footprint, Place};
use crate::transport::{Tracer, segment};
use glam::{DVec3, Vec3};

/// What an element knows of the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub position: Vec3,
    /// The point of the triangle's plane under `position`.
    pub on_plane: Vec3,
    pub normal_geometric: Vec3,
    pub normal_shading: Vec3,
    /// World triangle.
    pub triangle: u32,
    /// World metres per texel along u and v.
    pub per_texel: [Vec3; 2],
    /// Half the footprint's width, texels.
    pub reach: f32,
    /// What lies closer above the sample than this covers it, metres; 0 on pages that nobody looks at.
    pub pressed_m: f32,
}

/// Something opaque above a sample and nearer than this share of the footprint's size covers it, when it lies about
/// parallel: the slit is too narrow for the lightmap to show how light fades into it.
const PRESSED: f64 = 0.125;

/// The least cosine between the shading and the geometric normal: the lit hemisphere stays one the sample can see.
const LEAST_COSINE: f32 = 0.05;
/// Vertex normals farther than this from the plane's are no smooth surface's (a box shaded smooth): lifting a sample
/// to the surface they describe would take it far from the wall.
const SMOOTH_COSINE: f64 = 0.7;

/// The point at `place`, on the side of the chart.
pub(super) fn spot(
    chart: &ChartPlan,
    footprint: &Footprint,
    place: &Place,
    probe: &Probe<impl Tracer>,
) -> Spot {
    let (triangle, mapped) = (footprint.pieces[place.piece].triangle, &footprint.mapped[place.piece]);
    let scene = chart.scene;
    let surface = &scene.surfaces[chart.surface as usize];
    let side = if chart.back { -1.0 } else { 1.0 };
    let normal = mapped.normal() * side;
    let point = mapped.point(place.weights);
    let world_triangle = probe.world().triangle_of(chart.surface, triangle);
    let mut spot = Spot {
        position: point.as_vec3(),
        on_plane: point.as_vec3(),
        normal_geometric: normal.as_vec3(),
        normal_shading: normal.as_vec3(),
        triangle: world_triangle,
        per_texel: mapped.per_texel().map(|v| v.as_vec3()),
        reach: place.reach as f32,
        pressed_m: if chart.exported { (PRESSED * footprint.area().sqrt()) as f32 } else { 0.0 },
    };
    if !scene.geometry(surface).smooth {
        return spot;
    }
    let corners = scene.corner_indices(surface, triangle);
    let normals = corners.map(|i| surface.normal_world[i].as_dvec3() * side);
    let interpolated =
        normals[0] * place.weights.x + normals[1] * place.weights.y + normals[2] * place.weights.z;
    spot.normal_shading = into_hemisphere(interpolated.normalize_or(normal).as_vec3(), spot.normal_geometric);
    if let Some(lifted) = lifted(mapped, place.weights, point, normals, normal) {
        let lifted = lifted.as_vec3();
        let start = probe.world().offset_origin(world_triangle, spot.position, spot.normal_geometric);
        if !probe.occluded(&segment(start, lifted)) {
            spot.position = lifted;
        }
    }
    spot
}

/// The point of the smooth surface above a point of its triangle: the mean of the point's projections onto the
/// corners' tangent planes, as far as they lie above it (Hanika, Ray Tracing Gems II, chapter 4). Rays from there do
/// not meet the facets that the smooth surface stands for, so the shadow border follows the smooth shape.
fn lifted(mapped: &Mapped, weights: DVec3, point: DVec3, normals: [DVec3; 3], plane: DVec3) -> Option<DVec3> {
    if normals.iter().any(|n| n.is_nan() || n.dot(plane) < SMOOTH_COSINE) {
        return None;
    }
    let mut lift = DVec3::ZERO;
    for i in 0..3 {
        let below = normals[i].dot(mapped.world[i] - point).max(0.0);
        lift += normals[i] * (below * weights[i]);
    }
    (lift != DVec3::ZERO).then(|| point + lift)
}

/// A unit normal turned as little as needed to make at least `LEAST_COSINE` with the plane's.
fn into_hemisphere(shading: Vec3, plane: Vec3) -> Vec3 {
    let cosine = shading.dot(plane);
    if cosine >= LEAST_COSINE {
        return shading;
    }
    match (shading - plane * cosine).try_normalize() {
        Some(sideways) => sideways * (1.0 - LEAST_COSINE * LEAST_COSINE).sqrt() + plane * LEAST_COSINE,
        None => plane,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shading_normals_stay_above_the_plane() {
        for shading in [Vec3::Y, Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, -0.8, 0.0), Vec3::new(0.8, 0.6, 0.0)] {
            let n = into_hemisphere(shading, Vec3::Y);
            assert!(n.is_normalized() && n.y >= LEAST_COSINE - 1e-6, "{shading} {n}");
        }
        assert_eq!(into_hemisphere(Vec3::new(0.8, 0.6, 0.0), Vec3::Y), Vec3::new(0.8, 0.6, 0.0));
    }

    #[test]
    fn a_lifted_point_lies_on_the_sphere_of_its_normals() {
        // A facet of the unit sphere, about 20 degrees wide.
        let corners = [DVec3::new(0.2, 1.0, 0.0), DVec3::new(-0.1, 1.0, 0.2), DVec3::new(-0.1, 1.0, -0.2)];
        let world = corners.map(|p| p.normalize());
        let plane = (world[1] - world[0]).cross(world[2] - world[0]).normalize();
        let plane = plane * plane.y.signum();
        let mapped = Mapped { uv: [glam::DVec2::ZERO; 3], world, area: 1.0 };
        let weights = DVec3::splat(1.0 / 3.0);
        let point = mapped.point(weights);
        let up = lifted(&mapped, weights, point, world, plane).unwrap();
        // Tangent planes lie outside the sphere by as much as the facet lies inside, to second order.
        let gap = 1.0 - point.length();
        assert!(up.length() > 1.0 - 0.1 * gap && up.length() < 1.0 + 1.5 * gap, "{} {gap}", up.length());
        // Concave normals lift nothing; a box shaded smooth neither.
        assert!(
            lifted(&mapped, weights, point, world.map(|n| (2.0 * plane - n).normalize()), plane).is_none()
        );
        let diagonal = DVec3::ONE.normalize();
        assert!(lifted(&mapped, weights, point, [diagonal; 3], DVec3::X).is_none());
    }
}
