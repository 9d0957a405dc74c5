//! Pages being painted: which texels have a value, and from which chart.

use crate::elements::{Elements, NO_ELEMENT};
use crate::units::{Irradiance, Radiosity, Reflectance};
use glam::Vec3;

/// No chart: the texel has no value yet.
pub(super) const NO_CHART: u32 = u32::MAX;

/// One exported page. Until [`Canvas::store`] the values are irradiance.
pub(super) struct Canvas {
    /// Index of the page in the atlas.
    pub page: u32,
    /// Width and height.
    pub size: usize,
    /// Row by row from the top.
    pub value: Vec<Vec3>,
    /// The chart that each value belongs to.
    pub owner: Vec<u32>,
    /// Texels beside a chart that took its value, with their neighbours in it; by texel.
    ring: Vec<Ring>,
}

struct Ring {
    texel: usize,
    chart: u32,
}

impl Canvas {
    /// Paints the valid elements; of the invalid ones those beside them take their light, the others stay dark.
    /// Charts without a valid element stay unknown.
    pub(super) fn new(elements: &Elements, irradiance: &[Irradiance], page: u32) -> Self {
        let map = &elements.pages[page as usize];
        let size = map.size_texels as usize;
        let mut canvas = Self {
            page,
            size,
            value: vec![Vec3::ZERO; map.element.len()],
            owner: vec![NO_CHART; map.element.len()],
            ring: Vec::new(),
        };
        let mut invalid = Vec::new();
        for (texel, &e) in map.element.iter().enumerate() {
            if e == NO_ELEMENT {
                continue;
            }
            let light = irradiance.get(e as usize).copied().unwrap_or_default();
            if elements.valid[e as usize] && light.is_finite() {
                canvas.value[texel] = light.0.max(Vec3::ZERO);
                canvas.owner[texel] = elements.chart[e as usize];
            } else {
                invalid.push(texel);
            }
        }
        canvas.fill_invalid(elements, invalid);
        canvas.surround(elements);
        canvas
    }

    /// Indices of the up to eight texels around one, row by row.
    pub(super) fn around(&self, texel: usize) -> impl Iterator<Item = usize> + use<> {
        let size = self.size;
        let (x, y) = (texel % size, texel / size);
        let rows = y.saturating_sub(1)..(y + 2).min(size);
        rows.flat_map(move |j| (x.saturating_sub(1)..(x + 2).min(size)).map(move |i| j * size + i))
            .filter(move |&other| other != texel)
    }

    /// Whether two texels that touch share a side, not only a corner.
    pub(super) fn side_by_side(&self, a: usize, b: usize) -> bool {
        a % self.size == b % self.size || a / self.size == b / self.size
    }

    /// Mean of the known values around a texel that `counts`; corners count 1/√2. `None` when there are none.
    fn mean(&self, texel: usize, counts: impl Fn(usize) -> bool) -> Option<Vec3> {
        let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
        for other in self.around(texel) {
            if self.owner[other] != NO_CHART && counts(other) {
                let w = if self.side_by_side(texel, other) { 1.0 } else { std::f32::consts::FRAC_1_SQRT_2 };
                sum += self.value[other] * w;
                weight += w;
            }
        }
        (weight > 0.0).then(|| sum / weight)
    }

    /// The invalid texels beside valid ones take their mean, for bilinear lookups at the foot of what buries them. No
    /// light reaches what lies deeper: it stays dark, as it is under a box that stands on a floor.
    fn fill_invalid(&mut self, elements: &Elements, left: Vec<usize>) {
        let map = &elements.pages[self.page as usize];
        let chart = |texel: usize| elements.chart[map.element[texel] as usize];
        let beside: Vec<Vec3> = left
            .iter()
            .map(|&texel| self.mean(texel, |other| self.owner[other] == chart(texel)).unwrap_or(Vec3::ZERO))
            .collect();
        for (&texel, value) in left.iter().zip(beside) {
            self.value[texel] = value;
            self.owner[texel] = chart(texel);
        }
    }

    /// Gives the empty texels beside every chart a value of their own: bilinear lookups at its border need them.
    fn surround(&mut self, elements: &Elements) {
        let map = &elements.pages[self.page as usize];
        let mut found = Vec::new();
        for (texel, &e) in map.element.iter().enumerate() {
            if e != NO_ELEMENT {
                continue;
            }
            let owners = self.around(texel).map(|other| self.owner[other]);
            let Some(chart) = owners.filter(|&chart| chart != NO_CHART).min() else { continue };
            if let Some(value) = self.mean(texel, |other| self.owner[other] == chart) {
                found.push((texel, chart, value));
            }
        }
        for &(texel, chart, value) in &found {
            self.value[texel] = value;
            self.owner[texel] = chart;
        }
        self.ring = found.into_iter().map(|(texel, chart, _)| Ring { texel, chart }).collect();
    }

    /// Turns irradiance into what is stored: `of(irradiance, reflectance, emission)`, with the element's own
    /// reflectance and emission and, beside the chart, the mean of the elements around.
    pub(super) fn store(
        &mut self,
        elements: &Elements,
        emission: &[Radiosity],
        of: impl Fn(Irradiance, Reflectance, Radiosity) -> Vec3,
    ) {
        let map = &elements.pages[self.page as usize];
        let light = |e: u32| emission.get(e as usize).copied().unwrap_or_default();
        for (texel, &e) in map.element.iter().enumerate() {
            if e != NO_ELEMENT {
                let value = Irradiance(self.value[texel]);
                self.value[texel] = of(value, elements.reflectance[e as usize], light(e));
            }
        }
        for ring in &self.ring {
            let (mut reflectance, mut emitted, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0_f32);
            for other in self.around(ring.texel) {
                let e = map.element[other];
                if e != NO_ELEMENT && elements.chart[e as usize] == ring.chart {
                    reflectance += elements.reflectance[e as usize].0;
                    emitted += light(e).0;
                    count += 1.0;
                }
            }
            let (reflectance, emitted) = (reflectance / count.max(1.0), emitted / count.max(1.0));
            let value = Irradiance(self.value[ring.texel]);
            self.value[ring.texel] = of(value, Reflectance::clamped(reflectance), Radiosity(emitted));
        }
    }
}
