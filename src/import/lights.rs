//! KHR_lights_punctual: lamps placed by their nodes, their numbers brought to W/sr and W/m².

use super::document::Document;
use super::extras;
use super::json::{NODES, Part};
use super::nodes::Hierarchy;
use crate::error::{Error, Result, Warning};
use crate::options::{ImportOptions, LampUnits};
use crate::scene::{Cone, Lamp, LampKind, SpotFalloff};
use crate::units::{Intensity, Irradiance};
use glam::{DAffine3, DVec3, Vec3};
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use gltf::json::validation::Checked;
use std::f32::consts::{FRAC_PI_2, PI};

const EXTENSION: &str = "KHR_lights_punctual";
/// How the generator of Blender's exporter begins.
const BLENDER: &str = "Khronos glTF Blender I/O";
/// lm/W by which Blender's "Standard" export multiplies: luminous efficacy of green light, not of white.
const BLENDER_LM_PER_W: f32 = 683.0;
/// Suns below this many lux and lamps below this many candela are implausible in Blender's "Standard" export: a sun of
/// 0.07 W/m², a lamp of 1.8 W.
const IMPLAUSIBLE_LUX: f32 = 50.0;
const IMPLAUSIBLE_CD: f32 = 100.0;
/// Widest radius of a lamp, metres.
pub(super) const MAX_RADIUS_M: f32 = 1e6;

/// Reads the lamps of the scene, and says how their numbers were meant.
pub(super) fn read(
    document: &Document,
    hierarchy: &Hierarchy,
    origin_world: DVec3,
    options: &ImportOptions,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Lamp>, LampUnits)> {
    let units = resolve_units(document, options.lamp_units)?;
    let sun_angle_rad = match options.sun_angle_deg {
        None => None,
        Some(degrees) if (0.0..=180.0).contains(&degrees) => Some(degrees.to_radians()),
        Some(degrees) => {
            let what = format!("the angular diameter of a sun must be from 0 to 180 degrees, not {degrees}");
            return Err(Error::invalid("--sun-angle", what));
        }
    };
    let mut lamps = Vec::new();
    let mut implausible = false;
    for (index, world) in hierarchy.world_from_node.iter().enumerate() {
        let Some(world) = world else { continue };
        let node = Part::item(&document.json, NODES, index)?;
        let Some(reference) = node.extension(EXTENSION)? else { continue };
        let number = reference.required_index("light")?;
        let light = Part::root(&document.json)?
            .extension(EXTENSION)?
            .and_then(|lights| lights.nth("lights", "light", number).ok())
            .ok_or_else(|| {
                reference.wrong("light", &format!("names light {number}, which does not exist"))
            })?;
        let placed = Placement { node, light, world: *world, origin_world, units, sun_angle_rad };
        if let Some((lamp, strength)) = placed.lamp(warnings)? {
            implausible |= match lamp.kind {
                LampKind::Sun { .. } => strength < IMPLAUSIBLE_LUX,
                LampKind::Point { .. } => strength < IMPLAUSIBLE_CD,
            };
            lamps.push(lamp);
        }
    }
    if !lamps.is_empty() {
        say_units(options.lamp_units, units, implausible, warnings);
    }
    Ok((lamps, units))
}

fn resolve_units(document: &Document, wanted: LampUnits) -> Result<LampUnits> {
    if wanted != LampUnits::Auto {
        return Ok(wanted);
    }
    let asset = Part::root(&document.json)?.object("asset")?;
    let generator = match &asset {
        Some(asset) => asset.text("generator")?.unwrap_or_default(),
        None => "",
    };
    Ok(if generator.starts_with(BLENDER) { LampUnits::Blender } else { LampUnits::Gltf })
}

fn say_units(wanted: LampUnits, units: LampUnits, implausible: bool, warnings: &mut Vec<Warning>) {
    let assumed = match (wanted, units) {
        (LampUnits::Auto, LampUnits::Blender) => Some(
            "assumed Blender's \"Standard\" lighting mode, because Blender wrote the file: numbers are divided by 683 \
             lm/W; --lamp-units says otherwise",
        ),
        (LampUnits::Auto, _) => Some(
            "assumed candela and lux, as glTF says: the lightmap is photometric; --lamp-units says otherwise",
        ),
        _ => None,
    };
    warnings.extend(assumed.map(|what| Warning::new("lamps", what)));
    if units == LampUnits::Blender && implausible {
        let what = "some are very weak for Blender's \"Standard\" lighting mode: if the file was exported with \
                    \"Unitless\", pass --lamp-units unitless";
        warnings.push(Warning::new("lamps", what));
    }
}

