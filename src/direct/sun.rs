//! Suns: E = S cosθ; bright cells of a sky image are suns of their own.

use super::{Emitter, Receiver, ShadowRay};
use crate::sampling::{disc, frame};
use crate::transport::{Ray, Shaft};
use crate::units::Irradiance;
use glam::Vec3;

/// A distant disc.
pub struct SunEmitter {
    /// Unit vector towards its centre.
    pub toward_world: Vec3,
    /// On a surface that faces it.
    pub irradiance: Irradiance,
    /// Sine of the angular radius; 0 is sharp.
    pub sin_radius: f32,
}

impl Emitter for SunEmitter {
    fn unoccluded(&self, receiver: &Receiver) -> Irradiance {
        if self.toward_world.dot(receiver.normal_geometric) <= -self.sin_radius {
            return Irradiance::ZERO;
        }
        self.irradiance * risen(self.toward_world.dot(receiver.normal_shading), self.sin_radius)
    }

    fn shadow_ray(&self, receiver: &Receiver, [u, v]: [f32; 2]) -> Option<ShadowRay> {
        let mut direction = self.toward_world;
        if self.sin_radius > 0.0 {
            let [t, b, _] = frame(direction, Vec3::X);
            let [x, y] = disc(u, v);
            let offset = (t * x + b * y) * self.sin_radius;
            direction = (direction * (1.0 - offset.length_squared()).max(0.0).sqrt() + offset).normalize();
        }
        if direction.dot(receiver.normal_geometric) <= 0.0 {
            return None;
        }
        let cosine = direction.dot(receiver.normal_shading).max(0.0);
        Some(ShadowRay { ray: Ray::unbounded(receiver.origin_world, direction), weight: Vec3::splat(cosine) })
    }

    fn is_sharp(&self) -> bool {
        self.sin_radius <= 0.0
    }

    fn shaft(&self, from: [Vec3; 2], [low, high]: [Vec3; 2]) -> Shaft {
        // So far that all of the world is passed.
        let length = (high.max(from[1]) - low.min(from[0])).length();
        let (end, wide) = (self.toward_world * length, Vec3::splat(length * self.sin_radius));
        Shaft::new(from, [from[0] + end - wide, from[1] + end + wide])
    }
}

/// Cosine of a disc's centre, with the disc cut by the horizon: the mean over the disc of max(cosθ, 0).
///
/// For a disc whose sine radius is s and whose centre stands at cosine c, the height of its points is c + s·x with x
/// distributed as 2√(1−x²)/π; the mean of the positive part over x is closed (integrate by parts).
fn risen(cosine: f32, sin_radius: f32) -> f32 {
    if cosine >= sin_radius {
        return cosine;
    }
    if cosine <= -sin_radius {
        return 0.0;
    }
    let t = f64::from(cosine) / f64::from(sin_radius);
    let root = (1.0 - t * t).max(0.0).sqrt();
    let above = 0.5 + (t * root + t.asin()) / std::f64::consts::PI;
    let lift = 2.0 / (3.0 * std::f64::consts::PI) * root.powi(3);
    (f64::from(sin_radius) * (t * above + lift)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_sun_is_cut_continuously() {
        let s = 0.1;
        assert!((risen(s, s) - s).abs() < 1e-6);
        assert_eq!(risen(-s, s), 0.0);
        // Half risen: s · 2/(3π), the centroid of the upper half disc times its half area.
        assert!((risen(0.0, s) - s * 2.0 / (3.0 * std::f32::consts::PI)).abs() < 1e-7);
    }
}
