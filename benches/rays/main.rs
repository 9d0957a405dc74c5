//! Rays a second, closest hit and any hit, one thread.
//!
//! `cargo bench --bench rays` prints a table of million rays a second. With `LIGHTKILN_EMBREE` naming a library of
//! Embree 4 (for instance the one inside the Python package `embreex`), the same rays go through Embree's
//! single-ray queries on the same triangles, by turns in the same run, and the ratios are printed; "robust" is
//! Embree's mode for closed meshes. Words after `--` choose scenes by name; the path of a glTF file adds it as a scene.

#![allow(clippy::print_stdout)] // Its table is what it is for.

mod embree;
mod scenes;

use embree::Embree;
use lightkiln::transport::{OpaqueTracer, Tracer, World};
use scenes::{RayKind, Setting};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

/// Turns each contestant takes; the best counts.
const TURNS: usize = 7;

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let (files, names): (Vec<_>, Vec<_>) = wanted.iter().partition(|word| Path::new(word).is_file());
    let mut settings = scenes::all();
    settings.retain(|s| wanted.is_empty() || names.iter().any(|name| s.name.contains(name.as_str())));
    settings.extend(files.iter().map(|file| scenes::from_file(Path::new(file))));
    let library = std::env::var_os("LIGHTKILN_EMBREE");
    if library.is_none() {
        println!("Embree was not found: LIGHTKILN_EMBREE names no library. Ours alone:\n");
    }
    println!("| scene | triangles | rays | ours Mrays/s | Embree | ratio | robust Embree | ratio |");
    println!("| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: |");
    let mut builds = Vec::new();
    for setting in settings {
        let start = Instant::now();
        let world = World::opaque(setting.triangles.clone());
        builds.push((setting.name.clone(), start.elapsed().as_secs_f64(), world.bytes() / world.len()));
        let rivals: Vec<Embree> = library
            .iter()
            .flat_map(|path| [false, true].map(|robust| Embree::new(path, &setting.triangles, robust)))
            .collect();
        for kind in RayKind::ALL {
            compare(&setting, &world, &rivals, kind);
        }
    }
    println!("\n| scene | build s | bytes a triangle |\n| --- | ---: | ---: |");
    for (name, seconds, bytes) in builds {
        println!("| {name} | {seconds:.3} | {bytes} |");
    }
}

fn compare(setting: &Setting, world: &World, rivals: &[Embree], kind: RayKind) {
    let rays = setting.rays(world, kind);
    let tracer = OpaqueTracer::new(world);
    let ours = || match kind {
        RayKind::Shadow => rays.iter().filter(|ray| tracer.occluded(ray)).count() as f64,
        _ => rays.iter().filter_map(|ray| tracer.closest(ray)).map(|hit| f64::from(hit.t)).sum(),
    };
    let mut best = vec![f64::INFINITY; 1 + rivals.len()];
    let mut sums = vec![0.0; 1 + rivals.len()];
    for _ in 0..TURNS {
        (sums[0], best[0]) = timed(best[0], ours);
        for (k, rival) in rivals.iter().enumerate() {
            let theirs = || match kind {
                RayKind::Shadow => rival.count_occluded(&rays),
                _ => rival.sum_distances(&rays),
            };
            (sums[1 + k], best[1 + k]) = timed(best[1 + k], theirs);
        }
    }
    let rate = |seconds: f64| rays.len() as f64 / seconds / 1e6;
    let mut row = format!("| {} | {} | {} | {:.2} |", setting.name, world.len(), kind.name(), rate(best[0]));
    for k in 1..best.len() {
        row += &format!(" {:.2} | {:.2} |", rate(best[k]), best[k] / best[0]);
        let difference = (sums[0] - sums[k]).abs() / sums[0].abs().max(1.0);
        if difference > 1e-3 {
            row += &format!(" sums differ by {difference:.1e}");
        }
    }
    println!("{row}");
}

/// The result and the lesser of `best` and the seconds of this thread that `work` took.
fn timed(best: f64, work: impl Fn() -> f64) -> (f64, f64) {
    let start = thread_seconds();
    let result = black_box(work());
    (result, best.min(thread_seconds() - start))
}

/// Time this thread has run; it stands still while other programs have the processor.
#[cfg(target_os = "linux")]
fn thread_seconds() -> f64 {
    unsafe extern "C" {
        fn clock_gettime(clock: i32, time: *mut [i64; 2]) -> i32;
    }
    const THREAD_CPU_TIME: i32 = 3;
    let mut time = [0; 2];
    // SAFETY: a timespec is two 64-bit integers here.
    unsafe { clock_gettime(THREAD_CPU_TIME, &mut time) };
    time[0] as f64 + time[1] as f64 / 1e9
}

#[cfg(not(target_os = "linux"))]
fn thread_seconds() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}
