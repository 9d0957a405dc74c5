//! Direct light of single elements once more, with samples of their own: what the stage's result is judged by.

use super::emitters::EmitterList;
use super::footprint::Footprint;
use super::index::Index;
use super::visibility::visible_share;
use super::{Direct, Emitter, Receiver};
use crate::elements::{Elements, NO_ELEMENT};
use crate::plan::Sight;
use crate::sampling::sobol4;
use crate::transport::{Tracer, World};
use crate::units::Irradiance;

/// Points that are asked where no shadow border was seen: all agree unless something was missed.
const QUIET: usize = 16;

/// Lights single elements with the emitters that are bright in their block.
///
/// No probes decide, no neighbours help: the visible share of every emitter is averaged over texel and emitter, with few
/// rays where the stage saw no border of a shadow.
pub struct Again<'a> {
    elements: &'a Elements,
    emitters: &'a EmitterList,
    direct: &'a Direct,
    sight: &'a Sight,
    blocks: Index,
}

impl<'a> Again<'a> {
    /// For what `direct` holds.
    pub fn new(
        elements: &'a Elements,
        emitters: &'a EmitterList,
        direct: &'a Direct,
        sight: &'a Sight,
    ) -> Self {
        Self { elements, emitters, direct, sight, blocks: Index::new(elements, &direct.blocks) }
    }

    /// Irradiance of an element with `rays` shadow rays towards every emitter whose border passes, other ones for every
    /// `seed`; and the rays that took.
    pub fn irradiance<T: Tracer>(&self, element: u32, rays: u32, seed: u32, tracer: &T) -> (Irradiance, u64) {
        let e = element as usize;
        let block = self.blocks.block_of(self.elements, &self.direct.blocks, element);
        let receiver = Receiver::of(self.elements, element, tracer.world());
        let back = self.elements.charts[self.elements.chart[e] as usize].back;
        let clear = self.sight.is_clear(self.elements.triangle[e], usize::from(back));
        let refined = self.direct.refined[e];
        let footprint = self.footprint(element, tracer.world());
        let points = sobol4(rays.max(4), 0, seed);
        let points = if refined { &points[..] } else { &points[..points.len().min(QUIET)] };
        let (mut sum, mut sent) = (Irradiance::ZERO, 0);
        for &k in &self.direct.bright[block] {
            let emitter = &self.emitters.emitters[k as usize];
            let open = emitter.unoccluded(&receiver);
            if open.0.max_element() <= 0.0 {
                continue;
            }
            sum += if clear || footprint.sees_all_of(emitter, tracer.world()) {
                open
            } else {
                let share = visible_share(emitter, &footprint, points, usize::MAX, tracer, &mut sent);
                Irradiance(open.0 * share)
            };
        }
        (sum, sent)
    }

    fn footprint(&self, element: u32, world: &World) -> Footprint {
        let e = element as usize;
        let chart = &self.elements.charts[self.elements.chart[e] as usize];
        let page = &self.elements.pages[chart.page as usize];
        let (texel, size) = (self.elements.texel[e], page.size_texels as i32);
        let (x, y) = (i32::from(texel.x), i32::from(texel.y));
        let beside = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
        let on_page = beside.filter(|&(x, y)| (0..size).contains(&x) && (0..size).contains(&y));
        let around = on_page
            .map(|(x, y)| page.element[(y * size + x) as usize])
            .filter(|&n| n != NO_ELEMENT && chart.elements.contains(&n) && self.elements.valid[n as usize]);
        Footprint::new(self.elements, element, world, around)
    }
}
