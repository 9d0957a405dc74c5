//! A band of texel rows of one chart: its footprints, samples and their validity.

use super::charts::{ChartPlan, Mapped};
use super::clip::cut;
use super::footprint::Footprints;
use super::spot::{Spot, spot};
use super::texel::{Footprint, Piece, Place};
use super::validity::{Judge, Verdict};
use super::{Elements, TexelRef};
use crate::transport::Tracer;
use crate::units::Area;
use glam::DVec2;
use std::ops::Range;

/// Rows are handled in blocks of this many texels a side; bands begin at multiples of it.
pub(super) const BLOCK: usize = 8;

/// Some rows of a chart.
#[derive(Clone)]
pub(super) struct Band {
    /// Index of the chart.
    pub chart: u32,
    /// Columns of the page.
    pub columns: Range<i32>,
    /// Rows of the page.
    pub rows: Range<i32>,
    /// Which of [`super::rasterise`]'s lists holds the triangles that reach these rows; `None` for all of the chart.
    pub list: Option<usize>,
}

/// What [`Work::run`] found besides the elements.
#[derive(Clone, Copy, Default)]
pub(super) struct Counts {
    pub moved: u32,
    pub invalid: u32,
}

/// What every band is rasterised with.
pub(super) struct Work<'a, T> {
    pub judge: Judge<'a, T>,
    pub footprints: Footprints<'a>,
}

/// What may be tried in place of a texel's sample.
struct Candidates {
    pieces: Range<usize>,
}

impl<T: Tracer> Work<'_, T> {
    /// Appends the band's elements to `out`, by row, then column.
    pub(super) fn run(
        &self,
        chart: &ChartPlan,
        triangles: &[u32],
        band: &Band,
        out: &mut Elements,
    ) -> Counts {
        let width = band.columns.len();
        let (pieces, start) = pieces(chart, triangles, band);
        let mut index = vec![super::NO_ELEMENT; start.len() - 1];
        let first = out.len();
        let mut spots: Vec<Spot> = Vec::new();
        let mut candidates: Vec<Candidates> = Vec::new();
        for texel in 0..start.len() - 1 {
            let range = start[texel] as usize..start[texel + 1] as usize;
            if range.is_empty() {
                continue;
            }
            let (x, y) =
                (band.columns.start + (texel % width) as i32, band.rows.start + (texel / width) as i32);
            let mapped: Vec<Mapped> =
                pieces[range.clone()].iter().map(|p| chart.mapped(p.triangle)).collect();
            let footprint =
                Footprint { corner: corner(x, y), pieces: &pieces[range.clone()], mapped: &mapped };
            let means = self.footprints.means(chart, &footprint);
            index[texel] = spots.len() as u32;
            if means.emission.0.max_element() > 0.0 {
                out.emission.push(((first + spots.len()) as u32, means.emission));
            }
            spots.push(self.spot(chart, &footprint, &footprint.place()));
            candidates.push(Candidates { pieces: range });
            out.area.push(Area(footprint.area() as f32));
            out.reflectance.push(means.reflectance);
            out.texel.push(TexelRef { page: chart.placement.page, x: x as u16, y: y as u16 });
            out.chart.push(band.chart);
        }
        out.valid.resize(first + spots.len(), true);
        let counts =
            self.place_among_others(chart, band, &pieces, &index, &candidates, &mut spots, out, first);
        for spot in &spots {
            out.position_world.push(spot.position);
            out.normal_geometric.push(spot.normal_geometric);
            out.normal_shading.push(spot.normal_shading);
            out.triangle.push(spot.triangle);
            out.half_u_world.push(spot.per_texel[0] * spot.reach);
            out.half_v_world.push(spot.per_texel[1] * spot.reach);
        }
        counts
    }

    fn spot(&self, chart: &ChartPlan, footprint: &Footprint, place: &Place) -> Spot {
        let triangle = footprint.pieces[place.piece].triangle;
        spot(chart, &footprint.mapped[place.piece], triangle, place, self.judge.tracer)
    }

    /// Moves samples out of other geometry, block by block: where nothing else is near, one sample speaks for all.
    #[allow(clippy::too_many_arguments)]
    fn place_among_others(
        &self,
        chart: &ChartPlan,
        band: &Band,
        pieces: &[Piece],
        index: &[u32],
        candidates: &[Candidates],
        spots: &mut [Spot],
        out: &mut Elements,
        first: usize,
    ) -> Counts {
        let (width, height) = (band.columns.len(), band.rows.len());
        let mut counts = Counts::default();
        let mut members: Vec<usize> = Vec::with_capacity(BLOCK * BLOCK);
        for top in (0..height).step_by(BLOCK) {
            for left in (0..width).step_by(BLOCK) {
                members.clear();
                for y in top..(top + BLOCK).min(height) {
                    let row = &index[y * width..][left..(left + BLOCK).min(width)];
                    members.extend(row.iter().filter(|&&i| i != super::NO_ELEMENT).map(|&i| i as usize));
                }
                let Some(&some) = members.first() else { continue };
                if !self.judge.others_near(chart, members.iter().map(|&i| spots[i])) {
                    if self.judge.buried(&spots[some]).is_some() {
                        counts.invalid += members.len() as u32;
                        members.iter().for_each(|&i| out.valid[first + i] = false);
                    }
                    continue;
                }
                for &i in &members {
                    let verdict = self.judge.judge(&spots[i]);
                    if verdict == Verdict::Free {
                        continue;
                    }
                    let texel = out.texel[first + i];
                    let pieces = &pieces[candidates[i].pieces.clone()];
                    let corner = corner(texel.x.into(), texel.y.into());
                    match self.elsewhere(chart, corner, pieces, &spots[i], verdict) {
                        Some(better) => {
                            spots[i] = better;
                            counts.moved += 1;
                        }
                        None if matches!(verdict, Verdict::Buried { .. }) => {
                            out.valid[first + i] = false;
                            counts.invalid += 1;
                        }
                        None => {}
                    }
                }
            }
        }
        counts
    }

    /// The nearest other point of the texel that is better off.
    fn elsewhere(
        &self,
        chart: &ChartPlan,
        corner: DVec2,
        pieces: &[Piece],
        spot: &Spot,
        verdict: Verdict,
    ) -> Option<Spot> {
        if let Verdict::Buried { clearance_m } = verdict {
            // A wall runs through the texel only if one is nearer than the texel's corners; the low rays see it at
            // most 1/cos 45° farther away than it is.
            let [u, v] = spot.per_texel;
            if clearance_m > 1.5 * (u.length() + v.length()) {
                return None;
            }
        }
        let mapped: Vec<Mapped> = pieces.iter().map(|p| chart.mapped(p.triangle)).collect();
        let footprint = Footprint { corner, pieces, mapped: &mapped };
        let mut crowded = None;
        for place in footprint.others() {
            let other = self.spot(chart, &footprint, &place);
            match self.judge.judge(&other) {
                Verdict::Free => return Some(other),
                Verdict::Crowded => crowded = crowded.or(Some(other)),
                Verdict::Buried { .. } => {}
            }
        }
        // Crowded everywhere: better beside something than inside it, and where it was rather than elsewhere.
        crowded.filter(|_| matches!(verdict, Verdict::Buried { .. }))
    }
}

