//! Names, resources, and that an error leaves nothing behind.

use crate::kit::{Baked, Builder, Cut, atlas, lightmap, metadata, sheet};
use lightkiln::Error;
use lightkiln::export::{self, output_path};
use lightkiln::import;
use lightkiln::options::{ExportOptions, ImportOptions};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

fn to(output: impl Into<PathBuf>) -> ExportOptions {
    ExportOptions { output: Some(output.into()), ..ExportOptions::default() }
}

fn json(builder: &Builder) -> Value {
    builder.json(json!({
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    }))
}

fn plain() -> Vec<u8> {
    let builder = sheet(6);
    crate::kit::glb(&json(&builder).to_string(), Some(&builder.bin), &[])
}

fn names(folder: &Path) -> Vec<String> {
    let mut found: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    found.sort();
    found
}

#[test]
fn the_name_says_the_container_and_is_never_the_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for name in ["a.glb", "a.gltf", "a.vrm"] {
        fs::write(path(name), "").unwrap();
    }
    let out = |input: &str, options: &ExportOptions| output_path(&path(input), options);
    assert_eq!(out("a.glb", &to(path("b.GLTF"))).unwrap(), path("b.GLTF"));
    assert_eq!(out("a.glb", &ExportOptions::default()).unwrap(), path("a.baked.glb"));
    assert_eq!(out("a.gltf", &ExportOptions::default()).unwrap(), path("a.baked.gltf"));
    assert_eq!(out("a.vrm", &ExportOptions::default()).unwrap(), path("a.baked.glb"));
    assert_eq!(out("a.vrm", &to(path("b.vrm"))).unwrap(), path("b.vrm"));
    for bad in ["b", "b.obj", "b.vrm", "./a.glb"] {
        assert!(matches!(out("a.glb", &to(path(bad))), Err(Error::Invalid { .. })), "{bad}");
    }
    assert!(
        matches!(out("a.glb", &to(path("no/b.glb"))), Err(Error::Io { path, .. }) if path.ends_with("no"))
    );
    fs::create_dir(path("folder.glb")).unwrap();
    assert!(out("a.glb", &to(path("folder.glb"))).is_err());
    for preview in ["b.glb", "a.glb", "no/c.glb"] {
        let options = ExportOptions { preview: Some(path(preview)), ..to(path("b.glb")) };
        assert!(out("a.glb", &options).is_err(), "{preview}");
    }
    assert_eq!(
        names(folder.path()),
        ["a.glb", "a.gltf", "a.vrm", "folder.glb"],
        "asking leaves nothing behind"
    );
}

#[test]
fn the_same_bake_gives_the_same_bytes() {
    let bytes = plain();
    let files = |cut| {
        let options = ExportOptions { preview: Some("p.glb".into()), ..to("o.glb") };
        let baked = Baked::with("in.glb", &bytes, cut, |_| 0, options);
        baked.written.files.iter().map(|path| fs::read(path).unwrap()).collect::<Vec<_>>()
    };
    assert!(files(Cut::Thirds) == files(Cut::Thirds));
}

#[test]
fn an_error_leaves_nothing_behind_and_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.glb");
    fs::write(&input, plain()).unwrap();
    let (document, scene) = import::load(&input, &ImportOptions::default()).unwrap();
    let atlas = atlas(&scene, Cut::Thirds, |_| 0);
    let light = lightmap(&atlas);
    let write = |light, options: &ExportOptions| {
        export::write(&document, &scene, &atlas, light, None, &metadata(), options)
    };

    let missing = folder.path().join("missing/out.glb");
    assert!(matches!(write(&light, &to(&missing)), Err(Error::Io { .. })));
    // The preview fails after everything else is ready.
    let preview = ExportOptions { preview: Some(folder.path().join("p.glb")), ..ExportOptions::default() };
    assert!(write(&light, &preview).unwrap_err().to_string().contains("E/π"));
    let mut short = light.clone();
    short.pages.pop();
    assert!(matches!(write(&short, &ExportOptions::default()), Err(Error::Invalid { .. })));
    assert_eq!(names(folder.path()), ["in.glb"]);

    // A page would replace a file that the input is made of.
    let builder = sheet(6);
    let mut refers = json(&builder);
    refers["images"] = json!([{"uri": "out.lightmap0.exr"}]);
    fs::write(folder.path().join("out.lightmap0.exr"), "precious").unwrap();
    fs::write(&input, crate::kit::glb(&refers.to_string(), Some(&builder.bin), &[])).unwrap();
    let (document, scene) = import::load(&input, &ImportOptions::default()).unwrap();
    let options = to(folder.path().join("out.glb"));
    let error = export::write(&document, &scene, &atlas, &light, None, &metadata(), &options).unwrap_err();
    assert!(error.to_string().contains("another output name"), "{error}");
    assert_eq!(names(folder.path()), ["in.glb", "out.lightmap0.exr"]);
    assert_eq!(fs::read_to_string(folder.path().join("out.lightmap0.exr")).unwrap(), "precious");
}

#[test]
fn texels_no_page_can_hold_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.glb");
    fs::write(&input, plain()).unwrap();
    let (document, scene) = import::load(&input, &ImportOptions::default()).unwrap();
    let atlas = atlas(&scene, Cut::Thirds, |_| 0);
    let mut light = lightmap(&atlas);
    light.pages[1].value[3].x = 1e9;
    light.pages[1].value[4].y = f32::NAN;
    let written =
        export::write(&document, &scene, &atlas, &light, None, &metadata(), &ExportOptions::default())
            .unwrap();
    let of_page: Vec<_> = written.warnings.iter().filter(|w| w.at == "in.baked.lightmap1.exr").collect();
    assert_eq!(of_page.len(), 2, "{:?}", written.warnings);
    let page = export::read_exr(&folder.path().join("in.baked.lightmap1.exr")).unwrap();
    assert_eq!((page.value[3].x, page.value[4].y), (65504.0, 0.0));
}

