//! Scene + plan -> every lit side's place in texture space.
//!
//! A geometry is unwrapped once; every surface that uses it is packed separately, at the density its world scale
//! asks for. All surfaces of one node share a page. Pages are square; hidden pages (`exported == false`) hold the
//! sides that reflect light but are never looked up.

mod charting;
mod check;
mod coverage;
mod fit;
mod flat;
mod layout;
mod metric;
mod overlap;
mod page;
mod second;
mod shape;
#[cfg(test)]
mod tests;
mod topology;
mod weave;
#[allow(unsafe_code)]
mod xatlas;

use crate::error::{Error, Result};
use crate::options::AtlasOptions;
use crate::plan::{Side, Sides};
use crate::progress::Progress;
use crate::scene::{Scene, Surface};
use glam::{DMat3, Vec2};
use layout::{Job, Laid, Layout, Part};
use rayon::prelude::*;
use shape::Shapes;
use std::collections::BTreeMap;
use std::sync::Arc;
use weave::Woven;

/// Charts of one geometry: which source vertices the split vertices copy, and which chart a triangle belongs to.
#[derive(Clone, Debug, Default)]
pub struct Unwrap {
    /// For each vertex of the unwrapped mesh, the geometry's vertex it copies. The first ones copy the geometry's
    /// vertices in order; where this is as long as the geometry's list, no vertex was split.
    pub source_vertex: Vec<u32>,
    /// Vertex indices into the unwrapped mesh; same triangles in the same order and winding as the geometry's. On the
    /// page each winds positively, u to the right and v down: (b − a) × (c − a) > 0, for fronts, backs and mirrored
    /// surfaces alike. Degenerate triangles shrink to a point.
    pub triangles: Vec<[u32; 3]>,
    /// Chart of each triangle, `0..chart_count`; degenerate triangles belong to any chart.
    pub chart_of_triangle: Vec<u32>,
    /// Number of charts.
    pub chart_count: u32,
}

/// Where one side of one surface lies.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Index into [`Atlas::pages`].
    pub page: u32,
    /// Shared by all placements of a geometry (at one scale class).
    pub unwrap: Arc<Unwrap>,
    /// Position of every vertex of the unwrapped mesh on the page, in texels from the top left corner; texel centres
    /// lie at halves. The box around a chart reaches from texel centre to texel centre, so bilinear lookups at straight
    /// borders need no texel beyond.
    pub uv_texels: Vec<Vec2>,
    /// Smallest rectangle of whole texels that holds all that bilinear lookups of it read: `[min, max]`.
    pub rect_texels: [Vec2; 2],
}

/// One square page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page {
    /// Width and height.
    pub size_texels: u32,
    /// Whether it is written as a lightmap.
    pub exported: bool,
}

/// Texture space of the whole scene.
#[derive(Clone, Debug, Default)]
pub struct Atlas {
    /// Exported pages first.
    pub pages: Vec<Page>,
    /// Front side of every surface of the scene; `None` when it takes no light.
    pub fronts: Vec<Option<Placement>>,
    /// Back side of every surface of the scene.
    pub backs: Vec<Option<Placement>>,
    /// Texels per metre that were used on exported pages.
    pub density: f32,
    /// Share of the exported pages' texels that charts cover, gutters not counted.
    pub fill: f32,
    /// How each geometry was unwrapped and what went wrong, by name.
    pub warnings: Vec<crate::error::Warning>,
}

/// Hidden sides get this share of the texels per metre of the written ones.
pub const HIDDEN_DENSITY: f64 = 0.25;
/// A side that is laid out: its surface, whether it is the back, and its charts.
type Listed = (usize, bool, Part);

/// Largest page that can be asked for.
const LARGEST_PAGE: u32 = 16384;

