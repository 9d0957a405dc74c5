//! A block of neighbouring texels, lit together: emitters that cannot reach it are left out once, and shadow borders
//! are found by comparing neighbours.

use super::emitters::{AnyEmitter, EmitterList};
use super::footprint::Footprint;
use super::index::Block;
use super::penumbra::Patterns;
use super::shafts::{Search, Tiles};
use super::visibility::{Shadow, shadows, visible_share};
use super::{Emitter, Receiver};
use crate::elements::{Elements, NO_ELEMENT};
use crate::plan::Sight;
use crate::transport::{Tracer, World};
use crate::units::Irradiance;
use glam::Vec3;

/// Texels around the block that are probed too, so that borders of shadows on its rim are seen.
const APRON: usize = 2;

/// Where every texel is refined, so many rays that all agree tell that no shadow border passes.
const ENOUGH: usize = 256;

/// What the probes of one emitter say about a texel.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Class {
    /// No element, or the emitter cannot light it.
    Out,
    /// Nothing can stand between: no need of rays.
    Clear,
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
    let sends = T::SENDS && !asked.is_empty();
    let footprints = if sends { grid.footprints(tracer.world()) } else { Vec::new() };
    let is_lit = |i: usize| !grid.is_rim(i) && grid.id[i] != NO_ELEMENT;
    let tiles = sends.then(|| {
        let lit = footprints.iter().enumerate().map(|(i, &footprint)| is_lit(i).then_some(footprint));
        Tiles::new([grid.width, grid.height], lit)
    });
    for &index in &asked {
        let work = Work { grid: &grid, footprints: &footprints, tiles: tiles.as_ref(), tracer, patterns };
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

    /// Whether it has not all neighbours on the grid.
    fn is_rim(&self, i: usize) -> bool {
        let within = |k: usize, size: usize| (1..size - 1).contains(&k);
        !within(i % self.width, self.width) || !within(i / self.width, self.height)
    }

    fn phase(&self, i: usize) -> usize {
        let x = self.origin_in_chart[0] + (i % self.width) as i32;
        let y = self.origin_in_chart[1] + (i / self.width) as i32;
        Patterns::phase(x.rem_euclid(3) as usize, y.rem_euclid(3) as usize)
    }

    /// Where the texels' shadow rays start. Of the rim, whose texels are only compared with, the middles.
    fn footprints(&self, world: &World) -> Vec<Footprint> {
        let footprint = |i: usize| {
            if self.is_rim(i) || self.id[i] == NO_ELEMENT {
                return Footprint::point(self.receiver[i]);
            }
            let around = self.neighbours(i).into_iter().map(|n| self.id[n]).filter(|&n| n != NO_ELEMENT);
            Footprint::new(self.elements, self.id[i], world, around)
        };
        (0..self.id.len()).map(footprint).collect()
    }
}

/// Rows of one emitter's pass, reused.
struct Scratch {
    unoccluded: Vec<Irradiance>,
    class: Vec<Class>,
    clear: Vec<bool>,
    ratio: Vec<Vec3>,
    refined: Vec<bool>,
}

impl Scratch {
    fn new(n: usize) -> Self {
        Self {
            unoccluded: vec![Irradiance::ZERO; n],
            class: vec![Class::Out; n],
            clear: vec![false; n],
            ratio: vec![Vec3::ZERO; n],
            refined: vec![false; n],
        }
    }
}

