//! From an element to its block.

use super::Block;
use crate::elements::Elements;

/// Finds the block of an element.
pub(super) struct Index {
    /// First block of each chart.
    first: Vec<u32>,
}

impl Index {
    pub fn new(elements: &Elements, blocks: &[Block]) -> Self {
        let mut first = vec![0; elements.charts.len() + 1];
        for block in blocks {
            first[block.chart as usize + 1] += 1;
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        Self { first }
    }

    /// The block an element lies in.
    pub fn block_of(&self, elements: &Elements, blocks: &[Block], element: u32) -> usize {
        let chart = elements.chart[element as usize] as usize;
        let texel = elements.texel[element as usize];
        let inside =
            |b: &Block| (b.min[0]..b.max[0]).contains(&texel.x) && (b.min[1]..b.max[1]).contains(&texel.y);
        let (from, to) = (self.first[chart] as usize, self.first[chart + 1] as usize);
        from + blocks[from..to].iter().position(inside).unwrap_or(0)
    }
}
