//! Whole bakes of direct light: every kind of lamp against its closed form, at every texel's own place.

use super::Check;
use super::baked::farthest;
use super::bakes::ROUNDING;
use super::model::{Model, Place, effort};
use crate::error::{Error, Result};
use crate::options::Quality;
use glam::{DVec3, Vec3, dvec3, vec3};
use std::f64::consts::PI;

const WHY_ROUNDING: &str = "f32 of positions and of the stored value: 32 ulp";

/// A black floor 4 × 4 around the origin that faces up.
fn floor(model: &mut Model) -> usize {
    let black = model.material(0.0, 0.0);
    model.quad(vec3(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, black)
}

/// All lamps at all places.
pub fn lamps() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for place in Place::ALL {
        for part in [points, spots, suns, rectangles, small_emitters, discs] {
            checks.extend(part(&place)?.into_iter().map(|check| check.at(place.name)));
        }
    }
    checks.extend(penumbra()?);
    Ok(checks)
}

/// One lamp over the floor, and what each texel should get.
fn over_the_floor(
    case: &str,
    place: &Place,
    add: impl Fn(&mut Model),
    expected: impl Fn(DVec3) -> f64,
    bound: f64,
    why: &'static str,
) -> Result<Check> {
    let mut model = Model::default();
    let floor = floor(&mut model);
    add(&mut model);
    let baked = model.bake(place, &effort(Quality::Draft, 64))?;
    let (expected, found) = farthest(&baked.texels(floor), |texel| expected(texel.at));
    Ok(Check::new(format!("{case}, worst texel"), expected, found, bound, why))
}

/// E = I cosθ/d²; a sphere of radius R is the same as long as all of it is above the horizon.
fn points(place: &Place) -> Result<Vec<Check>> {
    let below = |height: f64| move |at: DVec3| height / at.distance(DVec3::Y * height).powi(3);
    let sphere = |at: DVec3| PI * 0.25 * below(2.0)(at);
    Ok(vec![
        over_the_floor(
            "point lamp 1 m up",
            place,
            |m| m.point(Vec3::Y, 1.0, 0.0),
            below(1.0),
            ROUNDING,
            WHY_ROUNDING,
        )?,
        over_the_floor(
            "point lamp of 1e8 W/sr",
            place,
            |m| m.point(Vec3::Y, 1e8, 0.0),
            |at| 1e8 * below(1.0)(at),
            ROUNDING,
            WHY_ROUNDING,
        )?,
        over_the_floor(
            "sphere of radius 0.5, 2 m up, L = 1: π L R²/d² cosθ",
            place,
            |m| m.point(Vec3::Y * 2.0, PI * 0.25, 0.5),
            sphere,
            ROUNDING,
            WHY_ROUNDING,
        )?,
    ])
}

/// Both cones.
fn spots(place: &Place) -> Result<Vec<Check>> {
    let (inner, outer) = (0.3_f64, 0.6_f64);
    let mut checks = Vec::new();
    for (name, gltf_cones) in [("Blender's", false), ("glTF's", true)] {
        let mut model = Model::default();
        model.gltf_cones = gltf_cones;
        let floor = floor(&mut model);
        model.spot(Vec3::Y * 2.0, Vec3::NEG_Y, 5.0, [inner, outer]);
        let baked = model.bake(place, &effort(Quality::Draft, 64))?;
        let share = |cosine: f64| {
            let above = cosine - outer.cos();
            if gltf_cones {
                (above / (inner.cos() - outer.cos())).clamp(0.0, 1.0).powi(2)
            } else {
                let t = (above / ((1.0 - outer.cos()) * (1.0 - inner / outer))).clamp(0.0, 1.0);
                t * t * (3.0 - 2.0 * t)
            }
        };
        // As a share of the axis: at the rim the light itself is nothing.
        let axis = 5.0 / 4.0;
        let mut worst = 0.0_f64;
        for texel in baked.texels(floor) {
            let to = DVec3::Y * 2.0 - texel.at;
            let cosine = to.y / to.length();
            let expected = 5.0 * cosine / to.length_squared() * share(cosine);
            worst = worst.max((texel.irradiance - expected).abs() / axis);
        }
        let why = "the ramp multiplies the rounding of the cosine, 32 ulp, by its slope, 20 at most";
        checks.push(Check::new(
            format!("spot lamp, {name} cone: largest error of the axis"),
            0.0,
            worst,
            20.0 * ROUNDING,
            why,
        ));
    }
    Ok(checks)
}

