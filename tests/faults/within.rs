//! Faults inside the process, by an observer that does more than look: it panics, or changes the input.

use super::{Place, is_temporary};
use lightkiln::bake::{Run, bake};
use lightkiln::options::{BakeOptions, Quality};
use lightkiln::progress::{Observer, Stage};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

fn options(output: &Path) -> BakeOptions {
    let mut options = BakeOptions { light: Quality::Draft.light(), ..BakeOptions::default() };
    (options.atlas.page_size, options.atlas.max_pages) = (64, 1);
    options.export.output = Some(output.to_owned());
    options
}

/// Does `act` once, in a worker where the stage has workers that tell how far they are, else when it begins.
struct At<'a> {
    stage: Stage,
    from_worker: bool,
    done: AtomicBool,
    act: &'a (dyn Fn() + Sync),
}

impl<'a> At<'a> {
    fn new(stage: Stage, from_worker: bool, act: &'a (dyn Fn() + Sync)) -> Self {
        Self { stage, from_worker, done: AtomicBool::new(false), act }
    }

    fn hear(&self, stage: Stage, from_worker: bool) {
        if stage == self.stage && from_worker == self.from_worker && !self.done.swap(true, Ordering::SeqCst) {
            (self.act)();
        }
    }
}

impl Observer for At<'_> {
    fn stage(&self, stage: Stage) {
        self.hear(stage, false);
    }

    fn advance(&self, stage: Stage, _done: u64, _total: u64) {
        self.hear(stage, true);
    }
}

#[test]
fn a_panic_anywhere_leaves_the_folder_as_it_was() {
    let place = Place::new();
    let before = place.files();
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let mut in_workers = 0;
    for stage in Stage::ALL {
        for from_worker in [false, true] {
            let observer = At::new(stage, from_worker, &|| panic!("a planted panic"));
            let run = Run { threads: Some(2), observer: &observer, ..Run::default() };
            let (input, mut options) = (place.path("cornell.glb"), options(&place.path("out.glb")));
            options.atlas.between_texels = Some(0.05);
            let ended = catch_unwind(AssertUnwindSafe(|| bake(&input, &options, &run).map(drop)));
            if !observer.done.load(Ordering::SeqCst) {
                // A stage whose workers tell nothing: it went well.
                assert!(from_worker, "{stage:?} does not begin");
                place.files().keys().filter(|name| !before.contains_key(*name)).for_each(|name| {
                    std::fs::remove_file(place.path(name)).unwrap();
                });
                continue;
            }
            in_workers += usize::from(from_worker);
            assert!(ended.is_err(), "the panic in {stage:?} was swallowed");
            assert!(place.files() == before, "after a panic in {stage:?}: {:?}", place.files().keys());
        }
    }
    std::panic::set_hook(hook);
    assert!(in_workers >= 4, "only {in_workers} stages tell how far they are");
    // And the next bake is none the worse.
    bake(&place.path("cornell.glb"), &options(&place.path("out.glb")), &Run::default()).unwrap();
}

#[test]
fn an_input_that_is_replaced_meanwhile_is_left_alone_and_the_bake_is_of_what_was_read() {
    let place = Place::new();
    let (input, options) = (place.path("cornell.glb"), options(&place.path("out.glb")));
    bake(&input, &options, &Run::default()).unwrap();
    let expected = place.files();
    let replace = || std::fs::write(&input, "the artist saved another scene").unwrap();
    let observer = At::new(Stage::Transport, false, &replace);
    bake(&input, &options, &Run { observer: &observer, ..Run::default() }).unwrap();
    let found = place.files();
    assert_eq!(found["cornell.glb"], b"the artist saved another scene");
    for name in ["out.glb", "out.lightmap0.exr"] {
        assert!(found[name] == expected[name], "{name} is not of the scene that was read");
    }
}

