//! What a bake will take, before it is begun: texels, rays, seconds, memory.
//!
//! The plan and texture space are made in full; what the light stages take is found by two trials at a fraction of the
//! density and carried on, stage by stage: what is spent on areas grows with the square of the density, what is spent on
//! edges and shadow borders with the density itself. So it holds for any machine, and for scenes whose cost no count of
//! triangles would tell. How the seconds of a stage divide among its texels, rays and patches is modelled; how
//! long they are here is measured by the trials.

mod accuracy;
mod model;
mod savings;

pub use accuracy::Price;

use crate::atlas::{self, HIDDEN_DENSITY};
use crate::audit;
use crate::bake::{Lit, Run, in_pool, light, sized, wanted};
use crate::error::Result;
use crate::memory;
use crate::options::{AtlasOptions, BakeOptions, Goal, LightOptions};
use crate::plan::{Finding, Proven};
use crate::progress::{Progress, Stage};
use crate::scene::Scene;
use model::{Load, Speed};
use savings::Counted;
use serde::Serialize;
use std::cell::OnceCell;

/// Bakes of at most so many covered texels, and the densities of their trials as shares of the bake's: of small bakes
/// a ninth of the texels would be too few to tell from, and more of them cost little.
const TRIALS: [(f64, [f32; 2]); 3] =
    [(120_000.0, [1.0 / 3.0, 2.0 / 3.0]), (500_000.0, [0.25, 0.5]), (f64::INFINITY, [1.0 / 9.0, 1.0 / 3.0])];
/// How often a trial is repeated, at the most; the mean counts, as what disturbs a trial disturbs a bake too.
const REPEATS: usize = 3;
/// Trials are repeated until they took this long together, seconds.
const SHORT_SECONDS: f64 = 0.3;
/// A stage that took as long in a trial tells by itself how it grows with the density.
const MEASURED_WELL_S: f64 = 0.02;
/// Stages that send rays, in the order they run.
const OF_RAYS: [Stage; 4] = [Stage::Elements, Stage::Direct, Stage::Solve, Stage::Gather];
/// An audit goes on to the end of a round beyond its least rays.
const AUDIT_BEYOND: f64 = 1.25;

/// How many times the patches of the larger trial a bake has at the most.
const MOST_MORE_PATCHES: f64 = 1.4;

/// The value of a s² + b s at the whole density, s = 1, from its values at two shares of it; a and b are not negative.
fn grown([s, t]: [f64; 2], [low, high]: [f64; 2]) -> f64 {
    let area = (high / t - low / s) / (t - s);
    let edge = high / t - area * t;
    match (area < 0.0, edge < 0.0) {
        (true, _) => high / t,
        (_, true) => high / (t * t),
        _ => area + edge,
    }
}

/// What a bake will take.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Forecast {
    /// Which effects are simulated, why, and what leaving the others out saves.
    pub effects: Vec<Finding>,
    /// Pages that will be written.
    pub pages: u32,
    /// Width and height of a page.
    pub page_size_texels: u32,
    /// Texels per metre.
    pub density_texels_per_m: f32,
    /// Texels that will be lit, those on hidden pages included: about.
    pub elements: u64,
    /// Shooters of the coarse solution: about.
    pub patches: u64,
    /// Rays: about.
    pub rays: u64,
    /// Seconds of each stage, in the order they run; without reading the file.
    pub stages: Vec<(Stage, f64)>,
    /// Most memory, bytes.
    pub memory_bytes: u64,
    /// What the light will be off by: about; none where nothing is lit. See [`crate::audit`].
    pub error: Option<f64>,
    /// What bakes to tolerances will take.
    pub prices: Vec<Price>,
}

impl Forecast {
    /// With the seconds that reading the file takes, which whoever has read the scene knows.
    pub fn after_reading(mut self, seconds: f64) -> Self {
        self.stages.insert(0, (Stage::Import, seconds));
        self.prices.iter_mut().for_each(|price| price.seconds += seconds);
        self
    }

    /// All stages, seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|stage| stage.1).sum()
    }

    /// The stages that find the light, plan to gather, seconds.
    pub fn light_seconds(&self) -> f64 {
        self.stages.iter().filter(|stage| stage.0 <= Stage::Gather).map(|stage| stage.1).sum()
    }
}

