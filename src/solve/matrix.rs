//! Matrix radiosity (Goral, Torrance, Greenberg & Battaile 1984): all form factors at once and a classical iteration.
//! The oracle beside [`super::progressive`].

use super::balance::Exchange;
use super::ledger::Ledger;
use super::problem::Problem;
use super::progressive::Solution;
use super::rows::RowSource;
use super::{Rgb, bound, weighted_sum, weighted_sum_abs};
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::transport::form_factors::Row;
use rayon::prelude::*;

/// How the equations are solved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Relaxation {
    /// All patches at once from the last round's values: one bounce of light per round.
    Jacobi,
    /// Patch after patch from the newest values.
    #[default]
    GaussSeidel,
    /// The same with steps lengthened by a factor in ]0, 2[: 1.1 to 1.3 saves half of the sweeps.
    Sor(f64),
    /// Conjugate gradients on the symmetric positive definite system A/ρ b − A F b = A s/ρ. Rows that are not
    /// reciprocal are made so first ([`super::Rows::balanced`]), which changes the solution by their sampling error.
    ConjugateGradient,
}

/// When to stop, and what may be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatrixOptions {
    /// How the equations are solved.
    pub relaxation: Relaxation,
    /// Stops when the residual Σ A |s + ρFb − b| is below this share of the power Σ A s, in every channel.
    pub tolerance: f64,
    /// Stops after this many sweeps in any case.
    pub max_sweeps: u64,
    /// Memory that may be taken, bytes.
    pub memory_bytes: u64,
}

impl Default for MatrixOptions {
    fn default() -> Self {
        Self {
            relaxation: Relaxation::default(),
            tolerance: 1e-10,
            max_sweeps: 10_000,
            memory_bytes: 4 << 30,
        }
    }
}

/// Memory that [`solve`] will take, bytes, for rows of `entries` factors in all; n² if every patch sees every other.
pub fn predicted_bytes(patches: usize, entries: usize, relaxation: Relaxation) -> u64 {
    // Column and f64 weight. Conjugate gradients meet both estimates of each pair, in lists of (u32, f64) and again
    // as rows.
    let per_entry = match relaxation {
        Relaxation::ConjugateGradient => 12 + 2 * 16 + 2 * 12,
        _ => 12,
    };
    let per_patch = 16 * size_of::<Rgb>();
    (entries as u64).saturating_mul(per_entry).saturating_add((patches * per_patch) as u64)
}

/// Solves the whole system.
///
/// Fails with [`Error::TooLarge`] before anything is allocated, where the matrix would not fit.
/// Fails with [`Error::Invalid`] for a relaxation factor outside ]0, 2[.
pub fn solve<R: RowSource>(
    problem: &Problem<R>,
    options: &MatrixOptions,
    progress: &Progress,
) -> Result<Solution> {
    let patches = problem.len();
    let wanted = predicted_bytes(patches, problem.rows().entries(), options.relaxation);
    if wanted > options.memory_bytes {
        return Err(too_large(patches, wanted, options.memory_bytes));
    }
    if let Relaxation::Sor(omega) = options.relaxation
        && !(omega > 0.0 && omega < 2.0)
    {
        return Err(Error::invalid(
            "matrix solver",
            format!("a relaxation factor of {omega} does not converge: choose one between 0 and 2"),
        ));
    }
    let matrix = match options.relaxation {
        Relaxation::ConjugateGradient => Matrix::balanced(problem),
        _ => Matrix::collect(problem.rows()),
    };
    let emitted = problem.emitted();
    let mut radiosity = problem.source().to_vec();
    let mut sweeps = 0;
    let mut conjugate = ConjugateGradient::default();
    loop {
        let received = matrix.times(&radiosity);
        let residual = residual(problem, &radiosity, &received);
        let power =
            weighted_sum(problem.area(), &residual.iter().map(|r| r.map(f64::abs)).collect::<Vec<_>>());
        debug_assert!(
            power.is_finite()
                && ledger(problem, &matrix, &radiosity, &received, &residual).imbalance()
                    <= Ledger::CLOSES_TO,
            "after sweep {sweeps}: {:?}",
            ledger(problem, &matrix, &radiosity, &received, &residual)
        );
        let done = (0..3).all(|c| power[c] <= options.tolerance * emitted[c]);
        progress.unshot(share(power.element_sum(), emitted.element_sum()));
        if done || sweeps >= options.max_sweeps || progress.cancelled() {
            return Ok(finished(problem, &matrix, radiosity, received, residual, sweeps));
        }
        match options.relaxation {
            Relaxation::Jacobi => {
                radiosity.iter_mut().zip(&residual).for_each(|(b, &r)| *b += r);
            }
            Relaxation::GaussSeidel => relax(problem, &matrix, &mut radiosity, 1.0),
            Relaxation::Sor(omega) => relax(problem, &matrix, &mut radiosity, omega),
            Relaxation::ConjugateGradient => conjugate.step(problem, &matrix, &mut radiosity, &residual),
        }
        sweeps += 1;
    }
}

