//! Whole bakes at the limits: reflectance, brightness, size and distance; nothing there, nothing lit; nonsense.

use super::Check;
use super::baked::{Baked, farthest, mean};
use super::bakes::{ROUNDING, lawful};
use super::hard::{brightest, differing};
use super::model::{Model, Place, Written, effort};
use crate::error::Result;
use crate::options::Quality;
use glam::{Vec3, vec3};
use std::f64::consts::PI;

/// Reflectances of nothing, one and more; brightness and size by powers of two; nothing there, nothing lit; nonsense.
pub fn extremes() -> Result<Vec<Check>> {
    let mut checks = reflectances()?;
    checks.extend(powers_of_two()?);
    checks.extend(far_apart()?);
    checks.extend(furnished_furnace()?);
    checks.extend(degenerate_emitters()?);
    checks.extend(nothing()?);
    checks.extend(refusals());
    Ok(checks)
}

/// Two furnaces in one scene, so that no origin is near both: each has the ulp of its distance to work with.
fn far_apart() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for distance in [1e2_f32, 1e3, 1e4, 1e5] {
        let mut model = Model::default();
        let grey = model.material(0.5, 1.0);
        for x in [0.0, distance] {
            model.room(vec3(x, 0.0, 0.0), vec3(x + 3.0, 2.0, 4.0), [grey; 6]);
        }
        let baked = model.bake(&Place::HERE, &effort(Quality::Draft, 128))?;
        let (expected, found) = farthest(&baked.all(), |_| 2.0 * PI);
        // Rays start 12u of the coordinate above their plane: so much of the view lies behind a neighbouring wall.
        let bound = 2.0 * ROUNDING + 1e-4 * 2.0 + 12.0 * 6e-8 * f64::from(distance) / 2.0;
        let why =
            "rays start 12u of the coordinate above a wall, as a share of the room's 2 m; the unshot share";
        checks.push(Check::new(
            format!("two furnaces {distance:e} m apart in one scene, worst texel"),
            expected,
            found,
            bound,
            why,
        ));
        checks.push(Check::fact("the same: finite, nowhere negative", lawful(&baked), "law"));
    }
    Ok(checks)
}

/// A furnace with a block in it, which hides nothing that matters: everything glows alike.
fn furnished_furnace() -> Result<Vec<Check>> {
    let mut model = Model::default();
    let grey = model.material(0.5, 1.0);
    model.room(Vec3::ZERO, vec3(4.0, 3.0, 5.0), [grey; 6]);
    model.block(vec3(1.0, 0.0, 1.0), vec3(2.0, 1.25, 2.5), grey);
    let mut options = effort(Quality::Good, 64);
    // Every texel is refined, by many rays.
    (options.light.direct.probe_rays, options.light.direct.penumbra_rays) = (0, 1024);
    let baked = model.bake(&Place::HERE, &options)?;
    let texels = baked.all();
    let (expected, found) = farthest(&texels, |_| 2.0 * PI);
    let rays = f64::from(options.light.direct.penumbra_rays);
    let probes = 4.0 * 0.5 * rays.powf(-0.75);
    let why = "visibility of each emitter by rays: 4 × ½ N^(−3/4) of what is half hidden";
    Ok(vec![
        Check::new("furnace with a block in it, worst texel", expected, found, probes, why),
        Check::new("the same: mean", 2.0 * PI, mean(&texels), probes, "the mean errs no more than its parts"),
    ])
}

