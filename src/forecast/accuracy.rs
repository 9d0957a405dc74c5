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
    // Where light is smooth, smaller texels change nothing; borders pass fewer of them, so their mean square falls with the
    // density. Between the two: by its root.
    let carried = |error: f64| error * share.powf(0.25);
    let found = Errors {
        total: carried(audit.total),
        direct: carried(audit.direct),
        solve: carried(audit.solve),
        gather: carried(audit.gather),
        interpolation: carried(audit.interpolation),
    };
    foreseen.error = Some(found.total);
    let known = Experience::of(Effort::of(&options.light), &found);
    let of_light = |stage: &Stage| GROWING.contains(stage) || *stage == Stage::Audit;
    let rest: f64 = foreseen.stages.iter().filter(|(stage, _)| !of_light(stage)).map(|(_, s)| s).sum();
    foreseen.prices = ERRORS
        .into_iter()
        .map(|error| {
            let (passes, within_reach) = known.passes_to(error);
            let (mut seconds, mut rays) = (rest, whole.loads[0].rays);
            for (effort, likely) in passes {
                let light = effort.light_of_pass(&options.light);
                let (took, sent) = pass(whole, growth(&options.light, &light));
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
