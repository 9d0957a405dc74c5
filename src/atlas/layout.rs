//! Sides of surfaces -> pages: which page every node goes to, at which density, and where its charts lie.

use super::coverage::{Cover, span};
use super::page::{Page, Spot};
use super::shape::Shapes;
use super::weave::Woven;
use crate::error::{Error, Result, Warning};
use crate::progress::Progress;
use rayon::prelude::*;

/// One side of one surface that wants texels.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Index into [`Job::nodes`]; parts of a node share a page.
    pub node: usize,
    /// Index into [`Job::shapes`].
    pub shapes: usize,
    /// Multiplies the density.
    pub factor: f64,
}

/// Everything that is packed together.
pub(super) struct Job<'a> {
    pub shapes: &'a [Shapes],
    /// By geometry.
    pub woven: &'a [Option<Woven>],
    /// Names of the nodes.
    pub nodes: &'a [String],
    /// In order of their nodes.
    pub parts: &'a [Part],
    pub page_size: u16,
    pub gutter: u16,
    /// Whether a low density is worth a warning.
    pub announced: bool,
}

impl Clone for Job<'_> {
    fn clone(&self) -> Self {
        *self
    }
}

impl Copy for Job<'_> {}

/// Where one part lies.
#[derive(Clone, Debug, Default)]
pub(super) struct Laid {
    pub page: usize,
    /// Texels that each chart's box spans.
    pub spans: Vec<[u16; 2]>,
    pub spots: Vec<Spot>,
}

/// The result.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    /// Width and height of each page.
    pub pages: Vec<u16>,
    /// One per part of the job.
    pub parts: Vec<Laid>,
    /// Texels per metre.
    pub density: f64,
    /// Texels that charts touch.
    pub texels: u64,
    pub warnings: Vec<Warning>,
}

/// A chart this much narrower than a page may be squeezed along its length to fit; any other too long chart lowers
/// the density of its node instead.
const STRIP: u16 = 16;
/// Largest page that is ever made.
const LARGEST_PAGE: u16 = 16384;
/// Packs that the search for a density may take.
const PACKS: usize = 9;
/// The search ends when the density is known this well.
const CLOSE: f64 = 1.004;
/// With more charts than this one sorting order is tried, not all.
const FEW: usize = 600;

/// Charts of one part at one density.
struct Fitted {
    spans: Vec<[u16; 2]>,
    covers: Vec<Cover>,
    /// Some chart is too long for the page and no strip.
    too_large: bool,
    squeezed: bool,
}

/// Parts with equal charts share what is fitted.
struct Fits {
    of_part: Vec<usize>,
    fitted: Vec<Fitted>,
}

