//! The straight line, in one screen: one call a stage, plain data in, plain data out.

mod log;
mod output;
mod passes;
mod reflect;
mod schedule;
mod sizing;
mod snapshots;

use crate::atlas::{self, Atlas};
use crate::direct;
use crate::elements::{self, Elements};
use crate::error::{Error, Result, Warning};
use crate::options::{BakeOptions, LightPart};
use crate::plan::{self, Plan, Wanted};
use crate::progress::{Observer, Silent, Stage};
use crate::report::{self, AtlasReport, EnergyReport, LightReport, Report, StageReport};
use crate::scene::Scene;
use crate::solve::coarse::Coarse;
use crate::transport::{AnyTracer, Blocking, Tracer, World};
use crate::units::Irradiance;
use crate::{export, import, memory, with_tracer};
use glam::Vec3;
use log::Log;
use output::Output;
use passes::{Ground, Pass, passes};
use snapshots::Snapshots;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// How a bake runs, as opposed to what it makes.
pub struct Run<'a> {
    /// Worker threads; all cores when absent.
    pub threads: Option<usize>,
    /// Hears of every stage.
    pub observer: &'a dyn Observer,
    /// Set by the caller to get the solution so far.
    pub cancel: &'a AtomicBool,
    /// The most memory the bake may plan for, bytes.
    pub memory_limit_bytes: Option<u64>,
    /// The memory that the machine has left, bytes, where the system tells: a bake that wants more is not begun.
    pub memory_available_bytes: Option<u64>,
    /// Seconds since some start: the library has no clock of its own.
    pub clock: &'a (dyn Fn() -> f64 + Sync),
    /// Most memory the process has had resident so far, bytes, where the system tells.
    pub memory: &'a (dyn Fn() -> Option<u64> + Sync),
    /// Writes the light so far every so many seconds.
    pub snapshot_every_s: Option<f64>,
}

impl Default for Run<'_> {
    /// All cores, nobody listens, nobody stops it, no clock.
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self {
            threads: None,
            observer: &Silent,
            cancel: &NEVER,
            memory_limit_bytes: None,
            memory_available_bytes: None,
            clock: &|| 0.0,
            memory: &|| None,
            snapshot_every_s: None,
        }
    }
}

/// A scene with its light.
pub struct Lit {
    /// What was decided before.
    pub plan: Plan,
    /// Texture space.
    pub atlas: Atlas,
    /// Receivers.
    pub elements: Elements,
    /// Irradiance straight from emitters, one row an element.
    pub direct: Vec<Irradiance>,
    /// All other irradiance, sky included, one row an element.
    pub indirect: Vec<Irradiance>,
    /// The part of `indirect` that no surface reflected; only where not all light is stored.
    pub sky: Option<Vec<Irradiance>>,
    /// What was thought before the light stages that the bake would take, bytes.
    pub predicted_memory_bytes: u64,
    /// What each stage cost.
    pub stages: Vec<StageReport>,
    /// What the light stages did.
    pub light: LightReport,
    /// What the stages noticed.
    pub warnings: Vec<Warning>,
}

impl Lit {
    /// All irradiance of an element.
    pub fn irradiance(&self, element: usize) -> Irradiance {
        self.direct[element] + self.indirect[element]
    }

    fn atlas_report(&self) -> AtlasReport {
        let exported = self.elements.charts.iter().filter(|c| c.exported);
        let texels = exported.clone().map(|c| c.elements.len() as u64).sum();
        let invalid =
            exported.flat_map(|c| c.elements.clone()).filter(|&e| !self.elements.valid[e as usize]).count();
        let pages = self.atlas.pages.iter().filter(|p| p.exported);
        AtlasReport {
            pages: pages.clone().count() as u32,
            page_size_texels: pages.map(|p| p.size_texels).max().unwrap_or(0),
            density_texels_per_m: self.atlas.density,
            fill: self.atlas.fill,
            texels,
            elements: self.elements.len() as u64,
            invalid_texels: invalid as u64,
        }
    }

