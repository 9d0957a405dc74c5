//! What a bake takes of the machine, against what it said it would.
#![cfg(target_os = "linux")]

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn bake(fixture: &str, page_size: u32, folder: &Path, more: &[&str]) -> Output {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(fixture);
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightkiln"));
    command.arg("bake").arg(scene).arg("-o").arg(folder.join("out.glb"));
    command.args(["--quality", "draft", "--max-pages", "1", "--quiet", "--report", "-"]);
    command.args(["--page-size", &page_size.to_string()]).args(more);
    command.output().expect("the command runs")
}

#[test]
fn the_prediction_holds_within_a_fifth() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut wrong = Vec::new();
    for (fixture, page_size) in [
        ("cornell.glb", 512),
        ("corridor.glb", 512),
        ("leaves.glb", 1024),
        ("window_room.glb", 1024),
        ("grey_lamp.glb", 1024),
        ("instances.glb", 2048),
        ("closed_furnace.glb", 2048),
    ] {
        let output = bake(fixture, page_size, folder.path(), &[]);
        let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
        let predicted = report["predicted_memory_bytes"].as_f64().expect("a prediction");
        let stages = report["stages"].as_array().expect("stages");
        let peak = stages.iter().filter_map(|s| s["peak_memory_bytes"].as_f64()).fold(0.0, f64::max);
        let ratio = predicted / peak;
        if !(0.8..=1.2).contains(&ratio) {
            wrong.push(format!("{fixture} at {page_size}: {predicted} for {peak}, {ratio:.2}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_bake_that_would_take_too_much_is_refused_before_it_starts() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = bake("cornell.glb", 4096, folder.path(), &["--memory", "1GiB"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    for part in ["memory", "GiB", "--page-size"] {
        assert!(said.contains(part), "{part:?} is missing in {said}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
}
