//! Where new bytes go, and what stays of the old ones.

use crate::kit::{Baked, Builder, Cut, glb, sheet};
use lightkiln::import::Container;
use lightkiln::options::ExportOptions;
use serde_json::{Value, json};
use std::fs;

fn file(builder: &Builder) -> Value {
    builder.json(json!({
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    }))
}

fn to(output: &str) -> ExportOptions {
    ExportOptions { output: Some(output.into()), ..ExportOptions::default() }
}

fn base64(bytes: &[u8]) -> String {
    use base64::Engine;
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

fn bin(baked: &Baked) -> Option<&[u8]> {
    match &baked.after.container {
        Container::Binary { bin, .. } => bin.as_deref(),
        Container::Json => None,
    }
}

#[test]
fn a_glb_grows_behind_its_own_bytes_and_keeps_its_chunks() {
    // A BIN chunk two bytes longer than its buffer; both are kept.
    let builder = sheet(6);
    let mut bin_bytes = builder.bin.clone();
    bin_bytes.extend([0xAB, 0xCD]);
    let bytes = glb(&file(&builder).to_string(), Some(&bin_bytes), &[(b"XTRA", b"unknown!"), (b"MORE", b"")]);
    let baked = Baked::new("in.glb", &bytes, Cut::Thirds);
    let Container::Binary { bin: Some(old), .. } = &baked.before.container else { panic!() };
    let Container::Binary { bin: Some(new), other_chunks } = &baked.after.container else { panic!() };
    assert_eq!(old.len(), bin_bytes.len() + 2);
    assert_eq!(new[..old.len()], old[..]);
    let wanted =
        [(u32::from_le_bytes(*b"XTRA"), b"unknown!".to_vec()), (u32::from_le_bytes(*b"MORE"), Vec::new())];
    assert_eq!(other_chunks[..], wanted);
    assert_eq!(baked.json()["buffers"].as_array().unwrap().len(), 1);
    assert!(baked.json()["bufferViews"][2]["byteOffset"].as_u64().unwrap() >= old.len() as u64);
}

#[test]
fn a_glb_that_keeps_its_bytes_elsewhere_gets_a_buffer_more() {
    let builder = sheet(6);
    let mut json = file(&builder);
    json["buffers"][0]["uri"] = json!(format!("data:;base64,{}", base64(&builder.bin)));
    for orphan in [None, Some(b"orphaned".as_slice())] {
        let baked = Baked::new("in.glb", &glb(&json.to_string(), orphan, &[]), Cut::Thirds);
        assert_eq!(bin(&baked), orphan);
        assert_eq!(baked.json()["buffers"][0], json["buffers"][0]);
        assert!(baked.json()["buffers"][1]["uri"].as_str().unwrap().starts_with("data:"));
        assert_eq!(baked.names().len(), 3);
    }
}

#[test]
fn a_glb_with_an_external_buffer_gets_another_one() {
    let builder = sheet(6);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("all.bin"), &builder.bin).unwrap();
    let mut json = file(&builder);
    json["buffers"][0]["uri"] = json!("all.bin");
    let input = folder.path().join("in.glb");
    fs::write(&input, glb(&json.to_string(), None, &[])).unwrap();
    let baked = Baked::of_file(folder, &input, Cut::Thirds, |_| 0, ExportOptions::default()).unwrap();
    assert_eq!(bin(&baked), None);
    assert_eq!(baked.json()["buffers"][0], json["buffers"][0]);
    assert_eq!(baked.json()["buffers"][1]["uri"], "in.baked.lightmap.bin");
    assert!(baked.names().contains(&"in.baked.lightmap.bin".to_owned()));
}

#[test]
fn a_gltf_stays_one_and_its_buffers_too() {
    let builder = sheet(6);
    let mut json = file(&builder);
    json["buffers"][0]["uri"] =
        json!(format!("data:application/octet-stream;base64,{}", base64(&builder.bin)));
    let baked = Baked::new("in.gltf", json.to_string().as_bytes(), Cut::Thirds);
    assert!(matches!(baked.after.container, Container::Json));
    assert_eq!(baked.names(), ["in.baked.lightmap0.exr", "in.baked.lightmap1.exr", "in.baked.gltf"]);
    assert_eq!(baked.json()["buffers"][0], json["buffers"][0]);
    assert!(baked.json()["buffers"][1]["uri"].as_str().unwrap().starts_with("data:"));

    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("in.bin"), &builder.bin).unwrap();
    json["buffers"][0]["uri"] = json!("in.bin");
    let input = folder.path().join("in.gltf");
    fs::write(&input, json.to_string()).unwrap();
    let baked = Baked::of_file(folder, &input, Cut::Thirds, |_| 0, ExportOptions::default()).unwrap();
    assert_eq!(fs::read(baked.folder.path().join("in.bin")).unwrap(), builder.bin);
    assert_eq!(baked.json()["buffers"][1]["uri"], "in.baked.lightmap.bin");
}

