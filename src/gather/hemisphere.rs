//! One gather: a fixed hemisphere of rays.

use super::Surroundings;
use super::openings::Openings;
use crate::elements::Elements;
use crate::sampling::{cosine_hemisphere, frame, seeded, sobol4, to_world};
use crate::transport::{ClearTracer, Hit, Ray, Tracer};
use crate::units::{Irradiance, Radiosity};
use glam::Vec3;
use std::f32::consts::PI;

/// Directions about +z with density cosθ/π, the same for every gather: neighbours err alike, so the result is
/// smooth. Ordered so that rays sent one after the other are near each other.
pub struct DirectionSet {
    local: Vec<Vec3>,
    /// Where a sky is lit, what finds the borders of its openings.
    openings: Option<Openings>,
}

/// The outcome of one gather.
#[derive(Clone, Copy, Debug)]
pub struct Gathered {
    /// Irradiance from all hits and the sky.
    pub irradiance: Irradiance,
    /// Harmonic mean of the distances to the hits, metres; infinite when all rays left.
    pub distance_m: f32,
}

impl DirectionSet {
    /// About `rays` directions; at least 16. Other ones for every `seed`. `sky_is_lit` tells whether rays that leave
    /// bring light.
    pub fn new(rays: u32, seed: u32, sky_is_lit: bool) -> Self {
        let mut points: Vec<[f32; 4]> = sobol4(rays.max(16), 0, seeded(seed, 3));
        let key = |p: &[f32; 4]| {
            let quantise = |x: f32| ((x * 64.0) as u32).min(63);
            morton(quantise(p[0]), quantise(p[1]))
        };
        points.sort_by_key(key);
        let local = points.iter().map(|p| cosine_hemisphere(p[0], p[1])).collect();
        let square = || points.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>();
        Self { local, openings: sky_is_lit.then(|| Openings::new(&square())) }
    }

    /// Number of rays of one gather.
    pub fn len(&self) -> usize {
        self.local.len()
    }

    /// Never true: there are at least 16 directions.
    pub fn is_empty(&self) -> bool {
        self.local.is_empty()
    }

    /// Gathers at an element; tells also how many rays that took.
    pub fn gather<T: Tracer, S: Fn(&Hit) -> Radiosity>(
        &self,
        elements: &Elements,
        element: u32,
        around: &Surroundings<T, S>,
    ) -> (Gathered, u64) {
        if elements.is_open(element, around.sight) {
            self.gather_with(elements, element, around, &ClearTracer::new(around.tracer.world()))
        } else {
            self.gather_with(elements, element, around, around.tracer)
        }
    }

    fn gather_with<T: Tracer, U: Tracer, S: Fn(&Hit) -> Radiosity>(
        &self,
        elements: &Elements,
        element: u32,
        around: &Surroundings<T, S>,
        tracer: &U,
    ) -> (Gathered, u64) {
        let e = element as usize;
        let (geometric, shading) = (elements.normal_geometric[e], elements.normal_shading[e]);
        let world = tracer.world();
        let origin = world.offset_origin(elements.triangle[e], elements.position_world[e], geometric);
        let frame = frame(shading, elements.half_u_world[e]);
        let (mut reflected, mut sky, mut nearness) = (Vec3::ZERO, Vec3::ZERO, 0.0_f32);
        let mut seen =
            self.openings.as_ref().filter(|_| U::SENDS).map(|openings| (openings, openings.unseen()));
        for (index, &local) in self.local.iter().enumerate() {
            let direction = to_world(&frame, local);
            if direction.dot(geometric) <= 0.0 {
                if let Some((openings, seen)) = &mut seen {
                    openings.note(seen, index, Vec3::ZERO, Vec3::ZERO);
                }
                continue;
            }
            let ray = Ray::unbounded(origin, direction);
            let mut first = f32::INFINITY;
            let left = tracer.walk(&ray, |hit: &Hit, share: Vec3| {
                first = first.min(hit.t);
                reflected += share * (around.radiosity)(hit).0;
            });
            let above = if left == Vec3::ZERO { Vec3::ZERO } else { left * around.sky.radiance(direction).0 };
            sky += above;
            if let Some((openings, seen)) = &mut seen {
                openings.note(seen, index, left, above);
            }
            nearness += 1.0 / first;
        }
        let count = self.local.len() as f32;
        let ask = |local: Vec3| {
            let direction = to_world(&frame, local);
            if direction.dot(geometric) <= 0.0 {
                return Vec3::ZERO;
            }
            tracer.transmittance(&Ray::unbounded(origin, direction)) * around.sky.radiance(direction).0
        };
        let mended = seen.and_then(|(openings, seen)| openings.mean(&seen, ask));
        let (sky, sky_rays) = mended.map_or((sky, 0), |(mean, rays)| (mean * count, rays));
        let none = (Irradiance::ZERO, 0);
        let (faint, faint_rays) = around.faint.map_or(none, |faint| faint.irradiance(element, tracer));
        let (bright, bright_rays) =
            around.bright.map_or(none, |bright| bright.irradiance(elements, element, tracer));
        let gathered = Gathered {
            irradiance: Irradiance((reflected + sky * PI) / count) + faint + bright,
            distance_m: count / nearness.max(f32::MIN_POSITIVE),
        };
        let rays = faint_rays + bright_rays + sky_rays + self.local.len() as u64;
        (gathered, if U::SENDS { rays } else { 0 })
    }
}

fn morton(x: u32, y: u32) -> u32 {
    (0..6).fold(0, |code, bit| code | (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1))
}