/// Tells what baking a scene will take. Needs a clock in `run`, or all seconds are 0; takes about a tenth of a large
/// bake, up to half of a small one, and as long for texture space as the bake does.
pub fn forecast(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<Forecast> {
    in_pool(run.threads, || {
        let begun = (run.clock)();
        let sizes = options.atlas.between_texels.is_some();
        let options = &sized(scene, options, run)?;
        let started = (run.clock)();
        let sizing = sizes.then_some((Stage::Sizing, started - begun));
        let wanted = wanted(options);
        let proven = Proven::new(scene, wanted.direct_alone);
        let plan = proven.plan(&wanted.forced);
        let planned = (run.clock)();
        let geometries = scene.geometries.len() as u64;
        let progress = Progress::begin(run.observer, run.cancel, Stage::Atlas, geometries);
        let atlas = atlas::unwrap(scene, &plan.sides, &options.atlas, &progress)?;
        let unwrapped = (run.clock)();
        let exported = || atlas.pages.iter().filter(|page| page.exported);
        let page_texels: f64 = exported().map(|page| f64::from(page.size_texels).powi(2)).sum();
        let mut foreseen = Forecast {
            pages: exported().count() as u32,
            page_size_texels: exported().map(|page| page.size_texels).max().unwrap_or(0),
            density_texels_per_m: atlas.density,
            memory_bytes: memory::predict_planned(scene, &atlas, &plan, options.light.solve.patches),
            stages: sizing
                .into_iter()
                .chain([(Stage::Plan, planned - started), (Stage::Atlas, unwrapped - planned)])
                .collect(),
            effects: plan.effects,
            ..Forecast::default()
        };
        // Where nothing gets a lightmap there is nothing to try.
        if foreseen.pages == 0 {
            return Ok(foreseen);
        }
        let covered = page_texels * f64::from(atlas.fill);
        let shares =
            TRIALS.iter().find(|(most, _)| covered <= *most).map_or(TRIALS[0].1, |(_, shares)| *shares);
        // The larger one also tells the error.
        let audited = options.light.least_audit_share();
        let [small, large] = shares.map(|share| atlas.density * share);
        let trials = [trial(scene, options, small, 0.0, run)?, trial(scene, options, large, audited, run)?];
        let whole = foresee(&mut foreseen, &trials, covered, page_texels, options);
        let share = f64::from(trials[1].atlas.density) / f64::from(atlas.density);
        if let Some(audit) = &trials[1].light.error_parts {
            accuracy::add(&mut foreseen, audit, share, &whole, options);
        }
        let counted = Counted {
            scene,
            options,
            proven: &proven,
            trial: &trials[1],
            share,
            elements: foreseen.elements,
            rays: foreseen.rays,
            hidden_density: HIDDEN_DENSITY * f64::from(atlas.density),
            world: OnceCell::new(),
        };
        for finding in foreseen.effects.iter_mut().filter(|finding| finding.can_be_forced) {
            finding.saving.amounts = counted.amounts(finding.effect);
        }
        Ok(foreseen)
    })?
}

/// What the stages that send rays have to do in the whole bake.
struct Whole {
    loads: [Load; OF_RAYS.len()],
    /// Seconds here for a second of the model.
    paces: [f64; OF_RAYS.len()],
    ran: [bool; OF_RAYS.len()],
    pace: f64,
}

/// Carries two trials on to the whole.
fn foresee(
    foreseen: &mut Forecast,
    trials: &[Lit; 2],
    covered: f64,
    page_texels: f64,
    options: &BakeOptions,
) -> Whole {
    let shares =
        [0, 1].map(|k| f64::from(trials[k].atlas.density) / f64::from(foreseen.density_texels_per_m));
    let texels = [0, 1].map(|k| trials[k].elements.len() as f64);
    let hidden = [0, 1].map(|k| {
        let charts = trials[k].elements.charts.iter().filter(|chart| !chart.exported);
        charts.map(|chart| chart.elements.len()).sum::<usize>() as f64
    });
    let elements = covered + grown(shares, hidden);
    let of = |k: usize, stage: Stage| {
        let report = trials[k].stages.iter().find(|report| report.stage == stage);
        report.map_or((0.0, 0.0), |report| (report.seconds, report.rays as f64))
    };
    let ran = |stage: Stage| trials[1].stages.iter().any(|report| report.stage == stage);
    let mut patches = trials[1].light.patches as f64;
    let mut speeds = [Speed::default(); OF_RAYS.len()];
    let mut all = Speed::default();
    let mut loads = [Load::default(); OF_RAYS.len()];
    let mut light_rays = 0.0;
    for (i, stage) in OF_RAYS.into_iter().enumerate().filter(|&(_, stage)| ran(stage)) {
        let rays = [of(0, stage).1, of(1, stage).1];
        let growth = match stage {
            _ if rays[1] == 0.0 => 1.0,
            // Nodes of the gather thin out faster than either law alone tells.
            Stage::Gather if rays[0] > 0.0 => {
                let law = (rays[1] / rays[0]).ln() / (texels[1] / texels[0].max(1.0)).ln().max(0.1);
                let power = (elements / texels[1].max(1.0)).powf(law.clamp(0.0, 1.0));
                power.min(grown(shares, rays) / rays[1])
            }
            _ => grown(shares, rays) / rays[1],
        };
        // Patches are cut finer only where texels allow, and never beyond what was asked for by much.
        let growth = if stage == Stage::Solve { growth.min(MOST_MORE_PATCHES) } else { growth };
        if stage == Stage::Solve {
            patches *= growth;
        }
        loads[i] = Load { elements, rays: rays[1] * growth, patches, page_texels };
        foreseen.rays += loads[i].rays as u64;
        if stage != Stage::Elements {
            light_rays += loads[i].rays;
        }
        for k in 0..2 {
            let patches = trials[k].light.patches as f64;
            let load = Load { elements: texels[k], rays: rays[k], patches, page_texels: 0.0 };
            let (took, modelled) = (of(k, stage).0, model::seconds(stage, &load));
            speeds[i].add(took, modelled);
            // What a light costs is its own: nothing else is as slow or as fast.
            if stage != Stage::Direct {
                all.add(took, modelled);
            }
        }
    }
    foreseen.stages.push((Stage::Transport, of(1, Stage::Transport).0));
    let pace = all.of_all();
    // Whether a light costs by texels or by the rays at borders is its own, too: an image that glows is asked at every texel.
    let took = [0, 1].map(|k| of(k, Stage::Direct).0);
    let paces = std::array::from_fn(|i| match OF_RAYS[i] {
        Stage::Direct if took[1] >= MEASURED_WELL_S => {
            grown(shares, took) / model::seconds(Stage::Direct, &loads[i])
        }
        _ => speeds[i].beside(pace),
    });
    let whole = Whole { loads, paces, ran: OF_RAYS.map(ran), pace };
    for (i, stage) in OF_RAYS.into_iter().enumerate().filter(|&(_, stage)| ran(stage)) {
        foreseen.stages.push((stage, whole.seconds(i, &loads[i])));
    }
    let share = f64::from(options.light.audit_share);
    if share > 0.0 && light_rays > 0.0 {
        let rays = audit_rays(share, light_rays);
        foreseen.stages.push((Stage::Audit, whole.audit_seconds(rays)));
        foreseen.rays += rays as u64;
    }
    let rest = Load { elements, rays: 0.0, patches, page_texels };
    for stage in [Stage::Resolve, Stage::Export] {
        foreseen.stages.push((stage, model::seconds(stage, &rest) * pace));
    }
    (foreseen.elements, foreseen.patches) = (elements as u64, patches as u64);
    whole
}

/// Rays of an audit that gets this share of the light's: where that needs few, its audit needs no more.
fn audit_rays(share: f64, light_rays: f64) -> f64 {
    (share * light_rays).max(AUDIT_BEYOND * audit::LEAST_RAYS as f64).min(light_rays)
}

impl Whole {
    /// Seconds of one of [`OF_RAYS`] under a load.
    fn seconds(&self, stage: usize, load: &Load) -> f64 {
        model::seconds(OF_RAYS[stage], load) * self.paces[stage]
    }

    fn audit_seconds(&self, rays: f64) -> f64 {
        let Load { elements, patches, page_texels, .. } = self.loads[0];
        model::seconds(Stage::Audit, &Load { elements, rays, patches, page_texels }) * self.pace
    }
}

/// A bake at a lower density, with the mean time of every stage of some repetitions.
fn trial(scene: &Scene, options: &BakeOptions, density: f32, audit_share: f32, run: &Run) -> Result<Lit> {
    let atlas = AtlasOptions { density: Some(density), ..options.atlas.clone() };
    let light_options = LightOptions { audit_share, ..options.light.clone() };
    let mut options = BakeOptions { atlas, light: light_options, goal: Goal::Effort, ..options.clone() };
    let quiet = Run { observer: &crate::progress::Silent, memory_limit_bytes: None, ..*run };
    let started = (run.clock)();
    let mut lit = light(scene, &options, &quiet)?;
    let mut runs = 1.0;
    options.light.audit_share = 0.0;
    for _ in 0..REPEATS {
        if (run.clock)() - started < SHORT_SECONDS {
            let again = light(scene, &options, &quiet)?;
            runs += 1.0;
            for (stage, other) in lit.stages.iter_mut().zip(&again.stages) {
                stage.seconds += other.seconds;
            }
        }
    }
    lit.stages.iter_mut().for_each(|stage| stage.seconds /= runs);
    Ok(lit)
}
