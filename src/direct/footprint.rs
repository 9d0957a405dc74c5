//! The part of a surface that a texel stands for: where its shadow rays start.

use super::{Emitter, Receiver};
use crate::elements::Elements;
use crate::transport::{Shaft, Tracer, World, segment};
use glam::Vec3;

/// Neighbours whose normals lie further apart than about 32° from the texel's are behind a crease.
const CREASE_COSINE: f32 = 0.85;

/// The texel's parallelogram around its middle.
#[derive(Clone, Copy)]
pub(super) struct Footprint {
    /// In the middle, where a texel that is only that has its shadow rays start.
    middle: Receiver,
    /// How far above it those of samples start that stray.
    lift: Vec3,
    /// Half sides, metres.
    half: [Vec3; 2],
    /// Whether other geometry is near.
    among_others: bool,
    /// Where something reaches into the parallelogram: how far above the surface a look from the middle to a sample goes,
    /// so that what lies flat on the surface is no wall.
    parted_at: Option<Vec3>,
}

impl Footprint {
    /// Of an element with these neighbours. On a hollow surface the tangent plane dips under its neighbours, and what lies
    /// beyond would see the light behind the wall: samples are lifted by as much as they may dip, the half diagonal times
    /// the tangent of the angle. On a crease they stay in the middle.
    pub fn new(elements: &Elements, element: u32, world: &World, around: impl Iterator<Item = u32>) -> Self {
        let e = element as usize;
        let middle = Receiver::of(elements, element, world);
        let normal = middle.normal_geometric;
        let (mut straightest, mut hollow) = (1.0_f32, 1.0_f32);
        for n in around.map(|n| n as usize) {
            let cosine = normal.dot(elements.normal_geometric[n]);
            straightest = straightest.min(cosine);
            // Neighbours of a hollow surface rise above the plane.
            if normal.dot(elements.position_world[n] - elements.position_world[e]) > 0.0 {
                hollow = hollow.min(cosine);
            }
        }
        if straightest < CREASE_COSINE {
            return Self::point(middle);
        }
        let half = [elements.half_u_world[e], elements.half_v_world[e]];
        let diagonal = half[0].length() + half[1].length();
        let tangent = (1.0 - hollow * hollow).max(0.0).sqrt() / hollow;
        let tangent = if tangent < 1e-3 { 0.0 } else { tangent };
        let lift = normal * (tangent * diagonal);
        let among_others = elements.among_others[e];
        let mut footprint = Self { middle, lift, half, among_others, parted_at: None };
        let above = normal * (diagonal / 16.0);
        let is_parted = among_others
            && !footprint.sees_all(above, world, |here| {
                let middle = middle.origin_world + above;
                let here = [here[0].min(middle), here[1].max(middle)];
                Shaft::new(here, here)
            });
        footprint.parted_at = is_parted.then_some(above);
        footprint
    }

    /// Only the middle.
    pub fn point(middle: Receiver) -> Self {
        let half = [Vec3::ZERO; 2];
        Self { middle, lift: Vec3::ZERO, half, among_others: false, parted_at: None }
    }

    /// Its middle.
    pub fn only_middle(&self) -> Self {
        Self::point(self.middle)
    }

    /// As seen by a light. Beside other geometry the part of the texel that is free lies to one side, where a light with an
    /// extent is seen in another share than from the middle: only the border of a `sharp` light's shadow is averaged.
    pub fn for_light(&self, sharp: bool) -> Self {
        if self.among_others && !sharp { self.only_middle() } else { *self }
    }

    /// Whether it is only its middle.
    pub fn is_point(&self) -> bool {
        self.half[0] == Vec3::ZERO
    }

    /// Whether something parts places of it from its middle.
    pub fn is_parted(&self) -> bool {
        self.parted_at.is_some()
    }

    /// The box around the starts of all shadow rays, the middle's included.
    pub fn starts(&self) -> [Vec3; 2] {
        let (start, half) = (self.middle.origin_world + self.lift, self.half[0].abs() + self.half[1].abs());
        [(start - half).min(self.middle.origin_world), (start + half).max(self.middle.origin_world)]
    }

    /// Normal of the plane that none of them lies below, and its height.
    pub fn plane(&self) -> (Vec3, f64) {
        let normal = self.middle.normal_geometric;
        (normal, normal.as_dvec3().dot(self.middle.origin_world.as_dvec3()))
    }

    /// Whether nothing reaches into a shaft, which is given the box around the starts, `above` higher.
    fn sees_all(&self, above: Vec3, world: &World, shaft: impl Fn([Vec3; 2]) -> Shaft) -> bool {
        let (normal, height) = self.plane();
        let shaft = shaft(self.starts().map(|corner| corner + above));
        let height = height + normal.as_dvec3().dot(above.as_dvec3());
        world.reaching_into(&shaft.above(normal, height), 0, &mut Vec::new())
    }

    /// Whether nothing reaches between any place of it and an emitter.
    pub fn sees_all_of<E: Emitter>(&self, emitter: &E, world: &World) -> bool {
        self.sees_all(Vec3::ZERO, world, |from| emitter.shaft(from, world.bounds()))
    }

    /// The receiver at a place of it, `[0, 1)²`; none where something parts it from the middle: under a block that stands
    /// on the surface or beyond a wall there is nothing to see.
    pub fn at<T: Tracer>(&self, [s, t]: [f32; 2], tracer: &T, rays: &mut u64) -> Option<Receiver> {
        let by = self.lift + self.half[0] * (2.0 * s - 1.0) + self.half[1] * (2.0 * t - 1.0);
        let clear = self.middle.origin_world - self.middle.position_world;
        let position_world = self.middle.position_world + by;
        let origin_world = position_world + clear;
        if let Some(above) = self.parted_at {
            *rays += 1;
            if tracer.occluded(&segment(self.middle.origin_world + above, origin_world + above)) {
                return None;
            }
        }
        Some(Receiver { position_world, origin_world, ..self.middle })
    }
}
