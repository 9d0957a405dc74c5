//! AVX2.

use super::Lanes;
use crate::transport::shear::{Reach, Sheared, Slabs};
use crate::transport::tree::{Block, Node, WIDTH};
use std::arch::x86_64::*;

/// AVX2; only to be made where the processor has it.
#[derive(Clone, Copy)]
pub(in crate::transport) struct Avx2 {
    axis: [usize; 3],
    origin: [__m256; 3],
    shear: [__m256; 2],
}

/// A ray's boxes test.
#[derive(Clone, Copy)]
pub(in crate::transport) struct Boxes {
    /// Index of the row of near planes, per axis; the far planes' is the other of the pair.
    near: [usize; 3],
    enter: [__m256; 3],
    enter_offset: [__m256; 3],
    leave: [__m256; 3],
    leave_offset: [__m256; 3],
}

#[repr(align(32))]
struct Row([f32; WIDTH]);

#[inline(always)]
fn spread<const N: usize>(values: [f32; N]) -> [__m256; N] {
    // SAFETY: the type's contract.
    values.map(|x| unsafe { _mm256_set1_ps(x) })
}

impl Lanes for Avx2 {
    type Boxes = Boxes;

    #[inline(always)]
    fn new(ray: &Sheared) -> Self {
        Self { axis: ray.axis, origin: spread(ray.origin), shear: spread(ray.shear) }
    }

    #[inline(always)]
    fn boxes(slabs: &Slabs) -> Boxes {
        let [x, y, z] = slabs.negative.map(usize::from);
        Boxes {
            near: [x, 2 + y, 4 + z],
            enter: spread(slabs.enter),
            enter_offset: spread(slabs.enter_offset),
            leave: spread(slabs.leave),
            leave_offset: spread(slabs.leave_offset),
        }
    }

    #[inline(always)]
    fn enter(boxes: &Boxes, node: &Node, t_min: f32, t_max: f32) -> (u32, [f32; WIDTH]) {
        // SAFETY: the type's contract; rows are 32-byte aligned as the node is and `near` is below 6.
        unsafe {
            let rows = node.bounds.as_ptr().cast::<f32>();
            let plane = |row: usize, slope: __m256, offset: __m256| {
                _mm256_fmsub_ps(slope, _mm256_load_ps(rows.add(row * WIDTH)), offset)
            };
            let enter = |k: usize| plane(boxes.near[k], boxes.enter[k], boxes.enter_offset[k]);
            let leave = |k: usize| plane(boxes.near[k] ^ 1, boxes.leave[k], boxes.leave_offset[k]);
            let first = _mm256_max_ps(
                _mm256_max_ps(enter(0), enter(1)),
                _mm256_max_ps(enter(2), _mm256_set1_ps(t_min)),
            );
            let last = _mm256_min_ps(
                _mm256_min_ps(leave(0), leave(1)),
                _mm256_min_ps(leave(2), _mm256_set1_ps(t_max)),
            );
            let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(first, last)) as u32;
            let mut row = Row([0.0; WIDTH]);
            _mm256_store_ps(row.0.as_mut_ptr(), first);
            (mask, row.0)
        }
    }

    #[inline(always)]
    fn triangles(&self, block: Block, reach: &Reach) -> (u32, u32) {
        // SAFETY: the type's contract; eight numbers can be read from the start of every row.
        unsafe {
            let rows = block.rows();
            let at = |k: usize, corner: usize| {
                let row = rows.add((3 * self.axis[k] + corner) * block.count());
                _mm256_sub_ps(self.origin[k], _mm256_loadu_ps(row))
            };
            let (az, bz, cz) = (at(2, 0), at(2, 1), at(2, 2));
            let sheared = |k: usize, corner: usize, z: __m256| {
                _mm256_sub_ps(at(k, corner), _mm256_mul_ps(self.shear[k], z))
            };
            let (ax, bx, cx) = (sheared(0, 0, az), sheared(0, 1, bz), sheared(0, 2, cz));
            let (ay, by, cy) = (sheared(1, 0, az), sheared(1, 1, bz), sheared(1, 2, cz));
            let u = _mm256_sub_ps(_mm256_mul_ps(bx, cy), _mm256_mul_ps(by, cx));
            let v = _mm256_sub_ps(_mm256_mul_ps(cx, ay), _mm256_mul_ps(cy, ax));
            let w = _mm256_sub_ps(_mm256_mul_ps(ax, by), _mm256_mul_ps(ay, bx));
            let least = _mm256_min_ps(_mm256_min_ps(u, v), w);
            let most = _mm256_max_ps(_mm256_max_ps(u, v), w);
            let near = _mm256_min_ps(_mm256_min_ps(az, bz), cz);
            let far = _mm256_max_ps(_mm256_max_ps(az, bz), cz);
            let zero = _mm256_setzero_ps();
            let [low, high] = spread(reach.widest);
            let side = _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_GE_OQ>(least, zero),
                _mm256_cmp_ps::<_CMP_LE_OQ>(most, zero),
            );
            let within =
                _mm256_and_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(far, low), _mm256_cmp_ps::<_CMP_LE_OQ>(near, high));
            let may = _mm256_movemask_ps(_mm256_and_ps(side, within)) as u32;
            let [low, high] = spread(reach.surest);
            let side = _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_GT_OQ>(least, zero),
                _mm256_cmp_ps::<_CMP_LT_OQ>(most, zero),
            );
            let within =
                _mm256_and_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(near, low), _mm256_cmp_ps::<_CMP_LT_OQ>(far, high));
            let sure = _mm256_movemask_ps(_mm256_and_ps(side, within)) as u32;
            let there = u32::MAX >> (32 - block.count() as u32);
            (may & there, sure & there)
        }
    }

    #[inline(always)]
    fn prefetch(node: &Node) {
        let start = std::ptr::from_ref(node).cast::<i8>();
        for line in 0..size_of::<Node>() / 64 {
            // SAFETY: prefetching reads nothing, whatever the address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line)) };
        }
    }
}
