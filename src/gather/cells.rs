//! The adaptive grid: cells in texture space, from coarse to fine, one round a level.

use super::hemisphere::{DirectionSet, Gathered};
use super::interpolate::{Finished, Nodes, Shape, plane};
use super::parted::parted;
use super::{Indirect, Surroundings};
use crate::direct::{Block, Direct};
use crate::elements::{Chart, Elements, NO_ELEMENT};
use crate::options::GatherOptions;
use crate::progress::Progress;
use crate::transport::{Hit, Tracer};
use crate::units::{Irradiance, Radiosity};
use glam::Vec3;
use rayon::prelude::*;

/// Something stands near a cell when it is nearer than this many of its widths (harmonic mean over the hemisphere).
const CONTACT_WIDTHS: f32 = 1.5;
/// Where something stands near, light may bend between nodes unseen. A parabola that starts level deviates from its
/// chord by a quarter of its rise: nodes that span more than four times the allowed difference are not trusted.
const MOST_RISE_NEAR: f32 = 4.0;
/// The same where nothing is near and the middle node would show the bend.
const MOST_RISE: f32 = 12.0;
/// Normals of one cell differ by less than acos(this).
pub(super) const SAME_NORMAL: f32 = 0.9;
/// Places darker than this share of the mean light count as this bright: nobody sees their error.
const DARK_SHARE: f32 = 0.1;

/// A rectangle of texels of one chart; corners inclusive, so neighbours share their border.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    pub chart: u32,
    pub min: [u16; 2],
    pub max: [u16; 2],
}

/// The elements a cell is judged by: nearest to its corners, and to its centre.
#[derive(Clone, Copy)]
struct Proxies {
    element: [u32; 5],
    /// Whether the four corners are exactly at the cell's corners.
    regular: bool,
}

struct State {
    value: Vec<Irradiance>,
    distance_m: Vec<f32>,
    gathered: Vec<bool>,
    nodes: u64,
    rays: u64,
    /// Of all exported light, about.
    mean: f32,
}

pub(super) fn fill<T: Tracer, S: Fn(&Hit) -> Radiosity + Sync>(
    elements: &Elements,
    direct: &Direct,
    coarse: &[Irradiance],
    around: &Surroundings<T, S>,
    set: &DirectionSet,
    options: &GatherOptions,
    progress: &mut Progress,
) -> Indirect {
    let mean = mean_light(elements, &direct.irradiance, coarse);
    let mut state = State {
        mean,
        value: coarse.to_vec(),
        distance_m: vec![f32::INFINITY; elements.len()],
        gathered: vec![false; elements.len()],
        nodes: 0,
        rays: 0,
    };
    let wanted: u64 = elements.charts.iter().filter(|c| c.exported).map(|c| c.elements.len() as u64).sum();
    progress.restart(wanted);
    if options.tolerance <= 0.0 {
        let all: Vec<u32> = exported(elements).collect();
        evaluate(elements, around, set, &all, &mut state, progress);
        progress.advance(0);
    } else {
        let floor = DARK_SHARE * mean;
        let mut cells = roots(elements, &direct.blocks, options.widest_cell.clamp(1, 256) as u16);
        let mut finished = Vec::new();
        while !cells.is_empty() && !progress.cancelled() {
            cells = round(
                elements,
                &direct.irradiance,
                around,
                set,
                options,
                floor,
                cells,
                &mut finished,
                &mut state,
                progress,
            );
        }
        if !progress.cancelled() {
            let (hidden, rays) = parted(elements, &finished, &state.gathered, around.sight, around.tracer);
            state.rays += rays;
            evaluate(elements, around, set, &hidden, &mut state, progress);
        }
        spread(elements, &finished, &mut state);
    }
    Indirect { gathered: state.gathered, nodes: state.nodes, rays: state.rays, irradiance: state.value }
}

fn exported(elements: &Elements) -> impl Iterator<Item = u32> + use<'_> {
    let charts = elements.charts.iter().filter(|c| c.exported);
    charts.flat_map(|c| c.elements.clone()).filter(|&e| elements.valid[e as usize])
}

fn mean_light(elements: &Elements, direct: &[Irradiance], coarse: &[Irradiance]) -> f32 {
    let (mut sum, mut area) = (0.0_f64, 0.0_f64);
    for e in exported(elements) {
        let e = e as usize;
        sum += f64::from((direct[e].mean() + coarse[e].mean()) * elements.area[e].0);
        area += f64::from(elements.area[e].0);
    }
    if area > 0.0 { (sum / area) as f32 } else { 0.0 }
}

/// One grid a block of the direct light, whose elements share their faint emitters.
fn roots(elements: &Elements, blocks: &[Block], widest: u16) -> Vec<Cell> {
    let mut cells = Vec::new();
    for block in blocks.iter().filter(|b| elements.charts[b.chart as usize].exported) {
        let cuts = |axis: usize| {
            let (from, to) = (block.min[axis], block.max[axis] - 1);
            let pieces = (to - from).div_ceil(widest).max(1);
            (0..=pieces)
                .map(|i| from + (u32::from(to - from) * u32::from(i) / u32::from(pieces)) as u16)
                .collect::<Vec<_>>()
        };
        let (columns, rows) = (cuts(0), cuts(1));
        for y in rows.windows(2) {
            for x in columns.windows(2) {
                cells.push(Cell { chart: block.chart, min: [x[0], y[0]], max: [x[1], y[1]] });
            }
        }
    }
    cells
}

