//! An independent look at an atlas: rasterises everything and measures every triangle.

use super::super::{Atlas, Placement};
use crate::scene::{Geometry, Origin, Role, Scene, Surface};
use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};
use std::collections::BTreeMap;

/// A surface of geometry `g` under a transform, as its own node.
pub(crate) fn surface(scene: &Scene, geometry: usize, world_from_local: DAffine3) -> Surface {
    let shape = &scene.geometries[geometry];
    let node = scene.surfaces.len();
    Surface {
        origin: Origin { name: format!("{} {node}", shape.name), node, mesh: geometry, ..Origin::default() },
        geometry: crate::scene::GeometryId(geometry as u32),
        material: crate::scene::MaterialId(0),
        world_from_local,
        position_world: shape
            .position_local
            .iter()
            .map(|p| world_from_local.transform_point3(p.as_dvec3()).as_vec3())
            .collect(),
        normal_world: shape.normal_local.clone(),
        mirrored: world_from_local.matrix3.determinant() < 0.0,
        role: Role::Lightmapped,
        density_factor: 1.0,
    }
}

/// A scene with one node per geometry.
pub(crate) fn scene(geometries: Vec<Geometry>) -> Scene {
    let mut scene = Scene { geometries, ..Scene::default() };
    for g in 0..scene.geometries.len() {
        let surface = surface(&scene, g, DAffine3::IDENTITY);
        scene.surfaces.push(surface);
    }
    scene
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Measured {
    pub charts: usize,
    /// Smallest and largest stretch of a triangle along any direction, against the asked density.
    pub stretch: [f64; 2],
    /// Same for the square root of the area.
    pub density: [f64; 2],
    /// Area-weighted mean of the latter.
    pub mean_density: f64,
}

/// Checks every promise of the stage; panics where one is broken. Triangles smaller than `crumb` texels² are not
/// measured (f32 texel coordinates cannot hold them).
pub(crate) fn verify(scene: &Scene, atlas: &Atlas, gutter: u32, crumb: f64) -> Measured {
    let mut pages: Vec<Vec<u32>> =
        atlas.pages.iter().map(|page| vec![0; (page.size_texels * page.size_texels) as usize]).collect();
    let mut samples: Vec<Vec<bool>> = atlas
        .pages
        .iter()
        .map(|page| vec![false; (page.size_texels * page.size_texels * 16) as usize])
        .collect();
    let mut measured = Measured {
        charts: 0,
        stretch: [f64::INFINITY, 0.0],
        density: [f64::INFINITY, 0.0],
        mean_density: 0.0,
    };
    let mut page_of_node: BTreeMap<(usize, Option<usize>), u32> = BTreeMap::new();
    let mut next_chart = 1;
    let mut area_m2 = 0.0;
    for (s, surface) in scene.surfaces.iter().enumerate() {
        for placement in [&atlas.fronts[s], &atlas.backs[s]].into_iter().flatten() {
            let page = atlas.pages[placement.page as usize].clone();
            if page.exported {
                let node = (surface.origin.node, surface.origin.instance);
                assert_eq!(
                    *page_of_node.entry(node).or_insert(placement.page),
                    placement.page,
                    "node on two pages"
                );
            }
            let density = f64::from(atlas.density)
                * f64::from(surface.density_factor)
                * if page.exported { 1.0 } else { 0.25 };
            check_mesh(scene.geometry(surface), placement);
            let size = page.size_texels as i64;
            let unwrap = &placement.unwrap;
            for (t, corners) in unwrap.triangles.iter().enumerate() {
                let uv = corners.map(|i| placement.uv_texels[i as usize].as_dvec2());
                assert!(
                    uv.iter()
                        .all(|p| p.is_finite() && p.min_element() >= 0.0 && p.max_element() <= size as f64)
                );
                let doubled = (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]);
                let world = scene.geometry(surface).triangles[t].map(|i| {
                    let p = scene.geometry(surface).position_local[i as usize].as_dvec3();
                    surface.world_from_local.transform_vector3(p)
                });
                let world_area = (world[1] - world[0]).cross(world[2] - world[0]).length() * 0.5;
                if doubled * 0.5 > crumb {
                    let [low, high] = stretch(world, uv);
                    measured.stretch[0] = measured.stretch[0].min(low / density);
                    measured.stretch[1] = measured.stretch[1].max(high / density);
                    let linear = (doubled * 0.5 / world_area).sqrt() / density;
                    measured.density[0] = measured.density[0].min(linear);
                    measured.density[1] = measured.density[1].max(linear);
                    area_m2 += world_area;
                    measured.mean_density += world_area * linear;
                } else {
                    assert!(doubled > -1e-3, "turned over: triangle {t}, doubled area {doubled}");
                }
                let chart = next_chart + unwrap.chart_of_triangle[t];
                claim(&mut pages[placement.page as usize], size, uv, chart);
                if doubled > 0.0 {
                    sample(&mut samples[placement.page as usize], 4 * size, uv, t);
                }
            }
            next_chart += unwrap.chart_count;
            measured.charts += unwrap.chart_count as usize;
        }
    }
    for (page, texels) in atlas.pages.iter().zip(&pages) {
        keep_apart(page.size_texels as i64, texels, i64::from(gutter));
    }
    let written: Vec<usize> = (0..pages.len()).filter(|&p| atlas.pages[p].exported).collect();
    let touched: usize = written.iter().map(|&p| pages[p].iter().filter(|&&chart| chart != 0).count()).sum();
    let all: usize = written.iter().map(|&p| pages[p].len()).sum();
    if all > 0 {
        let fill = touched as f64 / all as f64;
        assert!((fill - f64::from(atlas.fill)).abs() < 0.02, "fill {fill} is told as {}", atlas.fill);
    }
    measured.mean_density /= area_m2.max(f64::MIN_POSITIVE);
    measured
}

