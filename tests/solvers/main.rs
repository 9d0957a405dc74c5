//! Every solver against closed answers: one suite for all of them.

#[path = "../radiosity/mod.rs"]
mod radiosity;

mod progress;
mod refusals;
mod scenes;
mod suite;

use glam::{DVec3, dvec3};
use lightkiln::Error;
use lightkiln::options::{self, Quality, SolveOptions, Solver};
use lightkiln::progress::{Progress, Silent, Stage};
use lightkiln::solve::matrix::{self, MatrixOptions};
use lightkiln::solve::{Made, Problem, Progressive, Relaxation, RowSource, Rows, Solution, solve};
use lightkiln::transport::form_factors::Row;
use radiosity::{Method, World, box_room, cube, grey, sphere};
use std::sync::atomic::AtomicBool;

/// Where every solver stops, as a share of the power that is to be distributed.
const TOLERANCE: f64 = 1e-12;

/// The ways to a solution.
#[derive(Clone, Copy, Debug)]
enum Way {
    Shots,
    PlainShots,
    Sweeps,
    RemadeShots,
    RemadeSweeps,
    Matrix(Relaxation),
}

impl Way {
    fn solve<R: RowSource>(self, problem: &Problem<R>) -> Solution {
        let kept = || {
            let rows = Rows::collect(problem.rows()).unwrap();
            let (area, rho, source) = (problem.area(), problem.reflectance(), problem.source());
            Problem::new(area.to_vec(), rho.to_vec(), source.to_vec(), rows).unwrap()
        };
        match self {
            Self::Shots => shoot(Progressive::new(&kept())),
            Self::PlainShots => shoot(Progressive::new(&kept()).without_overshooting()),
            Self::RemadeShots => shoot(Progressive::remaking(problem)),
            Self::Sweeps => sweep(Progressive::new(&kept())),
            Self::RemadeSweeps => sweep(Progressive::remaking(problem)),
            Self::Matrix(relaxation) => {
                let options = MatrixOptions {
                    relaxation,
                    tolerance: TOLERANCE,
                    max_sweeps: 100_000,
                    ..MatrixOptions::default()
                };
                watched(|progress| matrix::solve(problem, &options, progress)).unwrap()
            }
        }
    }
}

/// Work that nobody listens to or stops.
fn watched<R>(work: impl FnOnce(&Progress) -> R) -> R {
    work(&Progress::begin(&Silent, &AtomicBool::new(false), Stage::Solve, 1))
}

fn shoot<T: lightkiln::solve::Transfer>(mut solver: Progressive<T>) -> Solution {
    for _ in 0..2_000_000 {
        let report = solver.step();
        if report.unshot_fraction <= TOLERANCE || report.shooter.is_none() {
            break;
        }
    }
    solver.solution()
}

fn sweep<T: lightkiln::solve::Transfer + Sync>(mut solver: Progressive<T>) -> Solution {
    for _ in 0..20_000 {
        if solver.sweep().unshot_fraction <= TOLERANCE {
            break;
        }
    }
    solver.solution()
}

/// n patches of equal area on a ring, each of which sees its neighbours in shares of 1/64: reciprocal, closed, and
/// exact in f32.
fn ring(patches: u32) -> Rows {
    let counts = [0u32, 20, 9, 3];
    let hits: Vec<Vec<(u32, u32)>> = (0..patches)
        .map(|i| {
            let neighbour =
                |step: u32, count| [((i + step) % patches, count), ((i + patches - step) % patches, count)];
            (1..4).flat_map(|step| neighbour(step, counts[step as usize])).collect()
        })
        .collect();
    Rows::from_counts(64, &hits, &vec![0; patches as usize]).unwrap()
}

/// Numbers in `[0, 1)`, the same at every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn colour(&mut self) -> DVec3 {
        dvec3(self.next(), self.next(), self.next())
    }
}

/// A cube whose patches have colours and lights of their own, on rows from rays that are made reciprocal.
fn colourful(n: u32, brightest: f64) -> Problem {
    let world = cube(n, 2.0);
    let mut numbers = Numbers(9);
    let rows = Method::Rays(64).rows(&world).balanced(&world.area()).unwrap();
    let rho = (0..world.len()).map(|_| numbers.colour() * brightest).collect();
    let source = (0..world.len()).map(|_| numbers.colour() * numbers.next().powi(4)).collect();
    Problem::new(world.area(), rho, source, rows).unwrap()
}

/// Exact form factors between the surfaces of a world without occlusion, in f64.
fn analytic(world: &World) -> impl RowSource {
    Method::Analytic.source(world)
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
