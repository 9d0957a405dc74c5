//! What a bake will take, before it is begun: texels, rays, seconds, memory.
//!
//! The plan and texture space are made in full; what the light stages take is found by two trials at a fraction of the
//! density and carried on, stage by stage: what is spent on areas grows with the square of the density, what is spent on
//! edges and shadow borders with the density itself. So it holds for any machine, and for scenes whose cost no count of
//! triangles would tell.

use crate::atlas;
use crate::audit;
use crate::bake::{Lit, Run, in_pool, light, wanted};
use crate::error::Result;
use crate::memory;
use crate::options::{AtlasOptions, BakeOptions, Goal, LightOptions};
use crate::plan::{Finding, plan};
use crate::progress::{Progress, Stage};
use crate::scene::Scene;
use serde::Serialize;

/// Densities of the trials, as shares of the bake's: their texels are about 1/81 and 1/9 of all.
const TRIALS: [f32; 2] = [1.0 / 9.0, 1.0 / 3.0];
/// The same of small bakes: a ninth of their texels would be too few to tell from, and more of them cost little.
const TRIALS_OF_SMALL: [f32; 2] = [1.0 / 3.0, 2.0 / 3.0];
/// Covered texels of a small bake.
const SMALL_TEXELS: f64 = 200_000.0;
/// How often a trial is repeated, at the most; the shortest time counts.
const REPEATS: usize = 3;
/// Trials are repeated until they took this long together, seconds.
const SHORT_SECONDS: f64 = 0.3;
/// Resolving, encoding and writing a page, seconds a texel: 512² take 0.03 s on two cores of 2020's.
const WRITE_SECONDS_PER_TEXEL: f64 = 1.2e-7;

/// The rays of an audit go everywhere at once: they take so many times as long as others.
const AUDIT_SLOWER: f64 = 1.7;

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
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Which effects are simulated and why.
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
}

impl Forecast {
    /// All stages, seconds.
    pub fn seconds(&self) -> f64 {
        self.stages.iter().map(|stage| stage.1).sum()
    }

    /// The stages that find the light, plan to gather, seconds.
    pub fn light_seconds(&self) -> f64 {
        self.stages.iter().filter(|stage| stage.0 <= Stage::Gather).map(|stage| stage.1).sum()
    }
}

