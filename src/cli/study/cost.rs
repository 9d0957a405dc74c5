//! What a bake takes that has a process of its own: a process that has baked other scenes before has their memory.

use super::{EffectsArgs, timed};
use crate::cli::{failure, memory};
use lightkiln::options::{BakeOptions, ExportOptions};
use lightkiln::study::effects::Cost;
use lightkiln::{Error, Result, bake};
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, ExitCode};

/// Starts this program again with the same arguments, to bake the scene of a number; nothing where that fails.
pub fn ask(number: usize) -> Option<Cost> {
    let mut again = Command::new(std::env::current_exe().ok()?);
    again.args(std::env::args_os().skip(1)).arg("--measure").arg(number.to_string());
    let output = again.output().ok().filter(|output| output.status.success())?;
    serde_json::from_slice(&output.stdout).ok()
}

/// Bakes the scene that was asked for and prints what that took.
pub fn tell(args: &EffectsArgs) -> ExitCode {
    let input = args.measure.and_then(|number| args.inputs.get(number)).map_or(Path::new(""), |path| path);
    match measure(args, input) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failure::error(&error, input),
    }
}

fn measure(args: &EffectsArgs, input: &Path) -> Result<()> {
    let folder = std::env::temp_dir().join(format!("lightkiln-study-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|error| Error::io(&folder, error))?;
    let export = ExportOptions { output: Some(folder.join("baked.glb")), ..ExportOptions::default() };
    let options = BakeOptions { export, ..args.options() };
    let report = timed(&args.how, |run| bake::bake(input, &options, run));
    let _ = std::fs::remove_dir_all(&folder);
    let cost = Cost { seconds: report?.seconds_total, memory_bytes: memory::peak_bytes() };
    let to_stdout = |error| Error::io("standard output", error);
    let text = serde_json::to_string(&cost).map_err(|error| to_stdout(std::io::Error::other(error)))?;
    std::io::stdout().lock().write_all(text.as_bytes()).map_err(to_stdout)
}
