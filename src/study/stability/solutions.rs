//! Solvers on their own: patches with known form factors and a known answer.

use super::Check;
use super::factors::FINE;
use super::way::Way;
use super::world::{Method, Numbers, World, add_sphere, cube, grey, parallel, ring};
use crate::error::Result;
use crate::solve::{Made, Problem, Rows, Solution};
use crate::transport::form_factors::Row;
use glam::{DVec3, dvec3};
use rayon::prelude::*;

/// Radiosity of a solution, one channel of the patch that is farthest from what is expected.
fn worst(found: &[DVec3], expected: DVec3) -> (f64, f64) {
    let channels = found.iter().flat_map(|b| (0..3).map(move |c| (b[c], expected[c])));
    let off = |pair: &(f64, f64)| (pair.0 - pair.1).abs() / pair.1.abs().max(f64::MIN_POSITIVE);
    channels.max_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or((f64::NAN, 0.0))
}

/// By every way, in parallel.
pub fn by_all_ways(solve: impl Fn(Way) -> Result<Vec<Check>> + Sync) -> Result<Vec<Check>> {
    let all: Result<Vec<Vec<Check>>> = Way::ALL
        .into_par_iter()
        .map(|way| {
            Ok(solve(way)?
                .into_iter()
                .map(|check| {
                    let way = if check.way.is_empty() {
                        way.name().to_owned()
                    } else {
                        format!("{}; {}", way.name(), check.way)
                    };
                    Check { way, ..check }
                })
                .collect())
        })
        .collect();
    Ok(all?.concat())
}

/// b = e/(1 − ρ), everywhere; with areas from 10⁻⁶ to 10¹² m² and light of 10⁸.
pub fn furnaces() -> Result<Vec<Check>> {
    by_all_ways(|way| {
        let mut checks = Vec::new();
        for rho in [0.0, 0.5, 0.8, 0.9, 0.99, 0.999] {
            for (area, light, place) in
                [(1e-6, 1.0, "mm"), (2.0, 1.0, "m"), (1e12, 1.0, "1000 km"), (2.0, 1e8, "m, light of 1e8")]
            {
                let emitted = dvec3(1.0, 0.0, 4.0) * light;
                let problem =
                    Problem::new(vec![area; 24], vec![grey(rho); 24], vec![emitted; 24], ring(24)?)?;
                let (found, expected) = worst(&way.solve(&problem)?.radiosity, emitted / (1.0 - rho));
                let why = "an unshot share of 1e-12 grows by 1/(1 − ρ); f64 adds its rounding as often";
                let bound = 2e-12 / (1.0 - rho);
                checks.push(Check::new(format!("furnace, ρ = {rho}"), expected, found, bound, why).at(place));
            }
        }
        Ok(checks)
    })
}

/// Two unit squares at distance 1, b₁ = 1/(1 − ρ²F²), b₂ = ρFb₁, also at ρ = 1; the six faces of a cube.
pub fn plates() -> Result<Vec<Check>> {
    let places = [(1e-3, "×1e-3"), (1.0, "×1"), (1e6, "×1e6")];
    let mut checks = Vec::new();
    for (method, (scale, place)) in FINE.into_iter().flat_map(|method| places.map(|place| (method, place))) {
        let (facing, faces) = (parallel(scale, scale, scale, [0.0; 2]), cube(1, scale));
        let rows = [method.rows(&facing)?, method.rows(&faces)?];
        let of_way = |way: Way| {
            let found =
                [two_plates(way, method, &facing, &rows[0])?, six_faces(way, method, &faces, &rows[1])?];
            Ok(found.concat().into_iter().map(|check| check.by(method.name()).at(place)).collect())
        };
        checks.extend(by_all_ways(of_way)?);
    }
    Ok(checks)
}

fn two_plates(way: Way, method: Method, world: &World, rows: &Rows) -> Result<Vec<Check>> {
    const FACTOR: f64 = 0.199824895698387;
    // Rows are kept in f32.
    let relative = method.error(world, 0, 1, FACTOR) / FACTOR + 6e-8;
    let mut checks = Vec::new();
    for (rho, b1, b2) in [
        (0.5, 1.01008315227, 0.100919880275),
        (0.8, 1.02622538777, 0.164052304859),
        (1.0, 1.04159070535, 1.04159070535 * FACTOR),
    ] {
        let source = vec![grey(1.0), grey(0.0)];
        let problem = Problem::new(world.area(), vec![grey(rho); 2], source, rows.clone())?;
        let b = way.solve(&problem)?.radiosity;
        let why = |what: &str| format!("{}; {what}", method.why());
        let bounce = rho * rho * FACTOR * FACTOR / (1.0 - rho * rho * FACTOR * FACTOR);
        let first = why("the plate's own light comes back by F², off twice as much; digits of the table");
        let second = why("b₂ is off as F is and as b₁; rows in f32; digits of the table");
        let bound = 2.0 * relative * bounce + 1e-11;
        checks.push(Check::new(format!("first plate, ρ = {rho}"), b1, b[0].x, bound, first));
        let bound = relative * (1.0 + 2.0 * bounce) + 1e-11;
        checks.push(Check::new(format!("second plate, ρ = {rho}"), b2, b[1].x, bound, second));
    }
    Ok(checks)
}