#[test]
fn an_input_that_vanishes_meanwhile_is_not_missed() {
    let place = Place::new();
    let input = place.path("cornell.glb");
    let remove = || std::fs::remove_file(&input).unwrap();
    let observer = At::new(Stage::Transport, false, &remove);
    bake(&input, &options(&place.path("out.glb")), &Run { observer: &observer, ..Run::default() }).unwrap();
    assert!(place.path("out.glb").exists());
}

/// A scene as `.gltf` with its buffer beside it.
fn in_two_files(place: &Place) {
    let (document, _) = lightkiln::import::load(&place.path("cornell.glb"), &Default::default()).unwrap();
    let mut json = document.json.clone();
    json["buffers"][0]["uri"] = "room.bin".into();
    std::fs::write(place.path("room.bin"), &document.buffers[0].bytes).unwrap();
    std::fs::write(place.path("room.gltf"), json.to_string()).unwrap();
}

#[test]
fn a_buffer_that_changes_meanwhile_is_told_and_copies_are_of_what_was_read() {
    for folder in ["", "elsewhere/"] {
        let place = Place::new();
        in_two_files(&place);
        let before = std::fs::read(place.path("room.bin")).unwrap();
        std::fs::create_dir(place.path("elsewhere")).unwrap();
        let change = || std::fs::write(place.path("room.bin"), vec![7; before.len()]).unwrap();
        let observer = At::new(Stage::Transport, false, &change);
        let options = options(&place.path(&format!("{folder}out.gltf")));
        let run = Run { observer: &observer, ..Run::default() };
        let report = bake(&place.path("room.gltf"), &options, &run).unwrap();
        let told = report.warnings.iter().any(|w| w.at.contains("room.bin") && w.what.contains("changed"));
        assert!(told, "{folder}: {:?}", report.warnings);
        assert_eq!(std::fs::read(place.path("room.bin")).unwrap(), vec![7; before.len()]);
        if !folder.is_empty() {
            assert!(std::fs::read(place.path("elsewhere/room.bin")).unwrap() == before);
        }
    }
}

#[test]
fn no_output_replaces_a_file_of_the_input() {
    let place = Place::new();
    in_two_files(&place);
    let before = place.files();
    let input = place.path("room.gltf");
    let with = |change: &dyn Fn(&mut BakeOptions)| {
        let mut options = options(&place.path("out.gltf"));
        change(&mut options);
        let light = AtomicBool::new(false);
        let tell = || light.store(true, Ordering::SeqCst);
        let observer = At::new(Stage::Atlas, false, &tell);
        let error = bake(&input, &options, &Run { observer: &observer, ..Run::default() }).unwrap_err();
        assert!(error.to_string().contains("never changed"), "{error}");
        assert!(!light.load(Ordering::SeqCst), "it was only told after the light was computed");
        assert!(place.files() == before);
    };
    with(&|options| options.export.output = Some(input.clone()));
    with(&|options| options.export.output = Some(place.path("./room.gltf")));
    with(&|options| options.export.preview = Some(input.clone()));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(place.path("room.bin"), place.path("link.glb")).unwrap();
        let before = place.files();
        let mut options = options(&place.path("link.glb"));
        options.export.preview = None;
        assert!(bake(&input, &options, &Run::default()).is_err());
        assert!(place.files() == before);
        std::fs::remove_file(place.path("link.glb")).unwrap();
    }
    // A picture of the name of a texture.
    let mut json: serde_json::Value = serde_json::from_slice(&before["room.gltf"]).unwrap();
    json["images"] = serde_json::json!([{"uri": "wood.png"}]);
    std::fs::write(&input, json.to_string()).unwrap();
    std::fs::write(place.path("wood.png"), "precious").unwrap();
    let mut options = options(&place.path("out.gltf"));
    options.export.picture = Some(place.path("wood.png"));
    let error = bake(&input, &options, &Run::default()).unwrap_err();
    assert!(error.to_string().contains("never changed"), "{error}");
    assert_eq!(std::fs::read(place.path("wood.png")).unwrap(), b"precious");
    assert!(!place.files().keys().any(|name| is_temporary(name)));
}
