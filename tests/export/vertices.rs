//! Seam splits, indices and texture coordinate sets.

use crate::kit::{Baked, Builder, CUTS, Cut, PNG, one, sheet};
use serde_json::{Value, json};

fn primitive(baked: &Baked) -> &Value {
    &baked.json()["meshes"][0]["primitives"][0]
}

fn accessor<'a>(baked: &'a Baked, index: &Value) -> &'a Value {
    &baked.json()["accessors"][index.as_u64().unwrap() as usize]
}

/// Every corner of every triangle: the lightmap coordinates are the placement's.
fn assert_uv(baked: &Baked) {
    let raw = baked.after.raw_primitive(0, 0).unwrap();
    let (_, uv) = raw.attributes.iter().find(|(name, _)| name == "TEXCOORD_1").unwrap();
    let uv = uv.to_floats();
    let placement = baked.atlas.fronts[0].as_ref().unwrap();
    for (after, cut) in raw.triangles.iter().zip(&placement.unwrap.triangles) {
        for (a, c) in after.iter().zip(cut) {
            let wanted = placement.uv_texels[*c as usize] / 64.0;
            assert_eq!([uv[2 * *a as usize], uv[2 * *a as usize + 1]], wanted.to_array());
        }
    }
}

#[test]
fn a_mesh_without_seams_keeps_its_accessors() {
    let builder = sheet(8);
    let bytes = one(&builder, json!({"attributes": {"POSITION": 0}, "indices": 1}));
    for cut in [Cut::Nowhere, Cut::Reversed] {
        let baked = Baked::new("in.glb", &bytes, cut);
        let after = primitive(&baked);
        assert_eq!(after["attributes"], json!({"POSITION": 0, "TEXCOORD_0": 2, "TEXCOORD_1": 2}));
        assert_eq!(after["indices"], json!(1));
        assert_eq!(baked.json()["accessors"].as_array().unwrap().len(), 3);
        assert_uv(&baked);
    }
}

#[test]
fn seams_split_vertices_and_the_strip_becomes_a_list() {
    for (mode, indexed) in [(4, true), (5, false), (6, false)] {
        let builder = sheet(9);
        let mut object = json!({"attributes": {"POSITION": 0}, "mode": mode});
        if indexed {
            object["indices"] = json!(1);
        }
        let bytes = one(&builder, object);
        for cut in CUTS {
            let baked = Baked::new("in.glb", &bytes, cut);
            let after = primitive(&baked);
            let kept = matches!(cut, Cut::Nowhere | Cut::Reversed);
            assert_eq!(after["mode"], if kept { mode } else { 4 }, "{cut:?}");
            if cut == Cut::Triangles {
                assert_eq!(accessor(&baked, &after["attributes"]["POSITION"])["count"], 21);
                assert_eq!(accessor(&baked, &after["indices"])["count"], 21);
                assert_eq!(accessor(&baked, &after["indices"])["componentType"], 5123);
            }
            assert_uv(&baked);
        }
    }
}

#[test]
fn indices_are_as_wide_as_they_must_be() {
    // 65535 vertices have indices up to 65534: the restart value 65535 stays out of 16 bits.
    for (triangles, vertices, component_type) in [(21844, 65535, 5123), (21845, 65538, 5125)] {
        let mut builder = Builder::default();
        builder.positions(triangles * 3);
        // The first triangle comes again at the end, in another chart: its three vertices are split.
        let indices: Vec<u8> =
            (0..triangles as u32 * 3).chain([0, 1, 2]).flat_map(u32::to_le_bytes).collect();
        builder.accessor(&indices, 5125, "SCALAR", triangles * 3 + 3);
        let bytes = one(&builder, json!({"attributes": {"POSITION": 0}, "indices": 1}));
        let baked = Baked::new("in.glb", &bytes, Cut::Thirds);
        let after = primitive(&baked);
        assert_eq!(accessor(&baked, &after["attributes"]["POSITION"])["count"], vertices);
        assert_eq!(accessor(&baked, &after["indices"])["componentType"], component_type);
        assert_uv(&baked);
    }
}

