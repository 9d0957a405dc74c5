//! Samples that other geometry covers, crosses or touches.

use crate::elements::Elements;
use crate::elements::testing::{Piece, Stand};
use crate::scene::{Alpha, Material, MaterialId};
use glam::{DAffine3, Vec2, Vec3, Vec4};

const PLAIN: MaterialId = MaterialId(0);

/// A floor of 4 m by 4 m around the origin, facing up, 100 × 100 texels of 4 cm from (2, 2) on.
fn floor() -> Piece {
    Piece::rectangle(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, 1, Vec2::splat(2.0), 0.04)
}

/// The elements of the floor, which is the first surface.
fn floor_elements(elements: &Elements) -> impl Iterator<Item = usize> + '_ {
    (0..elements.len()).filter(|&i| elements.charts[elements.chart[i] as usize].surface == 0)
}

/// World position of the texel's centre on the floor.
fn centre(elements: &Elements, i: usize) -> Vec2 {
    let texel = elements.texel[i];
    Vec2::new(f32::from(texel.y) - 2.0 + 0.5, f32::from(texel.x) - 2.0 + 0.5) * 0.04 - 2.0
}

/// Signed distance of a floor point (x, z) to a rectangle, negative inside.
fn beyond(p: Vec2, min: Vec2, max: Vec2) -> f32 {
    (min - p).max(p - max).max_element()
}

#[test]
fn a_box_on_a_floor_covers_what_stands_under_it() {
    // Sunk by a little, standing exactly on it, and floating by less than anyone can see.
    for bottom in [-0.3, 0.0, 1e-5] {
        let mut stand = Stand::new(512);
        stand.add(floor(), DAffine3::IDENTITY, PLAIN);
        let (min, max) = (Vec3::new(-0.53, bottom, -0.71), Vec3::new(0.64, 1.0, 0.345));
        stand.add(Piece::closed_box(min, max, Vec2::new(110.0, 2.0), 60.0, 0.04), DAffine3::IDENTITY, PLAIN);
        let (elements, noticed) = stand.noticed();
        let (lo, hi) = (Vec2::new(min.x, min.z), Vec2::new(max.x, max.z));
        let (mut under, mut straddling) = (0, 0);
        for i in floor_elements(&elements) {
            let position = elements.position_world[i];
            let sample = beyond(Vec2::new(position.x, position.z), lo, hi);
            let texel = beyond(centre(&elements, i), lo, hi);
            if texel > 0.0201 {
                assert!(elements.valid[i] && sample > 0.02 - 1e-4, "{texel}");
            } else if texel < -0.0201 {
                under += 1;
                assert!(!elements.valid[i], "{texel}");
            } else if elements.valid[i] {
                straddling += 1;
                assert!(sample > 0.002, "bottom {bottom}: the sample is {sample} m from the box");
            } else {
                // No sub-sample of a quarter texel's grid is outside.
                assert!(texel < -0.015 + 1e-4, "{texel}");
            }
        }
        assert!(
            under > 600 && straddling > 60 && noticed.moved > 30,
            "{under} {straddling} {}",
            noticed.moved
        );
    }
}

#[test]
fn a_box_among_boxes_loses_only_the_faces_that_touch() {
    let mut stand = Stand::new(512);
    let unit = |x: f32, row: f32| {
        Piece::closed_box(
            Vec3::new(x, 0.0, 0.0),
            Vec3::new(x + 1.0, 1.0, 1.0),
            Vec2::new(2.0, row),
            30.0,
            0.05,
        )
    };
    let first = stand.add(unit(0.0, 2.0), DAffine3::IDENTITY, PLAIN);
    stand.add(unit(1.0, 40.0), DAffine3::IDENTITY, PLAIN);
    let (elements, noticed) = stand.noticed();
    for i in 0..elements.len() {
        let touching = elements.normal_geometric[i].x
            * if elements.charts[elements.chart[i] as usize].surface == first as u32 { 1.0 } else { -1.0 };
        assert_eq!(elements.valid[i], touching < 0.5, "{}", elements.position_world[i]);
    }
    assert_eq!(noticed.moved, 0);
    assert!(noticed.warnings.is_empty());
}

#[test]
fn a_thin_wall_has_no_samples_inside_and_none_on_it() {
    // 1 cm thick, a quarter of a texel, along a line of texel centres: between 0.014 and 0.024 in x.
    let mut stand = Stand::new(512);
    stand.add(floor(), DAffine3::IDENTITY, PLAIN);
    let wall = Piece::closed_box(
        Vec3::new(0.016, 0.0, -2.0),
        Vec3::new(0.026, 2.0, 2.0),
        Vec2::new(110.0, 2.0),
        60.0,
        0.1,
    );
    stand.add(wall, DAffine3::IDENTITY, PLAIN);
    let (elements, noticed) = stand.noticed();
    let mut beside = 0;
    for i in floor_elements(&elements) {
        let x = elements.position_world[i].x;
        assert!(elements.valid[i] && !(0.014..0.028).contains(&x), "{x}");
        beside += usize::from((0.0..0.04).contains(&x));
    }
    assert_eq!(beside, 100);
    assert_eq!(noticed.moved, 100);
}

#[test]
fn a_sheet_through_the_texel_centres_does_not_share_its_samples_with_both_sides() {
    let mut stand = Stand::new(512);
    stand.add(floor(), DAffine3::IDENTITY, PLAIN);
    // One sheet, single-sided, exactly through the centres at x = 0.02.
    let sheet = Piece::rectangle(
        Vec3::new(0.02, 0.0, -2.0),
        Vec3::Y * 2.0,
        Vec3::Z * 4.0,
        1,
        Vec2::new(110.0, 2.0),
        0.1,
    );
    stand.add(sheet, DAffine3::IDENTITY, PLAIN);
    let elements = stand.elements();
    for i in floor_elements(&elements) {
        let x = elements.position_world[i].x;
        assert!(elements.valid[i] && (x - 0.02).abs() > 0.004, "{x}");
    }
}

