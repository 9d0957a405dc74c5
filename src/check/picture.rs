//! The scene coloured by its texels per metre.

use super::{ObjectReport, density, median_density};
use crate::baked::Baked;
use crate::error::Result;
use crate::options::{Exposure, RenderOptions, Tone};
use crate::render::{Eye, Look, Picture, take};
use crate::scene::SurfacePoint;
use crate::transport::World;
use crate::with_tracer;
use glam::{Vec2, Vec3};

/// A checker's square is this many texels wide.
const CHECKER_TEXELS: f32 = 4.0;
/// The scale ends at this many times more or fewer than the median.
const ENDS_OCTAVES: f32 = 2.0;

/// Green where the texels per metre are the scene's median, through cyan to blue where there are a quarter, through yellow to
/// red where there are four times as many; grey without a lightmap. Squares of the checker are four texels wide, seen along
/// the lightmap's own coordinates. `options`' exposure and tone do not count.
pub fn density_picture(baked: &Baked, objects: &[ObjectReport], options: &RenderOptions) -> Result<Picture> {
    let world = World::new(&baked.scene);
    let eye = Eye::new(&baked.scene, world.bounds(), &options.view, options.size)?;
    let how = Densities { baked, median: median_density(objects) };
    Ok(with_tracer!(world.tracer(&baked.scene), tracer => {
        take(&baked.scene, tracer, &how, &eye, Exposure::Ev(0.0), Tone::Clip)
    }))
}

struct Densities<'a> {
    baked: &'a Baked,
    median: f64,
}

impl Look for Densities<'_> {
    fn radiance(&self, at: SurfacePoint, direction: Vec3) -> Vec3 {
        let scene = &self.baked.scene;
        // Surfaces that face the eye are brighter, so that shapes can be told.
        let shade = 0.35 + 0.65 * scene.shading_normal(at).dot(direction).abs();
        let colour = self.colour(at).unwrap_or(Vec3::splat(0.25));
        colour * shade
    }

    fn background(&self, _: Vec3) -> Vec3 {
        Vec3::splat(0.02)
    }
}

impl Densities<'_> {
    /// `None` without a lightmap.
    fn colour(&self, at: SurfacePoint) -> Option<Vec3> {
        let scene = &self.baked.scene;
        let surface = &scene.surfaces[at.surface as usize];
        let lightmap = self.baked.lightmaps[at.surface as usize]?;
        let set = scene.geometry(surface).texcoords.get(lightmap.texcoord)?;
        let image = self.baked.pages[lightmap.page].image.as_ref().ok()?;
        let size = Vec2::new(image.size[0] as f32, image.size[1] as f32);
        let texels = scene.corner_indices(surface, at.triangle).map(|i| set[i] * size);
        let (own, _, _) = density::of_triangle(scene.corners_world(surface, at.triangle), texels)?;
        let here = (scene.texcoord(at, lightmap.texcoord)? * size / CHECKER_TEXELS).floor();
        let odd = (here.x + here.y).rem_euclid(2.0) >= 1.0;
        let octaves = ((own / self.median) as f32).log2();
        Some(scale(octaves / ENDS_OCTAVES) * if odd { 0.6 } else { 1.0 })
    }
}

/// Blue at −1 through cyan, green at 0, yellow to red at 1.
fn scale(x: f32) -> Vec3 {
    let x = if x.is_nan() { -1.0 } else { x.clamp(-1.0, 1.0) };
    let ramp = |centre: f32| (1.5 - 2.0 * (x - centre).abs()).clamp(0.0, 1.0);
    Vec3::new(ramp(1.0), ramp(0.0), ramp(-1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_runs_from_blue_through_green_to_red() {
        assert_eq!([scale(-1.0), scale(0.0), scale(7.0)], [Vec3::Z, Vec3::Y, Vec3::X]);
        assert_eq!([scale(0.5), scale(-0.5)], [Vec3::new(0.5, 0.5, 0.0), Vec3::new(0.0, 0.5, 0.5)]);
        assert_eq!(scale(f32::NAN), Vec3::Z);
    }
}
