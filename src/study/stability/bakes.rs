//! Whole bakes of closed rooms: furnaces, means, Khodulev's cube, plates, spheres.

use super::Check;
use super::baked::{Baked, deviation, farthest, mean};
use super::cube::{KHODULEV, straight};
use super::model::{Model, Place, effort};
use crate::error::Result;
use crate::options::{BakeOptions, FormFactors, Quality, Relaxation, Solver};
use glam::{DVec3, Vec3, dvec3, vec3};
use std::f64::consts::PI;

/// Irradiance in closed form is f64 until it is stored, but for positions: 32 ulp of f32.
pub const ROUNDING: f64 = 4e-6;

/// Every solver with every method of form factors.
pub fn all_ways(options: &BakeOptions) -> Vec<(String, BakeOptions)> {
    let solvers = [
        ("progressive", Solver::Progressive, Relaxation::GaussSeidel),
        ("matrix, Gauss-Seidel", Solver::Matrix, Relaxation::GaussSeidel),
        ("matrix, over-relaxation", Solver::Matrix, Relaxation::Sor),
        ("matrix, conjugate gradients", Solver::Matrix, Relaxation::Cg),
    ];
    let methods = [
        ("rays", FormFactors::Ray),
        ("hemicube", FormFactors::Hemicube),
        ("analytic", FormFactors::Analytic),
        ("auto", FormFactors::Auto),
    ];
    let mut all = Vec::new();
    for (solver_name, solver, relaxation) in solvers {
        for (method_name, form_factors) in methods {
            let mut options = options.clone();
            options.light.solve.solver = solver;
            options.light.solve.relaxation = relaxation;
            options.light.solve.form_factors = form_factors;
            all.push((format!("{solver_name}; {method_name}"), options));
        }
    }
    all
}

/// E = π L/(1 − ρ) everywhere in a closed room whose walls all glow and reflect alike.
pub fn furnaces() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let mut bake = |rho: f64, place: &Place, way: &str, options: &BakeOptions| -> Result<()> {
        let mut model = Model::default();
        let material = model.material(rho, 1.0);
        model.room(Vec3::ZERO, vec3(3.0, 2.0, 4.0), [material; 6]);
        let baked = model.bake(place, options)?;
        // Reflectances are f32: 0.999 is 1.3e-8 more, and 1 − ρ 1.3e-5 less.
        let rho = f64::from(rho as f32);
        let expected = PI / (1.0 - rho);
        let (expected, found) = farthest(&baked.all(), |_| expected);
        // Texels in contact with a wall see it at the horizon, where the f32 normal and position decide.
        let bound = 2.0 * ROUNDING + options.light.solve.tolerance / (1.0 - rho);
        let why =
            "f32 of positions and sums, 64 ulp; the unshot share at which the solver stops, times 1/(1 − ρ)";
        checks.push(
            Check::new(format!("furnace, ρ = {rho:.3}, worst texel"), expected, found, bound, why)
                .by(way)
                .at(place.name),
        );
        Ok(())
    };
    let mut options = effort(Quality::Draft, 64);
    (options.light.solve.tolerance, options.light.solve.patches) = (1e-9, 256);
    for rho in [0.0, 0.5, 0.9, 0.99, 0.999] {
        for place in Place::ALL {
            bake(rho, &place, "", &options)?;
        }
    }
    for (way, options) in all_ways(&options) {
        bake(0.9, &Place::HERE, &way, &options)?;
        bake(0.999, &Place::HERE, &way, &options)?;
    }
    Ok(checks)
}

/// Khodulev's cube, 10 m, ρ = 2/3, 50,000 cd in the middle; and the mean of a room of another shape.
pub fn rooms() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let mut options = strict(128);
    let usual = [("progressive; auto".to_owned(), options.clone())];
    for place in Place::ALL {
        checks.extend(in_a_cube(&place, &usual)?);
        checks.extend(uneven_room(&place, &options)?);
    }
    // Closed forms for all pairs cost the square of this.
    options.light.solve.patches = 600;
    checks.extend(in_a_cube(&Place::HERE, &all_ways(&options))?);
    Ok(checks)
}