fn six_faces(way: Way, method: Method, world: &World, rows: &Rows) -> Result<Vec<Check>> {
    let relative = method.error(world, 0, 2, 0.2) / 0.2 + 6e-8;
    let mut checks = Vec::new();
    for (rho, expected) in [
        (0.5, [1.09090909811, 0.181745826108, 0.181836268946]),
        (0.8, [1.55172415364, 0.689551070738, 0.689681193904]),
    ] {
        let mut source = vec![grey(0.0); 6];
        source[0] = grey(1.0);
        let problem = Problem::new(world.area(), vec![grey(rho); 6], source, rows.clone())?;
        let b = way.solve(&problem)?.radiosity;
        for (face, expected) in [(0, expected[0]), (1, expected[1]), (3, expected[2])] {
            let why = format!(
                "{}; what arrives is off as its factors are, reflected 1/(1 − ρ) times",
                method.why()
            );
            let case = format!("cube of six patches, face {face}, ρ = {rho}");
            checks.push(Check::new(case, expected, b[face].x, relative / (1.0 - rho), why));
        }
    }
    Ok(checks)
}

/// Concentric spheres; the mean of any closed room; areas of 1 : 10⁸ with an emitter of 10⁸; darkness.
pub fn shells() -> Result<Vec<Check>> {
    by_all_ways(|way| {
        let mut checks = Vec::new();
        for (outer, source, rho, expected) in [
            (2.0, [1.0, 0.0], [0.5, 0.5], [1.1111111111, 0.2222222222]),
            (2.0, [1.0, 0.0], [0.8, 0.3], [1.08391608, 0.10489510]),
            (10.0, [0.0, 1.0], [0.5, 0.9], [4.78468900, 9.56937799]),
        ] {
            // F₁₂ = 1, F₂₁ = (r₁/r₂)², F₂₂ = 1 − F₂₁.
            let back = 1.0 / outer / outer;
            let make = |patch: usize, row: &mut Row| {
                let factors: &[(u32, f64)] =
                    if patch == 0 { &[(1, 1.0)] } else { &[(0, back), (1, 1.0 - back)] };
                (row.column, row.weight) = factors.iter().copied().unzip();
                row.miss = 0.0;
            };
            let area = vec![1.0, outer * outer];
            let (rho, source) = (rho.map(grey).to_vec(), source.map(grey).to_vec());
            let b = way.solve(&Problem::new(area, rho.clone(), source, Made::new(2, make))?)?.radiosity;
            for i in 0..2 {
                // The table's digits, and 2⁻²⁴ of an f32 row, reflected 1/(1 − ρ) times.
                let bound = 5e-9 / expected[i] + 6e-8 / (1.0 - rho[1].x);
                let case = format!(
                    "spheres of radius 1 and {outer}, ρ = {} and {}: sphere {}",
                    rho[0].x,
                    rho[1].x,
                    i + 1
                );
                let why = "digits of the table; rows are kept in f32, reflected 1/(1 − ρ) times";
                checks.push(Check::new(case, expected[i], b[i].x, bound, why));
            }
        }
        // Planes without end see nothing but each other.
        for (rho, expected) in [(0.8, [2.7777777778, 2.2222222222]), (0.99, [50.2512562814, 49.7487437186])] {
            let make = |patch: usize, row: &mut Row| {
                (row.column, row.weight, row.miss) = (vec![1 - patch as u32], vec![1.0], 0.0);
            };
            let source = vec![grey(1.0), grey(0.0)];
            let problem = Problem::new(vec![1.0; 2], vec![grey(rho); 2], source, Made::new(2, make))?;
            let b = way.solve(&problem)?.radiosity;
            for i in 0..2 {
                let case = format!("planes without end, ρ = {rho}: plane {}", i + 1);
                let why = "an unshot share of 1e-12 grows by 1/(1 − ρ); digits of the table";
                let bound = 2e-12 / (1.0 - rho) + 5e-11;
                checks.push(Check::new(case, expected[i], b[i].x, bound, why));
            }
        }
        let mut numbers = Numbers(5);
        let source: Vec<_> = (0..40).map(|_| numbers.colour()).collect();
        let mean = source.iter().sum::<DVec3>() / 40.0;
        let problem = Problem::new(vec![0.5; 40], vec![grey(0.8); 40], source, ring(40)?)?;
        let found = way.solve(&problem)?.radiosity.iter().sum::<DVec3>() / 40.0;
        let why = "an unshot share of 1e-12 grows by 1/(1 − ρ)";
        let case = "mean of a closed room of ρ = 0.8, any sources";
        checks.push(Check::new(case, mean.y / 0.2, found.y, 2e-11, why));
        checks.extend(extremes(way)?);
        Ok(checks)
    })
}