/// Tells what baking a scene will take. Needs a clock in `run`, or all seconds are 0; takes about a tenth of the bake,
/// and as long for texture space as the bake does.
pub fn forecast(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<Forecast> {
    in_pool(run.threads, || {
        let started = (run.clock)();
        let plan = plan(scene, &wanted(options));
        let planned = (run.clock)();
        let geometries = scene.geometries.len() as u64;
        let progress = Progress::begin(run.observer, run.cancel, Stage::Atlas, geometries);
        let atlas = atlas::unwrap(scene, &plan.sides, &options.atlas, &progress)?;
        let unwrapped = (run.clock)();
        let memory_bytes = memory::predict(scene, &atlas, options.light.solve.patches);
        let pages = atlas.pages.iter().filter(|page| page.exported);
        let covered: f64 =
            pages.map(|page| f64::from(page.size_texels).powi(2) * f64::from(atlas.fill)).sum();
        let trials = if covered < SMALL_TEXELS { TRIALS_OF_SMALL } else { TRIALS };
        let [small, large] = trials.map(|share| trial(scene, options, atlas.density * share, run));
        let (small, large) = (small?, large?);

        // Where nothing takes a lightmap there is no density.
        let shares = if atlas.density > 0.0 {
            [&small, &large].map(|lit| f64::from(lit.atlas.density) / f64::from(atlas.density))
        } else {
            trials.map(f64::from)
        };
        let texels = [&small, &large].map(|lit| lit.elements.len() as f64);
        let hidden = [&small, &large].map(|lit| {
            let charts = lit.elements.charts.iter().filter(|chart| !chart.exported);
            charts.map(|chart| chart.elements.len()).sum::<usize>() as f64
        });
        let elements = covered + grown(shares, hidden);
        let mut stages = vec![(Stage::Plan, planned - started), (Stage::Atlas, unwrapped - planned)];
        let (mut rays, mut light_rays, mut patches) = (0.0, 0.0, large.light.patches as f64);
        for stage in [Stage::Transport, Stage::Elements, Stage::Direct, Stage::Solve, Stage::Gather] {
            let find = |lit: &Lit| lit.stages.iter().find(|report| report.stage == stage).cloned();
            let Some(last) = find(&large) else { continue };
            let first = find(&small);
            let sent = first.as_ref().map_or(0.0, |first| first.rays as f64);
            let growth = match stage {
                Stage::Transport => 1.0,
                // Nodes of the gather thin out faster than either law alone tells.
                Stage::Gather if last.rays > 0 && sent > 0.0 => {
                    let law = (last.rays as f64 / sent).ln() / (texels[1] / texels[0].max(1.0)).ln().max(0.1);
                    let power = (elements / texels[1]).powf(law.clamp(0.0, 1.0));
                    power.min(grown(shares, [sent, last.rays as f64]) / last.rays as f64)
                }
                _ if last.rays > 0 && stage != Stage::Elements => {
                    grown(shares, [sent, last.rays as f64]) / last.rays as f64
                }
                _ => elements / texels[1].max(1.0),
            };
            // Patches are cut finer only where texels allow, and never beyond what was asked for by much.
            let growth = if stage == Stage::Solve { growth.min(MOST_MORE_PATCHES) } else { growth };
            if stage == Stage::Solve {
                patches *= growth;
            }
            rays += last.rays as f64 * growth;
            if stage != Stage::Elements {
                light_rays += last.rays as f64 * growth;
            }
            // What the solver does with elements takes as long as its rays where patches are few.
            let slower = match (stage, &first) {
                (Stage::Solve, Some(first)) if last.seconds > 0.0 => {
                    (grown(shares, [first.seconds, last.seconds]) / last.seconds)
                        .clamp(1.0, 2.0 * MOST_MORE_PATCHES)
                }
                _ => growth,
            };
            stages.push((stage, last.seconds * slower));
        }
        let share = f64::from(options.light.audit_share);
        if share > 0.0 && light_rays > 0.0 {
            let light = [Stage::Direct, Stage::Solve, Stage::Gather];
            let took =
                stages.iter().filter(|stage| light.contains(&stage.0)).map(|stage| stage.1).sum::<f64>();
            // Where the light needs few rays, its audit needs no more.
            let audited = (share * light_rays).max(audit::LEAST_RAYS as f64).min(light_rays);
            stages.push((Stage::Audit, AUDIT_SLOWER * audited * took / light_rays));
            rays += audited;
        }
        let exported = atlas.pages.iter().filter(|page| page.exported);
        let size = exported.clone().map(|page| page.size_texels).max().unwrap_or(0);
        let pages = exported.count() as u32;
        let written = f64::from(pages) * f64::from(size).powi(2) * WRITE_SECONDS_PER_TEXEL;
        stages.push((Stage::Export, written));
        Ok(Forecast {
            effects: plan.effects,
            pages,
            page_size_texels: size,
            density_texels_per_m: atlas.density,
            elements: elements as u64,
            patches: patches as u64,
            rays: rays as u64,
            stages,
            memory_bytes,
        })
    })?
}

/// A bake at a lower density, with the shortest time of every stage of some repetitions.
fn trial(scene: &Scene, options: &BakeOptions, density: f32, run: &Run) -> Result<Lit> {
    let density = Some(density).filter(|&density| density > 0.0);
    let atlas = AtlasOptions { density: density.or(options.atlas.density), ..options.atlas.clone() };
    let light_options = LightOptions { audit_share: 0.0, ..options.light.clone() };
    let options = BakeOptions { atlas, light: light_options, goal: Goal::Effort, ..options.clone() };
    let quiet = Run { observer: &crate::progress::Silent, memory_limit_bytes: None, ..*run };
    let started = (run.clock)();
    let mut lit = light(scene, &options, &quiet)?;
    for _ in 0..REPEATS {
        if (run.clock)() - started < SHORT_SECONDS {
            let again = light(scene, &options, &quiet)?;
            for (stage, other) in lit.stages.iter_mut().zip(&again.stages) {
                stage.seconds = stage.seconds.min(other.seconds);
            }
        }
    }
    Ok(lit)
}
