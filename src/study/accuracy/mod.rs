//! What accuracy costs: one scene, baked many times over with more and with less effort, judged by a converged bake.
//!
//! The truth is gathered at every texel, and every texel's shadows are those of its whole square. It is baked twice, with
//! samples that no other bake uses and with other patches; what the two differ by is how well the truth is known
//! ([`Truth`]). Then the effort is varied, one setting at a time ([`sweep`]), and every bake is compared with the truth texel by texel
//! ([`Errors`]). Bakes of other densities have other texels: their lightmaps are looked up, as a viewer would, at the
//! texel centres of a converged bake of twice the density ([`grids`]).

mod beside;
mod grids;
mod maps;
mod measure;
mod show;
mod sweep;
mod trace;
mod truth;

pub use beside::{Beside, read as read_beside};
pub use measure::{Errors, errors, pareto};
pub use sweep::{Setting, settings};
pub use trace::Trace;
pub use truth::{
    AGREEMENT, Judged, Round, Truth, beside, efforts, find as find_truth, write as write_reference,
};

use super::Study;
use crate::bake::{Lit, Run, light};
use crate::error::{Error, Result};
use crate::memory;
use crate::options::{AtlasOptions, BakeOptions, LightOptions, Solver};
use crate::scene::Scene;
use crate::solve::{Relaxation, Rows, matrix};
use crate::text;
use std::collections::HashMap;

/// Bakes that take less than this are repeated, seconds.
const SHORT_SECONDS: f64 = 1.0;
/// How often; the shortest time counts.
const REPEATS: usize = 3;

/// What a bake took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// All stages from plan to gather.
    pub seconds: f64,
    /// Rays of all stages.
    pub rays: u64,
    /// The most memory it holds at once, bytes, as it is foretold from its texels, triangles, patches and form factors:
    /// the process that bakes all of a study only ever grows, and would tell every bake the memory of the largest before.
    pub memory_bytes: u64,
    /// What the bake itself estimates its rms error to be, as a share of the mean, where it does.
    pub estimated_error: Option<f64>,
}

/// What a lightmap is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum By {
    /// The truth, texel by texel.
    Texels,
    /// The truth of twice the density, at its texels, by bilinear lookup.
    Places,
}

/// One setting and what came of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// What was varied.
    pub sweep: &'static str,
    /// To what.
    pub setting: String,
    /// What it took.
    pub cost: Cost,
    /// How far off it is.
    pub errors: Errors,
    /// What it was compared with.
    pub by: By,
    /// Whether no other bake that is compared with the same is both faster and nearer.
    pub best: bool,
}

/// All that was found.
pub struct Outcome {
    /// What the tables call the scene.
    pub name: String,
    /// The truth and how well it is known.
    pub truth: Truth,
    /// Every setting.
    pub trials: Vec<Trial>,
    /// How the unshot power falls.
    pub traces: Vec<Trace>,
    /// Results of others.
    pub beside: Vec<Beside>,
    maps: Vec<super::Picture>,
}

impl Outcome {
    /// Everything as tables, plots and pictures.
    pub fn study(&self) -> Study {
        show::study(self)
    }
}

/// Studies a scene around the effort of `options`; `told` hears what comes next.
pub fn accuracy(
    name: &str,
    scene: &Scene,
    options: &BakeOptions,
    beside: Vec<Beside>,
    run: &Run,
    told: &dyn Fn(&str),
) -> Result<Outcome> {
    let truth = truth::find(scene, options, efforts(), run, told)?;
    let mut maps = vec![maps::light(scene, &truth)];
    let mut trials = Vec::new();
    let mut known: HashMap<String, (Cost, Errors)> = HashMap::new();
    let all = sweep::settings(options);
    for (number, Setting { sweep, value, options }) in all.iter().enumerate() {
        let key = format!("{options:?}");
        let (cost, errors) = match known.get(&key) {
            Some(found) => *found,
            None => {
                let (cost, lit) = timed(scene, options, run)?;
                let found = truth.judged.light(&lit);
                let errors = judge(&found, &truth.judged)?;
                if *sweep == sweep::QUALITY {
                    maps.push(maps::error(
                        value,
                        &truth,
                        &measure::texelwise(&found, &truth.judged),
                        &errors,
                    ));
                }
                known.insert(key, (cost, errors));
                (cost, errors)
            }
        };
        told(&line(number, all.len(), sweep, value, &cost, &errors));
        trials.push(Trial { sweep, setting: value.clone(), cost, errors, by: By::Texels, best: false });
    }
    trials.extend(densities(scene, options, truth.lit.atlas.density, run, told)?);
    mark(&mut trials);
    let traces = trace::traces(scene, options, run, told)?;
    Ok(Outcome { name: name.to_owned(), truth, trials, traces, beside, maps })
}

