//! Whole bakes of closed rooms: furnaces, means, Khodulev's cube, plates, spheres.

use super::Check;
use super::cube::{KHODULEV, straight};
use super::model::{Baked, Model, Place, effort, farthest, mean};
use crate::error::Result;
use crate::options::{BakeOptions, FormFactors, Quality, Relaxation, Solver};
use glam::{Vec3, dvec3, vec3};
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
    let mut options = effort(Quality::Good, 128);
    // At every texel: interpolation has its own test.
    options.light.gather.tolerance = 0.0;
    let usual = [("progressive; auto".to_owned(), options.clone())];
    for place in Place::ALL {
        checks.extend(in_a_cube(&place, &usual)?);
        checks.push(uneven_room(&place, &options)?);
    }
    // Closed forms for all pairs cost the square of this.
    options.light.solve.patches = 600;
    checks.extend(in_a_cube(&Place::HERE, &all_ways(&options))?);
    Ok(checks)
}

/// Φ/(A(1 − ρ)): the mean of a closed room depends on nothing but its power and reflectance.
fn uneven_room(place: &Place, options: &BakeOptions) -> Result<Check> {
    let mut model = Model::default();
    let grey = model.material(0.6, 0.0);
    model.room(Vec3::ZERO, vec3(5.0, 3.0, 4.0), [grey; 6]);
    model.point(vec3(1.5, 2.0, 1.2), 10.0, 0.0);
    let baked = model.bake(place, options)?;
    let texels = baked.all();
    let area = 2.0 * (5.0 * 3.0 + 3.0 * 4.0 + 4.0 * 5.0);
    // A texel's middle stands for it: h²/8 of the curvature of 1/d² at 1 m, which is 12; over a twentieth of the room.
    let texel = area / texels.len() as f64;
    let ledger = baked.lit.light.ledger;
    let lost = (ledger.escaped.iter().sum::<f64>() / ledger.emitted.iter().sum::<f64>()).abs();
    let gather =
        4.0 * 0.5 * f64::from(options.light.gather.rays).powf(-0.625) / (texels.len() as f64 / 256.0).sqrt();
    let bound = texel * 12.0 / 8.0 / 20.0 + 0.6 * gather + (lost + options.light.solve.tolerance) / 0.4;
    let why = "direct light at the middle of texels, h²/8 near the lamp; noise of all gathers; light of the rows made or \
               lost, reflected 1/(1 − ρ) times";
    let expected = 4.0 * PI * 10.0 / (area * 0.4);
    Ok(Check::new("mean of a room with a lamp in a corner", expected, mean(&texels), bound, why)
        .at(place.name))
}

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
        let (rays, per_row) =
            (f64::from(options.light.gather.rays), f64::from(options.light.solve.rays_per_patch));
        // Light met varies by 0.3 of its mean; so do the rows.
        let gather = 4.0 * 0.3 * rays.powf(-0.625);
        let row = 4.0 * 0.3 * per_row.powf(-0.625);
        let ledger = baked.lit.light.ledger;
        let emitted: f64 = ledger.emitted.iter().sum();
        let lost = (ledger.escaped.iter().sum::<f64>() / emitted).abs();
        let texel = 10.0 * (6.0 / texels.len() as f64).sqrt();
        let whole = lost / (1.0 - rho) + options.light.solve.tolerance / (1.0 - rho);
        let bound = 0.5 * (gather / (texels.len() as f64 / 256.0).sqrt() + row / patches.sqrt())
            + whole
            + (texel / 5.0).powi(2) / 8.0;
        let why = "light of the rows made or lost, reflected 1/(1 − ρ) times; noise of all gathers and rows; direct light at \
                   the middle of texels instead of their mean, h²/8";
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
            // The nearest texel is half of one away along each axis, where indirect light changes by 1/2 over 5 m.
            let aside = 0.5 * std::f64::consts::SQRT_2 * texel / 5.0 * 0.5 / (places / 2.0).sqrt().max(1.0);
            // Patches are half as wide as they are apart: what they hold varies by h/4 of 1/2, on either side.
            let patch = 10.0 * (6.0 / patches).sqrt();
            let mesh = 0.25 * patch / 5.0 * 0.5 * rho;
            let bound = share * (gather / (places / 2.0).sqrt().max(1.0) + aside + mesh) + whole;
            let why = "noise of a gather, 4 × 0.3 N^(−5/8), over the places that are alike; the nearest texel's distance; \
                       patches of constant light, O(h); light of the rows made or lost";
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
    let mut options = effort(Quality::Good, 128);
    options.light.gather.tolerance = 0.0;
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
            // Plates are lit by 0.239 in the middle and 0.139 at corners, a deviation of 0.12: second bounces follow
            // it, which changes them by its square times F.
            let uneven = 0.12 * 0.12 * FACTOR;
            // A hit or none, at 128² texels with sequences of their own, of which a hundred count as independent.
            let noise = 4.0 * (FACTOR * (1.0 - FACTOR)).sqrt() * rays.powf(-0.75) / FACTOR / 10.0;
            let bounce = (rho * FACTOR).powi(2);
            let texels = (1.0_f64 / 60.0).powi(2);
            let case = |plate: &str| format!("two plates, ρ = {rho}: {plate}");
            let by = |check: Check| check.by(way.as_str()).at(place.name);
            let bound = texels + bounce * (noise + uneven);
            let why = "direct light exact but for the size of texels, h²; the rest is ρ²F² of it";
            checks.push(by(Check::new(case("mean of the upper"), FACTOR * b1, there, bound, why)));
            let bound = texels + noise + 0.12 * 0.12 + options.light.solve.tolerance;
            let why = "a gather's hits, 4 √(F(1 − F)) N^(−3/4), over a hundred places; light is uneven by 0.12, which counts \
                       squared";
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

