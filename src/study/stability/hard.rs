//! Whole bakes of geometry that breaks lightmappers: thin walls, duplicates, needles, nothing at all.

use super::Check;
use super::baked::{Baked, farthest};
use super::bakes::{ROUNDING, lawful};
use super::model::{Model, Place, effort};
use crate::error::Result;
use crate::options::Quality;
use glam::{Vec3, vec3};
use serde_json::json;

const WHY_ROUNDING: &str = "f32 of positions and of the stored value: 32 ulp";

/// All of them.
pub fn geometry() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for place in Place::ALL {
        for part in [thin_wall, junctions, ring, sheets, mirrored, needles, buried, tiny] {
            checks.extend(part(&place)?.into_iter().map(|check| check.at(place.name)));
        }
    }
    Ok(checks)
}

/// The brightest texel.
pub fn brightest(baked: &Baked, surfaces: &[usize]) -> f64 {
    let texels = surfaces.iter().flat_map(|&surface| baked.texels(surface));
    texels.map(|texel| texel.irradiance).fold(0.0, f64::max)
}

/// A lit room of 10 m and a dark one behind a wall 1 mm thick.
fn thin_wall(place: &Place) -> Result<Vec<Check>> {
    let mut model = Model::default();
    let grey = model.material(0.7, 0.0);
    let lit = model.room(Vec3::ZERO, Vec3::splat(10.0), [grey; 6]);
    let dark = model.room(vec3(10.001, 0.0, 0.0), vec3(20.0, 10.0, 10.0), [grey; 6]);
    model.point(Vec3::splat(5.0), 1e4, 0.0);
    let baked = model.bake(place, &effort(Quality::Draft, 128))?;
    Ok(vec![
        Check::new(
            "dark side of a wall 1 mm thick, brightest texel",
            0.0,
            brightest(&baked, &dark),
            0.0,
            "no way leads there",
        ),
        Check::fact(
            "all is finite, none negative, and the lit room is lit",
            lawful(&baked) && brightest(&baked, &lit) > 1.0,
            "law",
        ),
    ])
}