    fn glimpse(&self) -> Glimpse<'_> {
        Glimpse {
            atlas: &self.atlas,
            elements: &self.elements,
            direct: &self.direct,
            indirect: &self.indirect,
            sky: self.sky.as_deref(),
            unshot_fraction: self.light.unshot_fraction,
        }
    }
}

/// The light so far, as [`Lit`] has it in the end.
#[derive(Clone, Copy)]
struct Glimpse<'a> {
    atlas: &'a Atlas,
    elements: &'a Elements,
    direct: &'a [Irradiance],
    indirect: &'a [Irradiance],
    sky: Option<&'a [Irradiance]>,
    unshot_fraction: f64,
}

impl Glimpse<'_> {
    fn part(&self, part: LightPart) -> Vec<Irradiance> {
        let all = 0..self.elements.len();
        match (part, &self.sky) {
            (LightPart::Full, _) => all.map(|e| self.direct[e] + self.indirect[e]).collect(),
            (LightPart::Direct, None) => self.direct.to_vec(),
            (LightPart::Direct, Some(sky)) => all.map(|e| self.direct[e] + sky[e]).collect(),
            (LightPart::Indirect, None) => self.indirect.to_vec(),
            // Interpolated each on its own, the two may differ by their error where nothing is reflected.
            (LightPart::Indirect, Some(sky)) => {
                all.map(|e| Irradiance((self.indirect[e].0 - sky[e].0).max(Vec3::ZERO))).collect()
            }
        }
    }
}

/// Bakes a file: reads it, lights it, writes the result, tells what was done.
pub fn bake(input: &Path, options: &BakeOptions, run: &Run) -> Result<Report> {
    let path = export::output_path(input, &options.export)?;
    in_pool(run.threads, || {
        let mut log = Log::new(run);
        let (document, scene) = log.stage(Stage::Import, 1, |_| {
            let (document, scene) = import::load(input, &options.import)?;
            export::check_names(&document, &options.export)?;
            Ok(((document, scene), 0))
        })?;
        let output = Output { document: &document, scene: &scene, options, path: &path };
        let write = |light: &Glimpse| output.write_so_far(light);
        let snapshots = Snapshots::new(run, &write);
        let lit = light_into(&scene, options, &mut log, snapshots.as_ref())?;
        let interrupted = log.cancelled();
        let written = output.write(&lit.glimpse(), &mut log)?;
        let missed: Vec<Warning> = snapshots.and_then(Snapshots::warning).into_iter().collect();
        let warnings = [&scene.warnings[..], &lit.warnings, &written.warnings, &missed].concat();
        let others = written.files.iter().filter(|file| **file != path);
        Ok(Report {
            version: env!("CARGO_PKG_VERSION"),
            input: input.to_owned(),
            outputs: [&path].into_iter().chain(others).cloned().collect(),
            interrupted,
            settings: options.clone(),
            lamp_units: scene.lamp_units,
            seconds_total: log.seconds(),
            stages: log.stages,
            predicted_memory_bytes: lit.predicted_memory_bytes,
            atlas: lit.atlas_report(),
            light: lit.light,
            effects: lit.plan.effects,
            warnings: report::sorted(warnings),
        })
    })?
}

