//! What the arguments mean.

use super::args::BakeArgs;
use super::progress::Verbosity;
use super::values::has_extension;
use lightkiln::export;
use lightkiln::options::{BakeOptions, ErrorBudget, ExportOptions, Goal, Solver};
use lightkiln::report::Report;
use lightkiln::{Error, Result};
use std::io;
use std::path::{Path, PathBuf};

/// What files of a scene are called; a report is none of them.
const ASSETS: [&str; 10] = ["glb", "gltf", "bin", "png", "jpg", "jpeg", "webp", "exr", "hdr", "blend"];

/// A bake that was asked for.
pub struct Job {
    /// The scene.
    pub input: PathBuf,
    /// What to do.
    pub options: BakeOptions,
    /// Where the report goes.
    pub report: Option<ReportTo>,
    /// How much is printed.
    pub verbosity: Verbosity,
    /// Worker threads.
    pub threads: Option<usize>,
    /// The most memory to use, bytes.
    pub memory_limit_bytes: Option<u64>,
    /// How often the light so far is written, seconds.
    pub snapshot_every_s: Option<f64>,
    /// A relaxation was asked for that the solver has no use for.
    idle_relaxation: bool,
}

/// Where a report goes.
pub enum ReportTo {
    /// Standard output.
    Stdout,
    /// A file.
    File(PathBuf),
}

/// Why a job is not begun.
pub enum Refusal {
    /// The arguments contradict each other.
    Misuse(String),
    /// The machine is not as the arguments suppose.
    Error(Error),
}

impl Job {
    /// What `args` mean.
    pub fn new(args: &BakeArgs) -> Self {
        let BakeArgs { input, quality, tolerance, time, output, atlas, scene, solve, effects, run } = args;
        let mut light = quality.0.light();
        light.solve.solver = solve.solver.0;
        light.solve.form_factors = solve.form_factors.0;
        if let Some(relaxation) = solve.relaxation {
            light.solve.relaxation = relaxation.0;
        }
        let budget = tolerance.map_or_else(|| ErrorBudget::of(quality.0), ErrorBudget::new);
        let options = BakeOptions {
            import: scene.import(),
            atlas: atlas.atlas(&budget),
            light,
            goal: match (tolerance, time) {
                (Some(share), _) => Goal::Tolerance(*share),
                (None, Some(seconds)) => Goal::Seconds(*seconds),
                (None, None) => Goal::Effort,
            },
            effects: effects.effects.0.forced(),
            export: ExportOptions {
                output: output.output.clone(),
                store: output.store.0,
                light: output.light.0,
                lamps: output.lamps.0,
                embed: output.embed,
                full_float: output.float,
                preview: output.preview.clone(),
                picture: output.picture.clone(),
            },
        };
        let verbosity = match (run.quiet, run.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        };
        let report = output
            .report
            .clone()
            .map(|path| if path == Path::new("-") { ReportTo::Stdout } else { ReportTo::File(path) });
        Self {
            input: input.clone(),
            options,
            report,
            verbosity,
            threads: run.threads.map(usize::from),
            memory_limit_bytes: run.memory,
            snapshot_every_s: run.snapshot_every,
            idle_relaxation: solve.relaxation.is_some() && solve.solver.0 != Solver::Matrix,
        }
    }

    /// Refuses options that contradict each other, and a report that would overwrite another file of the bake or has no place to be: an hour of baking must
    /// not end there. The other files are the library's to check.
    pub fn check(&self) -> std::result::Result<(), Refusal> {
        if self.idle_relaxation {
            let what = "--relaxation is a matter of the matrix solver; add --solver matrix or leave it out";
            return Err(Refusal::Misuse(what.to_owned()));
        }
        if self.options.atlas.between_texels.is_some() && self.options.atlas.density.is_some() {
            let what = "--density says how many texels there are; leave it out, or --page-size auto";
            return Err(Refusal::Misuse(what.to_owned()));
        }
        let Some(ReportTo::File(report)) = &self.report else { return Ok(()) };
        let export = &self.options.export;
        let others =
            [Some(&self.input), export.output.as_ref(), export.preview.as_ref(), export.picture.as_ref()];
        if others.into_iter().flatten().any(|other| resolved(other) == resolved(report)) {
            let report = report.display();
            return Err(Refusal::Misuse(format!(
                "the report cannot have the same name as another file, {report}"
            )));
        }
        if has_extension(report, &ASSETS) {
            let report = report.display();
            return Err(Refusal::Misuse(format!("a report is JSON and should be named so, not {report}")));
        }
        export::check_place(report).map_err(Refusal::Error)
    }

    /// Writes the report where it was asked for.
    pub fn write_report(&self, report: &Report) -> Result<()> {
        let Some(to) = &self.report else { return Ok(()) };
        let name = match to {
            ReportTo::Stdout => Path::new("standard output"),
            ReportTo::File(path) => path,
        };
        let mut json = serde_json::to_vec_pretty(report).map_err(|e| Error::io(name, e.into()))?;
        json.push(b'\n');
        match to {
            ReportTo::Stdout => {
                io::Write::write_all(&mut io::stdout().lock(), &json).map_err(|e| Error::io(name, e))
            }
            ReportTo::File(path) => export::write_all(vec![(path.clone(), json)]).map(drop),
        }
    }
}