fn extremes(way: Way) -> Result<Vec<Check>> {
    let make = |patch: usize, row: &mut Row| {
        row.column = vec![1 - patch as u32];
        row.weight = vec![if patch == 0 { 1.0 } else { 1e-8 }];
        row.miss = 1.0 - row.weight[0];
    };
    let problem = Problem::new(
        vec![1e-8, 1.0],
        vec![grey(0.999), grey(0.999)],
        vec![grey(1e8), grey(0.0)],
        Made::new(2, make),
    )?;
    let solution = way.solve(&problem)?;
    let b1 = 1e8 / (1.0 - 0.999 * 0.999 * 1e-8);
    let f32_rows = "rows are kept in f32, 2⁻²⁴";
    let dark = Problem::new(vec![1.0; 8], vec![grey(0.9); 8], vec![grey(0.0); 8], ring(8)?)?;
    let dark = way.solve(&dark)?;
    let most =
        |solution: &Solution| solution.radiosity.iter().map(|b| b.abs().max_element()).fold(0.0, f64::max);
    Ok(vec![
        Check::new(
            "emitter of 1e8, areas of 1e-8 : 1, ρ = 0.999: emitter",
            b1,
            solution.radiosity[0].x,
            1e-12,
            "f64",
        ),
        Check::new("the same: receiver", 0.999 * 1e-8 * b1, solution.radiosity[1].x, 6e-8, f32_rows),
        Check::new("the same: imbalance of the ledger", 0.0, solution.ledger.imbalance(), 1e-5, "demanded"),
        Check::new("no light", 0.0, most(&dark), 0.0, "nothing times anything"),
    ])
}

/// Inside a sphere every patch receives the same, H = mean(s)/(1 − mean ρ), whatever is where: b = s + ρH.
pub fn integrating_spheres() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for (n, across) in [(3, 0.55), (6, 0.27)] {
        let mut world = World::default();
        add_sphere(&mut world, 1.0, n, true);
        let area = world.area();
        let total: f64 = area.iter().sum();
        let upper = |i: usize| world.polygons[i].corners().iter().sum::<DVec3>().z > 0.0;
        let pick = |above: DVec3, below: DVec3| -> Vec<DVec3> {
            (0..world.len()).map(|i| if upper(i) { above } else { below }).collect()
        };
        let rho = pick(dvec3(0.8, 0.9, 0.0), dvec3(0.2, 0.5, 0.0));
        let source = pick(dvec3(1.0, 0.0, 1.0), dvec3(0.0, 1.0, 1.0));
        for method in [Method::Rays(256), Method::Hemicube { resolution: 16, points: 1 }, Method::Analytic] {
            if matches!(method, Method::Analytic) && n > 3 {
                continue;
            }
            let rows = method.rows(&world)?;
            checks.extend(by_all_ways(|way| {
                let problem = Problem::new(area.clone(), rho.clone(), source.clone(), rows.clone())?;
                let received = way.solve(&problem)?.received;
                let mean = received.iter().zip(&area).map(|(e, a)| *e * (a / total)).sum::<DVec3>();
                let expected = dvec3(1.0, 5.0 / 3.0, 1.0);
                // Facets cover h²/8 less of the radius than the sphere; half the light is reflected on average.
                let bound = across * across / 8.0 * 2.0 / (1.0 - 0.7);
                let why = "facets of extent h lie h²/8 of the radius inside the sphere, each way, reflected 1/(1 − ρ) times";
                Ok((0..2)
                    .map(|c| {
                        let case = ["halves of ρ 0.8 and 0.2, upper shines", "halves of ρ 0.9 and 0.5, lower shines"][c];
                        let case = format!("integrating sphere, {case}: mean irradiance");
                        Check::new(case, expected[c], mean[c], bound, why).by(format!("{}, {} facets", method.name(), world.len())).at("×1")
                    })
                    .collect())
            })?);
        }
    }
    Ok(checks)
}