/// The refusal of a matrix.
pub(super) fn too_large(patches: usize, wanted_bytes: u64, memory_bytes: u64) -> Error {
    let human = |bytes: u64| match bytes as f64 / f64::from(1 << 20) {
        mib if mib < 1024.0 => format!("{mib:.1} MiB"),
        mib => format!("{:.1} GiB", mib / 1024.0),
    };
    Error::TooLarge {
        at: "matrix solver".into(),
        what: format!(
            "the form factors of {patches} patches want {} and may have {}; raise --memory, ask for fewer patches by a \
             lower --quality, or use --solver progressive, which does with less",
            human(wanted_bytes),
            human(memory_bytes)
        ),
    }
}

fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

/// s + ρFb − b.
fn residual<R: RowSource>(problem: &Problem<R>, radiosity: &[Rgb], received: &[Rgb]) -> Vec<Rgb> {
    (0..radiosity.len())
        .map(|i| problem.source()[i] + problem.reflectance()[i] * received[i] - radiosity[i])
        .collect()
}

/// One sweep of successive over-relaxation; the patch's view of itself is solved exactly.
fn relax<R: RowSource>(problem: &Problem<R>, matrix: &Matrix, radiosity: &mut [Rgb], omega: f64) {
    for i in 0..radiosity.len() {
        let arriving = matrix.gather(i, radiosity);
        let own = matrix.diagonal[i];
        let (b, rho) = (radiosity[i], problem.reflectance()[i]);
        let solved = (problem.source()[i] + rho * (arriving - b * own)) / (1.0 - rho * own);
        radiosity[i] += (solved - b) * omega;
    }
}

/// Where the energy of an approximation is.
fn ledger<R: RowSource>(
    problem: &Problem<R>,
    matrix: &Matrix,
    radiosity: &[Rgb],
    received: &[Rgb],
    residual: &[Rgb],
) -> Ledger {
    let area = problem.area();
    let Sums { arrived, promised } = matrix.sums(area);
    let mut ledger =
        Ledger { emitted: problem.emitted(), unshot: weighted_sum(area, residual), ..Ledger::default() };
    for i in 0..area.len() {
        ledger.absorbed += (1.0 - problem.reflectance()[i]) * received[i] * area[i];
        ledger.escaped += radiosity[i] * (area[i] - arrived[i]);
        ledger.sampling += radiosity[i] * (promised[i] - arrived[i]);
    }
    ledger
}

fn finished<R: RowSource>(
    problem: &Problem<R>,
    matrix: &Matrix,
    radiosity: Vec<Rgb>,
    received: Vec<Rgb>,
    residual: Vec<Rgb>,
    sweeps: u64,
) -> Solution {
    let area = problem.area();
    let unshot_power = weighted_sum_abs(area, &residual).element_sum();
    let emitted = problem.emitted().element_sum();
    let sums = matrix.sums(area).promised;
    let sums = sums.iter().zip(area).map(|(promised, area)| promised / area);
    let gather = |left: &[Rgb]| matrix.times(left);
    Solution {
        error_bound: bound::remaining_power(area, problem.reflectance(), sums, &residual, gather),
        ledger: ledger(problem, matrix, &radiosity, &received, &residual),
        // B = s + ρE, with the last residual, as the progressive solver has it.
        radiosity: radiosity.iter().zip(&residual).map(|(&b, &r)| b + r).collect(),
        received,
        unshot_power,
        unshot_fraction: share(unshot_power, emitted),
        shots: 0,
        sweeps,
    }
}

/// All form factors in f64, compressed sparse rows.
struct Matrix {
    start: Vec<usize>,
    column: Vec<u32>,
    weight: Vec<f64>,
    diagonal: Vec<f64>,
}

/// What a unit of radiosity of each patch brings to all others, and what its own row says it does, m².
struct Sums {
    arrived: Vec<f64>,
    promised: Vec<f64>,
}

