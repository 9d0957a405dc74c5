//! Which sides of every surface take light, and the proof that a back cannot be reached.
//!
//! Blender marks nearly every material double-sided, so most backs are the insides of solid things. A back is dropped
//! only when its whole connected component is the closed outward skin of an opaque solid with nothing in it: then no
//! light arrives there and nobody could see it. In doubt the back stays.

mod columns;
mod solid;
#[cfg(test)]
mod tests;

use super::{Side, Sides};
use crate::scene::{Alpha, GeometryId, LampKind, Role, Scene, Surface};
use columns::Place;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use solid::{Component, Part, Skin, components};
use std::collections::HashMap;

/// What was found about the back of one double-sided surface.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct BackEvidence {
    /// Index into the scene's surfaces.
    pub surface: u32,
    /// Whether the back is proven unreachable and left out.
    pub dropped: bool,
    /// Why, in the artist's words.
    pub reason: String,
}

/// The sides of all surfaces and why.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SidesFound {
    /// One per surface of the scene.
    pub sides: Vec<Sides>,
    /// One per double-sided surface that takes light, in surface order.
    pub backs: Vec<BackEvidence>,
}

/// The sides of every surface of the scene.
pub fn sides(scene: &Scene) -> Vec<Sides> {
    sides_with_evidence(scene).sides
}

/// The sides of every surface of the scene, and why each double-sided back was kept or dropped.
pub fn sides_with_evidence(scene: &Scene) -> SidesFound {
    let backs = backs(scene);
    let mut sides: Vec<Sides> = scene
        .surfaces
        .iter()
        .map(|surface| match surface.role {
            _ if scene.material(surface).unlit => Sides { front: Side::Dark, back: Side::Dark },
            Role::Blocks | Role::Emits => Sides { front: Side::Dark, back: Side::Dark },
            Role::Reflects => Sides { front: Side::Hidden, back: Side::Dark },
            Role::Lightmapped => Sides { front: Side::Lightmapped, back: Side::Dark },
        })
        .collect();
    for back in backs.iter().filter(|back| !back.dropped) {
        sides[back.surface as usize].back = Side::Hidden;
    }
    SidesFound { sides, backs }
}

/// Whether the material asks for a lit back.
fn has_back(scene: &Scene, surface: &Surface) -> bool {
    let material = scene.material(surface);
    material.double_sided && !material.unlit && surface.role != Role::Blocks
}

/// The surfaces of one node and mesh: materials split a solid thing into several, so they are judged together.
struct Body {
    surfaces: Vec<u32>,
    /// The space its components are found in, to world metres relative to the scene's origin.
    world_from_shape: DAffine3,
    shape: usize,
}

/// One component of one body.
struct Placed {
    body: usize,
    component: usize,
    min: DVec3,
    max: DVec3,
}

/// Spaces that are the same mesh share their components.
#[derive(PartialEq, Eq, Hash)]
enum ShapeKey {
    Geometries(Vec<GeometryId>),
    /// Deformed: its world positions are not those of its geometry, so it is a shape of its own.
    Own(usize),
}

