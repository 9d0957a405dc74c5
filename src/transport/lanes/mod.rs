//! Eight boxes or four triangles at once, by processor.

mod portable;

pub(super) use portable::Portable;

use super::shear::Sheared;
use super::tree::{Block, Node, WIDTH};

/// The wide tests of one processor. All implementations give the same bits.
pub(super) trait Lanes {
    /// The ray spread over the lanes.
    fn new(ray: &Sheared) -> Self;

    /// Bit k is set when child k may hold a hit in `[t_min, t_max]`; the distances are where the ray enters.
    fn boxes(&self, node: &Node, t_min: f32, t_max: f32) -> (u32, [f32; WIDTH]);

    /// Bit k is set when the ray may meet triangle k: never clear when [`Sheared::meet`] finds a meeting.
    fn triangles(&self, block: &Block) -> u32;
}