/// Every floor sample must stay valid.
fn assert_all_valid(stand: &Stand, what: &str) {
    let elements = stand.elements();
    let lost = floor_elements(&elements).filter(|&i| !elements.valid[i]).count();
    assert_eq!(lost, 0, "{what}");
}

#[test]
fn lit_backs_ceilings_and_leaves_bury_nothing() {
    // A low ceiling that faces up, over the floor of a room whose walls face inward: dark backs everywhere above.
    let mut stand = Stand::new(512);
    stand.add(floor(), DAffine3::IDENTITY, PLAIN);
    let ceiling = Piece::rectangle(
        Vec3::new(-2.0, 0.3, -2.0),
        Vec3::Z * 4.0,
        Vec3::X * 4.0,
        1,
        Vec2::new(110.0, 2.0),
        0.1,
    );
    stand.add(ceiling, DAffine3::IDENTITY, PLAIN);
    let room = Piece::closed_box(
        Vec3::new(-2.0, 0.0, -2.0),
        Vec3::new(2.0, 0.3, 2.0),
        Vec2::new(2.0, 120.0),
        60.0,
        0.1,
    );
    let mut walls = room.turned();
    // Without its floor and ceiling.
    let mut keep = 0;
    walls.triangles.retain(|_| {
        keep += 1;
        !(5..=8).contains(&keep)
    });
    walls.chart = vec![0, 0, 1, 1, 4, 4, 5, 5];
    stand.add(walls, DAffine3::IDENTITY, PLAIN);
    assert_all_valid(&stand, "under a ceiling without an underside");

    // A canopy of double-sided leaves, their backs lit, and a closed box of them.
    let mut stand = Stand::new(512);
    stand.add(floor(), DAffine3::IDENTITY, PLAIN);
    let leaves = stand.material(Material { double_sided: true, ..Material::default() });
    let tent = Piece::closed_box(Vec3::splat(-0.7), Vec3::splat(0.7), Vec2::new(2.0, 120.0), 60.0, 0.04);
    let tent_surface = stand.add(tent.clone(), DAffine3::IDENTITY, leaves);
    let hidden = stand.page(512, false);
    stand.add_back(tent_surface, tent, hidden);
    let carpet =
        Piece::rectangle(Vec3::new(-1.9, 0.008, -1.9), Vec3::Z, Vec3::X, 1, Vec2::new(110.0, 2.0), 0.04);
    let carpet_surface = stand.add(carpet.clone(), DAffine3::IDENTITY, leaves);
    let hidden = stand.page(512, false);
    stand.add_back(carpet_surface, carpet, hidden);
    assert_all_valid(&stand, "under lit backs");

    // A glass box and one that is cut away wholly.
    for alpha in [Alpha::Blend, Alpha::Mask { cutoff: 0.5 }] {
        let mut stand = Stand::new(512);
        stand.add(floor(), DAffine3::IDENTITY, PLAIN);
        let glass = stand.material(Material {
            alpha,
            base_color: Vec4::new(1.0, 1.0, 1.0, 0.2),
            ..Material::default()
        });
        let tank = Piece::closed_box(Vec3::splat(-0.7), Vec3::splat(0.7), Vec2::new(110.0, 2.0), 60.0, 0.04);
        stand.add(tank, DAffine3::IDENTITY, glass);
        assert_all_valid(&stand, "in glass");
    }
}

#[test]
fn a_poster_hides_the_wall_behind_it_but_not_beside_it() {
    // Single-sided, a millimetre above the "wall", which is the floor here.
    let mut stand = Stand::new(512);
    stand.add(floor(), DAffine3::IDENTITY, PLAIN);
    let (min, max) = (Vec2::new(-0.83, -0.5), Vec2::new(0.87, 0.7));
    let poster = Piece::rectangle(
        Vec3::new(min.x, 0.001, min.y),
        Vec3::Z * (max.y - min.y),
        Vec3::X * (max.x - min.x),
        1,
        Vec2::new(110.0, 2.0),
        0.04,
    );
    stand.add(poster, DAffine3::IDENTITY, PLAIN);
    let elements = stand.elements();
    for i in floor_elements(&elements) {
        let texel = beyond(centre(&elements, i), min, max);
        if texel < -0.0201 {
            assert!(!elements.valid[i], "{texel}");
        } else if texel > 0.0201 {
            assert!(elements.valid[i], "{texel}");
        }
    }
}

#[test]
fn a_surface_inside_another_is_reported() {
    let mut stand = Stand::new(512);
    let big = Piece::closed_box(Vec3::splat(-1.0), Vec3::splat(1.0), Vec2::new(2.0, 2.0), 30.0, 0.1);
    stand.add(big, DAffine3::IDENTITY, PLAIN);
    let small = Piece::closed_box(Vec3::splat(-0.5), Vec3::splat(0.5), Vec2::new(2.0, 40.0), 30.0, 0.1);
    stand.add(small, DAffine3::IDENTITY, PLAIN);
    let (elements, noticed) = stand.noticed();
    for i in 0..elements.len() {
        assert_eq!(elements.valid[i], elements.charts[elements.chart[i] as usize].surface == 0);
    }
    assert_eq!(noticed.warnings.len(), 1);
    assert!(noticed.warnings[0].at == "s1" && noticed.warnings[0].what.starts_with("100 %"));
}