/// Rays of a gather where its noise is to be small without help from other gathers. All gathers of a bake send the same
/// directions, so that a mean over many of them errs by as much as one at the most.
const GATHER_RAYS: u32 = 1024;

/// Gathers of so many rays at every texel: interpolation has its own test.
pub fn strict(page_size: u32) -> BakeOptions {
    let mut options = effort(Quality::Good, page_size);
    (options.light.gather.tolerance, options.light.gather.rays) = (0.0, GATHER_RAYS);
    options
}

/// Noise of a gather that meets light of a deviation, 4 standard deviations: where light is met is a region of the
/// four-dimensional cube of a place and a direction, for which those of scrambled nets fall as N^(−5/8).
pub fn noise(deviation: f64) -> f64 {
    4.0 * deviation * f64::from(GATHER_RAYS).powf(-0.625)
}

/// What the direct light of a point lamp in a room misses, as a share: its sum over the middles of texels beside the
/// whole 4πI, by the closed form alone.
fn middles(baked: &Baked, lamp: DVec3, intensity: f64) -> f64 {
    let found = baked.all().into_iter().map(|texel| {
        let to = lamp - texel.at;
        let normal =
            baked.place.turn.inverse() * baked.lit.elements.normal_geometric[texel.element].as_dvec3();
        let area = texel.area / baked.place.scale.powi(2);
        area * intensity * to.dot(normal) / to.length().powi(3)
    });
    (found.sum::<f64>() / (4.0 * PI * intensity) - 1.0).abs()
}

/// The share of the light in a closed room that its rows made or lost.
fn made_or_lost(baked: &Baked) -> f64 {
    let ledger = baked.lit.light.ledger;
    let off: f64 = ledger.sampling.iter().chain(&ledger.escaped).sum();
    (off / ledger.emitted.iter().sum::<f64>()).abs()
}

/// Nothing leaves a closed room: where every ray lands on a patch, rows add up to 1.
fn escaped(baked: &Baked, room: &str) -> Check {
    let ledger = baked.lit.light.ledger;
    let share = ledger.escaped.iter().sum::<f64>() / ledger.emitted.iter().sum::<f64>();
    // A row of n weights in f32 adds up to 1 within 2⁻²⁴: of each, half an ulp; over all bounces.
    let why = "rows of rays are counts, rounded once to f32 where closed forms stand in: 2⁻²⁴ of what they sum up to, \
               times 1/(1 − ρ)";
    Check::new(format!("power that escapes from {room}"), 0.0, share, 6e-8 / (1.0 - 2.0 / 3.0), why)
}

/// Φ/(A(1 − ρ)): the mean of a closed room depends on nothing but its power and reflectance.
fn uneven_room(place: &Place, options: &BakeOptions) -> Result<Vec<Check>> {
    let mut model = Model::default();
    let grey = model.material(0.6, 0.0);
    model.room(Vec3::ZERO, vec3(5.0, 3.0, 4.0), [grey; 6]);
    model.point(vec3(1.5, 2.0, 1.2), 10.0, 0.0);
    let baked = model.bake(place, options)?;
    let texels = baked.all();
    let area = 2.0 * (5.0 * 3.0 + 3.0 * 4.0 + 4.0 * 5.0);
    let expected = 4.0 * PI * 10.0 / (area * 0.4);
    let gather = 0.6 * noise(deviation(&texels));
    let lost = (made_or_lost(&baked) + options.light.solve.tolerance) / 0.4;
    let bound = middles(&baked, dvec3(1.5, 2.0, 1.2), 10.0) / 0.4 + gather + lost;
    let why = "direct light at the middle of texels, by its closed form; noise of a gather, 4 N^(−5/8) times the \
               deviation of what all of them meet; light of the rows made or lost, reflected 1/(1 − ρ) times";
    let mean = Check::new("mean of a room with a lamp in a corner", expected, mean(&texels), bound, why);
    Ok(vec![mean.at(place.name), escaped(&baked, "a room with a lamp in a corner").at(place.name)])
}

