//! Which nodes of the binary tree become nodes of the wide one, and which become leaves.

use super::build::Binary;
use super::tree::{LANES, LEAF, WIDTH};

/// Cost of trying a leaf, in visits of a wide node.
///
/// Measured, as is [`BLOCK_COST`]: the best of seven pairs on two of three large scenes; between (0.2, 0.4) and
/// (0.4, 0.3) times differ by less than 5 %.
const LEAF_COST: f32 = 0.3;

/// Cost of trying each of its blocks.
const BLOCK_COST: f32 = 0.25;

/// The cheapest way to make wide nodes of a binary tree, by the surface area heuristic.
///
/// Dynamic programming from the leaves up: Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs
/// Through Compressed Wide BVHs", HPG 2017, section 3.
pub(super) struct Plan {
    /// Per binary node: how the best forest of at most 2, 3, … 8 trees over it is split, as the number of trees on the
    /// left; 0 when fewer trees do. The first entry is 1 when the whole is best a leaf.
    split: Vec<[u8; WIDTH]>,
}

impl Plan {
    /// Weighs all ways.
    pub fn new(binary: &Binary) -> Self {
        let count = binary.nodes.len();
        let mut split = vec![[0; WIDTH]; count];
        let mut cost = vec![[0f32; WIDTH - 1]; count];
        let mut size = vec![0u32; count];
        for &index in binary.order().iter().rev() {
            let (i, node) = (index as usize, &binary.nodes[index as usize]);
            let area = node.half_area();
            let leaf = |size: u32| {
                let cost = LEAF_COST + BLOCK_COST * size.div_ceil(LANES as u32) as f32;
                if size as usize <= LEAF { area * cost } else { f32::INFINITY }
            };
            if node.count > 0 {
                size[i] = node.count;
                cost[i] = [leaf(size[i]); WIDTH - 1];
                split[i][0] = 1;
                continue;
            }
            let (left, right) = (node.first as usize, node.first as usize + 1);
            size[i] = size[left] + size[right];
            let forest = |trees: usize| {
                (1..trees)
                    .filter(|&k| k < WIDTH && trees - k < WIDTH)
                    .map(|k| (cost[left][k - 1] + cost[right][trees - k - 1], k as u8))
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .unwrap_or((f32::INFINITY, 1))
            };
            let (whole, k) = forest(WIDTH);
            split[i][WIDTH - 1] = k;
            let (inner, leaf) = (whole + area, leaf(size[i]));
            split[i][0] = u8::from(leaf <= inner);
            let mut best = [inner.min(leaf); WIDTH - 1];
            for trees in 2..WIDTH {
                let (forest, k) = forest(trees);
                best[trees - 1] = best[trees - 2];
                if forest < best[trees - 1] {
                    best[trees - 1] = forest;
                    split[i][trees - 1] = k;
                }
            }
            cost[i] = best;
        }
        Self { split }
    }

    /// Whether the node is best a leaf.
    pub fn is_leaf(&self, node: u32) -> bool {
        self.split[node as usize][0] == 1
    }

    /// The nodes that become the children of the wide node over `root`.
    pub fn children(&self, binary: &Binary, root: u32) -> Vec<u32> {
        if self.is_leaf(root) {
            return vec![root];
        }
        let mut children = Vec::with_capacity(WIDTH);
        let mut open = vec![(root, WIDTH)];
        while let Some((node, mut trees)) = open.pop() {
            let split = &self.split[node as usize];
            while trees > 1 && split[trees - 1] == 0 {
                trees -= 1;
            }
            if trees == 1 {
                children.push(node);
                continue;
            }
            let left = split[trees - 1] as usize;
            let first = binary.nodes[node as usize].first;
            open.extend([(first + 1, trees - left), (first, left)]);
        }
        children
    }
}
