//! Areas, positions, normals, reflectances.

use crate::elements::testing::{Piece, Stand, scatter};
use crate::elements::{Elements, Lookup, NO_ELEMENT};
use crate::scene::{Filter, MaterialId, Pixels, Texture, TextureId, TextureSlot, Wrap};
use crate::transport::{Hit, World};
use glam::{Affine2, DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};

fn poses() -> Vec<DAffine3> {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0);
    let at = DVec3::new(3.0, -2.0, 7.0);
    let scales =
        [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0), DVec3::new(3.0, -0.2, 0.5), DVec3::new(-2.0, -0.1, -1.0)];
    scales.map(|s| DAffine3::from_scale_rotation_translation(s, turn, at)).into()
}

/// A wavy sheet of smooth triangles, unevenly laid out on the page, with holes: every seventh triangle is missing.
fn sheet() -> Piece {
    let mut sheet = Piece::rectangle(Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 3.0, 12, Vec2::new(3.3, 4.7), 0.05);
    for (p, uv) in sheet.position.iter_mut().zip(&mut sheet.uv_texels) {
        p.z = 0.3 * (p.x * 2.0).sin() + 0.2 * p.y * p.y;
        *uv += Vec2::new(3.0 * (uv.y * 0.1).sin(), 2.0 * (uv.x * 0.15).cos());
    }
    let mut kept = 0;
    sheet.triangles.retain(|_| {
        kept += 1;
        kept % 7 != 0
    });
    sheet.chart.truncate(sheet.triangles.len());
    sheet.normal = sheet.flat_normals();
    sheet
}

fn world_area(stand: &Stand, surface: usize) -> f64 {
    let surface = &stand.scene.surfaces[surface];
    let count = stand.scene.geometry(surface).triangles.len() as u32;
    (0..count)
        .map(|t| {
            let [a, b, c] = stand.scene.corners_world(surface, t).map(|p| p.as_dvec3());
            0.5 * (b - a).cross(c - a).length()
        })
        .sum()
}

#[test]
fn the_areas_of_a_chart_add_up_under_any_pose() {
    for pose in poses() {
        let mut stand = Stand::new(128);
        let sheet = stand.add(sheet(), pose, MaterialId(0));
        let elements = stand.elements();
        let total: f64 = elements.area.iter().map(|a| f64::from(a.0)).sum();
        let expected = world_area(&stand, sheet);
        assert!((total / expected - 1.0).abs() < 1e-6, "{total} {expected}");
        assert_eq!(elements.charts.len(), 1);
    }
}

/// Whether a point of the page is on the chart, and the triangle it is on.
fn on_chart(piece: &Piece, p: Vec2) -> Option<usize> {
    piece.triangles.iter().position(|t| {
        let [a, b, c] = t.map(|i| piece.uv_texels[i as usize].as_dvec2());
        let p = p.as_dvec2();
        let sides = [(b - a).perp_dot(p - a), (c - b).perp_dot(p - b), (a - c).perp_dot(p - c)];
        sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
    })
}

#[test]
fn every_texel_the_chart_touches_is_an_element_and_no_other() {
    let piece = sheet();
    let mut stand = Stand::new(128);
    stand.add(piece.clone(), DAffine3::IDENTITY, MaterialId(0));
    let elements = stand.elements();
    let (mut centres, mut corners) = (0, 0);
    for y in 0..128_u32 {
        for x in 0..128_u32 {
            let element = elements.pages[0].element[(y * 128 + x) as usize];
            let corner = Vec2::new(x as f32, y as f32);
            let grid = (0..64).map(|i| corner + (Vec2::new((i % 8) as f32, (i / 8) as f32) + 0.5) / 8.0);
            let covered = grid.filter(|&p| on_chart(&piece, p).is_some()).count();
            if covered > 0 {
                assert_ne!(element, NO_ELEMENT, "{x} {y}");
            } else if element != NO_ELEMENT {
                // A corner of the chart smaller than the grid of this test.
                corners += 1;
                assert!(elements.area[element as usize].0 < 0.05 * 0.05 * 2.0 / 16.0, "{x} {y}");
            }
            if on_chart(&piece, corner + 0.5).is_some() {
                centres += 1;
                assert_ne!(element, NO_ELEMENT);
            }
        }
    }
    assert!(centres > 3000 && corners < 100, "{centres} {corners}");
    for (i, texel) in elements.texel.iter().enumerate() {
        assert_eq!(elements.pages[0].element[texel.y as usize * 128 + texel.x as usize], i as u32);
    }
    assert!(elements.texel.windows(2).all(|t| (t[0].y, t[0].x) < (t[1].y, t[1].x)));
}

