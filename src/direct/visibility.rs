//! How much of an emitter is seen from a texel.

use super::footprint::Footprint;
use super::{Emitter, ShadowRay};
use crate::transport::Tracer;
use glam::Vec3;

/// What came of a shadow ray.
pub(super) struct Shadow {
    weight: Vec3,
    /// The share of light that passes.
    pub passed: Vec3,
    /// Rays it took.
    pub rays: u64,
}

/// What is found for each point of texel and emitter that face each other, as far as nothing parts them from the texel's
/// middle.
pub(super) fn shadows<E: Emitter, T: Tracer>(
    emitter: &E,
    footprint: Footprint,
    points: &[[f32; 4]],
    tracer: &T,
) -> impl Iterator<Item = Shadow> {
    let one_decides = emitter.is_sharp() && footprint.is_point();
    let points = if one_decides { &points[..1] } else { points };
    points.iter().filter_map(move |&[s, t, u, v]| {
        let mut rays = 1;
        let receiver = footprint.at([s, t], tracer, &mut rays)?;
        let ShadowRay { ray, weight } = emitter.shadow_ray(&receiver, [u, v])?;
        Some(Shadow { weight, passed: tracer.transmittance(&ray), rays })
    })
}

/// The share of an emitter that is seen, per channel, averaged over the free part of a footprint; after `enough` samples that
/// agree no more are sent.
pub(super) fn visible_share<E: Emitter, T: Tracer>(
    emitter: &E,
    footprint: &Footprint,
    points: &[[f32; 4]],
    enough: usize,
    tracer: &T,
    rays: &mut u64,
) -> Vec3 {
    let footprint = footprint.for_light(emitter.is_sharp());
    let mut over = |footprint| {
        let (mut all, mut passed) = (Vec3::ZERO, Vec3::ZERO);
        for (number, shadow) in shadows(emitter, footprint, points, tracer).enumerate() {
            if number == enough && (passed == all || passed == Vec3::ZERO) {
                break;
            }
            *rays += shadow.rays;
            all += shadow.weight;
            passed += shadow.weight * shadow.passed;
        }
        (all != Vec3::ZERO).then(|| {
            let share = |k: usize| if all[k] > 0.0 { (passed[k] / all[k]).min(1.0) } else { 0.0 };
            Vec3::from_array(std::array::from_fn(share))
        })
    };
    // Where all samples strayed into something, the middle of the texel stands for it.
    over(footprint).or_else(|| over(footprint.only_middle())).unwrap_or(Vec3::ZERO)
}
