use super::*;
use crate::options::LampUnits;
use crate::scene::{Cone, LampKind, SpotFalloff};
use glam::Vec3;
use serde_json::json;

fn lit(light: Value, node: Value, generator: &str, options: &ImportOptions) -> Result<Scene> {
    let mut node = node;
    node["name"] = json!("Bulb");
    node["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    let json = json!({
        "asset": {"version": "2.0", "generator": generator},
        "extensions": {"KHR_lights_punctual": {"lights": [light]}},
        "nodes": [{"name": "Wall", "mesh": 0}, node],
        "scenes": [{"nodes": [0, 1]}]
    });
    Builder::square().load_square(json, options).map(|(_, scene)| scene)
}

fn with_units(light: Value, lamp_units: LampUnits) -> Scene {
    lit(light, json!({}), "", &ImportOptions { lamp_units, ..ImportOptions::default() }).unwrap()
}

const BLENDER: &str = "Khronos glTF Blender I/O v4.5.51";

#[test]
fn units_follow_the_exporter() {
    let sun = json!({"type": "directional", "intensity": 2049, "color": [1, 0.5, 0.25]});
    let auto = |generator| lit(sun.clone(), json!({}), generator, &ImportOptions::default()).unwrap();
    let irradiance = |scene: &Scene| match scene.lamps[0].kind {
        LampKind::Sun { irradiance, .. } => irradiance.0,
        LampKind::Point { .. } => panic!("not a sun"),
    };
    let blender = auto(BLENDER);
    assert!((irradiance(&blender) - Vec3::new(3.0, 1.5, 0.75)).length() < 1e-5);
    assert_eq!(blender.lamp_units, LampUnits::Blender);
    assert_eq!(warnings(&blender, "Standard"), ["lamps"]);
    let other = auto("Some exporter");
    assert_eq!(irradiance(&other), Vec3::new(2049.0, 1024.5, 512.25));
    assert_eq!((other.lamp_units, warnings(&other, "candela").len()), (LampUnits::Gltf, 1));
    let forced = with_units(sun, LampUnits::Unitless);
    assert_eq!((forced.lamp_units, irradiance(&forced).x), (LampUnits::Unitless, 2049.0));
    assert!(warnings(&forced, "assumed").is_empty());
}

#[test]
fn numbers_of_the_other_mode_are_noticed() {
    let weak = |light| {
        let scene = lit(light, json!({}), BLENDER, &ImportOptions::default()).unwrap();
        warnings(&scene, "--lamp-units unitless").len()
    };
    assert_eq!(weak(json!({"type": "directional", "intensity": 3})), 1);
    assert_eq!(weak(json!({"type": "directional", "intensity": 2049})), 0);
    assert_eq!(weak(json!({"type": "point", "intensity": 7.95})), 1);
    assert_eq!(weak(json!({"type": "point", "intensity": 5435})), 0);
}

#[test]
fn lamps_stand_and_shine_as_their_nodes_do() {
    let spot = json!({"type": "spot", "intensity": 10, "range": 4, "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.5}});
    // A quarter turn about x lets −z look up; scale moves nothing.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let node = json!({"translation": [1, 2, 3], "rotation": [half, 0, 0, half], "scale": [5, 5, 5],
        "extras": {"radius": 0.25, "lightkiln": {"soft_falloff": true}}});
    let scene = lit(spot, node, "", &ImportOptions::default()).unwrap();
    let LampKind::Point { position_world, intensity, range_m, radius_m, soft_falloff, cone } =
        scene.lamps[0].kind
    else {
        panic!("not a spot")
    };
    assert_eq!(scene.lamps[0].name, "Bulb");
    assert_eq!((position_world, intensity.0), (Vec3::new(1.0, 2.0, 3.0), Vec3::splat(10.0)));
    assert_eq!((range_m, radius_m, soft_falloff), (Some(4.0), 0.25, true));
    let Cone { direction_world, inner_rad, outer_rad, falloff } = cone.unwrap();
    assert!((direction_world - Vec3::Y).length() < 1e-6, "{direction_world}");
    assert_eq!((inner_rad, outer_rad, falloff), (0.5, 0.5, SpotFalloff::Gltf));
}

