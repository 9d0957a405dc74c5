//! What the stages of a bake take, as functions of texels, rays and patches.
//!
//! The constants are a least-squares fit of the relative errors over bakes of the fifteen fixtures at 128² to 512², draft
//! and good, on one thread of an Intel Xeon server core of 2023 (AVX-512, 2 to 3 GHz); they are met within 20 to 45 %
//! there. Only their ratios count: what a second is worth on this machine, with its threads and on this scene's rays,
//! the trials tell ([`Speed`]).

use crate::progress::Stage;

/// What a stage has to do.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Load {
    pub elements: f64,
    pub rays: f64,
    pub patches: f64,
    /// Texels of pages that are written, empty ones too.
    pub page_texels: f64,
}

/// Seconds of each element, ray, patch and page texel, and of nothing at all.
struct Rate {
    element: f64,
    ray: f64,
    patch: f64,
    page_texel: f64,
    fixed: f64,
}

const fn rate(stage: Stage) -> Rate {
    let none = Rate { element: 0.0, ray: 0.0, patch: 0.0, page_texel: 0.0, fixed: 0.0 };
    match stage {
        Stage::Elements => Rate { element: 2.9e-7, ray: 2.6e-7, ..none },
        Stage::Direct => Rate { element: 6e-8, ray: 1.0e-7, ..none },
        Stage::Solve => Rate { element: 1.4e-7, ray: 1.3e-7, patch: 4.9e-6, ..none },
        Stage::Gather => Rate { element: 9e-8, ray: 1.0e-7, ..none },
        Stage::Audit => Rate { element: 1.2e-7, ray: 1.8e-7, patch: 1.1e-6, ..none },
        Stage::Resolve => Rate { element: 1e-8, page_texel: 2.8e-8, fixed: 3e-4, ..none },
        Stage::Export => Rate { element: 6e-8, page_texel: 9e-8, fixed: 7e-3, ..none },
        _ => none,
    }
}

/// Seconds of a stage on the machine and thread of the constants.
pub(super) fn seconds(stage: Stage, load: &Load) -> f64 {
    let rate = rate(stage);
    rate.fixed
        + rate.element * load.elements
        + rate.ray * load.rays
        + rate.patch * load.patches
        + rate.page_texel * load.page_texels
}

/// How long this machine takes for what takes the constants' machine a second.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Speed {
    took: f64,
    modelled: f64,
}

/// Trials that are as short as this tell half of a stage's own speed, the other half is that of all stages; seconds.
const TELLING: f64 = 0.004;

impl Speed {
    pub fn add(&mut self, took: f64, modelled: f64) {
        self.took += took;
        self.modelled += modelled;
    }

    /// As measured; 1 where nothing was.
    pub fn of_all(&self) -> f64 {
        if self.modelled > 0.0 && self.took > 0.0 { self.took / self.modelled } else { 1.0 }
    }

    /// As measured, as far as that was long enough to tell, else as `all` do.
    pub fn beside(&self, all: f64) -> f64 {
        (self.took + TELLING * all) / (self.modelled + TELLING)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_trials_tell_little_and_long_ones_all() {
        let speed = |took, modelled| Speed { took, modelled };
        assert_eq!(Speed::default().of_all(), 1.0);
        assert_eq!(Speed::default().beside(3.0), 3.0);
        assert!((speed(4.0, 2.0).beside(10.0) - 2.0).abs() < 0.02);
        assert!((speed(TELLING, TELLING).beside(3.0) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn seconds_grow_with_what_there_is_to_do() {
        let load = Load { elements: 1e6, rays: 1e6, patches: 1e3, page_texels: 1e6 };
        for stage in
            [Stage::Elements, Stage::Direct, Stage::Solve, Stage::Gather, Stage::Audit, Stage::Export]
        {
            let more = Load { elements: 2e6, ..load };
            assert!(seconds(stage, &more) > seconds(stage, &load), "{stage:?}");
        }
        assert_eq!(seconds(Stage::Plan, &load), 0.0, "is measured");
    }
}
