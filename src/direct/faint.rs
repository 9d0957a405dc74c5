//! The sum of many faint emitters at one place, by few rays.

use super::emitters::EmitterList;
use super::index::Index;
use super::{Block, Direct, Emitter, Receiver};
use crate::elements::Elements;
use crate::sampling::{seeded, sobol4};
use crate::transport::Tracer;
use crate::units::Irradiance;
use glam::Vec3;

/// Rays towards all faint emitters together.
const RAYS: u32 = 128;

/// Lights single elements with the emitters that are faint in their block.
///
/// Emitters are picked in proportion to what they would add unoccluded, by samples dealt evenly along a list in which
/// neighbours stand together: the share that is visible converges almost like a sum over strata, since visibility
/// changes slowly along such a list.
pub struct Faint<'a> {
    elements: &'a Elements,
    emitters: &'a EmitterList,
    direct: &'a Direct,
    blocks: Index,
    points: Vec<[f32; 4]>,
}

impl<'a> Faint<'a> {
    /// `None` where every emitter is bright everywhere. Other rays for every `seed`.
    pub fn new(
        elements: &'a Elements,
        emitters: &'a EmitterList,
        direct: &'a Direct,
        seed: u32,
    ) -> Option<Self> {
        let all_bright =
            |(block, bright): (&Block, &Vec<u32>)| direct.candidates(block.chart).len() == bright.len();
        if direct.blocks.iter().zip(&direct.bright).all(all_bright) {
            return None;
        }
        let blocks = Index::new(elements, &direct.blocks);
        // Along the list the samples lie in the same place of equal strata, by default in the centre; across an emitter
        // they follow Sobol's sequence.
        let mut points = sobol4(RAYS, 0, seeded(seed, 6));
        let place = if seed == 0 { 0.5 } else { points[0][0] };
        points.iter_mut().enumerate().for_each(|(i, p)| p[0] = (i as f32 + place) / RAYS as f32);
        Some(Self { elements, emitters, direct, blocks, points })
    }

    /// Irradiance of an element from the emitters that its block calls faint, and the rays that took.
    pub fn irradiance<T: Tracer>(&self, element: u32, tracer: &T) -> (Irradiance, u64) {
        let e = element as usize;
        let bright = &self.direct.bright[self.blocks.block_of(self.elements, &self.direct.blocks, element)];
        let candidates = self.direct.candidates(self.elements.chart[e]);
        let receiver = Receiver::of(self.elements, element, tracer.world());
        let mut open = Vec::with_capacity(candidates.len());
        let mut total = 0.0_f64;
        for &k in candidates {
            if bright.binary_search(&k).is_ok() {
                continue;
            }
            let k = k as usize;
            let irradiance = self.emitters.emitters[k].unoccluded(&receiver);
            if irradiance.mean() > 0.0 {
                total += f64::from(irradiance.mean());
                open.push((total, k, irradiance));
            }
        }
        let mut sum = Vec3::ZERO;
        let mut at = 0;
        for p in &self.points {
            let target = f64::from(p[0]) * total;
            while at + 1 < open.len() && open[at].0 < target {
                at += 1;
            }
            let Some((_, k, irradiance)) = open.get(at) else { break };
            let Some(shadow) = self.emitters.emitters[*k].shadow_ray(&receiver, [p[2], p[3]]) else {
                continue;
            };
            sum += irradiance.0 / irradiance.mean() * tracer.transmittance(&shadow.ray);
        }
        let rays = if open.is_empty() { 0 } else { self.points.len() as u64 };
        (Irradiance(sum * (total as f32 / self.points.len() as f32)), rays)
    }
}
