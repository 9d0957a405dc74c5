//! Samples moved out of other geometry, block by block.

use super::NO_ELEMENT;
use super::charts::{ChartPlan, Mapped};
use super::probe::Probe;
use super::spot::{Spot, spot};
use super::texel::{Footprint, Piece};
use super::validity::{Judge, Verdict};
use crate::transport::Tracer;
use glam::DVec2;

/// Texels of a side of the blocks that are asked together whether anything is near; bands begin at multiples of it.
pub(super) const BLOCK: usize = 8;
/// Texels of a side of the blocks that are asked one by one when something is near.
const SMALLEST: usize = 2;

/// The elements of a band before they are final.
pub(super) struct Draft<'a> {
    pub chart: ChartPlan<'a>,
    /// Texels of a row.
    pub width: usize,
    /// Row by row: the element of every texel.
    pub index: Vec<u32>,
    /// Per element: the texel's top left corner and its pieces.
    pub texels: Vec<(DVec2, &'a [Piece])>,
    pub spots: Vec<Spot>,
    pub valid: Vec<bool>,
    pub among_others: Vec<bool>,
}

/// What was found out about the elements of a band.
#[derive(Clone, Copy, Default)]
pub(super) struct Counts {
    pub moved: u32,
    pub invalid: u32,
    pub rays: u64,
}

impl<T: Tracer> Judge<'_, T> {
    /// Moves or gives up samples that other geometry covers. Where nothing else is near a block of texels, one sample
    /// speaks for all.
    pub(super) fn place(&self, probe: &Probe<T>, draft: &mut Draft) -> Counts {
        let (width, height) = (draft.width, draft.index.len() / draft.width);
        let mut counts = Counts::default();
        let mut members: Vec<usize> = Vec::with_capacity(BLOCK * BLOCK);
        for top in (0..height).step_by(BLOCK) {
            for left in (0..width).step_by(BLOCK) {
                self.place_block(probe, draft, [left, top], BLOCK, &mut members, &mut counts);
            }
        }
        counts
    }

    /// A block near other geometry is asked again in quarters, down to [`SMALLEST`]: a wall that stands on a surface
    /// is near a line of texels only.
    fn place_block(
        &self,
        probe: &Probe<T>,
        draft: &mut Draft,
        [left, top]: [usize; 2],
        size: usize,
        members: &mut Vec<usize>,
        counts: &mut Counts,
    ) {
        let (width, height) = (draft.width, draft.index.len() / draft.width);
        if left >= width || top >= height {
            return;
        }
        members.clear();
        for y in top..(top + size).min(height) {
            let row = &draft.index[y * width..][left..(left + size).min(width)];
            members.extend(row.iter().filter(|&&i| i != NO_ELEMENT).map(|&i| i as usize));
        }
        let Some(&some) = members.first() else { return };
        if !self.others_near(&draft.chart, members.iter().map(|&i| draft.spots[i])) {
            if self.buried(probe, &draft.spots[some]).is_some() {
                counts.invalid += members.len() as u32;
                members.iter().for_each(|&i| draft.valid[i] = false);
            }
        } else if size > SMALLEST {
            let half = size / 2;
            for corner in [[left, top], [left + half, top], [left, top + half], [left + half, top + half]] {
                self.place_block(probe, draft, corner, half, members, counts);
            }
        } else {
            for &i in members.iter() {
                draft.among_others[i] = true;
                self.place_one(probe, draft, i, counts);
            }
        }
    }

    fn place_one(&self, probe: &Probe<T>, draft: &mut Draft, i: usize, counts: &mut Counts) {
        let verdict = self.judge(probe, &draft.spots[i]);
        if verdict == Verdict::Free {
            return;
        }
        match self.elsewhere(probe, draft, i, verdict) {
            Some(better) => {
                draft.spots[i] = better;
                counts.moved += 1;
            }
            None if verdict == Verdict::Crowded => {}
            None => {
                draft.valid[i] = false;
                counts.invalid += 1;
            }
        }
    }

    /// The nearest other point of the texel that is better off.
    fn elsewhere(&self, probe: &Probe<T>, draft: &Draft, i: usize, verdict: Verdict) -> Option<Spot> {
        let (corner, pieces) = draft.texels[i];
        let mapped: Vec<Mapped> = pieces.iter().map(|p| draft.chart.mapped(p.triangle)).collect();
        let footprint = Footprint { corner, pieces, mapped: &mapped };
        let mut crowded = None;
        for place in footprint.others() {
            let offset = mapped[place.piece].point(place.weights).as_vec3() - draft.spots[i].on_plane;
            if matches!(verdict, Verdict::Buried(walls) if !walls.may_end_before(offset)) {
                continue;
            }
            let other = spot(&draft.chart, &footprint, &place, probe);
            match self.judge(probe, &other) {
                Verdict::Free => return Some(other),
                Verdict::Crowded => crowded = crowded.or(Some(other)),
                Verdict::Buried(_) => {}
            }
        }
        // Crowded everywhere: better beside something than inside it, and where it was rather than elsewhere.
        crowded.filter(|_| verdict != Verdict::Crowded)
    }
}
