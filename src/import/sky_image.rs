//! Pictures of the sky: Radiance HDR and OpenEXR, equirectangular.

use super::claims;
use crate::error::{Error, Result, Warning};
use crate::scene::SkyImage;
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, Vec2};
use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder};
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The most pixels of a sky: 16384 × 8192.
const MAX_PIXELS: usize = 1 << 27;
/// Bytes of a pixel in memory.
const PIXEL_BYTES: usize = 12;
/// The most bytes a pixel of an EXR may have in all its channels together: decoders take memory for whole blocks.
const MAX_PIXEL_BYTES: usize = 256;

/// Decodes a sky. `at` names the file, `strength` multiplies every pixel.
pub(super) fn read(bytes: &[u8], at: &str, strength: f32, warnings: &mut Vec<Warning>) -> Result<SkyImage> {
    if !(strength >= 0.0 && strength.is_finite()) {
        return Err(Error::invalid(at, format!("the strength of the sky must be 0 or more, not {strength}")));
    }
    let decode = || match bytes {
        _ if bytes.starts_with(&[0x76, 0x2F, 0x31, 0x01]) => read_exr(bytes),
        _ if bytes.starts_with(b"#?") => read_hdr(bytes),
        _ => Err("is neither OpenEXR nor Radiance HDR".to_owned()),
    };
    // Foreign decoders: whatever they do with a broken file, it is an error and nothing worse.
    let decoded =
        catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| Err("cannot be decoded".to_owned()));
    let (size, mut pixels) = decoded.map_err(|what| {
        Error::invalid(
            at,
            format!("this sky {what}; save it as an equirectangular .exr or .hdr with R, G and B"),
        )
    })?;
    clean(&mut pixels, strength, at, warnings);
    if size[0] != 2 * size[1] {
        let what = format!(
            "this sky is {} × {}, not twice as wide as high: it is stretched over the sphere",
            size[0], size[1]
        );
        warnings.push(Warning::new(at, what));
    }
    SkyImage::new(size, pixels).ok_or_else(|| Error::invalid(at, "this sky is empty"))
}

/// Light is neither negative nor endless: such pixels are brought to the nearest value that is light.
fn clean(pixels: &mut [Vec3], strength: f32, at: &str, warnings: &mut Vec<Warning>) {
    let mut brightest = 0.0_f32;
    for pixel in pixels.iter_mut() {
        *pixel *= strength;
        for channel in pixel.to_array() {
            if channel.is_finite() {
                brightest = brightest.max(channel);
            }
        }
    }
    let (mut dark, mut endless) = (0_usize, 0_usize);
    for pixel in pixels.iter_mut() {
        let lawful = pixel.map(|channel| if channel.is_nan() { 0.0 } else { channel.clamp(0.0, brightest) });
        if lawful != *pixel {
            let is_endless = pixel.to_array().contains(&f32::INFINITY);
            endless += usize::from(is_endless);
            dark += usize::from(!is_endless);
            *pixel = lawful;
        }
    }
    if dark > 0 {
        warnings.push(Warning::new(
            at,
            format!("{dark} pixels of this sky are negative or not numbers: black is used"),
        ));
    }
    if endless > 0 {
        let what = format!("{endless} pixels of this sky are infinite: its brightest finite value is used");
        warnings.push(Warning::new(at, what));
    }
}

type Decoded = std::result::Result<([u32; 2], Vec<Vec3>), String>;

fn check_size(
    [width, height]: [usize; 2],
    pixel_bytes: usize,
    bytes: &[u8],
) -> std::result::Result<[u32; 2], String> {
    match width.checked_mul(height) {
        Some(pixels @ 1..=MAX_PIXELS)
            if claims::SKY_PIXELS.holds((pixels * pixel_bytes.div_ceil(PIXEL_BYTES)) as u64, bytes.len()) =>
        {
            Ok([width as u32, height as u32])
        }
        Some(1..=MAX_PIXELS) => {
            Err(format!("claims {width} × {height} pixels, far more than its {} bytes can hold", bytes.len()))
        }
        _ => Err(format!("is {width} × {height} pixels; at most {MAX_PIXELS} are read")),
    }
}

fn read_hdr(bytes: &[u8]) -> Decoded {
    let broken = |error: image::ImageError| format!("cannot be decoded ({error})");
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let size = check_size([width as usize, height as usize], PIXEL_BYTES, bytes)?;
    let pixels = DynamicImage::from_decoder(decoder).map_err(broken)?.into_rgb32f();
    Ok((size, pixels.pixels().map(|pixel| Vec3::from_array(pixel.0)).collect()))
}

fn read_exr(bytes: &[u8]) -> Decoded {
    let broken = |error: exr::error::Error| format!("cannot be decoded ({error})");
    // The header first: the decoder believes its sizes and takes memory for them.
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        let size = [header.layer_size.width(), header.layer_size.height()];
        check_size(size, header.channels.bytes_per_pixel, bytes)?;
        if header.channels.bytes_per_pixel > MAX_PIXEL_BYTES {
            return Err(format!(
                "has {} bytes a pixel; at most {MAX_PIXEL_BYTES} are read",
                header.channels.bytes_per_pixel
            ));
        }
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size: Vec2<usize>, _: &_| (size, vec![Vec3::ZERO; size.area().min(MAX_PIXELS)]),
            |(size, pixels): &mut (Vec2<usize>, Vec<Vec3>), at: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
                if let Some(pixel) = pixels.get_mut(at.y() * size.width() + at.x()) {
                    *pixel = Vec3::new(r, g, b);
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let (size, pixels) = image.layer_data.channel_data.pixels;
    Ok((check_size([size.width(), size.height()], PIXEL_BYTES, bytes)?, pixels))
}
