//! Every promise on every kind of mesh.

use super::meshes::*;
use super::verify::*;
use super::{atlas, page};
use crate::error::Error;
use crate::options::AtlasOptions;
use crate::plan::{Side, Sides};
use crate::progress::{Progress, Silent, Stage};
use crate::scene::{Geometry, Scene};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use std::sync::atomic::AtomicBool;

/// Verifies a scene of one node per geometry on one page.
pub(super) fn one_page(geometries: Vec<Geometry>, size: u32, crumb: f64) -> Measured {
    let scene = scene(geometries);
    let result = atlas(&scene, Side::Dark, &page(size)).unwrap();
    assert_eq!(result.pages.len(), 1);
    verify(&scene, &result, 2, crumb)
}

/// Rounding a side of n texels to whole ones changes it by half a texel at most; `smallest` is the shortest side.
fn rounding(smallest: f64) -> [f64; 2] {
    [1.0 - 0.5 / smallest, 1.0 + 0.5 / smallest]
}

#[test]
fn a_cube_has_six_square_charts() {
    let scene = scene(vec![cube()]);
    let result = atlas(&scene, Side::Dark, &page(256)).unwrap();
    let measured = verify(&scene, &result, 2, 0.0);
    assert_eq!(measured.charts, 6);
    let [low, high] = rounding(80.0);
    assert!(measured.stretch[0] > low && measured.stretch[1] < high, "{measured:?}");
    assert!(result.warnings.is_empty(), "{:?}", result.warnings);
    // Nothing had to be split, and every corner lies on a texel centre.
    let placement = result.fronts[0].as_ref().unwrap();
    assert_eq!(placement.unwrap.source_vertex.len(), 36);
    assert!(placement.uv_texels.iter().all(|uv| uv.fract() == glam::Vec2::splat(0.5)));
}

#[test]
fn a_small_sphere_is_xatlas_work_and_even() {
    let scene = scene(vec![ico_sphere(2, 1.0)]);
    let result = atlas(&scene, Side::Dark, &page(512)).unwrap();
    assert!(result.warnings.is_empty(), "{:?}", result.warnings);
    let measured = verify(&scene, &result, 2, 0.0);
    assert!((2..=16).contains(&measured.charts), "{measured:?}");
    assert!(measured.stretch[0] > 0.6 && measured.stretch[1] < 1.6, "{measured:?}");
    assert!((measured.mean_density - 1.0).abs() < 0.02, "{measured:?}");
}

#[test]
fn smooth_meshes_of_every_size_keep_their_density() {
    // 5,120 triangles: uvunwrap; 81,920: cones.
    for (geometry, bounds, most) in [
        (ico_sphere(4, 3.0), [0.6, 1.6], 24),
        (torus(60, 24), [0.6, 1.6], 40),
        (ico_sphere(6, 0.2), [0.5, 1.6], 40),
        (terrain(60), [0.25, 4.0], 120),
        (terrain(180), [0.25, 4.0], 400),
    ] {
        let name = format!("{} of {}", geometry.name, geometry.triangles.len());
        let measured = one_page(vec![geometry], 1024, 1e-3);
        assert!(measured.charts <= most, "{name}: {measured:?}");
        assert!(measured.stretch[0] > bounds[0] && measured.stretch[1] < bounds[1], "{name}: {measured:?}");
        assert!((measured.mean_density - 1.0).abs() < 0.05 && measured.even > 0.9, "{name}: {measured:?}");
    }
}

#[test]
fn hard_edges_end_charts_and_smooth_ones_do_not() {
    let bent = |angle: f32| {
        let down = Vec3::new(angle.cos(), 0.0, -angle.sin());
        let mut corners = quad(Vec3::ZERO, Vec3::Y, Vec3::NEG_X).to_vec();
        corners.extend(quad(Vec3::ZERO, down, Vec3::Y));
        flat("bent", &corners)
    };
    let charts = |geometry: Geometry| one_page(vec![geometry], 128, 0.0).charts;
    assert_eq!(charts(bent(0.2)), 1);
    assert_eq!(charts(bent(1.2)), 2);
}

#[test]
fn many_boxes_and_loose_triangles() {
    let measured = one_page(vec![boxes(300)], 512, 0.0);
    assert_eq!(measured.charts, 1800);
    let measured = one_page(vec![soup(2000)], 512, 1e-3);
    assert_eq!(measured.charts, 2000);
}