fn line(number: usize, of: usize, sweep: &str, setting: &str, cost: &Cost, errors: &Errors) -> String {
    let (number, seconds) = (number + 1, text::duration(cost.seconds));
    format!("{number} of {of}: {sweep} {setting}: {seconds}, {} rms", text::percent(errors.rms))
}

fn judge(found: &[glam::Vec3], judged: &Judged) -> Result<Errors> {
    errors(found, &judged.truth, &judged.area)
        .ok_or_else(|| Error::invalid("the scene", "bakes of the same texture space have other texels"))
}

/// Marks the best of those that are compared with the same.
fn mark(trials: &mut [Trial]) {
    for by in [By::Texels, By::Places] {
        let rows: Vec<usize> = (0..trials.len()).filter(|&i| trials[i].by == by).collect();
        let choices: Vec<[f64; 2]> =
            rows.iter().map(|&i| [trials[i].cost.seconds, trials[i].errors.rms]).collect();
        for (&i, best) in rows.iter().zip(pareto(&choices)) {
            trials[i].best = best;
        }
    }
}

/// Bakes of lower densities, judged at the places of a converged bake of twice the density.
fn densities(
    scene: &Scene,
    options: &BakeOptions,
    density: f32,
    run: &Run,
    told: &dyn Fn(&str),
) -> Result<Vec<Trial>> {
    let at = |share: f32, light: LightOptions, size: u32| BakeOptions {
        atlas: AtlasOptions { density: Some(density * share), page_size: size, ..options.atlas.clone() },
        light,
        ..options.clone()
    };
    told("reference of twice the density");
    let size = options.atlas.page_size.saturating_mul(2).min(LARGEST_PAGE);
    let fine = light(scene, &at(2.0, truth::of_fine_texels(), size), run)?;
    let all = Judged::of(&fine);
    let mut trials = Vec::new();
    for (number, (name, share)) in sweep::DENSITIES.into_iter().enumerate() {
        let options = at(share, options.light.clone(), options.atlas.page_size);
        let (cost, lit) = timed(scene, &options, run)?;
        let seen = grids::looked_up(scene, &lit, &fine, &all.element);
        let (mut found, mut judged) = (Vec::new(), Judged::default());
        for (i, value) in seen.into_iter().enumerate() {
            let Some(value) = value else { continue };
            found.push(value);
            judged.truth.push(all.truth[i]);
            judged.area.push(all.area[i]);
        }
        let errors = judge(&found, &judged)?;
        let setting = format!("× {name}: {} texels/m", text::significant(lit.atlas.density.into()));
        told(&line(number, sweep::DENSITIES.len(), "density", &setting, &cost, &errors));
        trials.push(Trial { sweep: "density", setting, cost, errors, by: By::Places, best: false });
    }
    Ok(trials)
}

/// Pages are not made wider than this, texels.
const LARGEST_PAGE: u32 = 16384;

/// A bake and what it took.
fn timed_once(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<(Cost, Lit)> {
    let started = (run.clock)();
    let lit = light(scene, options, run)?;
    let seconds = (run.clock)() - started;
    let memory_bytes = memory_of(scene, options, &lit);
    let estimated_error = lit.light.estimated_error;
    Ok((Cost { seconds, rays: lit.light.rays, memory_bytes, estimated_error }, lit))
}

/// The same with the shortest time of some repetitions.
fn timed(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<(Cost, Lit)> {
    let (mut cost, lit) = timed_once(scene, options, run)?;
    for _ in 1..REPEATS {
        if cost.seconds > 0.0 && cost.seconds < SHORT_SECONDS {
            cost.seconds = cost.seconds.min(timed_once(scene, options, run)?.0.seconds);
        }
    }
    Ok((cost, lit))
}

/// The most memory of a bake, with the form factors that it really kept.
fn memory_of(scene: &Scene, options: &BakeOptions, lit: &Lit) -> u64 {
    let (patches, entries) = (lit.light.patches as usize, lit.light.form_factors as usize);
    let rows = Rows::predicted_bytes(patches, entries);
    let solve = &options.light.solve;
    let solver = match (solve.solver, solve.relaxation) {
        (Solver::Progressive, _) => rows,
        (Solver::Matrix, crate::options::Relaxation::Cg) => {
            matrix::predicted_bytes(patches, entries, Relaxation::ConjugateGradient)
        }
        (Solver::Matrix, _) => matrix::predicted_bytes(patches, entries, Relaxation::GaussSeidel),
    };
    memory::predict(scene, &lit.atlas, 0) + rows + solver
}
