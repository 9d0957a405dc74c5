//! How stages tell that they go on, and learn that they should stop. No clock, no printing: the caller has both.

use crate::options::LightOptions;
use crate::units::Irradiance;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The stages, in pipeline order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Stage {
    Import,
    Sizing,
    Plan,
    Atlas,
    Transport,
    Elements,
    Direct,
    Solve,
    Gather,
    Audit,
    Resolve,
    Export,
}

impl Stage {
    /// All stages, in order.
    pub const ALL: [Self; 12] = [
        Self::Import,
        Self::Sizing,
        Self::Plan,
        Self::Atlas,
        Self::Transport,
        Self::Elements,
        Self::Direct,
        Self::Solve,
        Self::Gather,
        Self::Audit,
        Self::Resolve,
        Self::Export,
    ];

    /// Lower-case name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Import => "import",
            Self::Sizing => "sizing",
            Self::Plan => "plan",
            Self::Atlas => "atlas",
            Self::Transport => "transport",
            Self::Elements => "elements",
            Self::Direct => "direct",
            Self::Solve => "solve",
            Self::Gather => "gather",
            Self::Audit => "audit",
            Self::Resolve => "resolve",
            Self::Export => "export",
        }
    }
}

/// Listens to the bake. Called from the baking thread and from workers; must be quick.
pub trait Observer: Sync {
    /// A stage begins.
    fn stage(&self, _stage: Stage) {}
    /// `done` of `total` units of the current stage are finished.
    fn advance(&self, _stage: Stage, _done: u64, _total: u64) {}
    /// The share of the reflected power that the solver has not yet distributed, in `[0, 1]`.
    fn unshot(&self, _fraction: f64) {}
    /// The light stages begin their pass of this number, from 1, with an effort that usually leaves an error of this share of the
    /// mean light, by what earlier passes showed of the scene.
    fn pass(&self, _number: usize, _effort: &LightOptions, _usual_error: f64) {}
    /// What is not finished yet is off by, over all of the light so far, as a share of its mean: about.
    fn unfinished(&self, _share: f64) {}
    /// The estimated error of the light so far, as a share of its mean.
    fn error(&self, _share: f64) {}
}

/// An observer that does not listen.
pub struct Silent;

impl Observer for Silent {}

/// Sees the irradiance that a stage has found so far, one row an element.
pub type Look<'a> = &'a (dyn Fn(&[Irradiance]) + Sync);

/// What a stage is handed to report with: counts work, and answers whether to stop.
pub struct Progress<'a> {
    observer: &'a dyn Observer,
    cancel: &'a AtomicBool,
    stage: Stage,
    done: AtomicU64,
    total: u64,
    stop: Option<&'a (dyn Fn() -> bool + Sync)>,
    look: Option<Look<'a>>,
}

impl<'a> Progress<'a> {
    /// Announces `stage`, which has `total` units of work.
    pub fn begin(observer: &'a dyn Observer, cancel: &'a AtomicBool, stage: Stage, total: u64) -> Self {
        observer.stage(stage);
        Self { observer, cancel, stage, done: AtomicU64::new(0), total, stop: None, look: None }
    }

    /// The same, which is to end too when `stop` says so.
    pub fn until(self, stop: Option<&'a (dyn Fn() -> bool + Sync)>) -> Self {
        Self { stop, ..self }
    }

    /// Shows a stage's unfinished result to `look` now and then.
    pub fn watched_by(self, look: Option<Look<'a>>) -> Self {
        Self { look, ..self }
    }

    /// What is found from now on is for nobody to see.
    pub fn unwatched(&mut self) {
        self.look = None;
    }

    /// Shows the irradiance so far, one row an element, to whoever wants to see it.
    pub fn glimpse(&self, so_far: &[Irradiance]) {
        if let Some(look) = self.look {
            look(so_far);
        }
    }

    /// The same stage goes on with another amount of work.
    pub fn restart(&mut self, total: u64) {
        self.done = AtomicU64::new(0);
        self.total = total;
    }

    /// `units` more are done.
    pub fn advance(&self, units: u64) {
        let done = self.done.fetch_add(units, Ordering::Relaxed) + units;
        self.observer.advance(self.stage, done.min(self.total), self.total);
    }

    /// Tells the observer the unshot share of the power.
    pub fn unshot(&self, fraction: f64) {
        self.observer.unshot(fraction);
    }

    /// Tells the observer the error of what is not finished, where each of the units that are left is off by this share of the mean.
    pub fn unfinished(&self, share_of_each: f64) {
        let left = 1.0 - self.done.load(Ordering::Relaxed) as f64 / self.total.max(1) as f64;
        self.observer.unfinished(share_of_each * left.max(0.0).sqrt());
    }

    /// Whether the caller wants the work so far, now.
    pub fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed) || self.stop.is_some_and(|stop| stop())
    }
}
