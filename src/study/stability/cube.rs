//! Khodulev's cube, solvers alone: a point light in a closed room, whose light is known from elsewhere.

use super::Check;
use super::solutions::by_all_ways;
use super::way::Way;
use super::world::{Method, World, cube, grey};
use crate::error::Result;
use crate::solve::{Made, Problem, Rows};
use crate::transport::form_factors::Row;
use crate::transport::form_factors::area::{Polygon, polygon_row};
use glam::DVec3;
use std::collections::BTreeSet;
use std::f64::consts::PI;

/// Khodulev's cube: 10 m, ρ = 2/3, a lamp of 50,000 cd in the middle. Total illuminance at face coordinates, by
/// collocation and extrapolation to ± 0.01 lx.
pub const KHODULEV: [(f64, f64, f64); 6] = [
    (0.0, 0.0, 4207.21),
    (0.4, 0.0, 3798.40),
    (0.4, 0.4, 3494.72),
    (0.8, 0.0, 3095.55),
    (0.8, 0.4, 2920.36),
    (0.8, 0.8, 2514.77),
];

/// Total illuminance where it is known, and the mean, which is 1000 π exactly.
pub fn khodulev() -> Result<Vec<Check>> {
    // Centres of 5 × 5 and of 15 × 15 cells lie at 0, ±0.4 and ±0.8.
    let coarse = Cube::new(Method::Analytic, 5, 1.0)?;
    let fine = Cube::new(Method::Analytic, 15, 1.0)?;
    let [coarser, finer] = [coarse.light(Way::Sweeps)?, fine.light(Way::Sweeps)?];
    // Patches of constant light err by O(h) at worst, near edges; then e₁₅ ≤ (e₅ − e₁₅)/(3 − 1).
    let mesh: Vec<f64> = coarser.at.iter().zip(&finer.at).map(|(a, b)| (a - b).abs() / 2.0).collect();
    let mut checks = by_all_ways(|way| fine.checks(way, &mesh, "×1"))?;
    for (scale, place) in [(1e-3, "×1e-3"), (1.0, "×1"), (1e6, "×1e6")] {
        for method in [Method::Rays(256), Method::Hemicube { resolution: 32, points: 1 }] {
            let cube = Cube::new(method, 15, scale)?;
            checks.extend(by_all_ways(|way| cube.checks(way, &mesh, place))?);
        }
    }
    Ok(checks)
}

/// Khodulev's cube in patches.
struct Cube {
    method: Method,
    n: u32,
    world: World,
    rows: Rows,
    /// Illuminance straight from the lamp, by patch.
    direct: Vec<f64>,
}

/// What is asked of it.
struct Lit {
    mean: f64,
    /// Total illuminance where it is known.
    at: Vec<f64>,
    /// Patches that each of these is the mean of.
    places: Vec<usize>,
    /// Share of the energy that is made or lost by rows that are not reciprocal.
    sampling: f64,
}

impl Cube {
    const RHO: f64 = 2.0 / 3.0;

    fn new(method: Method, n: u32, scale: f64) -> Result<Self> {
        let world = cube(n, 10.0 * scale);
        let rows = match method {
            // To 1e-6: there are two million of them.
            Method::Analytic => Rows::collect(&Made::new(world.len(), |patch, row: &mut Row| {
                polygon_row(&world.polygons, patch, 1e-6, row);
            }))?,
            _ => method.rows(&world)?,
        };
        // The lamp's strength grows with the square of the size, so that the light stays. Flux into a patch is the
        // intensity times its solid angle.
        let (lamp, intensity) = (DVec3::splat(5.0 * scale), 50_000.0 * scale * scale);
        let flux = |polygon: &Polygon| intensity * solid_angle(lamp, polygon.corners());
        let direct = world.polygons.iter().map(|polygon| flux(polygon) / polygon.area()).collect();
        Ok(Self { method, n, world, rows, direct })
    }

    fn light(&self, way: Way) -> Result<Lit> {
        let area = self.world.area();
        let source = self.direct.iter().map(|e| grey(Self::RHO * e)).collect();
        let rho = vec![grey(Self::RHO); area.len()];
        let solution = way.solve(&Problem::new(area.clone(), rho, source, self.rows.clone())?)?;
        let total = |i: usize| (self.direct[i] + solution.received[i].x) * area[i];
        let mean = (0..area.len()).map(total).sum::<f64>() / area.iter().sum::<f64>();
        let at = KHODULEV.iter().map(|&(x, y, _)| {
            let places = self.alike(x, y);
            let received = places.iter().map(|&patch| solution.received[patch].x).sum::<f64>();
            straight(x, y) + received / places.len() as f64
        });
        Ok(Lit {
            mean,
            at: at.collect(),
            places: KHODULEV.iter().map(|&(x, y, _)| self.alike(x, y).len()).collect(),
            sampling: (solution.ledger.sampling.x / solution.ledger.emitted.x).abs(),
        })
    }

