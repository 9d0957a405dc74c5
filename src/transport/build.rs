//! The binary tree over boxes; the only file that names obvhs.

use super::split::{Fragment, fragments};
use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// A node of a binary tree.
pub(super) struct BinaryNode {
    pub low: [f32; 3],
    pub high: [f32; 3],
    /// First of the two children, or first primitive of a leaf.
    pub first: u32,
    /// Primitives of a leaf; zero for inner nodes.
    pub count: u32,
}

/// A binary tree; node 0 is the root, no nodes when there are no triangles.
pub(super) struct Binary {
    pub nodes: Vec<BinaryNode>,
    /// Triangles in the order of the leaves.
    pub primitives: Vec<u32>,
}

impl Binary {
    /// Builds over the given triangles, which must be finite; those that `may_split` stand in several leaves.
    pub fn new(corners: &[[Vec3; 3]], triangles: &[u32], may_split: impl Fn(u32) -> bool) -> Self {
        let fragments = fragments(corners, triangles, may_split);
        let boxes: Vec<Aabb> =
            fragments.iter().map(|f: &Fragment| Aabb::new(f.low.into(), f.high.into())).collect();
        let mut bvh = PlocBuilder::with_capacity(boxes.len()).build(
            PlocSearchDistance::Medium,
            &boxes,
            (0..boxes.len() as u32).collect(),
            SortPrecision::U64,
            3,
        );
        ReinsertionOptimizer::default().run(&mut bvh, 0.05, None);
        let nodes = bvh.nodes.iter().map(|node| BinaryNode {
            low: node.aabb().min.to_array(),
            high: node.aabb().max.to_array(),
            first: node.first_index,
            count: node.prim_count,
        });
        Self {
            nodes: nodes.collect(),
            primitives: bvh.primitive_indices.iter().map(|&i| fragments[i as usize].triangle).collect(),
        }
    }

    /// Nodes, every parent before its children.
    pub fn order(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut open = Vec::from_iter((!self.nodes.is_empty()).then_some(0));
        while let Some(node) = open.pop() {
            order.push(node);
            let BinaryNode { first, count, .. } = self.nodes[node as usize];
            if count == 0 {
                open.extend([first + 1, first]);
            }
        }
        order
    }
}

impl BinaryNode {
    /// Half the surface of the box.
    pub fn half_area(&self) -> f32 {
        let [x, y, z]: [f32; 3] = std::array::from_fn(|k| self.high[k] - self.low[k]);
        x * y + y * z + z * x
    }

    /// Its place in [`Binary::primitives`].
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}
