//! Ways to a coarse solution: every solver, on rows that are kept and on rows that are made again.

use crate::error::Result;
use crate::progress::{Progress, Silent, Stage};
use crate::solve::matrix::{self, MatrixOptions};
use crate::solve::{Problem, Progressive, Relaxation, RowSource, Rows, Solution, Transfer};
use std::sync::atomic::AtomicBool;

/// Where every solver stops, as a share of the power that is to be distributed.
pub const TOLERANCE: f64 = 1e-12;

/// A solver and how it gets its rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// Progressive: shots with overshooting.
    Shots,
    /// Progressive: shots without.
    PlainShots,
    /// Progressive: sweeps.
    Sweeps,
    /// Progressive: shots by rows that are forgotten.
    RemadeShots,
    /// Progressive: sweeps over rows that are forgotten.
    RemadeSweeps,
    /// The matrix.
    Matrix(Relaxation),
}

impl Way {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Shots,
        Self::PlainShots,
        Self::Sweeps,
        Self::RemadeShots,
        Self::RemadeSweeps,
        Self::Matrix(Relaxation::Jacobi),
        Self::Matrix(Relaxation::GaussSeidel),
        Self::Matrix(Relaxation::Sor(1.2)),
        Self::Matrix(Relaxation::ConjugateGradient),
    ];

    /// What tables call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shots => "progressive, overshooting",
            Self::PlainShots => "progressive, plain shots",
            Self::Sweeps => "progressive, sweeps",
            Self::RemadeShots => "progressive, rows made again",
            Self::RemadeSweeps => "sweeps, rows made again",
            Self::Matrix(Relaxation::Jacobi) => "matrix, Jacobi",
            Self::Matrix(Relaxation::GaussSeidel) => "matrix, Gauss-Seidel",
            Self::Matrix(Relaxation::Sor(_)) => "matrix, over-relaxation",
            Self::Matrix(Relaxation::ConjugateGradient) => "matrix, conjugate gradients",
        }
    }

    /// Whether light goes by reciprocity, F_ij = F_ji A_j/A_i, instead of by the receiver's own row.
    pub fn is_reciprocal(self) -> bool {
        matches!(self, Self::RemadeShots | Self::Matrix(Relaxation::ConjugateGradient))
    }

    /// Solves to [`TOLERANCE`], as far as the numbers of steps below lead.
    pub fn solve<R: RowSource>(self, problem: &Problem<R>) -> Result<Solution> {
        let kept = || {
            let (area, rho, source) = (problem.area(), problem.reflectance(), problem.source());
            let rows = Rows::collect(problem.rows())?;
            Problem::new(area.to_vec(), rho.to_vec(), source.to_vec(), rows)
        };
        Ok(match self {
            Self::Shots => shoot(Progressive::new(&kept()?)),
            Self::PlainShots => shoot(Progressive::new(&kept()?).without_overshooting()),
            Self::RemadeShots => shoot(Progressive::remaking(problem)),
            Self::Sweeps => sweep(Progressive::new(&kept()?)),
            Self::RemadeSweeps => sweep(Progressive::remaking(problem)),
            Self::Matrix(relaxation) => {
                let options = MatrixOptions {
                    relaxation,
                    tolerance: TOLERANCE,
                    max_sweeps: 100_000,
                    ..MatrixOptions::default()
                };
                watched(|progress| matrix::solve(problem, &options, progress))?
            }
        })
    }
}

/// Work that nobody listens to or stops.
pub fn watched<R>(work: impl FnOnce(&Progress) -> R) -> R {
    work(&Progress::begin(&Silent, &AtomicBool::new(false), Stage::Solve, 1))
}

fn shoot<T: Transfer>(mut solver: Progressive<T>) -> Solution {
    for _ in 0..2_000_000 {
        let report = solver.step();
        if report.unshot_fraction <= TOLERANCE || report.shooter.is_none() {
            break;
        }
    }
    solver.solution()
}

fn sweep<T: Transfer + Sync>(mut solver: Progressive<T>) -> Solution {
    for _ in 0..20_000 {
        if solver.sweep().unshot_fraction <= TOLERANCE {
            break;
        }
    }
    solver.solution()
}