#[test]
fn broken_meshes_come_out_whole() {
    let point = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let square = quad(Vec3::ZERO, Vec3::X, Vec3::Y).to_vec();
    let doubled = smooth(
        "doubled",
        vec![Vec3::ZERO, Vec3::X, point(1.0, 1.0, 0.0), Vec3::Y],
        vec![[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]],
    );
    let folded: Vec<[Vec3; 3]> =
        square.iter().copied().chain(square.iter().map(|&[a, b, c]| [a, c, b])).collect();
    // Three leaves on one edge.
    let leaves: Vec<[Vec3; 3]> = (0..3)
        .map(|k| {
            [Vec3::ZERO, Vec3::Y, {
                let d = glam::Vec2::from_angle(2.0 * k as f32);
                Vec3::new(d.x, 0.0, d.y)
            }]
        })
        .collect();
    // A flat spiral stair seen from above, more than one turn.
    let step = |k: i32| glam::Vec2::from_angle(0.4 * k as f32).extend(0.0);
    let spiral: Vec<[Vec3; 3]> = (0..40).map(|k| [Vec3::ZERO, step(k), step(k + 1)]).collect();
    let mut zero_area = cube();
    zero_area.triangles.extend([[0, 0, 1], [3, 3, 3], [0, 1, 0]]);
    let colinear = flat("line", &[[Vec3::ZERO, Vec3::X, Vec3::X * 2.0], [Vec3::ZERO, Vec3::X, Vec3::Y]]);
    let with_nan = moved(cube(), |p| if p == Vec3::ONE { Vec3::NAN } else { p });
    let mut wild = cube();
    wild.triangles[3] = [0, 1, 4_000_000];
    wild.normal_local.truncate(5);
    for (geometry, size) in [
        (doubled, 128),
        (flat("folded", &folded), 128),
        (flat("leaves", &leaves), 128),
        (smooth_of("spiral", &spiral), 256),
        (zero_area, 128),
        (colinear, 64),
        (with_nan, 128),
    ] {
        let measured = one_page(vec![geometry], size, 1e-3);
        assert!(measured.charts > 0);
    }
    // An index out of range cannot be written back, but must not harm anything.
    let mut out_of_range = scene(vec![cube()]);
    out_of_range.geometries[0] = wild;
    atlas(&out_of_range, Side::Dark, &page(128)).unwrap();
}

/// The triangles with their vertices merged.
fn smooth_of(name: &str, corners: &[[Vec3; 3]]) -> Geometry {
    let mut position: Vec<Vec3> = Vec::new();
    let mut index = |p: Vec3| {
        position.iter().position(|&q| q == p).unwrap_or_else(|| {
            position.push(p);
            position.len() - 1
        }) as u32
    };
    let triangles = corners.iter().map(|t| t.map(&mut index)).collect();
    smooth(name, position, triangles)
}

#[test]
fn nothing_to_unwrap_is_no_error() {
    let lone_vertex = smooth("vertex", vec![Vec3::ONE], vec![]);
    let all_degenerate = smooth("degenerate", vec![Vec3::ONE, Vec3::X], vec![[0, 1, 0], [1, 1, 1]]);
    let none = Geometry::default();
    let scene = scene(vec![lone_vertex, all_degenerate, none, cube()]);
    let result = atlas(&scene, Side::Hidden, &page(128)).unwrap();
    assert!(result.fronts[..3].iter().all(Option::is_none));
    assert!(result.warnings.iter().any(|w| w.at == "degenerate"), "{:?}", result.warnings);
    verify(&scene, &result, 2, 0.0);
    let empty = atlas(&Scene::default(), Side::Dark, &page(128)).unwrap();
    assert!(empty.pages.is_empty());
}

#[test]
fn slivers_keep_at_least_a_texel() {
    // A million to one.
    let sliver = flat("sliver", &[[Vec3::ZERO, Vec3::X * 1000.0, Vec3::new(0.0, 1e-3, 0.0)]]);
    let scene = scene(vec![sliver, cube()]);
    let options = AtlasOptions { density: Some(20.0), ..page(256) };
    let result = atlas(&scene, Side::Dark, &options).unwrap();
    verify(&scene, &result, 2, 1e9);
    let uv = &result.fronts[0].as_ref().unwrap().uv_texels;
    let low = uv.iter().fold(glam::Vec2::INFINITY, |m, &p| m.min(p));
    let high = uv.iter().fold(glam::Vec2::ZERO, |m, &p| m.max(p));
    assert!((high - low).min_element() >= 1.0 && (high - low).max_element() <= 255.0);
    assert!(result.warnings.iter().any(|w| w.at.starts_with("sliver")), "{:?}", result.warnings);
}

#[test]
fn the_density_of_next_to_nothing_is_a_number() {
    // Found by fuzzing: 1e-41 m are too small for any texels per metre that an f32 holds.
    for size in [1e-43, 1e-41, 1e-38, 1e-30] {
        let speck = flat("speck", &[[Vec3::ZERO, Vec3::X * size, Vec3::Z * size * 100.0]]);
        let result = atlas(&scene(vec![speck]), Side::Dark, &page(64)).unwrap();
        assert!(result.density.is_finite() && result.density > 0.0, "{size}: {}", result.density);
    }
}

