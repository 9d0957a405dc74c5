//! What rays meet that leave the scene.

use crate::units::Radiance;
use glam::Vec3;
use std::f32::consts::PI;

/// The sky.
#[derive(Clone, Debug, Default)]
pub enum Sky {
    /// Black.
    #[default]
    None,
    /// The same radiance from everywhere.
    Constant(Radiance),
    /// An equirectangular image.
    Image(SkyImage),
}

/// An equirectangular image of the whole sphere: rows from the zenith (+y) down, the centre column looks along +x, the
/// first and last along −x, columns in between turn clockwise seen from above. So Blender's environment texture shows it.
#[derive(Clone, Debug)]
pub struct SkyImage {
    size: [u32; 2],
    radiance: Vec<Vec3>,
}

impl SkyImage {
    /// `None` when the size is zero or does not match, or a value is negative or not finite.
    pub fn new(size: [u32; 2], radiance: Vec<Vec3>) -> Option<Self> {
        let wanted = size[0] as usize * size[1] as usize;
        let lawful = wanted > 0
            && wanted == radiance.len()
            && radiance.iter().all(|c| c.is_finite() && c.min_element() >= 0.0);
        lawful.then_some(Self { size, radiance })
    }

    /// The same image turned about the vertical, counter-clockwise seen from above, to the nearest pixel.
    pub fn turned(mut self, degrees: f64) -> Self {
        let width = self.size[0] as usize;
        // Columns run clockwise: what was in a column moves to one further left.
        let columns = (degrees / 360.0 * width as f64).round().rem_euclid(width as f64) as usize;
        self.radiance.chunks_exact_mut(width).for_each(|row| row.rotate_left(columns % width));
        self
    }

    /// Whether red, green and blue are the same in every pixel.
    pub fn is_grey(&self) -> bool {
        self.radiance.iter().all(|pixel| pixel.x == pixel.y && pixel.y == pixel.z)
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Radiance of one pixel.
    pub fn pixel(&self, x: u32, y: u32) -> Radiance {
        Radiance(self.radiance[y as usize * self.size[0] as usize + x as usize])
    }

    /// Unit direction, world, of the image point `(u, v)` in `[0, 1]²`.
    pub fn direction_world(u: f32, v: f32) -> Vec3 {
        let (theta, phi) = (v * PI, (u - 0.5) * 2.0 * PI);
        Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
    }

    /// Image point `(u, v)` of a unit direction; the inverse of [`Self::direction_world`].
    pub fn image_point(direction_world: Vec3) -> (f32, f32) {
        let d = direction_world;
        (0.5 + d.z.atan2(d.x) / (2.0 * PI), d.y.clamp(-1.0, 1.0).acos() / PI)
    }

    /// Radiance seen along a unit direction, bilinear.
    pub fn sample(&self, direction_world: Vec3) -> Radiance {
        let (u, v) = Self::image_point(direction_world);
        let [w, h] = self.size;
        let (x, y) = (u * w as f32 - 0.5, (v * h as f32 - 0.5).clamp(0.0, (h - 1) as f32));
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let column = |i: f32| i.rem_euclid(w as f32) as u32 % w;
        let row = |i: f32| (i as u32).min(h - 1);
        let at = |i: f32, j: f32| self.pixel(column(i), row(j)).0;
        let top = at(x0, y0).lerp(at(x0 + 1.0, y0), fx);
        let bottom = at(x0, y0 + 1.0).lerp(at(x0 + 1.0, y0 + 1.0), fx);
        Radiance(top.lerp(bottom, fy))
    }
}

impl Sky {
    /// Radiance seen along a unit direction.
    pub fn radiance(&self, direction_world: Vec3) -> Radiance {
        match self {
            Self::None => Radiance::ZERO,
            Self::Constant(radiance) => *radiance,
            Self::Image(image) => image.sample(direction_world),
        }
    }

    /// Whether any light comes from it.
    pub fn is_lit(&self) -> bool {
        match self {
            Self::None => false,
            Self::Constant(radiance) => radiance.0.max_element() > 0.0,
            Self::Image(image) => image.radiance.iter().any(|c| c.max_element() > 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_image_points_are_inverse() {
        for (u, v) in [(0.1, 0.2), (0.5, 0.5), (0.9, 0.7)] {
            let (a, b) = SkyImage::image_point(SkyImage::direction_world(u, v));
            assert!((a - u).abs() < 1e-5 && (b - v).abs() < 1e-5);
        }
        let mut pixels = vec![Vec3::ZERO; 8];
        pixels[4] = Vec3::ONE;
        let image = SkyImage::new([8, 1], pixels).unwrap();
        let seen = |image: &SkyImage, d: Vec3| image.sample(d).0.x;
        let ahead = SkyImage::direction_world(4.5 / 8.0, 0.5);
        assert!((seen(&image, ahead) - 1.0).abs() < 1e-5);
        // A quarter turn to the left, seen from above.
        let turned = image.turned(90.0);
        assert!((seen(&turned, glam::Quat::from_rotation_y(PI / 2.0) * ahead) - 1.0).abs() < 1e-5);
        assert_eq!(seen(&turned, ahead), 0.0);
        assert!((SkyImage::direction_world(0.5, 0.5) - Vec3::X).length() < 1e-6);
    }
}
