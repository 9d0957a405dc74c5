use super::*;
use crate::scene::{Alpha, Filter, SurfacePoint, Wrap};
use glam::{Vec2, Vec3};
use serde_json::json;

/// The middle of the lower right triangle of the square.
fn point(x: f32, y: f32) -> SurfacePoint {
    SurfacePoint { surface: 0, triangle: 0, barycentric: Vec2::new(x, y) }
}

#[test]
fn reflectance_is_base_colour_without_metal_and_glass() {
    let scene = square(json!({"materials": [{
        "name": "Paint",
        "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.4, 0.2, 1], "metallicFactor": 0.5},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.5}}
    }]}))
    .unwrap();
    assert!((scene.reflectance(point(0.3, 0.3)).0 - Vec3::new(0.2, 0.1, 0.05)).length() < 1e-6);
    assert_eq!(scene.materials[1].name, "Paint");
    assert_eq!(scene.materials[1].index, Some(0));
}

#[test]
fn emission_is_factor_times_strength() {
    let scene = square(json!({"materials": [{
        "emissiveFactor": [1, 0.5, 0], "extras": {"any": [1, {"thing": null}]},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 12.5}, "VENDOR_unknown": {"a": 1.5}}
    }]}))
    .unwrap();
    assert_eq!(scene.emission(point(0.3, 0.3)).0, Vec3::new(12.5, 6.25, 0.0));
    assert!(warnings(&scene, "gives light").is_empty());
}

#[test]
fn specular_glossiness_gives_its_diffuse_part() {
    let scene = square(json!({"materials": [{
        "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]},
        "extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.5, 0.25, 0.125, 1]}}
    }]}))
    .unwrap();
    assert_eq!(scene.reflectance(point(0.3, 0.3)).0, Vec3::new(0.5, 0.25, 0.125));
}

#[test]
fn white_that_never_fades_is_named() {
    let white = |pbr: serde_json::Value| {
        let scene = square(json!({"materials": [{"name": "Snow", "pbrMetallicRoughness": pbr}]})).unwrap();
        warnings(&scene, "never fade").len()
    };
    assert_eq!(white(json!({"metallicFactor": 0})), 1);
    assert_eq!(white(json!({"metallicFactor": 0, "baseColorFactor": [0.9, 0.9, 0.9, 1]})), 0);
    assert_eq!(white(json!({"metallicFactor": 0.5})), 0);
    assert_eq!(white(json!({})), 0);
    let scene = square(json!({"materials": [{"name": "Chrome"}]})).unwrap();
    assert_eq!(warnings(&scene, "how metallic"), ["Chrome"]);
}

#[test]
fn alpha_modes_and_sides() {
    let alpha =
        |material: serde_json::Value| square(json!({"materials": [material]})).unwrap().materials[1].alpha;
    assert_eq!(alpha(json!({})), Alpha::Opaque);
    assert_eq!(alpha(json!({"alphaMode": "MASK"})), Alpha::Mask { cutoff: 0.5 });
    assert_eq!(alpha(json!({"alphaMode": "MASK", "alphaCutoff": 0.25})), Alpha::Mask { cutoff: 0.25 });
    assert_eq!(alpha(json!({"alphaMode": "BLEND"})), Alpha::Blend);
    assert!(refusal(square(json!({"materials": [{"alphaMode": "NONE"}]}))).contains("OPAQUE"));
    assert!(square(json!({"materials": [{"doubleSided": true}]})).unwrap().materials[1].double_sided);
}

#[test]
fn absurd_factors_are_clamped_or_refused_by_name() {
    let scene = square(json!({"materials": [{"name": "Odd", "emissiveFactor": [-1, 0, 0],
        "pbrMetallicRoughness": {"baseColorFactor": [-1, 0.5, 0.5, 1], "metallicFactor": 7}}]}))
    .unwrap();
    assert_eq!(warnings(&scene, "clamped"), ["Odd", "Odd", "Odd"]);
    assert_eq!(scene.materials[1].metallic, 1.0);
    assert_eq!(scene.materials[1].base_color.x, 0.0);
    let said = refusal(square(json!({"materials": [{"name": "Odd", "emissiveFactor": [1e39, 0, 0]}]})));
    assert!(said.contains("'Odd'") && said.contains("finite"), "{said}");
    let said = refusal(square(json!({"materials": [{"name": "Odd", "doubleSided": 3}]})));
    assert!(said.contains("'Odd'"), "{said}");
}

