//! Patches as convex polygons, for closed forms.
//!
//! A patch is a set of texel footprints. Where they lie in a plane, within ten degrees, and fill the hull around them,
//! the hull is the patch; else halves are tried. Hulls are scaled to the area of what they stand for, so that the
//! texels which a chart's border cuts add no light.

use crate::elements::{Elements, Patches};
use crate::transport::form_factors::area::Polygon;
use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Normals of one facet differ by less than acos(this) from their mean.
const FLAT: f64 = 0.985;
/// A hull may be larger than its footprints by this factor.
const LOOSE: f64 = 1.4;
/// Corners of a facet at the most.
const MOST_CORNERS: usize = 8;
/// Corners that hold less than this share of the facet are dropped.
const NOTHING: f64 = 1e-3;

/// A convex planar piece of a patch, world metres.
pub(super) struct Facet {
    pub polygon: Polygon,
    pub centre: DVec3,
    /// From the centre to the farthest corner.
    pub radius: f64,
}

/// The pieces of all patches.
pub(super) struct Facets {
    facets: Vec<Facet>,
    first: Vec<u32>,
}

impl Facets {
    /// Those of patches that are `wanted`; the others have none.
    pub fn new(elements: &Elements, patches: &Patches, wanted: &(dyn Fn(u32) -> bool + Sync)) -> Self {
        let of_patch: Vec<Vec<Facet>> = (0..patches.len() as u32)
            .into_par_iter()
            .map(|patch| {
                let mut pieces = Vec::with_capacity(1);
                if wanted(patch) {
                    cover(elements, patches.elements_of(patch), &mut pieces);
                }
                pieces
            })
            .collect();
        let mut first = vec![0];
        let mut facets = Vec::with_capacity(of_patch.len());
        for pieces in of_patch {
            facets.extend(pieces);
            first.push(facets.len() as u32);
        }
        Self { facets, first }
    }

    pub fn of(&self, patch: u32) -> &[Facet] {
        let at = |patch: usize| self.first[patch] as usize;
        let range: Range<usize> = at(patch as usize)..at(patch as usize + 1);
        &self.facets[range]
    }
}

/// Appends facets for elements, one if it may be; else for the halves along their greatest extent.
fn cover(elements: &Elements, members: &[u32], out: &mut Vec<Facet>) {
    let facet = if members.len() == 1 || is_flat(elements, members) { hull(elements, members) } else { None };
    match facet {
        Some(facet) => out.push(facet),
        None if members.len() > 1 => {
            let at = |e: &u32| elements.position_world[*e as usize];
            let (low, high) = members
                .iter()
                .map(at)
                .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
            let axis = (high - low).max_position();
            let mut sorted = members.to_vec();
            sorted.sort_unstable_by(|a, b| at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(b)));
            let (left, right) = sorted.split_at(sorted.len() / 2);
            cover(elements, left, out);
            cover(elements, right, out);
        }
        // An element without extent or normal.
        None => {}
    }
}

fn normal_sum(elements: &Elements, members: &[u32]) -> DVec3 {
    let weighted =
        |&e: &u32| elements.normal_geometric[e as usize].as_dvec3() * f64::from(elements.area[e as usize].0);
    members.iter().map(weighted).sum()
}

fn is_flat(elements: &Elements, members: &[u32]) -> bool {
    let Some(mean) = normal_sum(elements, members).try_normalize() else { return false };
    members.iter().all(|&e| elements.normal_geometric[e as usize].as_dvec3().dot(mean) > FLAT)
}

