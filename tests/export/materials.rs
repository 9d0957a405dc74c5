//! Which material wears the lightmap, and how it points at the page.

use crate::kit::{Baked, Cut, PNG, sheet};
use lightkiln::export::decode_exr;
use lightkiln::options::{ExportOptions, LightPart, Store};
use serde_json::{Value, json};

/// One node a primitive list; all primitives share the same sheet.
fn scene(meshes: &[Value], materials: Value, rest: Value) -> Vec<u8> {
    let count = meshes.len();
    let mut json = json!({
        "scenes": [{"nodes": (0..count).collect::<Vec<_>>()}],
        "nodes": (0..count).map(|mesh| json!({"mesh": mesh})).collect::<Vec<_>>(),
        "meshes": meshes.iter().map(|primitives| json!({"primitives": primitives})).collect::<Vec<_>>(),
    });
    if materials.as_array().is_some_and(|list| !list.is_empty()) {
        json["materials"] = materials;
    }
    json.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
    sheet(6).glb(json)
}

fn wears(material: u32) -> Value {
    json!({"attributes": {"POSITION": 0}, "indices": 1, "material": material})
}

fn worn(baked: &Baked, mesh: usize) -> u64 {
    baked.json()["meshes"][mesh]["primitives"][0]["material"].as_u64().unwrap()
}

fn lightmap(baked: &Baked, material: u64) -> &Value {
    &baked.json()["materials"][material as usize]["extensions"]["MOZ_lightmap"]
}

const PAGE_PER_NODE: fn(usize) -> u32 = |node| node as u32 % 2;

#[test]
fn a_material_of_one_page_is_edited_in_place() {
    let wall = json!({"name": "Wall", "extras": {"x": 1}, "extensions": {"VENDOR_a": {"b": 2}}});
    let bytes = scene(&[json!([wears(0)]), json!([wears(0)])], json!([wall]), json!({}));
    let baked = Baked::new("in.glb", &bytes, Cut::Nowhere);
    assert_eq!(
        baked.json()["materials"],
        json!([{"name": "Wall", "extras": {"x": 1}, "extensions": {"VENDOR_a": {"b": 2},
               "MOZ_lightmap": {"index": 0, "texCoord": 1, "intensity": std::f64::consts::PI}}}])
    );
    assert_eq!(baked.json()["extensionsUsed"], json!(["EXT_texture_exr", "MOZ_lightmap"]));
    assert_eq!(baked.json().get("extensionsRequired"), None);
}

#[test]
fn pages_get_copies_of_a_shared_material() {
    let bytes = scene(
        &[json!([wears(0)]), json!([wears(0)]), json!([wears(0)])],
        json!([{"name": "Wall"}]),
        json!({}),
    );
    let baked = Baked::with("in.glb", &bytes, Cut::Nowhere, PAGE_PER_NODE, ExportOptions::default());
    assert_eq!([worn(&baked, 0), worn(&baked, 1), worn(&baked, 2)], [0, 1, 0]);
    assert_eq!((&lightmap(&baked, 0)["index"], &lightmap(&baked, 1)["index"]), (&json!(0), &json!(1)));
    assert_eq!(baked.json()["materials"][1]["name"], "Wall");
}

#[test]
fn a_material_that_others_wear_too_stays_as_it_was() {
    let left_out = json!({"mesh": 1, "extras": {"lightkiln": {"bake": false}}});
    let nodes = json!({"nodes": [{"mesh": 0}, left_out]});
    let bytes = scene(&[json!([wears(0)]), json!([wears(0)])], json!([{"name": "Wall"}]), nodes);
    let baked = Baked::new("in.glb", &bytes, Cut::Nowhere);
    assert_eq!(baked.json()["materials"][0], json!({"name": "Wall"}));
    assert_eq!([worn(&baked, 0), worn(&baked, 1)], [1, 0]);

    // The same within one mesh, whose second primitive is lines.
    let lines = json!({"attributes": {"POSITION": 0}, "mode": 1, "material": 0});
    let bytes = scene(&[json!([wears(0), lines])], json!([{"name": "Wall"}]), json!({}));
    let baked = Baked::new("in.glb", &bytes, Cut::Thirds);
    assert_eq!(baked.json()["materials"][0], json!({"name": "Wall"}));
    assert_eq!(baked.json()["meshes"][0]["primitives"][1], lines);
    assert_eq!(worn(&baked, 0), 1);
}

