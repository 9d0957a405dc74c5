//! A block of neighbouring texels, lit together: emitters that cannot reach it are left out once, and shadow borders
//! are found by comparing neighbours.

use super::emitters::{AnyEmitter, EmitterList};
use super::footprint::{Free, NO_FOOTPRINT, footprint};
use super::penumbra::Patterns;
use super::{Emitter, Receiver};
use crate::elements::{Elements, NO_ELEMENT};
use crate::plan::Sight;
use crate::transport::{Tracer, World};
use crate::units::Irradiance;
use glam::Vec3;

/// Width of a block, texels.
const TILE: u16 = 64;
/// Texels around the block that are probed too, so that borders of shadows on its rim are seen.
const APRON: usize = 2;

/// A rectangle of texels of one chart, `[min, max)`.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Chart of the elements.
    pub chart: u32,
    /// First texel.
    pub min: [u16; 2],
    /// Exclusive end.
    pub max: [u16; 2],
}

impl Block {
    /// Texels of the rectangle.
    pub fn inner_area(&self) -> u64 {
        u64::from(self.max[0] - self.min[0]) * u64::from(self.max[1] - self.min[1])
    }
}

/// Cuts all charts into blocks.
pub fn cut(elements: &Elements) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (index, chart) in elements.charts.iter().enumerate() {
        if chart.elements.is_empty() {
            continue;
        }
        for y in (chart.min[1]..chart.max[1]).step_by(TILE.into()) {
            for x in (chart.min[0]..chart.max[0]).step_by(TILE.into()) {
                let max =
                    [x.saturating_add(TILE).min(chart.max[0]), y.saturating_add(TILE).min(chart.max[1])];
                blocks.push(Block { chart: index as u32, min: [x, y], max });
            }
        }
    }
    blocks
}

/// Where every texel is refined, so many rays that all agree tell that no shadow border passes.
const ENOUGH: usize = 256;

/// What the probes of one emitter say about a texel.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Class {
    /// No element, or the emitter cannot light it.
    Out,
    Lit,
    Shadowed,
    Mixed,
}

/// The texels of a block and its apron.
struct Grid<'a> {
    elements: &'a Elements,
    width: usize,
    height: usize,
    /// Texel of the grid's corner, counted from the chart's (may be negative): where a chart lies on its page must
    /// not change its light.
    origin_in_chart: [i32; 2],
    id: Vec<u32>,
    receiver: Vec<Receiver>,
}

/// The light of one block.
pub struct LitBlock {
    /// `(element, irradiance, whether a shadow border of any emitter passes)` of every valid element inside.
    pub lit: Vec<(u32, Irradiance, bool)>,
    /// The emitters that were asked, ascending.
    pub bright: Vec<u32>,
}

/// What all blocks are lit with.
pub struct With<'a> {
    /// Receivers.
    pub elements: &'a Elements,
    /// Sources.
    pub list: &'a EmitterList,
    /// Which rays are sent.
    pub patterns: &'a Patterns,
}

/// Whether nothing stands between any element of the block or its apron and the lights that reach it.
pub fn is_clear(elements: &Elements, block: &Block, sight: &Sight) -> bool {
    let chart = &elements.charts[block.chart as usize];
    let page = &elements.pages[chart.page as usize];
    let size = page.size_texels as usize;
    let span = |axis: usize| {
        usize::from(block.min[axis]).saturating_sub(APRON)..(usize::from(block.max[axis]) + APRON).min(size)
    };
    let clear = |e: u32| {
        e == NO_ELEMENT
            || !chart.elements.contains(&e)
            || sight.is_clear(elements.triangle[e as usize], usize::from(chart.back))
    };
    span(1).all(|y| page.element[y * size..][span(0)].iter().all(|&e| clear(e)))
}

/// Lights the block with the emitters that matter there one by one, out of those that may.
pub fn light<T: Tracer>(
    with: &With,
    block: &Block,
    candidates: &[u32],
    tracer: &T,
    rays: &mut u64,
) -> LitBlock {
    let &With { elements, list, patterns } = with;
    let grid = Grid::new(elements, block, tracer.world());
    let mut sum = vec![(Irradiance::ZERO, false); grid.id.len()];
    let present: Vec<Receiver> =
        grid.inner().filter(|&i| grid.id[i] != NO_ELEMENT).map(|i| grid.receiver[i]).collect();
    let bright = list.bright_at(candidates, &present);
    let mut asked = bright.clone();
    list.add_vain(candidates, &mut asked);
    let mut scratch = Scratch::new(grid.id.len());
    for &index in &asked {
        let work = Work { grid: &grid, tracer, patterns };
        match &list.emitters[index as usize] {
            AnyEmitter::Area(e) => work.add(e, &mut scratch, &mut sum, rays),
            AnyEmitter::Point(e) => work.add(e, &mut scratch, &mut sum, rays),
            AnyEmitter::Sun(e) => work.add(e, &mut scratch, &mut sum, rays),
        }
    }
    let lit = grid.inner().filter(|&i| grid.id[i] != NO_ELEMENT).map(|i| (grid.id[i], sum[i].0, sum[i].1));
    let lit = lit.collect();
    LitBlock { lit, bright }
}

