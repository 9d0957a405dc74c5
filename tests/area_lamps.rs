//! Lamps that have a size, through the whole line: area lamps from custom properties against the closed form of a
//! parallel rectangle, Blender's soft falloff against that of a disc.

mod common;

use common::{Builder, at, close, of_surface};
use glam::Vec3;
use lightkiln::bake::{self, Run};
use lightkiln::import;
use lightkiln::options::{BakeOptions, ImportOptions, LampUnits, Quality};
use lightkiln::scene::LampKind;
use lightkiln::units::Intensity;
use serde_json::{Value, json};
use std::f32::consts::PI;
use std::path::Path;

/// A floor of 2 m at the origin that faces up, and nodes beside it.
fn file(nodes: &[Value]) -> Vec<u8> {
    let floats: [f32; 12] = [-1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0, -1.0];
    let mut bytes: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|x| x.to_le_bytes()));
    let data: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    let mut all = vec![json!({"name": "floor", "mesh": 0})];
    all.extend_from_slice(nodes);
    let json = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 60, "uri": format!("data:application/octet-stream,{data}")}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4,
             "min": [-1, 0, -1], "max": [1, 0, 1]},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 6}
        ],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "nodes": all,
        "scenes": [{"nodes": (0..all.len()).collect::<Vec<_>>()}]
    });
    serde_json::to_vec(&json).unwrap()
}

/// A lamp of 1 m × 0.5 m that looks down.
fn panel(height: f64, watts: f64) -> Value {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    json!({"name": "panel", "translation": [0, height, 0], "rotation": [-half, 0, 0, half],
        "extras": {"lightkiln": {"area_lamp": {"shape": "rectangle", "size": [1, 0.5], "power": watts}}}})
}

/// Irradiance under the middle of it: four times the factor of a rectangle above its corner (Howell's catalogue, B-4).
fn under(height: f32, watts: f32) -> f32 {
    let (x, y) = (0.5 / height, 0.25 / height);
    let part = |x: f32, y: f32| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
    let factor = 4.0 * (part(x, y) + part(y, x)) / (2.0 * PI);
    PI * (watts / (PI * 0.5)) * factor
}

fn light(nodes: &[Value]) -> bake::Lit {
    let import = ImportOptions { lamp_units: LampUnits::Unitless, ..ImportOptions::default() };
    let (_, scene) = import::load_bytes(Path::new("floor.gltf"), &file(nodes), &import).unwrap();
    let mut options = BakeOptions { light: Quality::Good.light(), ..BakeOptions::default() };
    options.atlas.page_size = 128;
    bake::light(&scene, &options, &Run::default()).unwrap()
}

#[test]
fn it_lights_the_floor_as_its_form_factor_says() {
    let lit = light(&[panel(1.5, 40.0)]);
    // Nothing else reflects, so direct light is all there is; the texel nearest to the middle is 8 mm off.
    close(at(&lit, 0, Vec3::ZERO).mean(), under(1.5, 40.0), 1e-3, "under the middle");
    // It is no surface: the only elements are the floor's.
    assert!(lit.elements.charts.iter().all(|chart| chart.surface == 0));
    assert!((lit.elements.area.iter().map(|area| area.0).sum::<f32>() - 4.0).abs() < 1e-3);
}

#[test]
fn it_hides_nothing_and_shines_one_way() {
    let both = light(&[panel(1.5, 40.0), panel(2.0, 20.0)]);
    let expected = under(1.5, 40.0) + under(2.0, 20.0);
    close(at(&both, 0, Vec3::ZERO).mean(), expected, 1e-3, "two lamps, one above the other");
    // Below the floor and looking down, it lights nothing that faces up.
    let below = light(&[panel(-1.0, 40.0)]);
    assert_eq!(at(&below, 0, Vec3::ZERO).mean(), 0.0);
}

#[test]
fn it_is_the_same_as_an_emissive_rectangle() {
    let lamp = light(&[panel(1.5, 40.0)]);
    let mut builder = Builder::new();
    let (white, glow) = (builder.material(0.5, 0.0), builder.material(0.0, 40.0 / (PI * 0.5)));
    builder.quad(Vec3::new(-1.0, 0.0, 1.0), Vec3::X * 2.0, Vec3::Z * -2.0, white);
    builder.quad(Vec3::new(-0.5, 1.5, -0.25), Vec3::X, Vec3::Z * 0.5, glow);
    let surface = builder.light(Quality::Good, 128);
    for (x, z) in [(0.0, 0.0), (0.6, 0.3), (-0.9, 0.9)] {
        let place = Vec3::new(x, 0.0, z);
        // Two atlases: the nearest texels differ by up to 2 cm of 1.5 m.
        close(at(&lamp, 0, place).mean(), at(&surface, 0, place).mean(), 0.03, "surface and lamp");
    }
}

#[test]
fn soft_falloff_is_that_of_a_disc_which_faces_the_receiver() {
    // A disc of radius r and uniform radiance that faces a point at distance d gives it πL r²/(d² + r²) head on, and
    // I = πr²L; tilting the receiver scales that by cosθ as long as the whole disc stands above it.
    let mut b = Builder::new();
    let black = b.material(0.0, 0.0);
    let floor = b.quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, black);
    let (position_world, radius_m) = (Vec3::new(0.2, 0.8, -0.1), 0.5_f32);
    let intensity = Intensity::grey(5.0);
    let soft_falloff = true;
    b.lamp(LampKind::Point { position_world, intensity, range_m: None, radius_m, soft_falloff, cone: None });
    let lit = b.light(Quality::Draft, 64);
    for e in of_surface(&lit, floor) {
        let to = position_world - lit.elements.position_world[e];
        let expected = 5.0 * to.normalize().y / (to.length_squared() + radius_m * radius_m);
        // f32 rounding of positions and of the formula: 32 ulp.
        close(lit.irradiance(e).mean(), expected, 4e-6, "I cosθ/(d² + r²)");
    }
}
