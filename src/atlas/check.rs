//! Whether a flattened chart can hold a lightmap.

use super::flat::RawChart;
use super::metric::Metric;
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
    if overlaps(&chart.corner_uv, 0.5 * total.abs()) { Err(Fault::Overlaps) } else { Ok(()) }
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

/// Samples a mean triangle gets when overlaps are looked for.
const SAMPLES_PER_TRIANGLE: f64 = 64.0;
/// Most samples of a chart's bounding box.
const MOST_SAMPLES: f64 = 16_777_216.0;

/// Whether a sample is inside two triangles. Triangles that share an edge never share a sample: the edge's equation
/// is evaluated the same way round for both, and a sample on it belongs to one.
pub(super) fn overlaps(triangles: &[[glam::Vec2; 3]], area: f64) -> bool {
    // Two positive triangles that share an edge lie on its two sides; one cannot overlap itself.
    if triangles.len() <= 2 {
        return false;
    }
    let points = || triangles.iter().flatten().map(|uv| uv.as_dvec2());
    let low = points().fold(DVec2::INFINITY, DVec2::min);
    let size = points().fold(DVec2::NEG_INFINITY, DVec2::max) - low;
    let wanted = (SAMPLES_PER_TRIANGLE * triangles.len() as f64 / area).sqrt();
    let most = (MOST_SAMPLES / (size.x * size.y)).sqrt();
    let scale = wanted.min(most).min(32768.0 / size.max_element());
    let columns = (size.x * scale) as usize + 1;
    let rows = (size.y * scale) as usize + 1;
    let mut seen = vec![0u64; (columns * rows).div_ceil(64)];
    for corners in triangles {
        let p = corners.map(|uv| (uv.as_dvec2() - low) * scale - 0.5);
        let first = p[0].min(p[1]).min(p[2]).ceil().max(DVec2::ZERO);
        let last = p[0].max(p[1]).max(p[2]).floor().min(DVec2::new(columns as f64, rows as f64) - 1.0);
        let edges = [Edge::new(p[0], p[1]), Edge::new(p[1], p[2]), Edge::new(p[2], p[0])];
        let mut y = first.y;
        while y <= last.y {
            let mut x = first.x;
            while x <= last.x {
                if edges.iter().all(|edge| edge.holds(DVec2::new(x, y))) {
                    let n = y as usize * columns + x as usize;
                    if seen[n / 64] >> (n % 64) & 1 == 1 {
                        return true;
                    }
                    seen[n / 64] |= 1 << (n % 64);
                }
                x += 1.0;
            }
            y += 1.0;
        }
    }
    false
}

/// An edge with the triangle to its left.
struct Edge {
    from: DVec2,
    along: DVec2,
    /// −1 when the edge was turned round to be evaluated like its twin.
    sign: f64,
    owns_border: bool,
}

impl Edge {
    fn new(a: DVec2, b: DVec2) -> Self {
        let ordered = (a.x, a.y) <= (b.x, b.y);
        let (from, to, sign) = if ordered { (a, b, 1.0) } else { (b, a, -1.0) };
        Self { from, along: to - from, sign, owns_border: ordered }
    }

    fn holds(&self, p: DVec2) -> bool {
        let side = self.along.perp_dot(p - self.from) * self.sign;
        side > 0.0 || (side == 0.0 && self.owns_border)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    fn fan(turns: f32, n: usize) -> Vec<[Vec2; 3]> {
        let at = |k: usize| Vec2::from_angle(turns * std::f32::consts::TAU * k as f32 / n as f32);
        (0..n).map(|k| [Vec2::ZERO, at(k), at(k + 1)]).collect()
    }

    #[test]
    fn a_fan_that_closes_does_not_overlap_and_one_that_goes_on_does() {
        assert!(!overlaps(&fan(1.0, 31), 3.1));
        assert!(!overlaps(&fan(0.9, 31), 2.8));
        assert!(overlaps(&fan(1.2, 31), 3.1));
        assert!(overlaps(&fan(2.0, 31), 6.2));
    }

    #[test]
    fn a_long_thin_strip_is_sampled_by_its_area() {
        let strip = |lift: f32| {
            let at = move |k: i32| Vec2::new(k as f32, k as f32 + lift * (k % 2) as f32);
            (0..999).map(move |k| {
                if k % 2 == 0 { [at(k), at(k + 2), at(k + 1)] } else { [at(k), at(k + 1), at(k + 2)] }
            })
        };
        let once: Vec<_> = strip(0.1).collect();
        assert!(!overlaps(&once, 99.0));
        let twice: Vec<_> = strip(0.1).chain(strip(0.1)).collect();
        assert!(overlaps(&twice, 198.0));
    }
}
