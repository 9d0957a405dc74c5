//! The straight line, in one screen: one call a stage, plain data in, plain data out.

mod reflect;

use crate::atlas::{self, Atlas};
use crate::direct::{self, Faint};
use crate::elements::{self, Elements, Lookup};
use crate::error::{Error, Result, Warning};
use crate::export::{self, Metadata};
use crate::options::{BakeOptions, ImportOptions, LightPart, RenderOptions, Store};
use crate::plan::{self, Plan, Wanted};
use crate::progress::{Observer, Progress, Silent, Stage};
use crate::report::{self, AtlasReport, EnergyReport, LightReport, Report, StageReport};
use crate::scene::Scene;
use crate::transport::{AnyTracer, Blocking, Tracer, World};
use crate::units::Irradiance;
use crate::{baked, import, memory, render, resolve, with_tracer};
use glam::Vec3;
use reflect::{Around, Reflected, Straight};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

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

    fn part(&self, part: LightPart) -> Vec<Irradiance> {
        let all = 0..self.elements.len();
        match (part, &self.sky) {
            (LightPart::Full, _) => all.map(|e| self.irradiance(e)).collect(),
            (LightPart::Direct, None) => self.direct.clone(),
            (LightPart::Direct, Some(sky)) => all.map(|e| self.direct[e] + sky[e]).collect(),
            (LightPart::Indirect, None) => self.indirect.clone(),
            // Interpolated each on its own, the two may differ by their error where nothing is reflected.
            (LightPart::Indirect, Some(sky)) => {
                all.map(|e| Irradiance((self.indirect[e].0 - sky[e].0).max(Vec3::ZERO))).collect()
            }
        }
    }
}

/// Bakes a file: reads it, lights it, writes the result, tells what was done.
pub fn bake(input: &Path, options: &BakeOptions, run: &Run) -> Result<Report> {
    let started = (run.clock)();
    let output = export::output_path(input, &options.export)?;
    in_pool(run.threads, || {
        let mut log = Log::new(run);
        let (document, scene) = log.stage(Stage::Import, 1, |_| {
            let (document, scene) = import::load(input, &options.import)?;
            export::check_names(&document, &options.export)?;
            Ok(((document, scene), 0))
        })?;
        let lit = light_into(&scene, options, &mut log)?;
        let interrupted = run.cancel.load(Ordering::Relaxed);
        let (lightmap, white) = log.stage(Stage::Resolve, 1, |_| {
            let part = lit.part(options.export.light);
            let lightmap = resolve::resolve(&scene, &lit.elements, &lit.atlas, &part, options.export.store);
            let white = options.export.preview.as_ref().map(|_| {
                let all = lit.part(LightPart::Full);
                resolve::resolve(&scene, &lit.elements, &lit.atlas, &all, Store::IrradianceOverPi)
            });
            Ok(((lightmap, white), 0))
        })?;
        let written = log.stage(Stage::Export, 1, |_| {
            let metadata = metadata(options, &scene, &lit);
            let mut written = export::write(
                &document,
                &scene,
                &lit.atlas,
                &lightmap,
                white.as_ref(),
                &metadata,
                &options.export,
            )?;
            if let Some(path) = &options.export.picture {
                written.warnings.extend(take_picture(path, &output, &options.import)?);
                written.files.push(path.clone());
            }
            Ok((written, 0))
        })?;
        let warnings = [scene.warnings.clone(), lit.warnings.clone(), written.warnings].concat();
        Ok(Report {
            version: env!("CARGO_PKG_VERSION"),
            input: input.to_owned(),
            outputs: [&output]
                .into_iter()
                .chain(written.files.iter().filter(|f| **f != output))
                .cloned()
                .collect(),
            interrupted,
            settings: options.clone(),
            lamp_units: scene.lamp_units,
            seconds_total: (run.clock)() - started,
            stages: log.stages,
            predicted_memory_bytes: lit.predicted_memory_bytes,
            atlas: lit.atlas_report(),
            light: lit.light,
            effects: lit.plan.effects,
            warnings: report::sorted(warnings),
        })
    })?
}

/// A picture of what was just written, as `lightkiln render` would take it; a warning where there is nothing to see.
fn take_picture(path: &Path, output: &Path, import: &ImportOptions) -> Result<Option<Warning>> {
    let seen =
        baked::read(output, import).and_then(|baked| render::picture(&baked, &RenderOptions::default()));
    match seen {
        Ok(picture) => export::write_png(path, picture.size, &picture.rgb).map(|()| None),
        Err(error) => Ok(Some(Warning::new(path.display().to_string(), format!("no picture: {error}")))),
    }
}

fn metadata(options: &BakeOptions, scene: &Scene, lit: &Lit) -> Metadata {
    Metadata {
        generator: concat!("lightkiln ", env!("CARGO_PKG_VERSION")).to_owned(),
        settings: serde_json::to_value(options).unwrap_or_default(),
        convergence: vec![("unshot".to_owned(), lit.light.unshot_fraction)],
        scene: scene.index,
    }
}

