//! Charts under a surface's scale: turned, stretched and sized as the world sees them.

use super::metric::Metric;
use super::weave::Woven;
use crate::scene::Geometry;
use glam::{DMat3, DVec2, Vec2};
use rayon::prelude::*;

/// A chart's outline in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// Width and height of its box, world metres at equal area.
    pub size_m: DVec2,
    /// Whether it fills its box.
    pub filled: bool,
}

/// All charts of a geometry under one scale; shared by the surfaces that only turn and move it.
#[derive(Clone, Debug)]
pub(super) struct Shapes {
    /// Index of the geometry.
    pub geometry: usize,
    /// Position of every vertex of the unwrapped mesh in its chart's box, `[0, 1]²`.
    pub unit_uv: Vec<Vec2>,
    /// One per chart.
    pub charts: Vec<Shape>,
}

/// Largest share of its box that a chart may leave empty and still count as a rectangle.
const FILLED: f64 = 1e-4;
/// Most directions that are tried for the smallest box.
const DIRECTIONS: usize = 128;

impl Shapes {
    /// Shapes of a geometry's charts where a step `d` of its local space is √(d·space·d) metres of the world.
    pub fn of(geometry_index: usize, geometry: &Geometry, woven: &Woven, space: DMat3) -> Self {
        let mut unit_uv = vec![Vec2::ZERO; woven.uv.len()];
        let outlines: Vec<(Shape, Vec<(u32, Vec2)>)> =
            woven.charts.par_iter().map(|triangles| outline(geometry, woven, triangles, space)).collect();
        let mut charts = Vec::with_capacity(outlines.len());
        let mut anchor = vec![Vec2::ZERO; outlines.len()];
        for (n, (shape, vertices)) in outlines.into_iter().enumerate() {
            charts.push(shape);
            anchor[n] = vertices.first().map_or(Vec2::ZERO, |&(_, uv)| uv);
            vertices.into_iter().for_each(|(i, uv)| unit_uv[i as usize] = uv);
        }
        place_strays(woven, &anchor, &mut unit_uv);
        Self { geometry: geometry_index, unit_uv, charts }
    }
}

/// Vertices of degenerate triangles and of none lie where a vertex of a real triangle lies.
fn place_strays(woven: &Woven, anchor: &[Vec2], unit_uv: &mut [Vec2]) {
    let mut real = vec![false; unit_uv.len()];
    for &t in woven.charts.iter().flatten() {
        woven.unwrap.triangles[t as usize].iter().for_each(|&i| real[i as usize] = true);
    }
    if real.iter().all(|&real| real) {
        return;
    }
    let mut spots: Vec<(u32, [u32; 2], u32)> = Vec::new();
    let key = |i: usize| (woven.chart_of_vertex[i], woven.uv[i].to_array().map(f32::to_bits));
    for i in (0..real.len()).filter(|&i| real[i]) {
        let (chart, uv) = key(i);
        spots.push((chart, uv, i as u32));
    }
    spots.par_sort_unstable();
    for i in (0..real.len()).filter(|&i| !real[i]) {
        let wanted = key(i);
        let at = spots.partition_point(|&(chart, uv, _)| (chart, uv) < wanted);
        unit_uv[i] = match spots.get(at) {
            Some(&(chart, uv, twin)) if (chart, uv) == wanted => unit_uv[twin as usize],
            _ => anchor[wanted.0 as usize],
        };
    }
}

fn outline(geometry: &Geometry, woven: &Woven, triangles: &[u32], space: DMat3) -> (Shape, Vec<(u32, Vec2)>) {
    let mut mean = Metric::default();
    let (mut area_m2, mut flat_area) = (0.0, 0.0);
    for &t in triangles {
        let corners = geometry.triangles[t as usize].map(|i| geometry.position_local[i as usize].as_dvec3());
        let flat = woven.unwrap.triangles[t as usize].map(|i| woven.uv[i as usize].as_dvec2());
        let Some(metric) = Metric::of(corners, flat, space) else { continue };
        let doubled = (flat[1] - flat[0]).perp_dot(flat[2] - flat[0]).abs();
        let [low, high] = metric.eigenvalues();
        let area = 0.5 * doubled * (low * high).sqrt();
        flat_area += 0.5 * doubled;
        area_m2 += area;
        // Weighted by the area in the geometry's own measure, so that squashed parts still count.
        mean.add(metric, 0.5 * doubled);
    }
    // The direction only; the size comes from the area.
    let root = mean.root().unwrap_or_default();
    let root_area = root.determinant() * flat_area;
    let scale = (area_m2 / root_area).sqrt();
    let scale = if scale.is_finite() { scale } else { 0.0 };
    let mut vertices: Vec<u32> = triangles.iter().flat_map(|&t| woven.unwrap.triangles[t as usize]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let points: Vec<DVec2> = vertices.iter().map(|&i| root * woven.uv[i as usize].as_dvec2()).collect();
    let axis = smallest_box(&points);
    let turned = |p: DVec2| DVec2::new(p.dot(axis), p.dot(axis.perp()));
    let (low, high) = points
        .iter()
        .map(|&p| turned(p))
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let size = (high - low).max(DVec2::splat(f64::MIN_POSITIVE));
    let unit = |p: DVec2| ((turned(p) - low) / size).as_vec2().clamp(Vec2::ZERO, Vec2::ONE);
    let filled = root_area >= (1.0 - FILLED) * size.x * size.y;
    let unit_uv = vertices.iter().zip(&points).map(|(&i, &p)| (i, unit(p))).collect();
    (Shape { size_m: size * scale, filled }, unit_uv)
}

/// Direction of one side of the smallest box around the points: a side of their hull.
fn smallest_box(points: &[DVec2]) -> DVec2 {
    let hull = hull(points);
    if hull.len() < 3 {
        let along = hull.last().zip(hull.first()).map(|(a, b)| *a - *b);
        return along.and_then(DVec2::try_normalize).unwrap_or(DVec2::X);
    }
    let side = |n: usize| hull[(n + 1) % hull.len()] - hull[n];
    let mut sides: Vec<usize> = (0..hull.len()).collect();
    if sides.len() > DIRECTIONS {
        sides.sort_by(|&a, &b| side(b).length_squared().total_cmp(&side(a).length_squared()).then(a.cmp(&b)));
        sides.truncate(DIRECTIONS);
    }
    let mut best = (f64::INFINITY, DVec2::X);
    for axis in sides.into_iter().filter_map(|n| side(n).try_normalize()) {
        let range = |along: DVec2| {
            let (low, high) = hull
                .iter()
                .map(|p| p.dot(along))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            high - low
        };
        let area = range(axis) * range(axis.perp());
        // A clear gain only: of equal boxes the first stays.
        if area < best.0 * (1.0 - 1e-9) {
            best = (area, axis);
        }
    }
    best.1
}

/// Convex hull, counter-clockwise, without points on its sides (Andrew's monotone chain).
fn hull(points: &[DVec2]) -> Vec<DVec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let half = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b - a).perp_dot(p - a) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut lower = half(&mut sorted.iter().copied());
    lower.extend(half(&mut sorted.iter().rev().copied()));
    lower
}