fn backs(scene: &Scene) -> Vec<BackEvidence> {
    if !scene.surfaces.iter().any(|surface| has_back(scene, surface)) {
        return Vec::new();
    }
    let (bodies, shapes) = bodies(scene);
    let placed = place(&bodies, &shapes);
    let order = Sweep::new(&placed);
    let verdicts: Vec<Result<(), String>> = placed
        .par_iter()
        .enumerate()
        .map(|(i, _)| unreachable_inside(scene, &bodies, &shapes, &placed, &order, i))
        .collect();

    let mut reason: Vec<Option<String>> = vec![None; scene.surfaces.len()];
    for (item, verdict) in placed.iter().zip(&verdicts) {
        let Err(why) = verdict else { continue };
        let body = &bodies[item.body];
        for &(part, _) in &shapes[body.shape][item.component].triangles {
            reason[body.surfaces[part as usize] as usize].get_or_insert_with(|| why.clone());
        }
    }
    let evidence = |(i, surface): (u32, &Surface)| {
        let reason = reason[i as usize].clone();
        has_back(scene, surface).then(|| BackEvidence {
            surface: i,
            dropped: reason.is_none(),
            reason: reason.unwrap_or_else(|| "closed, faces outward, nothing inside".to_owned()),
        })
    };
    (0..).zip(&scene.surfaces).filter_map(evidence).collect()
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
struct Sweep {
    order: Vec<usize>,
    /// Greatest x of all boxes up to here.
    reach: Vec<f64>,
}

impl Sweep {
    fn new(placed: &[Placed]) -> Self {
        let mut order: Vec<usize> = (0..placed.len()).collect();
        order.sort_by(|&a, &b| placed[a].min.x.total_cmp(&placed[b].min.x));
        let reach = order.iter().scan(f64::NEG_INFINITY, |reach, &i| {
            *reach = reach.max(placed[i].max.x);
            Some(*reach)
        });
        let reach = reach.collect();
        Self { order, reach }
    }

    fn overlapping<'a>(&'a self, placed: &'a [Placed], item: usize) -> impl Iterator<Item = usize> + 'a {
        let (min, max) = (placed[item].min, placed[item].max);
        let first = self.reach.partition_point(|&reach| reach < min.x);
        let last = self.order.partition_point(|&i| placed[i].min.x <= max.x);
        self.order[first.min(last)..last]
            .iter()
            .copied()
            .filter(move |&i| i != item && placed[i].min.cmple(max).all() && placed[i].max.cmpge(min).all())
    }
}

/// `Ok` when the backs of a component cannot be reached, else why they might be.
fn unreachable_inside(
    scene: &Scene,
    bodies: &[Body],
    shapes: &[Vec<Component>],
    placed: &[Placed],
    order: &Sweep,
    item: usize,
) -> Result<(), String> {
    let body = &bodies[placed[item].body];
    let component = &shapes[body.shape][placed[item].component];
    let surfaces_of = |body: &Body, component: &Component| {
        let mut parts: Vec<u32> = component.triangles.iter().map(|&(part, _)| part).collect();
        parts.dedup();
        parts
            .into_iter()
            .map(|part| &scene.surfaces[body.surfaces[part as usize] as usize])
            .collect::<Vec<_>>()
    };
    let surfaces = surfaces_of(body, component);
    if !surfaces.iter().any(|surface| has_back(scene, surface)) {
        return Ok(());
    }
    let transparent = |surface: &&Surface| {
        let material = scene.material(surface);
        material.alpha != Alpha::Opaque || material.transmission > 0.0
    };
    if surfaces.iter().any(transparent) {
        return Err("lets light through".into());
    }
    let columns = match (component.skin, &component.columns) {
        (Skin::Closed, Some(columns)) => columns,
        (Skin::Open | Skin::Closed, _) => return Err("not closed".into()),
        (Skin::Tangled, _) => {
            return Err("more than two faces meet at an edge, or neighbours face opposite ways".into());
        }
        (Skin::Inward, _) => return Err("faces inward or encloses nothing".into()),
        (Skin::Folded, _) => return Err("a part of it is turned inside out".into()),
        (Skin::Intricate, _) => return Err("too intricate to prove closed".into()),
    };
    let linear = body.world_from_shape.matrix3;
    let volume = linear.determinant().abs();
    let cube = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
    if volume.is_nan() || volume <= 1e-9 * cube {
        return Err("flattened by its scale".into());
    }
    let shape_from_world = body.world_from_shape.inverse();

    for lamp in &scene.lamps {
        let LampKind::Point { position_world, .. } = lamp.kind else { continue };
        if columns.place(shape_from_world.transform_point3(position_world.as_dvec3())) != Place::Outside {
            return Err(format!("lamp '{}' is inside", lamp.name));
        }
    }
    let emits = |surfaces: &[&Surface]| surfaces.iter().any(|surface| scene.material(surface).emits());
    let glows = emits(&surfaces);
    for other in order.overlapping(placed, item) {
        let other_body = &bodies[placed[other].body];
        let other_component = &shapes[other_body.shape][placed[other].component];
        let samples = other_component.triangles.iter().flat_map(|&(part, triangle)| {
            let surface = &scene.surfaces[other_body.surfaces[part as usize] as usize];
            let [a, b, c] = scene.corners_world(surface, triangle).map(|p| p.as_dvec3());
            [(a + b + c) / 3.0, a, b, c]
        });
        let (mut inside, mut outside) = (false, false);
        for sample in samples {
            match columns.place(shape_from_world.transform_point3(sample)) {
                Place::Inside => inside = true,
                Place::Outside => outside = true,
                Place::On => {}
            }
            if inside && outside {
                break;
            }
        }
        let other_surfaces = surfaces_of(other_body, other_component);
        let name = || other_surfaces.first().map_or("", |surface| surface.origin.name.as_str());
        match (inside, outside) {
            // Part of it is buried in the solid: that part is dark, unless something glows in there.
            (true, true) if glows || emits(&other_surfaces) => {
                return Err(format!("'{}' reaches inside", name()));
            }
            (true, true) | (false, true) => {}
            (true, false) => return Err(format!("'{}' is inside", name())),
            (false, false) => return Err(format!("'{}' lies on its surface", name())),
        }
    }
    Ok(())
}
