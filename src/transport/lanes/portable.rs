//! Plain arrays, for every processor.

use super::Lanes;
use crate::transport::shear::{Reach, Sheared, Slabs};
use crate::transport::tree::{Block, Node, WIDTH};

/// Plain arrays.
#[derive(Clone, Copy)]
pub(in crate::transport) struct Portable {
    ray: Sheared,
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

type Row = [f32; WIDTH];

#[inline(always)]
fn each(f: impl Fn(usize) -> f32) -> Row {
    let mut row = [0.0; WIDTH];
    for (k, out) in row.iter_mut().enumerate() {
        *out = f(k);
    }
    row
}

impl Lanes for Portable {
    type Boxes = Slabs;

    #[inline(always)]
    fn new(ray: &Sheared) -> Self {
        Self { ray: *ray }
    }

    #[inline(always)]
    fn boxes(slabs: &Slabs) -> Slabs {
        *slabs
    }

    #[inline(always)]
    fn enter(slabs: &Slabs, node: &Node, t_min: f32, t_max: f32) -> (u32, [f32; WIDTH]) {
        let (mut first, mut last) = ([t_min; WIDTH], [t_max; WIDTH]);
        for axis in 0..3 {
            let near = 2 * axis + usize::from(slabs.negative[axis]);
            let (entered, left) = (&node.bounds[near], &node.bounds[near ^ 1]);
            first = each(|k| max(entered[k] * slabs.enter[axis] - slabs.enter_offset[axis], first[k]));
            last = each(|k| min(left[k] * slabs.leave[axis] - slabs.leave_offset[axis], last[k]));
        }
        let mask = (0..WIDTH).fold(0, |mask, k| mask | u32::from(first[k] <= last[k]) << k);
        (mask, first)
    }

    #[inline(always)]
    fn triangles(&self, block: Block, reach: &Reach) -> (u32, u32) {
        let (ray, count) = (&self.ray, block.count());
        // Lanes beyond the last triangle repeat it.
        let at = |k: usize| {
            let mut rows = [[0.0; WIDTH]; 3];
            for lane in 0..WIDTH {
                let corners = block.corners(ray.axis[k], lane.min(count - 1));
                for (row, corner) in rows.iter_mut().zip(corners) {
                    row[lane] = ray.origin[k] - corner;
                }
            }
            rows
        };
        let z = at(2);
        let sheared = |k: usize| {
            let mut rows = at(k);
            for (row, z) in rows.iter_mut().zip(&z) {
                for (flat, z) in row.iter_mut().zip(z) {
                    *flat -= ray.shear[k] * z;
                }
            }
            rows
        };
        let ([ax, bx, cx], [ay, by, cy], [az, bz, cz]) = (sheared(0), sheared(1), z);
        let (mut may, mut sure) = (0, 0);
        for k in 0..count {
            let u = bx[k] * cy[k] - by[k] * cx[k];
            let v = cx[k] * ay[k] - cy[k] * ax[k];
            let w = ax[k] * by[k] - ay[k] * bx[k];
            let (least, most) = (min(min(u, v), w), max(max(u, v), w));
            let (near, far) = (min(min(az[k], bz[k]), cz[k]), max(max(az[k], bz[k]), cz[k]));
            let within = far >= reach.widest[0] && near <= reach.widest[1];
            may |= u32::from((least >= 0.0 || most <= 0.0) && within) << k;
            let within = near > reach.surest[0] && far < reach.surest[1];
            sure |= u32::from((least > 0.0 || most < 0.0) && within) << k;
        }
        (may, sure)
    }

    #[inline(always)]
    fn prefetch(_: &Node) {}
}
