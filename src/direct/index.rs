//! From an element to its block.

use crate::elements::Elements;

/// Width of a block, texels.
const TILE: u16 = 64;

/// A rectangle of texels of one chart, `[min, max)`.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Chart of the elements.
    pub chart: u32,
    /// First texel.
    pub min: [u16; 2],
    /// Exclusive end.
    pub max: [u16; 2],
}

impl Block {
    /// Texels of the rectangle.
    pub fn inner_area(&self) -> u64 {
        u64::from(self.max[0] - self.min[0]) * u64::from(self.max[1] - self.min[1])
    }
}

/// Cuts all charts into blocks.
pub fn cut(elements: &Elements) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (index, chart) in elements.charts.iter().enumerate() {
        if chart.elements.is_empty() {
            continue;
        }
        for y in (chart.min[1]..chart.max[1]).step_by(TILE.into()) {
            for x in (chart.min[0]..chart.max[0]).step_by(TILE.into()) {
                let max =
                    [x.saturating_add(TILE).min(chart.max[0]), y.saturating_add(TILE).min(chart.max[1])];
                blocks.push(Block { chart: index as u32, min: [x, y], max });
            }
        }
    }
    blocks
}

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
