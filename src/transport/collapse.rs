//! How the wide tree comes from a binary one.

use super::build::{Binary, padded};
use super::plan::Plan;
use super::tree::{LEAF, Node, RECORD, WIDTH, add_blocks};
use glam::Vec3;

/// Levels that follow the binary tree; below them, the rest is divided by count, so that no input (thousands of equal
/// triangles) makes the tree deep.
const FREE_LEVELS: u32 = 24;
/// Deepest tree: below [`FREE_LEVELS`] each level divides at most 2³¹ triangles by eight.
const MOST_LEVELS: usize = FREE_LEVELS as usize + 11;
/// Most nodes that wait while one is visited: at each level all children but one, and all of the last.
pub(super) const STACK: usize = MOST_LEVELS * (WIDTH - 1) + 1;

/// What becomes a child: a subtree of the binary tree, or a run of triangles where that grew too deep.
enum Part {
    Subtree(u32),
    Run(Vec<u32>),
}

/// A wide tree in the making.
pub(super) struct Collapse<'a, F> {
    binary: &'a Binary,
    plan: Plan,
    corners: &'a [[Vec3; 3]],
    asks: &'a F,
    /// The nodes, the root first.
    pub nodes: Vec<Node>,
    /// The records of the leaves.
    pub words: Vec<u32>,
}

impl<'a, F: Fn(u32) -> bool> Collapse<'a, F> {
    /// Makes the tree; there must be a binary one.
    pub fn new(binary: &'a Binary, corners: &'a [[Vec3; 3]], asks: &'a F) -> Self {
        let plan = Plan::new(binary);
        let mut tree = Self { binary, plan, corners, asks, nodes: vec![Node::EMPTY], words: Vec::new() };
        tree.node(0, Part::Subtree(0), 0);
        tree
    }

    fn node(&mut self, index: usize, part: Part, level: u32) {
        let parts = match part {
            Part::Subtree(root) if level < FREE_LEVELS => {
                self.plan.children(self.binary, root).into_iter().map(Part::Subtree).collect()
            }
            Part::Subtree(root) => divide(&self.primitives(root)),
            Part::Run(run) => divide(&run),
        };
        let mut node = Node::EMPTY;
        let mut inner = Vec::new();
        for (k, part) in parts.into_iter().enumerate() {
            let (low, high) = self.bounds(&part);
            for axis in 0..3 {
                (node.bounds[2 * axis][k], node.bounds[2 * axis + 1][k]) = (low[axis], high[axis]);
            }
            if self.is_leaf(&part) {
                let run = self.run(part);
                node.child[k] = (self.words.len() / RECORD) as u32;
                node.count[k] = run.len() as u8;
                node.leaves |= 1 << k;
                add_blocks(&mut self.words, &run, self.corners, self.asks);
            } else {
                node.child[k] = self.nodes.len() as u32;
                self.nodes.push(Node::EMPTY);
                inner.push((node.child[k], part));
            }
        }
        self.nodes[index] = node;
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

    fn run(&self, part: Part) -> Vec<u32> {
        match part {
            Part::Subtree(node) => self.primitives(node),
            Part::Run(run) => run,
        }
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