/// A scene that refers to files of all kinds, in `in/`.
fn with_resources(root: &Path) -> PathBuf {
    let path = |name: &str| root.join(name);
    for folder in ["in/tex", "deep/out/tex"] {
        fs::create_dir_all(path(folder)).unwrap();
    }
    let builder = sheet(6);
    fs::write(path("in/a b.bin"), &builder.bin).unwrap();
    for (name, text) in [
        ("in/tex/a.png", "a"),
        ("in/tex/same.png", "same"),
        ("in/tex/clash.png", "ours"),
        ("in/scene.lightmap0.exr", "old page"),
        ("in/sound.ogg", "la"),
        ("in/extra.txt", "x"),
        ("outside.png", "o"),
        ("deep/out/tex/same.png", "same"),
        ("deep/out/tex/clash.png", "theirs"),
    ] {
        fs::write(path(name), text).unwrap();
    }
    let uris = [
        "tex/a.png",
        "tex/same.png",
        "tex/clash.png",
        "../outside.png",
        "gone.png",
        "scene.lightmap0.exr",
        "https://example.org/x.png",
        "data:image/png;base64,AA",
    ];
    let mut json = json(&builder);
    json["buffers"][0]["uri"] = json!("a%20b.bin");
    json["images"] = uris.iter().map(|uri| json!({"uri": uri})).collect();
    json["extensions"] = json!({"VENDOR_audio": {"clips": [{"uri": "sound.ogg"}]}});
    json["extensionsUsed"] = json!(["VENDOR_audio"]);
    json["extras"] = json!({"uri": "extra.txt"});
    fs::write(path("in/scene.gltf"), json.to_string()).unwrap();
    path("in/scene.gltf")
}

#[test]
fn resources_come_along_and_references_stay() {
    let root = tempfile::tempdir().unwrap();
    let input = with_resources(root.path());
    let options = ExportOptions { preview: Some("deep/out/look.glb".into()), ..to("deep/out/scene.gltf") };
    let baked = Baked::of_file(root, &input, Cut::Thirds, |_| 0, options).unwrap();
    let mut wanted = baked.before.json["images"].clone();
    wanted[2]["uri"] = json!("../../in/tex/clash.png");
    wanted[3]["uri"] = json!("../../outside.png");
    wanted[5]["uri"] = json!("../../in/scene.lightmap0.exr");
    assert_eq!(baked.json()["images"].as_array().unwrap()[..8], wanted.as_array().unwrap()[..]);
    assert_eq!(baked.json()["buffers"][0], baked.before.json["buffers"][0]);
    for words in ["clash.png", "outside.png", "scene.lightmap0.exr"] {
        let told =
            baked.written.warnings.iter().filter(|w| w.at.ends_with(words) && w.what.contains("refers to"));
        assert!(told.count() >= 1, "{words}: {:?}", baked.written.warnings);
    }
    assert!(baked.written.warnings.iter().any(|w| w.at == "gone.png"));
    let read = |name: &str| fs::read_to_string(baked.folder.path().join(name)).unwrap();
    for (name, text) in [
        ("deep/out/tex/a.png", "a"),
        ("deep/out/tex/clash.png", "theirs"),
        ("deep/out/sound.ogg", "la"),
        ("in/scene.lightmap0.exr", "old page"),
    ] {
        assert_eq!(read(name), text, "{name}");
    }
    assert!(baked.folder.path().join("deep/out/a b.bin").is_file());
    assert!(!baked.folder.path().join("deep/out/extra.txt").exists());
    let page = baked.folder.path().join("deep/out/scene.lightmap0.exr");
    assert_eq!(export::read_exr(&page).unwrap().size, [64, 64]);
}

#[test]
fn a_glb_takes_the_first_buffer_in_and_the_rest_along() {
    let root = tempfile::tempdir().unwrap();
    let input = with_resources(root.path());
    let baked = Baked::of_file(root, &input, Cut::Thirds, |_| 0, to("deep/out/scene.glb")).unwrap();
    assert_eq!(baked.json()["buffers"][0].get("uri"), None);
    assert!(!baked.folder.path().join("deep/out/a b.bin").exists(), "its bytes are in the GLB");
    assert!(baked.folder.path().join("deep/out/tex/a.png").exists());
}

#[test]
fn in_the_same_folder_nothing_is_copied() {
    let root = tempfile::tempdir().unwrap();
    let input = with_resources(root.path());
    let before = names(&root.path().join("in"));
    let baked = Baked::of_file(root, &input, Cut::Nowhere, |_| 0, ExportOptions::default()).unwrap();
    let mut after = names(&baked.folder.path().join("in"));
    after.retain(|name| !before.contains(name));
    assert_eq!(
        after,
        [
            "scene.baked.gltf",
            "scene.baked.lightmap.bin",
            "scene.baked.lightmap0.exr",
            "scene.baked.lightmap1.exr"
        ]
    );
    assert_eq!(
        baked.json()["images"].as_array().unwrap()[..8],
        baked.before.json["images"].as_array().unwrap()[..]
    );
}
