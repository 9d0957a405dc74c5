//! Form factors of round bodies, cut into facets.

use super::Check;
use super::world::{Method, World, add_sphere};
use crate::error::Result;
use crate::transport::form_factors::area::{Polygon, polygon_to_polygon};
use glam::{DVec3, dvec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// C-41, coaxial discs: two radii, distance, factor; 30-digit arithmetic.
const DISCS: [(f64, f64, f64, f64); 8] = [
    (1.0, 1.0, 1.0, 0.381966011250105),
    (1.0, 2.0, 1.0, 0.763932022500210),
    (2.0, 1.0, 1.0, 0.190983005625053),
    (0.5, 1.0, 2.0, 0.192235935955849),
    (1.0, 1.0, 0.1, 0.904875078027496),
    (1.0, 1.0, 0.001, 0.999000499875),
    (1.0, 1.0, 100.0, 9.99800049986e-5),
    (1.0, 1e-4, 1.0, 4.9999999875e-9),
];

/// Corners of the polygons that stand for a circle.
const CORNERS: u32 = 64;

/// A circle about the z axis as a polygon that faces up or down: inside the circle, or about it.
pub fn circle(radius: f64, z: f64, up: bool, about: bool) -> Vec<DVec3> {
    let step = 2.0 * PI / f64::from(CORNERS);
    let radius = if about { radius / (step / 2.0).cos() } else { radius };
    let turn = if up { step } else { -step };
    (0..CORNERS)
        .map(|k| dvec3((turn * f64::from(k)).cos(), (turn * f64::from(k)).sin(), 0.0) * radius + DVec3::Z * z)
        .collect()
}

/// Between polygons inside two discs and polygons about them. What two surfaces exchange, A₁F₁₂, grows with both of
/// them, so that the exact value lies between.
pub fn discs() -> Result<Vec<Check>> {
    let places = [(1e-3, "×1e-3"), (1.0, "×1"), (1e6, "×1e6")];
    let tasks: Vec<_> = DISCS.into_iter().flat_map(|disc| places.map(|place| (disc, place))).collect();
    let checks = tasks.into_par_iter().filter_map(|((first, second, distance, factor), (scale, place))| {
        let exchange = |about: bool| {
            let from = Polygon::new(circle(first * scale, 0.0, true, about))?;
            let to = Polygon::new(circle(second * scale, distance * scale, false, about))?;
            let found = polygon_to_polygon(&from, &to, 1e-6);
            Some((found.factor * from.area(), found.error * from.area()))
        };
        let ((low, low_error), (high, high_error)) = (exchange(false)?, exchange(true)?);
        let area = PI * (first * scale).powi(2);
        let (middle, half) = (0.5 * (low + high) / area, 0.5 * (high - low) / area);
        let bound = (half + (low_error + high_error) / area) / factor;
        let why = "polygons of 64 corners inside and about the discs: the exact value lies between, and the closed \
                   form's own error is added";
        let case = format!("discs of radius {first} and {second} at {distance}");
        Some(Check::new(case, factor, middle, bound, why).by("analytic").at(place))
    });
    Ok(checks.collect())
}

/// Inside a sphere every patch takes its share of the area from every other: F = A_j/A. The mean error over a row.
pub fn spheres() -> Result<Vec<Check>> {
    let methods = [Method::Rays(1 << 14), Method::Hemicube { resolution: 64, points: 4 }, Method::Analytic];
    let tasks: Vec<_> = methods
        .into_iter()
        .flat_map(|method| [(1e-3, "×1e-3"), (1.0, "×1"), (1e6, "×1e6")].map(|place| (method, place)))
        .collect();
    let checks = tasks.into_par_iter().map(|(method, (scale, place))| {
        let mut world = World::default();
        add_sphere(&mut world, scale, 3, true);
        let area = world.area();
        let total: f64 = area.iter().sum();
        let (mut off, mut bound) = (0.0_f64, 0.0_f64);
        for from in [0, 7, 40] {
            let row = method.row(&world, from);
            let share = |to: u32| area[to as usize] / total;
            let sums =
                row.column.iter().zip(&row.weight).map(|(&to, weight)| {
                    ((weight - share(to)).abs(), method.error(&world, from, to, share(to)))
                });
            let (error, allowed) = sums.fold((0.0, 0.0), |sum, term| (sum.0 + term.0, sum.1 + term.1));
            (off, bound) = (off.max(error), bound.max(allowed));
        }
        let why =
            format!("{}; facets 0.55 radii across lie within h²/2 of the sphere's directions", method.why());
        Check::new("sum over a row of |F − A_j/A|", 0.0, off, bound + 0.55 * 0.55 / 2.0, why)
            .by(method.name())
            .at(place)
    });
    Ok(checks.collect())
}