/// Unwraps every geometry that takes light once and lays all sides out on pages.
///
/// Charts end at hard edges. Each is scaled to equal area in the world, so non-uniform scales do not stretch texels,
/// and rounded to whole texels. Between the texels that bilinear lookups of any two charts read there are at least
/// `options.gutter` empty ones. Sides without any area get `None`.
///
/// The result depends on the input alone, except that a part of a mesh that takes xatlas or uvunwrap five minutes is
/// given up, which the warnings tell. Advances by one per geometry.
///
/// # Errors
/// [`Error::Cancelled`]; [`Error::Invalid`] for a page size or density that cannot be; [`Error::TooLarge`] when the
/// charts do not fit the pages however small they are.
pub fn unwrap(scene: &Scene, sides: &[Sides], options: &AtlasOptions, progress: &Progress) -> Result<Atlas> {
    validate(options)?;
    let mut warnings = Vec::new();
    let takes_light =
        |s: usize| sides.get(s).is_some_and(|side| [side.front, side.back].iter().any(|&x| x != Side::Dark));
    let mut wanted = vec![false; scene.geometries.len()];
    for (s, surface) in scene.surfaces.iter().enumerate() {
        wanted[surface.geometry.0 as usize] |= takes_light(s);
    }
    let woven = charting::charts(&scene.geometries, &wanted, progress, &mut warnings)?;
    let (shapes, shapes_of) = all_shapes(scene, &woven, &takes_light);
    let (nodes, node_of) = nodes(&scene.surfaces);
    let of_kind = |kind: Side| {
        let mut list: Vec<Listed> = Vec::new();
        for (s, surface) in scene.surfaces.iter().enumerate() {
            let (Some(side), Some(shapes)) = (sides.get(s), shapes_of[s]) else { continue };
            let asked = f64::from(surface.density_factor);
            let factor = if asked.is_finite() && asked > 0.0 { asked } else { 1.0 };
            for (back, what) in [(false, side.front), (true, side.back)] {
                if what == kind {
                    list.push((s, back, Part { node: node_of[s], shapes, factor }));
                }
            }
        }
        list.sort_by_key(|&(s, back, ref part)| (part.node, s, back));
        list
    };
    let written = of_kind(Side::Lightmapped);
    let parts = |list: &[Listed]| -> Vec<Part> { list.iter().map(|(.., part)| part.clone()).collect() };
    let written_parts = parts(&written);
    let job = Job {
        shapes: &shapes,
        woven: &woven,
        nodes: &nodes,
        parts: &written_parts,
        page_size: options.page_size as u16,
        gutter: options.gutter as u16,
        announced: true,
    };
    let exported = match (written.is_empty(), options.density) {
        (true, _) => Layout::default(),
        (false, Some(density)) => job.lay(f64::from(density), options.max_pages.max(1), progress)?,
        (false, None) => job.fill(options.max_pages.max(1), progress)?,
    };
    let unseen = |kind: Side| -> Result<(Vec<Listed>, Layout)> {
        let list = of_kind(kind);
        let parts = parts(&list);
        let job = Job { parts: &parts, announced: false, ..job };
        let laid = match (list.is_empty(), options.density.map(f64::from)) {
            (true, _) => Layout::default(),
            (false, _) if !written.is_empty() => {
                job.lay_tightly(exported.density * HIDDEN_DENSITY, progress)?
            }
            (false, Some(density)) => job.lay_tightly(density * HIDDEN_DENSITY, progress)?,
            (false, None) => {
                Job { page_size: (job.page_size / 4).max(64), ..job }.fill(u32::MAX, progress)?
            }
        };
        Ok((list, laid))
    };
    let ((hidden, unseen), (vain, in_vain)) = (unseen(Side::Hidden)?, unseen(Side::InVain)?);
    warnings.extend([&exported, &unseen, &in_vain].into_iter().flat_map(|laid| &laid.warnings).cloned());
    let pages_of = |laid: &Layout, exported: bool| -> Vec<(u16, bool)> {
        laid.pages.iter().map(|&size| (size, exported)).collect()
    };
    let pages = [pages_of(&exported, true), pages_of(&unseen, false), pages_of(&in_vain, false)].concat();
    let page_texels: f64 = exported.pages.iter().map(|&size| f64::from(size).powi(2)).sum();
    let mut atlas = Atlas {
        pages: pages
            .into_iter()
            .map(|(size, exported)| Page { size_texels: u32::from(size), exported })
            .collect(),
        fronts: vec![None; scene.surfaces.len()],
        backs: vec![None; scene.surfaces.len()],
        density: exported.density as f32,
        fill: if page_texels > 0.0 { (exported.texels as f64 / page_texels) as f32 } else { 0.0 },
        warnings,
    };
    let placed: Vec<(usize, bool, Placement)> = written
        .par_iter()
        .zip(&exported.parts)
        .map(|entry| (entry, 0))
        .chain(hidden.par_iter().zip(&unseen.parts).map(|entry| (entry, exported.pages.len())))
        .chain(
            vain.par_iter()
                .zip(&in_vain.parts)
                .map(|entry| (entry, exported.pages.len() + unseen.pages.len())),
        )
        .filter_map(|(((s, back, part), laid), first_page)| {
            let shapes = &shapes[part.shapes];
            Some((*s, *back, place(shapes, woven[shapes.geometry].as_ref()?, laid, first_page)))
        })
        .collect();
    for (s, back, placement) in placed {
        if back { &mut atlas.backs[s] } else { &mut atlas.fronts[s] }.replace(placement);
    }
    Ok(atlas)
}