#[test]
fn samples_lie_on_the_chart_at_the_centre_or_pulled_in_from_the_border() {
    let piece = sheet();
    let mut stand = Stand::new(128);
    stand.scene.geometries.clear();
    // Flat shading, so that positions are not lifted.
    stand.add(Piece { normal: vec![], ..piece.clone() }, DAffine3::IDENTITY, MaterialId(0));
    let elements = stand.elements();
    let surface = &stand.scene.surfaces[0];
    let mut pulled = 0;
    for i in 0..elements.len() {
        let [a, b, c] = stand.scene.corners_world(surface, elements.triangle[i]);
        let position = elements.position_world[i];
        let w = weights([a, b, c], position);
        assert!(w.min_element() > -1e-4, "{w}");
        let uv = piece.triangles[elements.triangle[i] as usize].map(|v| piece.uv_texels[v as usize]);
        let p = uv[0] * w.x + uv[1] * w.y + uv[2] * w.z;
        let texel = elements.texel[i];
        let centre = Vec2::new(f32::from(texel.x) + 0.5, f32::from(texel.y) + 0.5);
        assert!((p - centre).abs().max_element() < 0.501, "{p} {centre}");
        let around = (0..8).map(|k| centre + Vec2::from_angle(k as f32 * std::f32::consts::FRAC_PI_4) * 0.13);
        if around.chain([centre]).all(|p| on_chart(&piece, p).is_some()) {
            assert!(p.distance(centre) < 1e-3, "{p} {centre}");
        } else if on_chart(&piece, centre).is_some() {
            pulled += 1;
        }
        // The square that the footprint claims stays on the chart.
        let half = elements.half_u_world[i].length() / stand_per_texel(&piece, elements.triangle[i]).length();
        assert!(half <= 0.5 + 1e-4);
        for (sx, sy) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            let q = p + Vec2::new(sx, sy) * (half * 0.98 - 1e-3).max(0.0);
            assert!(half < 0.02 || on_chart(&piece, q).is_some(), "{p} {half}");
        }
    }
    assert!(pulled > 50, "{pulled}");
}

fn stand_per_texel(piece: &Piece, triangle: u32) -> Vec3 {
    let t = piece.triangles[triangle as usize];
    let (p, uv) = (t.map(|v| piece.position[v as usize]), t.map(|v| piece.uv_texels[v as usize]));
    let (d1, d2) = (uv[1] - uv[0], uv[2] - uv[0]);
    ((p[1] - p[0]) * d2.y - (p[2] - p[0]) * d1.y) / d1.perp_dot(d2)
}

/// Barycentric weights of the point's projection.
fn weights([a, b, c]: [Vec3; 3], p: Vec3) -> Vec3 {
    let [a, b, c, p] = [a, b, c, p].map(|v| v.as_dvec3());
    let n = (b - a).cross(c - a);
    let at = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).dot(n) / n.length_squared();
    DVec3::new(at(b, c, p), at(c, a, p), at(a, b, p)).as_vec3()
}

