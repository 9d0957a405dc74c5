//! Charts to elements: bands of rows in parallel, put together in chart order.

use super::band::{Band, Work};
use super::charts::{ChartPlan, Grouped};
use super::footprint::Footprints;
use super::place::{BLOCK, Counts};
use super::validity::Judge;
use super::{Chart, Elements, NO_ELEMENT, PageMap};
use crate::atlas::Atlas;
use crate::error::{Error, Result, Warning};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::transport::Tracer;
use rayon::prelude::*;
use std::ops::Range;

/// About how many texels one task rasterises, and how many tasks run before their results are put together.
const TASK_TEXELS: usize = 1 << 12;
const WAVE_TASKS: usize = 512;
/// A share of invalid elements that the artist should hear of.
const MANY_INVALID: f32 = 0.3;

/// What was noticed on the way.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Noticed {
    /// Rays sent to find buried samples.
    pub rays: u64,
    /// Samples that were moved out of or away from other geometry.
    pub moved: u64,
    /// Elements that are buried.
    pub invalid: u64,
    /// Surfaces of which a large part is buried.
    pub warnings: Vec<Warning>,
}

/// Finds every texel that a chart covers and samples the surface there.
///
/// Every texel whose square a chart overlaps becomes an element; the areas of a chart's elements add up to the
/// chart's. Elements stand in the order of their charts, in a chart by row, then column; charts without area have
/// none and are left out. The page maps name the first chart's element where two charts claim a texel (packing keeps
/// them apart). `back_counts` says of each surface with a lit back whether a sample may lie behind it: not where the back
/// is the inside of something solid and lit in vain.
///
/// # Errors
/// [`Error::TooLarge`] when there are more than 2³² − 1 elements; [`Error::Cancelled`].
pub fn rasterise<T: Tracer>(
    scene: &Scene,
    atlas: &Atlas,
    back_counts: &dyn Fn(usize) -> bool,
    tracer: &T,
    progress: &mut Progress,
) -> Result<(Elements, Noticed)> {
    let grouped = Grouped::new(scene, atlas);
    let charts = grouped.charts(scene, atlas);
    let rectangles: Vec<_> = charts.par_iter().map(ChartPlan::rectangle).collect();
    let (bands, lists) = bands(&charts, &rectangles);
    let tasks = tasks(&bands);
    progress.restart(tasks.len() as u64);
    let work = Work {
        judge: Judge::new(scene, atlas, back_counts, tracer),
        footprints: Footprints::new(scene, atlas),
    };

    let mut elements = Elements::default();
    let mut counts = vec![Counts::default(); scene.surfaces.len()];
    for wave in tasks.chunks(WAVE_TASKS) {
        let run = |task: &Range<usize>| {
            let mut part = Elements::default();
            let mut found = Vec::with_capacity(task.len());
            for band in &bands[task.clone()] {
                let chart = &charts[band.chart as usize];
                let triangles = band.list.map_or(chart.triangles, |list| &lists[list][..]);
                found.push((chart.surface, work.run(chart, triangles, band, &mut part)));
            }
            progress.advance(1);
            (part, found)
        };
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let done: Vec<_> = wave.par_iter().map(run).collect();
        for (part, found) in done {
            elements.append(part)?;
            for (surface, more) in found {
                let all = &mut counts[surface as usize];
                all.moved += more.moved;
                all.invalid += more.invalid;
                all.rays += more.rays;
            }
        }
    }
    number_charts(&mut elements, &charts, &rectangles);
    elements.pages = page_maps(atlas, &elements);
    let sum = |count: fn(&Counts) -> u64| counts.iter().map(count).sum();
    let noticed = Noticed {
        rays: sum(|c| c.rays),
        moved: sum(|c| c.moved.into()),
        invalid: sum(|c| c.invalid.into()),
        warnings: warnings(scene, &elements, &counts),
    };
    Ok((elements, noticed))
}

/// Cuts charts into bands of about a task's size; for charts of several bands, also the triangles that reach each.
fn bands(charts: &[ChartPlan], rectangles: &[Option<[[i32; 2]; 2]>]) -> (Vec<Band>, Vec<Vec<u32>>) {
    let (mut bands, mut lists): (Vec<Band>, Vec<Vec<u32>>) = (Vec::new(), Vec::new());
    for ((index, chart), rectangle) in (0..).zip(charts).zip(rectangles) {
        let &Some([min, max]) = rectangle else { continue };
        let width = (max[0] - min[0]) as usize;
        let height = (TASK_TEXELS / width).next_multiple_of(BLOCK) as i32;
        let many = max[1] - min[1] > height;
        let first_list = lists.len();
        for top in (min[1]..max[1]).step_by(height as usize) {
            let rows = top..(top + height).min(max[1]);
            let list = many.then(|| {
                lists.push(Vec::new());
                lists.len() - 1
            });
            bands.push(Band { chart: index, columns: min[0]..max[0], rows, list });
        }
        if many {
            for &t in chart.triangles {
                let uv = chart.mapped(t).uv;
                let (top, bottom) =
                    uv.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p.y), b.max(p.y)));
                if !(top.is_finite() && bottom.is_finite()) {
                    continue;
                }
                let band = |y: f64| ((y - f64::from(min[1])) / f64::from(height)).floor().max(0.0) as usize;
                let last = lists.len() - 1;
                lists[(first_list + band(top)).min(last)..=(first_list + band(bottom)).min(last)]
                    .iter_mut()
                    .for_each(|list| list.push(t));
            }
        }
    }
    (bands, lists)
}

