//! How far an unfinished solution can be from the true one.
//!
//! With M = ρF, residual u and error ε = b* − b, shooting everything that is left for ever gives ε = (M + M² + …) u.
//! M has no negative entry, so |ε| ≤ Σ Mᵏ|u|: the sizes of what is left are sent round as light would be, without
//! anything cancelling, and what arrives is added up. After k rounds the rest is bounded by its largest value r:
//! Mr ≤ q r with q = max ρ_i Σ_j F_ij, so that all further rounds together bring q/(1 − q) r at most. In a room of one
//! reflectance that is sharp at once; elsewhere the rounds make it so.

use super::problem::Problem;
use super::rows::RowSource;
use super::{Rgb, weighted_sum, weighted_sum_abs};

/// Rounds at the most; each costs one pass over the form factors.
const ROUNDS: usize = 64;

/// A bound that could improve by this share at most is good enough.
const GOOD_ENOUGH: f64 = 0.05;

/// Bound on Σ A |b* − b| per channel, W, from the residual `unshot` (W/m²), the `sums` of the rows, and `gather`, which
/// tells what every patch receives, Σ_j F_ij b_j.
pub(super) fn remaining_power(
    area: &[f64],
    reflectance: &[Rgb],
    sums: impl Iterator<Item = f64>,
    unshot: &[Rgb],
    gather: impl Fn(&[Rgb]) -> Vec<Rgb>,
) -> Rgb {
    let q = reflectance.iter().zip(sums).fold(Rgb::ZERO, |q, (&rho, sum)| q.max(rho * sum));
    let whole: f64 = area.iter().sum();
    let mut left: Vec<Rgb> = unshot.iter().map(|unshot| unshot.abs()).collect();
    let mut arrived = Rgb::ZERO;
    for round in 0.. {
        let largest = left.iter().copied().fold(Rgb::ZERO, Rgb::max);
        let rest = largest * q / (1.0 - q) * whole;
        if round == ROUNDS || rest.cmple(arrived * GOOD_ENOUGH).all() {
            return arrived + rest;
        }
        left = gather(&left).iter().zip(reflectance).map(|(&received, &rho)| rho * received).collect();
        arrived += weighted_sum(area, &left);
    }
    Rgb::INFINITY
}

/// The same where rows are not kept: shooting by reciprocity never makes power, so what a shot leaves is at most
/// q = max ρ of it, and Σ A |ε| ≤ q/(1 − q) Σ A |u|. Infinite for a reflectance of 1.
pub(super) fn remaining_power_remade<R: RowSource>(problem: &Problem<R>, unshot: &[Rgb]) -> Rgb {
    let power = weighted_sum_abs(problem.area(), unshot);
    let q = problem.reflectance().iter().fold(Rgb::ZERO, |q, &rho| q.max(rho));
    // A channel with nothing left has no error, whatever it reflects.
    Rgb::select(power.cmpgt(Rgb::ZERO), power * q / (1.0 - q), Rgb::ZERO)
}
