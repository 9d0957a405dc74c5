//! Every light path against its closed form, through the same line as a bake.
//!
//! Expected values are evaluated at the very position of the element that is compared, so no tolerance hides the
//! size of a texel.

mod common;

use common::{Builder, at, close, mean, nearest, of_surface};
use glam::Vec3;
use lightkiln::options::Quality;
use lightkiln::scene::{Cone, LampKind, SpotFalloff};
use lightkiln::units::Intensity;
use std::f32::consts::PI;

/// f32 rounding of positions and of the formula: 32 ulp.
const ROUNDING: f32 = 4e-6;

/// A black floor, 4 × 4 m around the origin, facing up.
fn floor(b: &mut Builder) -> usize {
    let black = b.material(0.0, 0.0);
    b.quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, black)
}

#[test]
fn point_lamp_over_a_floor() {
    let mut b = Builder::new();
    let f = floor(&mut b);
    b.point(Vec3::Y, 1.0);
    let lit = b.light(Quality::Draft, 64);
    // I = 1, h = 1: 1, 0.3536, 0.0894 at x = 0, 1, 2.
    for x in [0.0, 1.0, 1.9] {
        let e = nearest(&lit, f, Vec3::new(x, 0.0, 0.0));
        let d2 = lit.elements.position_world[e].distance_squared(Vec3::Y);
        close(lit.irradiance(e).mean(), d2.powf(-1.5), ROUNDING, "I cosθ/d²");
    }
}

#[test]
fn spot_lamps_follow_their_cones() {
    let (inner_rad, outer_rad) = (0.3, 0.6);
    for falloff in [SpotFalloff::Blender, SpotFalloff::Gltf] {
        let mut b = Builder::new();
        let f = floor(&mut b);
        b.lamp(LampKind::Point {
            position_world: Vec3::Y * 2.0,
            intensity: Intensity::grey(5.0),
            range_m: None,
            radius_m: 0.0,
            soft_falloff: false,
            cone: Some(Cone { direction_world: Vec3::NEG_Y, inner_rad, outer_rad, falloff }),
        });
        let lit = b.light(Quality::Draft, 128);
        for e in of_surface(&lit, f) {
            let to = Vec3::Y * 2.0 - lit.elements.position_world[e];
            let cosine = to.y / to.length();
            let share = match falloff {
                SpotFalloff::Blender => {
                    let blend = 1.0 - inner_rad / outer_rad;
                    let t = ((cosine - outer_rad.cos()) / ((1.0 - outer_rad.cos()) * blend)).clamp(0.0, 1.0);
                    t * t * (3.0 - 2.0 * t)
                }
                SpotFalloff::Gltf => {
                    ((cosine - outer_rad.cos()) / (inner_rad.cos() - outer_rad.cos())).clamp(0.0, 1.0).powi(2)
                }
            };
            let expected = 5.0 * cosine / to.length_squared() * share;
            let error = (lit.irradiance(e).mean() - expected).abs();
            // The ramp multiplies rounding of the cosine by at most its slope, about 20 here.
            assert!(error <= 20.0 * ROUNDING * 5.0 / 4.0, "{falloff:?}: {error}");
        }
    }
}

#[test]
fn soft_falloff_is_that_of_a_disc_which_faces_the_receiver() {
    // A disc of radius r and uniform radiance that faces a point at distance d gives it πL r²/(d² + r²) head on, and
    // I = πr²L; tilting the receiver scales that by cosθ as long as the whole disc stands above it.
    let mut b = Builder::new();
    let f = floor(&mut b);
    let (position_world, radius_m) = (Vec3::new(0.2, 0.8, -0.1), 0.5_f32);
    let intensity = Intensity::grey(5.0);
    b.lamp(LampKind::Point {
        position_world,
        intensity,
        range_m: None,
        radius_m,
        soft_falloff: true,
        cone: None,
    });
    let lit = b.light(Quality::Draft, 64);
    for e in of_surface(&lit, f) {
        let to = position_world - lit.elements.position_world[e];
        let expected = 5.0 * to.normalize().y / (to.length_squared() + radius_m * radius_m);
        close(lit.irradiance(e).mean(), expected, ROUNDING, "I cosθ/(d² + r²)");
    }
}

