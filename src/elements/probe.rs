//! A tracer that counts its rays.

use crate::transport::{Hit, Ray, Tracer, World};
use std::cell::Cell;

/// Sends rays for one task.
pub(super) struct Probe<'a, T> {
    tracer: &'a T,
    rays: Cell<u64>,
}

impl<'a, T: Tracer> Probe<'a, T> {
    pub(super) fn new(tracer: &'a T) -> Self {
        Self { tracer, rays: Cell::new(0) }
    }

    pub(super) fn world(&self) -> &'a World {
        self.tracer.world()
    }

    pub(super) fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.rays.set(self.rays.get() + 1);
        self.tracer.closest(ray)
    }

    pub(super) fn occluded(&self, ray: &Ray) -> bool {
        self.rays.set(self.rays.get() + 1);
        self.tracer.occluded(ray)
    }

    /// Rays sent so far.
    pub(super) fn rays(&self) -> u64 {
        self.rays.get()
    }
}
