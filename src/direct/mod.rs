//! Light from emitters straight to every element.
//!
//! The unoccluded irradiance is a closed form; visibility multiplies it. Where no triangle reaches into the shaft between
//! a texel, or a whole tile of them, and an emitter, all of it is seen and no ray is sent. Other elements probe the emitter
//! with a few rays; only where the probes of an element or of its eight neighbours disagree, a shadow border passes and
//! many more rays are spent. Sky light that is smooth is not here: the gather's rays that miss bring it. Where
//! hundreds of emitters reach a place, each of the faint ones adds so little that its shadow borders cannot be
//! seen: their sum is smooth too, and is left to the nodes of the gather ([`Faint`]).

mod again;
mod area;
mod block;
mod emitters;
mod faint;
mod footprint;
mod index;
mod penumbra;
mod point;
mod probing;
mod shafts;
mod sky;
mod sun;
mod visibility;

pub use again::Again;
pub use emitters::{EmitterList, collect};
pub use faint::Faint;
pub use index::Block;
pub use probing::probe_rays;

use crate::elements::Elements;
use crate::options::DirectOptions;
use crate::plan::{Plan, Rooms};
use crate::progress::Progress;
use crate::transport::{ClearTracer, Ray, Shaft, Tracer, World};
use crate::units::Irradiance;
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Where light arrives.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// On the surface, world metres relative to the scene's origin.
    pub position_world: Vec3,
    /// Where shadow rays start: clear of the surface.
    pub origin_world: Vec3,
    /// The normal of the cosine.
    pub normal_shading: Vec3,
    /// The normal of the plane: light from behind it does not count.
    pub normal_geometric: Vec3,
}

impl Receiver {
    /// An element's own place.
    pub(super) fn of(elements: &Elements, element: u32, world: &World) -> Self {
        let e = element as usize;
        let (position_world, normal_geometric) = (elements.position_world[e], elements.normal_geometric[e]);
        Self {
            position_world,
            origin_world: world.offset_origin(elements.triangle[e], position_world, normal_geometric),
            normal_shading: elements.normal_shading[e],
            normal_geometric,
        }
    }
}

/// A ray towards a point of an emitter, and what that point would contribute unoccluded.
#[derive(Clone, Copy, Debug)]
pub struct ShadowRay {
    /// From the receiver to just before the emitter.
    pub ray: Ray,
    /// Relative weight per channel; only ratios matter, the closed form gives the scale.
    pub weight: Vec3,
}

/// One kind of light source.
pub trait Emitter: Sync {
    /// Irradiance at the receiver if nothing stood in between.
    fn unoccluded(&self, receiver: &Receiver) -> Irradiance;

    /// A shadow ray to the emitter's point `(u, v)` in `[0, 1)²`; `None` when that point cannot light the receiver.
    fn shadow_ray(&self, receiver: &Receiver, uv: [f32; 2]) -> Option<ShadowRay>;

    /// Whether one ray decides: the emitter has no extent.
    fn is_sharp(&self) -> bool;

    /// The space that shadow rays from a box of `origin_world`s (lowest and highest corner) stay in, in a world of these
    /// bounds.
    fn shaft(&self, from: [Vec3; 2], world: [Vec3; 2]) -> Shaft;
}

/// What the stage found.
pub struct Direct {
    /// Irradiance from the bright emitters of each element's block, one row an element.
    pub irradiance: Vec<Irradiance>,
    /// Whether the border of a bright emitter's shadow passes an element or one next to it, one row an element.
    pub refined: Vec<bool>,
    /// The blocks the charts were cut into, ascending by chart.
    pub blocks: Vec<Block>,
    /// For each block the emitters that `irradiance` holds, ascending; the others in its rooms are faint there.
    pub bright: Vec<Vec<u32>>,
    /// The emitters in the rooms of each chart's side, ascending; shared, see `candidates_of_chart`.
    candidates: Vec<Vec<u32>>,
    /// For each chart its row of `candidates`.
    candidates_of_chart: Vec<u32>,
    /// Rays sent.
    pub rays: u64,
    /// Whether a cancelled run left elements dark.
    pub unfinished: bool,
}

