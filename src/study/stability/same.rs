//! What must not matter: where a scene is, how it is turned, in which order and under which names its objects come, and
//! into how many pieces its walls are cut.

use super::Check;
use super::baked::{Baked, deviation, half_range, mean};
use super::bakes::{noise, strict};
use super::limits::furnished;
use super::model::{Model, Place};
use crate::error::Result;
use glam::{DQuat, DVec3, Vec3, dvec3, vec3};
use serde_json::json;

/// All of them, against the scene as it was built.
pub fn invariance() -> Result<Vec<Check>> {
    let options = strict(128);
    let base = furnished(3.0).bake(&Place::HERE, &options)?;
    let texels = base.all();
    // Of what arrives no more than 0.7 is reflected.
    let [everywhere, anywhere] = [deviation(&texels), half_range(&texels)].map(|off| 2.0 * noise(0.7 * off));
    // A texel's middle stands for it: h²/24 of a curvature of 6/d² along two axes, the nearest lit thing being 1.5 m from
    // the lamp.
    let width_squared = texels.iter().map(|texel| texel.area).sum::<f64>() / texels.len() as f64;
    let middles = 2.0 * 2.0 * width_squared / 24.0 * 6.0 / (1.5 * 1.5);
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let mut checks = Vec::new();
    let mut compare = |case: &str, other: &Baked, walls: &[usize]| {
        let why = "two sets of samples: noise of a gather, 4 N^(−5/8) times the deviation of what it meets (half of its range, \
                   around a place), each; texels lie elsewhere, h²";
        let (a, b) = (mean(&base.all()), mean(&other.all()));
        checks.push(Check::new(format!("{case}: mean"), a, b, everywhere + middles, why));
        for (name, surface, at) in [
            ("floor", 2, dvec3(3.1, 0.0, 3.3)),
            ("ceiling", 3, dvec3(1.1, 3.0, 4.1)),
            ("wall", 1, dvec3(4.0, 1.4, 2.2)),
        ] {
            let around = |baked: &Baked, surface: usize| {
                let near = |texel: &super::baked::Texel| texel.at.distance(at) < 0.4;
                let texels: Vec<_> = baked.texels(surface).into_iter().filter(near).collect();
                mean(&texels)
            };
            // 0.4 m around hold ten texels and more, whose middle is off by a quarter of one: 2 cm of 1 m.
            let bound = anywhere + 0.02;
            let (a, b) = (around(&base, surface), around(other, walls[surface]));
            checks.push(Check::new(format!("{case}: around a place on the {name}"), a, b, bound, why));
        }
    };
    let same: Vec<usize> = (0..13).collect();
    compare("turned", &furnished(3.0).bake(&Place { turn, ..Place::HERE }, &options)?, &same);
    compare("1e6 m away", &furnished(3.0).bake(&Place::FAR, &options)?, &same);
    compare("a thousandth of the size", &furnished(3.0).bake(&Place::SMALL, &options)?, &same);
    compare("a million times the size", &furnished(3.0).bake(&Place::LARGE, &options)?, &same);
    let reversed: Vec<usize> = (0..13).rev().collect();
    compare("other names and the reverse order", &backwards().bake(&Place::HERE, &options)?, &reversed);
    compare("walls cut into 8 × 8", &cut().bake(&Place::HERE, &options)?, &same);
    Ok(checks)
}

/// The furnished room with its nodes in reverse, under other names.
fn backwards() -> Model {
    let mut model = furnished(3.0);
    model.reverse();
    for surface in 0..13 {
        if let Some(node) = model.node(surface) {
            node["name"] = json!(format!("Ω {}", 97 * surface % 13));
        }
    }
    model
}

/// The furnished room with its walls in many pieces.
fn cut() -> Model {
    let mut model = Model::default();
    let (white, red, lamp) =
        (model.material(0.7, 0.0), model.coloured([0.6, 0.1, 0.1], 0.0), model.material(0.3, 3.0));
    let (x, y, z) = (Vec3::X * 4.0, Vec3::Y * 3.0, Vec3::Z * 5.0);
    for (corner, u, v, material) in [
        (Vec3::ZERO, y, z, red),
        (x, z, y, white),
        (Vec3::ZERO, z, x, white),
        (y, x, z, white),
        (Vec3::ZERO, x, y, white),
        (z, y, x, white),
    ] {
        model.grid(corner, u, v, 8, material);
    }
    model.block(vec3(1.0, 0.0, 1.0), vec3(2.0, 1.25, 2.5), white);
    model.quad(vec3(1.5, 2.75, 2.0), Vec3::X, Vec3::Z, lamp);
    model
}
