//! How far an unfinished solution can be from the true one.
//!
//! With M = ρF, residual u and error ε = b* − b, shooting everything that is left for ever gives ε = (M + M² + …) u.
//! So Σ A |ε| ≤ Σ (z − A) |u| for z = A + MᵀA + Mᵀ²A + …: z_j is the power that one unit of radiosity on patch j
//! amounts to in the end. Any z with z ≥ A + Mᵀz in every entry is at least that large, M being non-negative; one is
//! found from a start w by w' = A + Mᵀw: where w' − w < A everywhere, t w with t = max A/(A − w' + w) is such a z.
//! In a room of one reflectance the start is the answer, z = A/(1 − ρ), and the bound is sharp.

use super::Rgb;
use super::problem::Problem;
use super::rows::{Columns, RowSource, Rows};
use rayon::prelude::*;

/// Iterations that the weights may take; each costs as much as shooting every patch once.
const ITERATIONS: usize = 24;

/// A bound that this factor could improve at most is good enough.
const GOOD_ENOUGH: f64 = 1.1;

/// Bound on Σ A |b* − b| per channel, W, from the residual `unshot` (W/m²) and the kept rows.
pub(super) fn remaining_power(problem: &Problem<Rows>, columns: &Columns, unshot: &[Rgb]) -> Rgb {
    let (area, rows) = (problem.area(), problem.rows());
    let sums: Vec<f64> = (0..rows.len()).map(|patch| rows.sum(patch)).collect();
    channels(|c| {
        let by_weights = match final_power(problem, columns, c) {
            Some(z) => z.iter().zip(area).zip(unshot).map(|((z, area), u)| (z - area) * u[c].abs()).sum(),
            None => f64::INFINITY,
        };
        by_weights.min(by_largest(area, problem.reflectance(), &sums, unshot, c))
    })
}

/// Calls a function for each channel's index.
pub(super) fn channels(value: impl Fn(usize) -> f64) -> Rgb {
    Rgb::new(value(0), value(1), value(2))
}

/// ‖ε‖∞ ≤ q/(1 − q) ‖u‖∞ with q = max ρ_i Σ_j F_ij, times the area. `sums` are those of the rows.
pub(super) fn by_largest(area: &[f64], reflectance: &[Rgb], sums: &[f64], residual: &[Rgb], c: usize) -> f64 {
    let q = reflectance.iter().zip(sums).map(|(rho, sum)| rho[c] * sum).fold(0.0, f64::max);
    let largest = residual.iter().map(|u| u[c].abs()).fold(0.0, f64::max);
    area.iter().sum::<f64>() * largest * q / (1.0 - q)
}

/// The same where rows are not kept: shooting by reciprocity never makes power, so what a shot leaves is at most
/// q = max ρ of it, and Σ A |ε| ≤ q/(1 − q) Σ A |u|. Infinite for a reflectance of 1.
pub(super) fn remaining_power_remade<R: RowSource>(problem: &Problem<R>, unshot: &[Rgb]) -> Rgb {
    let power = super::weighted_sum_abs(problem.area(), unshot);
    let q = problem.reflectance().iter().fold(Rgb::ZERO, |q, &rho| q.max(rho));
    // A channel with nothing left has no error, whatever it reflects.
    Rgb::select(power.cmpgt(Rgb::ZERO), power * q / (1.0 - q), Rgb::ZERO)
}

/// Weights z ≥ A + Mᵀz, or None when the iterations do not reach any.
fn final_power(problem: &Problem<Rows>, columns: &Columns, c: usize) -> Option<Vec<f64>> {
    let area = problem.area();
    let reflecting: f64 = area.iter().zip(problem.reflectance()).map(|(area, rho)| area * rho[c]).sum();
    let mean = (reflecting / area.iter().sum::<f64>()).min(0.999);
    let mut w: Vec<f64> = area.iter().map(|area| area / (1.0 - mean)).collect();
    let mut best: Option<(f64, Vec<f64>)> = None;
    for _ in 0..ITERATIONS {
        let next: Vec<f64> = (0..w.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|j| {
                let (row, weight) = columns.patch(j);
                let arriving = row.iter().zip(weight).map(|(&i, &weight)| {
                    f64::from(weight) * problem.reflectance()[i as usize][c] * w[i as usize]
                });
                area[j] + arriving.sum::<f64>()
            })
            .collect();
        let scale = |((next, w), area): ((&f64, &f64), &f64)| {
            let margin = area - (next - w);
            if margin > 0.0 { area / margin } else { f64::INFINITY }
        };
        let (low, high) = next
            .iter()
            .zip(&w)
            .zip(area)
            .map(scale)
            .fold((f64::INFINITY, 0f64), |(low, high), scale| (low.min(scale), high.max(scale)));
        if high.is_finite() && best.as_ref().is_none_or(|(scale, _)| high < *scale) {
            best = Some((high, w));
        }
        if high < GOOD_ENOUGH * low {
            break;
        }
        w = next;
    }
    best.map(|(scale, w)| w.into_iter().map(|w| w * scale).collect())
}