#[test]
fn unlit_surfaces_only_block() {
    let unlit =
        json!({"materials": [{"extensions": {"KHR_materials_unlit": {}}, "emissiveFactor": [1, 1, 1]}]});
    let scene = square(unlit).unwrap();
    assert_eq!(scene.surfaces[0].role, crate::scene::Role::Blocks);
    assert_eq!(scene.emission(point(0.3, 0.3)).0, Vec3::ZERO);
    assert_eq!(warnings(&scene, "gives light").len(), 1);
    assert_eq!(warnings(&scene, "takes a lightmap").len(), 1);
}

/// A square with a 2 × 1 picture: red on the left, half grey on the right.
fn textured(sampler: serde_json::Value, info: serde_json::Value) -> Scene {
    let mut builder = Builder::square();
    let view = builder.png([2, 1], &[[255, 0, 0, 255], [128, 128, 128, 51]]);
    let mut info = info;
    info["index"] = json!(0);
    let json = json!({
        "images": [{"name": "Tiles", "bufferView": view, "mimeType": "image/png"}],
        "samplers": [sampler],
        "textures": [{"source": 0, "sampler": 0}],
        "materials": [{"alphaMode": "BLEND", "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": info}}]
    });
    builder.load_square(json, &ImportOptions::default()).unwrap().1
}

#[test]
fn textures_are_decoded_from_srgb_with_their_sampler() {
    let nearest = json!({"magFilter": 9728, "wrapS": 33071, "wrapT": 33648});
    let scene = textured(nearest, json!({}));
    // The lower right corner of the square has u = 1; the sampler stays on the last texel.
    let grey = scene.reflectance(point(0.9, 0.0)).0;
    assert!((grey - Vec3::splat(0.215_86)).length() < 1e-4, "{grey}");
    assert_eq!(scene.reflectance(point(0.1, 0.0)).0, Vec3::new(0.999, 0.0, 0.0));
    assert!((scene.opacity(point(0.9, 0.0)).0 - 0.2).abs() < 1e-6);
    let texture = &scene.textures[0];
    assert_eq!((texture.name.as_str(), texture.size()), ("Tiles", [2, 1]));
    let linear = textured(json!({"wrapS": 33071}), json!({}));
    let middle = linear.reflectance(point(0.5, 0.0)).0;
    assert!((middle.x - (1.0 + 0.215_86) / 2.0).abs() < 1e-3, "{middle}");
}

