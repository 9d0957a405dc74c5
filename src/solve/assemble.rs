//! Elements and patches -> the form factors of a patch, by rays, by hemicubes or in closed form.

use super::coarse::Surfaces;
use super::facets::Facets;
use super::pairs::Pairs;
use super::rows::RowSource;
use crate::elements::{Elements, Patches};
use crate::options::{FormFactors, SolveOptions};
use crate::sampling::seeded;
use crate::transport::form_factors::hemicube::Hemicube;
use crate::transport::form_factors::rays::RaySet;
use crate::transport::form_factors::{Landings, Row, SurfacePoint};
use crate::transport::{ClearTracer, Ray, Tracer};
use crate::units::Radiance;
use glam::Vec3;
use std::sync::atomic::{AtomicU64, Ordering};

/// Pixels along the edge of a hemicube's top: 768 in all.
const RESOLUTION: u32 = 16;
/// Hemicubes over a patch of mean area and more; one is over the smaller.
const CUBES: usize = 4;
/// Patches send rays in proportion to the root of their area, down to this share of what a patch of mean area sends.
const FEWEST_SHARE: u32 = 8;
/// Nor fewer rays than this.
const FEWEST: u32 = 4;

/// Makes rows.
pub(super) struct Assembler<'a, T, S> {
    surfaces: &'a Surfaces<'a, T>,
    sky: &'a S,
    method: Method<'a, T>,
    /// Sets of 1, 2, 4, … rays, as far as they are needed.
    sets: Vec<RaySet>,
    /// Area of the elements of [`Patches`] from the first of their patch on, m².
    area_up_to: Vec<f32>,
    /// Which of them each patch uses.
    set_of: Vec<u8>,
    /// The one of a patch of mean area.
    mean_set: u8,
    /// Patches that see nothing.
    open: Vec<bool>,
    /// Of the samples.
    seed: u32,
    rays: AtomicU64,
}

