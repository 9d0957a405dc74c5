//! How the power of a shot finds its receivers.

use super::Rgb;
use super::bound;
use super::components::Components;
use super::problem::Problem;
use super::rows::{Columns, RowSource, Rows};
use crate::transport::form_factors::Row;

/// Where a shooter's power goes.
pub trait Transfer {
    /// Calls `receive(i, f)` for every patch i that receives: one unit of radiosity of `shooter` makes the irradiance
    /// f on it.
    fn shoot(&mut self, shooter: usize, area: &[f64], receive: impl FnMut(usize, f64));

    /// The share of the shooter's power that its own row says arrives; none where this is what a shot does.
    fn arriving(&self, shooter: usize) -> Option<f64>;

    /// Bound on Σ A |b* − b| per channel; see `bound.rs`.
    fn error_bound(&self, unshot: &[Rgb]) -> Rgb;
}

/// Rows that are kept: receivers gather by their own factors, E_i += F_ij Δb_j.
pub struct Kept<'p> {
    pub(super) problem: &'p Problem<Rows>,
    pub(super) columns: Columns,
    arriving: Vec<f64>,
}

/// Rows that are made when their patch shoots, and forgotten: E_i += F_ji A_j/A_i Δb_j, by reciprocity.
pub struct Remade<'p, R> {
    problem: &'p Problem<R>,
    row: Row,
}

impl<'p> Kept<'p> {
    pub(super) fn new(problem: &'p Problem<Rows>) -> (Self, Components) {
        let columns = problem.rows().transposed();
        let arriving = (0..problem.len()).map(|patch| problem.rows().sum(patch)).collect();
        (Self { problem, columns, arriving }, Components::of_rows(problem))
    }
}

impl<'p, R: RowSource> Remade<'p, R> {
    pub(super) fn new(problem: &'p Problem<R>) -> (Self, Components) {
        (Self { problem, row: Row::default() }, Components::single(problem))
    }
}

impl Transfer for Kept<'_> {
    fn shoot(&mut self, shooter: usize, _: &[f64], mut receive: impl FnMut(usize, f64)) {
        let (row, weight) = self.columns.patch(shooter);
        for (&i, &weight) in row.iter().zip(weight) {
            receive(i as usize, f64::from(weight));
        }
    }

    fn arriving(&self, shooter: usize) -> Option<f64> {
        Some(self.arriving[shooter])
    }

    fn error_bound(&self, unshot: &[Rgb]) -> Rgb {
        bound::remaining_power(self.problem, &self.columns, unshot)
    }
}

impl<R: RowSource> Transfer for Remade<'_, R> {
    fn shoot(&mut self, shooter: usize, area: &[f64], mut receive: impl FnMut(usize, f64)) {
        self.problem.rows().row(shooter, &mut self.row);
        for (&i, &weight) in self.row.column.iter().zip(&self.row.weight) {
            receive(i as usize, weight * area[shooter] / area[i as usize]);
        }
    }

    fn arriving(&self, _: usize) -> Option<f64> {
        None
    }

    fn error_bound(&self, unshot: &[Rgb]) -> Rgb {
        bound::remaining_power_remade(self.problem, unshot)
    }
}
