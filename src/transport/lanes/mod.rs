//! Eight boxes or eight triangles at once, by processor.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod portable;

#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Avx2;
pub(super) use portable::Portable;

use super::shear::{Reach, Sheared, Slabs};
use super::tree::{Block, Node, WIDTH};

/// The wide tests of one processor.
///
/// They only rule out, or vouch for, what [`Sheared::meet`] decides, so that every implementation leads to the same
/// bits. The edge functions are differences of products in f32. Rounding is monotonic, so such a difference never has
/// the wrong sign: where it is not zero, its sign is that of the exact one.
pub(super) trait Lanes: Copy {
    /// A ray's boxes test, spread over the lanes.
    type Boxes: Copy;

    /// A ray's triangle test, spread over the lanes.
    fn new(ray: &Sheared) -> Self;

    /// The same for boxes.
    fn boxes(slabs: &Slabs) -> Self::Boxes;

    /// Bit k is set when child k may hold a hit in `[t_min, t_max]`; the distances are where the ray enters, or
    /// somewhat before.
    fn enter(boxes: &Self::Boxes, node: &Node, t_min: f32, t_max: f32) -> (u32, [f32; WIDTH]);

    /// Bit k of the first is clear when [`Sheared::meet`] finds no meeting with triangle k within reach, bit k of the
    /// second is set when it surely finds one strictly within.
    fn triangles(&self, block: Block, reach: &Reach) -> (u32, u32);

    /// Asks the memory for a node early.
    fn prefetch(node: &Node);
}

/// Which wide instructions a tree is walked with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Processor {
    /// Plain arrays.
    #[default]
    Portable,
    /// AVX2 with FMA, in every x86-64 processor since about 2013 (Intel) and 2015 (AMD).
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Processor {
    /// The best this processor has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
        {
            return Self::Avx2;
        }
        Self::Portable
    }
}
