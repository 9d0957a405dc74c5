//! How far off the light is, found out before anybody else does.
//!
//! A few hundred texels, drawn from classes of texels that err alike, are lit twice more with samples of their own. If
//! E is the stored value and A and B are independent and right on average, (E − A)(E − B) is right on average for the
//! squared error: the noise of A and B falls out, however coarse they are. So each of three parts is judged, whose
//! samples know nothing of each other, so that squares add up: direct light (shadow borders), gathers (few rays,
//! interpolation), and the coarse solution that gather rays see, where a gather at what they meet knows better.
//!
//! What gathers are off by cannot be less than what as many rays of a witness are off by, which the difference of A and B
//! tells without anything cancelling: where few texels leave the product uncertain, that is its floor.
//!
//! *Error* is the root mean square over all valid texels of exported pages of what a texel's irradiance (mean of the
//! channels) is off by, divided by the mean irradiance of these texels; texels count alike, whatever their area.

mod between;
mod survey;
mod witness;

pub use between::between_texels;
pub use witness::{Lit, Reflections};

use crate::elements::Elements;
use crate::progress::Progress;
use crate::transport::Tracer;
use survey::{Found, Off, Sampling, Survey, roughness};
use witness::Witness;

/// Rays that are worth it however few the bake took.
pub const LEAST_RAYS: u64 = 120_000;
/// Shares of the rays: direct light, gathers, the coarse solution.
const SHARES: [f64; 3] = [0.2, 0.45, 0.35];
/// Of the mean square that a gather's few rays make this share is left after interpolation: a surface of the second order
/// through eight or nine nodes weighs their noise by about 0.2 in its middle and 0.8 at its corners, mean 0.4.
const NOISE_LEFT: f64 = 0.4;
/// A mean square that is not known to this share of itself, standard error, is gone on with,
const SETTLED: f64 = 0.25;
/// up to this many times the rays: few texels with large errors are seldom met, and an estimate without them is none.
const MORE: u64 = 3;
/// Errors below this share of the mean need not be known better: half floats round by half of it.
const NEGLIGIBLE: f64 = 1e-3;
/// A floor further above a square than so many of its standard errors is that of single texels whose witnesses differ wildly.
const MOST_DOUBT: f64 = 3.0;
/// Texels of every class to begin with.
const FIRST: [usize; 3] = [24, 8, 8];

/// What was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Audit {
    /// The error, all sources; see the module.
    pub total: f64,
    /// The part of the direct light: its shadow borders.
    pub direct: f64,
    /// The part of the coarse solution that gather rays see.
    pub solve: f64,
    /// The part of the gathers' few rays.
    pub gather: f64,
    /// The part of interpolation between gathers.
    pub interpolation: f64,
    /// Standard error of `total`.
    pub uncertainty: f64,
    /// Not a part of `total`: what a lookup between the texels' centres is off by, were they exact. Only more texels
    /// make it less.
    pub between_texels: f64,
    /// Texels that were lit again.
    pub texels: u64,
    /// Rays sent.
    pub rays: u64,
}

/// What an audit may cost, and what for.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// About the most rays.
    pub rays: u64,
    /// Errors far below this one need not be told from nothing.
    pub resolution: f64,
    /// Of the samples.
    pub seed: u32,
}

