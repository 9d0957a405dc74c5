//! The few patches far brighter than the rest, shot to the nodes one by one.
//!
//! A fixed set of rays meets a small bright patch at one node and misses it at the next: the error is not noise but a
//! pattern, like caustics. Taken out of what rays see, and added in closed form with one ray for visibility, such a
//! patch leaves no pattern. Nothing is counted twice: a ray that hits it brings nothing.

use crate::elements::{Elements, Patches};
use crate::sampling::mixed;
use crate::transport::form_factors::polygon::point_to_polygon_shaded;
use crate::transport::{Tracer, segment_to_surface};
use crate::units::{Irradiance, Radiosity};
use glam::{DVec3, Vec3};

/// A patch is bright beyond this many times the mean radiosity.
const BRIGHT: f32 = 4.0;
/// The most patches that are shot, as a share of the rays of a gather: they cost a ray each as well.
const MOST_SHARE: u32 = 4;
/// A patch fills its rectangle of texels at least to this share.
const FULL: f64 = 0.8;

#[derive(Clone)]
struct Shooter {
    patch: u32,
    corners: [Vec3; 4],
    corners_exact: [DVec3; 4],
    centre: Vec3,
    normal: Vec3,
    radiosity: Vec3,
    power: f32,
}

/// Flat rectangular patches that are shot.
pub struct Bright {
    shooters: Vec<Shooter>,
    /// Where the rays for visibility go: to the middle of a patch, or anywhere on it.
    anywhere: Option<u32>,
}

impl Bright {
    /// Finds them and takes their light out of `radiosity` (one row an element). `None` where no patch stands out.
    pub fn take(
        elements: &Elements,
        patches: &Patches,
        radiosity: &mut [Radiosity],
        gather_rays: u32,
    ) -> Option<Self> {
        let count = patches.len() as u32;
        let mean_of = |patch: u32| {
            let members = patches.elements_of(patch).iter().map(|&e| e as usize);
            let power: DVec3 =
                members.map(|e| radiosity[e].0.as_dvec3() * f64::from(elements.area[e].0)).sum();
            (power / patches.area[patch as usize]).as_vec3()
        };
        let light: Vec<Vec3> = (0..count).map(mean_of).collect();
        let counted = light.iter().zip(&patches.area).zip(&patches.counts).filter(|(_, counts)| **counts);
        let (power, area) = counted.fold((0.0, 0.0), |(power, all), ((light, area), _)| {
            (power + f64::from(light.element_sum()) * area, all + area)
        });
        let limit = BRIGHT * (power / area) as f32;
        let mut shooters: Vec<Shooter> = (0..count)
            .filter(|&p| patches.counts[p as usize] && light[p as usize].element_sum() > limit)
            .filter_map(|p| shooter(elements, patches, p, light[p as usize]))
            .collect();
        shooters.sort_by(|a, b| b.power.total_cmp(&a.power).then(a.patch.cmp(&b.patch)));
        shooters.truncate((gather_rays / MOST_SHARE) as usize);
        for shooter in &shooters {
            patches.elements_of(shooter.patch).iter().for_each(|&e| radiosity[e as usize] = Radiosity::ZERO);
        }
        (!shooters.is_empty()).then_some(Self { shooters, anywhere: None })
    }

    /// The same, but rays for visibility go to some point of a patch, other ones for every element and `seed`.
    pub fn aimed_anywhere(&self, seed: u32) -> Self {
        Self { shooters: self.shooters.clone(), anywhere: Some(seed) }
    }

    /// What all of them send to an element, and the rays that took.
    pub fn irradiance<T: Tracer>(&self, elements: &Elements, element: u32, tracer: &T) -> (Irradiance, u64) {
        let e = element as usize;
        let (position, normal) = (elements.position_world[e], elements.normal_geometric[e]);
        let shading = elements.normal_shading[e];
        let origin = tracer.world().offset_origin(elements.triangle[e], position, normal);
        let (mut sum, mut rays) = (Vec3::ZERO, 0);
        for (number, shooter) in (0..).zip(&self.shooters) {
            if (shooter.centre - position).dot(shooter.normal) >= 0.0 {
                continue;
            }
            let factor = point_to_polygon_shaded(
                position.as_dvec3(),
                normal.as_dvec3(),
                shading.as_dvec3(),
                &shooter.corners_exact,
            ) as f32;
            if factor > 0.0 {
                let [a, b, c, d] = shooter.corners;
                let target = self.anywhere.map_or(shooter.centre, |seed| {
                    let bits = mixed(seed ^ mixed(element ^ mixed(number)));
                    let (s, t) = ((bits >> 16) as f32 / 65536.0, (bits & 0xffff) as f32 / 65536.0);
                    a.lerp(b, s).lerp(d.lerp(c, s), t)
                });
                let ray = segment_to_surface(origin, target, shooter.normal, &[a, b, c]);
                sum += shooter.radiosity * factor * tracer.transmittance(&ray);
                rays += 1;
            }
        }
        (Irradiance(sum), rays)
    }
}

/// The rectangle of a flat patch whose elements fill a rectangle of texels.
fn shooter(elements: &Elements, patches: &Patches, patch: u32, radiosity: Vec3) -> Option<Shooter> {
    let members = patches.elements_of(patch);
    let normal = patches.normal_world[patch as usize];
    if normal.length_squared() < 0.9999 {
        return None;
    }
    let texels = || members.iter().map(|&e| elements.texel[e as usize]);
    let (x0, x1) = (texels().map(|t| t.x).min()?, texels().map(|t| t.x).max()? + 1);
    let (y0, y1) = (texels().map(|t| t.y).min()?, texels().map(|t| t.y).max()? + 1);
    // Elements at a chart's border are shifted and shrunk: the largest shows the grid.
    let extent = |e: usize| elements.half_u_world[e].cross(elements.half_v_world[e]).length();
    let guide = members.iter().map(|&e| e as usize).max_by(|&a, &b| extent(a).total_cmp(&extent(b)))?;
    let (u, v) = (elements.half_u_world[guide] * 2.0, elements.half_v_world[guide] * 2.0);
    let texel = elements.texel[guide];
    let at = |x: u16, y: u16| {
        let (s, t) = (f32::from(x) - f32::from(texel.x) - 0.5, f32::from(y) - f32::from(texel.y) - 0.5);
        elements.position_world[guide] + u * s + v * t
    };
    let area = f64::from(u.cross(v).length()) * f64::from(x1 - x0) * f64::from(y1 - y0);
    let filled = patches.area[patch as usize] / area;
    if !(FULL..=1.02).contains(&filled) {
        return None;
    }
    let mut corners = [at(x0, y0), at(x1, y0), at(x1, y1), at(x0, y1)];
    if (corners[1] - corners[0]).cross(corners[3] - corners[0]).dot(normal) < 0.0 {
        corners.swap(1, 3);
    }
    Some(Shooter {
        patch,
        corners,
        corners_exact: corners.map(|c| c.as_dvec3()),
        centre: (corners[0] + corners[2]) / 2.0,
        normal: normal.normalize(),
        radiosity: radiosity * filled as f32,
        power: radiosity.element_sum() * patches.area[patch as usize] as f32,
    })
}
