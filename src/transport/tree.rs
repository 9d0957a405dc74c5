//! The 8-wide tree: nodes, packed triangles, and how it comes from a binary tree.

use super::build::Binary;
use super::pages::Pages;
use super::plan::Plan;
use super::split::padded;
use super::traverse::Processor;
use glam::Vec3;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Most triangles of a leaf.
pub(super) const LEAF: usize = 8;
/// Levels that follow the binary tree; below them, the rest is halved by count, so that no input (thousands of equal
/// triangles) makes the tree deep.
const FREE_LEVELS: u32 = 24;
/// Deepest tree: below [`FREE_LEVELS`] each level divides at most 2³¹ triangles by eight.
const MOST_LEVELS: usize = FREE_LEVELS as usize + 11;
/// Most entries a traversal keeps.
pub(super) const STACK: usize = MOST_LEVELS * (WIDTH - 1) + 1;

/// Marks a child that is a leaf: `LEAF_BIT | first << 3 | count - 1`, counted in triangles of all leaves.
pub(super) const LEAF_BIT: u32 = 1 << 31;
/// Marks a triangle whose opacity must be asked.
pub(super) const ASK_BIT: u32 = 1 << 31;

/// Bounds of eight children; unused ones are empty boxes that no ray meets.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub(super) struct Node {
    /// Rows: low x, high x, low y, high y, low z, high z.
    pub bounds: [[f32; WIDTH]; 6],
    /// Node index or leaf.
    pub child: [u32; WIDTH],
}

/// Numbers of a triangle: nine coordinates and the id.
const RECORD: usize = 10;

/// The triangles of a leaf, structure of arrays: rows of coordinates by axis, then corner, and a row of ids. Rows are
/// as long as there are triangles, so that leaves lie dense in memory, and eight numbers can be read from the start of
/// each, the last of which may be those of the next row.
#[derive(Clone, Copy)]
pub(super) struct Leaf<'a> {
    /// Exactly the leaf.
    words: &'a [u32],
    count: usize,
}

/// The tree over a world's triangles.
///
/// Memory: 256 bytes a node of up to eight children and 40 bytes a triangle of a leaf; about 75 bytes a triangle in
/// ordinary meshes.
#[derive(Clone, Default)]
pub(super) struct Tree {
    /// Node 0 is the root; it is there even when there are no triangles.
    pub nodes: Pages<Node>,
    /// Leaves one after the other, with room behind the last for [`Leaf`]'s reads.
    words: Pages<u32>,
    /// Which wide instructions walk it.
    pub processor: Processor,
    /// Lowest corner of all triangles.
    pub low: [f32; 3],
    /// Highest corner of all triangles.
    pub high: [f32; 3],
}

impl Tree {
    /// Collapses a binary tree. `asks` tells the triangles whose opacity must be asked.
    pub fn new(binary: &Binary, corners: &[[Vec3; 3]], asks: impl Fn(u32) -> bool) -> Self {
        let mut collapse = Collapse {
            binary,
            plan: Plan::new(binary),
            corners,
            asks,
            nodes: vec![Node::EMPTY],
            // The leaf of unused children: one triangle that no ray meets.
            words: vec![f32::NAN.to_bits(); LEAF * RECORD],
        };
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        if let Some(root) = binary.nodes.first() {
            (low, high) = (root.low, root.high);
            collapse.node(0, Part::Subtree(0), 0);
        }
        collapse.words.extend([f32::NAN.to_bits(); LEAF]);
        let (nodes, words) = (Pages::new(&collapse.nodes), Pages::new(&collapse.words));
        Self { nodes, words, processor: Processor::detect(), low, high }
    }

    /// The triangles of a child that is a leaf.
    #[inline(always)]
    pub fn leaf(&self, child: u32) -> Leaf<'_> {
        let (first, count) = (((child & !LEAF_BIT) >> 3) as usize, (child & 7) as usize + 1);
        let range = first * RECORD..(first + count) * RECORD;
        debug_assert!(range.end + LEAF <= self.words.len());
        // SAFETY: leaves name the tree's own words.
        Leaf { words: unsafe { self.words.get_unchecked(range) }, count }
    }

    /// Where a child lies in memory and how many cache lines to ask for.
    #[inline(always)]
    pub fn place(&self, child: u32) -> (*const u8, usize) {
        if child & LEAF_BIT == 0 {
            (self.nodes.as_ptr().wrapping_add(child as usize).cast(), 4)
        } else {
            let first = ((child & !LEAF_BIT) >> 3) as usize * RECORD;
            (self.words.as_ptr().wrapping_add(first).cast(), 5)
        }
    }

    /// All leaves.
    #[cfg(test)]
    pub fn leaves(&self) -> impl Iterator<Item = Leaf<'_>> {
        let children = self.nodes.iter().flat_map(|node| node.child);
        children.filter(|child| *child > LEAF_BIT).map(|child| self.leaf(child))
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.words[..])
    }
}

