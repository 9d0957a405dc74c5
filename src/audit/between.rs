//! What a viewer sees between the texels' centres.

use super::witness::Lit;
use crate::elements::NO_ELEMENT;
use rayon::prelude::*;

/// Root mean square of what a bilinear lookup anywhere between four texels is off by, as a share of `mean`, were each of them
/// exact.
///
/// Between two texels of a parabola with second difference d the straight line is off by d x (1 − x) / 2, a mean square of
/// d²/120. Along both axes at once the two add up, as the light's bends mostly have one sign. Borders of shadows are no
/// parabolas: where they are sharper than a texel this is the size of the error, not its value.
pub(super) fn between_texels<T: Sync>(lit: &Lit<T>, exported: &[u32], mean: f64) -> f64 {
    let square = |&element: &u32| (bend(lit, element, [1, 0]) + bend(lit, element, [0, 1])).powi(2) / 120.0;
    // Sums of fixed chunks, one after the other: the same for any number of threads.
    let sums: Vec<f64> = exported.par_chunks(4096).map(|chunk| chunk.iter().map(square).sum()).collect();
    (sums.iter().sum::<f64>() / exported.len().max(1) as f64).sqrt() / mean
}

/// Size of the second difference along an axis; 0 where the chart ends.
fn bend<T>(lit: &Lit<T>, element: u32, [dx, dy]: [i32; 2]) -> f64 {
    let (elements, e) = (lit.elements, element as usize);
    let chart = &elements.charts[elements.chart[e] as usize];
    let page = &elements.pages[chart.page as usize];
    let (texel, size) = (elements.texel[e], page.size_texels as i32);
    let at = |k: i32| {
        let (x, y) = (i32::from(texel.x) + k * dx, i32::from(texel.y) + k * dy);
        if !(0..size).contains(&x) || !(0..size).contains(&y) {
            return None;
        }
        let n = page.element[(y * size + x) as usize];
        let counts = n != NO_ELEMENT && chart.elements.contains(&n) && elements.valid[n as usize];
        counts.then(|| f64::from(lit.irradiance(n).mean()))
    };
    match (at(-1), at(1)) {
        (Some(a), Some(b)) => (a + b - 2.0 * f64::from(lit.irradiance(element).mean())).abs(),
        _ => 0.0,
    }
}
