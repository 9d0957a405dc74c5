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

/// Always inlined, and without closures, which may not be: outside of a function with the processor's features every
/// instruction is a call.
#[inline(always)]
fn spread2([a, b]: [f32; 2]) -> [__m256; 2] {
    // SAFETY: the type's contract.
    unsafe { [_mm256_set1_ps(a), _mm256_set1_ps(b)] }
}

#[inline(always)]
fn spread3([a, b, c]: [f32; 3]) -> [__m256; 3] {
    // SAFETY: the type's contract.
    unsafe { [_mm256_set1_ps(a), _mm256_set1_ps(b), _mm256_set1_ps(c)] }
}

/// The origin minus the coordinates of three rows.
///
/// # Safety
/// The type's contract; eight numbers can be read from the start of each row.
#[inline(always)]
unsafe fn from_origin(origin: __m256, row: *const f32, count: usize) -> [__m256; 3] {
    // SAFETY: the caller's.
    unsafe {
        [
            _mm256_sub_ps(origin, _mm256_loadu_ps(row)),
            _mm256_sub_ps(origin, _mm256_loadu_ps(row.add(count))),
            _mm256_sub_ps(origin, _mm256_loadu_ps(row.add(2 * count))),
        ]
    }
}

#[inline(always)]
fn shear(flat: __m256, shear: __m256, z: __m256) -> __m256 {
    // SAFETY: the type's contract.
    unsafe { _mm256_sub_ps(flat, _mm256_mul_ps(shear, z)) }
}

impl Lanes for Avx2 {
    type Boxes = Boxes;

    #[inline(always)]
    fn new(ray: &Sheared) -> Self {
        Self { axis: ray.axis, origin: spread3(ray.origin), shear: spread2(ray.shear) }
    }

    #[inline(always)]
    fn boxes(slabs: &Slabs) -> Boxes {
        let [x, y, z] = slabs.negative;
        Boxes {
            near: [usize::from(x), 2 + usize::from(y), 4 + usize::from(z)],
            enter: spread3(slabs.enter),
            enter_offset: spread3(slabs.enter_offset),
            leave: spread3(slabs.leave),
            leave_offset: spread3(slabs.leave_offset),
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
            let count = block.count();
            let row = |k: usize| block.rows().add(self.axis[k] * 3 * count);
            let [az, bz, cz] = from_origin(self.origin[2], row(2), count);
            let [ax, bx, cx] = from_origin(self.origin[0], row(0), count);
            let [ay, by, cy] = from_origin(self.origin[1], row(1), count);
            let (ax, ay) = (shear(ax, self.shear[0], az), shear(ay, self.shear[1], az));
            let (bx, by) = (shear(bx, self.shear[0], bz), shear(by, self.shear[1], bz));
            let (cx, cy) = (shear(cx, self.shear[0], cz), shear(cy, self.shear[1], cz));
            let u = _mm256_sub_ps(_mm256_mul_ps(bx, cy), _mm256_mul_ps(by, cx));
            let v = _mm256_sub_ps(_mm256_mul_ps(cx, ay), _mm256_mul_ps(cy, ax));
            let w = _mm256_sub_ps(_mm256_mul_ps(ax, by), _mm256_mul_ps(ay, bx));
            let least = _mm256_min_ps(_mm256_min_ps(u, v), w);
            let most = _mm256_max_ps(_mm256_max_ps(u, v), w);
            let near = _mm256_min_ps(_mm256_min_ps(az, bz), cz);
            let far = _mm256_max_ps(_mm256_max_ps(az, bz), cz);
            let zero = _mm256_setzero_ps();
            let [low, high] = spread2(reach.widest);
            let side = _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_GE_OQ>(least, zero),
                _mm256_cmp_ps::<_CMP_LE_OQ>(most, zero),
            );
            let within =
                _mm256_and_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(far, low), _mm256_cmp_ps::<_CMP_LE_OQ>(near, high));
            let may = _mm256_movemask_ps(_mm256_and_ps(side, within)) as u32;
            let [low, high] = spread2(reach.surest);
            let side = _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_GT_OQ>(least, zero),
                _mm256_cmp_ps::<_CMP_LT_OQ>(most, zero),
            );
            let within =
                _mm256_and_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(near, low), _mm256_cmp_ps::<_CMP_LT_OQ>(far, high));
            let sure = _mm256_movemask_ps(_mm256_and_ps(side, within)) as u32;
            let there = u32::MAX >> (32 - count as u32);
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
