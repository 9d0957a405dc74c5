//! Elements that their cell's nodes do not speak for: something stands between.

use super::cells::element_at;
use super::interpolate::{Finished, Shape};
use crate::elements::Elements;
use crate::plan::Sight;
use crate::transport::{Tracer, segment};
use glam::Vec3;
use rayon::prelude::*;

/// Of the elements of finished cells, those that do not see the middle of their cell, ascending; and the rays that took.
/// Only elements among other geometry that have something in front of them are asked: nothing parts the others from their
/// neighbours.
pub(super) fn parted<T: Tracer>(
    elements: &Elements,
    finished: &[Finished],
    gathered: &[bool],
    sight: &Sight,
    tracer: &T,
) -> (Vec<u32>, u64) {
    let start = |e: u32| -> Vec3 {
        let e = e as usize;
        let (position, normal) = (elements.position_world[e], elements.normal_geometric[e]);
        tracer.world().offset_origin(elements.triangle[e], position, normal)
    };
    let found: Vec<(Vec<u32>, u64)> = finished
        .par_iter()
        .map(|Finished { cell, shape, .. }| {
            let chart = &elements.charts[cell.chart as usize];
            let (Shape::Quadratic { middle, .. } | Shape::Plane { middle, .. }) = *shape;
            let (mut hidden, mut rays) = (Vec::new(), 0);
            for y in cell.min[1]..=cell.max[1] {
                for x in cell.min[0]..=cell.max[0] {
                    let Some(e) = element_at(elements, chart, x, y) else { continue };
                    let apart = !elements.among_others[e as usize];
                    if gathered[e as usize] || apart || elements.is_open(e, sight) {
                        continue;
                    }
                    rays += 1;
                    if tracer.occluded(&segment(start(e), start(middle))) {
                        hidden.push(e);
                    }
                }
            }
            (hidden, rays)
        })
        .collect();
    let rays = found.iter().map(|f| f.1).sum();
    let mut hidden: Vec<u32> = found.into_iter().flat_map(|f| f.0).collect();
    hidden.sort_unstable();
    hidden.dedup();
    (hidden, rays)
}
