//! The 8-wide tree: nodes, packed triangles, and how it comes from a binary tree.

use super::build::{Binary, BinaryNode};
use glam::Vec3;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Triangles of a block.
pub(super) const LANES: usize = 4;
/// Most triangles of a leaf.
const LEAF: u32 = 8;
/// Levels that follow the binary tree; below them, the rest is halved by count, so that no input (thousands of equal
/// triangles) makes the tree deep.
const FREE_LEVELS: u32 = 24;
/// Deepest tree: below [`FREE_LEVELS`] each level divides at most 2³¹ triangles by eight.
const MOST_LEVELS: usize = FREE_LEVELS as usize + 11;
/// Most entries a traversal keeps.
pub(super) const STACK: usize = MOST_LEVELS * (WIDTH - 1) + 1;

/// Marks a child that is a leaf: `LEAF_BIT | first block << 3 | blocks`.
pub(super) const LEAF_BIT: u32 = 1 << 31;
/// Marks a triangle whose opacity must be asked.
pub(super) const ASK_BIT: u32 = 1 << 31;

/// Bounds of eight children; unused ones are empty boxes that no ray meets.
#[repr(C, align(64))]
#[derive(Clone)]
pub(super) struct Node {
    /// Rows: low x, high x, low y, high y, low z, high z.
    pub bounds: [[f32; WIDTH]; 6],
    /// Node index or leaf.
    pub child: [u32; WIDTH],
}

/// Four triangles; unused lanes hold NaN, which no test passes.
#[repr(C, align(32))]
#[derive(Clone)]
pub(super) struct Block {
    /// By axis, corner, lane.
    pub corner: [[[f32; LANES]; 3]; 3],
    /// World triangle, with [`ASK_BIT`].
    pub id: [u32; LANES],
}

/// The tree over a world's triangles.
///
/// Memory: 160 bytes a block of up to four triangles and 256 bytes a node of up to eight children; about 75 bytes a
/// triangle in ordinary meshes.
#[derive(Clone, Default)]
pub(super) struct Tree {
    /// Node 0 is the root; it is there even when there are no triangles.
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
    /// Lowest corner of all triangles.
    pub low: [f32; 3],
    /// Highest corner of all triangles.
    pub high: [f32; 3],
}

impl Tree {
    /// Collapses a binary tree. `asks` tells the triangles whose opacity must be asked.
    pub fn new(binary: &Binary, corners: &[[Vec3; 3]], asks: impl Fn(u32) -> bool) -> Self {
        let mut tree = Self { nodes: vec![Node::EMPTY], ..Self::default() };
        let Some(root) = binary.nodes.first() else { return tree };
        (tree.low, tree.high) = (root.low, root.high);
        let mut collapse = Collapse { binary, count: binary.counts(), corners, asks, tree };
        collapse.node(0, Part::Subtree(0), 0);
        collapse.tree
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.blocks[..])
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
    count: Vec<u32>,
    corners: &'a [[Vec3; 3]],
    asks: F,
    tree: Tree,
}

impl<F: Fn(u32) -> bool> Collapse<'_, F> {
    fn node(&mut self, index: usize, part: Part, level: u32) {
        let parts = match part {
            Part::Subtree(root) if level < FREE_LEVELS => self.widen(root),
            Part::Subtree(root) => divide(&self.primitives(root)),
            Part::Run(run) => divide(&run),
        };
        let mut inner = Vec::new();
        for (k, part) in parts.into_iter().enumerate() {
            let (low, high) = self.bounds(&part);
            for axis in 0..3 {
                self.tree.nodes[index].bounds[2 * axis][k] = low[axis];
                self.tree.nodes[index].bounds[2 * axis + 1][k] = high[axis];
            }
            self.tree.nodes[index].child[k] = if self.size(&part) <= LEAF {
                self.leaf(&part)
            } else {
                let child = self.tree.nodes.len() as u32;
                self.tree.nodes.push(Node::EMPTY);
                inner.push((child, part));
                child
            };
        }
        for (child, part) in inner {
            self.node(child as usize, part, level + 1);
        }
    }

    /// Opens the child of the largest surface until there are eight or all are leaves.
    fn widen(&self, root: u32) -> Vec<Part> {
        let mut open = vec![root];
        while open.len() < WIDTH {
            let largest = (0..open.len())
                .filter(|&k| self.count[open[k] as usize] > LEAF && !self.is_leaf(open[k]))
                .max_by(|&a, &b| self.area(open[a]).total_cmp(&self.area(open[b])));
            let Some(k) = largest else { break };
            let first = self.binary.nodes[open[k] as usize].first;
            open[k] = first;
            open.push(first + 1);
        }
        open.into_iter().map(Part::Subtree).collect()
    }

    fn is_leaf(&self, node: u32) -> bool {
        self.binary.nodes[node as usize].count > 0
    }

    fn area(&self, node: u32) -> f32 {
        self.binary.nodes[node as usize].half_area()
    }

    fn size(&self, part: &Part) -> u32 {
        match part {
            Part::Subtree(node) => self.count[*node as usize],
            Part::Run(run) => run.len() as u32,
        }
    }

    fn bounds(&self, part: &Part) -> ([f32; 3], [f32; 3]) {
        match part {
            Part::Subtree(node) => {
                let node = &self.binary.nodes[*node as usize];
                (node.low, node.high)
            }
            Part::Run(run) => {
                let all = || run.iter().flat_map(|&t| self.corners[t as usize]);
                let low = all().fold(Vec3::INFINITY, Vec3::min);
                let high = all().fold(Vec3::NEG_INFINITY, Vec3::max);
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
        let first = self.tree.blocks.len() as u32;
        for lanes in run.chunks(LANES) {
            let mut block = Block { corner: [[[f32::NAN; LANES]; 3]; 3], id: [0; LANES] };
            for (lane, &triangle) in lanes.iter().enumerate() {
                for (c, corner) in self.corners[triangle as usize].iter().enumerate() {
                    for axis in 0..3 {
                        block.corner[axis][c][lane] = corner[axis];
                    }
                }
                block.id[lane] = if (self.asks)(triangle) { triangle | ASK_BIT } else { triangle };
            }
            self.tree.blocks.push(block);
        }
        LEAF_BIT | first << 3 | (self.tree.blocks.len() as u32 - first)
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
    let size = run.len().div_ceil(WIDTH).max(LEAF as usize);
    run.chunks(size).map(|part| Part::Run(part.to_vec())).collect()
}

impl BinaryNode {
    fn half_area(&self) -> f32 {
        let [x, y, z] = std::array::from_fn(|k| self.high[k] - self.low[k]);
        x * y + y * z + z * x
    }

    fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}
