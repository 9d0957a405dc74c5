//! SIGKILL at any moment, and at every rename.

use super::{Files, Place, is_temporary};
use lightkiln::export::check_place;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// How often a bake is killed: 50 times, or `LIGHTKILN_KILLS`.
fn kills() -> u32 {
    std::env::var("LIGHTKILN_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(50)
}

/// The baked glTF, the page it refers to, which comes before it, and the preview, which is one file.
const FILES: [&str; 3] = ["out.glb", "out.lightmap0.exr", "lit.glb"];

/// What a whole run leaves; how long it took.
fn whole(place: &Place, more: &[&str]) -> (Files, Duration) {
    let begin = Instant::now();
    let output = place.bake_to(Path::new("")).args(more).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (place.files(), begin.elapsed())
}

#[test]
fn killed_at_any_moment_it_leaves_whole_files_or_none() {
    let (new, took) = whole(&Place::new(), &[]);
    let (old, _) = whole(&Place::new(), &["--density", "5"]);
    for name in FILES {
        assert!(new[name] != old[name], "{name}");
    }
    let place = Place::new();
    let mut left_something = 0;
    for kill in 0..kills() {
        // Half of the runs replace the files of another bake.
        let before = if kill % 2 == 0 { place_only_input(&place) } else { place_all(&place, &old) };
        let mut child =
            place.bake_to(Path::new("")).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        // A third dies while it writes, which is quick and would hardly be met by chance; the others anywhere.
        let share = f64::from(kill.wrapping_mul(2_654_435_769)) / f64::from(u32::MAX);
        if kill % 3 == 0 {
            let begin = Instant::now();
            while child.try_wait().unwrap().is_none()
                && begin.elapsed() < Duration::from_secs(60)
                && !place.files_are_being_written(&before)
            {
                std::thread::yield_now();
            }
            std::thread::sleep(Duration::from_micros((share * 20_000.0) as u64));
        } else {
            std::thread::sleep(took.mul_f64(share));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let left = place.files();
        left_something += usize::from(left.keys().any(|name| is_temporary(name)));
        examine(&before, &left, &new, kill);
        // What the next run into the folder begins with, whatever it bakes.
        check_place(&place.path("another.glb")).unwrap();
        let settled = place.files();
        assert!(!settled.keys().any(|name| is_temporary(name)), "after kill {kill}: {:?}", settled.keys());
        which(&settled, &before, &new).unwrap_or_else(|| panic!("after kill {kill} neither bake is whole"));
    }
    assert!(left_something > 0, "no kill came while files were written: the test is too tame");
    // The next run cleans up, and is as if nothing had happened.
    assert_eq!(whole(&place, &[]).0, new);
}

/// Which bake stands in the folder, whole.
fn which(found: &Files, old: &Files, new: &Files) -> Option<&'static str> {
    let is = |bake: &Files| FILES.iter().all(|name| found.get(*name) == bake.get(*name));
    if is(old) { Some("old") } else { is(new).then_some("new") }
}

/// Put between the program and its C library, kills it before it renames or removes a file for the nth time.
#[cfg(target_os = "linux")]
const SHIM: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
static atomic_int steps;
static void step(void) {
    const char *last = getenv("KILLED_BEFORE");
    if (last && atomic_fetch_add(&steps, 1) == atoi(last)) raise(SIGKILL);
}
int rename(const char *from, const char *to) {
    step();
    return ((int (*)(const char *, const char *))dlsym(RTLD_NEXT, "rename"))(from, to);
}
int unlink(const char *path) {
    step();
    return ((int (*)(const char *))dlsym(RTLD_NEXT, "unlink"))(path);
}
"#;

#[cfg(target_os = "linux")]
fn shim(folder: &Path) -> PathBuf {
    let (source, library) = (folder.join("shim.c"), folder.join("shim.so"));
    std::fs::write(&source, SHIM).unwrap();
    let built =
        Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).arg("-ldl").status();
    assert!(built.is_ok_and(|status| status.success()), "what builds xatlas builds this too");
    library
}

