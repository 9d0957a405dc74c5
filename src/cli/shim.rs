//! The signature of the library's `bake` until the straight line stands.

use lightkiln::options::BakeOptions;
use lightkiln::progress::Observer;
use lightkiln::report::Report;
use lightkiln::{Error, Result};
use std::path::Path;
use std::sync::atomic::AtomicBool;

#[allow(dead_code)]
pub struct Run<'a> {
    pub threads: Option<usize>,
    pub observer: &'a dyn Observer,
    pub cancel: &'a AtomicBool,
    pub memory_limit_bytes: Option<u64>,
    pub clock: &'a (dyn Fn() -> f64 + Sync),
    pub memory: &'a (dyn Fn() -> Option<u64> + Sync),
}

pub fn bake(input: &Path, _options: &BakeOptions, _run: &Run) -> Result<Report> {
    Err(Error::unsupported(input.display().to_string(), "the straight line is not laid yet"))
}