#[test]
fn a_primitive_without_material_gets_one_of_defaults() {
    let plain = json!({"attributes": {"POSITION": 0}, "indices": 1});
    let bytes = scene(&[json!([plain]), json!([plain])], json!([]), json!({}));
    let baked = Baked::new("in.glb", &bytes, Cut::Nowhere);
    let materials = baked.json()["materials"].as_array().unwrap();
    assert_eq!(materials.len(), 1);
    let mut keys: Vec<&str> = materials[0].as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    // Not metallic: a metal would not show its lightmap.
    assert_eq!(keys, ["extensions", "name", "pbrMetallicRoughness"]);
    assert_eq!(materials[0]["pbrMetallicRoughness"], json!({"metallicFactor": 0}));
    assert_eq!([worn(&baked, 0), worn(&baked, 1)], [0, 0]);
}

#[test]
fn variants_are_lit_too() {
    let mut primitive = wears(0);
    primitive["extensions"] = json!({"KHR_materials_variants": {"mappings": [
        {"material": 1, "variants": [0], "name": "night"}, {"material": 0, "variants": [1]}]}});
    let rest = json!({
        "extensionsUsed": ["KHR_materials_variants"],
        "extensions": {"KHR_materials_variants": {"variants": [{"name": "a"}, {"name": "b"}]}},
    });
    let materials = json!([{"name": "Day"}, {"name": "Night"}]);
    let bytes = scene(&[json!([primitive]), json!([primitive])], materials, rest);
    let baked = Baked::with("in.glb", &bytes, Cut::Thirds, PAGE_PER_NODE, ExportOptions::default());
    for mesh in 0..2 {
        let primitive = &baked.json()["meshes"][mesh]["primitives"][0];
        let mappings = &primitive["extensions"]["KHR_materials_variants"]["mappings"];
        assert_eq!((&mappings[0]["variants"], &mappings[0]["name"]), (&json!([0]), &json!("night")));
        for (mapping, name) in [(0, "Night"), (1, "Day")] {
            let material = mappings[mapping]["material"].as_u64().unwrap();
            assert_eq!(baked.json()["materials"][material as usize]["name"], name);
            assert_eq!(lightmap(&baked, material)["index"], mesh);
        }
        assert_eq!(mappings[1]["material"], primitive["material"]);
    }
}

#[test]
fn an_animated_copy_is_named() {
    let pointer = json!({"path": "pointer", "extensions": {"KHR_animation_pointer":
        {"pointer": "/materials/0/pbrMetallicRoughness/baseColorFactor"}}});
    let rest = json!({
        "extensionsUsed": ["KHR_animation_pointer"],
        "animations": [{"channels": [{"sampler": 0, "target": pointer}], "samplers": [{"input": 0, "output": 0}]}],
    });
    let bytes = scene(&[json!([wears(0)]), json!([wears(0)])], json!([{"name": "Neon"}]), rest);
    let baked = Baked::with("in.glb", &bytes, Cut::Nowhere, PAGE_PER_NODE, ExportOptions::default());
    assert!(baked.written.warnings.iter().any(|w| w.at == "Neon" && w.what.contains("animat")));
}

