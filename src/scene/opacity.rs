//! How much of the light surfaces stop, as far as it is the same everywhere.

use super::{Alpha, Scene, Surface, TextureSlot};

/// How much a surface stops, as far as it is the same everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Opacity {
    /// All light everywhere: also a mask or a veil whose image has no hole.
    Full,
    /// Nothing anywhere.
    Clear,
    /// All or nothing.
    Holes,
    /// A share.
    Partial,
}

/// By so much alpha must clear a cutoff: what interpolating f32 values may lose.
const ROUNDING: f32 = 1e-5;

impl Scene {
    /// How much a surface stops. Of an image all counts, whatever part of it the surface uses.
    pub fn opacity_of(&self, surface: &Surface) -> Opacity {
        let material = self.material(surface);
        if material.alpha == Alpha::Opaque {
            return Opacity::Full;
        }
        let factor = material.base_color.w;
        let of_image = |slot: &TextureSlot| self.textures[slot.texture.0 as usize].alpha();
        let image = &material.base_color_texture;
        let [low, high] = match (self.geometry(surface).color.is_empty(), image) {
            (true, None) => [factor; 2],
            (true, Some(slot)) => of_image(slot).map(|alpha| alpha * factor),
            // Sums of three weights are 1 up to rounding only.
            (false, _) => [0.0, f32::INFINITY],
        };
        let slack = if low == high { 0.0 } else { ROUNDING };
        match material.alpha {
            Alpha::Opaque => Opacity::Full,
            // Nothing is more transparent than transparent, however alpha is interpolated.
            Alpha::Mask { cutoff } if low >= 0.0 && cutoff <= 0.0 => Opacity::Full,
            Alpha::Mask { cutoff } if low >= cutoff + slack => Opacity::Full,
            Alpha::Mask { cutoff } if high < cutoff - slack => Opacity::Clear,
            Alpha::Mask { .. } => Opacity::Holes,
            Alpha::Blend if low >= 1.0 => Opacity::Full,
            Alpha::Blend => Opacity::Partial,
        }
    }

    /// Whether a surface sends out light of its own: its material does, and not through an image that is black.
    pub fn emits(&self, surface: &Surface) -> bool {
        let material = self.material(surface);
        material.emits() && !self.is_black(&material.emission_texture)
    }

    /// Whether there is an image and all of it is black.
    pub fn is_black(&self, slot: &Option<TextureSlot>) -> bool {
        slot.as_ref().is_some_and(|slot| self.textures[slot.texture.0 as usize].is_black())
    }
}