/// The hull of footprints in their mean plane; none where it holds much that they do not.
fn hull(elements: &Elements, members: &[u32]) -> Option<Facet> {
    let normal = normal_sum(elements, members).try_normalize()?;
    let (u, v) = normal.any_orthonormal_pair();
    let area: f64 = members.iter().map(|&e| f64::from(elements.area[e as usize].0)).sum();
    let position = |e: u32| elements.position_world[e as usize].as_dvec3();
    let middle = members.iter().map(|&e| position(e)).sum::<DVec3>() / members.len() as f64;
    let mut corners = outermost(members.iter().map(|&e| {
        let flat = |side: DVec3| DVec2::new(side.dot(u), side.dot(v));
        let [s, t] = [elements.half_u_world[e as usize], elements.half_v_world[e as usize]];
        [flat(position(e) - middle), flat(s.as_dvec3()), flat(t.as_dvec3())]
    }));
    let mut enclosed = doubled_area(&corners) / 2.0;
    if enclosed.is_nan() || enclosed <= 1e-3 * area {
        // Slivers have no extent of their own: a square stands for each.
        if members.len() > 1 {
            return None;
        }
        let half = area.sqrt() / 2.0;
        corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y)| DVec2::new(half * x, half * y))
            .to_vec();
        enclosed = area;
    }
    if members.len() > 1 && enclosed > LOOSE * area {
        return None;
    }
    simplify(&mut corners);
    enclosed = enclosed.min(doubled_area(&corners) / 2.0);
    let centre = corners.iter().sum::<DVec2>() / corners.len() as f64;
    let scale = (area / enclosed).sqrt();
    let corners: Vec<DVec3> = corners
        .iter()
        .map(|&corner| centre + (corner - centre) * scale)
        .map(|corner| middle + u * corner.x + v * corner.y)
        .collect();
    let centre = middle + u * centre.x + v * centre.y;
    let radius = corners.iter().map(|corner| corner.distance(centre)).fold(0.0, f64::max);
    Some(Facet { polygon: Polygon::new(corners)?, centre, radius })
}

/// The corners of parallelograms (middle and two half sides) that lie farthest out in evenly spread directions,
/// counter-clockwise: the hull, but for corners of less than 22.5°.
fn outermost(parallelograms: impl Iterator<Item = [DVec2; 3]> + Clone) -> Vec<DVec2> {
    const DIRECTIONS: usize = 16;
    let directions: [DVec2; DIRECTIONS] = std::array::from_fn(|k| {
        // Not along the axes: there whole edges lie equally far out.
        DVec2::from_angle((k as f64 + 0.4) / DIRECTIONS as f64 * std::f64::consts::TAU)
    });
    let (x, y) = (directions.map(|d| d.x as f32), directions.map(|d| d.y as f32));
    let mut farthest = [(f32::NEG_INFINITY, 0u32); DIRECTIONS];
    for (index, parallelogram) in (0..).zip(parallelograms.clone()) {
        let [middle, s, t] = parallelogram.map(|at| at.as_vec2());
        // All directions side by side.
        let mut reach = [0.0f32; DIRECTIONS];
        for k in 0..DIRECTIONS {
            let along = |at: Vec2| at.x * x[k] + at.y * y[k];
            reach[k] = along(middle) + along(s).abs() + along(t).abs();
        }
        for k in 0..DIRECTIONS {
            if reach[k] > farthest[k].0 {
                farthest[k] = (reach[k], index);
            }
        }
    }
    let mut corners = Vec::with_capacity(DIRECTIONS);
    for (direction, (_, index)) in directions.iter().zip(farthest) {
        if let Some([middle, s, t]) = parallelograms.clone().nth(index as usize) {
            corners.push(middle + s * s.dot(*direction).signum() + t * t.dot(*direction).signum());
        }
    }
    corners.dedup();
    if corners.len() > 1 && corners[0] == corners[corners.len() - 1] {
        corners.pop();
    }
    corners
}

fn doubled_area(corners: &[DVec2]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum()
}

