//! What pages promise, on small scenes.

use super::*;
use crate::elements::testing::{Piece, Stand, scatter};
use crate::scene::{Material, MaterialId};
use crate::units::Radiance;
use glam::{DAffine3, DVec3, Vec2, Vec4};

const PLAIN: MaterialId = MaterialId(0);

fn light(elements: &Elements, of: impl Fn(usize) -> f32) -> Vec<Irradiance> {
    (0..elements.len()).map(|e| Irradiance(Vec3::new(1.0, 0.5, 2.0) * of(e))).collect()
}

fn run(stand: &Stand, elements: &Elements, irradiance: &[Irradiance]) -> Lightmap {
    resolve(&stand.scene, elements, &stand.atlas, irradiance, Store::Irradiance)
}

/// What a viewer's bilinear lookup reads.
fn lookup(page: &LightmapPage, p: Vec2) -> Vec3 {
    let (corner, last) = ((p - 0.5).floor(), page.size_texels as f32 - 1.0);
    let f = p - 0.5 - corner;
    let at = |x: f32, y: f32| {
        page.value[y.clamp(0.0, last) as usize * page.size_texels as usize + x.clamp(0.0, last) as usize]
    };
    let row = |y: f32| at(corner.x, y).lerp(at(corner.x + 1.0, y), f.x);
    row(corner.y).lerp(row(corner.y + 1.0), f.y)
}

/// A few boxes and a slanted triangle on one page, with wide gaps.
fn scattered() -> Stand {
    let mut stand = Stand::new(128);
    let cube = Piece::closed_box(Vec3::ZERO, Vec3::ONE, Vec2::new(4.3, 5.2), 18.0, 0.1);
    stand.add(cube, DAffine3::IDENTITY, PLAIN);
    let mut slanted =
        Piece::rectangle(Vec3::ZERO, Vec3::X * 3.0, Vec3::Z * 3.0, 5, Vec2::new(40.0, 60.0), 0.1);
    slanted.uv_texels.iter_mut().for_each(|p| *p = Vec2::new(p.x + 0.4 * p.y - 20.0, p.y - 0.3 * p.x + 12.0));
    slanted.triangles.retain(|t| t.iter().sum::<u32>() % 4 != 0);
    slanted.chart.truncate(slanted.triangles.len());
    stand.add(slanted, DAffine3::from_translation(DVec3::new(5.0, 0.0, 0.0)), PLAIN);
    stand
}

#[test]
fn constant_light_is_constant_everywhere_in_the_stored_unit() {
    let stand = scattered();
    let elements = stand.elements();
    let irradiance = light(&elements, |_| 3.0);
    let stored = |store| resolve(&stand.scene, &elements, &stand.atlas, &irradiance, store);
    let expect = |lightmap: &Lightmap, value: Vec3| {
        let page = &lightmap.pages[0];
        assert!(page.value.iter().all(|v| (*v - value).abs().max_element() < 1e-5 * value.max_element()));
        assert_eq!(page.covered.iter().filter(|&&c| c).count(), elements.len());
    };
    let e = Vec3::new(3.0, 1.5, 6.0);
    expect(&stored(Store::Irradiance), e);
    expect(&stored(Store::IrradianceOverPi), e / PI);
    expect(&stored(Store::Radiosity), e * Reflectance::MAX);
}

#[test]
fn radiosity_adds_what_is_emitted() {
    let mut stand = Stand::new(64);
    let glow = Material {
        base_color: Vec4::new(0.5, 0.25, 0.125, 1.0),
        emission: Radiance(Vec3::new(2.0, 0.0, 1.0)),
        ..Material::default()
    };
    let glow = stand.material(glow);
    let panel = Piece::rectangle(Vec3::ZERO, Vec3::X, Vec3::Z, 1, Vec2::splat(6.5), 0.05);
    stand.add(panel, DAffine3::IDENTITY, glow);
    let elements = stand.elements();
    let irradiance = light(&elements, |_| 4.0);
    let lightmap = resolve(&stand.scene, &elements, &stand.atlas, &irradiance, Store::Radiosity);
    let expected = Vec3::new(0.5 * 4.0 + 2.0 * PI, 0.25 * 2.0, 0.125 * 8.0 + PI);
    assert!(lightmap.pages[0].value.iter().all(|v| (*v - expected).abs().max_element() < 1e-5));
}

