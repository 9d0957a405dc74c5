//! The binary tree over boxes; the only file that names obvhs.

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
    /// Builds over the given triangles; the boxes must be finite.
    pub fn new(corners: &[[Vec3; 3]], triangles: &[u32]) -> Self {
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|&t| Aabb::from_points(&corners[t as usize].map(glam::Vec3A::from)))
            .collect();
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
            primitives: bvh.primitive_indices.iter().map(|&i| triangles[i as usize]).collect(),
        }
    }

    /// Primitives below each node.
    pub fn counts(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.nodes.len());
        let mut open = vec![0];
        while let Some(node) = open.pop() {
            order.push(node);
            let BinaryNode { first, count, .. } = self.nodes[node as usize];
            if count == 0 {
                open.extend([first, first + 1]);
            }
        }
        let mut counts = vec![0; self.nodes.len()];
        for &node in order.iter().rev() {
            let BinaryNode { first, count, .. } = self.nodes[node as usize];
            let below = |k: u32| counts[(first + k) as usize];
            counts[node as usize] = if count > 0 { count } else { below(0) + below(1) };
        }
        counts
    }
}
