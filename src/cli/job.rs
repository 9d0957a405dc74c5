//! What the arguments mean, and whether it can be done at all: an hour of baking must not end at a missing folder.

use super::args::BakeArgs;
use super::progress::Verbosity;
use lightkiln::options::{AtlasOptions, BakeOptions, ExportOptions, ImportOptions};
use lightkiln::report::Report;
use lightkiln::{Error, Result};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

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
        let BakeArgs { input, quality, output, atlas, scene, run } = args;
        let options = BakeOptions {
            import: ImportOptions {
                scene: scene.scene.clone(),
                lamp_units: scene.lamp_units.0,
                sky: scene.sky.clone().map(|sky| sky.0),
                sun_angle_deg: scene.sun_angle,
                allow_outside: scene.allow_outside,
            },
            atlas: AtlasOptions {
                density: atlas.density,
                page_size: atlas.page_size,
                max_pages: atlas.max_pages,
                ..AtlasOptions::default()
            },
            light: quality.0.light(),
            export: ExportOptions {
                output: output.output.clone(),
                store: output.store.0,
                light: output.light.0,
                lamps: output.lamps.0,
                embed: output.embed,
                full_float: output.float,
                preview: output.preview.clone(),
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
        }
    }

    /// Refuses what cannot end well: files that would overwrite the scene or each other, folders that are missing
    /// or cannot be written to.
    pub fn check(&self) -> std::result::Result<(), Refusal> {
        fs::metadata(&self.input).map_err(|e| Refusal::Error(Error::io(&self.input, e)))?;
        let mut taken = vec![("the scene", resolved(&self.input))];
        for (name, path) in self.written() {
            let place = resolved(path);
            if let Some((other, _)) = taken.iter().find(|(_, other)| *other == place) {
                let path = path.display();
                return Err(Refusal::Misuse(format!("{name} and {other} are the same file, {path}")));
            }
            taken.push((name, place));
            writable(folder(path)).map_err(Refusal::Error)?;
        }
        if self.options.export.output.is_none() {
            writable(folder(&self.input)).map_err(Refusal::Error)?;
        }
        Ok(())
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
            ReportTo::Stdout => io::Write::write_all(&mut io::stdout().lock(), &json),
            ReportTo::File(path) => replace(path, &json),
        }
        .map_err(|e| Error::io(name, e))
    }

    fn written(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let report = match &self.report {
            Some(ReportTo::File(path)) => Some(path),
            _ => None,
        };
        let export = &self.options.export;
        [
            ("the output", export.output.as_ref()),
            ("the preview", export.preview.as_ref()),
            ("the report", report),
        ]
        .into_iter()
        .filter_map(|(name, path)| Some((name, path?.as_path())))
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

/// Tries whether a file can be made in the folder.
fn writable(folder: &Path) -> Result<()> {
    let probe = folder.join(format!(".lightkiln-{}.probe", std::process::id()));
    fs::File::create_new(&probe).and_then(|_| fs::remove_file(&probe)).map_err(|e| Error::io(folder, e))
}

/// Writes beside the file and renames, so that there is never half a file.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = PathBuf::from(name);
    fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, path)).inspect_err(|_| {
        let _ = fs::remove_file(&temporary);
    })
}
