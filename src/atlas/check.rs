//! Whether a flattened chart can hold a lightmap.

use super::flat::RawChart;
use super::metric::Metric;
use super::overlap;
use super::topology::Topology;
use crate::scene::Geometry;
use glam::{DMat3, DVec2};

/// Along no direction may a triangle be stretched or squeezed by more than this against the chart's mean...
pub(super) const STRETCH_LIMIT: f64 = 4.0;
/// ...unless it is smaller than this share of the chart: rounding may do as it likes with a crumb.
pub(super) const CRUMB: f64 = 1e-6;

/// What is wrong with a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    NotFinite,
    /// Triangles of both windings, or without area.
    Turned,
    /// Some triangle is stretched beyond [`STRETCH_LIMIT`].
    Stretched,
    /// Two triangles cover the same place.
    Overlaps,
}

/// Checks a chart; a mirrored one is mirrored back, so that afterwards all triangles wind positively.
pub(super) fn check(geometry: &Geometry, topology: &Topology, chart: &mut RawChart) -> Result<(), Fault> {
    if chart.triangles.is_empty() || !chart.corner_uv.iter().flatten().all(|uv| uv.is_finite()) {
        return Err(Fault::NotFinite);
    }
    let total: f64 = chart.corner_uv.iter().map(|&corners| doubled_area(corners.map(|c| c.as_dvec2()))).sum();
    if total < 0.0 {
        chart.corner_uv.iter_mut().flatten().for_each(|uv| uv.x = -uv.x);
    }
    if !chart.corner_uv.iter().all(|&corners| doubled_area(corners.map(|c| c.as_dvec2())) > 0.0) {
        return Err(Fault::Turned);
    }
    stretch(geometry, topology, chart)?;
    if overlap::any(&chart.corner_uv) { Err(Fault::Overlaps) } else { Ok(()) }
}

fn doubled_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

fn stretch(geometry: &Geometry, topology: &Topology, chart: &RawChart) -> Result<(), Fault> {
    let metrics: Option<Vec<(Metric, f64, f64)>> = chart
        .triangles
        .iter()
        .zip(&chart.corner_uv)
        .map(|(&t, flat)| {
            let corners =
                geometry.triangles[t as usize].map(|i| geometry.position_local[i as usize].as_dvec3());
            let metric = Metric::of(corners, flat.map(|uv| uv.as_dvec2()), DMat3::IDENTITY)?;
            Some((metric, topology.area[t as usize], doubled_area(flat.map(|uv| uv.as_dvec2()))))
        })
        .collect();
    let metrics = metrics.ok_or(Fault::Turned)?;
    let total: f64 = metrics.iter().map(|&(_, area, _)| area).sum();
    let mut mean = Metric::default();
    let flat: f64 = metrics.iter().map(|&(_, _, flat)| flat).sum();
    metrics.iter().for_each(|&(metric, _, share)| mean.add(metric, share / flat));
    let back = mean.root().ok_or(Fault::NotFinite)?.inverse();
    let limit = STRETCH_LIMIT * STRETCH_LIMIT;
    let fits = |&(metric, area, _): &(Metric, f64, f64)| {
        let [low, high] = metric.through(back).eigenvalues();
        area < CRUMB * total || (low * limit >= 1.0 && high <= limit)
    };
    if metrics.iter().all(fits) { Ok(()) } else { Err(Fault::Stretched) }
}
