//! The command line: fills options, prints reports, sets exit codes.
//!
//! What was typed ([`args`], with the parsers of single values in [`values`]) becomes what it means ([`job`]), which a
//! command runs ([`bake`], [`render`], [`check`]). Everything for the eye goes to standard error; standard output carries only what was
//! asked to go there (`--report -`, help), so it can be piped.

mod amounts;
pub mod args;
pub mod bake;
pub mod check;
mod estimate;
pub mod failure;
mod interrupt;
mod job;
mod memory;
pub mod plan;
mod progress;
pub mod render;
pub mod study;
mod summary;
mod values;