/// Half of the range of the light in Khodulev's cube, as a share of its mean: 4207 lx in the middle of a wall; nowhere less
/// than what a corner gets straight from the lamp, 385 lx, times 1/(1 − ρ). No deviation is larger (Popoviciu).
const HALF_RANGE: f64 = (4207.21 - 384.9 / (1.0 - 2.0 / 3.0)) / 2.0 / 3141.6;
/// The largest change in the table as a share of the mean, from (0.4, 0) to (0.8, 0), over half a wall.
const SLOPE: f64 = (3798.40 - 3095.55) / 0.4 / 3141.6;

fn in_a_cube(place: &Place, ways: &[(String, BakeOptions)]) -> Result<Vec<Check>> {
    let rho = 2.0 / 3.0;
    let mut model = Model::default();
    let grey = model.material(rho, 0.0);
    let walls = model.room(Vec3::splat(-5.0), Vec3::splat(5.0), [grey; 6]);
    model.point(Vec3::ZERO, 50_000.0, 0.0);
    let mut checks = Vec::new();
    for (way, options) in ways {
        let baked = model.bake(place, options)?;
        let texels = baked.all();
        let patches = baked.lit.light.patches as f64;
        let gather = noise(HALF_RANGE);
        // What is met was reflected twice at least: rows are as noisy, averaged over those that are met.
        let row = 4.0 * HALF_RANGE * f64::from(options.light.solve.rays_per_patch).powf(-0.625) * rho;
        let lost = made_or_lost(&baked);
        let texel = 10.0 * (6.0 / texels.len() as f64).sqrt();
        let whole = lost / (1.0 - rho) + options.light.solve.tolerance / (1.0 - rho);
        let bound = rho * (gather + row / patches.sqrt())
            + whole
            + middles(&baked, DVec3::ZERO, 50_000.0) / (1.0 - rho);
        let why = "light of the rows made or lost, reflected 1/(1 − ρ) times; noise of a gather and of all rows, 4 N^(−5/8) \
                   times half of the range of what they meet; direct light at the middle of texels, by its closed form";
        let found = mean(&texels);
        let by = |check: Check| check.by(way.as_str()).at(place.name);
        checks.push(by(Check::new("mean of Khodulev's cube", 1000.0 * PI, found, bound, why)));
        for (x, y, expected) in KHODULEV {
            let mut found = Vec::new();
            for (wall, axis) in walls.into_iter().zip([0, 0, 1, 1, 2, 2]) {
                for (u, v) in [(x, y), (y, x)] {
                    for signs in 0..4 {
                        let (u, v) =
                            (if signs & 1 == 0 { u } else { -u }, if signs & 2 == 0 { v } else { -v });
                        let mut at = dvec3(0.0, 0.0, 0.0);
                        let side = if wall % 2 == 0 { -5.0 } else { 5.0 };
                        (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (side, 5.0 * u, 5.0 * v);
                        if let Some(texel) = baked.nearest(wall, at) {
                            found.push((texel.element, f64::from(baked.lit.indirect[texel.element].mean())));
                        }
                    }
                }
            }
            found.sort_by_key(|found| found.0);
            found.dedup_by_key(|found| found.0);
            let places = found.len() as f64;
            let indirect = found.iter().map(|found| found.1).sum::<f64>() / places;
            let share = (expected - straight(x, y)) / expected;
            // The nearest texel is half of one away along each axis.
            let aside = 0.5 * std::f64::consts::SQRT_2 * texel / 5.0 * SLOPE;
            // What a patch holds differs from what is there by h/4 of the slope, on average over it.
            let patch = 10.0 * (6.0 / patches).sqrt();
            let mesh = 0.25 * patch / 5.0 * SLOPE * rho;
            let bound = share * (gather + row / patches.sqrt() + aside + mesh) + whole;
            let why = "noise of a gather, 4 N^(−5/8) times half of the range of what it meets; the nearest texel's distance and \
                       patches of constant light, O(h), times the largest slope of the table; light of the rows made or \
                       lost";
            let case = format!("Khodulev's cube at ({x}, {y})");
            checks.push(by(Check::new(case, expected, straight(x, y) + indirect, bound, why)));
        }
    }
    Ok(checks)
}

/// Two plates of which one glows: what comes back to it goes there and back by form factors alone. A sphere seen from
/// inside; one sphere in another.
pub fn bodies() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let mut options = strict(128);
    let usual = [("progressive; auto".to_owned(), options.clone())];
    for place in Place::ALL {
        checks.extend(plates(&place, &usual)?);
        checks.extend(inside_a_sphere(&place, &usual)?);
        checks.extend(shells(&place, &usual)?);
    }
    // Closed forms for all pairs cost the square of this.
    options.light.solve.patches = 600;
    checks.extend(plates(&Place::HERE, &all_ways(&options))?);
    checks.extend(inside_a_sphere(&Place::HERE, &all_ways(&options))?);
    Ok(checks)
}