/// The split mesh copies the geometry.
fn check_mesh(geometry: &Geometry, placement: &Placement) {
    let unwrap = &placement.unwrap;
    assert_eq!(unwrap.triangles.len(), geometry.triangles.len());
    assert_eq!(unwrap.chart_of_triangle.len(), geometry.triangles.len());
    assert_eq!(unwrap.source_vertex.len(), placement.uv_texels.len());
    for i in 0..geometry.position_local.len() {
        assert_eq!(unwrap.source_vertex[i], i as u32);
    }
    for (ours, theirs) in unwrap.triangles.iter().zip(&geometry.triangles) {
        assert_eq!(ours.map(|i| unwrap.source_vertex[i as usize]), *theirs);
    }
    assert!(unwrap.chart_of_triangle.iter().all(|&chart| chart < unwrap.chart_count));
    let [low, high] = placement.rect_texels;
    assert!(placement.uv_texels.iter().all(|uv| uv.cmpge(low).all() && uv.cmple(high).all()));
}

/// Texels per metre along the directions of least and most.
fn stretch(world: [DVec3; 3], uv: [DVec2; 3]) -> [f64; 2] {
    // Rows of the map world plane -> texels: an orthonormal frame of the triangle.
    let x = (world[1] - world[0]).normalize();
    let y = (world[2] - world[0]).reject_from(x).normalize();
    let flat = |p: DVec3| DVec2::new((p - world[0]).dot(x), (p - world[0]).dot(y));
    let from = glam::DMat2::from_cols(flat(world[1]), flat(world[2]));
    let to = glam::DMat2::from_cols(uv[1] - uv[0], uv[2] - uv[0]);
    let m = to * from.inverse();
    let mean = 0.5 * (m.x_axis.length_squared() + m.y_axis.length_squared());
    let determinant = m.determinant();
    let apart = (mean * mean - determinant * determinant).max(0.0).sqrt();
    let high = (mean + apart).sqrt();
    [determinant.abs() / high, high]
}

