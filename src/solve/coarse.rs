//! Elements and patches -> the coarse solution: form factors, then shooting or the matrix.

use super::assemble::Assembler;
use super::{Ledger, Made, Problem, RowSource, Rows, budget};
use crate::direct::{Direct, Faint};
use crate::elements::{Elements, Lookup, Patches};
use crate::error::Result;
use crate::options::SolveOptions;
use crate::plan::Sight;
use crate::progress::Progress;
use crate::transport::Tracer;
use crate::transport::form_factors::Row;
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
    /// Where nothing can be seen.
    pub sight: &'a Sight,
    /// The world.
    pub tracer: &'a T,
}

impl<T> Surfaces<'_, T> {
    /// Whether all rays of an element leave the scene.
    pub fn is_open(&self, element: u32) -> bool {
        self.elements.is_open(element, self.sight)
    }
}

/// What shines on the patches from outside the coarse solution.
pub struct Sources<'a, S> {
    /// Light of bright emitters, by element.
    pub direct: &'a Direct,
    /// The sum of faint emitters.
    pub faint: Option<&'a Faint<'a>>,
    /// Radiance from a direction, W/(m² sr).
    pub sky: S,
}

/// The coarse solution; by default of nothing.
#[derive(Default)]
pub struct Coarse {
    /// Irradiance of each patch that no bright emitter sent straight: sky, faint emitters, other patches.
    pub irradiance: Vec<Irradiance>,
    /// Rays sent.
    pub rays: u64,
    /// Form factors that are not zero, as far as they were kept; 0 where rows were made again at every sweep.
    pub form_factors: u64,
    /// Shots made.
    pub shots: u64,
    /// Sweeps over all patches.
    pub sweeps: u64,
    /// Share of the reflected power that was not distributed.
    pub unshot_fraction: f64,
    /// Bound on Σ A |b* − b| of what stopping there leaves out, as a share of the power that was to be distributed;
    /// see [`super::Solution::error_bound`].
    pub error_bound: f64,
    /// Where the power went.
    pub ledger: Ledger,
}

/// Solves for the light that was reflected at least once. Form factors and what the solver makes of them may take
/// `memory_bytes`: beyond that the matrix solver fails with [`Error::TooLarge`], and the progressive solver forgets
/// its rows and makes them again at every sweep.
///
/// [`Error::TooLarge`]: crate::Error::TooLarge
pub fn coarse<T: Tracer, S: Fn(Vec3) -> Radiance + Sync>(
    surfaces: &Surfaces<T>,
    sources: &Sources<S>,
    options: &SolveOptions,
    seed: u32,
    memory_bytes: u64,
    progress: &mut Progress,
) -> Result<Coarse> {
    let patches = surfaces.patches.len();
    progress.restart(2 * patches as u64);
    let assembler = Assembler::new(surfaces, &sources.sky, options, seed);
    let keep = budget::keep_rows(&assembler, options, memory_bytes)?;
    let (faint, faint_rays) = faint_irradiance(surfaces, sources.faint, progress);
    let outside = |beyond: &[[f32; 3]]| -> Vec<Irradiance> {
        let sky = beyond.iter().map(|beyond| Irradiance(Vec3::from_array(*beyond) * PI));
        sky.zip(&faint).map(|(sky, faint)| sky + *faint).collect()
    };
    // A cancelled run leaves the rest of the rows empty.
    let watched = Made::new(patches, |patch, row: &mut Row| {
        row.clear();
        if !progress.cancelled() {
            assembler.row(patch, row);
            progress.advance(1);
        }
    });
    let (solution, outside, form_factors) = if keep {
        let rows = Rows::collect(&watched)?;
        let (outside, form_factors) = (outside(rows.beyond()), rows.entries() as u64);
        let problem = problem(surfaces, sources.direct, &outside, rows)?;
        (super::solve(&problem, options, memory_bytes, progress)?, outside, form_factors)
    } else {
        let outside = outside(&beyond(&watched));
        let problem = problem(surfaces, sources.direct, &outside, watched)?;
        (super::solve_remaking(&problem, options, progress), outside, 0)
    };
    let irradiance = solution
        .received
        .iter()
        .zip(&outside)
        .map(|(reflected, outside)| Irradiance(reflected.max(DVec3::ZERO).as_vec3()) + *outside);
    let emitted = solution.ledger.emitted.element_sum();
    let error_bound = solution.error_bound.element_sum();
    Ok(Coarse {
        irradiance: irradiance.collect(),
        rays: assembler.rays() + faint_rays,
        form_factors,
        shots: solution.shots,
        sweeps: solution.sweeps,
        unshot_fraction: solution.unshot_fraction,
        error_bound: if emitted > 0.0 { error_bound / emitted } else { 0.0 },
        ledger: solution.ledger,
    })
}

/// What rows bring from beyond the scene, and nothing else of them.
fn beyond(source: &impl RowSource) -> Vec<[f32; 3]> {
    (0..source.len())
        .into_par_iter()
        .map_init(Row::default, |row, patch| {
            source.row(patch, row);
            row.beyond.map(|radiance| radiance as f32)
        })
        .collect()
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
fn problem<T, R: RowSource>(
    surfaces: &Surfaces<T>,
    direct: &Direct,
    outside: &[Irradiance],
    rows: R,
) -> Result<Problem<R>> {
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
