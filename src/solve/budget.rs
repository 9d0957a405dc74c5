//! Whether all form factors can be kept, before any is found.

use super::rows::{RowSource, Rows};
use super::{Relaxation, matrix, matrix_options};
use crate::error::Result;
use crate::options::{SolveOptions, Solver};
use crate::transport::form_factors::Row;
use rayon::prelude::*;

/// Rows that are made to see how many factors they have, where the most they can have would not fit.
const SAMPLES: usize = 64;
/// What they tell is trusted to this factor: half of its deviation over 64 rows, of one half each, four times.
const TRUST: f64 = 1.25;

/// Memory that a solver takes for rows of `entries` factors in all, bytes, the rows included.
pub(super) fn predicted_bytes(patches: usize, entries: usize, options: &SolveOptions) -> u64 {
    let rows = Rows::predicted_bytes(patches, entries);
    match options.solver {
        // The same by column.
        Solver::Progressive => rows.saturating_mul(2),
        Solver::Matrix => rows.saturating_add(matrix::predicted_bytes(patches, entries, relaxation(options))),
    }
}

fn relaxation(options: &SolveOptions) -> Relaxation {
    matrix_options(options, 0).relaxation
}

/// Whether rows fit into `memory_bytes`. Where not, the progressive solver does without; the matrix solver fails.
pub(super) fn keep_rows(source: &impl RowSource, options: &SolveOptions, memory_bytes: u64) -> Result<bool> {
    let patches = source.len();
    let mut wanted = predicted_bytes(patches, source.entries(), options);
    if wanted > memory_bytes && patches > SAMPLES {
        wanted = predicted_bytes(patches, estimated_entries(source), options);
    }
    match options.solver {
        _ if wanted <= memory_bytes => Ok(true),
        Solver::Progressive => Ok(false),
        Solver::Matrix => Err(matrix::too_large(patches, wanted, memory_bytes)),
    }
}

fn estimated_entries(source: &impl RowSource) -> usize {
    let patches = source.len();
    let found: usize = (0..SAMPLES)
        .into_par_iter()
        .map_init(Row::default, |row, k| {
            source.row((2 * k + 1) * patches / (2 * SAMPLES), row);
            row.column.len()
        })
        .sum();
    (found as f64 / SAMPLES as f64 * patches as f64 * TRUST) as usize
}