#[test]
fn normals_face_the_lit_side_under_any_pose() {
    for pose in poses() {
        let mut stand = Stand::new(128);
        let sheet_piece = sheet();
        let surface = stand.add(sheet_piece.clone(), pose, MaterialId(0));
        let back_page = stand.page(128, false);
        stand.add_back(surface, sheet_piece, back_page);
        let elements = stand.elements();
        assert_eq!(elements.charts.len(), 2);
        // Local +z is the front: a point far on that side is in front of every triangle under any affine map.
        let front = pose.transform_point3(DVec3::new(2.0, 1.5, 100.0)).as_vec3();
        for i in 0..elements.len() {
            let back = elements.charts[elements.chart[i] as usize].back;
            assert_eq!(back, elements.texel[i].page == back_page);
            let toward = (front - elements.position_world[i]) * if back { -1.0 } else { 1.0 };
            assert!(elements.normal_geometric[i].dot(toward) > 0.0);
            assert!(
                elements.normal_geometric[i].is_normalized() && elements.normal_shading[i].is_normalized()
            );
            assert!(elements.normal_shading[i].dot(elements.normal_geometric[i]) > 0.04);
            assert!(elements.normal_geometric[i].dot(elements.half_u_world[i]).abs() < 1e-4);
        }
    }
}

#[test]
fn a_large_chart_is_cut_into_bands_without_a_trace() {
    let mut stand = Stand::new(512);
    let piece = Piece::rectangle(Vec3::ZERO, Vec3::X * 5.0, Vec3::Z * 5.0, 9, Vec2::new(1.4, 2.6), 0.01);
    stand.add(piece, DAffine3::IDENTITY, MaterialId(0));
    let (elements, noticed) = stand.noticed();
    let total: f64 = elements.area.iter().map(|a| f64::from(a.0)).sum();
    assert!((total - 25.0).abs() < 1e-4 && elements.len() == 501 * 501, "{total} {}", elements.len());
    assert!(elements.valid.iter().all(|&v| v) && noticed.moved == 0);
    let one = elements.half_u_world[250 * 501 + 250];
    assert!((one - Vec3::X * 0.005).length() < 1e-6, "{one}");
}

fn lookup_fixture() -> (Stand, World, Elements, Piece) {
    let mut stand = Stand::new(128);
    let piece = sheet();
    stand.add(piece.clone(), poses()[1], MaterialId(0));
    let (world, elements) = (stand.world(), stand.elements());
    (stand, world, elements, piece)
}

fn hits() -> impl Iterator<Item = Hit> {
    let triangles = sheet().triangles.len() as f32;
    let mut number = scatter(5);
    std::iter::from_fn(move || {
        let (t, mut u, mut v) = (number.next()?, number.next()?, number.next()?);
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        Some(Hit { t: 1.0, triangle: (t * triangles) as u32, u, v, front: true })
    })
}

#[test]
fn a_hit_finds_the_element_it_lies_in() {
    let (stand, world, elements, piece) = lookup_fixture();
    let lookup = Lookup::new(&stand.scene, &stand.atlas, &world, &elements);
    for hit in hits().take(20_000) {
        let [a, c, b] = piece.triangles[hit.triangle as usize].map(|i| piece.uv_texels[i as usize]);
        let p = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
        let texel = elements.texel[lookup.element_at(&hit).unwrap() as usize];
        let inside = p - Vec2::new(f32::from(texel.x), f32::from(texel.y));
        assert!(inside.min_element() > -1e-3 && inside.max_element() < 1.001, "{p} {texel:?}");
        assert_eq!(lookup.element_at(&Hit { front: false, ..hit }), None);
    }
}

