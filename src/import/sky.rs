//! Which sky: the caller's, or the one in the scene's custom properties. glTF has none of its own.

use super::document::Document;
use super::extras;
use super::json::{Part, SCENES};
use super::sky_image;
use super::uri;
use crate::error::{Error, Result, Warning};
use crate::options::{ImportOptions, SkyOption};
use crate::scene::Sky;
use crate::units::Radiance;
use glam::Vec3;
use serde_json::Value;

/// The sky of the scene.
pub(super) fn read(
    document: &Document,
    scene: Option<usize>,
    options: &ImportOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Sky> {
    match (&options.sky, scene) {
        (Some(SkyOption::Constant(radiance)), _) => constant(radiance.0, 1.0, "--sky"),
        (Some(SkyOption::Image { path, strength }), _) => {
            let bytes = std::fs::read(path).map_err(|source| Error::io(path, source))?;
            sky_image::read(&bytes, &path.display().to_string(), *strength, warnings).map(Sky::Image)
        }
        (None, Some(scene)) => from_extras(document, scene, options, warnings),
        (None, None) => Ok(Sky::None),
    }
}

fn from_extras(
    document: &Document,
    scene: usize,
    options: &ImportOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Sky> {
    let part = Part::item(&document.json, SCENES, scene)?;
    let at = part.at();
    let must = |what: &str| Error::invalid(at.clone(), what);
    let strength = match extras::own_or_plain(&part, "sky_strength") {
        None => 1.0,
        Some(value) => value
            .as_f64()
            .map(|strength| strength as f32)
            .ok_or_else(|| must("its custom property sky_strength must be a number"))?,
    };
    let rotation_deg = match extras::own_or_plain(&part, "sky_rotation") {
        None => 0.0,
        Some(value) => value
            .as_f64()
            .filter(|degrees| degrees.abs() <= 1e6)
            .ok_or_else(|| must("its custom property sky_rotation must be a number of degrees"))?,
    };
    match extras::own_or_plain(&part, "sky") {
        None | Some(Value::Null) => Ok(Sky::None),
        Some(Value::Array(values)) => {
            let numbers: Vec<f32> = values.iter().filter_map(Value::as_f64).map(|v| v as f32).collect();
            match (numbers.as_slice(), values.len()) {
                // Blender colours come with alpha.
                ([r, g, b] | [r, g, b, _], 3 | 4) => constant(Vec3::new(*r, *g, *b), strength, &at),
                _ => Err(must("its custom property sky must be three numbers")),
            }
        }
        Some(Value::String(file)) => {
            let bytes = document.companion_bytes(file, options, &at)?;
            let image = sky_image::read(&bytes, &uri::shorten(file), strength, warnings)?;
            Ok(Sky::Image(image.turned(rotation_deg)))
        }
        Some(_) => {
            Err(must("its custom property sky must be three numbers or the name of an .exr or .hdr file"))
        }
    }
}

fn constant(radiance: Vec3, strength: f32, at: &str) -> Result<Sky> {
    let radiance = radiance * strength;
    if !radiance.is_finite() || radiance.min_element() < 0.0 {
        return Err(Error::invalid(at, "the sky must be three finite numbers that are not negative"));
    }
    Ok(if radiance == Vec3::ZERO { Sky::None } else { Sky::Constant(Radiance(radiance)) })
}
