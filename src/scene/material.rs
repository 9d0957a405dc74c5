//! What a surface does with light.

use super::TextureId;
use crate::units::Radiance;
use glam::{Affine2, Vec4};

/// A texture as a material uses it.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureSlot {
    /// Which texture.
    pub texture: TextureId,
    /// Which texture coordinate set of the geometry.
    pub texcoord: usize,
    /// KHR_texture_transform; identity when absent.
    pub transform: Affine2,
}

/// How a material lets light through.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Alpha {
    /// Never.
    #[default]
    Opaque,
    /// Wholly where alpha is below the cutoff.
    Mask {
        /// Smallest alpha that still blocks.
        cutoff: f32,
    },
    /// 1 − alpha of it, tinted by the base colour.
    Blend,
}

/// A diffuse material.
#[derive(Clone, Debug)]
pub struct Material {
    /// As the artist named it.
    pub name: String,
    /// glTF index; `None` for the default material.
    pub index: Option<usize>,
    /// Linear colour and alpha.
    pub base_color: Vec4,
    /// Multiplies `base_color`.
    pub base_color_texture: Option<TextureSlot>,
    /// Share of the surface that is metal and reflects nothing diffusely.
    pub metallic: f32,
    /// Its blue channel multiplies `metallic`.
    pub metallic_texture: Option<TextureSlot>,
    /// Share of the light that passes instead of being reflected (KHR_materials_transmission).
    pub transmission: f32,
    /// Emitted radiance: factor × strength.
    pub emission: Radiance,
    /// Multiplies `emission`.
    pub emission_texture: Option<TextureSlot>,
    /// How it lets light through.
    pub alpha: Alpha,
    /// Whether the back reflects and emits as the front does.
    pub double_sided: bool,
    /// KHR_materials_unlit: blocks light, takes and gives none.
    pub unlit: bool,
}

impl Default for Material {
    /// glTF's default material, but not metallic: a metal would take no diffuse light at all.
    fn default() -> Self {
        Self {
            name: "default".to_owned(),
            index: None,
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 0.0,
            metallic_texture: None,
            transmission: 0.0,
            emission: Radiance::ZERO,
            emission_texture: None,
            alpha: Alpha::Opaque,
            double_sided: false,
            unlit: false,
        }
    }
}

impl Material {
    /// Whether the surface sends out light of its own.
    pub fn emits(&self) -> bool {
        !self.unlit && self.emission.0.max_element() > 0.0
    }
}
