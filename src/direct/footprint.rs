//! Where in a texel shadow rays start.

use super::Receiver;
use crate::elements::Elements;
use crate::transport::{Tracer, segment};
use glam::Vec3;

/// How far samples may stray inside the texel: `(half u, half v, lift along the normal)`. On a hollow surface the
/// tangent plane dips under its neighbours, and what lies beyond would see the light behind the wall: samples are lifted
/// by as much as they may dip, the half diagonal times the tangent of the angle. On a crease they stay in the middle. They
/// do so beside other geometry too: the part of the texel that is free lies to one side, where a soft light is seen in
/// another share than from the middle; only the border of a `sharp` light's shadow is averaged over it.
pub(super) fn footprint(
    elements: &Elements,
    element: u32,
    sharp: bool,
    around: impl Iterator<Item = u32>,
) -> (Vec3, Vec3, f32) {
    let e = element as usize;
    if elements.among_others[e] && !sharp {
        return NO_FOOTPRINT;
    }
    let normal = elements.normal_geometric[e];
    let (mut straightest, mut hollow) = (1.0_f32, 1.0_f32);
    for n in around.map(|n| n as usize) {
        let cosine = normal.dot(elements.normal_geometric[n]);
        straightest = straightest.min(cosine);
        // Neighbours of a hollow surface rise above the plane.
        if normal.dot(elements.position_world[n] - elements.position_world[e]) > 0.0 {
            hollow = hollow.min(cosine);
        }
    }
    if straightest < 0.85 {
        return NO_FOOTPRINT;
    }
    let (u, v) = (elements.half_u_world[e], elements.half_v_world[e]);
    let tangent = (1.0 - hollow * hollow).max(0.0).sqrt() / hollow;
    let tangent = if tangent < 1e-3 { 0.0 } else { tangent };
    (u, v, tangent * (u.length() + v.length()))
}

/// Samples in the middle of the texel.
pub(super) const NO_FOOTPRINT: (Vec3, Vec3, f32) = (Vec3::ZERO, Vec3::ZERO, 0.0);

/// The part of a texel that other geometry leaves free: what can be reached from the sample without leaving the surface.
/// A texel that a block stands on with one half has the light of the other.
#[derive(Clone, Copy)]
pub(super) struct Free {
    from: Vec3,
    lift: Vec3,
}

impl Free {
    /// Where nothing else is near, or samples do not stray, all of the texel is free: none.
    pub fn of(
        elements: &Elements,
        element: u32,
        receiver: &Receiver,
        half_u: Vec3,
        half_v: Vec3,
    ) -> Option<Self> {
        let strays = elements.among_others[element as usize] && half_u != Vec3::ZERO;
        // A little above, so that what lies flat on the surface is no wall.
        let lift = receiver.normal_geometric * ((half_u.length() + half_v.length()) / 16.0);
        strays.then_some(Self { from: receiver.origin_world + lift, lift })
    }

    /// Whether something stands between the sample and where `strayed` is.
    pub fn is_left<T: Tracer>(&self, strayed: &Receiver, tracer: &T, rays: &mut u64) -> bool {
        *rays += u64::from(T::SENDS);
        tracer.occluded(&segment(self.from, strayed.origin_world + self.lift))
    }
}
