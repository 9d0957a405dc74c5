//! What an error will cost, before the bake: a trial that was audited tells what the scene errs, and what is usual how that
//! and the work change with effort.

use super::{Forecast, Load, OF_RAYS, Whole, audit_rays};
use crate::audit::Audit;
use crate::options::{BakeOptions, Effort, Errors, Experience, growth};
use crate::progress::Stage;
use serde::Serialize;

/// Errors whose prices are told.
const ERRORS: [f64; 4] = [0.05, 0.02, 0.01, 0.005];
/// Rays of the audits of a bake to a tolerance, as a share of the others.
const AUDITS: f64 = 0.12;
/// Stages that effort changes, as [`growth`] tells them.
const GROWING: [Stage; 3] = [Stage::Direct, Stage::Solve, Stage::Gather];

/// What a bake to a tolerance will take: about.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Price {
    /// The tolerance, as a share of the mean light.
    pub error: f64,
    /// All stages, seconds.
    pub seconds: f64,
    /// Rays.
    pub rays: u64,
    /// Whether more rays are likely to help so far.
    pub within_reach: bool,
}

/// Adds the error and the prices of others; `share`: density of the audited trial over that of the bake.
pub(super) fn add(foreseen: &mut Forecast, audit: &Audit, share: f64, whole: &Whole, options: &BakeOptions) {
    // A shadow border passes a share of the texels that falls with the density, and with it the mean square. Where light is
    // smooth, smaller texels change nothing, and at contacts as much as at borders: between the two, by the root.
    let (border, smooth) = (share.powf(0.5), share.powf(0.25));
    let parts =
        [audit.direct * border, audit.solve * smooth, audit.gather * smooth, audit.interpolation * smooth];
    let total = parts.map(|part| part * part).iter().sum::<f64>().sqrt();
    let [direct, solve, gather, interpolation] = parts;
    let found = Errors { total, direct, solve, gather, interpolation, between_texels: audit.between_texels };
    foreseen.error = Some(total);
    let known = Experience::of(Effort::of(&options.light), &found);
    let of_light = |stage: &Stage| GROWING.contains(stage) || *stage == Stage::Audit;
    let rest: f64 = foreseen.stages.iter().filter(|(stage, _)| !of_light(stage)).map(|(_, s)| s).sum();
    foreseen.prices = ERRORS
        .into_iter()
        .map(|error| {
            let (passes, within_reach) = known.passes_to(error);
            let (mut seconds, mut rays) = (rest, whole.loads[0].rays);
            for (step, likely) in passes {
                let light = step.effort.light_of_pass(&options.light);
                let [direct, solve, gather] = growth(&options.light, &light);
                let [straight, reflected] =
                    [step.anew.direct, step.anew.reflected].map(|anew| f64::from(u8::from(anew)));
                let (took, sent) = pass(whole, [straight * direct, reflected * solve, reflected * gather]);
                let audit = audit_rays(AUDITS, sent);
                seconds += likely * (took + whole.audit_seconds(audit));
                rays += likely * (sent + audit);
            }
            Price { error, seconds, rays: rays as u64, within_reach }
        })
        .collect();
}

/// Seconds and rays of the stages that effort changes.
fn pass(whole: &Whole, growth: [f64; 3]) -> (f64, f64) {
    let (mut seconds, mut rays) = (0.0, 0.0);
    for (stage, growth) in GROWING.into_iter().zip(growth) {
        let Some(k) = OF_RAYS.iter().position(|of_rays| *of_rays == stage).filter(|&k| whole.ran[k]) else {
            continue;
        };
        let load = Load { rays: whole.loads[k].rays * growth, ..whole.loads[k] };
        seconds += whole.seconds(k, &load);
        rays += load.rays;
    }
    (seconds, rays)
}