/// Lights a scene that is already in memory; no file is read or written.
pub fn light(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<Lit> {
    in_pool(run.threads, || {
        let mut log = Log::new(run);
        let mut lit = light_into(scene, options, &mut log, None)?;
        lit.stages = log.stages;
        Ok(lit)
    })?
}

/// The options with the width of pages that follows from the error between texels; as they are where none was given.
pub fn sized(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<BakeOptions> {
    in_pool(run.threads, || sizing::sized(scene, options, &mut Log::new(run)))?
}

/// What the plan is made for.
pub fn wanted(options: &BakeOptions) -> Wanted {
    Wanted {
        forced: options.effects.clone(),
        direct_alone: options.export.light == LightPart::Direct && options.export.preview.is_none(),
    }
}

fn light_into(
    scene: &Scene,
    options: &BakeOptions,
    log: &mut Log,
    snapshots: Option<&Snapshots>,
) -> Result<Lit> {
    let given = options;
    let options = &sizing::sized(scene, given, log)?;
    let plan = log.stage(Stage::Plan, 1, |_| Ok((plan::plan(scene, &wanted(options)), 0)))?;
    let geometries = scene.geometries.len() as u64;
    let atlas = log.stage(Stage::Atlas, geometries, |progress| {
        Ok((atlas::unwrap(scene, &plan.sides, &options.atlas, progress)?, 0))
    })?;
    let (limit, left) = (log.run.memory_limit_bytes, log.run.memory_available_bytes);
    let predicted_memory_bytes =
        memory::check(scene, &atlas, &plan, options.light.solve.patches, limit, left)?;
    let world = log.stage(Stage::Transport, 1, |_| Ok((World::new(scene), 0)))?;
    let blocking = if plan.work.tinted { Blocking::Tinted } else { world.blocking() };
    let tracer = AnyTracer::new(blocking, &world, scene);
    let lit = with_tracer!(tracer, tracer => shine(scene, plan, atlas, tracer, options, log, snapshots))?;
    let coarse = sizing::too_coarse(given, &lit.light);
    let warnings = lit.warnings.into_iter().chain(coarse).collect();
    Ok(Lit { predicted_memory_bytes, warnings, ..lit })
}

/// The stages that send rays, compiled once for each kind of tracer.
fn shine<T: Tracer>(
    scene: &Scene,
    plan: Plan,
    atlas: Atlas,
    tracer: &T,
    options: &BakeOptions,
    log: &mut Log,
    snapshots: Option<&Snapshots>,
) -> Result<Lit> {
    let (elements, noticed) = log.stage(Stage::Elements, 1, |progress| {
        let back_counts = |surface: usize| !plan.by_force[surface][1];
        let (elements, noticed) = elements::rasterise(scene, &atlas, &back_counts, tracer, progress)?;
        let rays = noticed.rays;
        Ok(((elements, noticed), rays))
    })?;
    let (emitters, sky) = direct::collect(scene, &plan);
    let (pass, spoken) = {
        let (plan, atlas, elements, emitters, sky) = (&plan, &atlas, &elements, &emitters, &sky);
        passes(&Ground { scene, plan, atlas, elements, emitters, sky, tracer, options }, log, snapshots)?
    };
    let light = light_report(&pass, log);
    let warnings = [&atlas.warnings[..], &noticed.warnings, &spoken].concat();
    let direct = Arc::try_unwrap(pass.direct).map_or_else(|kept| kept.irradiance.clone(), |d| d.irradiance);
    Ok(Lit {
        plan,
        atlas,
        direct,
        indirect: pass.reflected.irradiance,
        sky: pass.reflected.sky,
        elements,
        stages: Vec::new(),
        predicted_memory_bytes: 0,
        light,
        warnings,
    })
}

fn light_report(pass: &Pass, log: &Log) -> LightReport {
    let (solved, none) = (pass.reflected.solved.as_deref(), Coarse::default());
    let coarse = solved.map_or(&none, |solved| &solved.coarse);
    LightReport {
        patches: solved.map_or(0, |solved| solved.patches.len() as u64),
        shots: coarse.shots,
        sweeps: coarse.sweeps,
        form_factors: coarse.form_factors,
        rays: log.rays(),
        ledger: EnergyReport {
            emitted: coarse.ledger.emitted.to_array(),
            absorbed: coarse.ledger.absorbed.to_array(),
            escaped: (coarse.ledger.escaped - coarse.ledger.sampling).to_array(),
            sampling: coarse.ledger.sampling.to_array(),
            unshot: coarse.ledger.unshot.to_array(),
        },
        unshot_fraction: coarse.unshot_fraction,
        unshot_error_bound: Some(coarse.error_bound).filter(|bound| bound.is_finite()),
        estimated_error: pass.audit.map(|audit| audit.total),
        error_parts: pass.audit,
    }
}

/// Runs `work` with as many worker threads as wanted; all cores when absent.
pub fn in_pool<R: Send>(threads: Option<usize>, work: impl FnOnce() -> R + Send) -> Result<R> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let pool = pool.map_err(|e| Error::io("threads", std::io::Error::other(e)))?;
    Ok(pool.install(work))
}
