//! From a ray's hit to the elements under it, in constant time.

use super::charts::corners_texels;
use super::{Elements, NO_ELEMENT};
use crate::atlas::{Atlas, Placement};
use crate::scene::Scene;
use crate::transport::{Hit, World};
use glam::Vec2;
use rayon::prelude::*;

/// Where one side of a triangle lies on its page; 32 bytes.
#[derive(Clone, Copy, Debug)]
struct Mapped {
    /// Corners in texels, in the world's order.
    uv: [Vec2; 3],
    /// `NO_PAGE` when this side takes no light.
    page: u32,
    /// Chart of the elements; `NO_CHART` when it has no elements.
    chart: u32,
}

const NO_PAGE: u32 = u32::MAX;
const NO_CHART: u32 = u32::MAX;
const DARK: Mapped = Mapped { uv: [Vec2::ZERO; 3], page: NO_PAGE, chart: NO_CHART };

/// Finds the elements that a point of the world's surface belongs to.
///
/// Memory: 32 bytes for every world triangle, and as much again when any surface has a lit back.
#[derive(Clone, Debug)]
pub struct Lookup<'a> {
    elements: &'a Elements,
    front: Vec<Mapped>,
    /// Empty when no back is lit.
    back: Vec<Mapped>,
}

/// Elements and weights that add up to 1.
pub type Weights = [(u32, f32); 4];

impl<'a> Lookup<'a> {
    /// For hits with the triangles of `world`, which must be the scene's.
    pub fn new(scene: &Scene, atlas: &Atlas, world: &World, elements: &'a Elements) -> Self {
        let charts = ChartIndex::new(scene, elements);
        let side = |sides: &[Option<Placement>], back: bool| {
            let mapped = |triangle: usize| {
                let surface = world.surface_of(triangle as u32);
                let Some(placement) = sides.get(surface as usize).and_then(Option::as_ref) else {
                    return DARK;
                };
                let local = world.local_triangle(triangle as u32);
                let mirrored = scene.surfaces[surface as usize].mirrored;
                Mapped {
                    uv: corners_texels(placement, mirrored, local),
                    page: placement.page,
                    chart: charts.find(surface, back, placement.unwrap.chart_of_triangle[local as usize]),
                }
            };
            (0..world.len()).into_par_iter().map(mapped).collect()
        };
        let any_back = atlas.backs.iter().any(Option::is_some);
        let back = if any_back { side(&atlas.backs, true) } else { Vec::new() };
        Self { elements, front: side(&atlas.fronts, false), back }
    }

    /// The element whose footprint the hit lies in; next to a chart's border, where rounding or a gap between
    /// triangles may miss it, the nearest of the eight around it. `None` on sides that take no light.
    #[inline]
    pub fn element_at(&self, hit: &Hit) -> Option<u32> {
        let (side, p) = self.place(hit)?;
        let page = &self.elements.pages[side.page as usize];
        let limit = page.size_texels - 1;
        // Casts round towards zero and stay in range: no call to `floor` where the processor has no instruction for it.
        let (x, y) = ((p.x as u32).min(limit), (p.y as u32).min(limit));
        let found = page.element[y as usize * page.size_texels as usize + x as usize];
        // NO_ELEMENT is in no range; the charts' ranges stay in the cache, rows of elements do not.
        if self.elements.charts[side.chart as usize].elements.contains(&found) {
            return Some(found);
        }
        self.nearest(side, p)
    }

    /// The up to four valid elements of the hit's chart whose texel centres surround it, with bilinear weights; where
    /// none of the four is valid, the one the hit lies in, valid or not. Slots without an element repeat the first
    /// with weight 0. `None` on sides that take no light.
    #[inline]
    pub fn bilinear_at(&self, hit: &Hit) -> Option<Weights> {
        let (side, p) = self.place(hit)?;
        let page = &self.elements.pages[side.page as usize];
        let limit = page.size_texels as i32 - 1;
        let corner = (p - 0.5).floor();
        let f = p - 0.5 - corner;
        let mut weights = [(NO_ELEMENT, 0.0); 4];
        let (mut total, mut some) = (0.0, NO_ELEMENT);
        let bilinear = [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y];
        for (i, (slot, weight)) in weights.iter_mut().zip(bilinear).enumerate() {
            let (x, y) = (corner.x as i32 + (i & 1) as i32, corner.y as i32 + (i >> 1) as i32);
            if x < 0 || y < 0 || x > limit || y > limit || weight <= 0.0 {
                continue;
            }
            let found = page.element[y as usize * page.size_texels as usize + x as usize];
            if found != NO_ELEMENT
                && self.elements.chart[found as usize] == side.chart
                && self.elements.valid[found as usize]
            {
                *slot = (found, weight);
                total += weight;
                some = found;
            }
        }
        if total <= 0.0 {
            return self.element_at(hit).map(|e| [(e, 1.0), (e, 0.0), (e, 0.0), (e, 0.0)]);
        }
        Some(weights.map(|(e, w)| if e == NO_ELEMENT { (some, 0.0) } else { (e, w / total) }))
    }

    /// The page that a hit's lightmap is on, and the point there, texels from the top left. `None` on sides that take no
    /// light.
    pub fn texel_at(&self, hit: &Hit) -> Option<(u32, Vec2)> {
        self.place(hit).map(|(side, place)| (side.page, place))
    }

    /// The hit's side and its point on the page, texels.
    #[inline]
    fn place(&self, hit: &Hit) -> Option<(&Mapped, Vec2)> {
        let rows = if hit.front { &self.front } else { &self.back };
        let side = rows.get(hit.triangle as usize)?;
        if side.page == NO_PAGE || side.chart == NO_CHART {
            return None;
        }
        let [a, b, c] = side.uv;
        Some((side, a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v))
    }

    /// The nearest element of the chart among the nine texels around a point; of equals the first by row, then column.
    #[cold]
    fn nearest(&self, side: &Mapped, p: Vec2) -> Option<u32> {
        let page = &self.elements.pages[side.page as usize];
        let limit = page.size_texels as i32 - 1;
        let (cx, cy) = (p.x.floor() as i32, p.y.floor() as i32);
        let mut best: Option<(f32, u32)> = None;
        for y in cy.saturating_sub(1).max(0)..=cy.saturating_add(1).min(limit) {
            for x in cx.saturating_sub(1).max(0)..=cx.saturating_add(1).min(limit) {
                let found = page.element[y as usize * page.size_texels as usize + x as usize];
                if found == NO_ELEMENT || self.elements.chart[found as usize] != side.chart {
                    continue;
                }
                let distance = p.distance_squared(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
                if best.is_none_or(|(least, _)| distance < least) {
                    best = Some((distance, found));
                }
            }
        }
        best.map(|(_, found)| found)
    }
}

/// Element charts by surface, side and chart of the unwrap.
struct ChartIndex {
    /// Front and back of every surface: its charts `(source, index)`, ascending.
    of_side: Vec<Vec<(u32, u32)>>,
}

impl ChartIndex {
    fn new(scene: &Scene, elements: &Elements) -> Self {
        let mut of_side = vec![Vec::new(); 2 * scene.surfaces.len()];
        for (i, chart) in (0..).zip(&elements.charts) {
            of_side[2 * chart.surface as usize + usize::from(chart.back)].push((chart.source, i));
        }
        Self { of_side }
    }

    fn find(&self, surface: u32, back: bool, source: u32) -> u32 {
        let charts = &self.of_side[2 * surface as usize + usize::from(back)];
        charts.binary_search_by_key(&source, |&(source, _)| source).map_or(NO_CHART, |i| charts[i].1)
    }
}