#[test]
fn bilinear_weights_add_up_and_reproduce_a_linear_function() {
    let (stand, world, mut elements, _) = lookup_fixture();
    for (i, valid) in elements.valid.iter_mut().enumerate() {
        *valid = i % 5 != 0;
    }
    let lookup = Lookup::new(&stand.scene, &stand.atlas, &world, &elements);
    let mut whole = 0;
    for hit in hits().take(20_000) {
        let weights = lookup.bilinear_at(&hit).unwrap();
        let total: f32 = weights.iter().map(|w| w.1).sum();
        assert!((total - 1.0).abs() < 1e-5 && weights.iter().all(|w| w.1 >= 0.0));
        assert!(weights.iter().all(|w| elements.valid[w.0 as usize]) || weights[0].1 == 1.0);
        assert_eq!(lookup.bilinear_at(&Hit { front: false, ..hit }), None);
    }
    elements.valid.fill(true);
    let lookup = Lookup::new(&stand.scene, &stand.atlas, &world, &elements);
    for hit in hits().take(20_000) {
        let weights = lookup.bilinear_at(&hit).unwrap();
        let mut ids = weights.map(|w| w.0);
        ids.sort_unstable();
        if ids.windows(2).all(|w| w[0] < w[1]) {
            whole += 1;
            let texels = weights.map(|(e, w)| {
                let texel = elements.texel[e as usize];
                Vec2::new(f32::from(texel.x) + 0.5, f32::from(texel.y) + 0.5) * w
            });
            let at: Vec2 = texels.into_iter().sum();
            let element = elements.texel[lookup.element_at(&hit).unwrap() as usize];
            let inside = at - Vec2::new(f32::from(element.x), f32::from(element.y));
            assert!(inside.min_element() > -1e-3 && inside.max_element() < 1.001, "{at} {element:?}");
        }
    }
    assert!(whole > 10_000, "{whole}");
}

#[test]
fn a_fine_texture_is_averaged_and_a_coarse_one_is_followed() {
    // Red grows linearly along u, green is a one pixel checker, blue is 1 in the left half.
    let size = 256;
    let pixel = |i: u32| {
        let (x, y) = (i % size, i / size);
        Vec4::new((x as f32 + 0.5) / size as f32, ((x + y) % 2) as f32, (x < size / 2) as u8 as f32, 1.0)
    };
    let pixels = Pixels::Float((0..size * size).map(pixel).collect());
    for (texels, factor) in [(6.0_f32, 0.25), (20.0, 0.3), (100.0, 0.9)] {
        let mut stand = Stand::new(128);
        let texture = Texture::new("t".into(), [size; 2], pixels.clone(), [Wrap::Clamp; 2], Filter::Nearest);
        stand.scene.textures.push(texture.unwrap());
        let slot = TextureSlot { texture: TextureId(0), texcoord: 0, transform: Affine2::IDENTITY };
        let material = stand.material(crate::scene::Material {
            base_color: Vec4::new(factor, factor, factor, 1.0),
            base_color_texture: Some(slot),
            ..Default::default()
        });
        let piece = Piece::rectangle(Vec3::ZERO, Vec3::X, Vec3::Y, 3, Vec2::splat(4.0), 1.0 / texels);
        let texcoord = piece.position.iter().map(|p| Vec2::new(p.x, p.y)).collect();
        stand.add(piece, DAffine3::IDENTITY, material);
        stand.scene.geometries[0].texcoords.push(texcoord);
        let elements = stand.elements();
        assert_eq!(elements.len(), (texels * texels) as usize);
        for (texel, reflectance) in elements.texel.iter().zip(&elements.reflectance) {
            let u = (f32::from(texel.x) - 4.0 + 0.5) / texels;
            let [r, g, b] = (reflectance.0 / factor).to_array();
            assert!((r - u).abs() < 0.01, "{texels}: {r} {u}");
            // Two by two pixels are the least that averages a checker.
            assert!((g - 0.5).abs() < if texels > 50.0 { 0.51 } else { 0.13 }, "{texels}: {g}");
            let edge = (u - 0.5).abs() < 0.75 / texels;
            assert!(edge || (b - f32::from(u8::from(u < 0.5))).abs() < 0.01, "{texels}: {b} at {u}");
        }
        let mean = |channel: usize| {
            elements.reflectance.iter().map(|r| r.0[channel]).sum::<f32>() / elements.len() as f32 / factor
        };
        assert!((mean(0) - 0.5).abs() < 2e-3 && (mean(1) - 0.5).abs() < 0.02 && (mean(2) - 0.5).abs() < 5e-3);
    }
}
