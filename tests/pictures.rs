//! Baked files looked at: `lightkiln render`, `bake --picture` and what they show, against answers known beforehand.

use lightkiln::bake::{Run, bake};
use lightkiln::options::{BakeOptions, Exposure, ImportOptions, Quality, RenderOptions, Store, Tone, View};
use lightkiln::render::{Picture, picture};
use lightkiln::{baked, export};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

fn options(folder: &TempDir, name: &str) -> BakeOptions {
    let mut options = BakeOptions { light: Quality::Draft.light(), ..BakeOptions::default() };
    options.atlas.page_size = 128;
    options.atlas.max_pages = 1;
    options.export.output = Some(folder.path().join(name));
    options
}

fn shown(path: &Path, render: &RenderOptions) -> Picture {
    let baked = baked::read(path, &ImportOptions::default()).expect("the baked file can be read");
    picture(&baked, render).expect("it can be looked at")
}

/// Radiance 1 shows as sRGB of 2^-1.
fn fixed() -> RenderOptions {
    RenderOptions {
        exposure: Exposure::Ev(-1.0),
        tone: Tone::Clip,
        size: Some([80, 60]),
        ..RenderOptions::default()
    }
}

#[test]
fn the_furnace_looks_one_everywhere_whatever_is_stored_and_wherever() {
    let folder = tempfile::tempdir().unwrap();
    for (number, (store, embed)) in [
        (Store::IrradianceOverPi, false),
        (Store::Irradiance, false),
        (Store::Radiosity, false),
        (Store::IrradianceOverPi, true),
    ]
    .into_iter()
    .enumerate()
    {
        let mut options = options(&folder, &format!("furnace {number}.glb"));
        (options.export.store, options.export.embed) = (store, embed);
        bake(&fixture("closed_furnace.glb"), &options, &Run::default()).unwrap();
        let picture = shown(options.export.output.as_ref().unwrap(), &fixed());
        // E/π is 1, so ρE/π + L = 0.5 + 0.5; the bake's own noise of 2 % is 1.2 of 255 steps at sRGB(0.5) = 188.
        let off = picture.rgb.iter().map(|&shown| shown.abs_diff(188)).max();
        assert!(off <= Some(2), "{store:?} embedded {embed}: off by {off:?}");
    }
}

#[test]
fn what_cannot_be_looked_at_is_told_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let not_baked = baked::read(&fixture("cornell.glb"), &ImportOptions::default());
    assert!(not_baked.err().unwrap().to_string().contains("lightkiln bake"));

    let options = options(&folder, "room.glb");
    bake(&fixture("grey_lamp.glb"), &options, &Run::default()).unwrap();
    let output = options.export.output.unwrap();
    let wrong = RenderOptions { view: View::Camera("Nobody".into()), ..fixed() };
    let baked = baked::read(&output, &ImportOptions::default()).unwrap();
    assert!(picture(&baked, &wrong).unwrap_err().to_string().contains("Camera"));

    std::fs::remove_file(folder.path().join("room.lightmap0.exr")).unwrap();
    let baked = baked::read(&output, &ImportOptions::default()).unwrap();
    let said = picture(&baked, &fixed()).unwrap_err().to_string();
    assert!(said.contains("room.lightmap0.exr") && said.contains("missing"), "{said}");
}

#[test]
fn a_bake_takes_the_picture_that_render_takes() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = options(&folder, "room.glb");
    let (taken, again) = (folder.path().join("taken.png"), folder.path().join("again.png"));
    options.export.picture = Some(taken.clone());
    let report = bake(&fixture("grey_lamp.glb"), &options, &Run::default()).unwrap();
    assert!(report.outputs.contains(&taken), "{:?}", report.outputs);
    let picture = shown(options.export.output.as_ref().unwrap(), &RenderOptions::default());
    assert_eq!(picture.size[1], 720);
    export::write_png(&again, picture.size, &picture.rgb).unwrap();
    assert!(std::fs::read(taken).unwrap() == std::fs::read(again).unwrap());
}

#[test]
fn a_picture_that_cannot_be_written_stops_the_bake_before_it_begins() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = options(&folder, "room.glb");
    for wrong in ["picture.jpg", "nowhere/picture.png"] {
        options.export.picture = Some(folder.path().join(wrong));
        assert!(bake(&fixture("grey_lamp.glb"), &options, &Run::default()).is_err(), "{wrong}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn any_number_of_threads_takes_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let options = options(&folder, "leaves.glb");
    bake(&fixture("leaves.glb"), &options, &Run::default()).unwrap();
    let output = options.export.output.unwrap();
    let render = RenderOptions { size: Some([160, 90]), ..RenderOptions::default() };
    let with = |threads| lightkiln::bake::in_pool(Some(threads), || shown(&output, &render)).unwrap();
    let one = with(1);
    assert_eq!(one, with(7));
    // Sun and shadow: not one colour.
    assert!(one.rgb.iter().max() > one.rgb.iter().min().map(|dark| dark + 100).as_ref());
}

/// Runs the command in a folder.
fn lightkiln(folder: &TempDir, arguments: &str) -> std::process::Output {
    let mut command = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("lightkiln"));
    command.current_dir(folder.path()).args(arguments.split_whitespace()).output().unwrap()
}

#[test]
fn the_commands_say_what_they_did_and_end_with_the_right_code() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(fixture("grey_lamp.glb"), folder.path().join("room.glb")).unwrap();
    let run = |arguments: &str, code: i32| {
        let output = lightkiln(&folder, arguments);
        let [out, said] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(output.status.code(), Some(code), "{arguments}\n{out}{said}");
        (out, said)
    };
    run("bake room.glb -q --quality draft --page-size 64 --picture baked.png", 0);
    assert!(folder.path().join("baked.png").exists());

    let (out, said) = run("render room.baked.glb --size 64x48 --exposure -1", 0);
    assert!(
        out.is_empty() && said.contains("room.baked.png: 64 × 48, camera 'Camera', exposure -1.00"),
        "{said}"
    );
    run("render room.baked.glb -q --orbit=90 --tone clip --size 20x20 -o outside.png", 0);
    assert_eq!(image_size(&folder.path().join("outside.png")), [20, 20]);
    assert!(run("render room.glb", 1).1.contains("lightkiln bake"));
    assert!(run("render room.baked.glb --camera Nobody", 1).1.contains("Camera"));
    run("render room.baked.glb --camera Camera --orbit", 2);
    run("render room.baked.glb --size 0x0", 2);
    run("render", 2);

    let (table, _) = run("check room.baked.glb", 0);
    for part in ["room.baked.lightmap0.exr", "64 × 64", "room", "0 errors"] {
        assert!(table.contains(part), "{part} is not in\n{table}");
    }
    let (json, _) = run("check room.baked.glb --json --picture density.png --size 32x32", 0);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["objects"][0]["name"], "room");
    assert_eq!(image_size(&folder.path().join("density.png")), [32, 32]);
    std::fs::write(folder.path().join("room.baked.lightmap0.exr"), "nothing").unwrap();
    let (table, _) = run("check room.baked.glb", 1);
    assert!(table.contains("error: room.baked.lightmap0.exr") && table.contains("unreadable"), "{table}");
}

/// From the header of a PNG.
fn image_size(path: &Path) -> [u32; 2] {
    let bytes = std::fs::read(path).unwrap();
    [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()))
}
