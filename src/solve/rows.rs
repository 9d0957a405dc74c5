//! Form factors by patch: kept, or made again when asked for.

use crate::error::{Error, Result};
use crate::transport::form_factors::Row;
use rayon::prelude::*;

/// Row sums may exceed 1 by the rounding of f32 weights, not by more.
const SUM_ROUNDING: f64 = 1e-6;

/// Patches of one unit of parallel work. Fixed, so that nothing depends on the number of threads.
const CHUNK: usize = 256;

/// Where form factors come from, one patch at a time: [`Rows`] keeps them all, another source may trace the rays of a
/// patch again each time, for O(n) memory. The same patch always gives the same row.
pub trait RowSource: Sync {
    /// Number of patches.
    fn len(&self) -> usize;

    /// Fills `row` with the form factors of `patch`: F_ij for j in ascending order.
    fn row(&self, patch: usize, row: &mut Row);

    /// Whether there is no patch.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The most factors that all rows together can have; n² when nobody knows better.
    fn entries(&self) -> usize {
        self.len().saturating_mul(self.len())
    }
}

/// A [`RowSource`] that makes row i by calling a function: with rays, a hemicube or closed forms.
pub struct Made<F> {
    len: usize,
    make: F,
}

impl<F: Fn(usize, &mut Row) + Sync> Made<F> {
    /// `make(i, row)` fills `row` for each patch i below `len`.
    pub fn new(len: usize, make: F) -> Self {
        Self { len, make }
    }
}

impl<F: Fn(usize, &mut Row) + Sync> RowSource for Made<F> {
    fn len(&self) -> usize {
        self.len
    }

    fn row(&self, patch: usize, row: &mut Row) {
        (self.make)(patch, row);
    }
}

/// All form factors F_ij, by row, without the zeros: compressed sparse rows. Row i says where the power of patch i
/// goes, or, by reciprocity, what patch i sees: E_i = Σ_j F_ij b_j.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    start: Vec<usize>,
    column: Vec<u32>,
    weight: Vec<f32>,
    miss: Vec<f32>,
    beyond: Vec<[f32; 3]>,
}

impl Rows {
    /// Checks and keeps `rows`. Every weight is finite and not negative, columns ascend and name patches, and a row's
    /// weights and miss add up to 1 at most.
    pub fn new(rows: impl IntoIterator<Item = Row>) -> Result<Self> {
        let mut all = Self { start: vec![0], column: vec![], weight: vec![], miss: vec![], beyond: vec![] };
        for row in rows {
            all.push(&row);
        }
        all.checked()
    }

    /// Rows of ray counts: of `rays` rays of patch i, `hits[i]` are (patch, count) and `missed[i]` left the scene.
    /// Where `rays` is a power of two the factors are exact, and those of a closed scene add up to exactly 1.
    pub fn from_counts(rays: u32, hits: &[Vec<(u32, u32)>], missed: &[u32]) -> Result<Self> {
        if hits.len() != missed.len() {
            return Err(invalid("as many miss counts as rows of hits are needed"));
        }
        let share = |count: u32| f64::from(count) / f64::from(rays);
        Self::new(hits.iter().zip(missed).map(|(hits, &missed)| {
            let mut hits = hits.clone();
            hits.sort_unstable();
            let mut row = Row { miss: share(missed), ..Row::default() };
            for same in hits.chunk_by(|a, b| a.0 == b.0) {
                row.column.push(same[0].0);
                row.weight.push(share(same.iter().map(|hit| hit.1).sum()));
            }
            row
        }))
    }

