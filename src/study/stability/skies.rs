//! Whole bakes under a sky: walls, canyons, windows, an overcast image.

use super::Check;
use super::baked::{Baked, farthest, mean};
use super::bakes::ROUNDING;
use super::model::{Model, Place, effort};
use crate::error::Result;
use crate::options::{BakeOptions, Quality};
use crate::scene::{Sky, SkyImage};
use glam::{Vec3, vec3};
use std::f64::consts::PI;

/// Rays of a gather: the view of a sky with an edge across it is the indicator of a region of the square, for which
/// scrambled nets err by √(F(1 − F)) N^(−1/2 − 1/4).
const WHY: &str = "4 standard deviations of a scrambled net at an edge, √(F(1 − F)) N^(−3/4)";

fn bound(options: &BakeOptions, share: f64) -> f64 {
    4.0 * (share * (1.0 - share)).sqrt() * f64::from(options.light.gather.rays).powf(-0.75) / share
}

/// The middle of a small receiver, lit by a sky of radiance 1, beside black walls.
fn receiver(
    place: &Place,
    options: &BakeOptions,
    walls: impl Fn(&mut Model, usize),
    receiver: [Vec3; 3],
) -> Result<f64> {
    let mut model = Model::under_sky(1.0);
    let black = model.material(0.0, 0.0);
    let [corner, u, v] = receiver;
    let surface = model.quad(corner, u, v, black);
    walls(&mut model, black);
    let baked = model.bake(place, options)?;
    Ok(mean(&baked.texels(surface)))
}

/// Shares of a uniform sky.
pub fn skies() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let mut options = effort(Quality::High, 64);
    options.light.gather.tolerance = 0.0;
    // Receivers are a centimetre wide, so that their middle stands for them.
    let patch = [vec3(-0.005, 0.0, -0.005), Vec3::Z * 0.01, Vec3::X * 0.01];
    for place in Place::ALL {
        let mut model = Model::under_sky(2.0);
        let black = model.material(0.0, 0.0);
        let floor = model.quad(vec3(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, black);
        let baked = model.bake(&place, &effort(Quality::Draft, 64))?;
        let (expected, found) = farthest(&baked.texels(floor), |_| 2.0 * PI);
        let why = "weights of the rays add up to 1; f32";
        checks.push(
            Check::new("uniform sky over an open floor, worst texel", expected, found, ROUNDING, why)
                .at(place.name),
        );
        let mut share = |case: String, share: f64, found: f64| {
            checks.push(Check::new(case, PI * share, found, bound(&options, share), WHY).at(place.name));
        };
        for (elevation, seen) in [
            (10.0_f64, 0.992403876506),
            (30.0, 0.933012701892),
            (45.0, 0.853553390593),
            (60.0, 0.75),
            (80.0, 0.586824088833),
        ] {
            // (1 + cos α)/2 of the sky beside a long wall that rises to the elevation α.
            let height = elevation.to_radians().tan() as f32;
            let wall = |m: &mut Model, black: usize| {
                m.quad(vec3(-1.0, 0.0, -1000.0), Vec3::Y * height, Vec3::Z * 2000.0, black);
            };
            let found = receiver(&place, &options, wall, patch)?;
            share(format!("beside a wall that rises to {elevation}°"), seen, found);
        }
        let ground = |m: &mut Model, black: usize| {
            m.quad(vec3(-1000.0, -0.006, 0.0), Vec3::Z * 1000.0, Vec3::X * 2000.0, black);
        };
        let upright = [vec3(-0.005, -0.005, 0.0), Vec3::X * 0.01, Vec3::Y * 0.01];
        share("a wall on black ground".to_owned(), 0.5, receiver(&place, &options, ground, upright)?);
        let corner = |m: &mut Model, black: usize| {
            m.quad(vec3(-0.01, 0.0, -0.01), Vec3::Y * 100.0, Vec3::Z * 100.0, black);
            m.quad(vec3(-0.01, 0.0, -0.01), Vec3::X * 100.0, Vec3::Y * 100.0, black);
        };
        share(
            "in the corner of two walls without end".to_owned(),
            0.25,
            receiver(&place, &options, corner, patch)?,
        );
        for ratio in [0.5_f32, 1.0, 4.0] {
            let canyon = |m: &mut Model, black: usize| {
                m.quad(vec3(-0.5, 0.0, -1000.0), Vec3::Y * ratio, Vec3::Z * 2000.0, black);
                m.quad(vec3(0.5, 0.0, -1000.0), Vec3::Z * 2000.0, Vec3::Y * ratio, black);
            };
            // cos(atan(2H/W)).
            let seen = (f64::from(ratio) * 2.0).atan().cos();
            let found = receiver(&place, &options, canyon, patch)?;
            share(format!("floor of a canyon, height/width {ratio}"), seen, found);
        }
        for (width, height, distance, lit) in
            [(2.0_f32, 1.0_f32, 1.0_f32, 0.888531605995), (4.0, 3.0, 0.5, 0.608419208322)]
        {
            let wall = |m: &mut Model, black: usize| {
                m.quad(vec3(-distance, 0.0, -0.5 * width), Vec3::Y * height, Vec3::Z * width, black);
            };
            let found = receiver(&place, &options, wall, patch)?;
            share(format!("{distance} m before a wall {width} × {height}"), lit, found);
        }
        checks.extend(windows(&place)?);
    }
    checks.extend(overcast()?);
    Ok(checks)
}

