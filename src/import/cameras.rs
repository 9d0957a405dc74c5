//! Cameras, placed by their nodes. They matter to pictures only, so a broken one is left out with a warning.

use super::document::Document;
use super::json::{CAMERAS, NODES, Part};
use super::nodes::Hierarchy;
use crate::error::{Error, Result, Warning};
use crate::scene::{Camera, Projection};
use glam::DAffine3;
use std::f32::consts::PI;

/// The cameras of the scene, in the order of their nodes.
pub(super) fn read(document: &Document, hierarchy: &Hierarchy, warnings: &mut Vec<Warning>) -> Vec<Camera> {
    let mut cameras = Vec::new();
    for (index, world) in hierarchy.world_from_node.iter().enumerate() {
        let (Some(world), Ok(node)) = (world, Part::item(&document.json, NODES, index)) else { continue };
        match camera(document, &node, *world) {
            Ok(None) => {}
            Ok(Some(camera)) => cameras.push(camera),
            Err(error) => warnings.push(Warning::new(node.label(), format!("camera left out: {error}"))),
        }
    }
    cameras
}

fn camera(document: &Document, node: &Part, world_from_camera: DAffine3) -> Result<Option<Camera>> {
    let Some(part) = node.follow(&document.json, "camera", CAMERAS)? else { return Ok(None) };
    match projection(&part)? {
        Some((projection, clip_m)) if world_from_camera.matrix3.determinant() != 0.0 => {
            Ok(Some(Camera { name: node.label(), world_from_camera, projection, clip_m }))
        }
        _ => Err(Error::invalid(part.at(), "it has a lens that shows nothing, or a scale of zero")),
    }
}

/// How it sees and between which distances; `None` for a lens that cannot be.
fn projection(camera: &Part) -> Result<Option<(Projection, [f32; 2])>> {
    let number = |part: &Part, key: &str| part.object.get(key).and_then(|v| v.as_f64()).map(|v| v as f32);
    let positive = |x: &f32| *x > 0.0 && x.is_finite();
    let (part, projection) = match (camera.object("perspective")?, camera.object("orthographic")?) {
        (Some(part), _) => {
            let Some(yfov_rad) = number(&part, "yfov").filter(|angle| positive(angle) && *angle < PI) else {
                return Ok(None);
            };
            let aspect = number(&part, "aspectRatio").filter(positive);
            (part, Projection::Perspective { yfov_rad, aspect })
        }
        (None, Some(part)) => {
            // Negative magnifications mirror the picture; nobody means that.
            let half = |key| number(&part, key).map(f32::abs).filter(positive);
            let (Some(half_width_m), Some(half_height_m)) = (half("xmag"), half("ymag")) else {
                return Ok(None);
            };
            (part, Projection::Orthographic { half_width_m, half_height_m })
        }
        (None, None) => return Ok(None),
    };
    let near = number(&part, "znear").filter(|near| near.is_finite()).unwrap_or(0.0).max(0.0);
    let far = number(&part, "zfar").filter(|far| *far > near).unwrap_or(f32::INFINITY);
    Ok(Some((projection, [near, far])))
}

#[cfg(test)]
mod tests {
    use super::super::nodes;
    use super::*;
    use crate::import::document::Container;
    use glam::DVec3;
    use serde_json::json;

    #[test]
    fn lenses_come_with_their_nodes_and_broken_ones_are_left_out() {
        let json = json!({
            "cameras": [
                {"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 1.5, "znear": 0.1, "zfar": 100}},
                {"type": "orthographic", "orthographic": {"xmag": 4, "ymag": -3, "znear": 0, "zfar": 10}},
                {"type": "perspective", "perspective": {"yfov": 0}},
                {"type": "perspective", "perspective": {"yfov": 1}}
            ],
            "nodes": [
                {"name": "Eye", "camera": 0, "translation": [1, 2, 3]}, {"name": "Plan", "camera": 1},
                {"name": "Shut", "camera": 2}, {"name": "Flat", "camera": 3, "scale": [0, 1, 1]},
                {"name": "Lost", "camera": 9}
            ],
            "scenes": [{"nodes": [0, 1, 2, 3, 4]}]
        });
        let mut warnings = Vec::new();
        let hierarchy = nodes::place(&json, None, &mut warnings).unwrap();
        let document = Document {
            path: "a.gltf".into(),
            json,
            exponents: Default::default(),
            container: Container::Json,
            buffers: Vec::new(),
        };
        let cameras = read(&document, &hierarchy, &mut warnings);
        assert_eq!(cameras.len(), 2);
        assert_eq!(cameras[0].name, "Eye");
        assert_eq!(cameras[0].world_from_camera.translation, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(cameras[0].projection, Projection::Perspective { yfov_rad: 0.8, aspect: Some(1.5) });
        assert_eq!(cameras[0].clip_m, [0.1, 100.0]);
        assert_eq!(cameras[1].projection, Projection::Orthographic { half_width_m: 4.0, half_height_m: 3.0 });
        let at: Vec<&str> = warnings.iter().map(|w| w.at.as_str()).collect();
        assert_eq!(at, ["Shut", "Flat", "Lost"]);
    }
}