/// Drops the corners that hold next to nothing, and then the least, down to the most a facet has.
fn simplify(corners: &mut Vec<DVec2>) {
    let nothing = NOTHING * doubled_area(corners);
    while corners.len() > 3 {
        let count = corners.len();
        let held = |i: usize| {
            let (a, b, c) = (corners[(i + count - 1) % count], corners[i], corners[(i + 1) % count]);
            (b - a).perp_dot(c - b)
        };
        let least = (0..count).min_by(|&i, &j| held(i).total_cmp(&held(j))).unwrap_or(0);
        if count <= MOST_CORNERS && held(least) > nothing {
            break;
        }
        corners.remove(least);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Area;

    /// Elements of a square grid with a function for place and normal, one patch for all.
    fn grid(n: u32, place: impl Fn(f32, f32) -> (Vec3, Vec3), keep: impl Fn(u32, u32) -> bool) -> Elements {
        let mut elements = Elements::default();
        for (y, x) in (0..n).flat_map(|y| (0..n).map(move |x| (y, x))).filter(|&(y, x)| keep(x, y)) {
            let (s, t) = ((x as f32 + 0.5) / n as f32, (y as f32 + 0.5) / n as f32);
            let (position, normal) = place(s, t);
            let half = 0.5 / n as f32;
            let (u, v) = (place(s + half, t).0 - position, place(s, t + half).0 - position);
            elements.position_world.push(position);
            elements.normal_geometric.push(normal);
            elements.half_u_world.push(u);
            elements.half_v_world.push(v);
            elements.area.push(Area(4.0 * u.cross(v).length()));
        }
        elements
    }

    fn covered(elements: &Elements) -> Vec<Facet> {
        let members: Vec<u32> = (0..elements.area.len() as u32).collect();
        let mut facets = vec![];
        cover(elements, &members, &mut facets);
        let area: f64 = elements.area.iter().map(|area| f64::from(area.0)).sum();
        let sum: f64 = facets.iter().map(|facet| facet.polygon.area()).sum();
        assert!((sum / area - 1.0).abs() < 1e-6, "{sum} {area}");
        facets
    }

    #[test]
    fn a_flat_square_is_one_facet_with_its_corners() {
        let flat = |s: f32, t: f32| (Vec3::new(s, t, 3.0), Vec3::Z);
        let facets = covered(&grid(8, flat, |_, _| true));
        assert_eq!(facets.len(), 1);
        let corners = facets[0].polygon.corners();
        assert_eq!(corners.len(), 4);
        assert!(facets[0].polygon.normal().z > 0.999_999);
        for wanted in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let wanted = DVec3::new(wanted.0, wanted.1, 3.0);
            assert!(corners.iter().any(|corner| corner.distance(wanted) < 1e-6), "{corners:?}");
        }
    }

    /// A corner cut off at 45° is a hull; an L with thin arms is two rectangles at least.
    #[test]
    fn what_is_not_convex_is_cut() {
        let flat = |s: f32, t: f32| (Vec3::new(s, 0.0, t), Vec3::NEG_Y);
        let cut = covered(&grid(16, flat, |x, y| x + y < 24));
        assert!(cut.iter().all(|facet| facet.polygon.corners().len() <= MOST_CORNERS));
        assert!(cut[0].polygon.normal().y < -0.999_999);
        assert!(covered(&grid(8, flat, |x, y| x < 2 || y < 2)).len() > 1);
    }

    #[test]
    fn what_is_curved_is_cut_until_it_is_flat() {
        // A quarter of a cylinder.
        let round = |s: f32, t: f32| {
            let (sine, cosine) = (s * std::f32::consts::FRAC_PI_2).sin_cos();
            (Vec3::new(sine, t, cosine), Vec3::new(sine, 0.0, cosine))
        };
        let elements = grid(16, round, |_, _| true);
        let facets = covered(&elements);
        assert!(facets.len() >= 5, "{}", facets.len());
        for facet in &facets {
            let out = DVec3::new(facet.centre.x, 0.0, facet.centre.z).normalize();
            assert!(facet.polygon.normal().dot(out) > FLAT);
        }
    }

    #[test]
    fn a_sliver_without_extent_is_a_square() {
        let mut elements = grid(1, |s, t| (Vec3::new(s, t, 0.0), Vec3::Z), |_, _| true);
        elements.half_u_world[0] = Vec3::ZERO;
        assert_eq!(covered(&elements).len(), 1);
    }
}