    /// Asks for every row once, in parallel.
    pub fn collect(source: &impl RowSource) -> Result<Self> {
        let count = source.len();
        let parts: Vec<Self> = (0..count.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let mut part =
                    Self { start: vec![0], column: vec![], weight: vec![], miss: vec![], beyond: vec![] };
                let mut row = Row::default();
                for patch in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                    source.row(patch, &mut row);
                    part.push(&row);
                }
                part
            })
            .collect();
        let entries = parts.iter().map(|part| part.column.len()).sum();
        let mut all = Self {
            start: Vec::with_capacity(count + 1),
            column: Vec::with_capacity(entries),
            weight: Vec::with_capacity(entries),
            miss: Vec::with_capacity(count),
            beyond: Vec::with_capacity(count),
        };
        all.start.push(0);
        for part in parts {
            let offset = all.column.len();
            all.start.extend(part.start[1..].iter().map(|start| start + offset));
            all.column.extend(part.column);
            all.weight.extend(part.weight);
            all.miss.extend(part.miss);
            all.beyond.extend(part.beyond);
        }
        all.checked()
    }

    fn push(&mut self, row: &Row) {
        self.column.extend_from_slice(&row.column);
        self.weight.extend(row.weight.iter().map(|&weight| weight as f32));
        self.start.push(self.column.len());
        self.miss.push(row.miss as f32);
        self.beyond.push(row.beyond.map(|radiance| radiance as f32));
    }

    fn checked(self) -> Result<Self> {
        let count = self.len();
        if self.column.len() != self.weight.len() {
            return Err(invalid("a row has another number of patches than of factors"));
        }
        for patch in 0..count {
            let (column, weight) = self.patch(patch);
            let miss = self.miss[patch];
            let fault = |what: &str| Err(invalid(&format!("row {patch}: {what}")));
            if column.windows(2).any(|pair| pair[0] >= pair[1]) {
                return fault("patches must ascend, each at most once");
            }
            if column.last().is_some_and(|&last| last as usize >= count) {
                return fault("a factor goes to a patch that does not exist");
            }
            if weight.iter().chain([&miss]).any(|weight| !weight.is_finite() || *weight < 0.0) {
                return fault("a factor is negative or not finite");
            }
            if self.sum(patch) + f64::from(miss) > 1.0 + SUM_ROUNDING {
                return fault("more power arrives than leaves: the factors add up to more than 1");
            }
        }
        Ok(self)
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.miss.len()
    }

    /// Whether there is no patch.
    pub fn is_empty(&self) -> bool {
        self.miss.is_empty()
    }

    /// The patches that `patch` sees, ascending, and the form factor to each.
    pub fn patch(&self, patch: usize) -> (&[u32], &[f32]) {
        let range = self.start[patch]..self.start[patch + 1];
        (&self.column[range.clone()], &self.weight[range])
    }

    /// Σ_j F_ij: the share of the patch's power that other patches receive.
    pub fn sum(&self, patch: usize) -> f64 {
        self.patch(patch).1.iter().map(|&weight| f64::from(weight)).sum()
    }

    /// Share of each patch's power that leaves the scene.
    pub fn miss(&self) -> &[f32] {
        &self.miss
    }

    /// Mean radiance from beyond the scene over each patch's hemisphere, W/(m² sr); see [`Row::beyond`].
    pub fn beyond(&self) -> &[[f32; 3]] {
        &self.beyond
    }

    /// Number of factors that are not zero.
    pub fn entries(&self) -> usize {
        self.column.len()
    }

    /// Memory of these rows, bytes.
    pub fn memory_bytes(&self) -> u64 {
        Self::predicted_bytes(self.len(), self.entries())
    }

    /// Memory that rows of `patches` patches with `entries` factors in all take, bytes. The solver's columns take the
    /// same again.
    pub fn predicted_bytes(patches: usize, entries: usize) -> u64 {
        let per_patch = size_of::<usize>() + size_of::<f32>() + size_of::<[f32; 3]>();
        patches as u64 * per_patch as u64 + entries as u64 * (size_of::<u32>() + size_of::<f32>()) as u64
    }

    /// The same factors by receiver's column: for each shooter j all (i, F_ij).
    pub(super) fn transposed(&self) -> Columns {
        let count = self.len();
        let mut start = vec![0usize; count + 1];
        for &column in &self.column {
            start[column as usize + 1] += 1;
        }
        for column in 0..count {
            start[column + 1] += start[column];
        }
        // Each block of columns walks all rows, finds its part by bisection and writes its own slice.
        let mut row = vec![0u32; self.column.len()];
        let mut weight = vec![0f32; self.column.len()];
        let mut blocks = Vec::with_capacity(count.div_ceil(CHUNK));
        let (mut rows_left, mut weights_left) = (&mut row[..], &mut weight[..]);
        for first in (0..count).step_by(CHUNK) {
            let last = (first + CHUNK).min(count);
            let (rows_here, rest) = rows_left.split_at_mut(start[last] - start[first]);
            rows_left = rest;
            let (weights_here, rest) = weights_left.split_at_mut(start[last] - start[first]);
            weights_left = rest;
            blocks.push((first, last, rows_here, weights_here));
        }
        blocks.into_par_iter().for_each(|(first, last, rows_here, weights_here)| {
            let mut next: Vec<usize> = start[first..last].iter().map(|at| at - start[first]).collect();
            for patch in 0..count {
                let (column, weight) = self.patch(patch);
                let begin = column.partition_point(|&j| (j as usize) < first);
                for (&j, &weight) in column[begin..].iter().zip(&weight[begin..]) {
                    if j as usize >= last {
                        break;
                    }
                    let slot = &mut next[j as usize - first];
                    rows_here[*slot] = patch as u32;
                    weights_here[*slot] = weight;
                    *slot += 1;
                }
            }
        });
        Columns { start, row, weight }
    }
}