/// Lights a scene that is already in memory; no file is read or written.
pub fn light(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<Lit> {
    in_pool(run.threads, || {
        let mut log = Log::new(run);
        let mut lit = light_into(scene, options, &mut log)?;
        lit.stages = log.stages;
        Ok(lit)
    })?
}

/// What the plan is made for.
pub fn wanted(options: &BakeOptions) -> Wanted {
    Wanted {
        forced: options.effects.clone(),
        direct_alone: options.export.light == LightPart::Direct && options.export.preview.is_none(),
    }
}

fn light_into(scene: &Scene, options: &BakeOptions, log: &mut Log) -> Result<Lit> {
    let plan = log.stage(Stage::Plan, 1, |_| Ok((plan::plan(scene, &wanted(options)), 0)))?;
    let geometries = scene.geometries.len() as u64;
    let atlas = log.stage(Stage::Atlas, geometries, |progress| {
        Ok((atlas::unwrap(scene, &plan.sides, &options.atlas, progress)?, 0))
    })?;
    let (limit, left) = (log.run.memory_limit_bytes, log.run.memory_available_bytes);
    let predicted_memory_bytes = memory::check(scene, &atlas, options.light.solve.patches, limit, left)?;
    let world = log.stage(Stage::Transport, 1, |_| Ok((World::new(scene), 0)))?;
    let blocking = if plan.work.tinted { Blocking::Tinted } else { world.blocking() };
    let tracer = AnyTracer::new(blocking, &world, scene);
    let lit = with_tracer!(tracer, tracer => shine(scene, plan, atlas, tracer, options, log))?;
    Ok(Lit { predicted_memory_bytes, ..lit })
}

/// The stages that send rays, compiled once for each kind of tracer.
fn shine<T: Tracer>(
    scene: &Scene,
    plan: Plan,
    atlas: Atlas,
    tracer: &T,
    options: &BakeOptions,
    log: &mut Log,
) -> Result<Lit> {
    let effort = &options.light;
    let (elements, noticed) = log.stage(Stage::Elements, 1, |progress| {
        let back_counts = |surface: usize| !plan.by_force[surface][1];
        let (elements, noticed) = elements::rasterise(scene, &atlas, &back_counts, tracer, progress)?;
        let rays = noticed.rays;
        Ok(((elements, noticed), rays))
    })?;
    let count = elements.len() as u64;
    let (emitters, sky) = direct::collect(scene, &plan);
    let direct = log.stage(Stage::Direct, count, |progress| {
        let direct =
            direct::light(&elements, &emitters, &plan, tracer, &effort.direct, effort.seed, progress);
        let rays = direct.rays;
        Ok((direct, rays))
    })?;
    let faint = Faint::new(&elements, &emitters, &direct, effort.seed);
    let lit = if plan.work.gather || faint.is_some() {
        let lookup = Lookup::new(scene, &atlas, tracer.world(), &elements);
        let around =
            Around { scene, plan: &plan, atlas: &atlas, elements: &elements, lookup: &lookup, tracer };
        let from = Straight { direct: &direct, faint: faint.as_ref(), sky: &sky };
        around.reflect(&from, effort, options.export.light != LightPart::Full, log)?
    } else {
        Reflected::nothing(elements.len())
    };
    let light = LightReport {
        patches: lit.patches as u64,
        shots: lit.coarse.shots,
        sweeps: lit.coarse.sweeps,
        form_factors: lit.coarse.form_factors,
        rays: log.stages.iter().map(|s| s.rays).sum(),
        ledger: EnergyReport {
            emitted: lit.coarse.ledger.emitted.to_array(),
            absorbed: lit.coarse.ledger.absorbed.to_array(),
            escaped: lit.coarse.ledger.escaped.to_array(),
            unshot: lit.coarse.ledger.unshot.to_array(),
        },
        unshot_fraction: lit.coarse.unshot_fraction,
        unshot_error_bound: Some(lit.coarse.error_bound).filter(|bound| bound.is_finite()),
        estimated_error: None,
    };
    let warnings = [atlas.warnings.clone(), noticed.warnings].concat();
    Ok(Lit {
        plan,
        atlas,
        direct: direct.irradiance,
        indirect: lit.irradiance,
        sky: lit.sky,
        elements,
        stages: Vec::new(),
        predicted_memory_bytes: 0,
        light,
        warnings,
    })
}

/// Times the stages.
struct Log<'a> {
    run: &'a Run<'a>,
    stages: Vec<StageReport>,
}

impl<'a> Log<'a> {
    fn new(run: &'a Run<'a>) -> Self {
        Self { run, stages: Vec::new() }
    }

    /// Runs a stage of `total` units, which returns its result and the rays it sent.
    fn stage<R>(
        &mut self,
        stage: Stage,
        total: u64,
        work: impl FnOnce(&mut Progress) -> Result<(R, u64)>,
    ) -> Result<R> {
        let started = (self.run.clock)();
        let mut progress = Progress::begin(self.run.observer, self.run.cancel, stage, total);
        let (result, rays) = work(&mut progress)?;
        self.stages.push(StageReport {
            stage,
            seconds: (self.run.clock)() - started,
            rays,
            peak_memory_bytes: (self.run.memory)(),
        });
        Ok(result)
    }
}

/// Runs `work` with as many worker threads as wanted; all cores when absent.
pub fn in_pool<R: Send>(threads: Option<usize>, work: impl FnOnce() -> R + Send) -> Result<R> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let pool = pool.map_err(|e| Error::io("threads", std::io::Error::other(e)))?;
    Ok(pool.install(work))
}