fn validate(options: &AtlasOptions) -> Result<()> {
    if !(8..=LARGEST_PAGE).contains(&options.page_size) {
        let what = format!("must be from 8 to {LARGEST_PAGE} texels, not {}", options.page_size);
        return Err(Error::invalid("page size", what));
    }
    if options.gutter > options.page_size / 4 {
        let what = format!("must be at most a quarter of the page, not {} texels", options.gutter);
        return Err(Error::invalid("gutter", what));
    }
    match options.density {
        Some(density) if !(density.is_finite() && density > 0.0) => Err(Error::invalid(
            "density",
            format!("must be a positive number of texels per metre, not {density}"),
        )),
        _ => Ok(()),
    }
}

/// Shapes of every geometry at every scale it is used at, and which of them each surface uses.
fn all_shapes(
    scene: &Scene,
    woven: &[Option<Woven>],
    takes_light: &dyn Fn(usize) -> bool,
) -> (Vec<Shapes>, Vec<Option<usize>>) {
    let mut known: BTreeMap<(u32, [i64; 7]), usize> = BTreeMap::new();
    let mut classes: Vec<(usize, DMat3)> = Vec::new();
    let mut shapes_of = vec![None; scene.surfaces.len()];
    for (s, surface) in scene.surfaces.iter().enumerate() {
        let geometry = surface.geometry.0 as usize;
        if !takes_light(s) || woven[geometry].is_none() {
            continue;
        }
        let linear = surface.world_from_local.matrix3;
        let space = if linear.is_finite() { linear.transpose() * linear } else { DMat3::IDENTITY };
        let class = *known.entry((surface.geometry.0, scale_key(space))).or_insert_with(|| {
            classes.push((geometry, space));
            classes.len() - 1
        });
        shapes_of[s] = Some(class);
    }
    let shapes = classes
        .par_iter()
        .filter_map(|&(geometry, space)| {
            let woven = woven[geometry].as_ref()?;
            Some(Shapes::of(geometry, &scene.geometries[geometry], woven, space))
        })
        .collect();
    (shapes, shapes_of)
}

/// Equal for scales that differ by rounding only (about one part in 10⁵).
fn scale_key(space: DMat3) -> [i64; 7] {
    let entries =
        [space.x_axis.x, space.x_axis.y, space.x_axis.z, space.y_axis.y, space.y_axis.z, space.z_axis.z];
    let largest = entries.iter().fold(0.0f64, |m, e| m.max(e.abs()));
    let round = |x: f64| (x * 1e5).round() as i64;
    let [a, b, c, d, e, f] = entries.map(|entry| if largest > 0.0 { round(entry / largest) } else { 0 });
    [round(largest.max(f64::MIN_POSITIVE).ln()), a, b, c, d, e, f]
}

/// Names of the nodes in document order (instances count as nodes of their own), and the node of each surface.
fn nodes(surfaces: &[Surface]) -> (Vec<String>, Vec<usize>) {
    let mut known: BTreeMap<(usize, Option<usize>), usize> = BTreeMap::new();
    let mut names = Vec::new();
    let node_of = surfaces
        .iter()
        .map(|surface| {
            *known.entry((surface.origin.node, surface.origin.instance)).or_insert_with(|| {
                names.push(surface.origin.name.clone());
                names.len() - 1
            })
        })
        .collect();
    (names, node_of)
}

fn place(shapes: &Shapes, woven: &Woven, laid: &Laid, first_page: usize) -> Placement {
    let texel = |(unit, &chart): (&Vec2, &u32)| {
        let (span, spot) = (laid.spans[chart as usize], laid.spots[chart as usize]);
        let span = Vec2::new(f32::from(span[0]), f32::from(span[1]));
        let (at, size) = (*unit * span + 0.5, span + 1.0);
        let turned = match spot.turns {
            0 => at,
            1 => Vec2::new(size.y - at.y, at.x),
            2 => size - at,
            _ => Vec2::new(at.y, size.x - at.x),
        };
        turned + Vec2::new(f32::from(spot.x), f32::from(spot.y))
    };
    let (mut low, mut high) = (Vec2::INFINITY, Vec2::ZERO);
    for (span, spot) in laid.spans.iter().zip(&laid.spots) {
        let [w, h] = span.map(|texels| f32::from(texels) + 1.0);
        let first = Vec2::new(f32::from(spot.x), f32::from(spot.y));
        low = low.min(first);
        high = high.max(first + if spot.turns % 2 == 0 { Vec2::new(w, h) } else { Vec2::new(h, w) });
    }
    Placement {
        page: (first_page + laid.page) as u32,
        unwrap: Arc::clone(&woven.unwrap),
        uv_texels: shapes.unit_uv.iter().zip(&woven.chart_of_vertex).map(texel).collect(),
        rect_texels: [low, high],
    }
}