#[test]
fn no_lookup_and_no_mip_reads_black_or_beyond_the_charts_range() {
    let stand = scattered();
    let elements = stand.elements();
    let noise: Vec<f32> = scatter(3).take(elements.len()).map(|x| 1.0 + x).collect();
    let irradiance = light(&elements, |e| noise[e]);
    // The noise is between 1 and 2; of all there is only means of it, but for the seam inside the slanted piece.
    let page = &run(&stand, &elements, &irradiance).pages[0];
    for v in &page.value {
        assert!(v.is_finite() && v.x > 0.9 && v.x < 2.1, "{v}");
        assert!((v.y - 0.5 * v.x).abs() < 1e-4 && (v.z - 2.0 * v.x).abs() < 1e-4);
    }
    // Near a chart the gutter holds that chart's light.
    let elements = stand.elements();
    let dim =
        |e: usize| if elements.charts[elements.chart[e] as usize].surface == 0 { 0.001 } else { 1000.0 };
    let page = &run(&stand, &elements, &light(&elements, dim)).pages[0];
    for (texel, v) in page.value.iter().enumerate() {
        let (x, y) = (texel as i32 % 128, texel as i32 / 128);
        let near = |dx: i32, dy: i32| {
            let (i, j) = (x + dx, y + dy);
            let inside = (0..128).contains(&i) && (0..128).contains(&j);
            inside.then(|| elements.pages[0].element[(j * 128 + i) as usize]).filter(|&e| e != NO_ELEMENT)
        };
        let own = (-2..=2).flat_map(|dy| (-2..=2).filter_map(move |dx| near(dx, dy))).next();
        if let Some(e) = own {
            assert!((v.x / dim(e as usize) - 1.0).abs() < 1e-3, "{x} {y} {v}");
        }
    }
}

#[test]
fn buried_elements_take_the_light_beside_them_and_are_dark_further_in() {
    let mut stand = Stand::new(64);
    let floor = Piece::rectangle(Vec3::ZERO, Vec3::X * 2.0, Vec3::Z * 2.0, 1, Vec2::new(8.0, 8.0), 0.05);
    stand.add(floor, DAffine3::IDENTITY, PLAIN);
    let mut elements = stand.elements();
    // A wall five texels wide stands on it: bright on the left, dim on the right. And a broken value.
    let column = |elements: &Elements, e: usize| elements.texel[e].x - 8;
    for e in 0..elements.len() {
        elements.valid[e] = !(18..23).contains(&column(&elements, e));
    }
    let mut irradiance = light(&elements, |e| match column(&elements, e) {
        0..18 => 100.0,
        18..23 => 0.0,
        _ => 1.0,
    });
    irradiance[10] = Irradiance::grey(f32::NAN);
    irradiance[11] = Irradiance::grey(f32::INFINITY);
    irradiance[12] = Irradiance::grey(-5.0);
    let page = &run(&stand, &elements, &irradiance).pages[0];
    for (e, texel) in elements.texel.iter().enumerate().filter(|(e, _)| *e != 12) {
        let v = page.value[texel.y as usize * 64 + texel.x as usize].x;
        let expected = match column(&elements, e) {
            0..19 => 90.0..100.1,
            19..22 => -0.1..0.1,
            _ => 0.9..1.1,
        };
        // Beside the texel that was clamped to black the mean of the broken ones is lower.
        assert!(expected.contains(&v) || (10..12).contains(&e), "{e} {v}");
    }
    assert!(page.value.iter().all(|v| v.is_finite() && v.min_element() >= 0.0));
}

#[test]
fn a_chart_that_is_wholly_buried_is_dark() {
    let mut stand = Stand::new(64);
    let two = Piece::rectangle(Vec3::ZERO, Vec3::X, Vec3::Z, 1, Vec2::new(4.0, 4.0), 0.05);
    let other = Piece::rectangle(Vec3::Y * 9.0, Vec3::X, Vec3::Z, 1, Vec2::new(34.0, 4.0), 0.05);
    stand.add(two.and(other), DAffine3::IDENTITY, PLAIN);
    let mut elements = stand.elements();
    let second = elements.charts[1].elements.clone();
    elements.valid[second.start as usize..second.end as usize].fill(false);
    let page = &run(&stand, &elements, &light(&elements, |_| 7.0)).pages[0];
    for (texel, &e) in elements.pages[0].element.iter().enumerate().filter(|(_, e)| **e != NO_ELEMENT) {
        let expected = if second.contains(&e) { 0.0 } else { 7.0 };
        assert!((page.value[texel].x - expected).abs() < 1e-4);
    }
}

