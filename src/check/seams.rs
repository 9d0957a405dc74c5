//! Steps of the light across borders of charts: edges that are one smooth line on the surface but two on the page.

use super::layout::{NO_CHART, Side};
use crate::baked::Baked;
use crate::scene::SurfacePoint;
use glam::{Vec2, Vec3};
use serde::Serialize;

/// Places along an edge where both sides are read.
const PLACES: u32 = 8;
/// Normals of both sides must agree this well: a crease may be as dark on one side as it likes.
const SMOOTH: f32 = 0.999;
/// Corners are one when they differ by less than about this share of the scene's size.
const SAME_PLACE: f64 = 1e-6;

/// The steps found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Seams {
    /// Smooth edges on which two charts end.
    pub edges: usize,
    /// Largest step, as a share of the scene's mean light.
    pub largest: f64,
    /// Nineteen twentieths of the places have less.
    pub p95: f64,
    /// Objects on both sides of the largest one.
    pub between: [String; 2],
    /// Where it is, world metres.
    pub at_world: [f64; 3],
}

/// One side of an edge.
struct Border {
    /// The edge's ends, quantised, lower first: equal for both sides.
    key: [[i64; 3]; 2],
    side: u32,
    triangle: u32,
    /// Which corner of the triangle stands at the lower and which at the upper end.
    corner: [u8; 2],
}

/// Finds every smooth edge between two charts and measures; `mean` is the scene's mean light, its brightest channel.
/// Returns also the largest step on each side's own borders.
pub(super) fn measure(baked: &Baked, sides: &[Side], mean: f32) -> (Seams, Vec<f64>) {
    let mut found = Seams::default();
    let mut own = vec![0.0; sides.len()];
    if mean <= 0.0 {
        return (found, own);
    }
    let borders = borders(baked, sides);
    let mut steps: Vec<f64> = Vec::new();
    for group in borders.chunk_by(|a, b| a.key == b.key) {
        let [a, b] = group else { continue };
        let chart = |border: &Border| sides[border.side as usize].chart[border.triangle as usize];
        if chart(a) == chart(b) || !is_smooth(baked, sides, a, b) {
            continue;
        }
        found.edges += 1;
        for place in 0..PLACES {
            let t = (place as f32 + 0.5) / PLACES as f32;
            let [(here, at), (there, _)] = [a, b].map(|border| read(baked, sides, border, t));
            let step = f64::from((here - there).abs().max_element() / mean);
            steps.push(step);
            for border in [a, b] {
                let own = &mut own[border.side as usize];
                *own = step.max(*own);
            }
            if step > found.largest {
                let name = |border: &Border| {
                    baked.scene.surfaces[sides[border.side as usize].surface].origin.name.clone()
                };
                found.largest = step;
                found.between = [name(a), name(b)];
                found.at_world = (at.as_dvec3() + baked.scene.origin_world).to_array();
            }
        }
    }
    steps.sort_by(f64::total_cmp);
    found.p95 = steps.get(steps.len() * 95 / 100).copied().unwrap_or(0.0);
    (found, own)
}

/// All edges of all lit triangles, those of one place together.
fn borders(baked: &Baked, sides: &[Side]) -> Vec<Border> {
    let scene = &baked.scene;
    let corners =
        || sides.iter().flat_map(|s| &scene.surfaces[s.surface].position_world).filter(|p| p.is_finite());
    let (low, high) =
        corners().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let cell = (f64::from((high - low).length()) * SAME_PLACE).max(f64::MIN_POSITIVE);
    let quantised = |p: Vec3| (p.as_dvec3() / cell).round().to_array().map(|x| x as i64);
    let mut all = Vec::new();
    for (number, side) in sides.iter().enumerate() {
        let surface = &scene.surfaces[side.surface];
        for (triangle, _) in side.chart.iter().enumerate().filter(|(_, chart)| **chart != NO_CHART) {
            let ends = scene.corners_world(surface, triangle as u32).map(quantised);
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (low, high) = if ends[i] <= ends[j] { (i, j) } else { (j, i) };
                if ends[low] != ends[high] {
                    all.push(Border {
                        key: [ends[low], ends[high]],
                        side: number as u32,
                        triangle: triangle as u32,
                        corner: [low as u8, high as u8],
                    });
                }
            }
        }
    }
    all.sort_unstable_by_key(|border| (border.key, border.side, border.triangle));
    all
}

fn is_smooth(baked: &Baked, sides: &[Side], a: &Border, b: &Border) -> bool {
    let scene = &baked.scene;
    let normal = |border: &Border, end: usize| {
        let corner = usize::from(border.corner[end]);
        let mut barycentric = Vec2::ZERO;
        if corner > 0 {
            barycentric[corner - 1] = 1.0;
        }
        let surface = sides[border.side as usize].surface as u32;
        scene.shading_normal(SurfacePoint { surface, triangle: border.triangle, barycentric })
    };
    (0..2).all(|end| normal(a, end).dot(normal(b, end)) > SMOOTH)
}

/// The light at a place along the edge, from the lower end, as this side's chart has it, and where that is.
fn read(baked: &Baked, sides: &[Side], border: &Border, t: f32) -> (Vec3, Vec3) {
    let side = &sides[border.side as usize];
    let page = &baked.pages[side.page];
    let [low, high] = border.corner.map(usize::from);
    let texels = &side.corners[border.triangle as usize];
    let size = page.image.as_ref().map_or([1, 1], |image| image.size);
    let uv = texels[low].lerp(texels[high], t) / Vec2::new(size[0] as f32, size[1] as f32);
    let world = baked.scene.corners_world(&baked.scene.surfaces[side.surface], border.triangle);
    (page.sample(uv) * page.white_radiance_scale().unwrap_or(1.0), world[low].lerp(world[high], t))
}
