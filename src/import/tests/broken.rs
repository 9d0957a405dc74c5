use super::*;
use serde_json::json;
use std::path::Path;

/// A file that touches every part of the stage.
fn rich() -> Vec<u8> {
    let mut builder = Builder::square();
    let joints = builder.accessor(&[0; 16], 5121, "VEC4", 4);
    let weights = builder.floats(&[1., 0., 0., 0.].repeat(4), "VEC4");
    let colors = builder.floats(&[0.5; 12], "VEC3");
    let places = builder.floats(&[0., 0., 1., 0., 0., 2.], "VEC3");
    let (at, values) = (builder.view(&[1]), builder.view(&[0; 12]));
    builder.accessors.push(json!({"componentType": 5126, "type": "VEC3", "count": 4, "sparse": {"count": 1,
        "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}}}));
    let delta = builder.accessors.len() - 1;
    let png = builder.png([2, 2], &[[9, 99, 199, 255]; 4]);
    builder.file(json!({
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 9, "spot": {}}]}},
        "images": [{"bufferView": png}], "samplers": [{"wrapS": 33071}], "textures": [{"source": 0, "sampler": 0}],
        "materials": [{"alphaMode": "MASK", "emissiveFactor": [1, 1, 1],
            "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture":
                {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": 0.5}}}}}],
        "meshes": [{"name": "M", "weights": [0.5], "primitives": [{"material": 0, "indices": 3, "mode": 4,
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": colors, "JOINTS_0": joints,
                "WEIGHTS_0": weights}, "targets": [{"POSITION": delta}]}]}],
        "nodes": [
            {"mesh": 0, "skin": 0, "children": [1, 2], "extras": {"lightkiln": {"bake": true, "density": 2}}},
            {"translation": [1, 2, 3], "rotation": [0, 0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"mesh": 0, "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1],
             "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}}
        ],
        "skins": [{"joints": [1]}],
        "scenes": [{"nodes": [0], "extras": {"sky": [1, 1, 1]}}], "scene": 0
    }))
}

/// A small generator of numbers: the same mutations every time.
fn next(state: &mut u64) -> usize {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as usize
}

/// Files are changed at random and read: errors are fine, panics fail the test. `LIGHTKILN_FUZZ` sets how many.
#[test]
fn no_bytes_make_it_panic() {
    let good = rich();
    assert!(super::super::load_bytes(Path::new("a.glb"), &good, &ImportOptions::default()).is_ok());
    let json_length = u32::from_le_bytes(good[12..16].try_into().unwrap()) as usize;
    let rounds = std::env::var("LIGHTKILN_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(3000);
    let mut state = 1;
    let mut read = 0;
    for round in 0..rounds {
        let mut bytes = good.clone();
        for _ in 0..1 + round % 3 {
            // Mostly the JSON, where the sense is; digits become digits so that much of it stays readable.
            let at = if round % 4 == 0 {
                next(&mut state) % bytes.len()
            } else {
                20 + next(&mut state) % json_length
            };
            bytes[at] = match bytes[at] {
                b'0'..=b'9' if round % 2 == 0 => b"0123456789-.e"[next(&mut state) % 13],
                _ => (next(&mut state) % 256) as u8,
            };
        }
        read += usize::from(
            super::super::load_bytes(Path::new("a.glb"), &bytes, &ImportOptions::default()).is_ok(),
        );
    }
    assert!(
        read > rounds / 20,
        "only {read} of {rounds} could be read: the mutations are too coarse to test much"
    );
}

#[test]
fn the_same_file_gives_the_same_scene() {
    let load = || super::super::load_bytes(Path::new("a.glb"), &rich(), &ImportOptions::default()).unwrap().1;
    let (a, b) = (load(), load());
    assert_eq!(a.warnings, b.warnings);
    assert_eq!(format!("{:?}", a.surfaces), format!("{:?}", b.surfaces));
}

#[test]
fn required_extensions_are_refused_with_a_remedy() {
    let said = refusal(square(json!({"extensionsRequired": ["VENDOR_mesh_compression"]})));
    assert!(said.contains("VENDOR_mesh_compression") && said.contains("without compression"), "{said}");
}

#[test]
fn missing_buffers_name_their_file() {
    let json = json!({"asset": {"version": "2.0"}, "buffers": [{"uri": "gone.bin", "byteLength": 4}]});
    let result = super::super::load_bytes(
        Path::new("nowhere/a.gltf"),
        json.to_string().as_bytes(),
        &ImportOptions::default(),
    );
    match result {
        Err(Error::Io { path, .. }) => assert!(path.ends_with("gone.bin")),
        other => panic!("{:?}", other.err()),
    }
    let short =
        json!({"asset": {"version": "2.0"}, "buffers": [{"uri": "data:;base64,AAAA", "byteLength": 4}]});
    let result = super::super::load_bytes(
        Path::new("a.gltf"),
        short.to_string().as_bytes(),
        &ImportOptions::default(),
    );
    assert!(result.err().unwrap().to_string().contains("promises 4"));
}

#[test]
fn buffers_of_text_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let bytes: Vec<u8> =
        [0., 0., 0., 1., 0., 0., 0., 1., 0_f32].iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(folder.path().join("wall 1.bin"), [bytes.as_slice(), &[9; 5]].concat()).unwrap();
    let json = json!({
        "asset": {"version": "2.0"}, "buffers": [{"uri": "wall%201.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]
    });
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, json.to_string()).unwrap();
    let (document, scene) = super::super::load(&path, &ImportOptions::default()).unwrap();
    assert_eq!(document.buffers[0].bytes, bytes);
    assert_eq!(document.buffers[0].path.as_deref(), Some(folder.path().join("wall 1.bin").as_path()));
    assert_eq!(scene.geometries[0].triangles, [[0, 1, 2]]);
}