#[test]
fn a_gltf_becomes_a_glb() {
    let mut builder = sheet(6);
    let folder = tempfile::tempdir().unwrap();
    builder.bin.push(0xAB); // one byte that nothing names: what is new must be aligned all the same
    fs::write(folder.path().join("one.bin"), &builder.bin).unwrap();
    fs::write(folder.path().join("two.bin"), [1, 2, 3, 4]).unwrap();
    let mut json = file(&builder);
    json["buffers"] = json!([
        {"name": "first", "uri": "one.bin", "byteLength": builder.bin.len()},
        {"uri": "two.bin", "byteLength": 4},
    ]);
    let input = folder.path().join("in.gltf");
    fs::write(&input, json.to_string()).unwrap();
    let baked = Baked::of_file(folder, &input, Cut::Thirds, |_| 0, to("out.glb")).unwrap();
    assert_eq!(bin(&baked).unwrap()[..builder.bin.len()], builder.bin[..]);
    let buffers = &baked.json()["buffers"];
    assert_eq!((buffers[0].get("uri"), &buffers[0]["name"]), (None, &json!("first")));
    assert_eq!(buffers[1], json["buffers"][1]);
    let views = baked.json()["bufferViews"].as_array().unwrap();
    assert!(views.iter().all(|view| view["byteOffset"].as_u64().unwrap() % 4 == 0));
}

#[test]
fn a_glb_becomes_a_gltf() {
    let builder = sheet(6);
    let bytes = glb(&file(&builder).to_string(), Some(&builder.bin), &[(b"XTRA", b"unknown!")]);
    let baked = Baked::with("in.glb", &bytes, Cut::Thirds, |_| 0, to("out.gltf"));
    assert_eq!(baked.names(), ["out.lightmap0.exr", "out.lightmap1.exr", "out.lightmap.bin", "out.gltf"]);
    assert_eq!(baked.json()["buffers"].as_array().unwrap().len(), 1);
    let buffer = fs::read(baked.folder.path().join("out.lightmap.bin")).unwrap();
    assert_eq!(buffer[..builder.bin.len()], builder.bin[..]);
    assert_eq!(baked.json()["buffers"][0]["byteLength"].as_u64(), Some(buffer.len() as u64));
    assert!(baked.warns("XTRA"));
}

#[test]
fn a_file_without_buffers_gets_its_first() {
    // Accessors without a buffer view are all zero.
    let json = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [0, 0, 0]}],
    });
    for (name, buffers) in [("in.glb", 1), ("in.gltf", 1)] {
        let bytes = if name.ends_with("b") {
            glb(&json.to_string(), None, &[])
        } else {
            json.to_string().into_bytes()
        };
        let baked = Baked::forced(name, &bytes, Cut::Nowhere);
        assert_eq!(baked.json()["buffers"].as_array().unwrap().len(), buffers);
        assert!(baked.scene_after.surfaces.len() == 1);
    }
}

#[test]
fn numbers_are_written_letter_by_letter_as_they_were() {
    let mut json = sheet(6).json(json!({
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "Sheet", "mesh": 0, "extras": "NUMBERS"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    }));
    let numbers = r#"{"plain":[1e5,1.50,-0.0,2E-3],"1E5":"1e5 \"1E5\"","other":[1E5,1e+5,3E007]}"#;
    for name in ["in.glb", "in.gltf"] {
        if name.ends_with("gltf") {
            json["buffers"][0]["uri"] = "in.bin".into();
        }
        let text = json.to_string().replace(r#""NUMBERS""#, numbers);
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join(name);
        std::fs::write(folder.path().join("in.bin"), &sheet(6).bin).unwrap();
        let bytes = if name.ends_with("glb") { glb(&text, Some(&sheet(6).bin), &[]) } else { text.into() };
        std::fs::write(&input, bytes).unwrap();
        let baked = Baked::of_file(folder, &input, Cut::Triangles, |_| 0, ExportOptions::default()).unwrap();
        let bytes = std::fs::read(baked.written.files.last().unwrap()).unwrap();
        let compact: String = String::from_utf8_lossy(&bytes).replace(['\n', ' '], "");
        // The bake's own extras follow.
        let expected = numbers.replace(' ', "");
        assert!(compact.contains(expected.trim_end_matches('}')), "{name}");
    }
}
