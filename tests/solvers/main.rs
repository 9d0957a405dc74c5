//! What every solver must get right on the way: linearity, energy, refusals. Closed answers stand in `lightkiln study
//! stability`, which `tests/stability.rs` runs.

mod invariants;
mod progress;
mod refusals;
mod suite;

use glam::{DVec3, dvec3};
use lightkiln::Error;
use lightkiln::options::{self, Quality, SolveOptions, Solver};
use lightkiln::progress::{Progress, Silent, Stage};
use lightkiln::solve::matrix::{self, MatrixOptions};
use lightkiln::solve::{Problem, Progressive, Relaxation, RowSource, Rows, Solution, solve};
use lightkiln::study::stability::way::{Way, watched};
use lightkiln::study::stability::world::{Method, Numbers, box_room, cube, grey, ring};
use lightkiln::transport::form_factors::Row;
use std::sync::atomic::AtomicBool;

/// A cube whose patches have colours and lights of their own, on rows from rays that are made reciprocal.
fn colourful(n: u32, brightest: f64) -> Problem {
    let world = cube(n, 2.0);
    let mut numbers = Numbers(9);
    let rows = Method::Rays(64).rows(&world).unwrap().balanced(&world.area()).unwrap();
    let rho = (0..world.len()).map(|_| numbers.colour() * brightest).collect();
    let source = (0..world.len()).map(|_| numbers.colour() * numbers.next().powi(4)).collect();
    Problem::new(world.area(), rho, source, rows).unwrap()
}

fn assert_close(found: DVec3, expected: DVec3, relative: f64, what: &str) {
    assert!(
        (found - expected).abs().max_element() <= relative * expected.max_element(),
        "{what}: {found}, not {expected}"
    );
}

/// Σ A |a − b| per channel.
fn distance(problem: &Problem, a: &[DVec3], b: &[DVec3]) -> DVec3 {
    (0..a.len()).map(|i| (a[i] - b[i]).abs() * problem.area()[i]).sum()
}