#[test]
fn size_and_place_of_a_mesh_change_nothing() {
    let charts = |geometry: Geometry| one_page(vec![geometry], 512, 1e-3).charts;
    let expected = charts(ico_sphere(2, 1.0));
    assert_eq!(charts(ico_sphere(2, 1e-6)), expected);
    assert_eq!(charts(ico_sphere(2, 1e6)), expected);
    // Far away the sphere itself gets coarse (1/16 m steps): still sound.
    one_page(vec![moved(ico_sphere(2, 50.0), |p| p + Vec3::splat(1e6))], 512, 1e-3);
}

#[test]
fn density_follows_the_world_under_any_scale() {
    let mut scene = scene(vec![cube(), ico_sphere(2, 0.5)]);
    scene.surfaces.clear();
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    for scale in [
        DVec3::ONE,
        DVec3::splat(2.0),
        DVec3::new(1.0, 3.0, 0.5),
        DVec3::new(-1.0, 1.0, 1.0),
        DVec3::new(-2.0, 1.0, 4.0),
    ] {
        for g in 0..2 {
            let placed =
                surface(&scene, g, DAffine3::from_scale_rotation_translation(scale, turn, DVec3::ONE));
            scene.surfaces.push(placed);
        }
    }
    // A shear: no axis of the mesh is an axis of the stretch.
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1.5, 1.0, 0.0), DVec3::Z);
    scene.surfaces.push(surface(&scene, 0, DAffine3::from_mat3(shear)));
    scene.surfaces[0].density_factor = 2.0;
    let options = AtlasOptions { density: Some(40.0), ..page(1024) };
    let result = atlas(&scene, Side::Dark, &options).unwrap();
    let boxes_only = Scene {
        surfaces: scene.surfaces.iter().filter(|s| s.geometry.0 == 0).cloned().collect(),
        ..scene.clone()
    };
    let fronts =
        scene.surfaces.iter().zip(&result.fronts).filter(|(s, _)| s.geometry.0 == 0).map(|(_, f)| f.clone());
    let only = super::Atlas {
        fronts: fronts.collect(),
        backs: vec![None; boxes_only.surfaces.len()],
        ..result.clone()
    };
    let measured = verify(&scene, &result, 2, 0.0);
    // A chart that bends gets the mean of the scales its parts see.
    assert!(measured.stretch[0] > 0.4 && measured.stretch[1] < 2.5 && measured.even > 0.95, "{measured:?}");
    // Planes are exact but for the rounding to whole texels: the shortest side has 20.
    let exact = verify_without_fill(&boxes_only, only);
    let [low, high] = rounding(20.0);
    assert!(exact.stretch[0] >= low - 1e-3 && exact.stretch[1] <= high + 1e-3, "{exact:?}");
}

/// Like [`verify`] for a part of an atlas, whose fill is not the whole's.
fn verify_without_fill(scene: &Scene, mut atlas: super::Atlas) -> Measured {
    atlas.pages.iter_mut().for_each(|page| page.exported = true);
    atlas.fill = {
        let texels: f64 = atlas.pages.iter().map(|page| f64::from(page.size_texels).powi(2)).sum();
        (touched(scene, &atlas) as f64 / texels) as f32
    };
    verify(scene, &atlas, 2, 0.0)
}

#[test]
fn instances_share_one_unwrap_and_nodes_stay_on_a_page() {
    let mut scene = scene(vec![cube(), ico_sphere(1, 1.0)]);
    scene.surfaces.clear();
    for node in 0..12 {
        for g in 0..2 {
            let at = DAffine3::from_translation(DVec3::X * 4.0 * node as f64);
            let mut placed = surface(&scene, g, at);
            placed.origin.node = node;
            placed.origin.name = format!("pair {node}");
            scene.surfaces.push(placed);
        }
    }
    let options = AtlasOptions { density: Some(30.0), ..page(256) };
    let result = atlas(&scene, Side::Hidden, &options).unwrap();
    verify(&scene, &result, 2, 0.0);
    let written = result.pages.iter().filter(|page| page.exported).count();
    assert!(written > 1, "{:?}", result.pages);
    assert!(result.pages[..written].iter().all(|page| page.exported));
    let first = &result.fronts[0].as_ref().unwrap().unwrap;
    for s in (0..24).step_by(2) {
        assert!(std::sync::Arc::ptr_eq(first, &result.fronts[s].as_ref().unwrap().unwrap));
        assert!(std::sync::Arc::ptr_eq(first, &result.backs[s].as_ref().unwrap().unwrap));
    }
}

