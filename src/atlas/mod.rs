//! Scene + plan -> every lit side's place in texture space.
//!
//! A geometry is unwrapped once; every surface that uses it is packed separately, at the density its world scale
//! asks for. All surfaces of one node share a page. Pages are square; hidden pages (`exported == false`) hold the
//! sides that reflect light but are never looked up.

use glam::Vec2;
use std::sync::Arc;

/// Charts of one geometry: which source vertices the split vertices copy, and which chart a triangle belongs to.
#[derive(Clone, Debug, Default)]
pub struct Unwrap {
    /// For each vertex of the unwrapped mesh, the geometry's vertex it copies.
    pub source_vertex: Vec<u32>,
    /// Vertex indices into the unwrapped mesh; same triangles in the same order and winding as the geometry's.
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
    /// Position of every vertex of the unwrapped mesh on the page, in texels from the top left corner.
    pub uv_texels: Vec<Vec2>,
    /// Smallest rectangle of the page that holds it, texels: `[min, max]`.
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