impl<'a> Grid<'a> {
    fn new(elements: &'a Elements, block: &Block, world: &World) -> Self {
        let chart = &elements.charts[block.chart as usize];
        let page = &elements.pages[chart.page as usize];
        let width = usize::from(block.max[0] - block.min[0]) + 2 * APRON;
        let height = usize::from(block.max[1] - block.min[1]) + 2 * APRON;
        let origin = [i32::from(block.min[0]) - APRON as i32, i32::from(block.min[1]) - APRON as i32];
        let mut id = vec![NO_ELEMENT; width * height];
        let size = page.size_texels as i32;
        for row in 0..height {
            let y = origin[1] + row as i32;
            if !(0..size).contains(&y) {
                continue;
            }
            for column in 0..width {
                let x = origin[0] + column as i32;
                if !(0..size).contains(&x) {
                    continue;
                }
                let e = page.element[y as usize * size as usize + x as usize];
                if e != NO_ELEMENT && chart.elements.contains(&e) && elements.valid[e as usize] {
                    id[row * width + column] = e;
                }
            }
        }
        let receiver = id
            .iter()
            .map(|&e| {
                let present = if e == NO_ELEMENT { chart.elements.start } else { e };
                Receiver::of(elements, present, world)
            })
            .collect();
        let origin_in_chart = [0, 1].map(|axis| origin[axis] - i32::from(chart.min[axis]));
        Self { elements, width, height, origin_in_chart, id, receiver }
    }

    /// Grid indices of the block without its apron.
    fn inner(&self) -> impl Iterator<Item = usize> + use<'_> {
        self.ring(APRON)
    }

    /// Grid indices at least `margin` texels from the grid's rim.
    fn ring(&self, margin: usize) -> impl Iterator<Item = usize> + use<'_> {
        let columns = self.width - margin;
        (margin..self.height - margin)
            .flat_map(move |row| (margin..columns).map(move |column| row * self.width + column))
    }

    fn neighbours(&self, i: usize) -> [usize; 8] {
        let w = self.width;
        [i - w - 1, i - w, i - w + 1, i - 1, i + 1, i + w - 1, i + w, i + w + 1]
    }

    fn phase(&self, i: usize) -> usize {
        let x = self.origin_in_chart[0] + (i % self.width) as i32;
        let y = self.origin_in_chart[1] + (i / self.width) as i32;
        Patterns::phase(x.rem_euclid(3) as usize, y.rem_euclid(3) as usize)
    }

    fn footprint(&self, i: usize, sharp: bool) -> (Vec3, Vec3, f32) {
        let around = self.neighbours(i).into_iter().map(|n| self.id[n]).filter(|&n| n != NO_ELEMENT);
        footprint(self.elements, self.id[i], sharp, around)
    }
}

/// Rows of one emitter's pass, reused.
struct Scratch {
    unoccluded: Vec<Irradiance>,
    class: Vec<Class>,
    ratio: Vec<Vec3>,
    refined: Vec<bool>,
}

impl Scratch {
    fn new(n: usize) -> Self {
        Self {
            unoccluded: vec![Irradiance::ZERO; n],
            class: vec![Class::Out; n],
            ratio: vec![Vec3::ZERO; n],
            refined: vec![false; n],
        }
    }
}

struct Work<'a, T> {
    grid: &'a Grid<'a>,
    tracer: &'a T,
    patterns: &'a Patterns,
}

