//! What may stand between two boxes.
//!
//! A shaft is the convex hull of two boxes, as the planes that bound it: those of the box around both, and for each pair
//! of axes the lines that touch both boxes' outlines (Haines & Wallace, "Shaft Culling for Efficient Ray-Traced
//! Radiosity", Photorealistic Rendering in Computer Graphics 1994, section 3). What lies outside one of the planes does
//! not reach into the shaft; what lies outside none may or may not.

use super::World;
use super::shear::UNIT;
use super::stack::Stack;
use super::tree::{ASK_BIT, LANES, Leaf, Node, WIDTH};
use glam::{DVec3, Vec3};

/// Six of the box, at most four for each pair of axes, two of the ends.
const MOST_PLANES: usize = 20;

/// The space between two boxes, metres relative to the scene's origin.
pub struct Shaft {
    /// `normal · x > limit` is outside.
    planes: [(DVec3, f64); MOST_PLANES],
    count: usize,
    /// Middle and half the extent of both boxes.
    ends: [(DVec3, DVec3); 2],
    /// The box around both.
    low: Vec3,
    high: Vec3,
    /// What dot products with a normal of the largest component 1 are off by in f32, and a triangle's side in f64.
    slack: f64,
}

impl Shaft {
    /// Between two boxes, each the lowest and the highest corner.
    pub fn new(from: [Vec3; 2], to: [Vec3; 2]) -> Self {
        let (low, high) = (from[0].min(to[0]), from[1].max(to[1]));
        let largest = f64::from(low.abs().max(high.abs()).max_element());
        let mut shaft = Self {
            planes: [(DVec3::ZERO, 0.0); MOST_PLANES],
            count: 0,
            ends: [from, to].map(|[low, high]| {
                let (low, high) = (low.as_dvec3(), high.as_dvec3());
                ((low + high) / 2.0, (high - low) / 2.0)
            }),
            low,
            high,
            // Three products and two sums, and corners that the hit test sees moved by 6u of the distance.
            slack: f64::from(UNIT) * 48.0 * largest,
        };
        let of = |ends: [Vec3; 2], axis: usize, sign: f64| f64::from(ends[usize::from(sign > 0.0)][axis]);
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            for (si, sj) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let corner = [of(from, i, si), of(from, j, sj)];
                let other = [of(to, i, si), of(to, j, sj)];
                // The line through these corners of both outlines touches both if it leans as they do.
                let (mut a, mut b) = (other[1] - corner[1], corner[0] - other[0]);
                if a * si < 0.0 || b * sj < 0.0 {
                    (a, b) = (-a, -b);
                }
                let size = a.abs().max(b.abs());
                if a * si <= 0.0 || b * sj <= 0.0 || size <= 0.0 {
                    continue;
                }
                let mut normal = DVec3::ZERO;
                (normal[i], normal[j]) = (a / size, b / size);
                let limit = normal[i] * corner[0] + normal[j] * corner[1];
                shaft.add(normal, limit + shaft.slack);
            }
        }
        shaft
    }

    /// Only the part where `normal · x > height`.
    pub fn above(mut self, normal: Vec3, height: f64) -> Self {
        self.add(-normal.as_dvec3(), -height);
        self
    }

    fn add(&mut self, normal: DVec3, limit: f64) {
        self.planes[self.count] = (normal, limit);
        self.count += 1;
    }

    /// Whether a triangle is surely outside.
    pub fn misses(&self, corners: &[Vec3; 3]) -> bool {
        let [a, b, c] = *corners;
        if a.min(b).min(c).cmpgt(self.high).any() || a.max(b).max(c).cmplt(self.low).any() {
            return true;
        }
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let outside = |&(normal, limit): &(DVec3, f64)| {
            normal.dot(a) >= limit && normal.dot(b) >= limit && normal.dot(c) >= limit
        };
        if self.planes[..self.count].iter().any(outside) {
            return true;
        }
        // Both ends on one side of the triangle's plane.
        let normal = (b - a).cross(c - a);
        let slack = self.slack * normal.abs().max_element();
        let [from, to] = self.ends.map(|(middle, half)| {
            let (height, reach) = (normal.dot(middle - a), normal.abs().dot(half) + slack);
            if height > reach { 1 } else { -i32::from(height < -reach) }
        });
        from != 0 && from == to
    }

    /// Bit k is set where child k may reach in.
    fn children(&self, node: &Node) -> u32 {
        let mut outside = [false; WIDTH];
        let (low, high) = (self.low.to_array(), self.high.to_array());
        // Cut to the box around the shaft, so that no coordinate is larger than those that the slack is for.
        let mut cut = [[0.0f32; WIDTH]; 6];
        for axis in 0..3 {
            for k in 0..WIDTH {
                let (l, h) = (node.bounds[2 * axis][k], node.bounds[2 * axis + 1][k]);
                outside[k] |= !(l <= high[axis] && h >= low[axis]);
                cut[2 * axis][k] = l.max(low[axis]);
                cut[2 * axis + 1][k] = h.min(high[axis]);
            }
        }
        for &(normal, limit) in &self.planes[..self.count] {
            let normal = normal.as_vec3().to_array();
            let limit = (limit + self.slack) as f32;
            let nearest: [usize; 3] = std::array::from_fn(|axis| 2 * axis + usize::from(normal[axis] < 0.0));
            for k in 0..WIDTH {
                let least: f32 = normal[0] * cut[nearest[0]][k]
                    + normal[1] * cut[nearest[1]][k]
                    + normal[2] * cut[nearest[2]][k];
                outside[k] |= least > limit;
            }
        }
        (0..WIDTH).map(|k| u32::from(!outside[k]) << k).sum()
    }
}

impl World {
    /// Adds the blockers that may reach into a shaft to `found`, in an order that only the world decides; false when there
    /// are more than `most`, and `found` holds some of them.
    pub fn reaching_into(&self, shaft: &Shaft, most: usize, found: &mut Vec<u32>) -> bool {
        let tree = &self.tree;
        if tree.nodes.is_empty() {
            return reaching(&tree.tiny(), shaft, most, found);
        }
        let mut stack = Stack::new();
        stack.push(0, 0.0);
        while let Some(index) = stack.pop(f32::INFINITY) {
            let node = &tree.nodes[index as usize];
            let mut children = shaft.children(node);
            while children != 0 {
                let k = children.trailing_zeros() as usize;
                children &= children - 1;
                if node.leaves >> k & 1 == 0 {
                    stack.push(node.child[k], 0.0);
                } else if !reaching(&tree.leaf(node, k), shaft, most, found) {
                    return false;
                }
            }
        }
        true
    }
}

/// Adds those of a leaf.
fn reaching(leaf: &Leaf, shaft: &Shaft, most: usize, found: &mut Vec<u32>) -> bool {
    for start in (0..leaf.count()).step_by(LANES) {
        let block = leaf.block(start);
        for lane in 0..block.count() {
            let [x, y, z] = [0, 1, 2].map(|axis| block.corners(axis, lane));
            // Padding of tiny worlds is not a number.
            if x[0].is_nan() || shaft.misses(&std::array::from_fn(|k| Vec3::new(x[k], y[k], z[k]))) {
                continue;
            }
            if found.len() == most {
                return false;
            }
            found.push(block.id(lane) & !ASK_BIT);
        }
    }
    true
}