#[test]
fn sun_on_a_tilted_plane() {
    let mut b = Builder::new();
    let f = floor(&mut b);
    b.sun(Vec3::new(1.0, 2.0, 0.5), 3.0, 0.0);
    let lit = b.light(Quality::Draft, 64);
    let expected = 3.0 * 2.0 / (1.0_f32 + 4.0 + 0.25).sqrt();
    for e in of_surface(&lit, f) {
        close(lit.irradiance(e).mean(), expected, ROUNDING, "S cosθ");
    }
}

#[test]
fn soft_sun_has_the_same_energy_and_a_penumbra_of_the_right_shape() {
    // A long wall 1 m above the floor ends at x = 0; behind it the sun's disc is cut by a straight edge.
    let mut b = Builder::new();
    let f = floor(&mut b);
    let black = b.material(0.0, 0.0);
    b.quad(Vec3::new(-40.0, 1.0, -40.0), Vec3::Z * 80.0, Vec3::X * 40.0, black);
    let angle = 0.4_f32;
    b.sun(Vec3::Y, 1.0, angle);
    let lit = b.light(Quality::High, 128);
    for x in [-0.15_f32, -0.1, 0.0, 0.1, 0.15] {
        let e = nearest(&lit, f, Vec3::new(x, 0.0, 0.0));
        // Directions are spread over the projected disc: the visible share is that of a disc cut at t.
        let at = lit.elements.position_world[e].x;
        let t = -(at / (1.0 + at * at).sqrt()) / (angle / 2.0).sin();
        let share = if t.abs() < 1.0 {
            (t.acos() - t * (1.0 - t * t).sqrt()) / PI
        } else if t < 0.0 {
            1.0
        } else {
            0.0
        };
        // 128 stratified points err by about N^-3/4 = 0.026 of the disc at a straight edge; nine sets are averaged.
        assert!(
            (lit.irradiance(e).mean() - share).abs() < 0.026,
            "at {at}: {} {share}",
            lit.irradiance(e).mean()
        );
    }
}

#[test]
fn uniform_sky_over_an_open_floor() {
    let mut b = Builder::new();
    let f = floor(&mut b);
    b.sky(2.0);
    let lit = b.light(Quality::Draft, 64);
    for e in of_surface(&lit, f) {
        close(lit.irradiance(e).mean(), 2.0 * PI, ROUNDING, "πL");
    }
}

#[test]
fn half_of_the_sky_beside_a_long_wall() {
    let mut b = Builder::new();
    let black = b.material(0.0, 0.0);
    b.sky(1.0);
    let wall = b.quad(Vec3::new(-500.0, 0.0, 0.0), Vec3::X * 1000.0, Vec3::Y * 3.0, black);
    b.quad(Vec3::new(-500.0, 0.0, 0.0), Vec3::Z * 1000.0, Vec3::X * 1000.0, black);
    let lit = b.light(Quality::High, 64);
    // A vertical wall on a black floor sees half of the sky, weighted by the cosine: π/2.
    let e = at(&lit, wall, Vec3::new(0.0, 1.5, 0.0)).mean();
    // 1024 quasi-random rays across a straight horizon: error about N^-3/4 of the hemisphere, 0.6 %.
    close(e, PI / 2.0, 0.006, "π/2 L");
}

#[test]
fn rectangular_emitter_over_a_floor() {
    let mut b = Builder::new();
    let f = floor(&mut b);
    let lamp = b.material(0.0, 1.0);
    // Unit square, 1 m above the floor, shining down.
    b.quad(Vec3::new(-0.5, 1.0, -0.5), Vec3::X, Vec3::Z, lamp);
    let lit = b.light(Quality::Draft, 128);
    for e in of_surface(&lit, f) {
        let p = lit.elements.position_world[e];
        close(lit.irradiance(e).mean(), rectangle_above(p), 1e-5, "Lambert's formula");
    }
    // Independent digits from the table: 0.752274688454 under the centre.
    close(rectangle_above(Vec3::ZERO), 0.752_274_7, ROUNDING, "the reference itself");
}

