//! Closed boxes, which the plan's proofs are about.

use crate::common::Builder;
use glam::{Affine2, Vec2, Vec3, Vec4};
use lightkiln::scene::{
    Alpha, Cone, Filter, LampKind, Material, MaterialId, Pixels, Texture, TextureId, TextureSlot, Wrap,
};
use lightkiln::units::Intensity;

/// A box of six sides that share their corners; some sides can be left out (bits: −x, +x, −y, +y, −z, +z).
pub fn hull(
    b: &mut Builder,
    min: Vec3,
    max: Vec3,
    inward: bool,
    left_out: u8,
    material: MaterialId,
) -> usize {
    let corner = |i: u32| {
        let pick = |axis: usize| if i >> axis & 1 == 1 { max[axis] } else { min[axis] };
        Vec3::new(pick(0), pick(1), pick(2))
    };
    const QUADS: [[u32; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let kept = QUADS.iter().enumerate().filter(|(side, _)| left_out >> side & 1 == 0);
    let triangles = kept.flat_map(
        |(_, &[a, b, c, d])| {
            if inward { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] }
        },
    );
    let triangles = triangles.collect();
    b.mesh((0..8).map(corner).collect(), triangles, material)
}

/// A box around a point.
pub fn block(b: &mut Builder, middle: Vec3, half: f32, material: MaterialId) -> usize {
    hull(b, middle - half, middle + half, false, 0, material)
}

/// A grey room of 2 m that faces inward, closed.
pub fn room(b: &mut Builder) -> usize {
    let grey = b.material(0.5, 0.0);
    hull(b, Vec3::splat(-1.0), Vec3::splat(1.0), true, 0, grey)
}

/// A material like another one but for some of its properties.
pub fn like(b: &mut Builder, of: MaterialId, change: impl FnOnce(&mut Material)) -> MaterialId {
    let mut material = b.scene.materials[of.0 as usize].clone();
    change(&mut material);
    b.scene.materials.push(material);
    MaterialId(b.scene.materials.len() as u32 - 1)
}

pub fn double_sided(b: &mut Builder, reflectance: f32, emitted: f32) -> MaterialId {
    let plain = b.material(reflectance, emitted);
    like(b, plain, |material| material.double_sided = true)
}

pub fn coloured(b: &mut Builder, red: f32, green: f32, blue: f32) -> MaterialId {
    let plain = b.material(0.5, 0.0);
    like(b, plain, |material| material.base_color = Vec4::new(red, green, blue, 1.0))
}

pub fn transparent(b: &mut Builder, alpha: Alpha, opacity: f32) -> MaterialId {
    let plain = b.material(0.5, 0.0);
    like(b, plain, |material| {
        material.alpha = alpha;
        material.base_color.w = opacity;
    })
}

/// A point or spot lamp.
pub struct Shine {
    pub intensity: Intensity,
    pub range_m: Option<f32>,
    pub radius_m: f32,
    pub cone: Option<Cone>,
}

impl Default for Shine {
    /// Grey, sharp, all around, without end.
    fn default() -> Self {
        Self { intensity: Intensity::grey(1.0), range_m: None, radius_m: 0.0, cone: None }
    }
}

pub fn lamp(b: &mut Builder, position_world: Vec3, Shine { intensity, range_m, radius_m, cone }: Shine) {
    b.lamp(LampKind::Point { position_world, intensity, range_m, radius_m, soft_falloff: false, cone });
}

/// A texture of 2 × 2 texels, and coordinates for all objects so far.
pub fn texture(b: &mut Builder, colours: [[u8; 4]; 4]) -> TextureSlot {
    let pixels = Pixels::Srgb8(colours.to_vec());
    let texture = Texture::new("checks".into(), [2, 2], pixels, [Wrap::Repeat; 2], Filter::Nearest);
    b.scene.textures.push(texture.expect("the size fits"));
    for geometry in &mut b.scene.geometries {
        geometry.texcoords = vec![geometry.position_local.iter().map(|p| Vec2::new(p.x, p.z)).collect()];
    }
    let texture = TextureId(b.scene.textures.len() as u32 - 1);
    TextureSlot { texture, texcoord: 0, transform: Affine2::IDENTITY }
}

pub const CHECKS: [[u8; 4]; 4] = [[255, 255, 255, 255], [9, 9, 9, 255], [9, 9, 9, 255], [255, 255, 255, 255]];
