//! Which sides of every surface take light, and the proof that a back cannot be reached.
//!
//! Blender marks nearly every material double-sided, so most backs are the insides of solid things. A back is dropped
//! only when its whole connected component is the closed outward skin of an opaque solid with nothing in it: then no
//! light arrives there and nobody could see it. In doubt the back stays.

#[cfg(test)]
mod tests;

use super::bodies::{Bodies, Body, Placed, Sweep};
use super::columns::Place;
use super::solid::{Component, Skin};
use super::{Side, Sides};
use crate::scene::{LampKind, Opacity, Role, Scene, Surface};
use rayon::prelude::*;

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
    find(scene, &Bodies::new(scene))
}

/// The same of bodies that are already known.
pub(super) fn find(scene: &Scene, bodies: &Bodies) -> SidesFound {
    let backs = backs(scene, bodies);
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
pub(super) fn has_back(scene: &Scene, surface: &Surface) -> bool {
    let material = scene.material(surface);
    material.double_sided && !material.unlit && surface.role != Role::Blocks
}

fn backs(scene: &Scene, Bodies { bodies, shapes, placed, order }: &Bodies) -> Vec<BackEvidence> {
    if !scene.surfaces.iter().any(|surface| has_back(scene, surface)) {
        return Vec::new();
    }
    let verdicts: Vec<Result<(), String>> = placed
        .par_iter()
        .enumerate()
        .map(|(i, _)| unreachable_inside(scene, bodies, shapes, placed, order, i))
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
        scene.material(surface).transmission > 0.0 || scene.opacity_of(surface) != Opacity::Full
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
    let emits = |surfaces: &[&Surface]| surfaces.iter().any(|surface| scene.emits(surface));
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