    /// Patches around all places of the six faces that are like (x, y).
    fn alike(&self, x: f64, y: f64) -> BTreeSet<usize> {
        let n = self.n;
        let cell = |at: f64| ((at + 1.0) * 0.5 * f64::from(n)) as u32;
        let signs = |(u, v): (f64, f64)| [(u, v), (-u, v), (u, -v), (-u, -v)];
        let cells = [(x, y), (y, x)].into_iter().flat_map(signs);
        cells
            .flat_map(|(u, v)| (0..6).map(move |face| (face * n * n + cell(u) + n * cell(v)) as usize))
            .collect()
    }

    fn checks(&self, way: Way, mesh: &[f64], place: &str) -> Result<Vec<Check>> {
        // Hemicubes over patches side by side do not see each other alike: ways that turn rows round do not apply.
        if matches!(self.method, Method::Hemicube { .. }) && way.is_reciprocal() {
            return Ok(Vec::new());
        }
        let lit = self.light(way)?;
        let by = format!("{}, {n} × {n} patches a face", self.method.name(), n = self.n);
        let noise = |places: usize| match self.method {
            // Light that is met varies by 0.3 of its mean. By reciprocity it is counted in the rays that meet a patch,
            // of which there are as many as it sends, on average.
            Method::Rays(rays) if way.is_reciprocal() => 4.0 / (f64::from(rays) * places as f64).sqrt(),
            Method::Rays(rays) => 4.0 * 0.3 * f64::from(rays).powf(-0.625) / (places as f64).sqrt(),
            // Half of a chain of pixels, 1/resolution of the view, sees 0.3 more or less.
            Method::Hemicube { resolution, .. } => 0.3 * 0.5 / f64::from(resolution),
            Method::Analytic => 1e-6,
        };
        let all = (self.world.len() as f64).sqrt();
        let mean_bound = match self.method {
            Method::Rays(_) if way.is_reciprocal() => 1e-6,
            _ => lit.sampling / (1.0 - Self::RHO) + 1e-6,
        };
        let why = "what the ledger says the rows make or lose, reflected 1/(1 − ρ) times; rows in f32";
        let mean = Check::new("mean of Khodulev's cube", 1000.0 * PI, lit.mean, mean_bound, why);
        let mut checks = vec![mean.by(by.as_str()).at(place)];
        for (i, &(x, y, expected)) in KHODULEV.iter().enumerate() {
            let share = (expected - straight(x, y)) / expected;
            // All other patches' noise arrives too, averaged over them.
            let noise = noise(lit.places[i]) + Self::RHO / (1.0 - Self::RHO) * noise(1) / all * 2.0;
            let bound = share * noise + lit.sampling / (1.0 - Self::RHO) + (mesh[i] + 0.01) / expected;
            let why = "patches of constant light err by O(h) at worst: at most half of what patches of 3 h change; noise \
                       of the rows over the places that are alike, and of all others reflected; what the ledger says \
                       rows make or lose; 0.01 lx of the table";
            let case = format!("Khodulev's cube at ({x}, {y})");
            checks.push(Check::new(case, expected, lit.at[i], bound, why).by(by.as_str()).at(place));
        }
        Ok(checks)
    }
}

/// Illuminance straight from the lamp at a face's (x, y).
pub fn straight(x: f64, y: f64) -> f64 {
    50_000.0 * 5.0 / (25.0 * (1.0 + x * x + y * y)).powf(1.5)
}

/// Solid angle of a convex polygon, as a sum of triangles (van Oosterom & Strackee 1983).
pub fn solid_angle(from: DVec3, corners: &[DVec3]) -> f64 {
    let unit: Vec<DVec3> = corners.iter().map(|corner| (*corner - from).normalize()).collect();
    (1..unit.len() - 1)
        .map(|i| {
            let (a, b, c) = (unit[0], unit[i], unit[i + 1]);
            2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
        })
        .sum()
}