/// A box whose faces are cut differently, so that corners of some lie on edges of others, in the light of everything.
fn junctions(place: &Place) -> Result<Vec<Check>> {
    let mut model = Model::under_sky(1e4);
    let grey = model.material(0.9, 0.0);
    model.double_sided(grey);
    let third = 1.0 / 3.0_f32;
    let mut inside = Vec::new();
    // Each face in three strips that end where no neighbour has a corner, and a fin on one of the edges.
    for axis in 0..3 {
        let at = |u: f32, v: f32, w: f32| {
            let mut p = Vec3::ZERO;
            (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (w, u, v);
            p
        };
        for w in [0.0_f32, 1.0] {
            for strip in 0..3 {
                let (low, high) =
                    (strip as f32 * third, if strip == 2 { 1.0 } else { (strip + 1) as f32 * third });
                let (a, b, c, d) = (at(low, 0.0, w), at(high, 0.0, w), at(high, 1.0, w), at(low, 1.0, w));
                let corners = if w == 0.0 { [a, b, c, d] } else { [a, d, c, b] };
                inside.push(model.mesh(&corners, &[[0, 1, 2], [0, 2, 3]], grey));
            }
        }
    }
    model.quad(Vec3::ZERO, vec3(-0.3, -0.3, 0.0), Vec3::Z, grey);
    model.sun(vec3(1.0, 1.0, 1.0), 1e4, 0.1);
    model.point(vec3(-1.0, 0.4, 0.6), 1e4, 0.0);
    let baked = model.bake(place, &effort(Quality::Draft, 128))?;
    Ok(vec![
        Check::new(
            "inside of a box with T-junctions and a fin, brightest texel",
            0.0,
            brightest(&baked, &inside),
            0.0,
            "corners on other triangles' edges are the same f32 numbers: the hit test is watertight",
        ),
        Check::fact("all is finite, none negative", lawful(&baked), "law"),
    ])
}

/// A closed ring of facets, seen from inside, with soft lamps around it: the planes of its facets reach through it.
fn ring(place: &Place) -> Result<Vec<Check>> {
    const AROUND: u32 = 48;
    const ACROSS: u32 = 12;
    let mut model = Model::default();
    let bright = model.material(0.999, 0.0);
    let turn = |k: u32, of: u32| (k as f32 / of as f32 * std::f32::consts::TAU).sin_cos();
    let corner = |i: u32, j: u32| {
        let ((sin, cos), (up, out)) = (turn(i, AROUND), turn(j, ACROSS));
        let radius = 1.0 + 0.25 * out;
        vec3(radius * cos, 0.25 * up, radius * sin)
    };
    let position: Vec<Vec3> =
        (0..AROUND).flat_map(|i| (0..ACROSS).map(move |j| (i, j))).map(|(i, j)| corner(i, j)).collect();
    let at = |i: u32, j: u32| i % AROUND * ACROSS + j % ACROSS;
    let facet = |(i, j): (u32, u32)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    let triangles: Vec<[u32; 3]> =
        (0..AROUND).flat_map(|i| (0..ACROSS).map(move |j| (i, j))).flat_map(facet).collect();
    let inside = model.mesh(&position, &triangles, bright);
    for z in [-0.6, 0.0, 0.6] {
        model.point(vec3(0.4, 1.5, z), 1e4, 1.0);
    }
    let mut checks = Vec::new();
    for quality in [Quality::Draft, Quality::Preview] {
        let baked = model.bake(place, &effort(quality, 128))?;
        checks.push(Check::new(
            format!("inside of a closed ring with soft lamps around it, {quality:?}, brightest texel"),
            0.0,
            brightest(&baked, &[inside]),
            0.0,
            "no way leads there; samples of a texel that lie beyond a neighbouring facet are lifted above it",
        ));
    }
    Ok(checks)
}

/// Two sheets in one place; a floor upside down; leaves with two sides; triangles without area.
fn sheets(place: &Place) -> Result<Vec<Check>> {
    let options = effort(Quality::Draft, 64);
    let square = |model: &mut Model, material| {
        model.quad(vec3(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, material)
    };
    let mut checks = Vec::new();
    let mut twice = Model::default();
    let grey = twice.material(0.0, 0.0);
    let both = [square(&mut twice, grey), square(&mut twice, grey)];
    twice.sun(Vec3::Y, 2.0, 0.0);
    let baked = twice.bake(place, &options)?;
    for (which, sheet) in both.into_iter().enumerate() {
        let (expected, found) = farthest(&baked.texels(sheet), |_| 2.0);
        checks.push(Check::new(
            format!("two sheets in one place, sheet {}, worst texel", which + 1),
            expected,
            found,
            ROUNDING,
            WHY_ROUNDING,
        ));
    }
    for flipped in [true, false] {
        let mut model = Model::default();
        let grey = model.material(0.5, 0.0);
        let (u, v) = if flipped { (Vec3::X, Vec3::Z) } else { (Vec3::Z, Vec3::X) };
        let floor = model.quad(vec3(-1.0, 0.0, -1.0), u * 2.0, v * 2.0, grey);
        model.sun(Vec3::Y, 2.0, 0.0);
        let baked = model.bake(place, &options)?;
        let (expected, found) = farthest(&baked.texels(floor), |_| if flipped { 0.0 } else { 2.0 });
        let (case, bound) = if flipped {
            ("a floor that faces down, brightest texel", 0.0)
        } else {
            ("the same, turned over, worst texel", ROUNDING)
        };
        checks.push(Check::new(case, expected, found, bound, WHY_ROUNDING));
    }
    let mut leaf = Model::default();
    let green = leaf.material(0.5, 0.0);
    leaf.double_sided(green);
    let surface = square(&mut leaf, green);
    leaf.sun(Vec3::Y, 2.0, 0.0);
    leaf.sun(Vec3::NEG_Y, 3.0, 0.0);
    let baked = leaf.bake(place, &options)?;
    for (back, light) in [(false, 2.0), (true, 3.0)] {
        let (expected, found) = farthest(&baked.side(surface, back), |_| light);
        let side = if back { "back" } else { "front" };
        checks.push(Check::new(
            format!("a leaf's {side} in suns from both sides, worst texel"),
            expected,
            found,
            ROUNDING,
            WHY_ROUNDING,
        ));
    }
    checks.push(without_area(place)?);
    Ok(checks)
}

/// The same bits with triangles of no area among the others.
fn without_area(place: &Place) -> Result<Check> {
    let bake = |empty: bool| {
        let mut model = Model::default();
        let (grey, lamp) = (model.material(0.6, 0.0), model.material(0.0, 3.0));
        model.room(Vec3::ZERO, Vec3::splat(2.0), [grey; 6]);
        let mut position =
            vec![vec3(0.5, 1.9, 0.5), vec3(1.5, 1.9, 0.5), vec3(1.5, 1.9, 1.5), vec3(0.5, 1.9, 1.5)];
        let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
        if empty {
            position.extend([vec3(1.0, 1.0, 1.0), vec3(1.2, 1.0, 1.0), vec3(1.4, 1.0, 1.0)]);
            triangles.extend([[4, 5, 6], [0, 0, 1], [5, 5, 5], [4, 6, 4]]);
        }
        model.mesh(&position, &triangles, lamp);
        model.bake(place, &effort(Quality::Draft, 64))
    };
    let (with, without) = (bake(true)?, bake(false)?);
    Ok(Check::new(
        "triangles without area among others: texels that differ",
        0.0,
        differing(&with, &without, 1.0),
        0.0,
        "they are dropped before anything is built",
    ))
}

/// How many texels of two bakes do not have the same bits, with the first one's light multiplied by a power of two.
pub fn differing(a: &Baked, b: &Baked, factor: f32) -> f64 {
    let (a, b) = (&a.lit, &b.lit);
    if a.elements.len() != b.elements.len() {
        return f64::INFINITY;
    }
    let same = |e: &usize| {
        a.direct[*e].0 * factor == b.direct[*e].0 && a.indirect[*e].0 * factor == b.indirect[*e].0
    };
    (0..a.elements.len()).filter(|e| !same(e)).count() as f64
}

/// A node of negative scale faces the way it looks.
fn mirrored(place: &Place) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for scale in [[-1.0, 1.0, 1.0], [-2.0, -0.5, 3.0], [-1.0, -1.0, -1.0]] {
        let mut model = Model::default();
        let grey = model.material(0.5, 0.0);
        let floor = model.quad(vec3(-1.0, 0.25, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, grey);
        if let Some(node) = model.node(floor) {
            node["scale"] = json!(scale);
        }
        let up = if scale[1] > 0.0 { Vec3::Y } else { Vec3::NEG_Y };
        model.sun(up, 2.0, 0.0);
        let baked = model.bake(place, &effort(Quality::Draft, 64))?;
        let (expected, found) = farthest(&baked.texels(floor), |_| 2.0);
        checks.push(Check::new(
            format!("a floor scaled by {scale:?}, worst texel"),
            expected,
            found,
            ROUNDING,
            WHY_ROUNDING,
        ));
    }
    Ok(checks)
}

/// A floor of a hundred needles, 1 : 10⁴ the thinnest.
fn needles(place: &Place) -> Result<Vec<Check>> {
    let mut model = Model::default();
    let grey = model.material(0.5, 0.0);
    let share = |i: u32| (i as f32 / 100.0).powi(2);
    let mut position = vec![vec3(-0.5, 0.0, -0.5)];
    position.extend((0..=100).map(|i| vec3(-0.5 + share(i), 0.0, 0.5)));
    let triangles: Vec<[u32; 3]> = (0..100).map(|i| [0, 1 + i, 2 + i]).collect();
    let floor = model.mesh(&position, &triangles, grey);
    model.sun(vec3(0.3, 1.0, 0.2), 2.0, 0.0);
    let baked = model.bake(place, &effort(Quality::Draft, 128))?;
    let expected = 2.0 / (1.0_f64 + 0.09 + 0.04).sqrt();
    let texels = baked.texels(floor);
    let area: f64 = texels.iter().map(|texel| texel.area).sum::<f64>() / place.scale.powi(2);
    let (expected, found) = farthest(&texels, |_| expected);
    // Corners rounded to an ulp over a needle 1e-4 wide turn its plane only within that plane: all lie at one height.
    let why = "f32 of positions; all corners lie in one plane, turned and moved by an ulp over 1e-4 at most";
    let bound = ROUNDING + if place.by == glam::DVec3::ZERO { 0.0 } else { 6e-8 / 1e-4 };
    Ok(vec![
        Check::new("a floor of needles in the sun, worst texel", expected, found, bound, why),
        Check::new(
            "its area in texels",
            0.5,
            area,
            1e-4,
            "footprints are clipped to the chart in f32, 1e-4 of the thinnest",
        ),
    ])
}

/// A block stands on the floor: texels half under it have the light of their free half.
fn buried(place: &Place) -> Result<Vec<Check>> {
    let mut model = Model::default();
    let black = model.material(0.0, 0.0);
    let floor = model.quad(vec3(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, black);
    let block = model.block(vec3(-0.513, 0.0, -0.487), vec3(0.507, 1.0, 0.491), black);
    model.sun(Vec3::Y, 2.0, 0.0);
    let baked = model.bake(place, &effort(Quality::Draft, 64))?;
    let (expected, found) = farthest(&baked.texels(floor), |_| 2.0);
    let under = block.into_iter().filter(|&side| {
        let texels = baked.texels(side);
        !texels.is_empty() && texels.iter().all(|texel| texel.at.y.abs() < 1e-3)
    });
    Ok(vec![
        Check::new(
            "floor around a block in the sun, worst valid texel",
            expected,
            found,
            ROUNDING,
            "samples stand in the free part of their texel; the sun is overhead",
        ),
        Check::new(
            "undersides of the block that count as lit",
            0.0,
            under.count() as f64,
            0.0,
            "what lies face to face with the floor is covered",
        ),
    ])
}

/// A receiver of 1e-4 m under a square of 1 m, areas of 1e-8 : 1: what a point under its middle sees.
fn tiny(place: &Place) -> Result<Vec<Check>> {
    let mut model = Model::default();
    let (black, lamp) = (model.material(0.0, 0.0), model.material(0.0, 1.0));
    let speck = model.quad(vec3(-0.5e-4, 0.0, -0.5e-4), Vec3::Z * 1e-4, Vec3::X * 1e-4, black);
    model.quad(vec3(-0.5, 1.0, -0.5), Vec3::X, Vec3::Z, lamp);
    let baked = model.bake(place, &effort(Quality::Draft, 64))?;
    let (expected, found) = farthest(&baked.texels(speck), |_| 0.752274688454);
    let why = "Lambert's formula, 1e-5; the receiver's extent counts squared, 1e-8";
    Ok(vec![Check::new("a receiver of 1e-8 of the emitter's area, worst texel", expected, found, 1e-5, why)])
}
