//! What the stages cost, and when they are to end.

use super::Run;
use crate::error::Result;
use crate::progress::{Look, Progress, Stage};
use crate::report::StageReport;
use std::sync::atomic::Ordering;

/// Times the stages. Stages that run more than once have one row.
pub struct Log<'a> {
    pub run: &'a Run<'a>,
    pub stages: Vec<StageReport>,
    /// When the bake began, by the run's clock.
    pub started: f64,
    /// When stages that can be cut short are.
    pub until: Option<f64>,
}

impl<'a> Log<'a> {
    /// Begins now.
    pub fn new(run: &'a Run<'a>) -> Self {
        Self { run, stages: Vec::new(), started: (run.clock)(), until: None }
    }

    /// Seconds since the bake began.
    pub fn seconds(&self) -> f64 {
        (self.run.clock)() - self.started
    }

    /// Seconds that a stage has taken so far.
    pub fn seconds_of(&self, stage: Stage) -> f64 {
        self.stages.iter().find(|report| report.stage == stage).map_or(0.0, |report| report.seconds)
    }

    /// Rays so far.
    pub fn rays(&self) -> u64 {
        self.stages.iter().map(|report| report.rays).sum()
    }

    /// Whether the caller wants what there is.
    pub fn cancelled(&self) -> bool {
        self.run.cancel.load(Ordering::Relaxed)
    }

    /// Whether stages are cut short by now.
    pub fn cut(&self) -> bool {
        self.cancelled() || self.until.is_some_and(|until| (self.run.clock)() >= until)
    }

    /// Runs a stage of `total` units, which returns its result and the rays it sent.
    pub fn stage<R>(
        &mut self,
        stage: Stage,
        total: u64,
        work: impl FnOnce(&mut Progress) -> Result<(R, u64)>,
    ) -> Result<R> {
        self.watched_stage(stage, total, None, work)
    }

    /// The same, and lets `look` see its unfinished result.
    pub fn watched_stage<R>(
        &mut self,
        stage: Stage,
        total: u64,
        look: Option<Look>,
        work: impl FnOnce(&mut Progress) -> Result<(R, u64)>,
    ) -> Result<R> {
        let Run { clock, observer, cancel, .. } = *self.run;
        let started = clock();
        let late = self.until.map(|until| move || clock() >= until);
        let late = late.as_ref().map(|late| late as &(dyn Fn() -> bool + Sync));
        let mut progress = Progress::begin(observer, cancel, stage, total).until(late).watched_by(look);
        let (result, rays) = work(&mut progress)?;
        let seconds = (self.run.clock)() - started;
        let peak_memory_bytes = (self.run.memory)();
        match self.stages.iter_mut().find(|report| report.stage == stage) {
            Some(report) => {
                *report = StageReport {
                    seconds: report.seconds + seconds,
                    rays: report.rays + rays,
                    peak_memory_bytes,
                    ..report.clone()
                }
            }
            None => self.stages.push(StageReport { stage, seconds, rays, peak_memory_bytes }),
        }
        Ok(result)
    }
}