/// Estimates the error of `lit`, with as few rays as are enough. `None` where nothing is lit, or when the caller stops it.
pub fn audit<T: Tracer>(lit: &Lit<T>, wanted: Wanted, progress: &mut Progress) -> Option<Audit> {
    let texels = exported(lit.elements);
    let mean = mean(lit, &texels);
    if !(mean > 0.0 && mean.is_finite()) {
        return None;
    }
    let limit = wanted.rays.max(LEAST_RAYS);
    progress.restart(limit);
    let rough = roughness(lit, &texels, mean);
    // At contacts with other objects light bends, and patches end: few texels there make most of the error.
    let among = |e: usize| u8::from(lit.elements.among_others[e]);
    let parted = |kind: &dyn Fn(usize) -> u8| -> Vec<u8> {
        texels.iter().zip(&rough).map(|(&e, &rough)| 4 * rough + kind(e as usize)).collect()
    };
    let witness = Witness::new(lit, wanted.seed);
    let sampling = |class, k: usize| Sampling {
        texels: &texels,
        class,
        first: FIRST[k],
        rays: (limit as f64 * SHARES[k]) as u64,
        resolution: (wanted.resolution * mean).powi(2) / 2.0,
    };
    let refined = parted(&|e| u8::from(lit.direct.refined[e]));
    let (mut nodes, mut contacts) = (Vec::new(), Vec::new());
    if let Some(reflections) = &lit.reflections {
        nodes = parted(&|e| 2 * among(e) + u8::from(reflections.gathered[e]));
        if reflections.coarse.is_some() {
            contacts = parted(&among);
        }
    }
    // What there is not has no texels to be looked at.
    let mut surveys: Vec<Survey> = [&refined, &nodes, &contacts]
        .into_iter()
        .enumerate()
        .filter(|(_, class)| !class.is_empty())
        .map(|(k, class)| Survey::new(sampling(class, k)))
        .collect();
    let off = |k: usize, e: u32| match (k, &lit.reflections) {
        (1, Some(reflections)) => witness.gather_off(reflections, e),
        (2, Some(reflections)) => witness.solve_off(reflections, e),
        _ => witness.direct_off(e),
    };
    for (k, survey) in surveys.iter_mut().enumerate() {
        survey.run(|e| off(k, e), progress)?;
    }
    let resolution = wanted.resolution.max(NEGLIGIBLE) * mean;
    settle(&mut surveys, resolution.powi(2), (MORE * wanted.rays).max(LEAST_RAYS), &off, progress)?;
    let found = |k: usize| surveys.get(k).map(Survey::found).unwrap_or_default();
    let (direct, mut gather, solve) = (found(0), found(1), found(2));
    let mut interpolation = 0.0;
    if let Some(reflections) = &lit.reflections {
        let to_stage = witness::noise_to_stage(reflections.rays);
        let floor = (gather.noise * to_stage).min(gather.square + MOST_DOUBT * gather.doubt);
        gather.square = gather.square.max(floor);
        let [square, noise] = gather.of_even;
        interpolation = of_interpolation(square - NOISE_LEFT * noise * to_stage, gather.square);
    }
    let parts = [direct, gather, solve];
    let square = parts.map(|part| part.square.max(0.0));
    let total = square.iter().sum::<f64>();
    let doubt = parts.map(|part| part.doubt.powi(2)).iter().sum::<f64>().sqrt();
    let share = |square: f64| square.sqrt() / mean;
    Some(Audit {
        total: share(total),
        direct: share(square[0]),
        solve: share(square[2]),
        gather: share(square[1] - interpolation),
        interpolation: share(interpolation),
        // Of a root, half the share; of nothing, as much as would be told from nothing.
        uncertainty: if total > doubt { doubt / (2.0 * total.sqrt()) } else { doubt.sqrt() / 2.0 } / mean,
        between_texels: between_texels(lit.elements, &|e| f64::from(lit.irradiance(e).mean())),
        texels: parts.iter().map(|part| part.texels).sum(),
        rays: parts.iter().map(|part| part.rays).sum(),
    })
}

/// The part of a gather's square that is interpolation's, if so much is; both may be below 0 where there is next to nothing.
fn of_interpolation(square: f64, of_gather: f64) -> f64 {
    square.min(of_gather).max(0.0)
}

/// Goes on with whatever leaves most in doubt, until the error is known well or a good deal more rays are used up.
fn settle(
    surveys: &mut [Survey],
    resolution: f64,
    limit: u64,
    off: &(impl Fn(usize, u32) -> Off + Sync),
    progress: &Progress,
) -> Option<()> {
    loop {
        let found: Vec<Found> = surveys.iter().map(Survey::found).collect();
        let square: f64 = found.iter().map(|found| found.square.max(0.0)).sum();
        let doubt = found.iter().map(|found| found.doubt.powi(2)).sum::<f64>().sqrt();
        let rays: u64 = found.iter().map(|found| found.rays).sum();
        let open = (0..surveys.len()).filter(|&k| !surveys[k].spent);
        let most = open.max_by(|&a, &b| found[a].doubt.total_cmp(&found[b].doubt));
        let Some(k) = most.filter(|_| doubt > SETTLED * square.max(resolution) && rays < limit) else {
            return Some(());
        };
        surveys[k].round(|e| off(k, e), progress)?;
    }
}

/// Valid elements of exported pages.
fn exported(elements: &Elements) -> Vec<u32> {
    let charts = elements.charts.iter().filter(|chart| chart.exported);
    charts.flat_map(|chart| chart.elements.clone()).filter(|&e| elements.valid[e as usize]).collect()
}

fn mean<T>(lit: &Lit<T>, texels: &[u32]) -> f64 {
    let all: f64 = texels.iter().map(|&e| f64::from(lit.irradiance(e).mean())).sum();
    all / texels.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_below_nothing_are_nothing() {
        assert_eq!(of_interpolation(1e-7, -4.9e-7), 0.0);
        assert_eq!(of_interpolation(-1.0, 2.0), 0.0);
        assert_eq!(of_interpolation(1.0, 2.0), 1.0);
        assert_eq!(of_interpolation(3.0, 2.0), 2.0);
    }
}
