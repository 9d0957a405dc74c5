//! Point and spot lamps: E = I cosθ/d², or with Blender's Soft Falloff E = I cosθ/(d² + r²).

use super::{Emitter, Receiver, ShadowRay};
use crate::sampling::{disc, frame};
use crate::scene::{Cone, SpotFalloff};
use crate::transport::{Shaft, segment};
use crate::units::{Intensity, Irradiance};
use glam::Vec3;

/// A point or spot lamp, sharp or with a luminous sphere around it.
pub struct PointEmitter {
    /// Centre, world metres relative to the scene's origin.
    pub position_world: Vec3,
    /// On the axis.
    pub intensity: Intensity,
    /// Distance where the light ends.
    pub range_m: Option<f32>,
    /// Radius of the sphere that makes its shadows soft.
    pub radius_m: f32,
    /// Whether E = I cosθ/(d² + r²): the disc of that radius that faces the receiver, in closed form on its axis.
    pub soft_falloff: bool,
    /// Spot cone.
    pub cone: Option<Cone>,
}

impl PointEmitter {
    /// Share of the intensity that leaves towards `direction_out`, unit, away from the lamp.
    fn falloff(&self, direction_out: Vec3) -> f32 {
        let Some(cone) = &self.cone else { return 1.0 };
        let cosine = cone.direction_world.dot(direction_out);
        let (cos_inner, cos_outer) = (cone.inner_rad.cos(), cone.outer_rad.cos());
        match cone.falloff {
            SpotFalloff::Blender => {
                let blend = 1.0 - cone.inner_rad / cone.outer_rad.max(1e-6);
                let width = (1.0 - cos_outer) * blend;
                if cosine <= cos_outer {
                    return 0.0;
                }
                let t = if width > 0.0 { ((cosine - cos_outer) / width).min(1.0) } else { 1.0 };
                t * t * (3.0 - 2.0 * t)
            }
            SpotFalloff::Gltf => {
                // KHR_lights_punctual, "Inner and Outer Cone Angles": the width is kept from vanishing.
                let t = ((cosine - cos_outer) / (cos_inner - cos_outer).max(0.001)).clamp(0.0, 1.0);
                t * t
            }
        }
    }

    /// The range window of KHR_lights_punctual: clamp(1 − (d/range)⁴).
    fn window(&self, distance: f32) -> f32 {
        match self.range_m {
            Some(range) if range > 0.0 => (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0),
            _ => 1.0,
        }
    }
}

impl Emitter for PointEmitter {
    fn unoccluded(&self, receiver: &Receiver) -> Irradiance {
        let to_lamp = self.position_world - receiver.position_world;
        let distance_squared = to_lamp.length_squared();
        if !(distance_squared > 0.0 && distance_squared.is_finite())
            || to_lamp.dot(receiver.normal_geometric) <= 0.0
        {
            return Irradiance::ZERO;
        }
        let distance = distance_squared.sqrt();
        let direction = to_lamp / distance;
        let cosine = direction.dot(receiver.normal_shading).max(0.0);
        let softening = if self.soft_falloff { self.radius_m * self.radius_m } else { 0.0 };
        Irradiance(self.intensity.0)
            * (cosine / (distance_squared + softening) * self.falloff(-direction) * self.window(distance))
    }

    fn shadow_ray(&self, receiver: &Receiver, [u, v]: [f32; 2]) -> Option<ShadowRay> {
        let mut target = self.position_world;
        if self.radius_m > 0.0 {
            let axis = (receiver.position_world - self.position_world).try_normalize()?;
            let [t, b, _] = frame(axis, Vec3::X);
            let [x, y] = disc(u, v);
            target += (t * x + b * y) * self.radius_m;
        }
        let ray = segment(receiver.origin_world, target);
        (ray.direction.dot(receiver.normal_geometric) > 0.0).then_some(ShadowRay { ray, weight: Vec3::ONE })
    }

    fn is_sharp(&self) -> bool {
        self.radius_m <= 0.0
    }

    fn shaft(&self, from: [Vec3; 2], _: [Vec3; 2]) -> Shaft {
        let radius = Vec3::splat(self.radius_m.max(0.0));
        Shaft::new(from, [self.position_world - radius, self.position_world + radius])
    }
}