impl Job<'_> {
    /// Lays everything out at the density that fills `pages` pages well.
    pub fn fill(&self, pages: u32, progress: &Progress) -> Result<Layout> {
        let mut job = *self;
        let mut warnings = Vec::new();
        job.grow_page(&mut warnings)?;
        let mut allowed = 1;
        loop {
            if let Some(mut layout) = job.search(allowed, progress)? {
                layout.warnings = [warnings, layout.warnings].concat();
                return Ok(layout);
            }
            if allowed >= pages {
                break;
            }
            allowed = (allowed * 2).min(pages);
        }
        Err(too_much(pages))
    }

    /// Lays everything out at `density` texels per metre on at most `pages` pages; lowers the density where that
    /// does not do.
    pub fn lay(&self, density: f64, pages: u32, progress: &Progress) -> Result<Layout> {
        let mut job = *self;
        let mut warnings = Vec::new();
        job.grow_page(&mut warnings)?;
        let mut parts = self.parts.to_vec();
        job.lower_large_nodes(density, &mut parts, &mut warnings);
        let job = Job { parts: &parts, ..job };
        // Far too much is seen from the areas alone.
        let mut low = (1.1 * job.guess(pages) / density).min(1.0);
        loop {
            let used = job.spread(density * low, pages, progress)?;
            if let Some(mut layout) = used {
                if low < 1.0 && self.announced {
                    let what = format!(
                        "does not fit {pages} pages of {}² texels at {density} texels per metre; {:.4} were used. Allow \
                         more pages, larger pages, or lower the density",
                        job.page_size, layout.density
                    );
                    warnings.push(Warning::new("atlas", what));
                }
                layout.warnings = [warnings, layout.warnings].concat();
                return Ok(layout);
            }
            low *= 0.92;
            if low < 1e-6 {
                return Err(too_much(pages));
            }
        }
    }

    /// Lays everything out like [`Self::lay`] and makes a lone page no larger than it must be.
    pub fn lay_tightly(&self, density: f64, progress: &Progress) -> Result<Layout> {
        let layout = self.lay(density, u32::MAX, progress)?;
        let longest = layout.parts.iter().flat_map(|part| &part.spans).flatten().max().copied().unwrap_or(1);
        let least = (layout.texels as f64).sqrt() * 1.05;
        let (&[page], true) = (&layout.pages[..], layout.density == density) else { return Ok(layout) };
        let mut side = least.max(f64::from(longest) + 1.0);
        while side < f64::from(page) {
            let job = Job { page_size: (side.ceil() as u16).next_multiple_of(16).min(page), ..*self };
            if let Some(smaller) = job.spread(density, 1, progress)? {
                return Ok(smaller);
            }
            side *= 1.1;
        }
        Ok(layout)
    }

    /// Doubles the page until every node fits one with all its charts at their smallest.
    fn grow_page(&mut self, warnings: &mut Vec<Warning>) -> Result<()> {
        for node in self.by_node() {
            let charts: usize = node.iter().map(|&p| self.shapes[self.parts[p].shapes].charts.len()).sum();
            let side = 2 + usize::from(self.gutter);
            let fits = |size: u16| ((usize::from(size) + usize::from(self.gutter)) / side).pow(2) >= charts;
            let before = self.page_size;
            while !fits(self.page_size) && self.page_size < LARGEST_PAGE {
                self.page_size = (self.page_size * 2).min(LARGEST_PAGE);
            }
            let name = &self.nodes[self.parts[node[0]].node];
            if !fits(self.page_size) {
                return Err(Error::TooLarge {
                    what: format!(
                        "has {charts} charts, more than one page of {LARGEST_PAGE}² texels holds. Merge vertices so that \
                         triangles share edges, or split the object"
                    ),
                    at: name.clone(),
                });
            }
            if before != self.page_size && self.announced {
                let what = format!(
                    "has {charts} charts, more than a page of {before}² texels holds; pages of {}² are made instead",
                    self.page_size
                );
                warnings.push(Warning::new(name, what));
            }
        }
        Ok(())
    }

    /// Runs of parts that belong to one node.
    fn by_node(&self) -> Vec<Vec<usize>> {
        let all: Vec<usize> = (0..self.parts.len()).collect();
        all.chunk_by(|&a, &b| self.parts[a].node == self.parts[b].node).map(<[usize]>::to_vec).collect()
    }

    /// Lowers the density of each node that would not fit an empty page.
    fn lower_large_nodes(&self, density: f64, parts: &mut [Part], warnings: &mut Vec<Warning>) {
        let lowered: Vec<(Vec<usize>, f64)> = self
            .by_node()
            .into_par_iter()
            .map(|node| {
                let fits = |low: f64| {
                    let fits = self.fit(density * low, &node);
                    !fits.too_large(&node) && self.pack(&fits, &node).is_some()
                };
                if fits(1.0) {
                    return (node, 1.0);
                }
                let (mut low, mut high) = (1.0, 1.0);
                while !fits(low) && low > 1e-9 {
                    (low, high) = (low * 0.5, low);
                }
                for _ in 0..6 {
                    let middle = 0.5 * (low + high);
                    if fits(middle) { low = middle } else { high = middle }
                }
                (node, low)
            })
            .collect();
        for (node, low) in lowered.into_iter().filter(|&(_, low)| low < 1.0) {
            node.iter().for_each(|&p| parts[p].factor *= low);
            if self.announced {
                let what = format!(
                    "is too large for a page of {}² texels at {density} texels per metre; {:.4} were used for it. \
                     Make pages larger, or split the object",
                    self.page_size,
                    density * low
                );
                warnings.push(Warning::new(&self.nodes[parts[node[0]].node], what));
            }
        }
    }

    /// The highest density at which `pages` pages hold everything; `None` when none does.
    fn search(&self, pages: u32, progress: &Progress) -> Result<Option<Layout>> {
        let mut best: Option<Layout> = None;
        let (mut low, mut high): (f64, f64) = (0.0, f64::INFINITY);
        let mut density = self.guess(pages);
        for _ in 0..PACKS {
            let found = self.spread(density, pages, progress)?;
            let fits = found.as_ref().is_some_and(|layout| layout.density == density);
            if fits {
                low = density;
                best = found;
            } else {
                high = density;
            }
            if low * CLOSE >= high || !density.is_normal() {
                break;
            }
            density = match (low > 0.0, high.is_finite()) {
                (true, true) => 0.5 * (low + high),
                (true, false) => density * 1.05,
                _ => density * 0.9,
            };
        }
        if best.is_none() {
            // Even where every chart is as small as it gets.
            let mut density = high;
            for _ in 0..40 {
                density *= 0.5;
                best = self.spread(density, pages, progress)?;
                if best.is_some() {
                    break;
                }
            }
        }
        Ok(best)
    }

    /// The density at which the charts' boxes and gutters would cover most of the pages.
    fn guess(&self, pages: u32) -> f64 {
        let gutter = f64::from(self.gutter);
        let room = 0.92 * f64::from(pages) * f64::from(self.page_size).powi(2);
        let longest = f64::from(self.page_size);
        let need = |density: f64| -> f64 {
            let part = |part: &Part| -> f64 {
                let chart = |shape: &super::shape::Shape| {
                    let side =
                        |metres: f64| (metres * density * part.factor).clamp(1.0, longest) + 1.0 + gutter;
                    side(shape.size_m.x) * side(shape.size_m.y) * if shape.filled { 1.0 } else { 0.8 }
                };
                self.shapes[part.shapes].charts.iter().map(chart).sum()
            };
            self.parts.iter().map(part).sum()
        };
        // Between nothing and so much that the longest chart fills a page.
        let largest = self
            .parts
            .iter()
            .flat_map(|part| {
                self.shapes[part.shapes].charts.iter().map(|c| c.size_m.max_element() * part.factor)
            })
            .fold(0.0, f64::max);
        let (mut low, mut high) = (0.0, if largest > 0.0 { longest * 16.0 / largest } else { 1.0 });
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if need(middle) <= room { low = middle } else { high = middle }
        }
        // Mostly so small that all charts have their least size.
        if low > 0.0 { low } else { high }
    }

    /// Spreads the nodes over at most `pages` pages, in their order, as many on each as fit.
    fn spread(&self, density: f64, pages: u32, progress: &Progress) -> Result<Option<Layout>> {
        let all: Vec<usize> = (0..self.parts.len()).collect();
        let fits = self.fit(density, &all);
        if fits.too_large(&all) {
            return Ok(None);
        }
        let nodes = self.by_node();
        let mut layout =
            Layout { density, parts: vec![Laid::default(); self.parts.len()], ..Layout::default() };
        let mut first = 0;
        while first < nodes.len() {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            if layout.pages.len() as u32 == pages {
                return Ok(None);
            }
            // The last page must hold the rest; before it as many nodes as fit.
            let last_page = layout.pages.len() as u32 + 1 == pages;
            let rest = nodes.len() - first;
            let take = |count: usize| nodes[first..first + count].concat();
            let attempt = |count: usize| self.pack(&fits, &take(count)).map(|spots| (count, spots));
            let mut found = attempt(rest);
            if found.is_none() && !last_page {
                let (mut low, mut high) = (0, rest);
                while high - low > 1 {
                    let middle =
                        if low == 0 { self.likely(&fits, &nodes[first..], high) } else { (low + high) / 2 };
                    match attempt(middle) {
                        Some(better) => {
                            low = middle;
                            found = Some(better);
                        }
                        None => high = middle,
                    }
                }
            }
            let Some((count, spots)) = found else { return Ok(None) };
            for (p, spots) in take(count).into_iter().zip(spots) {
                let fitted = &fits.fitted[fits.of_part[p]];
                layout.texels += fitted.covers.iter().map(|cover| u64::from(cover.texels())).sum::<u64>();
                layout.parts[p] = Laid { page: layout.pages.len(), spans: fitted.spans.clone(), spots };
            }
            layout.pages.push(self.page_size);
            first += count;
        }
        if self.announced {
            layout.warnings = self.squeezed(&fits);
        }
        Ok(Some(layout))
    }

    /// How many of the nodes will about fill a page; at least 1, less than `below`.
    fn likely(&self, fits: &Fits, nodes: &[Vec<usize>], below: usize) -> usize {
        let room = 0.8 * f64::from(self.page_size).powi(2);
        let mut used = 0.0;
        let mut count = 0;
        for node in nodes {
            used += node.iter().map(|&p| fits.area(p, self.gutter)).sum::<f64>();
            if used > room {
                break;
            }
            count += 1;
        }
        count.clamp(1, below - 1)
    }

    fn squeezed(&self, fits: &Fits) -> Vec<Warning> {
        let mut nodes: Vec<usize> = (0..self.parts.len())
            .filter(|&p| fits.fitted[fits.of_part[p]].squeezed)
            .map(|p| self.parts[p].node)
            .collect();
        nodes.dedup();
        let what = format!(
            "has a long narrow part that no page of {}² texels holds; it gets fewer texels along its length",
            self.page_size
        );
        nodes.into_iter().map(|node| Warning::new(&self.nodes[node], &what)).collect()
    }

    /// Sizes the charts of the given parts.
    fn fit(&self, density: f64, parts: &[usize]) -> Fits {
        let mut keys: Vec<(usize, u64)> =
            parts.iter().map(|&p| (self.parts[p].shapes, self.parts[p].factor.to_bits())).collect();
        keys.sort_unstable();
        keys.dedup();
        let fitted = keys
            .par_iter()
            .map(|&(shapes, factor)| self.fit_shapes(&self.shapes[shapes], density * f64::from_bits(factor)))
            .collect();
        let mut of_part = vec![usize::MAX; self.parts.len()];
        for &p in parts {
            let key = (self.parts[p].shapes, self.parts[p].factor.to_bits());
            of_part[p] = keys.binary_search(&key).unwrap_or(0);
        }
        Fits { of_part, fitted }
    }

    fn fit_shapes(&self, shapes: &Shapes, density: f64) -> Fitted {
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
    fn pack(&self, fits: &Fits, parts: &[usize]) -> Option<Vec<Vec<Spot>>> {
        let room = (f64::from(self.page_size) + f64::from(self.gutter)).powi(2);
        if parts.iter().map(|&p| fits.area(p, self.gutter)).sum::<f64>() > room {
            return None;
        }
        let mut items: Vec<(u32, u32, &Cover)> = Vec::new();
        for (n, &p) in parts.iter().enumerate() {
            let covers = &fits.fitted[fits.of_part[p]].covers;
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
            let mut spots: Vec<Vec<Spot>> = parts
                .iter()
                .map(|&p| vec![Spot::default(); fits.fitted[fits.of_part[p]].covers.len()])
                .collect();
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
    fn too_large(&self, parts: &[usize]) -> bool {
        parts.iter().any(|&p| self.fitted[self.of_part[p]].too_large)
    }

    /// Texels that a part takes at the very least, gutters counted once.
    fn area(&self, part: usize, gutter: u16) -> f64 {
        let chart = |cover: &Cover| match &cover.mask {
            None => f64::from(cover.size[0] + gutter) * f64::from(cover.size[1] + gutter),
            Some(mask) => f64::from(mask.count),
        };
        self.fitted[self.of_part[part]].covers.iter().map(chart).sum()
    }
}

fn too_much(pages: u32) -> Error {
    Error::TooLarge {
        what: format!(
            "the charts do not fit {pages} pages even at the lowest density. Allow more or larger pages, or merge \
             vertices so that triangles share edges"
        ),
        at: "atlas".into(),
    }
}