#[test]
fn what_does_not_fit_is_told_by_name() {
    let large = moved(cube(), |p| p * 30.0);
    let scene = scene(vec![cube(), large]);
    let options = AtlasOptions { density: Some(30.0), max_pages: 4, ..page(256) };
    let result = atlas(&scene, Side::Dark, &options).unwrap();
    let warning = result.warnings.iter().find(|w| w.at == "cube 1").expect("the large node is named");
    assert!(warning.what.contains("too large for a page"), "{warning:?}");
    // The small one keeps its density.
    assert_eq!(result.density, 30.0);

    let many: Vec<Geometry> = (0..40).map(|_| cube()).collect();
    let scene = super::verify::scene(many);
    let options = AtlasOptions { density: Some(60.0), max_pages: 2, ..page(256) };
    let result = atlas(&scene, Side::Dark, &options).unwrap();
    assert!(result.density < 60.0 && result.pages.len() == 2);
    assert!(result.warnings.iter().any(|w| w.what.contains("does not fit 2 pages")), "{:?}", result.warnings);
    let measured = verify(&scene, &result, 2, 0.0);
    assert_eq!(measured.charts, 240);
}

#[test]
fn more_charts_than_a_page_can_hold_make_it_larger() {
    let scene = scene(vec![soup(3000)]);
    let result = atlas(&scene, Side::Dark, &page(128)).unwrap();
    assert_eq!(result.pages.len(), 1);
    assert_eq!(result.pages[0].size_texels, 256);
    assert!(
        result.warnings.iter().any(|w| w.what.contains("pages of 256² are made")),
        "{:?}",
        result.warnings
    );
    verify(&scene, &result, 2, 1e9);
}

#[test]
fn hidden_sides_get_a_quarter_of_the_density_on_pages_of_their_own() {
    let scene = scene(vec![cube(), ico_sphere(2, 1.0)]);
    let result = atlas(&scene, Side::Hidden, &page(512)).unwrap();
    assert_eq!(result.pages.len(), 2);
    assert!(result.pages[0].exported && !result.pages[1].exported);
    assert!(result.pages[1].size_texels <= 176, "{:?}", result.pages);
    let measured = verify(&scene, &result, 2, 0.0);
    assert!(measured.stretch[0] > 0.5 && measured.stretch[1] < 1.7, "{measured:?}");
    // Only hidden ones.
    let sides = vec![Sides { front: Side::Hidden, back: Side::Dark }; 2];
    let cancel = AtomicBool::new(false);
    let progress = Progress::begin(&Silent, &cancel, Stage::Atlas, 2);
    let result = super::unwrap(&scene, &sides, &page(512), &progress).unwrap();
    assert!(result.pages.iter().all(|page| !page.exported) && result.fronts.iter().all(Option::is_some));
}

#[test]
fn the_same_on_any_number_of_threads() {
    let scene =
        scene(vec![ico_sphere(4, 1.0), terrain(30), boxes(50), soup(200), torus(20, 10), terrain(170)]);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        fingerprint(&pool.install(|| atlas(&scene, Side::Hidden, &page(512)).unwrap()))
    };
    let one = on(1);
    assert!(one == on(2), "2 threads differ");
    assert!(one == on(3), "3 threads differ");
    assert!(one == on(1), "a second run differs");
}

#[test]
fn cancelling_and_bad_options_are_errors() {
    let scene = scene(vec![ico_sphere(4, 1.0)]);
    let sides = vec![Sides { front: Side::Lightmapped, back: Side::Dark }];
    let cancel = AtomicBool::new(true);
    let progress = Progress::begin(&Silent, &cancel, Stage::Atlas, 1);
    assert!(matches!(super::unwrap(&scene, &sides, &page(256), &progress), Err(Error::Cancelled)));
    for options in [
        AtlasOptions { page_size: 0, ..AtlasOptions::default() },
        AtlasOptions { density: Some(f32::NAN), ..AtlasOptions::default() },
        AtlasOptions { density: Some(-1.0), ..AtlasOptions::default() },
        AtlasOptions { gutter: 4000, ..AtlasOptions::default() },
    ] {
        assert!(matches!(atlas(&scene, Side::Dark, &options), Err(Error::Invalid { .. })), "{options:?}");
    }
}

#[test]
fn any_gutter_is_kept() {
    for gutter in [0, 1, 5] {
        let scene = scene(vec![boxes(20), ico_sphere(2, 1.0), torus(24, 12)]);
        let options = AtlasOptions { gutter, ..page(256) };
        let result = atlas(&scene, Side::Dark, &options).unwrap();
        verify(&scene, &result, gutter, 0.0);
    }
}
