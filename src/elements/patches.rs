//! Elements grouped into patches, which carry interreflected light in the coarse solution.

use super::Elements;
use super::cells::{Cell, cells};
use super::merge::merge;
use crate::units::Reflectance;
use glam::{DVec3, Vec3};
use std::ops::Range;

/// No patch: there are none, since all elements are buried.
pub const NO_PATCH: u32 = u32::MAX;

/// Cells are not joined below this number, however few patches are wanted: a patch that lies on both sides of a wall
/// carries light through it, which costs more error than the rays of a patch cost time.
pub(super) const MOST: usize = 1 << 16;

/// A partition of the valid elements.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Patches {
    /// Patch of every element. An invalid element belongs to the patch around it, so that rays which hit its texel
    /// find one; where all is buried to the nearest of its chart, of its surface, or any. [`NO_PATCH`] only if there
    /// are no patches.
    pub patch_of_element: Vec<u32>,
    /// Valid elements, patch by patch; inside a patch along a Z-order curve of its chart, so that evenly spaced places
    /// in the list are evenly spread over the patch.
    pub elements: Vec<u32>,
    /// Where every patch begins in `elements`; one more than there are patches.
    pub first: Vec<u32>,
    /// Area of the valid elements, m².
    pub area: Vec<f64>,
    /// Mean reflectance by area.
    pub reflectance: Vec<Reflectance>,
    /// Mean position by area, world metres relative to the scene's origin.
    pub position_world: Vec<Vec3>,
    /// Mean geometric normal by area; shorter than 1 on curved patches.
    pub normal_world: Vec<Vec3>,
    /// What its random choices hang on: its place on its surface, whatever other patches there are.
    pub key: Vec<u32>,
    /// Whether its first element is in a chart that counts; see [`patches`].
    pub counts: Vec<bool>,
    /// Mean area of those that count, m².
    pub mean_area: f64,
}

impl Patches {
    /// Number of patches.
    pub fn len(&self) -> usize {
        self.area.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.area.is_empty()
    }

    /// Number of valid elements of every patch.
    pub fn size_elements(&self) -> Vec<u32> {
        self.first.windows(2).map(|range| range[1] - range[0]).collect()
    }

    /// Valid elements of a patch.
    pub fn elements_of(&self, patch: u32) -> &[u32] {
        &self.elements[self.range_of(patch)]
    }

    /// Finds which patches count, their mean area, and the keys of all.
    pub(super) fn count(&mut self, elements: &Elements, counts: impl Fn(usize) -> bool) {
        let key = |patch: u32| {
            let Some(&first) = self.elements_of(patch).first() else { return patch };
            let chart = &elements.charts[elements.chart[first as usize] as usize];
            let side = 2 * chart.surface + u32::from(chart.back);
            // Two odd constants: the golden ratio's, and one of MurmurHash3's.
            let place = side.wrapping_mul(0x9e37_79b9) ^ chart.source;
            place.wrapping_mul(0xcc9e_2d51) ^ (first - chart.elements.start)
        };
        self.key = (0..self.len() as u32).map(key).collect();
        let chart = |element: u32| elements.chart[element as usize] as usize;
        let of_patch =
            |patch: u32| self.elements_of(patch).first().is_some_and(|&first| counts(chart(first)));
        self.counts = (0..self.len() as u32).map(of_patch).collect();
        let counted = self.counts.iter().zip(&self.area).filter(|(counts, _)| **counts);
        let (number, area) = counted.fold((0_u32, 0.0), |(number, area), (_, own)| (number + 1, area + own));
        self.mean_area = area / f64::from(number.max(1));
    }

