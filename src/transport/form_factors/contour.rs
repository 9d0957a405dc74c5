//! Form factor as a double integral along the contours of both polygons:
//! A₁ F₁₂ = 1/(2π) ∮∮ ln r dr₁·dr₂ (Moon 1936; Cohen & Wallace eq. 4.19).
//!
//! The inner edge is integrated in closed form. What remains along the outer edge is analytic but for logarithmic
//! singularities at known places, where corners of the inner edge project to it: the outer edge is cut there, and the
//! double exponential rule (Takahasi & Mori 1974), which converges exponentially in spite of singular ends, does each
//! piece.

use super::area::AreaFactor;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Form factor between two polygons, each wholly before the other, divided by `area`. The relative tolerance is that
/// of the closed integral, reached or not: see [`AreaFactor::error`].
pub(super) fn contour_factor(from: &[DVec3], to: &[DVec3], area: f64, tolerance: f64) -> AreaFactor {
    // Contours are closed, so a constant added to ln r changes nothing: measured in typical distances it is small.
    let unit = typical_distance(from, to);
    let mut coarser = f64::NAN;
    let mut best = AreaFactor { factor: 0.0, error: f64::INFINITY };
    for level in 2..=5 {
        let (mut sum, mut size) = (0.0, 0.0);
        for outer in edges(from) {
            for inner in edges(to) {
                let term = edge_pair(outer, inner, unit, level);
                sum += term;
                size += term.abs();
            }
        }
        let factor = (sum / (TAU * area)).clamp(0.0, 1.0);
        let rounding = 8.0 * f64::EPSILON * size / (TAU * area);
        let error = (factor - coarser).abs() + rounding;
        if error < best.error || best.error == f64::INFINITY {
            best = AreaFactor { factor, error: if error.is_nan() { f64::INFINITY } else { error } };
        }
        if best.error <= tolerance * factor + rounding {
            break;
        }
        coarser = factor;
    }
    best
}

fn typical_distance(from: &[DVec3], to: &[DVec3]) -> f64 {
    let mean = |corners: &[DVec3]| corners.iter().sum::<DVec3>() / corners.len() as f64;
    let extent = |corners: &[DVec3]| corners.iter().map(|c| c.distance(corners[0])).fold(0.0, f64::max);
    mean(from).distance(mean(to)).max(0.5 * extent(from)).max(0.5 * extent(to))
}

fn edges(corners: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    (0..corners.len()).map(|i| (corners[i], corners[(i + 1) % corners.len()]))
}

/// ∫∫ ln(r/unit) dr₁·dr₂ over two edges; the number of points doubles from level to level.
fn edge_pair(outer: (DVec3, DVec3), inner: (DVec3, DVec3), unit: f64, level: i32) -> f64 {
    let (Some(along), Some(beside)) =
        ((outer.1 - outer.0).try_normalize(), (inner.1 - inner.0).try_normalize())
    else {
        return 0.0;
    };
    let cosine = along.dot(beside);
    if cosine == 0.0 {
        return 0.0;
    }
    let length = outer.0.distance(outer.1);
    let mut cuts = [0.0, length, 0.0, 0.0, 0.0];
    let mut count = 2;
    let sine_squared = along.cross(beside).length_squared();
    let offset = inner.0 - outer.0;
    // Where the lines come closest to each other.
    let nearest = (offset.dot(along) - offset.dot(beside) * cosine) / sine_squared;
    for cut in [offset.dot(along), (inner.1 - outer.0).dot(along), nearest] {
        // Pieces shorter than rounding would only add noise.
        if cut > 1e-9 * length && cut < (1.0 - 1e-9) * length {
            cuts[count] = cut;
            count += 1;
        }
    }
    let cuts = &mut cuts[..count];
    cuts.sort_unstable_by(f64::total_cmp);
    let inner_length = inner.0.distance(inner.1);
    let log_integral = |position: f64| {
        let to_start = outer.0 + along * position - inner.0;
        let at = to_start.dot(beside);
        let height = to_start.cross(beside).length() / unit;
        unit * (log_primitive((inner_length - at) / unit, height) - log_primitive(-at / unit, height))
    };
    cuts.windows(2).map(|piece| double_exponential(piece[0], piece[1], level, log_integral)).sum::<f64>()
        * cosine
}

/// ∫₀ᵛ ln √(t² + h²) dt.
fn log_primitive(v: f64, h: f64) -> f64 {
    if v == 0.0 {
        return 0.0;
    }
    let turn = if h > 0.0 { h * (v / h).atan() } else { 0.0 };
    v * v.hypot(h).ln() - v + turn
}

/// ∫ f over [a, b] with 2^level points per unit of the transformed variable, which runs over ±3.2: what lies beyond
/// has weights below 1e-16.
fn double_exponential(a: f64, b: f64, level: i32, f: impl Fn(f64) -> f64) -> f64 {
    let half = 0.5 * (b - a);
    let step = 0.5f64.powi(level);
    let count = (3.2 / step) as i32;
    let mut sum = 0.0;
    for k in -count..=count {
        let t = f64::from(k) * step;
        let u = FRAC_PI_2 * t.sinh();
        let weight = FRAC_PI_2 * t.cosh() / u.cosh().powi(2);
        // The distance from the nearer end, without the cancellation of 1 − tanh.
        let from_end = half * (-u.abs()).exp() / u.cosh();
        let position = if u < 0.0 { a + from_end } else { b - from_end };
        sum += weight * f(position);
    }
    half * step * sum
}
