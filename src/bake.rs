//! The straight line, in one screen: one call a stage, plain data in, plain data out.

use crate::atlas::Atlas;
use crate::direct::{self, EmitterList};
use crate::elements::{Elements, Lookup, Patches};
use crate::error::{Error, Result, Warning};
use crate::export::{self, Metadata};
use crate::gather::{self, Surroundings};
use crate::options::{BakeOptions, LightPart};
use crate::plan::{self, Plan};
use crate::progress::{Observer, Progress, Silent, Stage};
use crate::report::{AtlasReport, EnergyReport, LightReport, Report, StageReport};
use crate::resolve;
use crate::scene::Scene;
use crate::solve::{self, Solution};
use crate::transport::{Hit, Tracer, World};
use crate::units::{Irradiance, Radiosity};
use crate::{atlas, elements, import, with_tracer};
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

    fn part(&self, part: LightPart) -> Vec<Irradiance> {
        match part {
            LightPart::Full => (0..self.elements.len()).map(|e| self.irradiance(e)).collect(),
            LightPart::Direct => self.direct.clone(),
            LightPart::Indirect => self.indirect.clone(),
        }
    }
}

/// Bakes a file: reads it, lights it, writes the result, tells what was done.
pub fn bake(input: &Path, options: &BakeOptions, run: &Run) -> Result<Report> {
    let output = export::output_path(input, &options.export)?;
    in_pool(run.threads, || {
        let started = (run.clock)();
        let mut log = Log::new(run);
        let import = log.begin(Stage::Import, 1);
        let (document, scene) = import::load(input, &options.import)?;
        log.end(import, 0);

        let lit = light_into(&scene, options, run, &mut log)?;

        let resolve = log.begin(Stage::Resolve, 1);
        let part = lit.part(options.export.light);
        let lightmap = resolve::resolve(&scene, &lit.elements, &lit.atlas, &part, options.export.store);
        let preview = options.export.preview.as_ref().map(|_| {
            let all = lit.part(LightPart::Full);
            resolve::resolve(&scene, &lit.elements, &lit.atlas, &all, Store::Radiosity).scaled(1.0 / PI)
        });
        log.end(resolve, 0);

        let export = log.begin(Stage::Export, 1);
        let metadata = metadata(options, &scene, &lit);
        let written = export::write(
            &document,
            &scene,
            &lit.atlas,
            &lightmap,
            preview.as_ref(),
            &metadata,
            &output,
            &options.export,
        )?;
        log.end(export, 0);

        let warnings = [scene.warnings.clone(), lit.warnings.clone(), written.warnings].concat();
        Ok(Report {
            version: env!("CARGO_PKG_VERSION"),
            input: input.to_owned(),
            outputs: written.files,
            interrupted: run.cancel.load(Ordering::Relaxed),
            settings: options.clone(),
            lamp_units: scene.lamp_units,
            atlas: atlas_report(&lit),
            light: lit.light,
            effects: lit.plan.effects,
            warnings: report::sorted(warnings),
            seconds_total: (run.clock)() - started,
            stages: log.stages,
        })
    })
}

/// Lights a scene that is already in memory; no file is read or written.
pub fn light(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<Lit> {
    in_pool(run.threads, || {
        let mut log = Log::new(run);
        let mut lit = light_into(scene, options, run, &mut log)?;
        lit.stages = log.stages;
        Ok(lit)
    })
}

fn light_into(scene: &Scene, options: &BakeOptions, run: &Run, log: &mut Log) -> Result<Lit> {
    let stage = log.begin(Stage::Plan, 1);
    let plan = plan::plan(scene, options);
    log.end(stage, 0);

    let stage = log.begin(Stage::Atlas, scene.geometries.len() as u64);
    let atlas = atlas::unwrap(scene, &plan.sides, &options.atlas, &stage)?;
    log.end(stage, 0);
    memory::check(scene, &atlas, options, run.memory_limit_bytes)?;

    let stage = log.begin(Stage::Transport, 1);
    let world = World::new(scene);
    log.end(stage, 0);

    with_tracer!(world.tracer(scene), tracer => shine(scene, plan, atlas, tracer, options, log))
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
    let stage = log.begin(Stage::Elements, 1);
    let (elements, noticed) = elements::rasterise(scene, &atlas, tracer, &stage);
    let lookup = Lookup::new(&atlas, &elements, tracer.world());
    log.end(stage, noticed.rays);

    let mut stage = log.begin(Stage::Direct, elements.len() as u64);
    let (emitters, sky) = direct::collect(scene);
    let direct = direct::light(&elements, &emitters, tracer, &effort.direct, &mut stage);
    log.end(stage, direct.rays);

    let stage = log.begin(Stage::Solve, u64::from(effort.solve.patches));
    let faint = Faint::new(&elements, &emitters, &direct);
    let patches = elements::patches(&elements, effort.solve.patches);
    let coarse = solve::coarse(&elements, &lookup, &patches, &direct, faint.as_ref(), tracer, &sky, &effort.solve, &stage);
    log.end(stage, coarse.rays);

    let mut stage = log.begin(Stage::Gather, elements.len() as u64);
    let smooth = gather::spread_over_elements(&elements, &patches.patch_of_element, &patches.size_elements(), &coarse.irradiance);
    let radiosity: Vec<Radiosity> = (0..elements.len())
        .map(|e| elements.reflectance[e] * (direct.irradiance[e] + smooth[e]))
        .collect();
    let around = Surroundings {
        tracer,
        radiosity: |hit: &Hit| lookup.element_at(hit).map_or(Radiosity::ZERO, |e| radiosity[e as usize]),
        sky: &sky,
        faint: faint.as_ref(),
    };
    let indirect = gather::gather(&elements, &direct, &smooth, &around, &effort.gather, &mut stage);
    log.end(stage, indirect.rays);
    todo!()
}