/// A black room with a window 1.6 wide, sill 1, head 2.2; the floor 2 m in front. L = 5: E = 0.6525.
fn windows(place: &Place) -> Result<Vec<Check>> {
    const SHARE: f64 = 0.0415394426022;
    let mut options = effort(Quality::High, 64);
    options.light.gather.tolerance = 0.0;
    let patch = [vec3(-0.005, 0.0, -0.005), Vec3::Z * 0.01, Vec3::X * 0.01];
    let (min, max) = (vec3(-2.0, -0.01, -3.0), vec3(4.0, 3.0, 3.0));
    let room = |pane: bool| {
        let mut model = Model::under_sky(5.0);
        let black = model.material(0.0, 0.0);
        let floor = model.quad(patch[0], patch[1], patch[2], black);
        let d = max - min;
        let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
        model.quad(min + x, z, y, black);
        model.quad(min, z, x, black);
        model.quad(min + y, x, z, black);
        model.quad(min, x, y, black);
        model.quad(min + z, y, x, black);
        let strips = [
            ([-0.01, -3.0], [1.0, 3.0]),
            ([2.2, -3.0], [3.0, 3.0]),
            ([1.0, -3.0], [2.2, -0.8]),
            ([1.0, 0.8], [2.2, 3.0]),
            ([1.0, -0.8], [2.2, 0.8]),
        ];
        for ([low_y, low_z], [high_y, high_z]) in strips.into_iter().take(if pane { 5 } else { 4 }) {
            let (up, along) = (Vec3::Y * (high_y - low_y), Vec3::Z * (high_z - low_z));
            model.quad(vec3(min.x, low_y, low_z), up, along, black);
        }
        (model, floor)
    };
    let (walled, surface) = room(false);
    let (model, floor) = room(true);
    let (closed, open) = (model.bake(place, &options)?, walled.bake(place, &options)?);
    let dark = closed.texels(floor).iter().map(|texel| texel.irradiance).fold(0.0, f64::max);
    let mut glowing = Model::default();
    let (black, glow) = (glowing.material(0.0, 0.0), glowing.material(0.0, 5.0));
    let lit = glowing.quad(patch[0], patch[1], patch[2], black);
    glowing.quad(vec3(-2.0, 1.0, -0.8), Vec3::Y * 1.2, Vec3::Z * 1.6, glow);
    let glowing = glowing.bake(place, &options)?;
    let at = |check: Check| check.at(place.name);
    // C-4 for a point before a wall: heights and widths by differences.
    let seen = |at: glam::DVec3| {
        let c = at.x + 2.0;
        let corner =
            |a: f64, b: f64| ((b / c).atan() - c / a.hypot(c) * (b / a.hypot(c)).atan()) / (2.0 * PI);
        let part = |a: f64| corner(a, 0.8 - at.z) + corner(a, 0.8 + at.z);
        part(2.2 - at.y) - part(1.0 - at.y)
    };
    let (expected, found) = farthest(&glowing.texels(lit), |texel| 5.0 * PI * seen(texel.at));
    let small = "Lambert's formula, 1e-5, at the texel's own place";
    Ok(vec![
        at(Check::new(
            "window's share by the formula, against the table",
            SHARE,
            seen(glam::DVec3::ZERO),
            1e-11,
            "digits",
        )),
        at(Check::new("room without a window", 0.0, dark, 0.0, "no ray gets in")),
        at(Check::new(
            "sky through a window",
            5.0 * PI * SHARE,
            mean(&open.texels(surface)),
            bound(&options, SHARE),
            WHY,
        )),
        at(Check::new("window as a glowing polygon, worst texel", expected, found, 1e-5, small)),
    ])
}

/// CIE overcast, L = Lz (1 + 2 sin γ)/3, as an image: 7π/9 on the ground, π/6 + 4/9 on a wall before black ground.
fn overcast() -> Result<Vec<Check>> {
    const SIZE: [u32; 2] = [16, 512];
    let row = |y: u32| {
        let up = (PI * (f64::from(y) + 0.5) / f64::from(SIZE[1])).cos();
        if up > 0.0 { (1.0 + 2.0 * up) / 3.0 } else { 0.0 }
    };
    let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |_| Vec3::splat(row(y) as f32)));
    let Some(image) = SkyImage::new(SIZE, pixels.collect()) else { return Ok(Vec::new()) };
    let mut options = effort(Quality::High, 64);
    options.light.gather.tolerance = 0.0;
    let rays = f64::from(options.light.gather.rays);
    let lit = |u: Vec3, v: Vec3| -> Result<f64> {
        let mut model = Model::default();
        let black = model.material(0.0, 0.0);
        let surface = model.quad(Vec3::ZERO, u, v, black);
        let mut scene = model.scene(&Place::HERE)?;
        scene.sky = Sky::Image(image.clone());
        Ok(mean(&Baked::of(scene, Place::HERE, &options)?.texels(surface)))
    };
    // Radiance over the view deviates by 0.2 of its mean, smoothly; rows of the image are 180°/512 high.
    let smooth = 4.0 * 0.2 * rays.powf(-0.75) + 1.0 / 512.0;
    let edge = bound(&options, 0.5) + smooth;
    let (ground, wall) = (lit(Vec3::Z, Vec3::X)?, lit(Vec3::Z, Vec3::Y)?);
    let why_ground = "4 × 0.2 N^(−3/4) of a smooth sky; rows of the image";
    let why_wall = "4 standard deviations at the horizon, √(F(1 − F)) N^(−3/4); rows of the image";
    Ok(vec![
        Check::new("overcast sky on the ground", 7.0 * PI / 9.0, ground, smooth, why_ground).at("×1"),
        Check::new("overcast sky on a wall", PI / 6.0 + 4.0 / 9.0, wall, edge, why_wall).at("×1"),
    ])
}