/// A lamp all of whose corners lie on a line, and one that touches its receiver.
fn degenerate_emitters() -> Result<Vec<Check>> {
    let mut model = Model::default();
    let (black, lamp) = (model.material(0.0, 0.0), model.material(0.0, 1e6));
    let floor = model.quad(vec3(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, black);
    model.mesh(&[vec3(-0.5, 1.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.5, 1.0, 0.0)], &[[0, 1, 2]], lamp);
    let line = model.bake(&Place::HERE, &effort(Quality::Draft, 64))?;
    let mut model = Model::default();
    let (black, lamp) = (model.material(0.0, 0.0), model.material(0.0, 1.0));
    let below = model.quad(vec3(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, black);
    model.quad(vec3(-1.0, 0.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, lamp);
    let touching = model.bake(&Place::HERE, &effort(Quality::Draft, 64))?;
    let most = brightest(&touching, &[below]);
    Ok(vec![
        Check::new(
            "a lamp all of whose corners lie on a line: brightest texel",
            0.0,
            brightest(&line, &[floor]),
            0.0,
            "no area",
        ),
        Check::fact(
            "a lamp in the plane of its receiver: E is at most πL",
            lawful(&touching) && most <= PI * (1.0 + ROUNDING),
            "a form factor is at most 1",
        ),
    ])
}

fn reflectances() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let mut options = effort(Quality::Draft, 64);
    (options.light.solve.tolerance, options.light.solve.patches) = (1e-9, 256);
    let room = |rho: f64, emission: f64| {
        let mut model = Model::default();
        let grey = model.material(rho, emission);
        model.room(Vec3::ZERO, vec3(3.0, 2.0, 4.0), [grey; 6]);
        model
    };
    let mut black = room(0.0, 0.0);
    black.point(vec3(1.0, 1.0, 1.0), 5.0, 0.0);
    let baked = black.bake(&Place::HERE, &options)?;
    let reflected = baked.lit.indirect.iter().map(|e| f64::from(e.mean())).fold(0.0, f64::max);
    checks.push(Check::new(
        "ρ = 0: reflected light of the brightest texel",
        0.0,
        reflected,
        0.0,
        "nothing reflects",
    ));
    for rho in [1.0, 1.5] {
        let model = room(rho, 1.0);
        let scene = model.scene(&Place::HERE)?;
        let told = scene.warnings.iter().any(|warning| warning.at.contains("material 0"));
        checks.push(Check::fact(
            format!("ρ = {rho} in a closed room: a warning names the material"),
            told,
            "there is no steady state",
        ));
        let baked = Baked::of(scene, Place::HERE, &options)?;
        let (expected, found) = farthest(&baked.all(), |_| PI / (1.0 - f64::from(0.999_f32)));
        let why = "taken as 0.999, in f32; 64 ulp; the unshot share, times 1/(1 − ρ)";
        let case = format!("furnace, ρ = {rho} taken as 0.999, worst texel");
        checks.push(Check::new(case, expected, found, 2.0 * ROUNDING + 1e-6, why));
    }
    Ok(checks)
}

/// A room with a lamp, a block and colours.
pub fn furnished(radiance: f64) -> Model {
    furnished_as(Written::default(), radiance)
}

/// The same, written in another way.
pub fn furnished_as(written: Written, radiance: f64) -> Model {
    let mut model = Model::written(written);
    let (white, red, lamp) =
        (model.material(0.7, 0.0), model.coloured([0.6, 0.1, 0.1], 0.0), model.material(0.3, radiance));
    model.room(Vec3::ZERO, vec3(4.0, 3.0, 5.0), [red, white, white, white, white, white]);
    model.block(vec3(1.0, 0.0, 1.0), vec3(2.0, 1.25, 2.5), white);
    model.quad(vec3(1.5, 2.75, 2.0), Vec3::X, Vec3::Z, lamp);
    model
}

fn powers_of_two() -> Result<Vec<Check>> {
    let options = effort(Quality::Draft, 64);
    let bake =
        |radiance: f64, scale: f64| furnished(radiance).bake(&Place { scale, ..Place::HERE }, &options);
    let one = bake(1.0, 1.0)?;
    let mut checks = Vec::new();
    for power in [27, -20] {
        let factor = 2f64.powi(power);
        let found = differing(&one, &bake(factor, 1.0)?, factor as f32);
        let case = format!("an emitter 2^{power} times as bright: texels that are not so too");
        checks.push(Check::new(case, 0.0, found, 0.0, "light is linear, and powers of two are exact"));
    }
    for power in [10, 20, -10] {
        let found = differing(&one, &bake(1.0, 2f64.powi(power))?, 1.0);
        let case = format!("a room 2^{power} times as large: texels that are not the same");
        checks.push(Check::new(
            case,
            0.0,
            found,
            0.0,
            "radiance knows no size, and there is no absolute epsilon",
        ));
    }
    checks.push(Check::fact(
        "a furnished room is lit, finite and nowhere negative",
        lawful(&one) && one.all().iter().any(|t| t.irradiance > 0.0),
        "law",
    ));
    let bright = bake(1e8, 1.0)?;
    checks.push(Check::fact("an emitter of 1e8: all is finite and nowhere negative", lawful(&bright), "law"));
    Ok(checks)
}

fn nothing() -> Result<Vec<Check>> {
    let mut dark = Model::default();
    let grey = dark.material(0.9, 0.0);
    dark.room(Vec3::ZERO, Vec3::splat(2.0), [grey; 6]);
    let baked = dark.bake(&Place::HERE, &effort(Quality::Draft, 64))?;
    let told =
        baked.scene.warnings.iter().any(|warning| warning.what.contains("nothing in the scene gives light"));
    let found = baked.all().iter().map(|texel| texel.irradiance).fold(0.0, f64::max);
    let empty = Model::default().scene(&Place::HERE);
    let says = empty.err().map(|error| error.to_string()).unwrap_or_default();
    Ok(vec![
        Check::new("no light: brightest texel", 0.0, found, 0.0, "nothing shines"),
        Check::fact("no light: a warning says what to do", told, "a black lightmap is a mistake"),
        Check::fact(
            "an empty scene is refused, by file and remedy",
            says.contains("hard case.glb") && says.contains("triangles"),
            "nothing to bake",
        ),
    ])
}

/// Numbers that are none never come through: the object is named.
fn refusals() -> Vec<Check> {
    let refused = |case: &str, position: Vec3| {
        let mut model = Model::default();
        let grey = model.material(0.5, 0.0);
        model.quad(Vec3::ZERO, Vec3::X, Vec3::Z, grey);
        model.mesh(&[Vec3::ZERO, Vec3::X, position], &[[0, 1, 2]], grey);
        let says = model.scene(&Place::HERE).err().map(|error| error.to_string()).unwrap_or_default();
        let named = says.contains("shape 1") || says.contains("object 1");
        Check::fact(format!("a vertex at {case} is refused, by name"), named, "it would be everywhere")
    };
    vec![
        refused("NaN", vec3(0.0, f32::NAN, 0.0)),
        refused("infinity", vec3(0.0, f32::INFINITY, 0.0)),
        refused("3e38 m", vec3(0.0, 3e38, 0.0)),
    ]
}
