//! Baked file -> picture: the lightmap times the surface's colour, seen through the scene's own tree of triangles. No
//! light is computed here.

mod eye;
mod look;
mod tone;

pub(crate) use eye::Eye;
pub(crate) use look::{Lit, Look};

use crate::baked::Baked;
use crate::error::{Error, Result};
use crate::options::{Exposure, RenderOptions, Tone};
use crate::sampling::sobol4;
use crate::scene::Scene;
use crate::transport::{Tracer, World};
use crate::with_tracer;
use glam::Vec3;
use look::{Seen, look};
use rayon::prelude::*;
use tone::Developer;

/// Neighbours that differ by more than this, of the screen's range, have an edge between them.
const EDGE: f32 = 1.0 / 32.0;
/// Looks through a pixel on an edge.
const EDGE_SAMPLES: u32 = 16;

/// A picture for the screen.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// sRGB, row by row from the top, three bytes a pixel.
    pub rgb: Vec<u8>,
    /// The exposure that was chosen or given: radiances were multiplied by 2 to this power.
    pub exposure_ev: f32,
    /// What it was taken with.
    pub camera: String,
}

/// A picture of a baked file.
///
/// # Errors
/// A camera that is not there; a size that cannot be; a page of light that cannot be read.
pub fn picture(baked: &Baked, options: &RenderOptions) -> Result<Picture> {
    for page in &baked.pages {
        if let Err(what) = &page.image {
            return Err(Error::invalid(&page.file, what));
        }
    }
    let world = World::new(&baked.scene);
    let eye = Eye::new(&baked.scene, world.bounds(), &options.view, options.size)?;
    let lit = Lit::new(baked);
    Ok(with_tracer!(world.tracer(&baked.scene), tracer => {
        take(&baked.scene, tracer, &lit, &eye, options.exposure, options.tone)
    }))
}

/// Looks through the middle of every pixel, chooses the exposure, then looks again where the picture has edges.
pub(crate) fn take<T: Tracer, L: Look>(
    scene: &Scene,
    tracer: &T,
    how: &L,
    eye: &Eye,
    exposure: Exposure,
    tone: Tone,
) -> Picture {
    let [width, height] = eye.size.map(|side| side as usize);
    let first: Vec<Seen> = (0..width * height)
        .into_par_iter()
        .map(|i| look(scene, tracer, how, eye.ray((i % width) as f32 + 0.5, (i / width) as f32 + 0.5)))
        .collect();
    let seen = first.iter().filter(|seen| seen.surface).map(|seen| seen.radiance);
    let developer = Developer::new(exposure, tone, seen);
    let shown: Vec<Vec3> =
        first.par_iter().map(|seen| tone::srgb(developer.develop(seen.radiance))).collect();

    let points = sobol4(EDGE_SAMPLES, 0, 11);
    let mut rgb = vec![0; width * height * 3];
    rgb.par_chunks_exact_mut(3 * width).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let here = shown[y * width + x];
            let differs = |x: usize, y: usize| {
                shown.get(y * width + x).is_some_and(|there| (*there - here).abs().max_element() > EDGE)
            };
            let edge = (x > 0 && differs(x - 1, y))
                || (x + 1 < width && differs(x + 1, y))
                || (y > 0 && differs(x, y - 1))
                || (y + 1 < height && differs(x, y + 1));
            let value = if edge {
                // The screen's light is averaged, not the scene's: a highlight must not eat the pixels around it.
                let sum: Vec3 = points
                    .iter()
                    .map(|p| look(scene, tracer, how, eye.ray(x as f32 + p[0], y as f32 + p[1])))
                    .map(|seen| developer.develop(seen.radiance))
                    .sum();
                tone::srgb(sum / points.len() as f32)
            } else {
                here
            };
            pixel.copy_from_slice(&tone::bytes(value));
        }
    });
    Picture { size: eye.size, rgb, exposure_ev: developer.ev(), camera: eye.name.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::View;
    use crate::scene::{Camera, Projection, SurfacePoint};
    use glam::DAffine3;

    /// Everything there is is white before black.
    struct White;

    impl Look for White {
        fn radiance(&self, _: SurfacePoint, _: Vec3) -> Vec3 {
            Vec3::ONE
        }

        fn background(&self, _: Vec3) -> Vec3 {
            Vec3::ZERO
        }
    }

    #[test]
    fn a_pixel_on_an_edge_shows_the_share_that_is_covered() {
        // One triangle whose upright edge cuts the pixels of column 2 at 0.25 of their width, seen from above.
        let corners =
            vec![[Vec3::new(-40.0, 0.0, 40.0), Vec3::new(0.25, 0.0, 40.0), Vec3::new(0.25, 0.0, -80.0)]];
        let world = World::opaque(corners);
        let mut scene = Scene::default();
        scene.materials.push(crate::scene::Material { double_sided: true, ..Default::default() });
        scene.geometries.push(crate::scene::Geometry { triangles: vec![[0, 1, 2]], ..Default::default() });
        scene.surfaces.push(crate::scene::Surface {
            origin: Default::default(),
            geometry: crate::scene::GeometryId(0),
            material: crate::scene::MaterialId(0),
            world_from_local: DAffine3::IDENTITY,
            position_world: [(-40.0, 40.0), (0.25, 40.0), (0.25, -80.0)]
                .map(|(x, z)| Vec3::new(x, 0.0, z))
                .to_vec(),
            normal_world: vec![Vec3::Y; 3],
            mirrored: false,
            role: crate::scene::Role::Lightmapped,
            density_factor: 1.0,
        });
        scene.cameras.push(Camera {
            name: "down".into(),
            world_from_camera: DAffine3::from_translation(glam::DVec3::Y)
                * DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2),
            projection: Projection::Orthographic { half_width_m: 2.0, half_height_m: 2.0 },
            clip_m: [0.0, 10.0],
        });
        let eye = Eye::new(&scene, world.bounds(), &View::First, Some([4, 4])).unwrap();
        let tracer = crate::transport::OpaqueTracer::new(&world);
        let picture = take(&scene, &tracer, &White, &eye, Exposure::Ev(0.0), Tone::Clip);
        let row: Vec<u8> = picture.rgb[12..24].chunks(3).map(|pixel| pixel[0]).collect();
        // sRGB of a quarter is 137; 16 points that lie in 16 strips of each axis are off by less than one of them.
        let quarter = [3.0_f32, 5.0].map(|n| tone::bytes(tone::srgb(Vec3::splat(n / 16.0)))[0]);
        assert_eq!([row[0], row[1], row[3]], [255, 255, 0], "{row:?}");
        assert!((quarter[0]..=quarter[1]).contains(&row[2]), "{row:?}");
    }
}