fn plates(place: &Place, ways: &[(String, BakeOptions)]) -> Result<Vec<Check>> {
    const FACTOR: f64 = 0.199824895698387;
    let mut checks = Vec::new();
    for rho in [0.5, 0.8] {
        let mut model = Model::default();
        let (glowing, grey) = (model.material(rho, 1.0 / PI), model.material(rho, 0.0));
        let lower = model.quad(Vec3::ZERO, Vec3::Z, Vec3::X, glowing);
        let upper = model.quad(Vec3::Y, Vec3::X, Vec3::Z, grey);
        for (way, options) in ways {
            let baked = model.bake(place, options)?;
            let b1 = 1.0 / (1.0 - (rho * FACTOR).powi(2));
            let (there, back) = (mean(&baked.texels(upper)), mean(&baked.texels(lower)));
            let rays = f64::from(options.light.gather.rays);
            // A point sees 0.239 of the other plate from the middle and 0.139 from a corner: a deviation of a quarter
            // of the mean at most (Popoviciu). What comes back goes by the same factors, so the mean of their product
            // is more than the product of their means by the square of it.
            let uneven = ((0.2394 - 0.1385) / 2.0 / FACTOR).powi(2);
            // A hit or none: the region of a square with an edge, for which scrambled nets fall as N^(−3/4).
            let noise = 4.0 * (FACTOR * (1.0 - FACTOR)).sqrt() * rays.powf(-0.75) / FACTOR;
            let bounce = (rho * FACTOR).powi(2);
            // A texel's middle stands for it: h²/24 of a curvature of at most 6 along each axis (of 1/d⁴ at 1).
            let texels = 0.5 / baked.texels(upper).len() as f64;
            let case = |plate: &str| format!("two plates, ρ = {rho}: {plate}");
            let by = |check: Check| check.by(way.as_str()).at(place.name);
            let bound = texels + bounce * (noise + uneven);
            let why = "direct light exact but for the size of texels, h²/2; the rest is ρ²F² of it";
            checks.push(by(Check::new(case("mean of the upper"), FACTOR * b1, there, bound, why)));
            let bound = texels + noise + uneven + options.light.solve.tolerance;
            let why = "a gather's hits, 4 √(F(1 − F)) N^(−3/4); light is uneven by a quarter at most, which counts squared";
            checks.push(by(Check::new(
                case("mean of the lower"),
                FACTOR * rho * FACTOR * b1,
                back,
                bound,
                why,
            )));
        }
    }
    Ok(checks)
}