#[test]
fn falloff_follows_the_units() {
    let falloff = |units| match with_units(json!({"type": "spot", "spot": {}}), units).lamps[0].kind {
        LampKind::Point { cone: Some(cone), .. } => cone.falloff,
        _ => panic!("not a spot"),
    };
    assert_eq!(falloff(LampUnits::Unitless), SpotFalloff::Blender);
    assert_eq!(falloff(LampUnits::Blender), SpotFalloff::Blender);
    assert_eq!(falloff(LampUnits::Gltf), SpotFalloff::Gltf);
}

#[test]
fn suns_take_their_size_from_the_caller_or_the_artist() {
    let sun = |extras: Value| json!({"type": "directional", "extras": extras});
    let angle = |light, node, sun_angle_deg| {
        let options = ImportOptions { sun_angle_deg, ..ImportOptions::default() };
        match lit(light, node, "", &options).unwrap().lamps[0].kind {
            LampKind::Sun { angle_rad, toward_world, .. } => {
                assert!((toward_world - Vec3::Z).length() < 1e-6);
                angle_rad
            }
            LampKind::Point { .. } => panic!("not a sun"),
        }
    };
    assert_eq!(angle(sun(json!({})), json!({}), None), 0.0);
    assert_eq!(angle(sun(json!({"angle": 0.01})), json!({}), None), 0.01);
    let nested = json!({"extras": {"lightkiln": {"angle": 0.02}}});
    assert_eq!(angle(sun(json!({"angle": 0.01})), nested, None), 0.02);
    assert!((angle(sun(json!({"angle": 0.01})), json!({}), Some(0.5)) - 0.5_f32.to_radians()).abs() < 1e-7);
    let options = ImportOptions { sun_angle_deg: Some(-1.0), ..ImportOptions::default() };
    assert!(refusal(lit(sun(json!({})), json!({}), "", &options)).contains("--sun-angle"));
}

#[test]
fn broken_lamps_are_refused_by_name() {
    for light in [
        json!({"type": "point", "intensity": -1}),
        json!({"type": "point", "color": [1, -1, 1]}),
        json!({"type": "point", "intensity": 1e39}),
        json!({"type": "point", "range": 0}),
        json!({"type": "spot"}),
        json!({"type": "spot", "spot": {"outerConeAngle": 2}}),
        json!({"type": "spot", "spot": {"innerConeAngle": -0.1}}),
        json!({"type": "point", "extras": {"radius": -1}}),
        json!({"type": 7}),
        json!({}),
    ] {
        let said = refusal(lit(light.clone(), json!({}), "", &ImportOptions::default()));
        assert!(said.contains("Bulb") || light.get("extras").is_some(), "{light}: {said}");
    }
    let scene = lit(json!({"type": "area"}), json!({}), "", &ImportOptions::default()).unwrap();
    assert!(scene.lamps.is_empty());
    assert_eq!(warnings(&scene, "kind that glTF does not know"), ["Bulb"]);
    let flat =
        lit(json!({"type": "directional"}), json!({"scale": [0, 0, 0]}), "", &ImportOptions::default());
    assert_eq!(warnings(&flat.unwrap(), "no direction"), ["Bulb"]);
}

#[test]
fn a_scene_without_light_says_which_box_to_tick() {
    let scene = square(json!({})).unwrap();
    assert_eq!(warnings(&scene, "Punctual Lights").len(), 1);
    let scene = lit(json!({"type": "point"}), json!({}), "", &ImportOptions::default()).unwrap();
    assert!(warnings(&scene, "Punctual Lights").is_empty());
    let dark =
        lit(json!({"type": "point", "intensity": 0}), json!({}), "", &ImportOptions::default()).unwrap();
    assert_eq!(warnings(&dark, "Punctual Lights").len(), 1);
}
