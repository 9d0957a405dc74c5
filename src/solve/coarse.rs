//! Elements and patches -> the coarse solution: rows by rays, then shooting.

use super::{Ledger, Problem, Rows};
use crate::direct::{Direct, Faint};
use crate::elements::{Elements, Lookup, Patches};
use crate::error::Result;
use crate::options::SolveOptions;
use crate::progress::Progress;
use crate::transport::form_factors::{Landings, Row, SurfacePoint, rays::ray_row};
use crate::transport::{Ray, Tracer};
use crate::units::{Irradiance, Radiance};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;

/// What elements are made of, as the coarse solution sees them.
pub struct Surfaces<'a, T> {
    /// Receivers.
    pub elements: &'a Elements,
    /// From hits to elements.
    pub lookup: &'a Lookup<'a>,
    /// Shooters.
    pub patches: &'a Patches,
    /// The world.
    pub tracer: &'a T,
}

/// The coarse solution.
pub struct Coarse {
    /// Irradiance of each patch that no bright emitter sent straight: sky, faint emitters, other patches.
    pub irradiance: Vec<Irradiance>,
    /// Rays sent.
    pub rays: u64,
    /// Shots made.
    pub shots: u64,
    /// Share of the reflected power that was not distributed.
    pub unshot_fraction: f64,
    /// Where the power went.
    pub ledger: Ledger,
}

/// Solves for the light that was reflected at least once.
pub fn coarse<T: Tracer>(
    surfaces: &Surfaces<T>,
    direct: &Direct,
    faint: Option<&Faint>,
    sky: &(impl Fn(Vec3) -> Radiance + Sync),
    options: &SolveOptions,
    memory_bytes: u64,
    progress: &mut Progress,
) -> Result<Coarse> {
    let patches = surfaces.patches;
    progress.restart(2 * patches.len() as u64);
    let ray_count = options.rays_per_patch.next_power_of_two();
    let rows = Rows::collect(&super::rows::Made::new(patches.len(), |patch, row: &mut Row| {
        row.clear();
        if !progress.cancelled() {
            sample_row(surfaces, patch as u32, ray_count, sky, row);
            progress.advance(1);
        }
    }))?;
    let (faint, faint_rays) = faint_irradiance(surfaces, faint, progress);
    let outside: Vec<Irradiance> = rows
        .beyond()
        .iter()
        .zip(&faint)
        .map(|(beyond, faint)| Irradiance(Vec3::from_array(*beyond) * PI) + *faint)
        .collect();
    let problem = problem(surfaces, direct, &outside, rows)?;

    let solution = super::solve(&problem, options, memory_bytes, progress)?;
    let irradiance = solution
        .received
        .iter()
        .zip(&outside)
        .map(|(reflected, outside)| Irradiance(reflected.max(DVec3::ZERO).as_vec3()) + *outside);
    Ok(Coarse {
        irradiance: irradiance.collect(),
        rays: patches.len() as u64 * u64::from(ray_count) + faint_rays,
        shots: solution.shots,
        unshot_fraction: solution.unshot_fraction,
        ledger: solution.ledger,
    })
}

/// The form factors of one patch: where its rays land. What they bring from the sky is kept with the row.
fn sample_row<T: Tracer>(
    surfaces: &Surfaces<T>,
    patch: u32,
    rays: u32,
    sky: &impl Fn(Vec3) -> Radiance,
    row: &mut Row,
) {
    let Surfaces { elements, lookup, patches, tracer } = surfaces;
    let members = patches.elements_of(patch);
    let point = |[u, _]: [f32; 2]| {
        let e = members[((u * members.len() as f32) as usize).min(members.len() - 1)] as usize;
        let (position, normal) = (elements.position_world[e], elements.normal_geometric[e]);
        SurfacePoint {
            position_world: tracer.world().offset_origin(elements.triangle[e], position, normal),
            normal,
        }
    };
    let land = |ray: &Ray, landings: &mut Landings| {
        let left = tracer.walk(ray, |hit, share| {
            if let Some(patch) = lookup.element_at(hit).map(|e| patches.patch_of_element[e as usize])
                && (patch as usize) < patches.len()
            {
                landings.hit(patch, share.element_sum() / 3.0);
            }
        });
        if left != Vec3::ZERO {
            let share = left.element_sum() / 3.0;
            landings.miss(share, (left / share * sky(ray.direction).0).to_array());
        }
    };
    ray_row(patch, rays, point, land, &mut Landings::default(), row);
}

/// Faint emitters, asked at the middle element of each patch.
fn faint_irradiance<T: Tracer>(
    surfaces: &Surfaces<T>,
    faint: Option<&Faint>,
    progress: &Progress,
) -> (Vec<Irradiance>, u64) {
    let patches = surfaces.patches;
    let Some(faint) = faint else { return (vec![Irradiance::ZERO; patches.len()], 0) };
    let lit: Vec<(Irradiance, u64)> = (0..patches.len() as u32)
        .into_par_iter()
        .map(|patch| {
            let members = patches.elements_of(patch);
            if progress.cancelled() || members.is_empty() {
                return (Irradiance::ZERO, 0);
            }
            faint.irradiance(members[members.len() / 2], surfaces.tracer)
        })
        .collect();
    (lit.iter().map(|l| l.0).collect(), lit.iter().map(|l| l.1).sum())
}

/// Power that a patch reflects of what arrives from outside the coarse solution, element by element, so that no
/// energy is lost between the fine and the coarse: s = Σ Aρ(E_direct + E_outside) / A.
fn problem<T>(
    surfaces: &Surfaces<T>,
    direct: &Direct,
    outside: &[Irradiance],
    rows: Rows,
) -> Result<Problem> {
    let Surfaces { elements, patches, .. } = surfaces;
    let reflectance: Vec<_> = patches.reflectance.iter().map(|r| r.0.as_dvec3()).collect();
    let source = (0..patches.len() as u32)
        .into_par_iter()
        .map(|patch| {
            let outside = outside[patch as usize];
            let members = patches.elements_of(patch);
            let power: DVec3 = members
                .iter()
                .map(|&e| {
                    let e = e as usize;
                    let leaving = elements.reflectance[e] * (direct.irradiance[e] + outside);
                    leaving.0.as_dvec3() * f64::from(elements.area[e].0)
                })
                .sum();
            power / patches.area[patch as usize]
        })
        .collect();
    Problem::new(patches.area.clone(), reflectance, source, rows)
}
