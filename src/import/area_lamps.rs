//! Area lamps: glTF has none, so they come as a custom property of their node, `lightkiln.area_lamp`:
//!
//! `{"shape": "rectangle" or "ellipse", "size": [width, height], "power": W, "color": [r, g, b]}`
//!
//! They shine along the node's −z from the rectangle, or the ellipse in it, that width and height span along its x and y;
//! the node's scale counts. The radiance is power × colour / (π × area), the same everywhere and in all directions, as
//! Blender's is. Nothing is hidden by such a lamp and no ray meets it: it is an emitter and no more.

use super::document::Document;
use super::extras;
use super::json::{NODES, Part};
use super::nodes::Hierarchy;
use crate::error::{Error, Result, Warning};
use crate::scene::{Alpha, Geometry, GeometryId, Material, MaterialId, Origin, Role, Scene, Surface};
use crate::units::Radiance;
use glam::{DVec3, Vec3, Vec4};
use serde_json::Value;
use std::f64::consts::PI;

const PROPERTY: &str = "area_lamp";
/// Corners of the polygon that stands for an ellipse; its area is the ellipse's.
const CORNERS: u32 = 48;

/// Adds the area lamps of the scene to its surfaces.
pub(super) fn add(document: &Document, hierarchy: &Hierarchy, scene: &mut Scene) -> Result<()> {
    for (index, world) in hierarchy.world_from_node.iter().enumerate() {
        let Some(world) = world else { continue };
        let node = Part::item(&document.json, NODES, index)?;
        let Some(value) = extras::own(&node, PROPERTY) else { continue };
        let lamp = AreaLamp::read(&node, value)?;
        let place = |p: DVec3| world.transform_point3(p) - scene.origin_world;
        let outline: Vec<DVec3> = lamp.outline().into_iter().map(place).collect();
        let area = area(&outline);
        if !(area > 0.0 && area.is_finite()) {
            let what = "its area lamp has no area: left out";
            scene.warnings.push(Warning::new(node.label(), what));
            continue;
        }
        let radiance = (lamp.color.as_dvec3() * f64::from(lamp.power) / (PI * area)).as_vec3();
        if !radiance.is_finite() {
            return Err(Error::invalid(
                node.at(),
                "its area lamp is too bright to compute: lower its power, or make it larger",
            ));
        }
        if radiance != Vec3::ZERO {
            let mirrored = world.matrix3.determinant() < 0.0;
            push(scene, node.label(), index, outline, mirrored, Radiance(radiance));
        }
    }
    Ok(())
}

/// The property, checked.
struct AreaLamp {
    ellipse: bool,
    size: [f64; 2],
    power: f32,
    color: Vec3,
}

impl AreaLamp {
    fn read(node: &Part, value: &Value) -> Result<Self> {
        let wrong = |key: &str, must: &str| {
            Error::invalid(node.at(), format!("\"{key}\" of its custom property lightkiln.{PROPERTY} {must}"))
        };
        let numbers = |key: &str| -> Option<Vec<f64>> {
            value.get(key)?.as_array()?.iter().map(Value::as_f64).collect()
        };
        let positive = |x: &f64| *x > 0.0 && *x <= f64::from(super::lights::MAX_RADIUS_M);
        let size = match numbers("size").as_deref() {
            Some(&[w, h]) if positive(&w) && positive(&h) => [w, h],
            _ => return Err(wrong("size", "must be two numbers above 0, width and height in metres")),
        };
        let ellipse = match value.get("shape").and_then(Value::as_str) {
            Some("rectangle") => false,
            Some("ellipse") => true,
            _ => return Err(wrong("shape", "must be \"rectangle\" or \"ellipse\"")),
        };
        let power = value.get("power").and_then(Value::as_f64).map(|power| power as f32);
        let power = power.filter(|power| *power >= 0.0 && power.is_finite());
        let power = power.ok_or_else(|| wrong("power", "must be a number that is not negative"))?;
        let color = match numbers("color").as_deref() {
            None if value.get("color").is_none() => Vec3::ONE,
            Some(&[r, g, b]) => Vec3::new(r as f32, g as f32, b as f32),
            _ => Vec3::NAN,
        };
        if !(color.is_finite() && color.min_element() >= 0.0) {
            return Err(wrong("color", "must be three numbers that are not negative"));
        }
        Ok(Self { ellipse, size, power, color })
    }

    /// Corners in the node's space, counter-clockwise seen from the side that shines.
    fn outline(&self) -> Vec<DVec3> {
        let [a, b] = self.size.map(|side| side / 2.0);
        if !self.ellipse {
            return [(-a, -b), (-a, b), (a, b), (a, -b)].map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
        }
        let step = 2.0 * PI / f64::from(CORNERS);
        let widen = (step / step.sin()).sqrt();
        (0..CORNERS)
            .map(|k| {
                let (sin, cos) = (-f64::from(k) * step).sin_cos();
                DVec3::new(a * widen * cos, b * widen * sin, 0.0)
            })
            .collect()
    }
}

/// Area of a flat outline.
fn area(outline: &[DVec3]) -> f64 {
    let fan = outline[1..].windows(2).map(|pair| (pair[0] - outline[0]).cross(pair[1] - outline[0]));
    fan.sum::<DVec3>().length() / 2.0
}

fn push(
    scene: &mut Scene,
    name: String,
    node: usize,
    outline: Vec<DVec3>,
    mirrored: bool,
    emission: Radiance,
) {
    let corners = outline.len() as u32;
    let position_world: Vec<Vec3> = outline.iter().map(|p| p.as_vec3()).collect();
    // Neighbours in the list are pairs that make quads.
    let triangles: Vec<[u32; 3]> = (1..corners - 1).map(|k| [0, k, k + 1]).collect();
    let normal = {
        let [a, b, c] = [0, 1, 2].map(|k| outline[k]);
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
        if mirrored { -normal } else { normal }
    };
    scene.geometries.push(Geometry {
        name: name.clone(),
        position_local: position_world.clone(),
        normal_local: vec![normal; position_world.len()],
        triangles,
        ..Geometry::default()
    });
    scene.materials.push(Material {
        name: name.clone(),
        base_color: Vec4::ZERO,
        emission,
        // Wholly a hole: it stops no ray.
        alpha: Alpha::Mask { cutoff: 1.0 },
        ..Material::default()
    });
    scene.surfaces.push(Surface {
        origin: Origin { name, node, mesh: usize::MAX, primitive: 0, instance: None },
        geometry: GeometryId(scene.geometries.len() as u32 - 1),
        material: MaterialId(scene.materials.len() as u32 - 1),
        world_from_local: glam::DAffine3::from_translation(scene.origin_world),
        normal_world: vec![normal; position_world.len()],
        position_world,
        mirrored,
        role: Role::Emits,
        density_factor: 1.0,
    });
}
