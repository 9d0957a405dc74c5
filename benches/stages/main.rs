//! Seconds and rays of every stage of a bake, and of the whole.
//!
//! `cargo bench --bench stages` bakes the fixtures named below on one page of 512² texels with all cores, several
//! times, and prints the least seconds of each stage. Words after `--` are paths of glTF files to bake instead.

use lightkiln::bake::{self, Run};
use lightkiln::options::{BakeOptions, Quality};
use lightkiln::progress::Stage;
use lightkiln::report::Report;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Bakes of each scene; the least of each stage counts.
const TURNS: usize = 3;

const FIXTURES: [&str; 3] = ["cornell.glb", "window_room.glb", "leaves.glb"];

fn main() {
    let mut files: Vec<PathBuf> =
        std::env::args().skip(1).filter(|a| !a.starts_with("--")).map(PathBuf::from).collect();
    if files.is_empty() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures");
        files = FIXTURES.iter().map(|name| folder.join(name)).collect();
    }
    println!("| scene | stage | seconds | rays | Mrays/s |\n| --- | --- | ---: | ---: | ---: |");
    for file in files {
        let reports: Vec<Report> = (0..TURNS).map(|_| bake(&file)).collect();
        let scene = file.file_stem().unwrap_or_default().to_string_lossy();
        for (k, stage) in reports[0].stages.iter().enumerate() {
            let seconds = least(reports.iter().map(|report| report.stages[k].seconds));
            print_row(&scene, name(stage.stage), seconds, stage.rays);
        }
        let rays = reports[0].stages.iter().map(|stage| stage.rays).sum();
        print_row(&scene, "whole bake", least(reports.iter().map(|report| report.seconds_total)), rays);
    }
}

fn bake(file: &Path) -> Report {
    let folder = tempfile::tempdir().expect("a folder for the results");
    let mut options = BakeOptions { light: Quality::Good.light(), ..BakeOptions::default() };
    (options.atlas.page_size, options.atlas.max_pages) = (512, 1);
    options.export.output = Some(folder.path().join("baked.glb"));
    let start = Instant::now();
    let clock = || start.elapsed().as_secs_f64();
    bake::bake(file, &options, &Run { clock: &clock, ..Run::default() }).expect("the scene can be baked")
}

fn least(seconds: impl Iterator<Item = f64>) -> f64 {
    seconds.fold(f64::INFINITY, f64::min)
}

/// Stages by what they do.
fn name(stage: Stage) -> &'static str {
    match stage {
        Stage::Atlas => "unwrap",
        Stage::Transport => "build the tree",
        other => other.name(),
    }
}

fn print_row(scene: &str, stage: &str, seconds: f64, rays: u64) {
    print!("| {scene} | {stage} | {seconds:.3} |");
    if rays > 0 {
        println!(" {rays} | {:.2} |", rays as f64 / seconds / 1e6);
    } else {
        println!(" | |");
    }
}
