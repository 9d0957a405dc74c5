//! Pages as 8 bit pictures: the fallback that viewers without EXR show, and a picture to look at.

use super::exr::lawful;
use super::files::Batch;
use crate::error::{Error, Result};
use crate::resolve::{Lightmap, LightmapPage};
use glam::Vec3;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use std::path::Path;

/// Half the width and height, linear values clipped at 1, eight bits: what readers see that know PNG only. They
/// read a lightmap as linear data, so there is no sRGB curve.
pub(super) fn fallback_png(at: &str, page: &LightmapPage) -> Result<Vec<u8>> {
    let size = page.size_texels as usize;
    let half = size.div_ceil(2);
    let mut rgb = Vec::with_capacity(half * half * 3);
    for y in 0..half {
        for x in 0..half {
            let corner = |dx: usize, dy: usize| {
                page.value[(2 * y + dy).min(size - 1) * size + (2 * x + dx).min(size - 1)]
            };
            let four = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
            rgb.extend([0, 1, 2].map(|axis| {
                let mean = four.iter().map(|texel| lawful(texel[axis], 1.0)).sum::<f32>() / 4.0;
                (mean * 255.0).round() as u8
            }));
        }
    }
    png(at, &rgb, half, half)
}

/// All pages side by side as a picture: exposed so that the brightest hundredth of the covered texels burns out,
/// sRGB curve; dilated texels are shown, what they surround is black.
pub fn picture_png(lightmap: &Lightmap) -> Result<Vec<u8>> {
    let ([width, height], rgb) = picture_rgb(lightmap);
    png("picture", &rgb, width, height)
}

/// The same as width and height and three bytes a pixel, row by row from the top.
pub fn picture_rgb(lightmap: &Lightmap) -> ([usize; 2], Vec<u8>) {
    let width: usize = lightmap.pages.iter().map(|page| page.size_texels as usize).sum();
    let height = lightmap.pages.iter().map(|page| page.size_texels as usize).max().unwrap_or(0);
    let exposure = 1.0 / white(lightmap);
    let mut rgb = vec![0; width * height * 3];
    let mut left = 0;
    for page in &lightmap.pages {
        let size = page.size_texels as usize;
        for (y, row) in page.value.chunks_exact(size.max(1)).enumerate() {
            let from = (y * width + left) * 3;
            for (out, value) in rgb[from..from + size * 3].chunks_exact_mut(3).zip(row) {
                out.copy_from_slice(&value.to_array().map(|c| srgb(c * exposure)));
            }
        }
        left += size;
    }
    ([width, height], rgb)
}

/// A PNG of three bytes a pixel, sRGB, row by row from the top.
pub fn encode_png(size: [u32; 2], rgb: &[u8]) -> Result<Vec<u8>> {
    let [width, height] = size.map(|side| side as usize);
    if width * height * 3 != rgb.len() {
        return Err(Error::invalid(
            "picture",
            format!("{} bytes are not {width} × {height} pixels", rgb.len()),
        ));
    }
    png("picture", rgb, width, height)
}

/// The value that becomes white: the 99th percentile of the brightest channel over covered texels, never zero.
fn white(lightmap: &Lightmap) -> f32 {
    let mut peaks: Vec<f32> = lightmap
        .pages
        .iter()
        .flat_map(|page| page.value.iter().zip(&page.covered))
        .filter(|(value, covered)| **covered && value.is_finite())
        .map(|(value, _)| value.max_element())
        .collect();
    if peaks.is_empty() {
        return 1.0;
    }
    let rank = (peaks.len() - 1) * 99 / 100;
    let (_, peak, _) = peaks.select_nth_unstable_by(rank, f32::total_cmp);
    if *peak > 0.0 { *peak } else { 1.0 }
}

fn srgb(linear: f32) -> u8 {
    (curve(linear) * 255.0).round() as u8
}

/// IEC 61966-2-1.
fn curve(linear: f32) -> f32 {
    let x = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// A square page from 0 to 1 as sRGB with 16 bits.
pub(super) fn deep_png(at: &str, size_texels: u32, value: &[Vec3]) -> Result<Vec<u8>> {
    let deep = |linear: f32| (curve(linear) * 65535.0).round() as u16;
    let rgb: Vec<[u16; 3]> = value.par_iter().map(|value| value.to_array().map(deep)).collect();
    encode(at, bytemuck::cast_slice(&rgb), [size_texels; 2], ExtendedColorType::Rgb16)
}

/// Writes a picture, sRGB, three bytes a pixel, row by row from the top; whole or not at all.
pub fn write_png(path: &Path, size: [u32; 2], rgb: &[u8]) -> Result<()> {
    let [width, height] = size.map(|side| side as usize);
    let at = path.display().to_string();
    if width * height * 3 != rgb.len() {
        return Err(Error::invalid(at, format!("{} bytes are not {width} × {height} pixels", rgb.len())));
    }
    let mut batch = Batch::new([]);
    batch.add(path, &[&png(&at, rgb, width, height)?])?;
    batch.commit().map(drop)
}

fn png(at: &str, rgb: &[u8], width: usize, height: usize) -> Result<Vec<u8>> {
    let side = |n: usize| u32::try_from(n).map_err(|_| Error::invalid(at, "too large for a PNG"));
    encode(at, rgb, [side(width)?, side(height)?], ExtendedColorType::Rgb8)
}

fn encode(at: &str, bytes: &[u8], [width, height]: [u32; 2], kind: ExtendedColorType) -> Result<Vec<u8>> {
    let failed =
        |error: image::ImageError| Error::invalid(at, format!("the PNG could not be encoded: {error}"));
    let mut out = Vec::new();
    PngEncoder::new(&mut out).write_image(bytes, width, height, kind).map_err(failed)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(size: u32, value: Vec<Vec3>) -> LightmapPage {
        LightmapPage { size_texels: size, covered: vec![true; value.len()], value }
    }

    fn pixels(png: &[u8]) -> (u32, u32, Vec<[u8; 3]>) {
        let read = image::load_from_memory_with_format(png, image::ImageFormat::Png).unwrap().to_rgb8();
        (read.width(), read.height(), read.pixels().map(|p| p.0).collect())
    }

    #[test]
    fn the_fallback_is_half_as_wide_linear_and_clipped() {
        let mut value = vec![Vec3::ZERO; 16];
        value[0] = Vec3::new(9.0, 0.5, f32::NAN);
        value[1] = Vec3::new(1.0, 0.5, 0.0);
        (value[4], value[5]) = (value[1], value[1]);
        let (w, h, found) = pixels(&fallback_png("page", &page(4, value)).unwrap());
        assert_eq!((w, h), (2, 2));
        assert_eq!(found, [[255, 128, 0], [0; 3], [0; 3], [0; 3]]);
        let (w, h, found) = pixels(&fallback_png("page", &page(1, vec![Vec3::splat(0.2)])).unwrap());
        assert_eq!((w, h, found), (1, 1, vec![[51; 3]]));
    }

    #[test]
    fn the_picture_shows_pages_side_by_side() {
        let lightmap =
            Lightmap { pages: vec![page(2, vec![Vec3::splat(4.0); 4]), page(1, vec![Vec3::ZERO])] };
        let (w, h, found) = pixels(&picture_png(&lightmap).unwrap());
        assert_eq!((w, h), (3, 2));
        assert_eq!(found, [[255; 3], [255; 3], [0; 3], [255; 3], [255; 3], [0; 3]]);
    }
}