/// Consecutive bands of about `TASK_TEXELS` together.
fn tasks(bands: &[Band]) -> Vec<Range<usize>> {
    let mut tasks: Vec<Range<usize>> = Vec::new();
    let mut texels = usize::MAX;
    for (i, band) in bands.iter().enumerate() {
        // A chart costs something even when it is small.
        let more = band.columns.len() * band.rows.len() + 64;
        if texels.saturating_add(more) > TASK_TEXELS {
            tasks.push(i..i);
            texels = 0;
        }
        texels += more;
        if let Some(task) = tasks.last_mut() {
            task.end = i + 1;
        }
    }
    tasks
}

/// Lists the charts that have elements and renumbers the elements' charts.
fn number_charts(elements: &mut Elements, charts: &[ChartPlan], rectangles: &[Option<[[i32; 2]; 2]>]) {
    let mut begin = 0;
    while begin < elements.chart.len() {
        let index = elements.chart[begin] as usize;
        let end = begin + elements.chart[begin..].partition_point(|&c| c as usize == index);
        let chart = &charts[index];
        let [min, max] = rectangles[index].unwrap_or_default().map(|corner| corner.map(|v| v as u16));
        let number = elements.charts.len() as u32;
        elements.chart[begin..end].fill(number);
        elements.charts.push(Chart {
            elements: begin as u32..end as u32,
            page: chart.placement.page,
            min,
            max,
            surface: chart.surface,
            source: chart.chart,
            back: chart.back,
            exported: chart.exported,
        });
        begin = end;
    }
}

fn page_maps(atlas: &Atlas, elements: &Elements) -> Vec<PageMap> {
    let empty = |page: &crate::atlas::Page| PageMap {
        size_texels: page.size_texels,
        element: vec![NO_ELEMENT; page.size_texels as usize * page.size_texels as usize],
    };
    let mut pages: Vec<PageMap> = atlas.pages.par_iter().map(empty).collect();
    for (i, texel) in (0..).zip(&elements.texel) {
        let page = &mut pages[texel.page as usize];
        let slot = &mut page.element[texel.y as usize * page.size_texels as usize + texel.x as usize];
        if *slot == NO_ELEMENT {
            *slot = i;
        }
    }
    pages
}

fn warnings(scene: &Scene, elements: &Elements, counts: &[Counts]) -> Vec<Warning> {
    let mut total = vec![0_u32; scene.surfaces.len()];
    for chart in &elements.charts {
        total[chart.surface as usize] += chart.elements.len() as u32;
    }
    let many = |(surface, (count, &total)): (&crate::scene::Surface, (&Counts, &u32))| {
        let share = count.invalid as f32 / total.max(1) as f32;
        (share > MANY_INVALID).then(|| {
            let what = format!(
                "{:.0} % of its lightmap lies inside other objects and takes its light from the rest; if it should be \
                 visible, look for duplicated or overlapping objects there, or for normals that face inward",
                100.0 * share
            );
            Warning::new(surface.origin.name.clone(), what)
        })
    };
    scene.surfaces.iter().zip(counts.iter().zip(&total)).filter_map(many).collect()
}

impl Elements {
    /// Adds the rows of another part; charts and pages are numbered later.
    fn append(&mut self, part: Self) -> Result<()> {
        let first = self.len();
        if first + part.len() >= NO_ELEMENT as usize {
            return Err(Error::TooLarge {
                what: "more than 4 294 967 294 texels; lower the density or the page size".into(),
                at: "the lightmap".into(),
            });
        }
        self.emission.extend(part.emission.into_iter().map(|(i, e)| (first as u32 + i, e)));
        self.position_world.extend(part.position_world);
        self.normal_geometric.extend(part.normal_geometric);
        self.normal_shading.extend(part.normal_shading);
        self.area.extend(part.area);
        self.reflectance.extend(part.reflectance);
        self.triangle.extend(part.triangle);
        self.half_u_world.extend(part.half_u_world);
        self.half_v_world.extend(part.half_v_world);
        self.texel.extend(part.texel);
        self.valid.extend(part.valid);
        self.among_others.extend(part.among_others);
        self.chart.extend(part.chart);
        Ok(())
    }
}
