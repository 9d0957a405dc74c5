//! How the power of a shot finds its receivers, and how a patch gathers from all others.

use super::Rgb;
use super::bound;
use super::components::Components;
use super::problem::Problem;
use super::rows::{Columns, RowSource, Rows};
use crate::transport::form_factors::Row;
use rayon::prelude::*;
use std::ops::Range;

/// Where power goes.
pub trait Transfer {
    /// Calls `receive(i, f)` for every patch i that receives: one unit of radiosity of `shooter` makes the irradiance
    /// f on it.
    fn shoot(&mut self, shooter: usize, area: &[f64], receive: impl FnMut(usize, f64));

    /// The share of the shooter's power that its own row says arrives; none where this is what a shot does.
    fn arriving(&self, shooter: usize) -> Option<f64>;

    /// What `patches` receive by their own rows, Σ_j F_ij b_j, and the sums of these rows.
    fn gather(&self, patches: Range<usize>, radiosity: &[Rgb]) -> Vec<(Rgb, f64)>;

    /// Bound on Σ A |b* − b| per channel; see `bound.rs`.
    fn error_bound(&self, unshot: &[Rgb]) -> Rgb;
}

/// Rows that are kept: receivers gather by their own factors, E_i += F_ij Δb_j.
pub struct Kept<'p> {
    problem: &'p Problem<Rows>,
    columns: Columns,
    arriving: Vec<f64>,
}

/// Rows that are made when they are needed, and forgotten. A shot goes by reciprocity, E_i += F_ji A_j/A_i Δb_j.
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

    /// Σ_j F_ij b_j.
    fn received(&self, patch: usize, radiosity: &[Rgb]) -> Rgb {
        let (column, weight) = self.problem.rows().patch(patch);
        let terms = column.iter().zip(weight);
        terms.map(|(&j, &weight)| radiosity[j as usize] * f64::from(weight)).sum()
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

    fn gather(&self, patches: Range<usize>, radiosity: &[Rgb]) -> Vec<(Rgb, f64)> {
        patches.map(|patch| (self.received(patch, radiosity), self.arriving[patch])).collect()
    }

    fn error_bound(&self, unshot: &[Rgb]) -> Rgb {
        let (area, reflectance) = (self.problem.area(), self.problem.reflectance());
        bound::remaining_power(area, reflectance, self.arriving.iter().copied(), unshot, |left| {
            let received = |patch| self.received(patch, left);
            (0..left.len()).into_par_iter().with_min_len(256).map(received).collect()
        })
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

    fn gather(&self, patches: Range<usize>, radiosity: &[Rgb]) -> Vec<(Rgb, f64)> {
        patches
            .into_par_iter()
            .map_init(Row::default, |row, patch| {
                self.problem.rows().row(patch, row);
                let terms = row.column.iter().zip(&row.weight);
                let sum = terms.map(|(&j, &weight)| radiosity[j as usize] * weight).sum();
                (sum, row.weight.iter().sum())
            })
            .collect()
    }

    fn error_bound(&self, unshot: &[Rgb]) -> Rgb {
        bound::remaining_power_remade(self.problem, unshot)
    }
}