enum Method<'a, T> {
    Rays,
    Hemicubes(Hemicube),
    /// All pairs.
    Closed(Pairs<'a, T>),
    /// Near pairs, the others by rays.
    Mixed(Pairs<'a, T>),
}

impl<'a, T: Tracer, S: Fn(Vec3) -> Radiance + Sync> Assembler<'a, T, S> {
    pub fn new(surfaces: &'a Surfaces<'a, T>, sky: &'a S, options: &SolveOptions, seed: u32) -> Self {
        let mean = options.rays_per_patch.clamp(1, 1 << 16).next_power_of_two();
        let set_of = set_of(&surfaces.patches.area, surfaces.patches.mean_area, mean);
        let mean_set = mean.trailing_zeros() as u8;
        let pairs = |wanted: &(dyn Fn(u32) -> bool + Sync)| {
            Pairs::new(surfaces, Facets::new(surfaces.elements, surfaces.patches, wanted), seed)
        };
        let method = match options.form_factors {
            FormFactors::Ray => Method::Rays,
            FormFactors::Hemicube => Method::Hemicubes(Hemicube::new(RESOLUTION)),
            FormFactors::Analytic => Method::Closed(pairs(&|_| true)),
            FormFactors::Auto => Method::Mixed(pairs(&|patch| set_of[patch as usize] >= mean_set)),
        };
        let most = set_of.iter().copied().max().unwrap_or(0);
        let sets = (0..=most).map(|log| RaySet::new(1 << log)).collect();
        let area_up_to = area_up_to(surfaces.elements, surfaces.patches);
        let sees_nothing =
            |patch: u32| surfaces.patches.elements_of(patch).iter().all(|&e| surfaces.is_open(e));
        let open = (0..surfaces.patches.len() as u32).map(sees_nothing).collect();
        Self {
            surfaces,
            sky,
            method,
            sets,
            area_up_to,
            set_of,
            mean_set,
            open,
            seed,
            rays: AtomicU64::new(0),
        }
    }

    /// Rays sent so far.
    pub fn rays(&self) -> u64 {
        self.rays.load(Ordering::Relaxed)
    }

    /// Whether the patch is of mean area at least.
    fn is_large(&self, patch: u32) -> bool {
        self.set_of[patch as usize] >= self.mean_set
    }

    /// The start of a ray from the middle of an element.
    fn place(&self, element: u32) -> SurfacePoint {
        let (elements, e) = (self.surfaces.elements, element as usize);
        let (position, normal) = (elements.position_world[e], elements.normal_geometric[e]);
        let world = self.surfaces.tracer.world();
        SurfacePoint { position_world: world.offset_origin(elements.triangle[e], position, normal), normal }
    }

    /// Where a ray's light goes.
    fn land(&self, ray: &Ray, landings: &mut Landings) {
        let Surfaces { lookup, patches, tracer, .. } = self.surfaces;
        let left = tracer.walk(ray, |hit, share| {
            if let Some(patch) = lookup.element_at(hit).map(|e| patches.patch_of_element[e as usize])
                && (patch as usize) < patches.len()
            {
                landings.hit(patch, share.element_sum() / 3.0);
            }
        });
        if left != Vec3::ZERO {
            let share = left.element_sum() / 3.0;
            landings.miss(share, (left / share * (self.sky)(ray.direction).0).to_array());
        }
    }

    /// The row of a patch that sees nothing but what is beyond the scene: the same rays, none of them sent.
    fn open_row(&self, patch: u32, row: &mut Row) {
        let clear = ClearTracer::new(self.surfaces.tracer.world());
        let beyond = |ray: &Ray, landings: &mut Landings| {
            let left = clear.walk(ray, |_, _| ()).element_sum() / 3.0;
            landings.miss(left, (self.sky)(ray.direction).0.to_array());
        };
        self.rays_of(patch, beyond, row);
    }

    fn ray_row(&self, patch: u32, row: &mut Row) -> u64 {
        self.rays_of(patch, |ray, to| self.land(ray, to), row)
    }

    /// Sends the patch's rays; tells how many.
    fn rays_of(&self, patch: u32, land: impl Fn(&Ray, &mut Landings), row: &mut Row) -> u64 {
        let range = self.surfaces.patches.range_of(patch);
        let (members, up_to) = (&self.surfaces.patches.elements[range.clone()], &self.area_up_to[range]);
        let whole = up_to.last().copied().unwrap_or(0.0);
        let place = |[along, _]: [f32; 2]| {
            let at = up_to.partition_point(|&area| area <= along * whole);
            self.place(members[at.min(members.len() - 1)])
        };
        let set = &self.sets[usize::from(self.set_of[patch as usize])];
        let mut landings = Landings::for_rays(set.len());
        let key = seeded(self.seed, self.surfaces.patches.key[patch as usize]);
        set.row(key, place, land, &mut landings, row);
        u64::from(set.len())
    }

    fn hemicube_row(&self, cube: &Hemicube, patch: u32, row: &mut Row) -> u64 {
        let members = self.surfaces.patches.elements_of(patch);
        let count = if self.is_large(patch) { CUBES.min(members.len()) } else { 1 };
        let middle = |k: usize| members[(2 * k + 1) * members.len() / (2 * count)];
        let places: Vec<_> = (0..count).map(|k| self.place(middle(k))).collect();
        cube.row(patch, &places, |ray, to| self.land(ray, to), &mut Landings::default(), row);
        (count * cube.len()) as u64
    }
}

impl<T: Tracer, S: Fn(Vec3) -> Radiance + Sync> RowSource for Assembler<'_, T, S> {
    fn len(&self) -> usize {
        self.surfaces.patches.len()
    }

    fn row(&self, patch: usize, row: &mut Row) {
        let number = patch as u32;
        let rays = match &self.method {
            _ if self.open[patch] => {
                self.open_row(number, row);
                0
            }
            Method::Rays => self.ray_row(number, row),
            Method::Hemicubes(cube) => self.hemicube_row(cube, number, row),
            Method::Closed(pairs) => {
                let seen = self.ray_row(number, row);
                seen + pairs.replace_all(number, seen, row)
            }
            // Of small patches many fill the view that one large one would: their noise averages.
            Method::Mixed(pairs) if self.is_large(number) => {
                let seen = self.ray_row(number, row);
                seen + pairs.replace_near(number, seen, row)
            }
            Method::Mixed(_) => self.ray_row(number, row),
        };
        self.rays.fetch_add(rays, Ordering::Relaxed);
    }

    fn entries(&self) -> usize {
        let patches = self.len();
        match &self.method {
            Method::Rays | Method::Mixed(_) => {
                self.set_of.iter().map(|&set| patches.min(self.sets[usize::from(set)].len() as usize)).sum()
            }
            Method::Hemicubes(cube) => patches.saturating_mul(patches.min(CUBES * cube.len())),
            Method::Closed(_) => patches.saturating_mul(patches),
        }
    }
}

fn area_up_to(elements: &Elements, patches: &Patches) -> Vec<f32> {
    let mut sums: Vec<f32> = patches.elements.iter().map(|&e| elements.area[e as usize].0).collect();
    for patch in 0..patches.len() as u32 {
        let mut sum = 0.0;
        for area in &mut sums[patches.range_of(patch)] {
            sum += *area;
            *area = sum;
        }
    }
    sums
}

/// Logarithms of the rays that patches send: `mean` (a power of two) for one of mean area. What a patch sends and receives grows with
/// its area, and its noise with the root of its rays.
fn set_of(area: &[f64], mean_area: f64, mean: u32) -> Vec<u8> {
    let fewest = (mean / FEWEST_SHARE).max(FEWEST).min(mean);
    area.iter()
        .map(|area| {
            let wanted = f64::from(mean) * (area / mean_area).sqrt();
            (wanted as u32).clamp(fewest, 2 * mean).next_power_of_two().trailing_zeros() as u8
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_patches_send_few_rays_and_equal_ones_the_same() {
        assert_eq!(set_of(&[3.0; 5], 3.0, 64), [6; 5]);
        assert_eq!(set_of(&[], 0.0, 64), [0u8; 0]);
        let mut area = vec![1.0; 100];
        area[0] = 1e-9;
        area[1] = 1e9;
        let sets = set_of(&area, area.iter().sum::<f64>() / 100.0, 64);
        assert_eq!((sets[0], sets[1]), (3, 7));
        assert_eq!(set_of(&[1.0, 1e-9], 0.5, 1)[1], 0);
    }
}
