//! Patches cut finer where what they see changes.

use super::{Elements, NO_PATCH, Patches};
use crate::sampling::{cosine_hemisphere, frame, sobol4, to_world};
use crate::transport::{Ray, Tracer, segment};
use glam::Vec3;
use rayon::prelude::*;

/// Elements of a patch that look around.
const VIEWERS: usize = 16;
/// Rays each of them sends.
const RAYS: u32 = 8;
/// A patch is cut where the nearness of what its elements see differs by this factor.
const CHANGE: f32 = 3.0;
/// Patches of fewer elements stay whole.
const FEWEST: usize = 8;
/// Each round cuts a patch into four.
const ROUNDS: u32 = 3;
/// Parts of a patch that a wall stands on, at the most.
const MOST_PARTS: usize = 4;
/// Squared length of a patch's mean normal from which it counts as flat.
const FLAT: f32 = 0.9999;
/// No patch is cut beyond this number of patches.
const MOST: usize = 1 << 17;

/// Cuts patches into quarters, again and again, where some of their elements stand close to other surfaces and some
/// do not: behind furniture, under a table, along an edge; then parts flat ones along the walls that stand on them. One
/// value for both sides would carry light where none gets to.
/// Returns the patches and the number of rays that took.
pub fn adapt<T: Tracer>(elements: &Elements, mut patches: Patches, tracer: &T) -> (Patches, u64) {
    let directions: Vec<Vec3> = sobol4(RAYS, 0, 8).iter().map(|p| cosine_hemisphere(p[0], p[1])).collect();
    let mut rays = 0;
    let mut fresh: Vec<bool> = vec![true; patches.len()];
    for _ in 0..ROUNDS {
        let uneven: Vec<bool> = (0..patches.len())
            .into_par_iter()
            .map(|patch| {
                fresh[patch] && is_uneven(elements, patches.elements_of(patch as u32), &directions, tracer)
            })
            .collect();
        rays += fresh.iter().filter(|f| **f).count() as u64 * (VIEWERS as u64) * u64::from(RAYS);
        let cuts = uneven.iter().filter(|u| **u).count();
        if cuts == 0 || patches.len() + 3 * cuts > MOST {
            break;
        }
        let parts: Vec<_> = (0..patches.len())
            .map(|patch| uneven[patch].then(|| quarters(patches.elements_of(patch as u32))))
            .collect();
        (patches, fresh) = cut(elements, &patches, &parts);
    }
    let among_others = |members: &[u32]| members.iter().any(|&e| elements.among_others[e as usize]);
    let parts: Vec<_> = (0..patches.len())
        .into_par_iter()
        .map(|patch| {
            let members = patches.elements_of(patch as u32);
            if patches.normal_world[patch].length_squared() < FLAT || !among_others(members) {
                return None;
            }
            Some(seen_parts(elements, members, tracer)).filter(|parts| parts.len() > 1)
        })
        .collect();
    let asked =
        (0..patches.len() as u32).map(|p| patches.elements_of(p)).filter(|members| among_others(members));
    rays += asked.map(|members| members.len() as u64).sum::<u64>();
    (cut(elements, &patches, &parts).0, rays)
}

fn is_uneven<T: Tracer>(elements: &Elements, members: &[u32], directions: &[Vec3], tracer: &T) -> bool {
    if members.len() < FEWEST {
        return false;
    }
    let viewers = VIEWERS.min(members.len());
    let (mut least, mut most) = (f32::INFINITY, 0.0_f32);
    for k in 0..viewers {
        let e = members[k * members.len() / viewers] as usize;
        let normal = elements.normal_geometric[e];
        let frame = frame(normal, elements.half_u_world[e]);
        let origin = tracer.world().offset_origin(elements.triangle[e], elements.position_world[e], normal);
        let nearness: f32 = directions
            .iter()
            .filter_map(|&d| tracer.closest(&Ray::unbounded(origin, to_world(&frame, d))))
            .map(|hit| 1.0 / hit.t)
            .sum();
        least = least.min(nearness);
        most = most.max(nearness);
    }
    // What is further away than the patch is wide changes little across it, whatever the ratio.
    let width = members.iter().map(|&e| elements.area[e as usize].0).sum::<f32>().sqrt();
    most > CHANGE * least && most * width > directions.len() as f32 * 0.5
}

/// Members stand along a Z-order curve: quarters of the list are quarters of the square.
fn quarters(members: &[u32]) -> Vec<Vec<u32>> {
    (0..4).map(|k| members[k * members.len() / 4..(k + 1) * members.len() / 4].to_vec()).collect()
}

/// Parts of a flat patch whose members see the part's middle: a wall that stands on a patch parts it.
fn seen_parts<T: Tracer>(elements: &Elements, members: &[u32], tracer: &T) -> Vec<Vec<u32>> {
    let origin = |e: u32| {
        let e = e as usize;
        let (position, normal) = (elements.position_world[e], elements.normal_geometric[e]);
        tracer.world().offset_origin(elements.triangle[e], position, normal)
    };
    let mut left = members.to_vec();
    let mut parts = Vec::new();
    while parts.len() + 1 < MOST_PARTS && !left.is_empty() {
        let from = origin(left[left.len() / 2]);
        let (seen, hidden) = left.iter().partition(|&&e| !tracer.occluded(&segment(from, origin(e))));
        parts.push(seen);
        left = hidden;
    }
    parts.extend((!left.is_empty()).then_some(left));
    parts
}

/// Replaces every patch by its parts; tells which are new.
fn cut(elements: &Elements, patches: &Patches, parts: &[Option<Vec<Vec<u32>>>]) -> (Patches, Vec<bool>) {
    let mut next = Patches {
        patch_of_element: vec![NO_PATCH; elements.len()],
        elements: Vec::with_capacity(patches.elements.len()),
        first: vec![0],
        ..Patches::default()
    };
    let mut fresh = Vec::new();
    let mut first_part = Vec::with_capacity(patches.len());
    for (patch, parts) in (0..).zip(parts) {
        first_part.push(next.len() as u32);
        match parts {
            Some(parts) => parts.iter().for_each(|part| next.push(elements, part.iter().copied())),
            None => next.push(elements, patches.elements_of(patch).iter().copied()),
        }
        fresh.resize(next.len(), parts.is_some());
    }
    for (e, old) in patches.patch_of_element.iter().enumerate() {
        if next.patch_of_element[e] == NO_PATCH && *old != NO_PATCH {
            next.patch_of_element[e] = first_part[*old as usize];
        }
    }
    (next, fresh)
}
