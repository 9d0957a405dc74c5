//! How the unshot power falls, solver by solver.

use super::sweep::SOLVERS;
use crate::bake::{Run, light};
use crate::error::Result;
use crate::options::{BakeOptions, Solver};
use crate::progress::Observer;
use crate::scene::Scene;
use std::sync::{Mutex, PoisonError};

/// Solved until this share of the power is unshot: nearly all digits of f64.
const TOLERANCE: f64 = 1e-12;

/// Every sweep goes through all form factors twice: once to change the patches, once to see what is left.
const PASSES_A_SWEEP: f64 = 2.0;

/// The unshot power of one solver.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// The solver.
    pub solver: &'static str,
    /// Passes over all form factors, and the share of the power that was unshot after them.
    pub unshot: Vec<[f64; 2]>,
}

#[derive(Default)]
struct Listener(Mutex<Vec<f64>>);

impl Observer for Listener {
    fn unshot(&self, fraction: f64) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(fraction);
    }
}

/// Solves with every solver; nothing is gathered beyond what must be.
pub fn traces(scene: &Scene, options: &BakeOptions, run: &Run, told: &dyn Fn(&str)) -> Result<Vec<Trace>> {
    SOLVERS
        .iter()
        .map(|&(name, solver, relaxation)| {
            told(&format!("convergence of {name}"));
            let listener = Listener::default();
            let mut options = options.clone();
            (options.light.solve.solver, options.light.solve.relaxation) = (solver, relaxation);
            options.light.solve.tolerance = TOLERANCE;
            (options.light.gather.rays, options.light.gather.tolerance) = (16, 1.0);
            let lit = light(scene, &options, &Run { observer: &listener, ..*run })?.light;
            let unshot = listener.0.into_inner().unwrap_or_else(PoisonError::into_inner);
            // A shot is one column of the form factors. The matrix is looked at before its first sweep.
            let shots = lit.shots as usize;
            let passes = |step: usize| match solver {
                Solver::Progressive if step < shots => (step + 1) as f64 / lit.patches.max(1) as f64,
                Solver::Progressive => {
                    shots as f64 / lit.patches.max(1) as f64 + PASSES_A_SWEEP * (step + 1 - shots) as f64
                }
                Solver::Matrix => 1.0 + PASSES_A_SWEEP * step as f64,
            };
            let points = unshot.iter().enumerate().map(|(step, &fraction)| [passes(step), fraction]);
            Ok(Trace { solver: name, unshot: points.filter(|point| point[1] > 0.0).collect() })
        })
        .collect()
}
