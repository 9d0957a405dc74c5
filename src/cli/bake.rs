//! `lightkiln bake`.

use super::args::BakeArgs;
use super::interrupt::{self, INTERRUPTED};
use super::job::{Job, Refusal};
use super::progress::{Display, Verbosity};
use super::{failure, memory, summary};
use lightkiln::bake::{Run, bake};
use lightkiln::export;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Bakes, tells what came of it, and returns the exit code.
pub fn run(args: &BakeArgs) -> ExitCode {
    let job = Job::new(args);
    match job.check() {
        Ok(()) => {}
        Err(Refusal::Misuse(what)) => return failure::misuse(&what),
        Err(Refusal::Error(error)) => return failure::error(&error, &job.input),
    }

    export::settle(&job.input);
    let cancel = Arc::new(AtomicBool::new(false));
    let display = Display::new(job.verbosity, &job.options);
    interrupt::listen(Arc::clone(&cancel), display.on_interrupt(job.verbosity));
    let result = bake(
        &job.input,
        &job.options,
        &Run {
            threads: job.threads,
            observer: &display,
            cancel: &cancel,
            memory_limit_bytes: job.memory_limit_bytes,
            memory_available_bytes: memory::available_bytes(),
            clock: &|| display.seconds(),
            memory: &memory::peak_bytes,
            snapshot_every_s: job.snapshot_every_s,
        },
    );
    drop(display);

    let written = result.and_then(|report| job.write_report(&report).map(|()| report));
    match written {
        Ok(report) => {
            if job.verbosity > Verbosity::Quiet {
                failure::say(summary::render(&report, job.verbosity).trim_end());
            }
            if report.interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS }
        }
        Err(error) => failure::error(&error, &job.input),
    }
}
