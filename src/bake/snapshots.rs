//! The light so far, written now and then.

use super::{Glimpse, Run};
use crate::error::{Result, Warning};
use std::sync::{Mutex, PoisonError};

/// Writes what there is when it is time to.
pub struct Snapshots<'a> {
    every_s: f64,
    clock: &'a (dyn Fn() -> f64 + Sync),
    write: &'a (dyn Fn(&Glimpse) -> Result<()> + Sync),
    state: Mutex<State>,
}

struct State {
    next_s: f64,
    failed: Option<Warning>,
}

impl<'a> Snapshots<'a> {
    /// As often as `run` wants; `None` where it wants none.
    pub fn new(run: &'a Run, write: &'a (dyn Fn(&Glimpse) -> Result<()> + Sync)) -> Option<Self> {
        let every_s = run.snapshot_every_s?;
        let state = State { next_s: (run.clock)() + every_s, failed: None };
        Some(Self { every_s, clock: run.clock, write, state: Mutex::new(state) })
    }

    /// Writes, if it is time. What cannot be written now is tried again next time: the bake goes on.
    pub fn offer(&self, light: &Glimpse) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if (self.clock)() < state.next_s {
            return;
        }
        let warning = |error: crate::Error| Warning::new("snapshot", format!("not written: {error}"));
        state.failed = (self.write)(light).err().map(warning);
        state.next_s = (self.clock)() + self.every_s;
    }

    /// What went wrong the last time.
    pub fn warning(self) -> Option<Warning> {
        self.state.into_inner().unwrap_or_else(PoisonError::into_inner).failed
    }
}
