//! `lightkiln study`.

mod accuracy;
mod cost;

use super::args::{AtlasArgs, SceneArgs};
use super::failure;
use super::memory;
use super::values::{self, Pick};
use clap::{Args, Subcommand};
use lightkiln::bake::{Run, in_pool};
use lightkiln::options::{BakeOptions, ErrorBudget, Quality};
use lightkiln::study::effects::{Subject, effects};
use lightkiln::study::stability::stability;
use lightkiln::study::{Study, write};
use lightkiln::text::printable;
use lightkiln::{Error, Result, export, import};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

const EXAMPLES: &str = "\
Examples:
  lightkiln study accuracy room.glb --out study       what accuracy costs, with plots
  lightkiln study effects room.glb                    what leaving effects out saves in this scene
  lightkiln study effects fixtures/*.glb --out study  the same of many, as CSV and as a page with plots
  lightkiln study stability --out study               hard cases and their exact answers; needs no scene

Exit codes: 0 everything held, 1 something did not, or could not be studied, 2 wrong usage.";

/// The arguments of `study`, as typed.
#[derive(Debug, Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
pub struct StudyArgs {
    /// What is studied.
    #[command(subcommand)]
    pub command: StudyCommand,
}

/// What is studied.
#[derive(Debug, Subcommand)]
pub enum StudyCommand {
    /// What leaving effects out saves, and that it changes nothing
    Effects(EffectsArgs),
    /// What accuracy costs: error against time for every setting, judged by a converged reference
    Accuracy(accuracy::AccuracyArgs),
    /// Hard cases beside their exact answers, through every solver and form factor; needs no scene
    Stability(StabilityArgs),
}

/// The arguments of `study effects`, as typed.
#[derive(Debug, Args)]
pub struct EffectsArgs {
    /// Scenes, .glb or .gltf files
    #[arg(value_name = "SCENE", required = true)]
    pub inputs: Vec<PathBuf>,

    /// How much effort goes into the light
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = Pick(Quality::default()))]
    pub quality: Pick<Quality>,

    /// Texture space.
    #[command(flatten)]
    pub atlas: AtlasArgs,

    /// How the scenes are read.
    #[command(flatten)]
    pub scene: SceneArgs,

    /// Bakes only the scene of this number and prints what that took: the study asks itself in a process of its own.
    #[arg(long, value_name = "NUMBER", hide = true)]
    pub measure: Option<usize>,

    /// How it is done.
    #[command(flatten)]
    pub how: HowArgs,
}

/// The arguments of `study stability`, as typed.
#[derive(Debug, Args)]
pub struct StabilityArgs {
    /// How it is done.
    #[command(flatten)]
    pub how: HowArgs,
}

/// How a study is done.
#[derive(Debug, Args)]
#[command(next_help_heading = "Run")]
pub struct HowArgs {
    /// A folder for the tables as CSV and one HTML page with plots
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Worker threads [default: one per core]
    #[arg(long, value_name = "NUMBER", value_parser = values::threads())]
    pub threads: Option<u16>,
}

/// Studies, prints, and returns the exit code.
pub fn run(args: &StudyArgs) -> ExitCode {
    match &args.command {
        StudyCommand::Accuracy(args) => accuracy::run(args),
        StudyCommand::Effects(args) if args.measure.is_some() => cost::tell(args),
        StudyCommand::Effects(args) => finish(study_effects(args), &args.how, args.inputs.first()),
        StudyCommand::Stability(args) => {
            let study = timed(&args.how, |_| stability(&|group| failure::say(group)));
            finish(study, &args.how, None)
        }
    }
}

impl EffectsArgs {
    fn options(&self) -> BakeOptions {
        BakeOptions {
            import: self.scene.import(),
            atlas: self.atlas.atlas(&ErrorBudget::of(self.quality.0)),
            light: self.quality.0.light(),
            ..BakeOptions::default()
        }
    }
}

fn study_effects(args: &EffectsArgs) -> Result<Study> {
    let options = args.options();
    let read = |(number, path): (usize, &PathBuf)| {
        let started = Instant::now();
        export::settle(path);
        let (_, scene) = import::load(path, &options.import)?;
        let read_seconds = started.elapsed().as_secs_f64();
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Ok(Subject { name, scene, read_seconds, cost: cost::ask(number) })
    };
    let subjects: Vec<Subject> = args.inputs.iter().enumerate().map(read).collect::<Result<_>>()?;
    timed(&args.how, |run| effects(&subjects, &options, run, &|name| failure::say(&printable(name))))
}

/// Hands out a way to run bakes that has a clock.
fn timed<R: Send>(how: &HowArgs, work: impl FnOnce(&Run) -> Result<R> + Send) -> Result<R> {
    let started = Instant::now();
    let threads = how.threads.map(usize::from);
    let run = Run {
        threads,
        clock: &|| started.elapsed().as_secs_f64(),
        memory: &memory::peak_bytes,
        ..Run::default()
    };
    in_pool(threads, || work(&run))?
}

/// Prints the tables, writes the files, and says whether all rows held.
fn finish(study: Result<Study>, how: &HowArgs, input: Option<&PathBuf>) -> ExitCode {
    let shown = study.and_then(|study| show(&study, how.out.as_deref()).map(|()| study));
    match shown {
        Err(error) => failure::error(&error, input.map_or(Path::new("study"), PathBuf::as_path)),
        Ok(study) if study.passes() => ExitCode::SUCCESS,
        Ok(_) => ExitCode::from(failure::COULD_NOT),
    }
}

fn show(study: &Study, out: Option<&Path>) -> Result<()> {
    let width = terminal_width();
    let tables: Vec<String> = study.on_screen().iter().map(|sheet| sheet.screen(width)).collect();
    let to_stdout = |error| Error::io("standard output", error);
    std::io::stdout().lock().write_all(tables.join("\n").as_bytes()).map_err(to_stdout)?;
    if let Some(folder) = out {
        for file in write(study, folder)? {
            failure::say(&format!("wrote {}", printable(&file.display().to_string())));
        }
    }
    Ok(())
}

/// Columns of the terminal; plenty where there is none.
pub fn terminal_width() -> u16 {
    terminal_size::terminal_size().map_or(240, |(columns, _)| columns.0.max(80))
}