/// Gives the elements of finished cells their values.
fn spread(elements: &Elements, finished: &[Finished], state: &mut State) {
    let mut filled = vec![false; elements.len()];
    // Batches, so that the copies stay small next to the elements.
    for batch in finished.chunks(4096) {
        let nodes = Nodes { elements, value: &state.value, gathered: &state.gathered };
        for (e, value) in nodes.fill_all(batch) {
            if !std::mem::replace(&mut filled[e as usize], true) {
                state.value[e as usize] = value;
            }
        }
    }
}

#[allow(clippy::too_many_arguments)]
fn round<T: Tracer, S: Fn(&Hit) -> Radiosity + Sync>(
    elements: &Elements,
    direct: &[Irradiance],
    around: &Surroundings<T, S>,
    set: &DirectionSet,
    options: &GatherOptions,
    floor: f32,
    cells: Vec<Cell>,
    finished: &mut Vec<Finished>,
    state: &mut State,
    progress: &Progress,
) -> Vec<Cell> {
    let proxies: Vec<Option<Proxies>> = cells.par_iter().map(|cell| proxies(elements, cell)).collect();
    let mut wanted: Vec<u32> = proxies.iter().flatten().flat_map(|p| p.element).collect();
    wanted.sort_unstable();
    wanted.dedup();
    wanted.retain(|&e| !state.gathered[e as usize]);
    evaluate(elements, around, set, &wanted, state, progress);
    if progress.cancelled() {
        return Vec::new();
    }
    let judge = Judge { elements, direct, state, tolerance: options.tolerance, floor };
    let judged: Vec<Verdict> = cells
        .par_iter()
        .zip(&proxies)
        .map(|(cell, proxies)| {
            proxies.as_ref().map_or(Verdict::Known, |proxies| judge.verdict(cell, proxies))
        })
        .collect();
    let mut next = Vec::new();
    for (cell, verdict) in cells.iter().zip(judged) {
        match verdict {
            Verdict::Known => {}
            Verdict::Smooth(cell) => {
                let [width, height] = [0, 1].map(|k| u64::from(cell.cell.max[k] - cell.cell.min[k]));
                progress.advance((width * height).saturating_sub(2));
                finished.push(cell);
            }
            Verdict::Split => next.extend(split(cell)),
        }
    }
    next
}

enum Verdict {
    /// There is nothing between the nodes.
    Known,
    Smooth(Finished),
    Split,
}

fn evaluate<T: Tracer, S: Fn(&Hit) -> Radiosity + Sync>(
    elements: &Elements,
    around: &Surroundings<T, S>,
    set: &DirectionSet,
    wanted: &[u32],
    state: &mut State,
    progress: &Progress,
) {
    // Batches, so that a cancelled run keeps what it has.
    for batch in wanted.chunks(8192) {
        if progress.cancelled() {
            return;
        }
        let one = |&e: &u32| (!progress.cancelled()).then(|| set.gather(elements, e, around));
        let gathered: Vec<Option<(Gathered, u64)>> = batch.par_iter().map(one).collect();
        let (mut square, mut count) = (0.0, 0.0);
        for (&e, gathered) in batch.iter().zip(gathered) {
            let Some((gathered, rays)) = gathered else { continue };
            state.rays += rays;
            square += f64::from(gathered.irradiance.mean() - state.value[e as usize].mean()).powi(2);
            count += 1.0;
            state.value[e as usize] = gathered.irradiance;
            state.distance_m[e as usize] = gathered.distance_m;
            state.gathered[e as usize] = true;
        }
        state.nodes += batch.len() as u64;
        progress.advance(batch.len() as u64);
        // What is left is likely to be off by as much as what was found just now.
        if count > 0.0 && state.mean > 0.0 {
            progress.unfinished((square / count).sqrt() / f64::from(state.mean));
        }
        progress.glimpse(&state.value);
    }
}

fn split(cell: &Cell) -> Vec<Cell> {
    let halves = |axis: usize| {
        let (from, to) = (cell.min[axis], cell.max[axis]);
        if to - from <= 1 { vec![(from, to)] } else { vec![(from, (from + to) / 2), ((from + to) / 2, to)] }
    };
    let (columns, rows) = (halves(0), halves(1));
    rows.iter()
        .flat_map(|y| columns.iter().map(|x| Cell { chart: cell.chart, min: [x.0, y.0], max: [x.1, y.1] }))
        .collect()
}

pub(super) fn element_at(elements: &Elements, chart: &Chart, x: u16, y: u16) -> Option<u32> {
    let page = &elements.pages[chart.page as usize];
    let e = page.element[y as usize * page.size_texels as usize + x as usize];
    (e != NO_ELEMENT && chart.elements.contains(&e) && elements.valid[e as usize]).then_some(e)
}

