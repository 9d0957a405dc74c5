//! Rays through the world: the BVH, what blocks light, form factors.
//!
//! [`World`] holds the triangles of a scene and an 8-wide tree over them. A [`Tracer`] sends rays through it; there
//! is one for worlds of opaque triangles only, one for worlds with cut-outs and one for worlds with tinted surfaces.
//! [`World::tracer`] names the least that the scene needs and [`with_tracer!`](crate::with_tracer) hands it to a
//! generic function, so that a hot loop holds no question the scene does not ask.
//!
//! Rays that start on a surface start at [`World::offset_origin`]; there is no other guard against hitting the
//! surface one stands on.

mod build;
mod collapse;
mod lanes;
mod offset;
mod pages;
mod plan;
mod shaft;
mod shear;
mod stack;
mod tracer;
mod traverse;
mod tree;
mod world;

#[cfg(test)]
mod tests;

pub use offset::{offset_origin, segment, segment_to_surface};
pub use shaft::Shaft;
pub use tracer::{AnyTracer, ClearTracer, CutoutTracer, OpaqueTracer, TintedTracer};
pub use world::{Blocking, World};

pub mod form_factors;

use glam::Vec3;

/// A ray; `direction` has unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start, world metres relative to the scene's origin.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Hits at or beyond this distance do not count, metres; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray without an end.
    pub fn unbounded(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_max: f32::INFINITY }
    }

    /// The point at distance `t`, metres.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance, metres; more than zero and less than the ray's `t_max`.
    pub t: f32,
    /// World triangle, see [`World`].
    pub triangle: u32,
    /// Weight of the second corner.
    pub u: f32,
    /// Weight of the third corner.
    pub v: f32,
    /// Whether the ray comes from the side the corners wind counter-clockwise on.
    pub front: bool,
}

/// A world that rays can be sent through. The implementations differ by what a ray may meet (only opaque triangles,
/// masked ones, tinted ones), so that a hot loop generic over this trait holds no question the scene does not ask.
///
/// Of several surfaces at the same distance the one of the lowest triangle index counts first: every answer is the
/// same for any thread count, tree and processor.
pub trait Tracer: Sync {
    /// Whether rays are sent at all; where not, all of them pass.
    const SENDS: bool = true;

    /// The triangles it sends rays through.
    fn world(&self) -> &World;

    /// The nearest surface that takes any of the ray's light.
    fn closest(&self, ray: &Ray) -> Option<Hit>;

    /// Whether nothing at all passes along the ray up to `t_max`; stops at the first surface that proves it.
    fn occluded(&self, ray: &Ray) -> bool;

    /// The share of light per channel that passes along the ray up to `t_max`: zero when blocked.
    fn transmittance(&self, ray: &Ray) -> Vec3;

    /// Visits what the ray meets, nearest first, with the share of the ray's light each surface accounts for
    /// (an opaque surface takes all that is left); returns what is left beyond the last.
    fn walk(&self, ray: &Ray, visit: impl FnMut(&Hit, Vec3)) -> Vec3
    where
        Self: Sized;
}
