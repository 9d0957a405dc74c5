//! Random small scenes: whatever the plan leaves out changes nothing.

use crate::common::Builder;
use crate::scenes::{Shine, block, coloured, double_sided, hull, lamp, like, transparent};
use crate::{changes_nothing, draft};
use glam::Vec3;
use lightkiln::scene::{Alpha, MaterialId, Role};
use proptest::prelude::*;

/// What stands in one cell of a grid of 3 m.
#[derive(Clone, Debug)]
enum Thing {
    Nothing,
    Block { half: f32 },
    Room { left_out: u8, inside: bool, lamp: bool, inward: bool },
    Sheet,
}

#[derive(Clone, Debug)]
struct Recipe {
    things: Vec<(Thing, u8)>,
    lamps: Vec<(Vec3, f32, Option<f32>)>,
    sun: Option<f32>,
    sky: f32,
    ground: bool,
}

fn recipe() -> impl Strategy<Value = Recipe> {
    let thing = prop_oneof![
        2 => Just(Thing::Nothing),
        3 => (0.2_f32..0.9).prop_map(|half| Thing::Block { half }),
        4 => (prop_oneof![3 => Just(0_u8), 1 => 0_u8..64], any::<bool>(), any::<bool>(), any::<bool>())
            .prop_map(|(left_out, inside, lamp, inward)| Thing::Room { left_out, inside, lamp, inward }),
        1 => Just(Thing::Sheet),
    ];
    let lamp = (
        [-1.4_f32..7.4, 0.1_f32..3.0, -1.4_f32..4.4].prop_map(Vec3::from_array),
        prop_oneof![Just(0.0_f32), Just(0.1)],
        proptest::option::of(0.5_f32..5.0),
    );
    (
        prop::collection::vec((thing, 0_u8..9), 1..5),
        prop::collection::vec(lamp, 0..3),
        proptest::option::of(prop_oneof![Just(0.0_f32), Just(0.1)]),
        prop_oneof![Just(0.0_f32), Just(0.5)],
        any::<bool>(),
    )
        .prop_map(|(things, lamps, sun, sky, ground)| Recipe { things, lamps, sun, sky, ground })
}

fn material(b: &mut Builder, kind: u8) -> MaterialId {
    match kind {
        0 => b.material(0.0, 0.0),
        1 | 2 => double_sided(b, 0.6, 0.0),
        3 => coloured(b, 0.8, 0.3, 0.1),
        4 => double_sided(b, 0.3, 1.5),
        5 => transparent(b, Alpha::Blend, 0.5),
        6 => {
            let plain = b.material(0.5, 0.0);
            like(b, plain, |material| material.unlit = true)
        }
        _ => b.material(0.5, 0.0),
    }
}

fn cook(recipe: &Recipe) -> Builder {
    let mut b = Builder::new();
    for (cell, (thing, kind)) in recipe.things.iter().enumerate() {
        let middle = Vec3::new((cell % 3) as f32 * 3.0, 1.0, (cell / 3) as f32 * 3.0);
        let of = material(&mut b, *kind);
        match *thing {
            Thing::Nothing => {}
            Thing::Block { half } => drop(block(&mut b, middle, half, of)),
            Thing::Sheet => drop(b.quad(middle - 0.7, Vec3::X * 1.4, Vec3::new(0.0, 1.4, 0.9), of)),
            Thing::Room { left_out, inside, lamp, inward } => {
                hull(&mut b, middle - 0.9, middle + 0.9, inward, left_out, of);
                if inside {
                    let of = material(&mut b, (kind + 3) % 9);
                    block(&mut b, middle + Vec3::new(0.2, -0.3, 0.1), 0.3, of);
                }
                if lamp {
                    b.point(middle + Vec3::new(-0.4, 0.4, 0.3), 1.0);
                }
            }
        }
    }
    if recipe.ground || b.scene.surfaces.is_empty() {
        let of = b.material(0.4, 0.0);
        b.quad(Vec3::new(-2.0, -0.2, -2.0), Vec3::Z * 8.0, Vec3::X * 10.0, of);
    }
    // A scene in which nothing is lightmapped is refused.
    if b.scene.surfaces.iter().all(|surface| b.scene.material(surface).unlit) {
        b.scene.surfaces[0].role = Role::Lightmapped;
        b.scene.surfaces[0].material = MaterialId(0);
    }
    for &(position_world, radius_m, range_m) in &recipe.lamps {
        lamp(&mut b, position_world, Shine { range_m, radius_m, ..Shine::default() });
    }
    if let Some(angle) = recipe.sun {
        b.sun(Vec3::new(0.2, 1.0, 0.3), 1.0, angle);
    }
    b.sky(recipe.sky);
    b
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn what_is_left_out_changes_nothing(recipe in recipe()) {
        changes_nothing("random", &cook(&recipe).scene, &draft());
    }
}
