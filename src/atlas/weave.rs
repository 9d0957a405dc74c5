//! Charts of a geometry -> one mesh whose vertices are split where charts meet.

use super::Unwrap;
use super::flat::RawChart;
use super::topology::Topology;
use crate::scene::Geometry;
use glam::Vec2;
use std::sync::Arc;

const NONE: u32 = u32::MAX;

/// An unwrapped geometry before it has a place.
#[derive(Clone, Debug)]
pub(super) struct Woven {
    pub unwrap: Arc<Unwrap>,
    /// Flattened position of every vertex of the unwrapped mesh, in its chart's own units.
    pub uv: Vec<Vec2>,
    /// Chart of every vertex.
    pub chart_of_vertex: Vec<u32>,
    /// Triangles with area of each chart, ascending.
    pub charts: Vec<Vec<u32>>,
}

/// The first vertices of the result copy the geometry's vertices in order, so a geometry that no chart border splits
/// keeps its numbering. Degenerate triangles shrink to a point of a chart they touch. `None` without charts.
pub(super) fn weave(geometry: &Geometry, topology: &Topology, mut charts: Vec<RawChart>) -> Option<Woven> {
    charts.sort_by_key(|chart| chart.triangles.iter().min().copied());
    if charts.is_empty() {
        return None;
    }
    let mut mesh = Mesh::new(geometry);
    for (n, chart) in charts.iter().enumerate() {
        for (&t, uv) in chart.triangles.iter().zip(&chart.corner_uv) {
            let corners = geometry.triangles[t as usize];
            mesh.triangles[t as usize] = [0, 1, 2].map(|k| mesh.vertex(corners[k], n as u32, uv[k]));
            mesh.chart_of_triangle[t as usize] = n as u32;
        }
    }
    let anchor = mesh.triangles[charts[0].triangles[0] as usize][0];
    for t in (0..geometry.triangles.len()).filter(|&t| topology.area[t] == 0.0) {
        let corners = geometry.triangles[t];
        let known =
            corners.into_iter().find(|&i| mesh.chart_of_vertex.get(i as usize).is_some_and(|&c| c != NONE));
        let at = known.unwrap_or(anchor) as usize;
        let (chart, uv) = (mesh.chart_of_vertex[at], mesh.uv[at]);
        let last = geometry.position_local.len() as u32 - 1;
        mesh.triangles[t] = corners.map(|i| mesh.vertex(i.min(last), chart, uv));
        mesh.chart_of_triangle[t] = chart;
    }
    let (chart, uv) = (mesh.chart_of_vertex[anchor as usize], mesh.uv[anchor as usize]);
    for i in 0..geometry.position_local.len() {
        if mesh.chart_of_vertex[i] == NONE {
            (mesh.chart_of_vertex[i], mesh.uv[i]) = (chart, uv);
        }
    }
    let unwrap = Unwrap {
        source_vertex: mesh.source_vertex,
        triangles: mesh.triangles,
        chart_of_triangle: mesh.chart_of_triangle,
        chart_count: charts.len() as u32,
    };
    let charts = charts.into_iter().map(|mut chart| {
        chart.triangles.sort_unstable();
        chart.triangles
    });
    Some(Woven {
        unwrap: Arc::new(unwrap),
        uv: mesh.uv,
        chart_of_vertex: mesh.chart_of_vertex,
        charts: charts.collect(),
    })
}

struct Mesh {
    source_vertex: Vec<u32>,
    uv: Vec<Vec2>,
    chart_of_vertex: Vec<u32>,
    /// Next copy of the same source vertex.
    next_copy: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    chart_of_triangle: Vec<u32>,
}

impl Mesh {
    fn new(geometry: &Geometry) -> Self {
        let (vertices, triangles) = (geometry.position_local.len(), geometry.triangles.len());
        Self {
            source_vertex: (0..vertices as u32).collect(),
            uv: vec![Vec2::ZERO; vertices],
            chart_of_vertex: vec![NONE; vertices],
            next_copy: vec![NONE; vertices],
            triangles: vec![[0; 3]; triangles],
            chart_of_triangle: vec![0; triangles],
        }
    }

    /// The copy of a source vertex that lies at `uv` of `chart`. The newest copies are looked at first, and only those
    /// of this chart: charts come one after the other, so a vertex with very many copies costs no more than another.
    fn vertex(&mut self, source: u32, chart: u32, uv: Vec2) -> u32 {
        let first = source as usize;
        if self.chart_of_vertex[first] == NONE {
            (self.chart_of_vertex[first], self.uv[first]) = (chart, uv);
            return source;
        }
        if self.chart_of_vertex[first] == chart && self.uv[first] == uv {
            return source;
        }
        let newest = self.next_copy[first];
        let mut at = newest;
        while at != NONE && self.chart_of_vertex[at as usize] == chart {
            if self.uv[at as usize] == uv {
                return at;
            }
            at = self.next_copy[at as usize];
        }
        let copy = self.uv.len() as u32;
        self.next_copy[first] = copy;
        self.source_vertex.push(source);
        self.uv.push(uv);
        self.chart_of_vertex.push(chart);
        self.next_copy.push(newest);
        copy
    }
}
