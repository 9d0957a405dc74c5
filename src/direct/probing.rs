//! How many shadow rays probing will send, without sending any.

use super::emitters::EmitterList;
use super::footprint::Footprint;
use super::{Emitter, Receiver, candidates};
use crate::elements::Elements;
use crate::options::DirectOptions;
use crate::plan::Plan;
use crate::transport::World;
use rayon::prelude::*;

/// Elements that are looked at; they stand for the others.
const LOOKED_AT: usize = 4096;

/// Shadow rays by which all elements probe the emitters of a plan, about: what shadow borders take besides is not in it,
/// nor what neighbouring blocks both look at.
pub fn probe_rays(
    elements: &Elements,
    emitters: &EmitterList,
    plan: &Plan,
    world: &World,
    options: &DirectOptions,
) -> u64 {
    if emitters.is_empty() || elements.is_empty() {
        return 0;
    }
    let (lists, of_chart) = candidates(elements, emitters, &plan.rooms);
    // Where every texel is refined, that is what takes rays.
    let soft = if options.probe_rays == 0 { options.penumbra_rays } else { options.probe_rays };
    let stride = elements.len().div_ceil(LOOKED_AT);
    let looked_at: Vec<usize> = (0..elements.len()).step_by(stride).filter(|&e| elements.valid[e]).collect();
    let rays: u64 = looked_at
        .par_iter()
        .map(|&e| {
            let chart = elements.chart[e] as usize;
            let side = usize::from(elements.charts[chart].back);
            if plan.sight.is_clear(elements.triangle[e], side) {
                return 0;
            }
            let receiver = Receiver::of(elements, e as u32, world);
            let within = &lists[of_chart[chart] as usize];
            let mut asked = emitters.bright_at(within, &[receiver]);
            emitters.add_vain(within, &mut asked);
            let reaching = asked.iter().map(|&k| &emitters.emitters[k as usize]);
            let reaching = reaching.filter(|emitter| emitter.unoccluded(&receiver).0.max_element() > 0.0);
            let footprint = Footprint::new(elements, e as u32, world, std::iter::empty());
            let asked =
                reaching.filter(|emitter| emitters.clear_probed || !footprint.sees_all_of(*emitter, world));
            let one = |sharp: bool| {
                let half = sharp && !emitters.sharp_as_soft && options.probe_rays > 0;
                match footprint.for_light(sharp).is_parted() {
                    true => 2 * options.penumbra_rays,
                    false if half => soft.div_ceil(2),
                    false => soft,
                }
            };
            asked.map(|emitter| u64::from(one(emitter.is_sharp()))).sum()
        })
        .sum();
    rays * stride as u64
}
