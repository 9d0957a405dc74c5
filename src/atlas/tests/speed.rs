//! Measurements, not checks: `cargo test --release atlas::tests::speed -- --ignored --nocapture`.

use super::meshes::*;
use super::verify::scene;
use super::{atlas, page};
use crate::plan::Side;
use crate::scene::Geometry;
use glam::Vec3;
use std::time::Instant;

fn cornell() -> Vec<Geometry> {
    let wall = |a: Vec3, u: Vec3, v: Vec3| flat("wall", &quad(a, u, v));
    let (x, y, z) = (Vec3::X * 5.5, Vec3::Y * 5.5, Vec3::Z * 5.6);
    vec![
        wall(Vec3::ZERO, x, z),
        wall(y, z, x),
        wall(Vec3::ZERO, y, z),
        wall(x, z, y),
        wall(Vec3::ZERO, x, y),
        wall(Vec3::new(2.0, 5.4, 2.0), Vec3::X * 1.3, Vec3::Z),
        flat("short", &box_triangles(Vec3::new(1.0, 0.0, 1.0), Vec3::splat(1.65))),
        flat("tall", &box_triangles(Vec3::new(3.0, 0.0, 3.0), Vec3::new(1.65, 3.3, 1.65))),
    ]
}

fn time(name: &str, geometries: Vec<Geometry>) {
    let scene = scene(geometries);
    let triangles: usize = scene.geometries.iter().map(|g| g.triangles.len()).sum();
    let mut wanted = vec![true; scene.geometries.len()];
    wanted.fill(true);
    let cancel = std::sync::atomic::AtomicBool::new(false);
    let progress =
        crate::progress::Progress::begin(&crate::progress::Silent, &cancel, crate::progress::Stage::Atlas, 1);
    let begin = Instant::now();
    super::super::charting::charts(&scene.geometries, &wanted, &progress, &mut Vec::new()).unwrap();
    let charts = begin.elapsed();
    let begin = Instant::now();
    let result = atlas(&scene, Side::Dark, &page(1024)).unwrap();
    let seconds = begin.elapsed();
    let count: u32 = result.fronts.iter().flatten().map(|p| p.unwrap.chart_count).sum();
    println!(
        "{name:24} {triangles:8} triangles {count:6} charts  unwrap {charts:9.2?}  all {seconds:9.2?}  fill {:.3}  \
         density {:.2}  pages {}",
        result.fill,
        result.density,
        result.pages.len()
    );
    for warning in result.warnings.iter().take(3) {
        println!("    {}: {}", warning.at, warning.what);
    }
}

#[test]
#[ignore = "a measurement"]
fn table() {
    time("warm up", cornell());
    time("cube", vec![cube()]);
    time("cornell", cornell());
    time("sphere 320", vec![ico_sphere(2, 1.0)]);
    time("sphere 1280", vec![ico_sphere(3, 1.0)]);
    time("sphere 20k", vec![ico_sphere(5, 1.0)]);
    time("torus 2k", vec![torus(50, 20)]);
    time("torus 60k", vec![torus(300, 100)]);
    time("terrain 20k", vec![terrain(100)]);
    time("terrain 200k", vec![terrain(316)]);
    time("soup 20k", vec![soup(20_000)]);
    time("boxes 1667", vec![boxes(1667)]);
    time("160 nodes of spheres", (0..160).map(|_| ico_sphere(2, 1.0)).collect());
    time("300 single boxes", (0..300).map(|i| moved_box(i)).collect());
}

fn moved_box(i: usize) -> Geometry {
    let mut next = random(i as u64 + 3);
    flat("box", &box_triangles(Vec3::ZERO, Vec3::new(0.1 + next(), 0.1 + next(), 0.1 + next())))
}

#[test]
#[ignore = "a measurement"]
fn large() {
    time("boxes 16667", vec![boxes(16_667)]);
    time("terrain 1M", vec![terrain(707)]);
    time("sphere 1.3M", vec![ico_sphere(8, 1.0)]);
}