#[test]
fn textures_have_a_fallback_that_every_reader_knows() {
    let bytes = scene(&[json!([wears(0)])], json!([{}]), json!({}));
    let baked = Baked::new("Küche 1.glb", &bytes, Cut::Nowhere);
    let json = baked.json();
    let texture = &json["textures"][1];
    assert_eq!(json["textures"].as_array().unwrap().len(), 2);
    let sampler = &json["samplers"][texture["sampler"].as_u64().unwrap() as usize];
    assert_eq!(*sampler, json!({"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}));
    let image = |index: &Value| &json["images"][index.as_u64().unwrap() as usize];
    let (png, exr) = (image(&texture["source"]), image(&texture["extensions"]["EXT_texture_exr"]["source"]));
    assert_eq!(png["mimeType"], "image/png");
    let view = &json["bufferViews"][png["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let data = &baked.after.buffers[0].bytes[start..][..view["byteLength"].as_u64().unwrap() as usize];
    let picture = image::load_from_memory(data).unwrap();
    assert_eq!((picture.width(), picture.height()), (32, 32));
    assert_eq!(
        *exr,
        json!({"name": "Küche 1.baked.lightmap1", "uri": "K%C3%BCche%201.baked.lightmap1.exr", "mimeType": "image/x-exr"})
    );
    assert_eq!(json["nodes"][0]["extras"]["lightmap"]["file"], "Küche 1.baked.lightmap0.exr");
    assert!(baked.folder.path().join("Küche 1.baked.lightmap1.exr").is_file());
}

#[test]
fn what_is_stored_decides_what_viewers_multiply_with() {
    let bytes = scene(&[json!([wears(0)])], json!([{"name": "Wall"}]), json!({}));
    let with = |store, light| {
        let options = ExportOptions { store, light, full_float: true, ..ExportOptions::default() };
        Baked::with("in.glb", &bytes, Cut::Nowhere, |_| 0, options)
    };
    let baked = with(Store::Irradiance, LightPart::Indirect);
    assert_eq!(lightmap(&baked, 0)["intensity"].as_f64(), Some(1.0));
    let page = decode_exr("page", &std::fs::read(&baked.written.files[0]).unwrap()).unwrap();
    assert_eq!(page.value, baked.lightmap.pages[0].value, "32 bit floats are exact");
    for (name, wanted) in [
        ("store", "irradiance"),
        ("unit", "W/m^2"),
        ("light", "indirect"),
        ("version", "lightkiln 0.1.0"),
        ("settings", r#"{"quality":"good"}"#),
        ("convergence.unshot", "0.0001"),
        ("texelsPerMetre", "16"),
        ("pages", "2"),
    ] {
        assert_eq!(page.attributes[&format!("lightkiln.{name}")], wanted);
    }

    // Lamps that another program wrote are in candela and lux, and then so is the light.
    let rest = json!({"asset": {"version": "2.0"}});
    let photometric = scene(&[json!([wears(0)])], json!([{}]), rest);
    let baked = Baked::new("in.glb", &photometric, Cut::Nowhere);
    assert_eq!(baked.json()["scenes"][0]["extras"]["lightmaps"][0]["unit"], "cd/m^2");

    let baked = with(Store::Radiosity, LightPart::Full);
    assert_eq!(
        baked.json()["materials"],
        baked.before.json["materials"],
        "viewers would apply the albedo twice"
    );
    assert_eq!(baked.json()["extensionsUsed"], json!(["EXT_texture_exr"]));
    assert_eq!(baked.json()["nodes"][0]["extras"]["lightmap"]["store"], "radiosity");
    assert_eq!(baked.json()["scenes"][0]["extras"]["lightmaps"][0].get("intensity"), None);
}

#[test]
fn embedded_pages_are_in_the_buffer() {
    let bytes = scene(&[json!([wears(0)])], json!([{}]), json!({}));
    let options = ExportOptions { embed: true, ..ExportOptions::default() };
    let baked = Baked::with("in.glb", &bytes, Cut::Nowhere, |_| 0, options);
    assert_eq!(baked.names(), ["in.baked.glb"]);
    let image = &baked.json()["images"][1];
    assert_eq!((image.get("uri"), &image["mimeType"]), (None, &json!("image/x-exr")));
    let view = &baked.json()["bufferViews"][image["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let exr = &baked.after.buffers[0].bytes[start..][..view["byteLength"].as_u64().unwrap() as usize];
    assert_eq!(decode_exr("page", exr).unwrap().size, [64, 64]);
}

#[test]
fn a_second_bake_replaces_the_first_lightmap() {
    let bytes = scene(&[json!([wears(0)]), json!([wears(0)])], json!([{"name": "Wall"}]), json!({}));
    let once = Baked::with("in.glb", &bytes, Cut::Thirds, PAGE_PER_NODE, ExportOptions::default());
    let folder = tempfile::tempdir().unwrap();
    let input = once.written.files.last().unwrap();
    let output = ExportOptions { output: Some("again.glb".into()), ..ExportOptions::default() };
    let twice = Baked::of_file(folder, input, Cut::Nowhere, PAGE_PER_NODE, output).unwrap();
    assert!(twice.warns("had a lightmap already"));
    for mesh in 0..2 {
        let old = &once.json()["meshes"][mesh]["primitives"][0]["attributes"];
        let new = &twice.json()["meshes"][mesh]["primitives"][0]["attributes"];
        assert_eq!(new["POSITION"], old["POSITION"]);
        assert_ne!(new["TEXCOORD_1"], old["TEXCOORD_1"]);
        assert_eq!(new.get("TEXCOORD_2"), None);
        assert_eq!(
            twice.json()["nodes"][mesh]["extras"]["lightmap"]["file"],
            format!("again.lightmap{mesh}.exr")
        );
        let texture = lightmap(&twice, worn(&twice, mesh))["index"].as_u64().unwrap() as usize;
        assert_eq!(twice.json()["textures"][texture]["name"], format!("again.lightmap{mesh}"));
    }
    assert_eq!(
        twice.json()["materials"].as_array().unwrap()[..2],
        once.json()["materials"].as_array().unwrap()[..]
    );
}

#[test]
fn a_preview_shines_by_itself() {
    let wall = json!({"name": "Wall", "doubleSided": true, "alphaMode": "MASK", "normalTexture": {"index": 0},
        "pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.5, 0.25, 0.75], "metallicFactor": 0.0,
                                 "baseColorTexture": {"index": 0}}});
    let mut builder = sheet(6);
    builder.view(PNG);
    let bytes = builder.glb(json!({
        "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}},
                  {"mesh": 1, "extras": {"lightkiln": {"bake": false}}}],
        "meshes": [{"primitives": [wears(0)]}, {"primitives": [wears(0)]}],
        "materials": [wall],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 2, "mimeType": "image/png"}],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
    }));
    let options = ExportOptions { preview: Some("look.glb".into()), ..ExportOptions::default() };
    let baked = Baked::with("in.glb", &bytes, Cut::Thirds, |_| 1, options);
    assert_eq!(
        baked.names(),
        ["in.baked.lightmap0.exr", "in.baked.lightmap1.exr", "in.baked.glb", "look.glb"]
    );
    let (look, _) =
        lightkiln::import::load(baked.written.files.last().unwrap(), &Default::default()).unwrap();
    let material = look.json["meshes"][0]["primitives"][0]["material"].as_u64().unwrap();
    let material = &look.json["materials"][material as usize];
    // The white of the page is the brightest that the material shows on it: less than one here.
    let white = material["emissiveFactor"][0].as_f64().unwrap();
    assert!(white > 0.1 && white <= 1.0);
    assert_eq!(
        *material,
        json!({"name": "Wall", "doubleSided": true, "alphaMode": "MASK",
               "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 0.75], "metallicFactor": 0,
                                        "roughnessFactor": 1, "baseColorTexture": {"index": 0}},
               "emissiveTexture": {"index": 2, "texCoord": 1}, "emissiveFactor": [white, white, white],
               "extensions": {"KHR_materials_specular": {"specularFactor": 0}}})
    );
    let source = look.json["textures"][2]["source"].as_u64().unwrap() as usize;
    let image = &look.json["images"][source];
    assert_eq!((&image["name"], &image["mimeType"]), (&json!("look.radiance1"), &json!("image/png")));
    let (mesh, node) = (&look.json["meshes"][1], &look.json["nodes"][2]);
    assert_eq!(node["mesh"], 1, "{mesh}");
    let bare = mesh["primitives"][0]["material"].as_u64().unwrap() as usize;
    let bare = &look.json["materials"][bare];
    assert!(
        bare["emissiveTexture"]["index"] == 0 && bare["emissiveFactor"][0].as_f64().unwrap() > 0.1,
        "{bare}"
    );
    assert_eq!(look.json["nodes"][1], json!({}), "no lamp lights it a second time");
}
