//! The `lightkiln` command.

#![forbid(unsafe_code)]

mod cli;

use clap::Parser;
use cli::args::{Cli, Command};
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return cli::failure::usage(&error),
    };
    match cli.command {
        Command::Bake(args) => cli::failure::guarded(args.run.verbose, || cli::bake::run(&args)),
        Command::Check(args) => cli::failure::guarded(args.verbose, || cli::check::run(&args)),
        Command::Plan(args) => cli::failure::guarded(false, || cli::plan::run(&args)),
        Command::Study(args) => cli::failure::guarded(false, || cli::study::run(&args)),
        Command::Render(args) => cli::failure::guarded(false, || cli::render::run(&args)),
    }
}