/// The blend of what was found with this share, and of what was there before.
pub fn blend(found: &mut [Irradiance], before: &[Irradiance], share: f32) {
    for (found, before) in found.iter_mut().zip(before) {
        found.0 = before.0.lerp(found.0, share);
    }
}

impl Direct {
    /// With this share of itself, and the rest of what was there before; as it is where others count as bright now.
    pub fn blended(mut self, before: &Self, share: f32) -> Self {
        if share < 1.0 && self.bright == before.bright {
            blend(&mut self.irradiance, &before.irradiance, share);
            self.refined.iter_mut().zip(&before.refined).for_each(|(own, before)| *own |= before);
        }
        self
    }

    /// The emitters in the rooms of a chart's side, ascending.
    fn candidates(&self, chart: u32) -> &[u32] {
        &self.candidates[self.candidates_of_chart[chart as usize] as usize]
    }
}

/// For each chart the emitters in the rooms of its side: the different lists, and which of them it has.
fn candidates(elements: &Elements, emitters: &EmitterList, rooms: &Rooms) -> (Vec<Vec<u32>>, Vec<u32>) {
    let mut known: BTreeMap<&[u32], u32> = BTreeMap::new();
    let mut lists = Vec::new();
    let of_chart = elements.charts.iter().map(|chart| {
        let within = &rooms.of_side[chart.surface as usize][usize::from(chart.back)];
        *known.entry(within).or_insert_with(|| {
            lists.push(emitters.within(within));
            lists.len() as u32 - 1
        })
    });
    let of_chart = of_chart.collect();
    (lists, of_chart)
}

/// Lights every element: each with the emitters of its rooms, without rays where the plan knows that none is stopped.
pub fn light<T: Tracer>(
    elements: &Elements,
    emitters: &EmitterList,
    plan: &Plan,
    tracer: &T,
    options: &DirectOptions,
    seed: u32,
    progress: &mut Progress,
) -> Direct {
    let blocks = index::cut(elements);
    let (candidates, candidates_of_chart) = candidates(elements, emitters, &plan.rooms);
    let mut direct = Direct {
        irradiance: vec![Irradiance::ZERO; elements.len()],
        refined: vec![false; elements.len()],
        bright: Vec::with_capacity(blocks.len()),
        candidates,
        candidates_of_chart,
        blocks,
        rays: 0,
        unfinished: false,
    };
    if emitters.is_empty() {
        direct.bright.resize(direct.blocks.len(), Vec::new());
        return direct;
    }
    progress.restart(elements.len() as u64);
    let patterns = penumbra::Patterns::new(options, emitters, seed);
    // Bounded batches keep the transient copies small next to the elements themselves.
    for batch in direct.blocks.chunks(4096) {
        let lit: Vec<_> = batch
            .par_iter()
            .map(|block| {
                if progress.cancelled() {
                    return None;
                }
                let mut rays = 0;
                let with = block::With { elements, list: emitters, patterns: &patterns };
                let candidates = direct.candidates(block.chart);
                let lit = if block::is_clear(elements, block, &plan.sight) {
                    block::light(&with, block, candidates, &ClearTracer::new(tracer.world()), &mut rays)
                } else {
                    block::light(&with, block, candidates, tracer, &mut rays)
                };
                progress.advance(lit.lit.len() as u64);
                Some((lit, rays))
            })
            .collect();
        for lit in lit {
            let Some((lit, rays)) = lit else {
                direct.unfinished = true;
                direct.bright.push(Vec::new());
                continue;
            };
            direct.rays += rays;
            for &(id, value, refined) in &lit.lit {
                direct.irradiance[id as usize] = value;
                direct.refined[id as usize] = refined;
            }
            direct.bright.push(lit.bright);
        }
    }
    direct
}