impl RowSource for Rows {
    fn len(&self) -> usize {
        self.miss.len()
    }

    fn row(&self, patch: usize, row: &mut Row) {
        let (column, weight) = self.patch(patch);
        row.clear();
        row.column.extend_from_slice(column);
        row.weight.extend(weight.iter().map(|&weight| f64::from(weight)));
        row.miss = f64::from(self.miss[patch]);
        row.beyond = self.beyond[patch].map(f64::from);
    }

    fn entries(&self) -> usize {
        self.column.len()
    }
}

/// [`Rows`] by column.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    start: Vec<usize>,
    row: Vec<u32>,
    weight: Vec<f32>,
}

impl Columns {
    /// The patches that see `patch`, ascending, and the form factor from each to it.
    pub(super) fn patch(&self, patch: usize) -> (&[u32], &[f32]) {
        let range = self.start[patch]..self.start[patch + 1];
        (&self.row[range.clone()], &self.weight[range])
    }
}

fn invalid(what: &str) -> Error {
    Error::invalid("form factors", what)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(entries: &[(u32, f64)], miss: f64) -> Row {
        let (column, weight) = entries.iter().copied().unzip();
        Row { column, weight, miss, ..Row::default() }
    }

    #[test]
    fn broken_rows_are_refused_with_their_number() {
        let good = row(&[(0, 0.5), (1, 0.5)], 0.0);
        for (bad, word) in [
            (row(&[(1, 0.5), (0, 0.5)], 0.0), "ascend"),
            (row(&[(1, 0.5), (1, 0.5)], 0.0), "ascend"),
            (row(&[(2, 0.5)], 0.0), "exist"),
            (row(&[(0, -0.5)], 0.0), "negative"),
            (row(&[(0, f64::NAN)], 0.0), "finite"),
            (row(&[(0, 0.5)], f64::INFINITY), "finite"),
            (row(&[(0, 0.9), (1, 0.2)], 0.0), "more than 1"),
            (row(&[(0, 0.9)], 0.2), "more than 1"),
        ] {
            let error = Rows::new([good.clone(), bad]).unwrap_err().to_string();
            assert!(error.contains("row 1") && error.contains(word), "{error}");
        }
        assert!(Rows::new([good.clone(), good]).is_ok());
    }

    #[test]
    fn counts_become_exact_factors() {
        let rows = Rows::from_counts(64, &[vec![(1, 40), (0, 7), (1, 17)], vec![(0, 64)]], &[0, 0]).unwrap();
        assert_eq!(rows.patch(0), (&[0, 1][..], &[7.0 / 64.0, 57.0 / 64.0][..]));
        assert_eq!((rows.sum(0), rows.sum(1)), (1.0, 1.0));
        assert_eq!(rows.memory_bytes(), 3 * 8 + 2 * (8 + 4 + 12));
    }

    #[test]
    fn the_transposed_of_many_rows_holds_every_factor_once() {
        let count = 1000u32;
        let rows = Rows::new((0..count).map(|i| {
            let columns = (0..count).filter(|j| (i * 31 + j * 17) % 97 == 0);
            row(&columns.map(|j| (j, f64::from(i + j) * 1e-6)).collect::<Vec<_>>(), 0.0)
        }))
        .unwrap();
        let columns = rows.transposed();
        let mut found = 0;
        for j in 0..count as usize {
            let (row, weight) = columns.patch(j);
            assert!(row.is_sorted());
            for (&i, weight) in row.iter().zip(weight) {
                let (column, weights) = rows.patch(i as usize);
                assert_eq!(weights[column.binary_search(&(j as u32)).unwrap()], *weight);
                found += 1;
            }
        }
        assert_eq!(found, rows.entries());
    }

    #[test]
    fn collecting_gives_the_rows_of_the_source() {
        let rows = Rows::new((0..700).map(|i| row(&[(i / 2, 0.25), (i / 2 + 1, 0.5)], 0.25))).unwrap();
        assert_eq!(Rows::collect(&rows).unwrap(), rows);
    }
}
