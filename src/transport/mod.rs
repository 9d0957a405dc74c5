//! Rays through the world: the BVH, what blocks light, form factors. Knows triangles, no scenes' meaning.

pub mod form_factors;

use glam::Vec3;

/// A ray; `direction` has unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start, world metres relative to the scene's origin.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Hits at or beyond this distance do not count, metres.
    pub t_max: f32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance, metres.
    pub t: f32,
    /// Index of the triangle as given to the builder.
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
pub trait Tracer: Sync {
    /// The nearest surface that blocks, for scenes where nothing is tinted.
    fn closest(&self, ray: &Ray) -> Option<Hit>;

    /// The share of light per channel that passes along the ray up to `t_max`: zero when blocked.
    fn transmittance(&self, ray: &Ray) -> Vec3;

    /// Visits what the ray meets, nearest first, with the share of the ray's light each surface accounts for
    /// (an opaque surface takes all that is left); returns what is left beyond the last.
    fn walk(&self, ray: &Ray, visit: &mut dyn FnMut(&Hit, Vec3)) -> Vec3;
}
