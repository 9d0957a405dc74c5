//! Sides of surfaces -> pages: which page every node goes to, at which density, and where its charts lie.

use super::fit::Fits;
use super::page::Spot;
use super::shape::Shapes;
use super::weave::Woven;
use crate::error::{Error, Result, Warning};
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;

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

/// Parts of one node, or of several that follow each other.
pub(super) type Parts = Range<usize>;

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

/// Largest page that is ever made.
const LARGEST_PAGE: u16 = 16384;
/// Packs that the search for a density may take.
const PACKS: usize = 9;
/// A density this many times the one that fills all pages is as good as endless.
const ABSURD: f64 = 1e6;
/// More than this an f32 may not hold when the search went up from it.
const HIGHEST: f64 = f32::MAX as f64 / 2.0;
/// The search ends when the density is known this well.
const CLOSE: f64 = 1.01;
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
        // Searched downwards from what no pages could hold, the density that fits would not be found.
        let asked = density;
        let density = asked.min(ABSURD * job.guess(pages));
        job.lower_large_nodes(density, &mut parts, &mut warnings);
        let job = Job { parts: &parts, ..job };
        // Far too much is seen from the areas alone.
        let mut low = (1.1 * job.guess(pages) / density).min(1.0);
        loop {
            let used = job.spread(density * low, pages, progress)?;
            if let Some(mut layout) = used {
                if layout.density < asked && self.announced {
                    let what = format!(
                        "does not fit {pages} pages of {}² texels at {asked} texels per metre; {:.4} were used. Allow \
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
            let charts: usize =
                self.parts[node.clone()].iter().map(|part| self.shapes[part.shapes].charts.len()).sum();
            let side = 2 + usize::from(self.gutter);
            let fits = |size: u16| ((usize::from(size) + usize::from(self.gutter)) / side).pow(2) >= charts;
            let before = self.page_size;
            while !fits(self.page_size) && self.page_size < LARGEST_PAGE {
                self.page_size = (self.page_size * 2).min(LARGEST_PAGE);
            }
            let name = &self.nodes[self.parts[node.start].node];
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

    /// Parts of each node.
    fn by_node(&self) -> Vec<Parts> {
        let mut nodes: Vec<Parts> = Vec::new();
        for (p, part) in self.parts.iter().enumerate() {
            match nodes.last_mut() {
                Some(last) if self.parts[last.start].node == part.node => last.end = p + 1,
                _ => nodes.push(p..p + 1),
            }
        }
        nodes
    }

    /// Lowers the density of each node that would not fit an empty page.
    fn lower_large_nodes(&self, density: f64, parts: &mut [Part], warnings: &mut Vec<Warning>) {
        let all = self.fit(density, 0..self.parts.len());
        let lowered: Vec<(Parts, f64)> = self
            .by_node()
            .into_par_iter()
            .map(|node| {
                let fits = |low: f64| self.holds(&self.fit(density * low, node.clone()), node.clone());
                if self.surely_holds(&all, node.clone()) || self.holds(&all, node.clone()) {
                    return (node, 1.0);
                }
                let (mut low, mut high) = (1.0, 1.0);
                while low > 1e-9 && (high == low || !fits(low)) {
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
            parts[node.clone()].iter_mut().for_each(|part| part.factor *= low);
            if self.announced {
                let what = format!(
                    "is too large for a page of {}² texels at {density} texels per metre; {:.4} were used for it. \
                     Make pages larger, or split the object",
                    self.page_size,
                    density * low
                );
                warnings.push(Warning::new(&self.nodes[parts[node.start].node], what));
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
            if found.is_some() {
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
        let most = if largest > 0.0 { (longest * 16.0 / largest).min(HIGHEST) } else { 1.0 };
        let (mut low, mut high) = (0.0, most);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if need(middle) <= room { low = middle } else { high = middle }
        }
        // Mostly so small that all charts have their least size.
        if low > 0.0 { low } else { high }
    }

    /// Spreads the nodes over at most `pages` pages, in their order, as many on each as fit.
    fn spread(&self, density: f64, pages: u32, progress: &Progress) -> Result<Option<Layout>> {
        let fits = self.fit(density, 0..self.parts.len());
        if fits.too_large(0..self.parts.len()) {
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
            let take = |count: usize| nodes[first].start..nodes[first + count - 1].end;
            let attempt = |count: usize| self.pack(&fits, take(count)).map(|spots| (count, spots));
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
            for (p, spots) in take(count).zip(spots) {
                let fitted = fits.of(p);
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
    fn likely(&self, fits: &Fits, nodes: &[Parts], below: usize) -> usize {
        let room = 0.8 * f64::from(self.page_size).powi(2);
        let mut used = 0.0;
        let mut count = 0;
        for node in nodes {
            used += node.clone().map(|p| fits.area(p, self.gutter)).sum::<f64>();
            if used > room {
                break;
            }
            count += 1;
        }
        count.clamp(1, below - 1)
    }

    fn squeezed(&self, fits: &Fits) -> Vec<Warning> {
        let mut nodes: Vec<usize> =
            (0..self.parts.len()).filter(|&p| fits.of(p).squeezed).map(|p| self.parts[p].node).collect();
        nodes.dedup();
        let what = format!(
            "has a long narrow part that no page of {}² texels holds; it gets fewer texels along its length",
            self.page_size
        );
        nodes.into_iter().map(|node| Warning::new(&self.nodes[node], &what)).collect()
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
