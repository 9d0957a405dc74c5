//! Where somebody looks at the scene from. Light does not care; pictures do.

use glam::DAffine3;

/// How a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Rays spread from one point.
    Perspective {
        /// Opening angle from the lower to the upper border of the picture, radians.
        yfov_rad: f32,
        /// Width over height, where the file says.
        aspect: Option<f32>,
    },
    /// Rays run side by side.
    Orthographic {
        /// Half the width of what is seen, metres.
        half_width_m: f32,
        /// Half the height, metres.
        half_height_m: f32,
    },
}

/// A camera; it looks along its own −z, with +y upwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The node's name.
    pub name: String,
    /// Camera space to world space, before [`super::Scene::origin_world`] is subtracted. Its scale does not count.
    pub world_from_camera: DAffine3,
    /// How it sees.
    pub projection: Projection,
    /// Nearest and farthest distance along the view's axis that is seen, metres; the second may be infinite.
    pub clip_m: [f32; 2],
}
