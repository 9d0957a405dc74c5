//! The 8-wide tree as it lies in memory.

use super::build::Binary;
use super::collapse::Collapse;
use super::lanes::Processor;
use super::pages::Pages;
use glam::Vec3;
use std::ops::Range;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Most triangles of a block: they are tested at once.
pub(super) const LANES: usize = 8;
/// Most triangles of a leaf.
pub(super) const LEAF: usize = 32;
/// Worlds of no more triangles have no nodes: all triangles are tried. Measured: in a box with boxes the tree is
/// slower for 48 triangles, faster for 60.
pub(super) const TINY: usize = 48;
/// Marks a triangle whose opacity must be asked.
pub(super) const ASK_BIT: u32 = 1 << 31;
/// Numbers of a triangle: nine coordinates and the id.
pub(super) const RECORD: usize = 10;

/// Bounds of eight children; unused ones are empty boxes that no ray meets.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub(super) struct Node {
    /// Rows: low x, high x, low y, high y, low z, high z.
    pub bounds: [[f32; WIDTH]; 6],
    /// Node index, or the first record of a leaf.
    pub child: [u32; WIDTH],
    /// Triangles of a leaf.
    pub count: [u8; WIDTH],
    /// Bit k is set when child k is a leaf.
    pub leaves: u32,
}

/// Up to eight triangles, structure of arrays: rows of coordinates by axis, then corner, and a row of ids. Rows are as
/// long as there are triangles, so that blocks lie dense in memory, and eight numbers can be read from the start of
/// each, the last of which may be those of the next row.
#[derive(Clone, Copy)]
pub(super) struct Block<'a> {
    /// Its records and [`LANES`] words more, which are read with the last rows.
    words: &'a [u32],
    count: usize,
}

/// The triangles of a leaf: blocks one after the other, all full but the last.
#[derive(Clone, Copy)]
pub(super) struct Leaf<'a> {
    /// Its records and [`LANES`] words more, as those of its last block.
    words: &'a [u32],
    count: usize,
}

/// The tree over a world's triangles.
///
/// Memory: 256 bytes a node of up to eight children and 40 bytes a triangle; about 60 bytes a triangle in ordinary
/// meshes.
#[derive(Clone, Default)]
pub(super) struct Tree {
    /// Node 0 is the root. None when the world is tiny.
    pub nodes: Pages<Node>,
    /// Records of all blocks, with room behind the last for [`Block`]'s reads. Those of a tiny world are all of full
    /// length, padded with triangles that no ray meets.
    words: Pages<u32>,
    /// Which wide instructions walk it.
    pub processor: Processor,
    /// Lowest corner of all triangles.
    pub low: [f32; 3],
    /// Highest corner of all triangles.
    pub high: [f32; 3],
}

impl Tree {
    /// Makes the binary tree wide. `asks` tells the triangles whose opacity must be asked.
    pub fn new(binary: &Binary, corners: &[[Vec3; 3]], asks: impl Fn(u32) -> bool) -> Self {
        let (low, high) = binary.nodes.first().map_or(([0.0; 3], [0.0; 3]), |root| (root.low, root.high));
        let (nodes, mut words) = if binary.primitives.len() <= TINY {
            (Vec::new(), full_blocks(&binary.primitives, corners, &asks))
        } else {
            let made = Collapse::new(binary, corners, &asks);
            (made.nodes, made.words)
        };
        words.extend([0; LANES]);
        let (nodes, words) = (Pages::new(&nodes), Pages::new(&words));
        Self { nodes, words, processor: Processor::detect(), low, high }
    }

