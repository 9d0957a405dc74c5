//! A band of texel rows of one chart: its footprints, samples and their validity.

use super::charts::{ChartPlan, Mapped};
use super::clip::cut;
use super::footprint::Footprints;
use super::place::{Counts, Draft};
use super::spot::spot;
use super::texel::{Footprint, Piece};
use super::validity::Judge;
use super::{Elements, NO_ELEMENT, TexelRef};
use crate::transport::Tracer;
use crate::units::Area;
use glam::DVec2;
use std::ops::Range;

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

/// What every band is rasterised with.
pub(super) struct Work<'a, T> {
    pub judge: Judge<'a, T>,
    pub footprints: Footprints<'a>,
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
        let (first, probe) = (out.len(), self.judge.probe());
        let mut draft = Draft {
            chart: *chart,
            width,
            index: vec![NO_ELEMENT; start.len() - 1],
            texels: Vec::new(),
            spots: Vec::new(),
            valid: Vec::new(),
            among_others: Vec::new(),
        };
        let mut mapped: Vec<Mapped> = Vec::new();
        let mut last: &[Piece] = &[];
        for texel in 0..start.len() - 1 {
            let pieces = &pieces[start[texel] as usize..start[texel + 1] as usize];
            if pieces.is_empty() {
                continue;
            }
            let x = band.columns.start + (texel % width) as i32;
            let y = band.rows.start + (texel / width) as i32;
            // Neighbouring texels mostly lie in the same triangles.
            if !pieces.iter().map(|p| p.triangle).eq(last.iter().map(|p| p.triangle)) {
                mapped.clear();
                mapped.extend(pieces.iter().map(|p| chart.mapped(p.triangle)));
                last = pieces;
            }
            let footprint = Footprint { corner: corner(x, y), pieces, mapped: &mapped };
            let means = self.footprints.means(chart, &footprint);
            if means.emission.0.max_element() > 0.0 {
                out.emission.push(((first + draft.spots.len()) as u32, means.emission));
            }
            draft.index[texel] = draft.spots.len() as u32;
            draft.spots.push(spot(chart, &footprint, &footprint.place(), &probe));
            draft.texels.push((footprint.corner, pieces));
            out.area.push(Area(footprint.area() as f32));
            out.reflectance.push(means.reflectance);
            out.texel.push(TexelRef { page: chart.placement.page, x: x as u16, y: y as u16 });
            out.chart.push(band.chart);
        }
        draft.valid = vec![true; draft.spots.len()];
        draft.among_others = vec![false; draft.spots.len()];
        let mut counts = self.judge.place(&probe, &mut draft);
        counts.rays = probe.rays();
        out.valid.append(&mut draft.valid);
        out.among_others.append(&mut draft.among_others);
        for spot in &draft.spots {
            out.position_world.push(spot.position);
            out.normal_geometric.push(spot.normal_geometric);
            out.normal_shading.push(spot.normal_shading);
            out.triangle.push(spot.triangle);
            out.half_u_world.push(spot.per_texel[0] * spot.reach);
            out.half_v_world.push(spot.per_texel[1] * spot.reach);
        }
        counts
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
