//! Objects whose fronts are dark while their backs stand in the light: their normals probably look the wrong way.

use crate::baked::Baked;
use crate::render::{Lit, Look};
use crate::sampling::{cosine_hemisphere, frame, sobol4, to_world};
use crate::scene::SurfacePoint;
use crate::transport::{Ray, Tracer};
use glam::{Vec2, Vec3};

/// Fronts below this share of the scene's mean are dark.
pub(super) const DARK: f32 = 0.02;
/// Backs above this share of the scene's mean are lit.
const LIT: f32 = 0.1;
/// Places looked at per object, and looks from each.
const PLACES: u32 = 32;
const LOOKS: u32 = 32;

/// The mean light that arrives at the backs of some surfaces, E/π: what is seen from there, directions weighted by
/// their cosine.
pub(super) fn back_light<T: Tracer>(baked: &Baked, tracer: &T, lit: &Lit, surfaces: &[usize]) -> Vec3 {
    let (scene, world) = (&baked.scene, tracer.world());
    let mut running: Vec<(f64, u32)> = Vec::new();
    let mut area = 0.0;
    for &surface in surfaces {
        let first = world.first_triangle_of_surface(surface as u32);
        for triangle in first..world.first_triangle_of_surface(surface as u32 + 1) {
            area += f64::from(world.area(triangle));
            running.push((area, triangle));
        }
    }
    let looks = sobol4(LOOKS, 1, 5);
    let mut sum = Vec3::ZERO;
    for place in sobol4(PLACES, 0, 5) {
        let wanted = f64::from(place[0]) * area;
        let Some(&(_, triangle)) = running.get(running.partition_point(|(upto, _)| *upto <= wanted)) else {
            continue;
        };
        let (u, v) =
            if place[1] + place[2] <= 1.0 { (place[1], place[2]) } else { (1.0 - place[1], 1.0 - place[2]) };
        let at = SurfacePoint {
            surface: world.surface_of(triangle),
            triangle: world.local_triangle(triangle),
            barycentric: Vec2::new(u, v),
        };
        let back = -world.normal(triangle);
        let origin = world.offset_origin(triangle, scene.position(at), back);
        let axes = frame(back, Vec3::X);
        for p in &looks {
            let direction = to_world(&axes, cosine_hemisphere(p[0], p[1]));
            sum += match tracer.closest(&Ray::unbounded(origin, direction)) {
                None => lit.background(direction),
                Some(hit) => {
                    let at = world.surface_point(&hit);
                    let seen = hit.front || scene.material(&scene.surfaces[at.surface as usize]).double_sided;
                    if seen { lit.radiance(at, direction) } else { Vec3::ZERO }
                }
            };
        }
    }
    sum / (PLACES * LOOKS) as f32
}

/// Whether this looks like a mistake: light, its brightest channel, on front and back and in the mean of the scene.
pub(super) fn is_suspect(front: f32, back: f32, mean: f32) -> bool {
    front < DARK * mean && back > LIT * mean
}