/// E = S cosθ, sharp and soft.
fn suns(place: &Place) -> Result<Vec<Check>> {
    let toward = vec3(1.0, 2.0, 0.5);
    let expected = 3.0 * 2.0 / (1.0_f64 + 4.0 + 0.25).sqrt();
    let sun = |angle: f64| move |m: &mut Model| m.sun(toward, 3.0, angle);
    Ok(vec![
        over_the_floor("sun", place, sun(0.0), |_| expected, ROUNDING, WHY_ROUNDING)?,
        over_the_floor("sun 0.53° wide", place, sun(0.00931), |_| expected, ROUNDING, WHY_ROUNDING)?,
    ])
}

/// E/L under a rectangle, by its four corners (C-4 of Howell's catalogue).
fn under_a_rectangle(at: DVec3, [low_x, high_x]: [f64; 2], [low_z, high_z]: [f64; 2], height: f64) -> f64 {
    let corner = |a: f64, b: f64| {
        let (p, q) = (a / (1.0 + a * a).sqrt(), b / (1.0 + b * b).sqrt());
        0.5 * (p * (b / (1.0 + a * a).sqrt()).atan() + q * (a / (1.0 + b * b).sqrt()).atan())
    };
    let [x0, x1] = [low_x, high_x].map(|x| (x - at.x) / height);
    let [z0, z1] = [low_z, high_z].map(|z| (z - at.z) / height);
    corner(x1, z1) - corner(x0, z1) - corner(x1, z0) + corner(x0, z0)
}

/// A unit square 1 m up; the same in contact; of 1e8; made of needles.
fn rectangles(place: &Place) -> Result<Vec<Check>> {
    let square = |height: f32, radiance: f64| {
        move |m: &mut Model| {
            let lamp = m.material(0.0, radiance);
            m.quad(vec3(-0.5, height, -0.5), Vec3::X, Vec3::Z, lamp);
        }
    };
    let needles = |m: &mut Model| {
        // Two fans of a hundred needles, 1 : 100 to 1 : 10⁴.
        let lamp = m.material(0.0, 1.0);
        let mut position = vec![vec3(-0.5, 1.0, -0.5), vec3(0.5, 1.0, 0.5)];
        let share = |i: u32| (i as f32 / 100.0).powi(2);
        position.extend((0..=100).map(|i| vec3(-0.5 + share(i), 1.0, 0.5)));
        position.extend((0..=100).map(|i| vec3(-0.5 + share(i), 1.0, -0.5)));
        let mut triangles = Vec::new();
        for i in 0..100 {
            triangles.push([0, 2 + i + 1, 2 + i]);
            triangles.push([1, 103 + i, 103 + i + 1]);
        }
        m.mesh(&position, &triangles, lamp);
    };
    let one = |at: DVec3| under_a_rectangle(at, [-0.5, 0.5], [-0.5, 0.5], 1.0);
    let bright = |at: DVec3| 1e8 * one(at);
    let low = f64::from(0.01_f32);
    let near = |at: DVec3| under_a_rectangle(at, [-0.5, 0.5], [-0.5, 0.5], low);
    let why = "Lambert's formula in f64, 1e-5 with positions in f32; within 6 radii nothing else is used";
    let close = "the same; at 1 cm an ulp of position is a hundred times more of the distance";
    let many = "the same for each of 200 needles; their areas cancel in f32 corners, an ulp over 1e-4";
    Ok(vec![
        over_the_floor("unit square, 1 m up", place, square(1.0, 1.0), one, 1e-5, why)?,
        over_the_floor("unit square of 1e8 W/(m² sr)", place, square(1.0, 1e8), bright, 1e-5, why)?,
        over_the_floor(
            "unit square, 1 cm up",
            place,
            square(0.01, 1.0),
            near,
            1e-5 + 100.0 * ROUNDING,
            close,
        )?,
        over_the_floor("unit square of needles", place, needles, one, 1e-5 + ROUNDING, many)?,
    ])
}

