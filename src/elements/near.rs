//! Which parts of a surface have other geometry close by: box queries over the world's triangles.

use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;

/// Triangles in a leaf.
const LEAF: usize = 4;

/// A balanced tree of boxes over the triangles of a world.
pub(super) struct Near<'a> {
    world: &'a World,
    /// Triangles; every node owns a consecutive range, halved at each level.
    order: Vec<u32>,
    /// Boxes, children of `i` at `2i + 1` and `2i + 2`.
    boxes: Vec<[Vec3; 2]>,
    levels: u32,
}

impl<'a> Near<'a> {
    pub(super) fn new(world: &'a World) -> Self {
        let finite = |&t: &u32| world.corners(t).iter().all(|c| c.is_finite());
        let mut order: Vec<u32> = (0..world.len() as u32).filter(finite).collect();
        let leaves = order.len().div_ceil(LEAF).next_power_of_two();
        let levels = leaves.trailing_zeros();
        arrange(world, &mut order, levels);
        let mut near = Self { world, order, boxes: vec![EMPTY; 2 * leaves - 1], levels };
        near.enclose();
        near
    }

    /// Whether a triangle that `counts` touches the box.
    pub(super) fn any(&self, min: Vec3, max: Vec3, mut counts: impl FnMut(u32) -> bool) -> bool {
        // Two entries a level at most: a node is replaced by its children.
        let mut stack = vec![(0_usize, 0_usize, self.order.len(), 0_u32)];
        while let Some((node, from, to, level)) = stack.pop() {
            let [lo, hi] = self.boxes[node];
            if !(lo.cmple(max).all() && hi.cmpge(min).all()) {
                continue;
            }
            if level < self.levels {
                let middle = from + (to - from) / 2;
                stack.push((2 * node + 2, middle, to, level + 1));
                stack.push((2 * node + 1, from, middle, level + 1));
                continue;
            }
            for &t in &self.order[from..to] {
                if touches(&self.world.corners(t), min, max) && counts(t) {
                    return true;
                }
            }
        }
        false
    }

    fn enclose(&mut self) {
        let leaves = 1 << self.levels;
        let (world, order, levels) = (self.world, &self.order, self.levels);
        self.boxes[leaves - 1..].par_iter_mut().enumerate().for_each(|(leaf, found)| {
            let (mut from, mut to) = (0, order.len());
            for level in (0..levels).rev() {
                let middle = from + (to - from) / 2;
                if leaf >> level & 1 == 1 { from = middle } else { to = middle }
            }
            let corners = order[from..to].iter().flat_map(|&t| world.corners(t));
            *found = corners.fold(EMPTY, |[lo, hi], c| [lo.min(c), hi.max(c)]);
        });
        for node in (0..leaves - 1).rev() {
            let ([a, b], [c, d]) = (self.boxes[2 * node + 1], self.boxes[2 * node + 2]);
            self.boxes[node] = [a.min(c), b.max(d)];
        }
    }
}

const EMPTY: [Vec3; 2] = [Vec3::INFINITY, Vec3::NEG_INFINITY];

/// Orders triangles so that halving the range `levels` times separates them in space.
fn arrange(world: &World, ids: &mut [u32], levels: u32) {
    if levels == 0 || ids.len() < 2 {
        return;
    }
    let centre = |t: u32| world.corners(t).iter().map(|c| *c / 3.0).sum::<Vec3>();
    let [lo, hi] = ids.iter().fold(EMPTY, |[lo, hi], &t| [lo.min(centre(t)), hi.max(centre(t))]);
    let extent = hi - lo;
    let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
    let middle = ids.len() / 2;
    ids.select_nth_unstable_by(middle, |&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b)));
    let (left, right) = ids.split_at_mut(middle);
    if left.len() > 4096 {
        rayon::join(|| arrange(world, left, levels - 1), || arrange(world, right, levels - 1));
    } else {
        arrange(world, left, levels - 1);
        arrange(world, right, levels - 1);
    }
}

/// Whether a triangle and a box share a point: no separating axis among the box's, the plane's and the crossed edges'
/// (Akenine-Möller 2001). In f64, so that touching counts.
fn touches(corners: &[Vec3; 3], min: Vec3, max: Vec3) -> bool {
    let (min, max) = (min.as_dvec3(), max.as_dvec3());
    let (centre, half) = ((min + max) * 0.5, (max - min) * 0.5);
    let [a, b, c] = corners.map(|p| p.as_dvec3() - centre);
    let apart = |axis: glam::DVec3| {
        let [p, q, r] = [a, b, c].map(|corner| axis.dot(corner));
        let reach = half.dot(axis.abs()) * (1.0 + 1e-12);
        p.min(q).min(r) > reach || p.max(q).max(r) < -reach
    };
    if glam::DVec3::AXES.into_iter().any(apart) || apart((b - a).cross(c - a)) {
        return false;
    }
    let edges = [b - a, c - b, a - c];
    !edges.into_iter().any(|edge| glam::DVec3::AXES.into_iter().any(|axis| apart(edge.cross(axis))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn scatter(count: u32) -> Vec<[Vec3; 3]> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 9) as f32 / (1 << 23) as f32
        };
        let mut point = |scale: f32| Vec3::new(next(), next(), next()) * scale;
        (0..count)
            .map(|_| {
                let at = point(10.0);
                [at, at + point(0.5), at + point(0.5)]
            })
            .collect()
    }

    #[test]
    fn an_empty_world_has_nothing_near() {
        let world = World::opaque(vec![]);
        assert!(!Near::new(&world).any(Vec3::splat(-1e9), Vec3::splat(1e9), |_| true));
    }

    #[test]
    fn a_slanted_triangle_does_not_touch_every_box_in_its_box() {
        let triangle = [Vec3::X, Vec3::Y, Vec3::Z];
        assert!(touches(&triangle, Vec3::splat(0.3), Vec3::splat(0.4)));
        assert!(!touches(&triangle, Vec3::ZERO, Vec3::splat(0.3)));
        assert!(!touches(&triangle, Vec3::new(0.7, 0.5, 0.0), Vec3::ONE));
        assert!(touches(&triangle, Vec3::new(1.0, 0.0, 0.0), Vec3::ONE));
    }

    proptest! {
        #[test]
        fn finds_what_a_full_search_finds(at in proptest::array::uniform3(0.0_f32..10.0), size in 0.0_f32..0.6) {
            let world = World::opaque(scatter(300));
            let near = Near::new(&world);
            let (min, max) = (Vec3::from(at), Vec3::from(at) + size);
            let mut found = Vec::new();
            near.any(min, max, |t| { found.push(t); false });
            found.sort_unstable();
            let expected: Vec<u32> = (0..300).filter(|&t| touches(&world.corners(t), min, max)).collect();
            prop_assert_eq!(found, expected);
        }
    }
}
