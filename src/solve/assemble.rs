//! Patches -> rows of form factors, by the rays each patch sends.

use crate::elements::{Elements, Lookup, Patches};
use crate::progress::Progress;
use crate::sampling::{cosine_hemisphere, frame, sobol4, to_world};
use crate::transport::{Hit, Ray, Tracer};
use crate::units::{Irradiance, Radiance};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;

/// What the rays of one patch met.
#[derive(Clone, Debug, Default)]
pub struct SampledRow {
    /// `(patch, share of the rays)`, ascending.
    pub to: Vec<(u32, f32)>,
    /// Share of the rays that left the scene.
    pub escaped: f32,
    /// Irradiance from the sky, mean over the patch.
    pub sky: Irradiance,
}

/// Sends `rays` cosine-distributed rays from every patch: the share that lands on patch j is the form factor F_ij
/// (Malley's method). What lands on sides that take no part is absorbed: it is in no column and does not escape.
pub fn sample_rows<T: Tracer>(
    elements: &Elements,
    lookup: &Lookup,
    patches: &Patches,
    tracer: &T,
    sky: &(impl Fn(Vec3) -> Radiance + Sync),
    rays: u32,
    progress: &Progress,
) -> Vec<SampledRow> {
    let points = sobol4(rays, 0, 5);
    (0..patches.len() as u32)
        .into_par_iter()
        .map(|patch| {
            if progress.cancelled() {
                return SampledRow::default();
            }
            let row = sample_row(elements, lookup, patches, tracer, sky, &points, patch);
            progress.advance(1);
            row
        })
        .collect()
}

fn sample_row<T: Tracer>(
    elements: &Elements,
    lookup: &Lookup,
    patches: &Patches,
    tracer: &T,
    sky: &impl Fn(Vec3) -> Radiance,
    points: &[[f32; 4]],
    patch: u32,
) -> SampledRow {
    let members = patches.elements_of(patch);
    // Successive patches turn the set by the powers of the golden ratio's cousin for four dimensions.
    let turn = |x: f32, ratio: f64| {
        let y = x + (f64::from(patch) * ratio).fract() as f32;
        if y >= 1.0 { y - 1.0 } else { y }
    };
    let mut hits: Vec<(u32, f32)> = Vec::with_capacity(points.len());
    let (mut escaped, mut sky_sum) = (0.0_f32, Vec3::ZERO);
    let share = 1.0 / points.len() as f32;
    for p in points {
        let pick = turn(p[0], 0.856_674_883_854_502) * members.len() as f32;
        let e = members[(pick as usize).min(members.len() - 1)] as usize;
        let normal = elements.normal_geometric[e];
        let frame = frame(normal, elements.half_u_world[e]);
        let local = cosine_hemisphere(turn(p[2], 0.628_706_720_807_263_5), turn(p[3], 0.538_597_250_723_152_6));
        let direction = to_world(&frame, local);
        let origin = tracer.world().offset_origin(elements.triangle[e], elements.position_world[e], normal);
        let ray = Ray::unbounded(origin, direction);
        let left = tracer.walk(&ray, |hit: &Hit, weight: Vec3| {
            if let Some(element) = lookup.element_at(hit) {
                hits.push((patches.patch_of_element[element as usize], weight.element_sum() / 3.0 * share));
            }
        });
        if left != Vec3::ZERO {
            escaped += left.element_sum() / 3.0 * share;
            sky_sum += left * sky(direction).0;
        }
    }
    hits.sort_by_key(|h| h.0);
    let mut to: Vec<(u32, f32)> = Vec::new();
    for (patch, weight) in hits {
        match to.last_mut() {
            Some(last) if last.0 == patch => last.1 += weight,
            _ => to.push((patch, weight)),
        }
    }
    SampledRow { to, escaped, sky: Irradiance(sky_sum * (PI * share)) }
}