/// The same text for the same file, however it is named; also for a file that is not there yet.
fn resolved(path: &Path) -> PathBuf {
    let in_folder = || Some(folder(path).canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::{Cli, Command};
    use crate::cli::values::WIDEST_AUTO_PAGE;
    use clap::Parser;
    use lightkiln::options::{
        Forced, FormFactors, LampUnits, LampsOut, LightPart, Quality, Relaxation, SkyOption, Store,
    };

    fn job(arguments: &[&str]) -> Job {
        let typed = ["lightkiln", "bake", "room.glb"].iter().chain(arguments);
        let Command::Bake(args) = Cli::try_parse_from(typed).unwrap().command else { panic!("not a bake") };
        Job::new(&args)
    }

    #[test]
    fn nothing_typed_means_the_library_s_defaults() {
        let job = job(&[]);
        assert_eq!(format!("{:?}", job.options), format!("{:?}", BakeOptions::default()));
        assert_eq!((job.threads, job.memory_limit_bytes, job.verbosity), (None, None, Verbosity::Normal));
    }

    #[test]
    fn what_is_typed_arrives() {
        let typed = "-o a.glb --preview b.glb --picture d.png --report c.json --store radiosity --light indirect --lamps tag --embed \
                     --float --density 2.5 --page-size 64 --max-pages 3 --scene attic --sky 1,2,3,2 --sun-angle 0.5 \
                     --lamp-units gltf --allow-outside --threads 3 --memory 2GiB --quality high -v \
                     --solver matrix --relaxation sor --form-factors hemicube --effects all";
        let Job { options, report, verbosity, threads, memory_limit_bytes, .. } =
            job(&typed.split_whitespace().collect::<Vec<_>>());
        let BakeOptions { import, atlas, light, goal, effects, export } = options;
        assert_eq!(goal, Goal::Effort);
        assert_eq!(export.output, Some("a.glb".into()));
        assert_eq!(export.preview, Some("b.glb".into()));
        assert_eq!(export.picture, Some("d.png".into()));
        assert!(matches!(report, Some(ReportTo::File(path)) if path == Path::new("c.json")));
        assert_eq!(
            (export.store, export.light, export.lamps),
            (Store::Radiosity, LightPart::Indirect, LampsOut::Tag)
        );
        assert_eq!(effects, Forced::all());
        assert!(export.embed && export.full_float && import.allow_outside);
        assert_eq!((atlas.density, atlas.page_size, atlas.max_pages), (Some(2.5), 64, 3));
        assert_eq!((import.scene.as_deref(), import.sun_angle_deg), (Some("attic"), Some(0.5)));
        assert_eq!(import.lamp_units, LampUnits::Gltf);
        assert!(matches!(import.sky, Some(SkyOption::Constant(sky)) if sky.0.to_array() == [2.0, 4.0, 6.0]));
        let mut expected = Quality::High.light();
        expected.solve.solver = Solver::Matrix;
        expected.solve.relaxation = Relaxation::Sor;
        expected.solve.form_factors = FormFactors::Hemicube;
        assert_eq!(format!("{light:?}"), format!("{expected:?}"));
        assert_eq!((threads, memory_limit_bytes, verbosity), (Some(3), Some(2 << 30), Verbosity::Verbose));
        assert!(matches!(job(&["--report", "-"]).report, Some(ReportTo::Stdout)));
    }

    #[test]
    fn a_report_never_replaces_another_file() {
        let misused = |arguments: &[&str]| matches!(job(arguments).check(), Err(Refusal::Misuse(_)));
        assert!(misused(&["--report", "./room.glb"]));
        assert!(misused(&["-o", "out.glb", "--report", "./out.glb"]));
        assert!(!misused(&["--report", "room.json"]));
        // A scene is made of such files, and which it names is not known yet.
        assert!(misused(&["--report", "room.bin"]) && misused(&["--report", "wood.PNG"]));
    }

    #[test]
    fn a_page_follows_from_what_the_bake_may_err() {
        let atlas = |arguments: &[&str]| job(arguments).options.atlas;
        let by_tolerance = atlas(&["--page-size", "auto", "--tolerance", "0.02"]);
        assert_eq!((by_tolerance.page_size, by_tolerance.between_texels), (WIDEST_AUTO_PAGE, Some(0.02)));
        let by_quality = atlas(&["--page-size", "auto", "--quality", "high"]);
        assert_eq!(by_quality.between_texels, Some(ErrorBudget::of(Quality::High).total));
        let both = job(&["--page-size", "auto", "--density", "10"]);
        assert!(matches!(both.check(), Err(Refusal::Misuse(_))));
    }

    #[test]
    fn a_relaxation_belongs_to_the_matrix() {
        let misused = |arguments: &[&str]| matches!(job(arguments).check(), Err(Refusal::Misuse(_)));
        assert!(misused(&["--relaxation", "cg"]));
        assert!(misused(&["--solver", "progressive", "--relaxation", "gauss-seidel"]));
        assert!(!misused(&["--solver", "matrix", "--relaxation", "cg"]));
    }
}
