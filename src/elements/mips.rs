//! Smaller copies of textures, so that a coarse lightmap texel sees the mean of what it covers.

use crate::scene::{Filter, Pixels, Texture};
use glam::{UVec2, Vec2, Vec4};
use rayon::prelude::*;

/// The first stored copy has 1/4 of the width and height; finer means are cheap to take from the texture itself.
const FIRST_LEVEL: u32 = 2;

/// A texture with its smaller copies.
pub(super) struct Mips<'a> {
    texture: &'a Texture,
    /// Level `FIRST_LEVEL + i`: width and height divided by 2 to that power.
    smaller: Vec<Texture>,
    /// Whether the smaller copies hold colour × alpha.
    weighted: bool,
}

impl<'a> Mips<'a> {
    /// With `weighted`, means of colour count by alpha: what is cut out does not darken the rest.
    pub(super) fn new(texture: &'a Texture, weighted: bool) -> Self {
        let mut smaller: Vec<Texture> = Vec::new();
        loop {
            let (source, factor) = match smaller.last() {
                None => (texture, 1 << FIRST_LEVEL),
                Some(last) => (last, 2),
            };
            if source.size().iter().all(|&s| s < factor) {
                break;
            }
            let premultiply = weighted && smaller.is_empty();
            let Some(next) = reduced(source, factor, premultiply) else { break };
            smaller.push(next);
        }
        Self { texture, smaller, weighted }
    }

    pub(super) fn size(&self) -> Vec2 {
        UVec2::from(self.texture.size()).as_vec2()
    }

    /// The mean over about `spacing` texels around a texture coordinate.
    pub(super) fn sample(&self, uv: Vec2, spacing: f32) -> Vec4 {
        // Neighbouring samples of a level may be two of its texels apart: bilinear lookups then still meet.
        let level = (spacing * 0.5).log2().ceil();
        if level <= 0.0 || level.is_nan() || self.smaller.is_empty() {
            return self.texture.sample(uv);
        }
        let index = (level as usize).saturating_sub(FIRST_LEVEL as usize).min(self.smaller.len() - 1);
        let mean = self.smaller[index].sample(uv);
        if self.weighted && mean.w > 0.0 { (mean.truncate() / mean.w).extend(mean.w) } else { mean }
    }
}

/// A copy `factor` times smaller, every texel the mean of those it replaces.
fn reduced(source: &Texture, factor: u32, premultiply: bool) -> Option<Texture> {
    let [w, h] = source.size();
    let size = [w, h].map(|s| (s / factor).max(1));
    let range = |i: u32, from: u32, to: u32| {
        let at = |i: u32| (u64::from(i) * u64::from(from) / u64::from(to)) as u32;
        at(i)..at(i + 1)
    };
    let texel = |x, y| {
        let c = source.texel(x, y);
        if premultiply { (c.truncate() * c.w).extend(c.w) } else { c }
    };
    let mean = |i: usize| {
        let (columns, rows) = (range(i as u32 % size[0], w, size[0]), range(i as u32 / size[0], h, size[1]));
        let count = (columns.len() * rows.len()) as f32;
        rows.map(|y| columns.clone().map(|x| texel(x, y)).sum::<Vec4>()).sum::<Vec4>() / count
    };
    let pixels = (0..size[0] as usize * size[1] as usize).into_par_iter().map(mean).collect();
    Texture::new(source.name.clone(), size, Pixels::Float(pixels), source.wrap(), Filter::Linear)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Wrap;

    fn checker(size: u32) -> Texture {
        let pixel = |i: u32| {
            if (i % size + i / size).is_multiple_of(2) { Vec4::ONE } else { Vec4::new(0.0, 0.0, 0.0, 0.0) }
        };
        let pixels = Pixels::Float((0..size * size).map(pixel).collect());
        Texture::new("checker".into(), [size; 2], pixels, [Wrap::Repeat; 2], Filter::Nearest).unwrap()
    }

    #[test]
    fn a_fine_checker_is_grey_from_afar_and_sharp_from_near() {
        let texture = checker(64);
        let mips = Mips::new(&texture, false);
        for spacing in [8.0, 16.0, 64.0, 1e6] {
            for i in 0..10 {
                let uv = Vec2::new(0.137 * i as f32, 0.61 * i as f32);
                assert!((mips.sample(uv, spacing) - Vec4::splat(0.5)).length() < 1e-5);
            }
        }
        assert_eq!(mips.sample(Vec2::splat(0.5 / 64.0), 1.0), Vec4::ONE);
    }

    #[test]
    fn holes_do_not_darken_the_leaf() {
        let texture = checker(32);
        let leaf = Mips::new(&texture, true).sample(Vec2::splat(0.3), 16.0);
        assert!((leaf - Vec4::new(1.0, 1.0, 1.0, 0.5)).length() < 1e-5);
    }

    #[test]
    fn odd_and_thin_textures_keep_their_mean() {
        for size in [[1, 1], [3, 1], [7, 5], [1, 33], [100, 6]] {
            let count = size[0] * size[1];
            let pixels = Pixels::Float((0..count).map(|_| Vec4::splat(0.25)).collect());
            let texture =
                Texture::new("grey".into(), size, pixels, [Wrap::Clamp; 2], Filter::Linear).unwrap();
            assert!((Mips::new(&texture, false).sample(Vec2::ONE, 50.0).x - 0.25).abs() < 1e-6);
        }
    }
}
