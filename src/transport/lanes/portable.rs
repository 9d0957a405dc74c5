//! Plain arrays, for every processor.

use super::Lanes;
use crate::transport::shear::Sheared;
use crate::transport::tree::{Block, LANES, Node, WIDTH};

/// Plain arrays.
pub(in crate::transport) struct Portable {
    near: [usize; 3],
    far: [usize; 3],
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    inverse: [f32; 3],
    axis: [usize; 3],
    origin: [f32; 3],
    shear: [f32; 2],
}

/// The second when they do not compare, as the processors' wide maximum has it.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

impl Lanes for Portable {
    #[inline(always)]
    fn new(ray: &Sheared) -> Self {
        let row = |k: usize, high: bool| 2 * k + usize::from(high);
        Self {
            near: std::array::from_fn(|k| row(k, ray.negative[k])),
            far: std::array::from_fn(|k| row(k, !ray.negative[k])),
            near_origin: ray.near_origin,
            far_origin: ray.far_origin,
            inverse: ray.inverse,
            axis: ray.axis,
            origin: ray.origin,
            shear: ray.shear,
        }
    }

    #[inline(always)]
    fn boxes(&self, node: &Node, t_min: f32, t_max: f32) -> (u32, [f32; WIDTH]) {
        let enter = |axis: usize, k: usize| {
            (node.bounds[self.near[axis]][k] - self.near_origin[axis]) * self.inverse[axis]
        };
        let leave = |axis: usize, k: usize| {
            (node.bounds[self.far[axis]][k] - self.far_origin[axis]) * self.inverse[axis]
        };
        let first: [f32; WIDTH] =
            std::array::from_fn(|k| max(max(enter(0, k), enter(1, k)), max(enter(2, k), t_min)));
        let last: [f32; WIDTH] =
            std::array::from_fn(|k| min(min(leave(0, k), leave(1, k)), min(leave(2, k), t_max)));
        let mask = (0..WIDTH).fold(0, |mask, k| mask | u32::from(first[k] <= last[k]) << k);
        (mask, first)
    }

    #[inline(always)]
    fn triangles(&self, block: &Block) -> u32 {
        let corner = |c: usize, k: usize| -> [f32; LANES] {
            std::array::from_fn(|lane| {
                let z = block.corner[self.axis[2]][c][lane] - self.origin[2];
                block.corner[self.axis[k]][c][lane] - self.origin[k] - self.shear[k] * z
            })
        };
        let [ax, bx, cx] = std::array::from_fn(|c| corner(c, 0));
        let [ay, by, cy] = std::array::from_fn(|c| corner(c, 1));
        (0..LANES).fold(0, |mask, k| {
            let u = bx[k] * cy[k] - by[k] * cx[k];
            let v = cx[k] * ay[k] - cy[k] * ax[k];
            let w = ax[k] * by[k] - ay[k] * bx[k];
            let one_side = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
            mask | u32::from(one_side) << k
        })
    }
}
