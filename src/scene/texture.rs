//! Images with their samplers, read as linear values.

use glam::{Vec2, Vec4};
use std::sync::OnceLock;

/// How a coordinate outside `[0, 1]` is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Tiles.
    #[default]
    Repeat,
    /// Tiles, every second one mirrored.
    Mirror,
    /// Stays at the border.
    Clamp,
}

/// How values between texels are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Filter {
    /// Bilinear.
    #[default]
    Linear,
    /// The nearest texel.
    Nearest,
}

/// The stored texels, row by row from the top.
#[derive(Clone, Debug)]
pub enum Pixels {
    /// Colour with the sRGB curve; alpha linear.
    Srgb8(Vec<[u8; 4]>),
    /// Linear 8 bit.
    Linear8(Vec<[u8; 4]>),
    /// Linear float.
    Float(Vec<Vec4>),
}

/// A decoded image with its sampler. `size` is never zero and matches the pixel count.
#[derive(Clone, Debug)]
pub struct Texture {
    /// For messages.
    pub name: String,
    size: [u32; 2],
    pixels: Pixels,
    wrap: [Wrap; 2],
    filter: Filter,
    /// Found when asked for.
    alpha: OnceLock<[f32; 2]>,
}

impl Texture {
    /// `None` when the size is zero or does not match the pixels.
    pub fn new(
        name: String,
        size: [u32; 2],
        pixels: Pixels,
        wrap: [Wrap; 2],
        filter: Filter,
    ) -> Option<Self> {
        let count = match &pixels {
            Pixels::Srgb8(p) | Pixels::Linear8(p) => p.len(),
            Pixels::Float(p) => p.len(),
        };
        let wanted = size[0] as usize * size[1] as usize;
        let alpha = OnceLock::new();
        (wanted > 0 && wanted == count).then_some(Self { name, size, pixels, wrap, filter, alpha })
    }

    /// Whether red, green and blue are the same in every texel.
    pub fn is_grey(&self) -> bool {
        match &self.pixels {
            Pixels::Srgb8(pixels) | Pixels::Linear8(pixels) => {
                pixels.iter().all(|[red, green, blue, _]| red == green && green == blue)
            }
            Pixels::Float(pixels) => pixels.iter().all(|pixel| pixel.x == pixel.y && pixel.y == pixel.z),
        }
    }

    /// Whether red, green and blue are 0 in every texel, or less.
    pub fn is_black(&self) -> bool {
        match &self.pixels {
            Pixels::Srgb8(pixels) | Pixels::Linear8(pixels) => {
                pixels.iter().all(|pixel| pixel[..3] == [0; 3])
            }
            Pixels::Float(pixels) => pixels.iter().all(|pixel| pixel.truncate().max_element() <= 0.0),
        }
    }

    /// Least and greatest alpha of any texel.
    pub fn alpha(&self) -> [f32; 2] {
        fn range<T: Copy>(all: &[T], alpha: impl Fn(T) -> f32) -> [f32; 2] {
            let alphas = all.iter().map(|&pixel| alpha(pixel));
            alphas.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], a| [low.min(a), high.max(a)])
        }
        *self.alpha.get_or_init(|| match &self.pixels {
            Pixels::Srgb8(pixels) | Pixels::Linear8(pixels) => range(pixels, |p| f32::from(p[3]) / 255.0),
            Pixels::Float(pixels) => range(pixels, |p| p.w),
        })
    }

    /// Width and height in texels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// How coordinates outside `[0, 1]` are read, along u and v.
    pub fn wrap(&self) -> [Wrap; 2] {
        self.wrap
    }

    /// The linear value of one texel.
    pub fn texel(&self, x: u32, y: u32) -> Vec4 {
        let i = y as usize * self.size[0] as usize + x as usize;
        match &self.pixels {
            Pixels::Srgb8(p) => {
                let curve = srgb_curve();
                let [r, g, b, a] = p[i];
                Vec4::new(curve[r as usize], curve[g as usize], curve[b as usize], f32::from(a) / 255.0)
            }
            Pixels::Linear8(p) => Vec4::from_array(p[i].map(|c| f32::from(c) / 255.0)),
            Pixels::Float(p) => p[i],
        }
    }

    /// The linear value at a texture coordinate; v runs down from the top. Interpolates after decoding.
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        let [w, h] = self.size;
        if !uv.is_finite() {
            return self.texel(0, 0);
        }
        let (u, v) = (f64::from(uv.x) * f64::from(w), f64::from(uv.y) * f64::from(h));
        if self.filter == Filter::Nearest {
            return self.texel(wrap(u.floor(), w, self.wrap[0]), wrap(v.floor(), h, self.wrap[1]));
        }
        let (x, y) = ((u - 0.5).floor(), (v - 0.5).floor());
        let (fx, fy) = ((u - 0.5 - x) as f32, (v - 0.5 - y) as f32);
        let x = [wrap(x, w, self.wrap[0]), wrap(x + 1.0, w, self.wrap[0])];
        let y = [wrap(y, h, self.wrap[1]), wrap(y + 1.0, h, self.wrap[1])];
        let top = self.texel(x[0], y[0]).lerp(self.texel(x[1], y[0]), fx);
        let bottom = self.texel(x[0], y[1]).lerp(self.texel(x[1], y[1]), fx);
        top.lerp(bottom, fy)
    }
}

fn wrap(index: f64, size: u32, mode: Wrap) -> u32 {
    let n = f64::from(size);
    let wrapped = match mode {
        Wrap::Clamp => index.clamp(0.0, n - 1.0),
        Wrap::Repeat => index.rem_euclid(n),
        Wrap::Mirror => {
            let m = index.rem_euclid(2.0 * n);
            if m < n { m } else { 2.0 * n - 1.0 - m }
        }
    };
    (wrapped as u32).min(size - 1)
}

/// IEC 61966-2-1, the curve of sRGB, for the 256 byte values.
fn srgb_curve() -> &'static [f32; 256] {
    static CURVE: OnceLock<[f32; 256]> = OnceLock::new();
    CURVE.get_or_init(|| {
        std::array::from_fn(|i| {
            let x = i as f64 / 255.0;
            (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_and_interpolates() {
        let pixels = Pixels::Float(vec![Vec4::ZERO, Vec4::ONE]);
        let t = Texture::new("t".into(), [2, 1], pixels, [Wrap::Repeat; 2], Filter::Linear).unwrap();
        assert_eq!(t.sample(Vec2::new(0.25, 0.5)).x, 0.0);
        assert_eq!(t.sample(Vec2::new(0.5, 0.5)).x, 0.5);
        assert_eq!(t.sample(Vec2::new(1.0, 0.5)).x, 0.5);
        assert_eq!(t.sample(Vec2::new(-0.25, 0.5)).x, 1.0);
        assert!(t.sample(Vec2::new(f32::NAN, f32::INFINITY)).is_finite());
    }

    #[test]
    fn refuses_a_wrong_size() {
        let pixels = Pixels::Float(vec![Vec4::ZERO]);
        assert!(
            Texture::new("t".into(), [0, 1], pixels.clone(), [Wrap::Clamp; 2], Filter::Nearest).is_none()
        );
        assert!(Texture::new("t".into(), [2, 1], pixels, [Wrap::Clamp; 2], Filter::Nearest).is_none());
    }
}
