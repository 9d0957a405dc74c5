//! Meshes that no one would model.

use super::cases::one_page;
use super::meshes::*;
use super::verify::*;
use super::{atlas, page};
use crate::plan::Side;
use crate::scene::Geometry;
use glam::Vec3;

/// Random meshes of every kind of trouble: few vertices and many triangles, so that edges have many sides, sheets pass
/// through each other, normals point anywhere.
fn tangle(seed: u64) -> Geometry {
    let mut next = random(seed);
    let vertices = 3 + (next() * 60.0) as usize;
    let triangles = 1 + (next() * 200.0) as usize;
    let stretch = Vec3::new(1.0, 10f32.powf(-6.0 * next()), 1.0);
    let grid = next() < 0.5;
    let position: Vec<Vec3> = (0..vertices)
        .map(|_| {
            let p = Vec3::new(next(), next(), next());
            (if grid { (p * 4.0).floor() } else { p }) * stretch
        })
        .collect();
    let corner = |x: f32| (x * vertices as f32) as u32;
    let triangles = (0..triangles).map(|_| [corner(next()), corner(next()), corner(next())]).collect();
    smooth("tangle", position, triangles)
}

#[test]
fn tangled_meshes_come_out_whole() {
    for seed in 0..150 {
        let scene = scene(vec![tangle(seed)]);
        let result = atlas(&scene, Side::Dark, &page(256)).unwrap();
        verify(&scene, &result, 2, 1e9);
    }
}

/// A crumpled sheet: connected and smooth, but its normals go everywhere.
#[test]
fn crumpled_sheets_come_out_whole() {
    for (seed, n, rough) in [(1, 20, 0.3), (2, 20, 2.0), (3, 40, 1.0), (4, 60, 0.6), (5, 30, 10.0)] {
        let mut next = random(seed);
        let heights: Vec<f32> = (0..=n * (n + 2)).map(|_| next()).collect();
        let geometry = sheet("crumpled", [n, n], [false, false], |p| {
            let at = (p * n as f32).round();
            let height = heights[(at.y as u32 * (n + 1) + at.x as u32) as usize] * rough / n as f32;
            Vec3::new(p.x, height, -p.y)
        });
        one_page(vec![geometry], 512, 1e-2);
    }
}