/// Claims every texel that a bilinear lookup on the triangle reads with some weight: whose square of two texels
/// around its centre meets the triangle (separating axes).
fn claim(texels: &mut [u32], size: i64, uv: [DVec2; 3], chart: u32) {
    let low = (uv[0].min(uv[1]).min(uv[2]) - 1.5).floor().as_i64vec2().max(glam::I64Vec2::ZERO);
    let high = (uv[0].max(uv[1]).max(uv[2]) + 1.5).ceil().as_i64vec2().min(glam::I64Vec2::splat(size - 1));
    // Weights below 1/512 are nothing.
    let reach = 1.0 - 1.0 / 512.0;
    for y in low.y..=high.y {
        for x in low.x..=high.x {
            let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let p = uv.map(|corner| corner - centre);
            let apart = |axis: DVec2, radius: f64| {
                let d = p.map(|corner| corner.dot(axis));
                d.iter().all(|&d| d >= radius) || d.iter().all(|&d| d <= -radius)
            };
            let normals = [0, 1, 2].map(|k| (p[(k + 1) % 3] - p[k]).perp());
            if apart(DVec2::X, reach)
                || apart(DVec2::Y, reach)
                || normals.iter().any(|n| *n != DVec2::ZERO && apart(*n, reach * (n.x.abs() + n.y.abs())))
            {
                continue;
            }
            let owner = &mut texels[(y * size + x) as usize];
            assert!(*owner == 0 || *owner == chart, "charts {owner} and {chart} share texel {x}, {y}");
            *owner = chart;
        }
    }
}

/// No sample may lie well inside two triangles.
fn sample(seen: &mut [bool], size: i64, uv: [DVec2; 3], triangle: usize) {
    let p = uv.map(|corner| corner * 4.0 - 0.5);
    let low = p[0].min(p[1]).min(p[2]).ceil().as_i64vec2();
    let high = p[0].max(p[1]).max(p[2]).floor().as_i64vec2();
    for y in low.y..=high.y {
        for x in low.x..=high.x {
            let at = DVec2::new(x as f64, y as f64);
            let inside = (0..3).all(|k| {
                let along = p[(k + 1) % 3] - p[k];
                along.perp_dot(at - p[k]) > 1e-3 * along.length()
            });
            if inside {
                let seen = &mut seen[(y * size + x) as usize];
                assert!(!*seen, "triangle {triangle} lies over another at {}", (at + 0.5) / 4.0);
                *seen = true;
            }
        }
    }
}

/// Different charts have `gutter` empty texels between them.
fn keep_apart(size: i64, texels: &[u32], gutter: i64) {
    let at = |x: i64, y: i64| texels[(y * size + x) as usize];
    for y in 0..size {
        for x in 0..size {
            let chart = at(x, y);
            if chart == 0 {
                continue;
            }
            // Half of the neighbourhood: the other half is seen from the other side.
            for v in y..=(y + gutter).min(size - 1) {
                for u in (x - gutter).max(0)..=(x + gutter).min(size - 1) {
                    let other = at(u, v);
                    assert!(
                        other == 0 || other == chart,
                        "charts {chart} and {other} nearer than {gutter} texels"
                    );
                }
            }
        }
    }
}

/// Bytes of everything that is decided.
pub(crate) fn fingerprint(atlas: &Atlas) -> Vec<u32> {
    let mut words = vec![atlas.density.to_bits(), atlas.fill.to_bits()];
    words.extend(atlas.pages.iter().map(|page| page.size_texels));
    for placement in atlas.fronts.iter().chain(&atlas.backs).flatten() {
        words.push(placement.page);
        words.extend(placement.unwrap.source_vertex.iter().chain(&placement.unwrap.chart_of_triangle));
        words.extend(placement.unwrap.triangles.iter().flatten());
        words.extend(placement.uv_texels.iter().flat_map(|uv: &Vec2| uv.to_array().map(f32::to_bits)));
    }
    words
}

/// Every vertex moved.
pub(crate) fn moved(mut geometry: Geometry, by: impl Fn(Vec3) -> Vec3) -> Geometry {
    geometry.position_local.iter_mut().for_each(|p| *p = by(*p));
    geometry
}
