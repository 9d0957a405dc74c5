//! Values for every texel that no chart covers: near charts their nearest values, elsewhere ever coarser means, so that
//! neither bilinear lookups nor smaller copies of the page bring in black.

use super::canvas::{Canvas, NO_CHART};
use glam::Vec3;
use rayon::prelude::*;

/// Rings of texels around charts that take the mean of their neighbours; beyond, means of growing squares.
const RINGS: u32 = 6;

/// Fills the whole page.
pub(super) fn dilate(canvas: &mut Canvas) {
    let mut known: Vec<bool> = canvas.owner.iter().map(|&owner| owner != NO_CHART).collect();
    grow(canvas, &mut known);
    push_pull(&mut canvas.value, &known, canvas.size);
}

fn grow(canvas: &mut Canvas, known: &mut [bool]) {
    let mut front: Vec<usize> = (0..known.len()).filter(|&t| known[t]).collect();
    let mut queued = known.to_vec();
    for _ in 0..RINGS {
        let mut next = Vec::new();
        for &texel in &front {
            for other in canvas.around(texel) {
                if !std::mem::replace(&mut queued[other], true) {
                    next.push(other);
                }
            }
        }
        let mean = |&texel: &usize| {
            let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
            for other in canvas.around(texel).filter(|&other| known[other]) {
                let w = if canvas.side_by_side(texel, other) { 1.0 } else { 0.25 };
                sum += canvas.value[other] * w;
                weight += w;
            }
            sum / weight
        };
        let values: Vec<Vec3> = next.par_iter().map(mean).collect();
        for (&texel, value) in next.iter().zip(values) {
            canvas.value[texel] = value;
            known[texel] = true;
        }
        front = next;
    }
}

/// Push-pull (Gortler, Grzeszczuk, Szeliski and Cohen, The Lumigraph, 1996): means of known texels at half the size,
/// recursively, are spread back over the unknown.
pub(crate) fn push_pull(value: &mut [Vec3], known: &[bool], size: usize) {
    if known.iter().all(|&k| k) || !known.iter().any(|&k| k) {
        return;
    }
    let half = size.div_ceil(2);
    let children = |texel: usize| {
        let (x, y) = (2 * (texel % half), 2 * (texel / half));
        let columns = x..(x + 2).min(size);
        (y..(y + 2).min(size)).flat_map(move |j| columns.clone().map(move |i| j * size + i))
    };
    let pull = |texel: usize| {
        let (mut sum, mut count) = (Vec3::ZERO, 0.0_f32);
        for child in children(texel).filter(|&child| known[child]) {
            sum += value[child];
            count += 1.0;
        }
        (sum / count.max(1.0), count > 0.0)
    };
    let (mut coarse, coarse_known): (Vec<Vec3>, Vec<bool>) =
        (0..half * half).into_par_iter().map(pull).unzip();
    push_pull(&mut coarse, &coarse_known, half);
    let last = half - 1;
    value.par_iter_mut().enumerate().filter(|(texel, _)| !known[*texel]).for_each(|(texel, value)| {
        // The four coarse texels around, nearest first: weights 9, 3, 3 and 1 of 16.
        let (x, y) = (texel % size, texel / size);
        let beside =
            |i: usize| if i.is_multiple_of(2) { (i / 2).saturating_sub(1) } else { (i / 2 + 1).min(last) };
        let at = |x: usize, y: usize| coarse[y * half + x];
        let (x0, y0, x1, y1) = (x / 2, y / 2, beside(x), beside(y));
        *value = (at(x0, y0) * 9.0 + (at(x1, y0) + at(x0, y1)) * 3.0 + at(x1, y1)) / 16.0;
    });
}