#[test]
fn texture_transform_turns_scales_and_shifts() {
    let nearest = || json!({"magFilter": 9728, "wrapS": 10497});
    let at = |transform: serde_json::Value| {
        let info = json!({"texCoord": 5, "extensions": {"KHR_texture_transform": transform}});
        textured(nearest(), info).materials[1].base_color_texture.clone().unwrap()
    };
    let slot = at(json!({"texCoord": 0, "offset": [0.5, 0.25], "scale": [2, 3]}));
    assert_eq!(slot.texcoord, 0);
    assert_eq!(slot.transform.transform_point2(Vec2::new(1.0, 1.0)), Vec2::new(2.5, 3.25));
    // A quarter turn brings u to −v: what stood right of the origin stands above it, as v runs down.
    let slot = at(json!({"rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 1]}));
    assert_eq!(slot.texcoord, 5);
    let turned = slot.transform.transform_point2(Vec2::new(1.0, 0.0));
    assert!((turned - Vec2::new(0.0, -2.0)).length() < 1e-6, "{turned}");
    // The exporter of Blender writes this for a mapping of angle θ, scale s, without a shift of its own: the corner
    // (0, 0) of Blender's coordinates, which run up, stays where it is.
    let (angle, scale) = (0.3_f32, 1.7_f32);
    let offset = [-scale * angle.sin(), 1.0 - scale * angle.cos()];
    let slot = at(json!({"rotation": angle, "scale": [scale, scale], "offset": offset}));
    let corner = slot.transform.transform_point2(Vec2::new(0.0, 1.0));
    assert!((corner - Vec2::new(0.0, 1.0)).length() < 1e-6, "{corner}");
}

#[test]
fn equal_textures_are_shared_and_unseen_ones_not_decoded() {
    let mut builder = Builder::square();
    let view = builder.png([1, 1], &[[10, 20, 30, 255]]);
    let json = json!({
        "images": [{"bufferView": view}],
        "textures": [{"source": 0}, {"source": 0}],
        "materials": [{
            "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0},
            "pbrMetallicRoughness": {
                "metallicFactor": 0, "baseColorTexture": {"index": 1}, "metallicRoughnessTexture": {"index": 0}}
        }]
    });
    let scene = builder.load_square(json, &ImportOptions::default()).unwrap().1;
    let material = &scene.materials[1];
    assert_eq!(scene.textures.len(), 1);
    assert_eq!(material.base_color_texture, material.emission_texture);
    assert!(material.metallic_texture.is_none());
}

#[test]
fn pictures_that_cannot_be_read_cost_a_texture_and_a_word() {
    let mut builder = Builder::square();
    let broken = builder.view(b"\x89PNG\r\n\x1a\nbroken");
    let ktx = builder.view(&[0xAB, b'K', b'T', b'X', b' ', b'2', b'0', 0xBB]);
    for (texture, image, word) in [
        (json!({"source": 0}), json!({"bufferView": broken}), "decoded"),
        (json!({"source": 0}), json!({"bufferView": ktx, "mimeType": "image/ktx2"}), "KTX2"),
        (json!({"source": 0}), json!({"uri": "nowhere.png"}), "nowhere.png"),
        (json!({"source": 0}), json!({"uri": "http://a/b.png"}), "http"),
        (json!({"source": 0}), json!({}), "neither"),
        (json!({}), json!({"bufferView": broken}), "names no image"),
        (json!({"extensions": {"KHR_texture_basisu": {"source": 0}}}), json!({}), "KHR_texture_basisu"),
    ] {
        let json = json!({
            "images": [image], "textures": [texture],
            "materials": [{"name": "Wood", "pbrMetallicRoughness": {
                "metallicFactor": 0, "baseColorFactor": [0.5, 0.5, 0.5, 1], "baseColorTexture": {"index": 0}}}]
        });
        let scene = builder.load_square(json, &ImportOptions::default()).unwrap().1;
        assert_eq!(scene.reflectance(point(0.1, 0.1)).0, Vec3::splat(0.5));
        assert_eq!(warnings(&scene, word), ["Wood"], "{:?}", scene.warnings);
    }
    let outside = json!({"images": [{"uri": "../secret.png"}], "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]});
    assert!(refusal(square(outside)).contains("--allow-outside"));
    let dangling = json!({"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]});
    assert!(refusal(square(dangling)).contains("texture 0"));
}

#[test]
fn a_picture_is_measured_before_it_is_decoded() {
    let mut builder = Builder::square();
    let view = builder.png([1, 1], &[[0; 4]]);
    let offset = builder.views[view]["byteOffset"].as_u64().unwrap() as usize;
    // Width and height of the header, then the checksum that belongs to them.
    let header = &mut builder.bin[offset + 12..offset + 33];
    header[4..12].copy_from_slice(&[0x7F, 0, 0, 0, 0x7F, 0, 0, 0]);
    let checksum = crc(&header[..17]);
    header[17..].copy_from_slice(&checksum.to_be_bytes());
    let json = json!({"images": [{"bufferView": view}], "textures": [{"source": 0}],
        "materials": [{"name": "Vast", "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}}}]});
    let scene = builder.load_square(json, &ImportOptions::default()).unwrap().1;
    assert_eq!(warnings(&scene, "left out"), ["Vast"], "{:?}", scene.warnings);
}

/// CRC-32 of a PNG chunk.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg()))
    })
}

#[test]
fn missing_texture_coordinates_are_named_once() {
    let scene = textured(json!({}), json!({"texCoord": 3}));
    assert_eq!(warnings(&scene, "TEXCOORD_3").len(), 1);
    assert!(scene.reflectance(point(0.5, 0.2)).0.is_finite());
    let sampler = &textured(json!({"minFilter": 9987}), json!({})).textures[0];
    assert_eq!(sampler.size(), [2, 1]);
    let _ = (Wrap::Repeat, Filter::Linear);
}