/// E/L under the unit square at height 1 by adding four corner rectangles (the corner formula of Howell's C-4).
fn rectangle_above(p: Vec3) -> f32 {
    let corner = |a: f64, b: f64| {
        let (p, q) = (a / (1.0 + a * a).sqrt(), b / (1.0 + b * b).sqrt());
        0.5 * (p * (b / (1.0 + a * a).sqrt()).atan() + q * (a / (1.0 + b * b).sqrt()).atan())
    };
    let (x0, x1) = (f64::from(-0.5 - p.x), f64::from(0.5 - p.x));
    let (z0, z1) = (f64::from(-0.5 - p.z), f64::from(0.5 - p.z));
    (corner(x1, z1) - corner(x0, z1) - corner(x1, z0) + corner(x0, z0)) as f32
}

#[test]
fn white_furnace() {
    for (reflectance, tolerance) in [(0.0, 1e-4), (0.5, 2e-3), (0.9, 5e-3)] {
        let mut b = Builder::new();
        let m = b.material(reflectance, 1.0);
        let walls = b.room(Vec3::ZERO, Vec3::new(3.0, 2.0, 4.0), [m; 6]);
        let lit = b.light(Quality::Good, 128);
        // Everything has radiosity π/(1−ρ); E = that. Sources: the direct light is exact up to the probes' closed
        // form at touching edges; the reflected part converges to the solver's tolerance divided by 1−ρ.
        let expected = PI / (1.0 - reflectance);
        for wall in walls {
            for e in of_surface(&lit, wall) {
                close(lit.irradiance(e).mean(), expected, tolerance, "furnace");
            }
        }
    }
}

#[test]
fn mean_irradiance_of_a_closed_room_depends_on_nothing_but_its_reflectance() {
    let mut b = Builder::new();
    let grey = b.material(0.6, 0.0);
    let size = Vec3::new(5.0, 3.0, 4.0);
    b.room(Vec3::ZERO, size, [grey; 6]);
    b.point(Vec3::new(1.5, 2.0, 1.2), 10.0);
    let lit = b.light(Quality::Good, 256);
    let area = 2.0 * (5.0 * 3.0 + 3.0 * 4.0 + 4.0 * 5.0);
    let expected = 4.0 * PI * 10.0 / (area * (1.0 - 0.6));
    // Midpoint sums over texels of a 1/d² peak, and 64 rays a row: a few tenths of a percent.
    close(mean(&lit) as f32, expected, 5e-3, "Φ/(A(1−ρ))");
}

#[test]
fn two_facing_plates() {
    // Unit squares at distance 1; F = 0.199824895698. Mean irradiance of each is F times the other's radiosity.
    let factor = 0.199_824_9;
    for rho in [0.5_f32, 0.8] {
        let mut b = Builder::new();
        let (glowing, grey) = (b.material(rho, 1.0 / PI), b.material(rho, 0.0));
        let lower = b.quad(Vec3::ZERO, Vec3::Z, Vec3::X, glowing);
        let upper = b.quad(Vec3::Y, Vec3::X, Vec3::Z, grey);
        let lit = b.light(Quality::High, 128);
        let mean = |surface| {
            let (mut sum, mut area) = (0.0, 0.0);
            for e in of_surface(&lit, surface) {
                sum += lit.irradiance(e).mean() * lit.elements.area[e].0;
                area += lit.elements.area[e].0;
            }
            sum / area
        };
        // Two-patch solution: the radiosity of a plate is not quite even, which changes its second bounce by less
        // than the square of the unevenness times F²ρ²; 0.5 % covers it and the sampling.
        let b1 = 1.0 / (1.0 - (rho * factor).powi(2));
        close(mean(upper), factor * b1, 5e-3, "upper plate");
        close(mean(lower), factor * rho * factor * b1, 1.5e-2, "lower plate");
    }
}

#[test]
fn a_sealed_neighbour_room_stays_black() {
    let mut b = Builder::new();
    let grey = b.material(0.7, 0.0);
    b.room(Vec3::ZERO, Vec3::splat(3.0), [grey; 6]);
    let dark = b.room(Vec3::new(3.001, 0.0, 0.0), Vec3::new(6.0, 3.0, 3.0), [grey; 6]);
    b.point(Vec3::splat(1.5), 100.0);
    let lit = b.light(Quality::Draft, 256);
    for wall in dark {
        for e in of_surface(&lit, wall) {
            assert_eq!(lit.irradiance(e).mean(), 0.0, "light leaks through a wall 1 mm thick");
        }
    }
}