/// A strip of 4 m by 2 m bent by `angle` at its middle, each half a chart of its own on another grid.
fn strip(angle: f32) -> Piece {
    let left = Piece::rectangle(Vec3::ZERO, Vec3::Z * 2.0, Vec3::X * 2.0, 1, Vec2::new(5.3, 6.1), 0.05);
    let along = Vec3::new(angle.cos(), angle.sin(), 0.0) * 2.0;
    let mut right = Piece::rectangle(Vec3::X * 2.0, Vec3::Z * 2.0, along, 1, Vec2::ZERO, 0.05);
    let turn = Vec2::from_angle(0.7);
    right.uv_texels.iter_mut().for_each(|p| *p = turn.rotate(*p * 0.9) + Vec2::new(90.0, 8.0));
    left.and(right)
}

/// Root mean square difference of lookups on both sides of the strip's fold.
fn along_fold(piece: &Piece, page: &LightmapPage) -> f64 {
    let on_page = |p: Vec3, chart: u32| {
        let (vertices, _): (Vec<_>, Vec<_>) = piece
            .triangles
            .iter()
            .zip(&piece.chart)
            .filter(|(_, c)| **c == chart)
            .flat_map(|(t, _)| t.map(|v| (v as usize, ())))
            .unzip();
        let end = vertices.into_iter().find(|&v| piece.position[v].distance(p) < 1e-6).unwrap();
        piece.uv_texels[end]
    };
    let ends = |chart| [Vec3::X * 2.0, Vec3::new(2.0, 0.0, 2.0)].map(|p| on_page(p, chart));
    let ([a, b], [c, d]) = (ends(0), ends(1));
    let squares = (0..997).map(|k| {
        let t = (k as f32 + 0.5) / 997.0;
        f64::from((lookup(page, a.lerp(b, t)) - lookup(page, c.lerp(d, t))).x).powi(2)
    });
    (squares.sum::<f64>() / 997.0).sqrt()
}

/// Smooth light with a ripple that both grids sample differently.
fn ripple(p: Vec3) -> f32 {
    10.0 + 3.0 * (9.0 * p.z + 4.0 * p.x).sin() + 2.0 * p.x
}

#[test]
fn a_smooth_seam_closes_and_the_interior_hardly_moves() {
    let piece = strip(0.0);
    let mut stand = Stand::new(192);
    stand.add(piece.clone(), DAffine3::IDENTITY, PLAIN);
    let elements = stand.elements();
    let irradiance = light(&elements, |e| ripple(elements.position_world[e]));
    let stitched = &run(&stand, &elements, &irradiance).pages[0];
    // The same pages, each half its own object.
    let mut apart = Stand::new(192);
    let half = |chart: u32| {
        let mut half = piece.clone();
        let keep: Vec<bool> = half.chart.iter().map(|&c| c == chart).collect();
        let mut i = 0;
        half.triangles.retain(|_| {
            i += 1;
            keep[i - 1]
        });
        half.chart = vec![0; half.triangles.len()];
        half
    };
    apart.add(half(0), DAffine3::IDENTITY, PLAIN);
    apart.add(half(1), DAffine3::IDENTITY, PLAIN);
    let plain = &run(&apart, &elements, &irradiance).pages[0];
    let (before, after) = (along_fold(&piece, plain), along_fold(&piece, stitched));
    assert!(before > 0.05 && after < 0.1 * before, "{before} {after}");
    let mut touched = 0;
    for (e, texel) in elements.texel.iter().enumerate() {
        let i = texel.y as usize * 192 + texel.x as usize;
        let change = (stitched.value[i] - plain.value[i]).abs().max_element();
        let distance_m = (elements.position_world[e].x - 2.0).abs();
        if distance_m > 0.125 {
            assert_eq!(change, 0.0, "{distance_m}");
        }
        touched += usize::from(change > 0.0);
        assert!(change < 6.0 * before as f32, "{change}");
    }
    assert!(touched > 40);
}