fn corner(x: i32, y: i32) -> DVec2 {
    DVec2::new(x.into(), y.into())
}

/// The pieces of all texels of the band, grouped by texel, ascending by triangle; and where each texel's begin.
fn pieces(chart: &ChartPlan, triangles: &[u32], band: &Band) -> (Vec<Piece>, Vec<u32>) {
    let width = band.columns.len();
    let mut found: Vec<Piece> = Vec::new();
    let mut start = vec![0_u32; width * band.rows.len() + 1];
    for &triangle in triangles {
        let mapped = chart.mapped(triangle);
        if mapped.area == 0.0 {
            continue;
        }
        cut(mapped.uv, band.rows.clone(), |part| {
            // Rounding at the rectangle's border: the area still counts.
            let x = part.x.clamp(band.columns.start, band.columns.end - 1);
            let texel =
                ((part.y - band.rows.start) as usize * width + (x - band.columns.start) as usize) as u32;
            let centroid = part.centroid - corner(x, part.y);
            let piece = Piece {
                texel,
                triangle,
                area: part.share * mapped.area,
                coverage: part.coverage as f32,
                centroid: centroid.as_vec2().clamp(glam::Vec2::ZERO, glam::Vec2::ONE).to_array(),
            };
            match found.last_mut() {
                // A needle may put several pieces into one texel.
                Some(last) if last.texel == texel && last.triangle == triangle => last.area += piece.area,
                _ => {
                    start[texel as usize + 1] += 1;
                    found.push(piece);
                }
            }
        });
    }
    for i in 1..start.len() {
        start[i] += start[i - 1];
    }
    let mut next = start.clone();
    let mut order = vec![0_u32; found.len()];
    for (i, piece) in (0..).zip(&found) {
        order[next[piece.texel as usize] as usize] = i;
        next[piece.texel as usize] += 1;
    }
    (order.into_iter().map(|i| found[i as usize]).collect(), start)
}
