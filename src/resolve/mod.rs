//! Light per element -> pages: seams, dilation, validity, the stored unit.

use glam::Vec3;

/// One page, ready to be written.
#[derive(Clone, Debug)]
pub struct LightmapPage {
    /// Width and height.
    pub size_texels: u32,
    /// Row by row from the top, in the stored unit; finite and not negative everywhere.
    pub value: Vec<Vec3>,
    /// Whether a chart covers the texel (dilated texels are not covered).
    pub covered: Vec<bool>,
}

/// All exported pages, in the atlas' order.
#[derive(Clone, Debug, Default)]
pub struct Lightmap {
    /// The pages.
    pub pages: Vec<LightmapPage>,
}
