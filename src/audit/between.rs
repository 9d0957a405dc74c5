//! What a viewer sees between the texels' centres.

use super::exported;
use crate::elements::{Elements, NO_ELEMENT};
use rayon::prelude::*;

/// Root mean square of what a bilinear lookup anywhere between four texels is off by, as a share of the mean light, were each of
/// them exact; `irradiance` of every element.
///
/// Between two texels of a parabola with second difference d the straight line is off by d x (1 − x) / 2, a mean square of
/// d²/120. Along both axes at once the two add up, as the light's bends mostly have one sign. Borders of shadows are no
/// parabolas: where they are sharper than a texel this is the size of the error, not its value.
pub fn between_texels(elements: &Elements, irradiance: &(impl Fn(u32) -> f64 + Sync)) -> f64 {
    let square = |element: u32| {
        let bends = [[1, 0], [0, 1]].map(|along| bend(elements, irradiance, element, along));
        (bends[0] + bends[1]).powi(2) / 120.0
    };
    let texels = exported(elements);
    // Sums of fixed chunks, one after the other: the same for any number of threads.
    let sums: Vec<[f64; 2]> = texels
        .par_chunks(4096)
        .map(|chunk| chunk.iter().fold([0.0, 0.0], |[s, m], &e| [s + square(e), m + irradiance(e)]))
        .collect();
    let [square, sum] = sums.iter().fold([0.0, 0.0], |[s, m], chunk| [s + chunk[0], m + chunk[1]]);
    if sum > 0.0 { (square * texels.len() as f64).sqrt() / sum } else { 0.0 }
}

/// Size of the second difference along an axis; 0 where the chart ends.
fn bend(elements: &Elements, irradiance: &impl Fn(u32) -> f64, element: u32, [dx, dy]: [i32; 2]) -> f64 {
    let e = element as usize;
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
        counts.then(|| irradiance(n))
    };
    match (at(-1), at(1)) {
        (Some(a), Some(b)) => (a + b - 2.0 * irradiance(element)).abs(),
        _ => 0.0,
    }
}