struct Work<'a, T> {
    grid: &'a Grid<'a>,
    /// A row a texel; none where rays are not sent.
    footprints: &'a [Footprint],
    /// None where rays are not sent.
    tiles: Option<&'a Tiles>,
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
                (false, Class::Clear | Class::Lit) => Irradiance(open.0 * scratch.ratio[i]),
                (false, _) => Irradiance::ZERO,
            };
        }
    }

    fn probe<E: Emitter>(&self, emitter: &E, scratch: &mut Scratch, rays: &mut u64) {
        let grid = self.grid;
        for i in 0..grid.id.len() {
            scratch.refined[i] = false;
            scratch.clear[i] = false;
            scratch.class[i] = Class::Out;
            let present = grid.id[i] != NO_ELEMENT;
            let open = if present { emitter.unoccluded(&grid.receiver[i]) } else { Irradiance::ZERO };
            let counts = open.0.max_element() > 0.0 && self.faces(emitter, i);
            scratch.unoccluded[i] = if counts { open } else { Irradiance::ZERO };
        }
        let lit = |i: usize| scratch.unoccluded[i].0.max_element() > 0.0;
        match self.tiles {
            Some(tiles) => {
                Search { emitter, world: self.tracer.world(), tiles }.run(&mut scratch.clear, lit);
            }
            None => scratch.clear.fill(true),
        }
        let sends = self.tiles.is_some();
        for i in (0..grid.id.len()).filter(|&i| lit(i)) {
            let is_clear = scratch.clear[i]
                && !(sends && self.patterns.clear_probed && self.is_stopped(emitter, i, rays));
            (scratch.class[i], scratch.ratio[i]) =
                if is_clear { (Class::Clear, Vec3::ONE) } else { self.ask(emitter, i, rays) };
        }
    }

    /// Whether a ray meets anything where none should: a proof that is put to the test.
    fn is_stopped<E: Emitter>(&self, emitter: &E, i: usize, rays: &mut u64) -> bool {
        let phase = self.grid.phase(i);
        let points = match self.patterns.everywhere {
            true => &self.patterns.refine[phase],
            false => self.patterns.probe(phase, emitter.is_sharp()),
        };
        let footprint = self.footprints[i].for_light(emitter.is_sharp());
        let mut stopped = false;
        for Shadow { passed, rays: sent, .. } in shadows(emitter, footprint, points, self.tracer) {
            *rays += sent;
            stopped |= passed != Vec3::ONE;
        }
        stopped
    }

    /// Whether any ray could be sent from the texel's middle. A light that grazes the surface, so that it is told from one
    /// below the horizon by its rounding only, counts nowhere, whether rays are sent or not.
    fn faces<E: Emitter>(&self, emitter: &E, i: usize) -> bool {
        let points = &self.patterns.refine[self.grid.phase(i)];
        points.iter().any(|&[_, _, u, v]| emitter.shadow_ray(&self.grid.receiver[i], [u, v]).is_some())
    }

    /// What a few rays from all over the texel to all over the emitter tell.
    fn ask<E: Emitter>(&self, emitter: &E, i: usize, rays: &mut u64) -> (Class, Vec3) {
        let points = self.patterns.probe(self.grid.phase(i), emitter.is_sharp());
        let mut before = None;
        let footprint = self.footprints[i].for_light(emitter.is_sharp());
        // Of a part of a texel few probes would be left to tell.
        if footprint.is_parted() {
            return (Class::Mixed, Vec3::ZERO);
        }
        for Shadow { passed, rays: sent, .. } in shadows(emitter, footprint, points, self.tracer) {
            *rays += sent;
            if before.is_some_and(|before| before != passed) {
                return (Class::Mixed, passed);
            }
            before = Some(passed);
        }
        match before {
            None => (Class::Mixed, Vec3::ZERO),
            Some(Vec3::ZERO) => (Class::Shadowed, Vec3::ZERO),
            Some(passed) => (Class::Lit, passed),
        }
    }

    /// Refines where a texel or one of its neighbours is in doubt.
    fn refine<E: Emitter>(&self, emitter: &E, scratch: &mut Scratch, rays: &mut u64) {
        let grid = self.grid;
        for i in grid.ring(1) {
            let own = scratch.class[i];
            let differs = |n: usize| match (own, scratch.class[n]) {
                (_, Class::Out) => false,
                (Class::Lit, Class::Lit | Class::Clear) => scratch.ratio[n] != scratch.ratio[i],
                (own, other) => own != other,
            };
            scratch.refined[i] = match own {
                Class::Out | Class::Clear => false,
                Class::Mixed => true,
                Class::Lit | Class::Shadowed => {
                    self.patterns.everywhere || grid.neighbours(i).into_iter().any(differs)
                }
            };
        }
        for i in grid.ring(1) {
            if scratch.refined[i] {
                let points = &self.patterns.refine[grid.phase(i)];
                let enough = if self.patterns.everywhere { ENOUGH } else { usize::MAX };
                scratch.ratio[i] =
                    visible_share(emitter, &self.footprints[i], points, enough, self.tracer, rays);
            }
        }
    }

    /// The refined visibility; inside a wide penumbra the mean of the 3×3 neighbourhood, whose nine sample sets
    /// differ, so that no grain is left. A linear ramp is its own mean: nothing is blurred. Where the mean is further
    /// from the texel's own value than twice what samples err by, the ramp bends, and the value stays.
    fn smoothed<E: Emitter>(&self, emitter: &E, scratch: &Scratch, i: usize) -> Vec3 {
        let around = self.grid.neighbours(i);
        let known = |n: usize| scratch.refined[n] || scratch.class[n] == Class::Clear;
        if emitter.is_sharp() || self.patterns.everywhere || !around.into_iter().all(known) {
            return scratch.ratio[i];
        }
        let own = scratch.ratio[i];
        let mean = (around.iter().map(|&n| scratch.ratio[n]).sum::<Vec3>() + own) / 9.0;
        let grain = (mean - own).abs().max_element() <= 2.0 * self.patterns.visibility_error;
        if grain { mean } else { own }
    }
}
