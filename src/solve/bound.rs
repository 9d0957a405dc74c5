//! How far an unfinished solution can be from the true one.
//!
//! With M = ρF, residual u and error ε = b* − b, shooting everything that is left for ever gives ε = (M + M² + …) u.
//! So Σ A |ε| ≤ Σ (z − A) |u| for z = A + MᵀA + Mᵀ²A + …: z_j is the power that one unit of radiosity on patch j
//! amounts to in the end. Any z with z ≥ A + Mᵀz in every entry is at least that large, M being non-negative; one is
//! found from a start w by w' = A + Mᵀw: where w' − w < A everywhere, t w with t = max A/(A − w' + w) is such a z.
//! In a room of one reflectance the start is the answer, z = A/(1 − ρ), and the bound is sharp.

use super::problem::Problem;
use super::rows::{Columns, RowSource, Rows};
use super::{Rgb, weighted_sum_abs};
use rayon::prelude::*;

/// Iterations that the weights may take; each costs one pass over the form factors.
const ITERATIONS: usize = 8;

/// A bound that could improve by this factor at most is good enough.
const GOOD_ENOUGH: f64 = 1.2;

/// Bound on Σ A |b* − b| per channel, W, from the residual `unshot` (W/m²) and the kept rows.
pub(super) fn remaining_power(problem: &Problem<Rows>, columns: &Columns, unshot: &[Rgb]) -> Rgb {
    let (area, rows) = (problem.area(), problem.rows());
    let sums: Vec<f64> = (0..rows.len()).map(|patch| rows.sum(patch)).collect();
    let (scale, w) = final_power(problem, columns);
    // (z − A)|u| = (t w − A)|u|
    let weighted: Rgb = w.iter().zip(unshot).map(|(&w, unshot)| w * unshot.abs()).sum();
    let by_weights = scale * weighted - weighted_sum_abs(area, unshot);
    let by_weights = Rgb::select(scale.cmplt(Rgb::INFINITY), by_weights, Rgb::INFINITY);
    by_largest(area, problem.reflectance(), &sums, unshot).min(by_weights)
}

/// ‖ε‖∞ ≤ q/(1 − q) ‖u‖∞ with q = max ρ_i Σ_j F_ij, times the area. `sums` are those of the rows.
pub(super) fn by_largest(area: &[f64], reflectance: &[Rgb], sums: &[f64], unshot: &[Rgb]) -> Rgb {
    let returned = reflectance.iter().zip(sums).map(|(&rho, &sum)| rho * sum);
    let q = returned.fold(Rgb::ZERO, Rgb::max);
    let largest = unshot.iter().map(|unshot| unshot.abs()).fold(Rgb::ZERO, Rgb::max);
    largest * q / (1.0 - q) * area.iter().sum::<f64>()
}

/// The same where rows are not kept: shooting by reciprocity never makes power, so what a shot leaves is at most
/// q = max ρ of it, and Σ A |ε| ≤ q/(1 − q) Σ A |u|. Infinite for a reflectance of 1.
pub(super) fn remaining_power_remade<R: RowSource>(problem: &Problem<R>, unshot: &[Rgb]) -> Rgb {
    let power = weighted_sum_abs(problem.area(), unshot);
    let q = problem.reflectance().iter().fold(Rgb::ZERO, |q, &rho| q.max(rho));
    // A channel with nothing left has no error, whatever it reflects.
    Rgb::select(power.cmpgt(Rgb::ZERO), power * q / (1.0 - q), Rgb::ZERO)
}

/// A scale t and weights w with t w ≥ A + Mᵀ(t w), per channel; t is infinite where the iterations find none.
fn final_power(problem: &Problem<Rows>, columns: &Columns) -> (Rgb, Vec<Rgb>) {
    let (area, reflectance) = (problem.area(), problem.reflectance());
    let mean = super::weighted_sum(area, reflectance) / area.iter().sum::<f64>();
    let mut w: Vec<Rgb> = area.iter().map(|&area| area / (1.0 - mean.min(Rgb::splat(0.999)))).collect();
    for round in 0..ITERATIONS {
        let next: Vec<Rgb> = (0..w.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|j| {
                let (row, weight) = columns.patch(j);
                let terms = row.iter().zip(weight).map(|(&i, &weight)| (i as usize, f64::from(weight)));
                area[j] + terms.map(|(i, weight)| reflectance[i] * w[i] * weight).sum::<Rgb>()
            })
            .collect();
        let (mut low, mut high) = (Rgb::INFINITY, Rgb::ZERO);
        for ((&next, &w), &area) in next.iter().zip(&w).zip(area) {
            let margin = area - (next - w);
            let scale = Rgb::select(margin.cmpgt(Rgb::ZERO), area / margin, Rgb::INFINITY);
            (low, high) = (low.min(scale), high.max(scale));
        }
        if round + 1 == ITERATIONS || high.cmplt(low * GOOD_ENOUGH).all() {
            return (high, w);
        }
        w = next;
    }
    (Rgb::INFINITY, w)
}