impl Leaf<'_> {
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

    /// A coordinate.
    #[inline(always)]
    pub fn coordinate(&self, axis: usize, corner: usize, lane: usize) -> f32 {
        debug_assert!(axis < 3 && corner < 3 && lane < self.count);
        // SAFETY: a leaf has nine rows of `count` coordinates.
        f32::from_bits(unsafe { *self.words.get_unchecked((3 * axis + corner) * self.count + lane) })
    }

    /// A coordinate, or any number where there are not so many triangles.
    #[inline(always)]
    pub fn coordinate_or_any(&self, axis: usize, corner: usize, lane: usize) -> f32 {
        self.coordinate(axis, corner, lane.min(self.count - 1))
    }

    /// World triangle, with [`ASK_BIT`].
    #[inline(always)]
    pub fn id(&self, lane: usize) -> u32 {
        debug_assert!(lane < self.count);
        // SAFETY: the tenth row.
        unsafe { *self.words.get_unchecked(9 * self.count + lane) }
    }
}

impl Node {
    const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self { bounds: [low, high, low, high, low, high], child: [LEAF_BIT; WIDTH] }
    };
}

/// What becomes a child: a subtree of the binary tree, or a run of triangles where that grew too deep.
enum Part {
    Subtree(u32),
    Run(Vec<u32>),
}

struct Collapse<'a, F> {
    binary: &'a Binary,
    plan: Plan,
    corners: &'a [[Vec3; 3]],
    asks: F,
    nodes: Vec<Node>,
    words: Vec<u32>,
}

impl<F: Fn(u32) -> bool> Collapse<'_, F> {
    fn node(&mut self, index: usize, part: Part, level: u32) {
        let parts = match part {
            Part::Subtree(root) if level < FREE_LEVELS => {
                self.plan.children(self.binary, root).into_iter().map(Part::Subtree).collect()
            }
            Part::Subtree(root) => divide(&self.primitives(root)),
            Part::Run(run) => divide(&run),
        };
        let mut inner = Vec::new();
        for (k, part) in parts.into_iter().enumerate() {
            let (low, high) = self.bounds(&part);
            for axis in 0..3 {
                self.nodes[index].bounds[2 * axis][k] = low[axis];
                self.nodes[index].bounds[2 * axis + 1][k] = high[axis];
            }
            self.nodes[index].child[k] = if self.is_leaf(&part) {
                self.leaf(&part)
            } else {
                let child = self.nodes.len() as u32;
                self.nodes.push(Node::EMPTY);
                inner.push((child, part));
                child
            };
        }
        for (child, part) in inner {
            self.node(child as usize, part, level + 1);
        }
    }

    fn is_leaf(&self, part: &Part) -> bool {
        match part {
            Part::Subtree(node) => self.plan.is_leaf(*node),
            Part::Run(run) => run.len() <= LEAF,
        }
    }

    fn bounds(&self, part: &Part) -> ([f32; 3], [f32; 3]) {
        match part {
            Part::Subtree(node) => {
                let node = &self.binary.nodes[*node as usize];
                (node.low, node.high)
            }
            Part::Run(run) => {
                let boxes = run.iter().map(|&t| padded(&self.corners[t as usize]));
                let add = |(low, high): (Vec3, Vec3), (l, h)| (low.min(l), high.max(h));
                let (low, high) = boxes.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), add);
                (low.to_array(), high.to_array())
            }
        }
    }

    fn leaf(&mut self, part: &Part) -> u32 {
        let mut run = match part {
            Part::Subtree(node) => self.primitives(*node),
            Part::Run(run) => run.clone(),
        };
        run.sort_unstable();
        run.dedup();
        let first = (self.words.len() / RECORD) as u32;
        for (axis, corner) in (0..9).map(|row| (row / 3, row % 3)) {
            let bits = |&triangle: &u32| self.corners[triangle as usize][corner][axis].to_bits();
            self.words.extend(run.iter().map(bits));
        }
        let id = |&triangle: &u32| if (self.asks)(triangle) { triangle | ASK_BIT } else { triangle };
        self.words.extend(run.iter().map(id));
        LEAF_BIT | first << 3 | (run.len() - 1) as u32
    }

    fn primitives(&self, root: u32) -> Vec<u32> {
        let (mut open, mut found) = (vec![root], Vec::new());
        while let Some(node) = open.pop() {
            let node = &self.binary.nodes[node as usize];
            if node.count > 0 {
                found.extend_from_slice(&self.binary.primitives[node.range()]);
            } else {
                open.extend([node.first + 1, node.first]);
            }
        }
        found
    }
}

fn divide(run: &[u32]) -> Vec<Part> {
    let size = run.len().div_ceil(WIDTH).max(LEAF);
    run.chunks(size).map(|part| Part::Run(part.to_vec())).collect()
}