/// Smaller than a texel, from 1 cm to 10 µm: E = L A cosθ cosθ'/d².
fn small_emitters(place: &Place) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for size in [1e-2_f32, 1e-3, 1e-4, 1e-5] {
        let emitter = |m: &mut Model| {
            let lamp = m.material(0.0, 1e6);
            m.quad(vec3(-0.5 * size, 1.0, -0.5 * size), Vec3::X * size, Vec3::Z * size, lamp);
        };
        let side = f64::from(size);
        let expected = |at: DVec3| 1e6 * side * side / (1.0 + at.x * at.x + at.z * at.z).powi(2);
        // Corners at 0.5 size; relative to the middle of the scene they are rounded to an ulp of 1, at most.
        let corners = 2.0 * 6e-8 / side;
        // Turned about 1e6 m away, the file's own numbers are f64.
        let bound = 1e-5 + side * side + if place.by == DVec3::ZERO { 8.0 * 6e-8 } else { corners };
        let why = "the closed form, 1e-5; the emitter's extent counts squared, also where its middle stands for it; corners of f32 far from the scene's middle";
        checks.push(over_the_floor(&format!("emitter of {size:e} m"), place, emitter, expected, bound, why)?);
    }
    Ok(checks)
}

/// A disc of radius 0.5, 1 m up: E = π L R²/(R² + h²) on the axis.
fn discs(place: &Place) -> Result<Vec<Check>> {
    let disc = |m: &mut Model| m.disc(Vec3::Y, Vec3::NEG_Y, 0.5, PI * PI * 0.25);
    let off_axis = |at: DVec3| {
        // Howell's B-12, with the disc seen from a point at distance a off its axis.
        let (h, r, a) = (1.0, 0.5, at.x.hypot(at.z).max(1e-9));
        let z = 1.0 + (h / a) * (h / a) + (r / a) * (r / a);
        PI * 0.5 * (1.0 - (z - 2.0 * (r / a) * (r / a)) / (z * z - 4.0 * (r / a) * (r / a)).sqrt())
    };
    // Of equal area, a polygon of 48 corners has the disc's second moment to (2π/48)⁴/180; beyond 6 radii of a piece a
    // few points stand for it, off by 0.1 % of what a receiver that faces it gets; the floor's cosine is 1/3 there.
    let why = "beyond 6 radii points stand for a piece: 0.1 % of what a receiver facing it gets, the cosine being 1/3; \
               48 corners for a circle, 2e-6";
    Ok(vec![over_the_floor("disc of radius 0.5, 1 m up", place, disc, off_axis, 3e-3, why)?])
}

/// A straight edge over the sun's disc at t radii: (acos t − t √(1 − t²))/π of it is seen.
fn penumbra() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let angle = 0.4_f64;
    for place in [Place::HERE, Place::FAR] {
        let mut model = Model::default();
        let black = model.material(0.0, 0.0);
        // Small, so that there are many texels across the penumbra, which is 0.4 m wide.
        let floor = model.quad(vec3(-0.35, 0.0, -0.05), Vec3::Z * 0.1, Vec3::X * 0.7, black);
        model.quad(vec3(-0.7, 1.0, -0.4), Vec3::Z * 0.8, Vec3::X * 0.7, black);
        model.sun(Vec3::Y, 1.0, angle);
        let baked = model.bake(&place, &effort(Quality::High, 128))?;
        for t in [-1.0_f64, -0.5, 0.0, 0.5, 0.9, 1.0] {
            // Directions are spread over the projected disc: the visible share is that of a disc cut at t.
            let x = -t * (angle / 2.0).sin() / (1.0 - (t * (angle / 2.0).sin()).powi(2)).sqrt();
            let Some(texel) = baked.nearest(floor, dvec3(x, 0.0, 0.0)) else {
                return Err(Error::invalid("penumbra", "the floor has no texels"));
            };
            let here = -texel.at.x / (1.0 + texel.at.x * texel.at.x).sqrt() / (angle / 2.0).sin();
            let here = here.clamp(-1.0, 1.0);
            let share = (here.acos() - here * (1.0 - here * here).sqrt()) / PI;
            // 128 stratified points err by about N^(−3/4) of the disc at a straight edge.
            let bound = 128f64.powf(-0.75);
            let why = "N^(−3/4) of the disc for 128 points at a straight edge, absolute";
            let error = (texel.irradiance - share).abs();
            let case =
                format!("sun's disc cut at t = {here:.2}: error of the share {share:.4} of it that is seen");
            checks.push(Check::new(case, 0.0, error, bound, why).at(place.name));
        }
    }
    Ok(checks)
}