fn proxies(elements: &Elements, cell: &Cell) -> Option<Proxies> {
    let chart = &elements.charts[cell.chart as usize];
    let ([x0, y0], [x1, y1]) = (cell.min, cell.max);
    let middle = [(x0 + x1) / 2, (y0 + y1) / 2];
    let targets = [[x0, y0], [x1, y0], [x0, y1], [x1, y1], middle];
    let exact = targets.map(|[x, y]| element_at(elements, chart, x, y));
    let regular = exact[..4].iter().all(Option::is_some);
    let mut element = [NO_ELEMENT; 5];
    for k in 0..5 {
        element[k] = match exact[k] {
            Some(e) => e,
            None => nearest(elements, chart, cell, targets[k])?,
        };
    }
    Some(Proxies { element, regular })
}

/// The valid element of the cell that is nearest to a texel; the lowest id of equals.
fn nearest(elements: &Elements, chart: &Chart, cell: &Cell, to: [u16; 2]) -> Option<u32> {
    let mut best: Option<(i32, u32)> = None;
    for y in cell.min[1]..=cell.max[1] {
        for x in cell.min[0]..=cell.max[0] {
            if let Some(e) = element_at(elements, chart, x, y) {
                let (dx, dy) = (i32::from(x) - i32::from(to[0]), i32::from(y) - i32::from(to[1]));
                let key = (dx * dx + dy * dy, e);
                best = Some(best.map_or(key, |b| b.min(key)));
            }
        }
    }
    best.map(|b| b.1)
}

struct Judge<'a> {
    elements: &'a Elements,
    direct: &'a [Irradiance],
    state: &'a State,
    tolerance: f32,
    floor: f32,
}

impl Judge<'_> {
    /// Whether the nodes of the cell agree.
    fn verdict(&self, cell: &Cell, proxies: &Proxies) -> Verdict {
        let (width, height) = (cell.max[0] - cell.min[0], cell.max[1] - cell.min[1]);
        if width <= 1 && height <= 1 {
            return Verdict::Known;
        }
        let e = proxies.element.map(|e| e as usize);
        let value = e.map(|e| self.state.value[e].0);
        let middle = e[4];
        let straight = |k: usize| {
            self.elements.normal_shading[e[k]].dot(self.elements.normal_shading[middle]) >= SAME_NORMAL
        };
        if !(0..4).all(straight) {
            return Verdict::Split;
        }
        let texel_m = 2.0
            * self.elements.half_u_world[middle].length().max(self.elements.half_v_world[middle].length());
        let width_m = texel_m * f32::from(width.max(height));
        let nearest = e.iter().map(|&e| self.state.distance_m[e]).fold(f32::INFINITY, f32::min);
        let most_rise = if nearest < CONTACT_WIDTHS * width_m { MOST_RISE_NEAR } else { MOST_RISE };
        let light = (self.direct[middle].0 + value[4]).element_sum() / 3.0;
        let allowed = self.tolerance * light.max(self.floor);
        let agrees = |difference: Vec3| difference.abs().max_element() <= allowed;
        let low = value.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = value.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        if (high - low).max_element() > most_rise * allowed {
            return Verdict::Split;
        }
        let shape = if proxies.regular {
            let (s, t) = self.place(cell, middle);
            let bump = value[4] - bilinear(&[value[0], value[1], value[2], value[3]], s, t);
            let [a, b, c, d, middle] = proxies.element;
            agrees(bump).then_some(Shape::Quadratic { corner: [a, b, c, d], middle })
        } else {
            let points: Vec<(f32, f32, Vec3)> = e
                .iter()
                .zip(value)
                .map(|(&e, v)| {
                    let texel = self.elements.texel[e];
                    (f32::from(texel.x - cell.min[0]), f32::from(texel.y - cell.min[1]), v)
                })
                .collect();
            let (at, du, dv) = plane(&points);
            let fits = points.iter().all(|&(x, y, v)| agrees(v - (at + du * x + dv * y)));
            fits.then_some(Shape::Plane { middle: proxies.element[4], at, du, dv })
        };
        shape.map_or(Verdict::Split, |shape| Verdict::Smooth(Finished { cell: *cell, shape, allowed }))
    }

    /// Where an element lies in the cell, `[0, 1]²`.
    fn place(&self, cell: &Cell, element: usize) -> (f32, f32) {
        let texel = self.elements.texel[element];
        let share = |at: u16, axis: usize| {
            let width = cell.max[axis] - cell.min[axis];
            if width == 0 { 0.0 } else { f32::from(at - cell.min[axis]) / f32::from(width) }
        };
        (share(texel.x, 0), share(texel.y, 1))
    }
}

fn bilinear(corner: &[Vec3; 4], s: f32, t: f32) -> Vec3 {
    corner[0].lerp(corner[1], s).lerp(corner[2].lerp(corner[3], s), t)
}
