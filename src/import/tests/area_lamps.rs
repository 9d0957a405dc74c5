use super::*;
use crate::scene::{Alpha, Role, Surface};
use glam::Vec3;
use serde_json::json;
use std::f32::consts::PI;

fn lit(extras: Value, node: Value) -> Result<Scene> {
    let mut node = node;
    node["name"] = json!("Panel");
    node["extras"] = extras;
    let json = json!({"nodes": [{"name": "Wall", "mesh": 0}, node], "scenes": [{"nodes": [0, 1]}]});
    Builder::square().load_square(json, &ImportOptions::default()).map(|(_, scene)| scene)
}

fn panel(scene: &Scene) -> &Surface {
    scene.surfaces.iter().find(|surface| surface.role == Role::Emits).expect("there is a lamp")
}

/// Mean normal and area of what shines.
fn shape(scene: &Scene) -> (Vec3, f32) {
    let surface = panel(scene);
    let count = scene.geometry(surface).triangles.len() as u32;
    let sum: Vec3 =
        (0..count).map(|t| scene.corners_world(surface, t)).map(|[a, b, c]| (b - a).cross(c - a) / 2.0).sum();
    (sum.normalize(), sum.length())
}

#[test]
fn power_is_spread_over_the_area_and_all_directions() {
    let lamp = json!({"lightkiln": {"area_lamp": {
        "shape": "rectangle", "size": [2, 0.5], "power": 100, "color": [1, 0.5, 0.25]}}});
    let scene = lit(lamp.clone(), json!({"translation": [0, 3, 0]})).unwrap();
    let material = scene.material(panel(&scene));
    assert!((material.emission.0 - Vec3::new(1.0, 0.5, 0.25) * (100.0 / PI)).length() < 1e-4);
    let (normal, area) = shape(&scene);
    // Blender's lamps, and glTF's, shine along their own −z.
    assert!((normal - Vec3::NEG_Z).length() < 1e-6 && (area - 1.0).abs() < 1e-6);
    // Twice as wide: the same power from twice the area.
    let wide = lit(lamp.clone(), json!({"scale": [2, 1, 1]})).unwrap();
    assert!((wide.material(panel(&wide)).emission.0.x - 50.0 / PI).abs() < 1e-4);
    // Turned down, and mirrored: the lit side stays the node's −z.
    let down = json!({"rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0, 0, std::f64::consts::FRAC_1_SQRT_2],
        "scale": [-1, 1, 1]});
    let (normal, area) = shape(&lit(lamp, down).unwrap());
    assert!((normal - Vec3::NEG_Y).length() < 1e-6 && (area - 1.0).abs() < 1e-6, "{normal}");
}

#[test]
fn an_ellipse_has_its_own_area_and_stops_no_ray() {
    let lamp = json!({"lightkiln.area_lamp": {"shape": "ellipse", "size": [2, 1], "power": 10}});
    let scene = lit(lamp, json!({})).unwrap();
    let (normal, area) = shape(&scene);
    assert!((normal - Vec3::NEG_Z).length() < 1e-6 && (area - PI / 2.0).abs() < 1e-5, "{area}");
    let material = scene.material(panel(&scene));
    assert!((material.emission.0.x - 10.0 / (PI * PI / 2.0)).abs() < 1e-5);
    assert!(matches!(material.alpha, Alpha::Mask { cutoff } if material.base_color.w < cutoff));
    assert_eq!(scene.surfaces.len(), 2);
}

#[test]
fn a_broken_area_lamp_is_told_by_name_and_key() {
    for (lamp, key) in [
        (json!({"shape": "rectangle", "power": 1}), "size"),
        (json!({"shape": "rectangle", "size": [1, 0], "power": 1}), "size"),
        (json!({"shape": "star", "size": [1, 1], "power": 1}), "shape"),
        (json!({"shape": "ellipse", "size": [1, 1]}), "power"),
        (json!({"shape": "ellipse", "size": [1, 1], "power": -1}), "power"),
        (json!({"shape": "ellipse", "size": [1, 1], "power": 1, "color": [1, 1]}), "color"),
        (json!("bright"), "size"),
    ] {
        let said = lit(json!({"lightkiln": {"area_lamp": lamp}}), json!({})).unwrap_err().to_string();
        assert!(said.contains("Panel") && said.contains(&format!("\"{key}\"")), "{said}");
    }
    let flat = json!({"lightkiln": {"area_lamp": {"shape": "ellipse", "size": [1, 1], "power": 1}}});
    let scene = lit(flat, json!({"scale": [0, 1, 1]})).unwrap();
    assert_eq!(scene.surfaces.len(), 1);
    assert_eq!(warnings(&scene, "no area"), ["Panel"]);
}
