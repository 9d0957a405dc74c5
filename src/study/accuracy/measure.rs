//! How far a lightmap is from another.

use super::Judged;
use glam::Vec3;
use serde::Serialize;

/// Differences of a lightmap from the truth, as shares of the mean irradiance of the truth. The error of a texel is
/// |E − E_ref|, mean over the channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Root of the mean square.
    pub rms: f64,
    /// Half of the texels err less.
    pub median: f64,
    /// 95 of 100 texels err less.
    pub p95: f64,
    /// The texel that errs most.
    pub largest: f64,
    /// Mean of E − E_ref: texels count alike.
    pub bias: f64,
    /// Power that arrives too much on all surfaces, ∫(E − E_ref) dA / ∫E_ref dA: texels count by their area.
    pub energy: f64,
}

/// Compares texel by texel. `None` where the truth is dark or there is no texel.
pub fn errors(found: &[Vec3], truth: &[Vec3], area: &[f64]) -> Option<Errors> {
    let mean_of = |v: Vec3| v.as_dvec3().element_sum() / 3.0;
    let count = truth.len() as f64;
    let mean = truth.iter().map(|&v| mean_of(v)).sum::<f64>() / count;
    if !(mean > 0.0 && mean.is_finite()) || found.len() != truth.len() {
        return None;
    }
    let mut size: Vec<f64> = found.iter().zip(truth).map(|(&a, &b)| mean_of((a - b).abs()) / mean).collect();
    let rms = (size.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
    let signed = || found.iter().zip(truth).map(|(&a, &b)| mean_of(a) - mean_of(b));
    let bias = signed().sum::<f64>() / count / mean;
    let power: f64 = truth.iter().zip(area).map(|(&v, area)| mean_of(v) * area).sum();
    let surplus: f64 = signed().zip(area).map(|(error, area)| error * area).sum();
    size.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| size[((count * share) as usize).min(size.len() - 1)];
    let energy = if power > 0.0 { surplus / power } else { 0.0 };
    Some(Errors { rms, median: at(0.5), p95: at(0.95), largest: size[size.len() - 1], bias, energy })
}

/// Error of every texel as a share of the truth's mean.
pub fn texelwise(found: &[Vec3], judged: &Judged) -> Vec<f32> {
    let mean = judged.truth.iter().map(|v| f64::from(v.element_sum())).sum::<f64>()
        / (3 * judged.truth.len().max(1)) as f64;
    let error = |(&a, &b): (&Vec3, &Vec3)| (a - b).abs().element_sum() / 3.0 / mean as f32;
    found.iter().zip(&judged.truth).map(error).collect()
}

/// Which of several choices, each with its cost and its error, no other one beats in one of the two without losing in
/// the other.
pub fn pareto(choices: &[[f64; 2]]) -> Vec<bool> {
    let beats = |a: &[f64; 2], b: &[f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
    choices.iter().map(|own| !choices.iter().any(|other| beats(other, own))).collect()
}