impl Matrix {
    fn sums(&self, area: &[f64]) -> Sums {
        let mut sums = Sums { arrived: vec![0.0; area.len()], promised: vec![0.0; area.len()] };
        for (i, own) in area.iter().enumerate() {
            for (j, weight) in self.row(i) {
                sums.arrived[j] += own * weight;
                sums.promised[i] += own * weight;
            }
        }
        sums
    }

    fn collect(rows: &impl RowSource) -> Self {
        const CHUNK: usize = 64;
        let parts: Vec<(Vec<usize>, Vec<u32>, Vec<f64>)> = (0..rows.len().div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let (mut lengths, mut column, mut weight) = (vec![], vec![], vec![]);
                let mut row = Row::default();
                for patch in chunk * CHUNK..((chunk + 1) * CHUNK).min(rows.len()) {
                    rows.row(patch, &mut row);
                    lengths.push(row.column.len());
                    column.extend_from_slice(&row.column);
                    weight.extend_from_slice(&row.weight);
                }
                (lengths, column, weight)
            })
            .collect();
        let (mut start, mut column, mut weight) = (vec![0], vec![], vec![]);
        for part in parts {
            for length in part.0 {
                start.push(start[start.len() - 1] + length);
            }
            column.extend(part.1);
            weight.extend(part.2);
        }
        Self::new(start, column, weight)
    }

    fn balanced<R: RowSource>(problem: &Problem<R>) -> Self {
        let Exchange { start, column, mut exchange, .. } = Exchange::new(problem.area(), problem.rows());
        for (i, area) in problem.area().iter().enumerate() {
            exchange[start[i]..start[i + 1]].iter_mut().for_each(|exchange| *exchange /= area);
        }
        Self::new(start, column, exchange)
    }

    fn new(start: Vec<usize>, column: Vec<u32>, weight: Vec<f64>) -> Self {
        let mut matrix = Self { start, column, weight, diagonal: vec![] };
        let own = |i: usize| matrix.row(i).filter(|(j, _)| *j == i).map(|(_, weight)| weight).sum();
        matrix.diagonal = (0..matrix.start.len() - 1).map(own).collect();
        matrix
    }

    fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.start[i]..self.start[i + 1];
        self.column[range.clone()].iter().zip(&self.weight[range]).map(|(&j, &weight)| (j as usize, weight))
    }

    fn gather(&self, i: usize, values: &[Rgb]) -> Rgb {
        self.row(i).map(|(j, weight)| values[j] * weight).sum()
    }

    fn times(&self, values: &[Rgb]) -> Vec<Rgb> {
        (0..values.len()).into_par_iter().with_min_len(64).map(|i| self.gather(i, values)).collect()
    }
}

/// Conjugate gradients with the diagonal A/ρ as preconditioner, three channels side by side. Patches that reflect
/// nothing hold their source from the start and take no part.
#[derive(Default)]
struct ConjugateGradient {
    direction: Vec<Rgb>,
    size: Rgb,
}

impl ConjugateGradient {
    /// `residual` is s + ρFb − b, which the preconditioner makes of the symmetric system's own residual.
    fn step<R: RowSource>(
        &mut self,
        problem: &Problem<R>,
        matrix: &Matrix,
        radiosity: &mut [Rgb],
        residual: &[Rgb],
    ) {
        let reflectance = problem.reflectance();
        let metric = |i: usize| {
            let rho = reflectance[i];
            Rgb::select(rho.cmpgt(Rgb::ZERO), problem.area()[i] / rho, Rgb::ZERO)
        };
        let product = |a: &[Rgb], b: &[Rgb]| -> Rgb { (0..a.len()).map(|i| metric(i) * a[i] * b[i]).sum() };
        let ratio = |top: Rgb, bottom: Rgb| Rgb::select(bottom.cmpgt(Rgb::ZERO), top / bottom, Rgb::ZERO);
        let size = product(residual, residual);
        if self.direction.is_empty() {
            self.direction = residual.to_vec();
        } else {
            let keep = ratio(size, self.size);
            for (direction, &residual) in self.direction.iter_mut().zip(residual) {
                *direction = residual + *direction * keep;
            }
        }
        self.size = size;
        // (1 − ρF) p, which times A/ρ is the symmetric matrix times p.
        let arriving = matrix.times(&self.direction);
        let image: Vec<Rgb> =
            (0..radiosity.len()).map(|i| self.direction[i] - reflectance[i] * arriving[i]).collect();
        let length = ratio(size, product(&self.direction, &image));
        for (b, &direction) in radiosity.iter_mut().zip(&self.direction) {
            *b += direction * length;
        }
    }
}
