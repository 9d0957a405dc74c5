//! The charts of some parts in whole texels, and whether they fit one page.

use super::coverage::{Cover, span};
use super::layout::{Job, Parts};
use super::page::{Page, Spot};
use super::shape::Shapes;
use rayon::prelude::*;

/// A chart this much narrower than a page may be squeezed along its length to fit; any other too long chart lowers
/// the density of its node instead.
const STRIP: u16 = 16;
/// With more charts than this one sorting order is tried, not all.
const FEW: usize = 100;

/// With more charts than this, those that span less than [`TINY`] texels are laid as full boxes.
const CROWD: usize = 30_000;
const TINY: u16 = 8;

/// Charts of one part at one density.
pub(super) struct Fitted {
    pub spans: Vec<[u16; 2]>,
    pub covers: Vec<Cover>,
    /// Some chart is too long for the page and no strip.
    too_large: bool,
    pub squeezed: bool,
}

/// Parts with equal charts share what is fitted.
pub(super) struct Fits {
    /// Part of the first row.
    first: usize,
    of_part: Vec<usize>,
    fitted: Vec<Fitted>,
}

impl Job<'_> {
    pub(super) fn holds(&self, fits: &Fits, parts: Parts) -> bool {
        !fits.too_large(parts.clone()) && self.pack(fits, parts).is_some()
    }

    /// So little that packing need not be tried.
    pub(super) fn surely_holds(&self, fits: &Fits, parts: Parts) -> bool {
        let box_area =
            |cover: &Cover| cover.size.iter().map(|&side| f64::from(side + self.gutter)).product::<f64>();
        let half = self.page_size / 2;
        let covers = || parts.clone().flat_map(|p| &fits.of(p).covers);
        !fits.too_large(parts.clone())
            && covers().all(|cover| cover.size.iter().all(|&side| side <= half))
            && covers().map(box_area).sum::<f64>() <= 0.25 * f64::from(self.page_size).powi(2)
    }

    /// Sizes the charts of the given parts.
    pub(super) fn fit(&self, density: f64, parts: Parts) -> Fits {
        let key = |p: usize| (self.parts[p].shapes, self.parts[p].factor.to_bits());
        let mut keys: Vec<(usize, u64)> = parts.clone().map(key).collect();
        keys.sort_unstable();
        keys.dedup();
        let charts: usize = self.parts.iter().map(|part| self.shapes[part.shapes].charts.len()).sum();
        let crowded = charts > CROWD;
        let sized = |&(shapes, factor): &(usize, u64)| {
            self.fit_shapes(&self.shapes[shapes], density * f64::from_bits(factor), crowded)
        };
        let fitted = keys.par_iter().map(sized).collect();
        let of_part = parts.clone().map(|p| keys.partition_point(|&known| known < key(p))).collect();
        Fits { first: parts.start, of_part, fitted }
    }

    fn fit_shapes(&self, shapes: &Shapes, density: f64, crowded: bool) -> Fitted {
        let most = self.page_size - 1;
        let wanted = |metres: f64| metres * density;
        let long = |n: usize| wanted(shapes.charts[n].size_m.max_element()) >= f64::from(most) + 0.5;
        let short = |n: usize| wanted(shapes.charts[n].size_m.min_element()) > f64::from(most / STRIP);
        let charts = 0..shapes.charts.len();
        let too_large = charts.clone().any(|n| long(n) && short(n));
        let squeezed = charts.clone().any(long);
        let spans: Vec<[u16; 2]> = shapes.charts.iter().map(|shape| span(shape, density, most)).collect();
        let covers = match &self.woven[shapes.geometry] {
            Some(woven) if !too_large => charts
                .into_par_iter()
                .with_min_len(64)
                .map(|n| {
                    if crowded && spans[n].iter().all(|&side| side < TINY) {
                        return Cover::full(spans[n]);
                    }
                    let corners =
                        |&t: &u32| woven.unwrap.triangles[t as usize].map(|i| shapes.unit_uv[i as usize]);
                    Cover::of(&shapes.charts[n], spans[n], woven.charts[n].iter().map(corners))
                })
                .collect(),
            _ => Vec::new(),
        };
        Fitted { spans, covers, too_large, squeezed }
    }

    /// Spots for all charts of the given parts on one page.
    pub(super) fn pack(&self, fits: &Fits, parts: Parts) -> Option<Vec<Vec<Spot>>> {
        let room = (f64::from(self.page_size) + f64::from(self.gutter)).powi(2);
        if parts.clone().map(|p| fits.area(p, self.gutter)).sum::<f64>() > room {
            return None;
        }
        let mut items: Vec<(u32, u32, &Cover)> = Vec::new();
        for (n, p) in parts.clone().enumerate() {
            let covers = &fits.of(p).covers;
            items.extend(covers.iter().enumerate().map(|(c, cover)| (n as u32, c as u32, cover)));
        }
        let long = |cover: &Cover| u32::from(cover.size[0].max(cover.size[1]));
        let short = |cover: &Cover| u32::from(cover.size[0].min(cover.size[1]));
        type Order<'o> = &'o dyn Fn(&Cover) -> (u32, u32);
        let orders: [Order; 3] = [
            &|cover| (long(cover), short(cover)),
            &|cover| (long(cover) * short(cover), long(cover)),
            &|cover| (long(cover) + short(cover), long(cover)),
        ];
        let tries = if items.len() <= FEW { 3 } else { 1 };
        for order in &orders[..tries] {
            items.sort_by_key(|&(n, c, cover)| (std::cmp::Reverse(order(cover)), n, c));
            let mut page = Page::new(self.page_size, self.gutter);
            let blank = |p: usize| vec![Spot::default(); fits.of(p).covers.len()];
            let mut spots: Vec<Vec<Spot>> = parts.clone().map(blank).collect();
            let laid = items.iter().all(|&(n, c, cover)| match page.lay(cover) {
                Some(spot) => {
                    spots[n as usize][c as usize] = spot;
                    true
                }
                None => false,
            });
            if laid {
                return Some(spots);
            }
        }
        None
    }
}

impl Fits {
    pub fn of(&self, part: usize) -> &Fitted {
        &self.fitted[self.of_part[part - self.first]]
    }

    pub fn too_large(&self, mut parts: Parts) -> bool {
        parts.any(|p| self.of(p).too_large)
    }

    /// Texels that a part takes at the very least, gutters counted once.
    pub fn area(&self, part: usize, gutter: u16) -> f64 {
        let chart = |cover: &Cover| match &cover.mask {
            None => f64::from(cover.size[0] + gutter) * f64::from(cover.size[1] + gutter),
            Some(mask) => f64::from(mask.count),
        };
        self.of(part).covers.iter().map(chart).sum()
    }
}