/// An octahedron cut into n² triangles a side, of radius 1.
fn sphere(n: u32, radius: f32, inside: bool, above: Option<bool>) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut position, mut triangles) = (Vec::new(), Vec::new());
    for octant in 0..8 {
        let sign = vec3(
            if octant & 1 == 0 { 1.0 } else { -1.0 },
            if octant & 2 == 0 { 1.0 } else { -1.0 },
            if octant & 4 == 0 { 1.0 } else { -1.0 },
        );
        if above.is_some_and(|above| above != (octant & 4 == 0)) {
            continue;
        }
        let first = position.len() as u32;
        let mut number = vec![];
        for i in 0..=n {
            for j in 0..=n - i {
                number.push((i, j));
                let k = n - i - j;
                position.push((vec3(i as f32, j as f32, k as f32) * sign).normalize() * radius);
            }
        }
        let at = |i: u32, j: u32| first + number.iter().position(|&n| n == (i, j)).unwrap_or(0) as u32;
        let mut add = |a: u32, b: u32, c: u32| {
            let [p, q, r] = [a, b, c].map(|v| position[v as usize]);
            let outward = (q - p).cross(r - p).dot(p) > 0.0;
            triangles.push(if outward == inside { [a, c, b] } else { [a, b, c] });
        };
        for i in 0..n {
            for j in 0..n - i {
                add(at(i, j), at(i + 1, j), at(i, j + 1));
                if i + j + 1 < n {
                    add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                }
            }
        }
    }
    (position, triangles)
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
        let (position, triangles) = sphere(FACETS, 1.0, true, Some(above));
        model.mesh(&position, &triangles, material);
    }
    for (way, options) in ways {
        let baked = model.bake(place, options)?;
        let texels = baked.all();
        // Facets lie FACET²/8 of the radius inside the sphere, there and back; half of the light is reflected.
        let facets = FACET * FACET / 8.0 * 2.0 / (1.0 - 0.5);
        let rays = f64::from(options.light.gather.rays);
        let whole = facets + 4.0 * 0.6 * rays.powf(-0.625) / 10.0 + options.light.solve.tolerance;
        let why = "facets of extent h lie h²/8 inside the sphere, each way, reflected twice over; noise of a hundred gathers";
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
        let (position, triangles) = sphere(FACETS, 1.0, false, None);
        model.mesh(&position, &triangles, glowing);
        let (position, triangles) = sphere(FACETS, 2.0, true, None);
        model.mesh(&position, &triangles, grey);
        for (way, options) in ways {
            let baked = model.bake(place, options)?;
            // b = e + ρE.
            let irradiance = [(expected[0] - 1.0) / rho[0], expected[1] / rho[1]];
            // Areas of the facets are h²/4 less than the spheres', whose ratio is the factor.
            let facets = FACET * FACET / 8.0 * 2.0 / (1.0 - 0.75 * rho[1]);
            let rays = f64::from(options.light.gather.rays);
            let bound = 2.0 * facets + 4.0 * 0.6 * rays.powf(-0.625) / 10.0;
            let why = "facets of extent h: areas and heights off by h²/8 each way, reflected; noise of a hundred gathers";
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