/// A light on a node.
struct Placement<'a> {
    node: Part<'a>,
    light: Part<'a>,
    world: DAffine3,
    origin_world: DVec3,
    units: LampUnits,
    sun_angle_rad: Option<f32>,
}

impl Placement<'_> {
    /// The lamp and its strength in the file's numbers; `None` for kinds that are not known.
    fn lamp(&self, warnings: &mut Vec<Warning>) -> Result<Option<(Lamp, f32)>> {
        let name = self.node.label();
        let broken = |error| Error::invalid(self.node.at(), format!("its light is broken: {error}"));
        let value = serde_json::Value::Object(self.light.object.clone());
        let light: Light = serde_json::from_value(value).map_err(broken)?;
        let Checked::Valid(kind) = light.type_ else {
            warnings.push(Warning::new(name, "its light is of a kind that glTF does not know: left out"));
            return Ok(None);
        };
        let color = Vec3::from_array(light.color) * light.intensity;
        if !color.is_finite() || color.min_element() < 0.0 {
            let what = "its light has a negative or endless colour or intensity: light can only be added";
            return Err(Error::invalid(self.node.at(), what));
        }
        let scale = if self.units == LampUnits::Blender { 1.0 / BLENDER_LM_PER_W } else { 1.0 };
        let direction = match kind {
            Type::Point => DVec3::NEG_Z,
            // Lengths do not count: only where the axis points.
            _ => match self.world.transform_vector3(DVec3::NEG_Z).try_normalize() {
                Some(direction) => direction,
                None => {
                    let what = "its node is scaled to nothing, so its light has no direction: left out";
                    warnings.push(Warning::new(name, what));
                    return Ok(None);
                }
            },
        };
        let parts = [&self.node, &self.light];
        let kind = match kind {
            Type::Directional => LampKind::Sun {
                toward_world: -direction.as_vec3(),
                irradiance: Irradiance(color * scale),
                angle_rad: match self.sun_angle_rad {
                    Some(angle) => angle,
                    None => extras::bounded(&parts, "angle", PI)?.unwrap_or(0.0),
                },
            },
            Type::Point | Type::Spot => LampKind::Point {
                position_world: (self.world.translation - self.origin_world).as_vec3(),
                intensity: Intensity(color * scale),
                range_m: self.range(light.range)?,
                radius_m: extras::bounded(&parts, "radius", MAX_RADIUS_M)?.unwrap_or(0.0),
                soft_falloff: extras::flag(&parts, "soft_falloff")?.unwrap_or(false),
                cone: if kind == Type::Spot { Some(self.cone(&light, direction.as_vec3())?) } else { None },
            },
        };
        Ok(Some((Lamp { name, kind }, color.max_element())))
    }

    fn range(&self, range: Option<f32>) -> Result<Option<f32>> {
        match range {
            Some(range) if !(range > 0.0 && range.is_finite()) => Err(Error::invalid(
                self.node.at(),
                format!("the range of its light must be above 0, not {range}"),
            )),
            lawful => Ok(lawful),
        }
    }

    fn cone(&self, light: &Light, direction_world: Vec3) -> Result<Cone> {
        let spot = light.spot.clone().ok_or_else(|| {
            Error::invalid(self.node.at(), "its spot light has no cone: export the scene again")
        })?;
        let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
        // Rounded up by exporters, a half circle may be a little more.
        if !(inner >= 0.0 && outer > 0.0 && outer <= FRAC_PI_2 + 1e-4) {
            let what =
                format!("the cone of its spot light must lie within 0 and π/2, not from {inner} to {outer}");
            return Err(Error::invalid(self.node.at(), what));
        }
        let outer_rad = outer.min(FRAC_PI_2);
        // Blender writes equal angles for a spot without blend, although glTF wants the inner one smaller.
        let inner_rad = inner.min(outer_rad);
        let falloff = if self.units == LampUnits::Gltf { SpotFalloff::Gltf } else { SpotFalloff::Blender };
        Ok(Cone { direction_world, inner_rad, outer_rad, falloff })
    }
}
