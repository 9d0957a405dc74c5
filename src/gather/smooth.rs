//! Patch values -> element values without steps.

use crate::elements::{Chart, Elements, NO_ELEMENT, Patches};
use crate::units::Irradiance;
use glam::DVec3;
use rayon::prelude::*;

/// Spreads a value per patch over the elements: each element takes the mean over a window as wide as its own patch.
///
/// A box filter over cells of its own width is the linear interpolation between their centres, and a window clipped
/// by the chart keeps light from leaking across its border. Where other geometry stands inside the window, the element
/// keeps its patch's value: the patch ends at a wall, the window would not.
pub fn spread_over_elements(elements: &Elements, patches: &Patches, value: &[Irradiance]) -> Vec<Irradiance> {
    let patch_of_element = &patches.patch_of_element;
    // Elements outside any patch are buried; nobody looks them up.
    let of = |patch: u32| value.get(patch as usize).copied().unwrap_or(Irradiance::ZERO);
    let mut out = vec![Irradiance::ZERO; elements.len()];
    let mut rest = out.as_mut_slice();
    let mut rows = Vec::with_capacity(elements.charts.len());
    for chart in &elements.charts {
        let (head, tail) = rest.split_at_mut(chart.elements.len());
        rows.push((chart, head));
        rest = tail;
    }
    rows.into_par_iter().for_each(|(chart, out)| {
        let first = chart.elements.start as usize;
        let own = &patch_of_element[first..first + out.len()];
        if own.iter().all(|p| *p == own[0]) {
            out.fill(own.first().map_or(Irradiance::ZERO, |&p| of(p)));
            return;
        }
        let table = SummedArea::new(elements, chart, |e| of(patch_of_element[e as usize]));
        for (k, out) in out.iter_mut().enumerate() {
            let e = first + k;
            let texel = elements.texel[e];
            let patch = patch_of_element[e];
            let count = if (patch as usize) < patches.len() { patches.range_of(patch).len() } else { 1 };
            let half = ((count as f64).sqrt() / 2.0).round() as i32;
            let mean = table.mean(i32::from(texel.x), i32::from(texel.y), half);
            *out = mean.unwrap_or_else(|| of(patch));
        }
    });
    out
}

/// Sums over all rectangles of a chart in constant time (Crow 1984).
struct SummedArea {
    min: [i32; 2],
    width: usize,
    height: usize,
    /// Of the elements above and left of each corner: sum, number, number among other geometry.
    sum: Vec<(DVec3, u32, u32)>,
}

impl SummedArea {
    fn new(elements: &Elements, chart: &Chart, value: impl Fn(u32) -> Irradiance) -> Self {
        let page = &elements.pages[chart.page as usize];
        let (width, height) =
            (usize::from(chart.max[0] - chart.min[0]), usize::from(chart.max[1] - chart.min[1]));
        let mut sum = vec![(DVec3::ZERO, 0, 0); (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = (DVec3::ZERO, 0, 0);
            let texels =
                (usize::from(chart.min[1]) + y) * page.size_texels as usize + usize::from(chart.min[0]);
            for x in 0..width {
                let e = page.element[texels + x];
                if e != NO_ELEMENT && chart.elements.contains(&e) {
                    row.0 += value(e).0.as_dvec3();
                    row.1 += 1;
                    row.2 += u32::from(elements.among_others[e as usize]);
                }
                let above = sum[y * (width + 1) + x + 1];
                sum[(y + 1) * (width + 1) + x + 1] = (above.0 + row.0, above.1 + row.1, above.2 + row.2);
            }
        }
        Self { min: chart.min.map(i32::from), width, height, sum }
    }

    /// The mean over a window; `None` where other geometry stands inside it.
    fn mean(&self, x: i32, y: i32, half: i32) -> Option<Irradiance> {
        let clamp = |v: i32, n: usize| v.clamp(0, n as i32) as usize;
        let (x, y) = (x - self.min[0], y - self.min[1]);
        let (x0, x1) = (clamp(x - half, self.width), clamp(x + half + 1, self.width));
        let (y0, y1) = (clamp(y - half, self.height), clamp(y + half + 1, self.height));
        let at = |x: usize, y: usize| self.sum[y * (self.width + 1) + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        // Counts first: adding before subtracting keeps the unsigned difference from wrapping.
        if d.2 + a.2 != b.2 + c.2 {
            return None;
        }
        let count = (d.1 + a.1) - (b.1 + c.1);
        let sum = (d.0 - b.0) - (c.0 - a.0);
        Some(Irradiance((sum / f64::from(count.max(1))).max(DVec3::ZERO).as_vec3()))
    }
}