#[cfg(target_os = "linux")]
#[test]
fn killed_before_every_single_rename_one_bake_is_whole_after_the_next_run() {
    let tools = tempfile::tempdir().unwrap();
    let shim = shim(tools.path());
    let (new, _) = whole(&Place::new(), &[]);
    let (old, _) = whole(&Place::new(), &["--density", "5"]);
    for over_older in [false, true] {
        let (mut found, mut without_gltf) = (Vec::new(), 0);
        for step in 0.. {
            let place = Place::new();
            let before = if over_older { place_all(&place, &old) } else { place.files() };
            let mut bake = place.bake_to(Path::new(""));
            let status =
                bake.env("LD_PRELOAD", &shim).env("KILLED_BEFORE", step.to_string()).output().unwrap();
            if status.status.success() {
                break;
            }
            assert_eq!(status.status.signal(), Some(9), "{}", String::from_utf8_lossy(&status.stderr));
            let left = place.files();
            examine(&before, &left, &new, step);
            without_gltf += usize::from(over_older && !left.contains_key(FILES[0]));
            let another = ["--page-size", "64", "-o", "another.glb"];
            assert!(place.bake_within("true", &another).output().unwrap().status.success());
            let settled = place.files();
            assert!(!settled.keys().any(|name| is_temporary(name)), "{:?}", settled.keys());
            found.push(
                which(&settled, &before, &new).unwrap_or_else(|| panic!("step {step}: neither is whole")),
            );
        }
        // First the older, then the new: three renames aside, three to the names, and the journal's end.
        assert!(found.is_sorted_by_key(|bake| *bake == "new"), "{found:?}");
        let newer = found.iter().filter(|bake| **bake == "new").count();
        assert!(newer >= if over_older { 7 } else { 4 } && newer < found.len(), "{found:?}");
        assert_eq!(without_gltf, if over_older { 3 } else { 0 });
    }
}

/// Nothing but the input and what earlier kills left.
fn place_only_input(place: &Place) -> Files {
    for name in place.files().into_keys().filter(|name| name != "cornell.glb" && !is_temporary(name)) {
        std::fs::remove_file(place.path(&name)).unwrap();
    }
    place.files()
}

fn place_all(place: &Place, files: &Files) -> Files {
    for (name, bytes) in files {
        std::fs::write(place.path(name), bytes).unwrap();
    }
    place.files()
}

impl Place {
    /// Whether a temporary file is there that was not there before, one with something in it.
    fn files_are_being_written(&self, before: &Files) -> bool {
        let entries = std::fs::read_dir(self.folder.path()).unwrap().flatten();
        let mut names = entries.filter(|entry| entry.metadata().is_ok_and(|data| data.len() > 0));
        names.any(|entry| {
            let name = entry.file_name().into_string().unwrap();
            is_temporary(&name) && !before.contains_key(&name)
        })
    }
}

fn examine(before: &Files, left: &Files, new: &Files, kill: u32) {
    assert!(left["cornell.glb"] == before["cornell.glb"], "kill {kill} changed the input");
    for (name, bytes) in left.iter().filter(|(name, _)| !is_temporary(name)) {
        let known = before.get(name) == Some(bytes) || new.get(name) == Some(bytes);
        assert!(known, "after kill {kill}, {name} is neither what was there nor what is to be");
    }
    // Between two renames what was there has a temporary name, until all that is to be there is.
    for (name, bytes) in before.iter().filter(|(name, _)| !is_temporary(name)) {
        let aside = || left.iter().any(|(name, kept)| is_temporary(name) && kept == bytes);
        assert!(left.contains_key(name) || aside(), "kill {kill} lost {name}");
    }
    let [glb, exr, _] = FILES;
    if left.contains_key(glb) {
        let made = if left.get(glb) == new.get(glb) { new } else { before };
        assert!(left.get(exr) == made.get(exr), "after kill {kill}, {exr} is not the page of {glb}");
    }
}
