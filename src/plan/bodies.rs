//! What belongs together: the surfaces of a node, their connected components, where these stand.

use super::sides::has_back;
use super::solid::{Component, Part, components};
use crate::scene::{GeometryId, Scene};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// All bodies of a scene.
pub(super) struct Bodies {
    pub(super) bodies: Vec<Body>,
    /// Components of every distinct shape.
    pub(super) shapes: Vec<Vec<Component>>,
    /// Every component of every body.
    pub(super) placed: Vec<Placed>,
    /// To find what overlaps.
    pub(super) order: Sweep,
}

impl Bodies {
    pub(super) fn new(scene: &Scene) -> Self {
        let (bodies, shapes) = bodies(scene);
        let placed = place(&bodies, &shapes);
        let order = Sweep::new(&placed);
        Self { bodies, shapes, placed, order }
    }

    /// The component that stands there.
    pub(super) fn component(&self, item: usize) -> &Component {
        &self.shapes[self.bodies[self.placed[item].body].shape][self.placed[item].component]
    }

    /// Surface and triangle of each of its triangles.
    pub(super) fn triangles(&self, item: usize) -> impl Iterator<Item = (u32, u32)> + '_ {
        let body = &self.bodies[self.placed[item].body];
        self.component(item)
            .triangles
            .iter()
            .map(|&(part, triangle)| (body.surfaces[part as usize], triangle))
    }

    /// The surfaces it is a part of, ascending.
    pub(super) fn surfaces(&self, item: usize) -> Vec<u32> {
        let mut surfaces: Vec<u32> = self.triangles(item).map(|(surface, _)| surface).collect();
        surfaces.sort_unstable();
        surfaces.dedup();
        surfaces
    }
}

/// The surfaces of one node and mesh: materials split a solid thing into several, so they are judged together.
pub(super) struct Body {
    pub(super) surfaces: Vec<u32>,
    /// The space its components are found in, to world metres relative to the scene's origin.
    pub(super) world_from_shape: DAffine3,
    pub(super) shape: usize,
}

/// One component of one body.
pub(super) struct Placed {
    pub(super) body: usize,
    pub(super) component: usize,
    pub(super) min: DVec3,
    pub(super) max: DVec3,
}

/// Spaces that are the same mesh share their components.
#[derive(PartialEq, Eq, Hash)]
enum ShapeKey {
    Geometries(Vec<GeometryId>),
    /// Deformed: its world positions are not those of its geometry, so it is a shape of its own.
    Own(usize),
}

/// Groups surfaces into bodies and finds the components of every distinct shape.
fn bodies(scene: &Scene) -> (Vec<Body>, Vec<Vec<Component>>) {
    let mut index = HashMap::new();
    let mut groups: Vec<Vec<u32>> = Vec::new();
    for (i, surface) in (0..).zip(&scene.surfaces) {
        let origin = &surface.origin;
        let pose = surface.world_from_local.to_cols_array().map(f64::to_bits);
        let key = (origin.node, origin.mesh, origin.instance, pose, surface.mirrored);
        let group = *index.entry(key).or_insert_with(|| {
            groups.push(Vec::new());
            groups.len() - 1
        });
        groups[group].push(i);
    }

    let rigid: Vec<bool> = groups.par_iter().map(|group| group.iter().all(|&i| is_rigid(scene, i))).collect();
    let mut shape_index = HashMap::new();
    let mut shape_bodies: Vec<(usize, bool)> = Vec::new();
    let mut bodies = Vec::with_capacity(groups.len());
    for (b, surfaces) in groups.into_iter().enumerate() {
        let at = |&i: &u32| &scene.surfaces[i as usize];
        let key = match rigid[b] {
            true => ShapeKey::Geometries(surfaces.iter().map(|i| at(i).geometry).collect()),
            false => ShapeKey::Own(b),
        };
        let shape = *shape_index.entry(key).or_insert_with(|| {
            shape_bodies.push((b, false));
            shape_bodies.len() - 1
        });
        shape_bodies[shape].1 |= surfaces.iter().any(|i| has_back(scene, at(i)));
        let world_from_shape = match rigid[b] {
            true => DAffine3::from_translation(-scene.origin_world) * at(&surfaces[0]).world_from_local,
            false => DAffine3::IDENTITY,
        };
        bodies.push(Body { surfaces, world_from_shape, shape });
    }

    let find = |&(body, prove): &(usize, bool)| {
        let part = |&i: &u32| {
            let surface = &scene.surfaces[i as usize];
            let geometry = scene.geometry(surface);
            let (positions, turned) = match rigid[body] {
                true => (geometry.position_local.as_slice(), false),
                false => (surface.position_world.as_slice(), surface.mirrored),
            };
            Part { positions, triangles: &geometry.triangles, turned }
        };
        components(&bodies[body].surfaces.iter().map(part).collect::<Vec<_>>(), prove)
    };
    let shapes = shape_bodies.par_iter().map(find).collect();
    (bodies, shapes)
}