#[test]
fn a_crease_and_a_wall_on_the_seam_are_not_blurred() {
    // Folded by 90°: the light may jump. Flat, but 100 times brighter on one side: a wall stands there.
    for (angle, contrast) in [(1.57, 1.5), (0.0, 100.0)] {
        let mut stand = Stand::new(192);
        stand.add(strip(angle), DAffine3::IDENTITY, PLAIN);
        let elements = stand.elements();
        let irradiance = light(&elements, |e| if elements.chart[e] == 0 { 1.0 } else { contrast });
        let page = &run(&stand, &elements, &irradiance).pages[0];
        for (e, texel) in elements.texel.iter().enumerate() {
            let v = page.value[texel.y as usize * 192 + texel.x as usize];
            assert!((v - irradiance[e].0).abs().max_element() < 1e-4, "{angle} {v}");
        }
    }
}

#[test]
fn a_chart_closes_on_itself_and_materials_share_a_seam() {
    // A tube of 24 facets, unrolled into one chart: its two ends are one edge.
    let mut tube = Piece::default();
    for i in 0..=24 {
        let angle = std::f32::consts::TAU * (i % 24) as f32 / 24.0;
        let out = Vec3::new(angle.cos(), 0.0, angle.sin());
        for y in 0..2 {
            tube.position.push(out + Vec3::Y * y as f32);
            tube.normal.push(out);
            tube.uv_texels.push(Vec2::new(5.4 + 4.9 * i as f32, 6.7 + 20.0 * y as f32));
        }
    }
    for i in 0..24 {
        let k = 2 * i;
        tube.triangles.extend([[k, k + 1, k + 2], [k + 2, k + 1, k + 3]]);
    }
    tube.chart = vec![0; 48];
    let mut stand = Stand::new(160);
    stand.add(tube, DAffine3::IDENTITY, PLAIN);
    assert_eq!(seams::seams(&stand.scene, &stand.atlas).len(), 1);

    // The strip's halves as two materials of one node, on two pages.
    let piece = strip(0.0);
    let mut stand = Stand::new(192);
    let part = |chart: u32| {
        let mut part = piece.clone();
        let triangles = piece.triangles.iter().zip(&piece.chart).filter(|(_, c)| **c == chart);
        part.triangles = triangles.map(|(t, _)| *t).collect();
        part.chart = vec![0; part.triangles.len()];
        part
    };
    stand.add(part(0), DAffine3::IDENTITY, PLAIN);
    stand.add(part(1), DAffine3::IDENTITY, PLAIN);
    assert_eq!(seams::seams(&stand.scene, &stand.atlas).len(), 0);
    stand.scene.surfaces[1].origin.node = 0;
    stand.page(192, true);
    stand.atlas.fronts[1].as_mut().unwrap().page = 1;
    let found = seams::seams(&stand.scene, &stand.atlas);
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].map(|border| border.page), [0, 1]);

    let elements = stand.elements();
    let irradiance = light(&elements, |e| ripple(elements.position_world[e]));
    let mut canvases: Vec<Canvas> = (0..2).map(|page| Canvas::new(&elements, &irradiance, page)).collect();
    let covered = |canvas: usize, texel: usize| elements.pages[canvas].element[texel] != NO_ELEMENT;
    let [before, after] = stitch::stitch(&mut canvases, &found, covered);
    assert!(before > 0.05 && after < 0.1 * before, "{before} {after}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let mut stand = scattered();
    stand.add(strip(0.02), DAffine3::from_translation(DVec3::new(0.0, 20.0, 0.0)), PLAIN);
    stand.page(192, true);
    stand.atlas.fronts[2].as_mut().unwrap().page = 1;
    let elements = stand.elements();
    let irradiance = light(&elements, |e| ripple(elements.position_world[e]));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&stand, &elements, &irradiance))
    };
    let one = with(1);
    for threads in [2, 7] {
        assert_eq!(one, with(threads));
    }
}

#[test]
fn hidden_pages_and_an_empty_scene_are_left_out() {
    let mut stand = scattered();
    stand.page(64, false);
    let elements = stand.elements();
    assert_eq!(run(&stand, &elements, &light(&elements, |_| 1.0)).pages.len(), 1);
    let empty = Stand::new(16);
    let elements = empty.elements();
    let page = &run(&empty, &elements, &[]).pages[0];
    assert!(page.value.iter().all(|v| *v == Vec3::ZERO) && !page.covered.iter().any(|&c| c));
}