/// Facets along an octant's edge; each is this many radians across.
const FACETS: u32 = 6;
const FACET: f64 = 0.27;

/// E = H = mean e/(1 − mean ρ) plus what the closed form of emission brings straight: b = e + ρH. Halves of ρ 0.8 and
/// 0.2, the upper with e = 1: H = 1.
fn inside_a_sphere(place: &Place, ways: &[(String, BakeOptions)]) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let mut model = Model::default();
    let (bright, dim) = (model.material(0.8, 1.0 / PI), model.material(0.2, 0.0));
    for (above, material) in [(true, bright), (false, dim)] {
        model.sphere(FACETS, 1.0, true, Some(above), material);
    }
    for (way, options) in ways {
        let baked = model.bake(place, options)?;
        let texels = baked.all();
        // Facets lie FACET²/8 of the radius inside the sphere, there and back; half of the light is reflected.
        let facets = FACET * FACET / 8.0 * 2.0 / (1.0 - 0.5);
        // Halves of radiosity 1.8 and 0.2.
        let whole = facets + noise(0.8) + options.light.solve.tolerance;
        let why = "facets of extent h lie h²/8 inside the sphere, each way, reflected twice over; noise of a gather, 4 N^(−5/8) \
                   times half of the range of what it meets";
        let by = |check: Check| check.by(way.as_str()).at(place.name);
        checks.push(by(Check::new(
            "inside of a sphere, unequal halves: mean",
            1.0,
            mean(&texels),
            whole,
            why,
        )));
        for (half, name) in [(0, "bright"), (1, "dim")] {
            let bound = whole + facets;
            let case = format!("inside of a sphere, unequal halves: mean of the {name} one");
            checks.push(by(Check::new(case, 1.0, mean(&baked.texels(half)), bound, why)));
        }
    }
    Ok(checks)
}

/// F₁₂ = 1, F₂₁ = ¼, F₂₂ = ¾ for radii 1 and 2: the inner one glows.
fn shells(place: &Place, ways: &[(String, BakeOptions)]) -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for (rho, expected) in [([0.5, 0.5], [1.1111111, 0.2222222]), ([0.8, 0.3], [1.08391608, 0.10489510])] {
        let mut model = Model::default();
        let (glowing, grey) = (model.material(rho[0], 1.0 / PI), model.material(rho[1], 0.0));
        model.sphere(FACETS, 1.0, false, None, glowing);
        model.sphere(FACETS, 2.0, true, None, grey);
        for (way, options) in ways {
            let baked = model.bake(place, options)?;
            // b = e + ρE.
            let irradiance = [(expected[0] - 1.0) / rho[0], expected[1] / rho[1]];
            // Areas of the facets are h²/4 less than the spheres', whose ratio is the factor.
            let facets = FACET * FACET / 8.0 * 2.0 / (1.0 - 0.75 * rho[1]);
            let half_range = (expected[0] - expected[1]) / 2.0 / irradiance[1];
            let bound = 2.0 * facets + noise(half_range);
            let why = "facets of extent h: areas and heights off by h²/8 each way, reflected; noise of a gather, 4 N^(−5/8) times \
                       half of the range of what it meets";
            for (sphere, name) in [(0, "inner"), (1, "outer")] {
                let case =
                    format!("spheres of radius 1 and 2, ρ = {} and {}: E of the {name} one", rho[0], rho[1]);
                let found = mean(&baked.texels(sphere));
                checks.push(
                    Check::new(case, irradiance[sphere], found, bound, why).by(way.as_str()).at(place.name),
                );
            }
        }
    }
    Ok(checks)
}

/// Whether all that a bake holds is finite and not negative.
pub fn lawful(baked: &Baked) -> bool {
    let all = baked.lit.direct.iter().chain(&baked.lit.indirect);
    all.into_iter().all(|irradiance| irradiance.0.is_finite() && irradiance.0.min_element() >= 0.0)
}
