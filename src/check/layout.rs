//! The lightmap's texture space as the file has it: triangles in texels and the charts they make.

use crate::baked::Baked;
use glam::Vec2;
use std::ops::Range;

/// A lightmapped surface's triangles on its page.
pub(super) struct Side {
    /// Index into the scene's surfaces.
    pub surface: usize,
    /// Index into the pages.
    pub page: usize,
    /// Corners in texels, in the order of [`crate::scene::Scene::corner_indices`].
    pub corners: Vec<[Vec2; 3]>,
    /// Chart of each triangle, numbered over all sides; [`NO_CHART`] for triangles without area on the page.
    pub chart: Vec<u32>,
    /// The charts of this side.
    pub charts: Range<u32>,
}

/// Chart of a triangle that covers nothing.
pub(super) const NO_CHART: u32 = u32::MAX;

/// All lightmapped surfaces whose page and coordinates are there.
pub(super) fn sides(baked: &Baked) -> Vec<Side> {
    let scene = &baked.scene;
    let mut next = 0;
    let mut sides = Vec::new();
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let Some(lightmap) = baked.lightmaps[index] else { continue };
        let Some(set) = scene.geometry(surface).texcoords.get(lightmap.texcoord) else { continue };
        let Ok(image) = &baked.pages[lightmap.page].image else { continue };
        let size = Vec2::new(image.size[0] as f32, image.size[1] as f32);
        let count = scene.geometry(surface).triangles.len() as u32;
        let indices: Vec<[usize; 3]> = (0..count).map(|t| scene.corner_indices(surface, t)).collect();
        let corners: Vec<[Vec2; 3]> = indices.iter().map(|t| t.map(|i| set[i] * size)).collect();
        let (chart, made) = charts(set, &indices, &corners, next);
        sides.push(Side { surface: index, page: lightmap.page, corners, chart, charts: next..next + made });
        next += made;
    }
    sides
}

/// Triangles that share a point of the page belong together. Numbers start at `first`; returns how many there are.
fn charts(set: &[Vec2], indices: &[[usize; 3]], corners: &[[Vec2; 3]], first: u32) -> (Vec<u32>, u32) {
    // Vertices at the same point are one: the lowest of them stands for all.
    let mut order: Vec<u32> = (0..set.len() as u32).collect();
    let key = |i: u32| set[i as usize].to_array().map(f32::to_bits);
    order.sort_unstable_by_key(|&i| (key(i), i));
    let mut parent: Vec<u32> = (0..set.len() as u32).collect();
    for pair in order.windows(2) {
        if key(pair[0]) == key(pair[1]) {
            parent[pair[1] as usize] = parent[pair[0] as usize];
        }
    }
    let covers = |t: usize| doubled_area(&corners[t]).abs() > 0.0;
    for (t, triangle) in indices.iter().enumerate().filter(|(t, _)| covers(*t)) {
        debug_assert!(covers(t));
        let roots = triangle.map(|i| root(&mut parent, i as u32));
        let lowest = roots[0].min(roots[1]).min(roots[2]);
        roots.iter().for_each(|&r| parent[r as usize] = lowest);
    }
    let mut number = vec![NO_CHART; set.len()];
    let mut made = 0;
    let chart = (0..indices.len())
        .map(|t| {
            if !covers(t) {
                return NO_CHART;
            }
            let slot = &mut number[root(&mut parent, indices[t][0] as u32) as usize];
            if *slot == NO_CHART {
                *slot = first + made;
                made += 1;
            }
            *slot
        })
        .collect();
    (chart, made)
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Twice the signed area; 0 where a corner is not a finite number.
pub(super) fn doubled_area([a, b, c]: &[Vec2; 3]) -> f32 {
    let area = (*b - *a).perp_dot(*c - *a);
    if area.is_finite() { area } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_that_touch_on_the_page_are_one_chart() {
        let at = |x: f32, y: f32| Vec2::new(x, y);
        // A quad whose halves have vertices of their own, a triangle apart, and one without area.
        let set = [
            (0.0, 0.0),
            (1.0, 0.0),
            (0.0, 1.0),
            (1.0, 0.0),
            (1.0, 1.0),
            (0.0, 1.0),
            (4.0, 0.0),
            (5.0, 0.0),
            (4.0, 1.0),
        ]
        .map(|(x, y)| at(x, y));
        let indices = [[0, 1, 2], [3, 4, 5], [6, 7, 8], [0, 0, 1]];
        let corners: Vec<[Vec2; 3]> = indices.iter().map(|t| t.map(|i| set[i])).collect();
        let (chart, made) = charts(&set, &indices, &corners, 10);
        assert_eq!((chart, made), (vec![10, 10, 11, NO_CHART], 2));
    }
}
