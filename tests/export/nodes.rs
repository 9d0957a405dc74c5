//! Nodes that share meshes, instances, lamps and extras.

use crate::kit::{self, Baked, Builder, Cut, sheet};
use glam::Vec3;
use lightkiln::options::{ExportOptions, ImportOptions, LampsOut, LightPart};
use lightkiln::{export, import};
use serde_json::{Value, json};

fn shared(nodes: Value) -> Vec<u8> {
    let count = nodes.as_array().unwrap().len();
    sheet(6).glb(json!({
        "scenes": [{"nodes": (0..count).collect::<Vec<_>>()}],
        "nodes": nodes,
        "meshes": [{"name": "Chair", "weights": [], "extras": {"kind": 7},
                    "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "extras": {"a": 1}}]}],
    }))
}

fn meshes_of(baked: &Baked) -> Vec<u64> {
    let nodes = baked.json()["nodes"].as_array().unwrap();
    nodes.iter().map(|node| node["mesh"].as_u64().unwrap()).collect()
}

#[test]
fn each_node_gets_its_own_coordinates_and_shares_the_rest() {
    let place = |x: f32| json!({"name": format!("Chair at {x}"), "mesh": 0, "translation": [x, 0.0, 0.0]});
    let bytes = shared(json!([place(0.0), place(1.0), place(2.0)]));
    for cut in [Cut::Nowhere, Cut::Thirds] {
        let baked = Baked::new("in.glb", &bytes, cut);
        assert_eq!(meshes_of(&baked), [0, 1, 2]);
        let meshes = baked.json()["meshes"].as_array().unwrap();
        let attribute =
            |mesh: usize, name: &str| meshes[mesh]["primitives"][0]["attributes"][name].as_u64().unwrap();
        for other in 1..3 {
            assert_eq!(meshes[other]["name"], "Chair");
            assert_eq!(meshes[other]["extras"], json!({"kind": 7}));
            assert_eq!(meshes[other]["primitives"][0]["extras"], json!({"a": 1}));
            assert_eq!(attribute(other, "POSITION"), attribute(0, "POSITION"));
            assert_eq!(meshes[other]["primitives"][0]["indices"], meshes[0]["primitives"][0]["indices"]);
            assert_ne!(attribute(other, "TEXCOORD_1"), attribute(other - 1, "TEXCOORD_1"));
        }
        let entry = &baked.json()["nodes"][1]["extras"]["lightmap"];
        assert_eq!(entry["file"], "in.baked.lightmap0.exr");
        assert_eq!((&entry["texCoord"], &entry["store"]), (&json!(1), &json!("irradiance-over-pi")));
        let rect: Vec<f32> =
            entry["rect"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32).collect();
        let [min, max] = baked.atlas.fronts[1].as_ref().unwrap().rect_texels.map(|corner| corner / 64.0);
        assert_eq!(rect, [min.x, min.y, max.x, max.y]);
    }
}

#[test]
fn who_is_not_baked_keeps_the_mesh_as_it_was() {
    let out = json!({"mesh": 0, "name": "Out", "extras": {"lightkiln": {"bake": false}}});
    let baked = Baked::new("in.glb", &shared(json!([{"mesh": 0, "name": "In"}, out.clone()])), Cut::Thirds);
    assert_eq!(meshes_of(&baked), [1, 0]);
    assert_eq!(baked.json()["meshes"][0], baked.before.json["meshes"][0]);
    assert_eq!(baked.json()["nodes"][1], out);
}

#[test]
fn extras_are_merged_or_left_alone() {
    let nodes =
        json!([{"mesh": 0, "extras": {"mine": [1, 2]}}, {"mesh": 0, "name": "Odd", "extras": "text"}]);
    let baked = Baked::new("in.glb", &shared(nodes), Cut::Nowhere);
    assert_eq!(baked.json()["nodes"][0]["extras"]["mine"], json!([1, 2]));
    assert!(baked.json()["nodes"][0]["extras"]["lightmap"].is_object());
    assert_eq!(baked.json()["nodes"][1]["extras"], "text");
    assert!(baked.warns("not an object"), "{:?}", baked.written.warnings);
    let pages = baked.json()["scenes"][0]["extras"]["lightmaps"].as_array().unwrap();
    assert_eq!(pages.len(), 2);
    assert_eq!(pages[1]["file"], "in.baked.lightmap1.exr");
    assert_eq!(pages[0]["store"], "irradiance-over-pi");
    assert_eq!(pages[0]["intensity"].as_f64(), Some(std::f64::consts::PI));
    assert_eq!((&pages[0]["unit"], &pages[0]["texelsPerMetre"]), (&json!("W/(m^2 sr)"), &json!(16.0)));
}

#[test]
fn the_pages_are_told_to_the_scene_that_was_baked() {
    let bytes = sheet(6).glb(json!({
        "scenes": [{"name": "Empty", "nodes": [1]}, {"name": "Full", "nodes": [0]}],
        "nodes": [{"mesh": 0}, {"name": "Nothing"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    }));
    let folder = tempfile::tempdir().unwrap();
    let options = ImportOptions { scene: Some("Full".to_owned()), ..ImportOptions::default() };
    let loaded = import::load_bytes(&folder.path().join("in.glb"), &bytes, &options).unwrap();
    let output = folder.path().join("in.baked.glb");
    let atlas = kit::atlas(&loaded.1, Cut::Nowhere, |_| 0);
    let light = kit::lightmap(&atlas);
    let out = ExportOptions::default();
    export::write(&loaded.0, &loaded.1, &atlas, &light, None, &kit::metadata(), &out).unwrap();
    let (after, _) = import::load(&output, &options).unwrap();
    assert_eq!(after.json["scenes"][0], json!({"name": "Empty", "nodes": [1]}));
    assert!(after.json["scenes"][1]["extras"]["lightmaps"].is_array());
}

fn instanced() -> Vec<u8> {
    let mut builder = sheet(6);
    builder.floats(&[1.0, 2.0, 3.0, -1.0, 0.0, 0.5], "VEC3");
    // A half turn about y and about x, in bytes: not quite of length 1 after decoding.
    builder.accessor(&[0, 126, 0, 0, 90, 0, 0, 90], 5120, "VEC4", 2);
    builder.accessors[3]["normalized"] = json!(true);
    builder.floats(&[2.0, 2.0, 2.0, 1.0, -1.0, 1.0], "VEC3");
    builder.floats(&[7.0, 8.0], "SCALAR");
    let attributes = json!({"TRANSLATION": 2, "ROTATION": 3, "SCALE": 4, "_ID": 5});
    builder.glb(json!({
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "extensionsRequired": ["EXT_mesh_gpu_instancing"],
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "Trees", "mesh": 0, "children": [1], "translation": [0.0, 5.0, 0.0], "extras": {"n": 2},
             "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}, "VENDOR_x": {"kept": true}}},
            {"name": "Bird"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    }))
}

#[test]
fn instances_become_nodes_that_stand_where_they_stood() {
    let baked = Baked::new("in.glb", &instanced(), Cut::Thirds);
    let nodes = baked.json()["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), 4);
    assert_eq!(
        nodes[0],
        json!({"name": "Trees", "children": [1, 2, 3], "translation": [0.0, 5.0, 0.0], "extras": {"n": 2},
               "extensions": {"VENDOR_x": {"kept": true}}})
    );
    assert_eq!(nodes[1], json!({"name": "Bird"}));
    assert_eq!((&nodes[2]["name"], &nodes[2]["mesh"]), (&json!("Trees.000"), &json!(0)));
    assert_eq!((&nodes[3]["name"], &nodes[3]["mesh"]), (&json!("Trees.001"), &json!(1)));
    assert_eq!(nodes[3]["extras"]["instance"], json!({"_ID": [8.0]}));
    assert!(nodes[3]["extras"]["lightmap"].is_object());
    assert!(baked.warns("_ID"));
    for list in ["extensionsUsed", "extensionsRequired"] {
        let names = baked.json()[list].to_string();
        assert!(!names.contains("instancing"), "{list}: {names}");
    }
    assert_eq!(baked.scene.surfaces.len(), 2);
    for (old, new) in baked.scene.surfaces.iter().zip(&baked.scene_after.surfaces) {
        for triangle in 0..4 {
            let (a, b) =
                (baked.scene.corners_world(old, triangle), baked.scene_after.corners_world(new, triangle));
            for (a, b) in a.iter().zip(&b) {
                // Rotations are rounded once more, to f32.
                assert!(
                    (*a - *b).abs().max_element() <= 1e-6 * a.abs().max(Vec3::ONE).max_element(),
                    "{a} {b}"
                );
            }
        }
    }
}

fn lamps() -> Vec<u8> {
    let punctual = |light: u32| json!({"KHR_lights_punctual": {"light": light}});
    sheet(6).glb(json!({
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensionsRequired": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "name": "Bulb", "extras": {"watts": 3}}, {"type": "directional"}]}},
        "scenes": [{"nodes": [0, 1]}, {"nodes": [3]}],
        "nodes": [
            {"mesh": 0},
            {"name": "Bulb", "extensions": punctual(0), "children": [2]},
            {"name": "Other", "extensions": {"VENDOR_x": {}, "KHR_lights_punctual": {"light": 0}}},
            {"name": "Elsewhere", "extensions": punctual(1)},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    }))
}

fn with_lamps(lamps_out: LampsOut, light: LightPart) -> Baked {
    let options = ExportOptions { lamps: lamps_out, light, ..ExportOptions::default() };
    Baked::with("in.glb", &lamps(), Cut::Nowhere, |_| 0, options)
}

#[test]
fn lamps_stay_are_tagged_or_go() {
    let kept = with_lamps(LampsOut::Keep, LightPart::Full);
    assert_eq!(
        kept.json()["nodes"].as_array().unwrap()[1..],
        kept.before.json["nodes"].as_array().unwrap()[1..]
    );
    assert!(kept.warns("lights twice"));
    assert!(!with_lamps(LampsOut::Keep, LightPart::Indirect).warns("lights twice"));

    let tagged = with_lamps(LampsOut::Tag, LightPart::Full);
    let list = &tagged.json()["extensions"]["KHR_lights_punctual"]["lights"];
    assert_eq!(list[0]["extras"], json!({"watts": 3, "baked": true}));
    assert_eq!(list[1].get("extras"), None, "another scene's lamp");
    assert_eq!(tagged.json()["nodes"][1]["extras"], json!({"baked": true}));
    assert_eq!(tagged.json()["nodes"][2]["extras"], json!({"baked": true}));

    let removed = with_lamps(LampsOut::Remove, LightPart::Full);
    assert_eq!(removed.json()["nodes"][1], json!({"name": "Bulb", "children": [2]}));
    assert_eq!(removed.json()["nodes"][2]["extensions"], json!({"VENDOR_x": {}}));
    assert_eq!(removed.json()["nodes"][3], removed.before.json["nodes"][3]);
    assert_eq!(removed.json()["extensions"], removed.before.json["extensions"]);
    assert_eq!(removed.json()["extensionsRequired"], json!(["KHR_lights_punctual"]));
    assert!(with_lamps(LampsOut::Remove, LightPart::Indirect).warns("direct light"));
}

#[test]
fn a_scene_that_takes_no_light_is_written_as_it_was() {
    let mut builder = Builder::default();
    builder.positions(3);
    let bytes = builder.glb(json!({
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "extras": {"lightkiln": {"bake": false}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    }));
    let baked = Baked::new("in.glb", &bytes, Cut::Nowhere);
    assert_eq!(baked.json()["nodes"], baked.before.json["nodes"]);
    assert_eq!(baked.json()["meshes"], baked.before.json["meshes"]);
    assert!(baked.warns("no object took a lightmap"));
}