    /// Appends a patch of valid elements.
    pub(super) fn push(&mut self, elements: &Elements, members: impl IntoIterator<Item = u32>) {
        let (mut area, mut color, mut position, mut normal) = (0.0, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let patch = self.len() as u32;
        for e in members {
            let i = e as usize;
            self.patch_of_element[i] = patch;
            self.elements.push(e);
            let a = f64::from(elements.area[i].0);
            area += a;
            color += elements.reflectance[i].0.as_dvec3() * a;
            position += elements.position_world[i].as_dvec3() * a;
            normal += elements.normal_geometric[i].as_dvec3() * a;
        }
        self.first.push(self.elements.len() as u32);
        self.area.push(area);
        self.reflectance.push(Reflectance::clamped((color / area).as_vec3()));
        self.position_world.push((position / area).as_vec3());
        self.normal_world.push((normal / area).as_vec3());
    }

    /// Where the elements of a patch stand in [`Self::elements`].
    pub fn range_of(&self, patch: u32) -> Range<usize> {
        self.first[patch as usize] as usize..self.first[patch as usize + 1] as usize
    }
}

/// Cuts every chart into square blocks of comparable area, about `wanted` in all; curved charts more finely, and at
/// least one a chart. Where that makes more than 65,536, small neighbouring ones share a patch: of one surface and
/// direction first, of any surface where that does not suffice. Ordered by their first element. `wanted` is the number of patches of
/// the charts that count; the others are cut as finely.
pub fn patches(elements: &Elements, wanted: u32, counts: impl Fn(usize) -> bool) -> Patches {
    patches_within(elements, wanted, MOST, counts)
}

/// The same where cells are joined beyond `most` patches, or 1.5 × `wanted` if that is more.
pub(super) fn patches_within(
    elements: &Elements,
    wanted: u32,
    most: usize,
    counts: impl Fn(usize) -> bool,
) -> Patches {
    let wanted = wanted.max(1);
    let (order, cells, target) = cells(elements, wanted, &counts);
    let groups = merge(elements, &order, &cells, target, most.max(wanted as usize + wanted as usize / 2));
    let mut patches = collect(elements, &order, &cells, groups);
    patches.count(elements, counts);
    patches
}

/// Numbers the groups of cells by their lowest element and gathers what is known of each.
fn collect(elements: &Elements, order: &[u32], cells: &[Cell], mut groups: Vec<Vec<u32>>) -> Patches {
    let lowest = |group: &Vec<u32>| {
        let members = group.iter().flat_map(|&c| &order[cells[c as usize].range.clone()]);
        members.copied().min().unwrap_or(u32::MAX)
    };
    groups.sort_by_cached_key(lowest);
    let mut patches = Patches {
        patch_of_element: vec![NO_PATCH; elements.len()],
        elements: Vec::with_capacity(elements.len()),
        first: vec![0],
        ..Patches::default()
    };
    for (patch, group) in (0..).zip(groups) {
        let members = || group.iter().flat_map(|&c| &order[cells[c as usize].range.clone()]).copied();
        members().for_each(|e| patches.patch_of_element[e as usize] = patch);
        patches.push(elements, members().filter(|&e| elements.valid[e as usize]));
    }
    adopt_buried(elements, order, &mut patches);
    patches
}

/// Gives elements without a patch that of their neighbour along the curve, of their surface, or the first.
fn adopt_buried(elements: &Elements, order: &[u32], patches: &mut Patches) {
    if patches.is_empty() {
        return;
    }
    let mut of_surface: Vec<Option<u32>> = Vec::new();
    let mut orphans = Vec::new();
    for (i, chart) in elements.charts.iter().enumerate() {
        let surface = chart.surface as usize;
        of_surface.resize(of_surface.len().max(surface + 1), None);
        // Charts stand one after the other in `order`, as their elements do.
        let members = &order[chart.elements.start as usize..chart.elements.end as usize];
        let patch = &mut patches.patch_of_element;
        let Some(first) = members.iter().map(|&e| patch[e as usize]).find(|&p| p != NO_PATCH) else {
            orphans.push(i);
            continue;
        };
        of_surface[surface].get_or_insert(first);
        members.iter().fold(first, |last, &e| {
            let own = &mut patch[e as usize];
            if *own == NO_PATCH {
                *own = last;
            }
            *own
        });
    }
    for i in orphans {
        let chart = &elements.charts[i];
        let range = chart.elements.start as usize..chart.elements.end as usize;
        patches.patch_of_element[range].fill(of_surface[chart.surface as usize].unwrap_or(0));
    }
}