impl<T: Tracer> Work<'_, T> {
    fn add<E: Emitter>(
        &self,
        emitter: &E,
        scratch: &mut Scratch,
        sum: &mut [(Irradiance, bool)],
        rays: &mut u64,
    ) {
        self.probe(emitter, scratch, rays);
        self.refine(emitter, scratch, rays);
        for i in self.grid.inner() {
            let open = scratch.unoccluded[i];
            sum[i].1 |= scratch.refined[i];
            sum[i].0 += match (scratch.refined[i], scratch.class[i]) {
                (true, _) => Irradiance(open.0 * self.smoothed(emitter, scratch, i)),
                (false, Class::Lit) => Irradiance(open.0 * scratch.ratio[i]),
                (false, _) => Irradiance::ZERO,
            };
        }
    }

    fn probe<E: Emitter>(&self, emitter: &E, scratch: &mut Scratch, rays: &mut u64) {
        let grid = self.grid;
        for i in 0..grid.id.len() {
            scratch.refined[i] = false;
            scratch.class[i] = Class::Out;
            scratch.unoccluded[i] = Irradiance::ZERO;
            if grid.id[i] == NO_ELEMENT {
                continue;
            }
            let receiver = &grid.receiver[i];
            let open = emitter.unoccluded(receiver);
            if open.0.max_element() <= 0.0 {
                continue;
            }
            scratch.unoccluded[i] = open;
            let points = &self.patterns.probe[grid.phase(i)];
            let points = if emitter.is_sharp() { &points[..self.patterns.sharp_probes] } else { &points[..] };
            let mut first = None;
            let mut class = Class::Mixed;
            let mut seen = Vec3::ZERO;
            for &uv in points {
                let Some(shadow) = emitter.shadow_ray(receiver, uv) else { continue };
                *rays += u64::from(T::SENDS);
                let passed = self.tracer.transmittance(&shadow.ray);
                match first {
                    None => {
                        first = Some(passed);
                        seen = passed;
                        class = if passed == Vec3::ZERO { Class::Shadowed } else { Class::Lit };
                        if !T::SENDS {
                            break;
                        }
                    }
                    Some(before) if before != passed => {
                        class = Class::Mixed;
                        break;
                    }
                    Some(_) => {}
                }
            }
            scratch.class[i] = class;
            scratch.ratio[i] = seen;
        }
    }

    /// Refines where a texel or one of its neighbours is in doubt.
    fn refine<E: Emitter>(&self, emitter: &E, scratch: &mut Scratch, rays: &mut u64) {
        let grid = self.grid;
        for i in grid.ring(1) {
            let class = scratch.class[i];
            if class == Class::Out {
                continue;
            }
            let doubtful = class == Class::Mixed
                || self.patterns.everywhere && T::SENDS
                || grid.neighbours(i).iter().any(|&n| {
                    scratch.class[n] != Class::Out
                        && (scratch.class[n] != class
                            || class == Class::Lit && scratch.ratio[n] != scratch.ratio[i])
                });
            if doubtful {
                scratch.refined[i] = true;
            }
        }
        for i in grid.ring(1) {
            if scratch.refined[i] {
                scratch.ratio[i] = self.visibility(emitter, i, rays);
            }
        }
    }

    /// Visible share of the emitter, averaged over the free part of the texel's footprint.
    fn visibility<E: Emitter>(&self, emitter: &E, i: usize, rays: &mut u64) -> Vec3 {
        let footprint = self.grid.footprint(i, emitter.is_sharp());
        let whole = self.visibility_over(emitter, i, footprint, rays);
        // Where all samples strayed into something, the middle of the texel stands for it.
        whole.or_else(|| self.visibility_over(emitter, i, NO_FOOTPRINT, rays)).unwrap_or(Vec3::ZERO)
    }

    /// The same over a footprint; none where no sample of it sees the emitter's side.
    fn visibility_over<E: Emitter>(
        &self,
        emitter: &E,
        i: usize,
        (half_u, half_v, lift): (Vec3, Vec3, f32),
        rays: &mut u64,
    ) -> Option<Vec3> {
        let mut receiver = self.grid.receiver[i];
        let free = Free::of(self.grid.elements, self.grid.id[i], &receiver, half_u, half_v);
        let clear = receiver.origin_world - receiver.position_world;
        let centre = receiver.position_world + receiver.normal_geometric * lift;
        let (mut all, mut passed) = (Vec3::ZERO, Vec3::ZERO);
        let points = &self.patterns.refine[self.grid.phase(i)];
        for (sent, &[s, t, u, v]) in points.iter().enumerate() {
            if self.patterns.everywhere && sent == ENOUGH && (passed == all || passed == Vec3::ZERO) {
                break;
            }
            receiver.position_world = centre + half_u * (2.0 * s - 1.0) + half_v * (2.0 * t - 1.0);
            receiver.origin_world = receiver.position_world + clear;
            if free.is_some_and(|free| free.is_left(&receiver, self.tracer, rays)) {
                continue;
            }
            let Some(shadow) = emitter.shadow_ray(&receiver, [u, v]) else { continue };
            *rays += u64::from(T::SENDS);
            all += shadow.weight;
            passed += shadow.weight * self.tracer.transmittance(&shadow.ray);
            if emitter.is_sharp() && half_u == Vec3::ZERO {
                break;
            }
        }
        (all != Vec3::ZERO).then(|| {
            let share = |k: usize| if all[k] > 0.0 { (passed[k] / all[k]).min(1.0) } else { 0.0 };
            Vec3::from_array(std::array::from_fn(share))
        })
    }

    /// The refined visibility; inside a wide penumbra the mean of the 3×3 neighbourhood, whose nine sample sets
    /// differ, so that no grain is left. A linear ramp is its own mean: nothing is blurred. Where the mean is further
    /// from the texel's own value than twice what samples err by, the ramp bends, and the value stays.
    fn smoothed<E: Emitter>(&self, emitter: &E, scratch: &Scratch, i: usize) -> Vec3 {
        let around = self.grid.neighbours(i);
        if emitter.is_sharp() || self.patterns.everywhere || !around.iter().all(|&n| scratch.refined[n]) {
            return scratch.ratio[i];
        }
        let own = scratch.ratio[i];
        let mean = (around.iter().map(|&n| scratch.ratio[n]).sum::<Vec3>() + own) / 9.0;
        let grain = (mean - own).abs().max_element() <= 2.0 * self.patterns.visibility_error;
        if grain { mean } else { own }
    }
}
