//! The same input and options give the same bytes, whatever the number of threads and however often.

use lightkiln::bake::{Run, bake};
use lightkiln::options::{BakeOptions, LightPart, Quality, SkyOption, Store};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Small enough to be quick.
fn draft() -> BakeOptions {
    let mut options = BakeOptions { light: Quality::Draft.light(), ..BakeOptions::default() };
    (options.atlas.page_size, options.atlas.max_pages) = (128, 1);
    options
}

/// All files that a bake leaves, by name.
fn written(input: &Path, options: &BakeOptions, folder: &Path, threads: usize) -> BTreeMap<String, Vec<u8>> {
    if folder.exists() {
        fs::remove_dir_all(folder).unwrap();
    }
    fs::create_dir(folder).unwrap();
    bake(input, options, &Run { threads: Some(threads), ..Run::default() }).unwrap();
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    files.map(|file| (file.file_name().into_string().unwrap(), fs::read(file.path()).unwrap())).collect()
}

/// Fails with the file and the byte that differ.
#[track_caller]
fn same(one: &BTreeMap<String, Vec<u8>>, other: &BTreeMap<String, Vec<u8>>, what: &str) {
    assert!(one.keys().eq(other.keys()), "{what}: {:?} and {:?}", one.keys(), other.keys());
    for (name, bytes) in one {
        let other = &other[name];
        let at = bytes.iter().zip(other).position(|(a, b)| a != b);
        assert!(at.is_none() && bytes.len() == other.len(), "{what}: {name} differs at byte {at:?}");
    }
}

fn check(input: &Path, options: &BakeOptions, folder: &Path, files: usize, what: &str) {
    let one = written(input, options, folder, 1);
    assert!(one.len() >= files, "{what}: {:?}", one.keys());
    same(&one, &written(input, options, folder, 1), &format!("{what}, once more"));
    for threads in [2, 7] {
        same(&one, &written(input, options, folder, threads), &format!("{what}, {threads} threads"));
    }
}

#[test]
fn every_fixture_is_baked_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures");
    let mut inputs: Vec<PathBuf> =
        fs::read_dir(fixtures).unwrap().map(|entry| entry.unwrap().path()).collect();
    inputs.retain(|path| path.extension().is_some_and(|extension| extension == "glb"));
    inputs.sort();
    assert!(inputs.len() >= 12, "{inputs:?}");
    for input in inputs {
        let mut options = draft();
        options.export.output = Some(out.join("baked.glb"));
        // The GLB, its page, and the page's stand-in.
        check(&input, &options, &out, 2, &input.file_name().unwrap().to_string_lossy());
    }
}

#[test]
fn every_way_to_write_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let input = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/window_room.glb");
    type Change<'a> = &'a dyn Fn(&mut BakeOptions);
    let variants: [(&str, Change); 8] = [
        ("irradiance", &|options| options.export.store = Store::Irradiance),
        ("radiosity", &|options| options.export.store = Store::Radiosity),
        ("indirect light alone", &|options| options.export.light = LightPart::Indirect),
        ("direct light alone", &|options| options.export.light = LightPart::Direct),
        ("full floats", &|options| options.export.full_float = true),
        ("embedded", &|options| options.export.embed = true),
        ("with a preview", &|options| options.export.preview = Some(out.join("preview.glb"))),
        ("with a picture", &|options| options.export.picture = Some(out.join("picture.png"))),
    ];
    for (what, change) in variants {
        let mut options = draft();
        options.export.output = Some(out.join("baked.glb"));
        change(&mut options);
        check(&input, &options, &out, 1, what);
    }
}

/// Where a scene and its bake lie is no part of the light: nothing that is written names a folder.
#[test]
fn bakes_into_other_folders_are_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [one, other] = ["a", "another folder with a long name"].map(|name| folder.path().join(name));
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/blend_glass.glb");
    let [one, other] = [one, other].map(|folder| {
        fs::create_dir(&folder).unwrap();
        let input = folder.join("room.glb");
        fs::copy(&fixture, &input).unwrap();
        let sky = folder.join("sky.hdr");
        fs::write(&sky, b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x80\x80\x80\x80\x80")
            .unwrap();
        let out = folder.join("out");
        let mut options = draft();
        options.import.sky = Some(SkyOption::Image { path: sky, strength: 1.0 });
        options.export.output = Some(out.join("lit.glb"));
        options.export.preview = Some(out.join("preview.glb"));
        options.export.picture = Some(out.join("picture.png"));
        written(&input, &options, &out, 2)
    });
    same(&one, &other, "another folder");
    assert!(one.len() >= 4, "{:?}", one.keys());
    let trace = folder.path().to_str().unwrap().as_bytes();
    for (name, bytes) in &one {
        assert!(!bytes.windows(trace.len()).any(|at| at == trace), "{name} names a folder");
    }
    // What the light hangs on is told.
    let told = |word: &str| one["lit.lightmap0.exr"].windows(word.len()).any(|at| at == word.as_bytes());
    assert!(told("lightkiln.settings") && told("sky.hdr") && told("page_size"));
}