#[test]
fn attributes_are_copied_as_the_bytes_they_were() {
    let mut builder = sheet(6);
    let rows = |width: usize| -> Vec<u8> { (0..6 * width).map(|i| (i * 37 + 11) as u8).collect() };
    // Three bytes an element, padded to four, normalised, with a name and extras.
    builder.view(&rows(4));
    builder.views[2]["byteStride"] = json!(4);
    let exact: Value = serde_json::from_str("0.10000000000000001").unwrap();
    builder.accessors.push(json!({"bufferView": 2, "componentType": 5120, "type": "VEC3", "count": 6,
        "normalized": true, "name": "Schräg", "extras": {"by": "hand", "exact": exact},
        "max": [127, 127, 127]}));
    builder.accessor(&rows(4), 5121, "VEC4", 6);
    builder.accessors[3]["normalized"] = json!(true);
    builder.accessor(&rows(8), 5123, "VEC4", 6);
    builder.accessor(&rows(12), 5121, "MAT3", 6);
    builder.accessor(&rows(2), 5122, "SCALAR", 6);
    let attributes = json!({"POSITION": 0, "NORMAL": 2, "COLOR_0": 3, "_WIDE": 4, "_MATRIX": 5, "_ODD": 6});
    let bytes = one(&builder, json!({"attributes": attributes, "indices": 1}));
    let baked = Baked::new("in.glb", &bytes, Cut::Thirds);

    let (before, after) =
        (baked.before.raw_primitive(0, 0).unwrap(), baked.after.raw_primitive(0, 0).unwrap());
    assert!(after.attributes[0].1.count > 6);
    for (name, old) in &before.attributes {
        let (_, new) = after.attributes.iter().find(|(other, _)| other == name).unwrap();
        assert_eq!(
            (new.component_type, new.normalized, &new.kind),
            (old.component_type, old.normalized, &old.kind)
        );
        for (a, b) in before.triangles.as_flattened().iter().zip(after.triangles.as_flattened()) {
            let element = |raw: &lightkiln::import::RawAccessor, i: u32| {
                raw.bytes[i as usize * raw.element_bytes..][..raw.element_bytes].to_vec()
            };
            assert_eq!(element(old, *a), element(new, *b), "{name}");
        }
    }
    let new = &primitive(&baked)["attributes"];
    let view = |name: &str| {
        let view = accessor(&baked, &new[name])["bufferView"].as_u64().unwrap() as usize;
        &baked.json()["bufferViews"][view]
    };
    for (name, stride) in
        [("NORMAL", json!(4)), ("_ODD", json!(4)), ("COLOR_0", Value::Null), ("_MATRIX", json!(12))]
    {
        assert_eq!(view(name)["byteStride"], stride, "{name}");
        assert_eq!(view(name)["target"], 34962);
        assert_eq!(view(name)["byteOffset"].as_u64().unwrap() % 4, 0);
    }
    let normal = accessor(&baked, &new["NORMAL"]);
    assert_eq!(normal["name"], "Schräg");
    assert_eq!(normal["extras"].to_string(), r#"{"by":"hand","exact":0.10000000000000001}"#);
    assert_eq!(normal["max"], Value::Null, "only POSITION needs bounds, and old ones may not hold");
}

#[test]
fn bounds_of_positions_are_exact() {
    let mut builder = Builder::default();
    let values = [0.1, -0.2, 0.3, 1.7e-8, 3.3e7, -0.7, 0.9, 0.11, -1e-20, 9.0, 9.0, 9.0];
    builder.floats(&values, "VEC3");
    builder.indices(&[0, 1, 2, 2, 1, 0]);
    let bytes = one(&builder, json!({"attributes": {"POSITION": 0}, "indices": 1}));
    let baked = Baked::new("in.glb", &bytes, Cut::Triangles);
    let position = accessor(&baked, &primitive(&baked)["attributes"]["POSITION"]);
    let floats = |key: &str| -> Vec<f32> {
        position[key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32).collect()
    };
    assert_eq!(floats("min"), [1.7e-8, -0.2, -0.7]);
    assert_eq!(floats("max"), [0.9, 3.3e7, 0.3]);
}

#[test]
fn morph_targets_follow_and_become_dense() {
    let mut builder = sheet(6);
    let (at, values) = (builder.view(&[1, 4]), builder.view(&[0u8; 24]));
    builder.accessors.push(json!({"componentType": 5126, "type": "VEC3", "count": 6, "min": [0, 0, 0],
        "max": [0, 0, 0], "sparse": {"count": 2, "indices": {"bufferView": at, "componentType": 5121},
        "values": {"bufferView": values}}}));
    let targets = json!([{"POSITION": 2}, {"POSITION": 2}]);
    let bytes = one(&builder, json!({"attributes": {"POSITION": 0}, "indices": 1, "targets": targets}));
    // Import gives morphed meshes no lightmap by itself; here they get one all the same.
    let baked = Baked::forced("in.glb", &bytes, Cut::Triangles);
    let targets = primitive(&baked)["targets"].as_array().unwrap();
    assert_eq!(targets[0], targets[1], "what was one accessor stays one");
    let dense = accessor(&baked, &targets[0]["POSITION"]);
    assert_eq!((dense["count"].as_u64(), dense.get("sparse")), (Some(12), None));
    assert_eq!(dense["min"], json!([0.0, 0.0, 0.0]));
    assert_uv(&baked);
}

#[test]
fn the_first_set_is_added_where_it_is_missing() {
    let textured = |texture: Value| {
        let mut builder = sheet(6);
        builder.view(PNG);
        builder.glb(json!({
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": texture}}],
            "textures": [{"source": 0}],
            "images": [{"bufferView": 2, "mimeType": "image/png"}],
        }))
    };
    let sets = |texture| {
        let baked = Baked::new("in.glb", &textured(texture), Cut::Nowhere);
        let attributes = primitive(&baked)["attributes"].clone();
        let raw = |name: &str| baked.after.raw_accessor(attributes[name].as_u64()? as usize).ok();
        let zero =
            (0..3).map(|set| raw(&format!("TEXCOORD_{set}")).map(|raw| raw.bytes.iter().all(|b| *b == 0)));
        zero.collect::<Vec<_>>()
    };
    // The texture was read at (0, 0) so far, and still is.
    assert_eq!(sets(json!({"index": 0})), [Some(true), Some(false), None]);
    // It reads the second set: that one stays at zero, the lightmap gets the third.
    assert_eq!(sets(json!({"index": 0, "texCoord": 1})), [Some(false), Some(true), Some(false)]);
}

#[test]
fn a_second_set_is_never_replaced() {
    let mut builder = sheet(6);
    builder.floats(&[0.5; 12], "VEC2");
    let bytes =
        one(&builder, json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 2, "TEXCOORD_1": 2}, "indices": 1}));
    let baked = Baked::new("in.glb", &bytes, Cut::Nowhere);
    let attributes = json!({"POSITION": 0, "TEXCOORD_0": 2, "TEXCOORD_1": 2, "TEXCOORD_2": 3});
    assert_eq!(primitive(&baked)["attributes"], attributes);
    assert_eq!(baked.json()["nodes"][0]["extras"]["lightmap"]["texCoord"], 2);
    assert_eq!(baked.json()["materials"][0]["extensions"]["MOZ_lightmap"]["texCoord"], 2);
    assert!(baked.warns("TEXCOORD_2"), "{:?}", baked.written.warnings);
}
