//! Patches cut finer where what they see changes.

use super::{Elements, NO_PATCH, Patches, TexelRef};
use crate::sampling::{cosine_hemisphere, frame, sobol4, to_world};
use crate::transport::{Ray, Tracer, segment};
use glam::Vec3;
use rayon::prelude::*;

/// Elements of a patch that look around.
const VIEWERS: usize = 8;
/// Rays each of them sends.
const RAYS: u32 = 8;
/// How far they look, in widths of the patch: what is further away changes little across it.
const REACH_WIDTHS: f32 = 2.0;
/// A patch is cut where one viewer has this many more of its rays blocked than another.
const CHANGE: u32 = 2;
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
/// Patches whose elements are all open see nothing and stay as they are.
/// Returns the patches and the number of rays that took.
pub fn adapt<T: Tracer>(
    elements: &Elements,
    patches: Patches,
    is_open: impl Fn(u32) -> bool + Sync,
    counts: impl Fn(usize) -> bool,
    tracer: &T,
) -> (Patches, u64) {
    let directions: Vec<Vec3> = sobol4(RAYS, 0, 8).iter().map(|p| cosine_hemisphere(p[0], p[1])).collect();
    let mut rays = 0;
    for rounds in (0..=ROUNDS).rev() {
        let cut: Vec<(Vec<Vec<u32>>, u64)> = (0..patches.len() as u32)
            .into_par_iter()
            .map(|patch| {
                let mut cutter = Cutter { elements, tracer, directions: &directions, rays: 0, parts: vec![] };
                let members = patches.elements_of(patch);
                match members.iter().all(|&e| is_open(e)) {
                    true => cutter.parts.push(members.to_vec()),
                    false => cutter.cut(members.to_vec(), rounds),
                }
                (cutter.parts, cutter.rays)
            })
            .collect();
        rays += cut.iter().map(|c| c.1).sum::<u64>();
        let count: usize = cut.iter().map(|c| c.0.len()).sum();
        if count <= MOST {
            let mut patches = replaced(elements, &patches, cut.into_iter().map(|c| c.0));
            patches.count(elements, counts);
            return (patches, rays);
        }
    }
    (patches, rays)
}

/// Cuts one patch.
struct Cutter<'a, T> {
    elements: &'a Elements,
    tracer: &'a T,
    directions: &'a [Vec3],
    rays: u64,
    parts: Vec<Vec<u32>>,
}

impl<T: Tracer> Cutter<'_, T> {
    fn cut(&mut self, members: Vec<u32>, rounds: u32) {
        if rounds > 0 && self.is_uneven(&members) {
            for quarter in quarters(self.elements, &members) {
                self.cut(quarter, rounds - 1);
            }
        } else if self.may_be_parted(&members) {
            self.part(members);
        } else {
            self.parts.push(members);
        }
    }

    fn may_be_parted(&self, members: &[u32]) -> bool {
        members.iter().any(|&e| self.elements.among_others[e as usize]) && is_flat(self.elements, members)
    }

    fn origin(&self, element: u32) -> Vec3 {
        let e = element as usize;
        let (position, normal) = (self.elements.position_world[e], self.elements.normal_geometric[e]);
        self.tracer.world().offset_origin(self.elements.triangle[e], position, normal)
    }

    fn is_uneven(&mut self, members: &[u32]) -> bool {
        if members.len() < FEWEST {
            return false;
        }
        let elements = self.elements;
        let width = members.iter().map(|&e| elements.area[e as usize].0).sum::<f32>().sqrt();
        let (mut least, mut most) = (RAYS, 0);
        for k in 0..VIEWERS {
            let e = members[(2 * k + 1) * members.len() / (2 * VIEWERS)];
            let frame = frame(elements.normal_geometric[e as usize], elements.half_u_world[e as usize]);
            let origin = self.origin(e);
            let blocked = |&&local: &&Vec3| {
                let direction = to_world(&frame, local);
                self.tracer.occluded(&Ray { origin, direction, t_max: REACH_WIDTHS * width })
            };
            let blocked = self.directions.iter().filter(blocked).count() as u32;
            self.rays += u64::from(RAYS);
            (least, most) = (least.min(blocked), most.max(blocked));
            if most >= least + CHANGE {
                return true;
            }
        }
        false
    }

    /// Parts of a flat patch whose members see the part's middle: a wall that stands on a patch parts it.
    fn part(&mut self, members: Vec<u32>) {
        let mut left = members;
        for _ in 1..MOST_PARTS {
            let Some(&middle) = left.get(left.len() / 2) else { return };
            let from = self.origin(middle);
            self.rays += left.len() as u64;
            let (seen, hidden) =
                left.iter().partition(|&&e| !self.tracer.occluded(&segment(from, self.origin(e))));
            self.parts.push(seen);
            left = hidden;
        }
        self.parts.extend((!left.is_empty()).then_some(left));
    }
}

fn is_flat(elements: &Elements, members: &[u32]) -> bool {
    let mut sum = (Vec3::ZERO, 0.0);
    for &e in members {
        let area = elements.area[e as usize].0;
        sum = (sum.0 + elements.normal_geometric[e as usize] * area, sum.1 + area);
    }
    sum.0.length_squared() >= FLAT * sum.1 * sum.1
}

/// The quarters of the texel rectangle around elements of one chart, those that are not empty; else of the list.
fn quarters(elements: &Elements, members: &[u32]) -> Vec<Vec<u32>> {
    let chart = |e: u32| elements.chart[e as usize];
    if members.iter().any(|&e| chart(e) != chart(members[0])) {
        let at = |k: usize| k * members.len() / 4;
        return (0..4).map(|k| members[at(k)..at(k + 1)].to_vec()).collect();
    }
    let texel = |e: &u32| elements.texel[*e as usize];
    let middle = |of: fn(TexelRef) -> u16| {
        let places = members.iter().map(|e| of(texel(e)));
        let (low, high) = places.fold((u16::MAX, 0), |(low, high), at| (low.min(at), high.max(at)));
        low + (high - low).div_ceil(2)
    };
    let (x, y) = (middle(|texel| texel.x), middle(|texel| texel.y));
    let mut quarters: [Vec<u32>; 4] = std::array::from_fn(|_| Vec::with_capacity(members.len() / 4 + 1));
    for &e in members {
        quarters[usize::from(texel(&e).x >= x) + 2 * usize::from(texel(&e).y >= y)].push(e);
    }
    quarters.into_iter().filter(|quarter| !quarter.is_empty()).collect()
}

/// Puts the parts of every patch in its place.
fn replaced(elements: &Elements, patches: &Patches, parts: impl Iterator<Item = Vec<Vec<u32>>>) -> Patches {
    let mut next = Patches {
        patch_of_element: vec![NO_PATCH; elements.len()],
        elements: Vec::with_capacity(patches.elements.len()),
        first: vec![0],
        ..Patches::default()
    };
    let mut first_part = Vec::with_capacity(patches.len());
    for parts in parts {
        first_part.push(next.len() as u32);
        parts.into_iter().for_each(|part| next.push(elements, part));
    }
    // Buried elements stay with the first part of their patch.
    for (part, &patch) in next.patch_of_element.iter_mut().zip(&patches.patch_of_element) {
        if *part == NO_PATCH && patch != NO_PATCH {
            *part = first_part[patch as usize];
        }
    }
    next
}