/// Whether the world positions are the local ones moved by `world_from_local` (they are not under a skin).
fn is_rigid(scene: &Scene, surface: u32) -> bool {
    let surface = &scene.surfaces[surface as usize];
    let frame = DAffine3::from_translation(-scene.origin_world) * surface.world_from_local;
    let local = &scene.geometry(surface).position_local;
    let size = surface.position_world.iter().fold(0.0_f32, |m, p| m.max(p.abs().max_element()));
    let rounding = f64::from(size) * 1e-6;
    local.len() == surface.position_world.len()
        && local.iter().zip(&surface.position_world).all(|(&l, &w)| {
            (frame.transform_point3(l.as_dvec3()) - w.as_dvec3()).abs().max_element() <= rounding
        })
}

fn place(bodies: &[Body], shapes: &[Vec<Component>]) -> Vec<Placed> {
    let mut placed = Vec::new();
    for (b, body) in bodies.iter().enumerate() {
        for (c, component) in shapes[body.shape].iter().enumerate() {
            let (lo, hi) = (component.min, component.max);
            let corner = |i: usize| {
                let pick = |axis: usize| if i >> axis & 1 == 1 { hi[axis] } else { lo[axis] };
                body.world_from_shape.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
            };
            let min = (0..8).map(corner).fold(DVec3::INFINITY, DVec3::min);
            let max = (0..8).map(corner).fold(DVec3::NEG_INFINITY, DVec3::max);
            placed.push(Placed { body: b, component: c, min, max });
        }
    }
    placed
}

/// Boxes in the order of their least x, to find those that overlap another.
pub(super) struct Sweep {
    order: Vec<usize>,
    /// Greatest x of all boxes up to here.
    reach: Vec<f64>,
}

impl Sweep {
    pub(super) fn new(placed: &[Placed]) -> Self {
        let mut order: Vec<usize> = (0..placed.len()).collect();
        order.sort_by(|&a, &b| placed[a].min.x.total_cmp(&placed[b].min.x));
        let reach = order.iter().scan(f64::NEG_INFINITY, |reach, &i| {
            *reach = reach.max(placed[i].max.x);
            Some(*reach)
        });
        let reach = reach.collect();
        Self { order, reach }
    }

    pub(super) fn overlapping<'a>(
        &'a self,
        placed: &'a [Placed],
        item: usize,
    ) -> impl Iterator<Item = usize> + 'a {
        let (min, max) = (placed[item].min, placed[item].max);
        let first = self.reach.partition_point(|&reach| reach < min.x);
        let last = self.order.partition_point(|&i| placed[i].min.x <= max.x);
        self.order[first.min(last)..last]
            .iter()
            .copied()
            .filter(move |&i| i != item && placed[i].min.cmple(max).all() && placed[i].max.cmpge(min).all())
    }
}