    /// The triangles of a child that is a leaf.
    #[inline(always)]
    pub fn leaf(&self, node: &Node, child: usize) -> Leaf<'_> {
        let (first, count) = (node.child[child] as usize, usize::from(node.count[child]));
        debug_assert!(count > 0 && (first + count) * RECORD + LANES <= self.words.len());
        // SAFETY: leaves name the tree's own words.
        Leaf { words: unsafe { self.words.get_unchecked(records(first, count)) }, count }
    }

    /// All triangles of a tiny world.
    #[inline(always)]
    pub fn tiny(&self) -> Leaf<'_> {
        let count = self.words.len() / (LANES * RECORD) * LANES;
        Leaf { words: &self.words, count }
    }

    /// All leaves.
    #[cfg(test)]
    pub fn leaves(&self) -> Vec<Leaf<'_>> {
        let children = self.nodes.iter().flat_map(|node| (0..WIDTH).map(move |k| (node, k)));
        let leaves = children.filter(|(node, k)| node.leaves >> k & 1 != 0);
        let mut all: Vec<_> = leaves.map(|(node, k)| self.leaf(node, k)).collect();
        if self.nodes.is_empty() {
            all.push(self.tiny());
        }
        all
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.words[..])
    }
}

impl<'a> Leaf<'a> {
    /// Triangles.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The block from triangle `start` on, a multiple of [`LANES`] below the count.
    #[inline(always)]
    pub fn block(&self, start: usize) -> Block<'a> {
        self.block_of(start, LANES.min(self.count - start))
    }

    /// The same where it is known to be full.
    #[inline(always)]
    pub fn full_block(&self, start: usize) -> Block<'a> {
        self.block_of(start, LANES)
    }

    #[inline(always)]
    fn block_of(&self, start: usize, count: usize) -> Block<'a> {
        debug_assert!(start.is_multiple_of(LANES) && start + count <= self.count);
        // SAFETY: records of the leaf.
        Block { words: unsafe { self.words.get_unchecked(records(start, count)) }, count }
    }
}

impl Block<'_> {
    /// Triangles, from one to eight.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The start of the first row.
    #[inline(always)]
    pub fn rows(&self) -> *const f32 {
        self.words.as_ptr().cast()
    }

    /// A coordinate of the three corners.
    #[inline(always)]
    pub fn corners(&self, axis: usize, lane: usize) -> [f32; 3] {
        debug_assert!(axis < 3 && lane < self.count);
        let (first, count) = (axis * 3 * self.count + lane, self.count);
        // SAFETY: a block has nine rows of `count` coordinates.
        let word = |place: usize| f32::from_bits(unsafe { *self.words.get_unchecked(place) });
        [word(first), word(first + count), word(first + 2 * count)]
    }

    /// World triangle, with [`ASK_BIT`].
    #[inline(always)]
    pub fn id(&self, lane: usize) -> u32 {
        debug_assert!(lane < self.count);
        // SAFETY: the tenth row.
        unsafe { *self.words.get_unchecked(9 * self.count + lane) }
    }
}

/// The words of records, with those that wide reads of the last rows take in.
#[inline(always)]
fn records(first: usize, count: usize) -> Range<usize> {
    first * RECORD..(first + count) * RECORD + LANES
}

impl Node {
    /// No children.
    pub const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self { bounds: [low, high, low, high, low, high], child: [0; WIDTH], count: [0; WIDTH], leaves: 0 }
    };
}

/// The records of some triangles as blocks.
pub(super) fn add_blocks(
    words: &mut Vec<u32>,
    triangles: &[u32],
    corners: &[[Vec3; 3]],
    asks: &impl Fn(u32) -> bool,
) {
    for block in triangles.chunks(LANES) {
        for (axis, corner) in (0..9).map(|row| (row / 3, row % 3)) {
            words.extend(block.iter().map(|&t| corners[t as usize][corner][axis].to_bits()));
        }
        words.extend(block.iter().map(|&t| if asks(t) { t | ASK_BIT } else { t }));
    }
}

/// The same, rows padded to full length.
fn full_blocks(triangles: &[u32], corners: &[[Vec3; 3]], asks: &impl Fn(u32) -> bool) -> Vec<u32> {
    let mut words = Vec::new();
    for block in triangles.chunks(LANES) {
        let mut rows = Vec::new();
        add_blocks(&mut rows, block, corners, asks);
        for row in rows.chunks(block.len()) {
            words.extend(row);
            words.resize(words.len() + LANES - row.len(), f32::NAN.to_bits());
        }
    }
    words
}
