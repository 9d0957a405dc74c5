//! `lightkiln study accuracy`.

use super::{HowArgs, finish, timed};
use crate::cli::args::{AtlasArgs, SceneArgs};
use crate::cli::failure;
use crate::cli::values::Pick;
use clap::Args;
use lightkiln::bake::{Run, sized};
use lightkiln::export;
use lightkiln::import::{self, Document};
use lightkiln::options::{BakeOptions, ErrorBudget, Quality};
use lightkiln::scene::Scene;
use lightkiln::study::Study;
use lightkiln::study::accuracy::{Beside, accuracy, read_beside, write_reference};
use lightkiln::text::printable;
use lightkiln::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The arguments of `study accuracy`, as typed.
#[derive(Debug, Args)]
pub struct AccuracyArgs {
    /// The scene, a .glb or .gltf file
    #[arg(value_name = "SCENE")]
    pub input: PathBuf,

    /// The effort around which single settings are varied
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = Pick(Quality::default()))]
    pub quality: Pick<Quality>,

    /// Results of others for the same table and plots, a CSV with columns as accuracy.csv has them
    #[arg(long, value_name = "FILE")]
    pub beside: Vec<PathBuf>,

    /// Texture space.
    #[command(flatten)]
    pub atlas: AtlasArgs,

    /// How the scene is read.
    #[command(flatten)]
    pub scene: SceneArgs,

    /// How it is done.
    #[command(flatten)]
    pub how: HowArgs,
}

/// Studies, prints, writes, and returns the exit code.
pub fn run(args: &AccuracyArgs) -> ExitCode {
    finish(study(args), &args.how, Some(&args.input))
}

fn study(args: &AccuracyArgs) -> Result<Study> {
    let options = BakeOptions {
        import: args.scene.import(),
        atlas: args.atlas.atlas(&ErrorBudget::of(args.quality.0)),
        light: args.quality.0.light(),
        ..BakeOptions::default()
    };
    let mut beside = Vec::new();
    for file in &args.beside {
        beside.extend(read_beside(file)?);
    }
    // An hour of baking must not end at a folder that cannot be made.
    if let Some(folder) = &args.how.out {
        std::fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
    }
    export::settle(&args.input);
    let (document, scene) = import::load(&args.input, &options.import)?;
    let job = Job { args, options, document, scene, beside };
    timed(&args.how, |run| job.study(run))
}

struct Job<'a> {
    args: &'a AccuracyArgs,
    options: BakeOptions,
    document: Document,
    scene: Scene,
    beside: Vec<Beside>,
}

impl Job<'_> {
    fn study(self, run: &Run) -> Result<Study> {
        let Self { args, options, document, scene, beside } = self;
        let options = sized(&scene, &options, run)?;
        let name = args.input.file_stem().map_or(Path::new("scene"), Path::new).display().to_string();
        let outcome = accuracy(&name, &scene, &options, beside, run, &|line| failure::say(&printable(line)))?;
        if let Some(folder) = &args.how.out {
            for file in write_reference(&document, &scene, &options, &outcome.truth, folder)? {
                failure::say(&format!("wrote {}", printable(&file.display().to_string())));
            }
        }
        Ok(outcome.study())
    }
}
