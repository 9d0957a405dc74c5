//! Mean reflectance and emission over a texel's footprint: minification must not alias.

use super::charts::{ChartPlan, Mapped};
use super::mips::Mips;
use super::texel::{Footprint, Piece};
use crate::atlas::Atlas;
use crate::scene::{Alpha, Geometry, Material, Scene, TextureSlot};
use crate::units::{Radiance, Reflectance};
use glam::{DVec2, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;

/// Samples along either axis of a texel at most; beyond, smaller copies of the texture are read.
const MOST_SAMPLES: f32 = 8.0;

/// All textured materials, ready for means.
pub(super) struct Footprints<'a> {
    scene: &'a Scene,
    mips: Vec<Mips<'a>>,
    /// Per material: which of `mips` its base colour, metallic and emission textures are.
    of_material: Vec<[Option<usize>; 3]>,
}

/// Means over one footprint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Means {
    pub reflectance: Reflectance,
    pub emission: Radiance,
}

/// A texture as the material uses it.
struct Layer<'a> {
    slot: &'a TextureSlot,
    mips: &'a Mips<'a>,
}

impl<'a> Footprints<'a> {
    pub(super) fn new(scene: &'a Scene, atlas: &Atlas) -> Self {
        let mut used = vec![false; scene.materials.len()];
        for (i, surface) in scene.surfaces.iter().enumerate() {
            let lit = |sides: &[Option<_>]| sides.get(i).is_some_and(Option::is_some);
            used[surface.material.0 as usize] |= lit(&atlas.fronts) || lit(&atlas.backs);
        }
        let mut index = HashMap::new();
        let mut wanted: Vec<(u32, bool)> = Vec::new();
        let mut want = |slot: &Option<TextureSlot>, weighted: bool| {
            slot.as_ref().map(|slot| {
                *index.entry((slot.texture.0, weighted)).or_insert_with(|| {
                    wanted.push((slot.texture.0, weighted));
                    wanted.len() - 1
                })
            })
        };
        let of_material = scene.materials.iter().zip(&used).map(|(material, &used)| {
            if !used || material.unlit {
                return [None; 3];
            }
            [
                want(&material.base_color_texture, material.alpha != Alpha::Opaque),
                want(&material.metallic_texture, false),
                if material.emits() { want(&material.emission_texture, false) } else { None },
            ]
        });
        let of_material = of_material.collect();
        let build =
            |&(texture, weighted): &(u32, bool)| Mips::new(&scene.textures[texture as usize], weighted);
        let mips = wanted.par_iter().map(build).collect();
        Self { scene, mips, of_material }
    }

    /// Means over the covered part of a texel, by area.
    pub(super) fn means(&self, chart: &ChartPlan, footprint: &Footprint) -> Means {
        let surface = &self.scene.surfaces[chart.surface as usize];
        let material = self.scene.material(surface);
        let geometry = self.scene.geometry(surface);
        let layer = |slot: &'a Option<TextureSlot>, mips: Option<usize>| {
            slot.as_ref().zip(mips).map(|(slot, mips)| Layer { slot, mips: &self.mips[mips] })
        };
        let [base, metallic, emission] = self.of_material[surface.material.0 as usize];
        let shading = Shading {
            material,
            geometry,
            base: layer(&material.base_color_texture, base),
            metallic: layer(&material.metallic_texture, metallic),
            emission: layer(&material.emission_texture, emission),
        };
        let (mut reflected, mut emitted, mut area) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (piece, mapped) in footprint.pieces.iter().zip(footprint.mapped) {
            let corners = self.scene.corner_indices(surface, piece.triangle);
            let (r, e) = shading.piece(corners, footprint.corner, piece, mapped);
            reflected += r.as_dvec3() * piece.area;
            emitted += e.as_dvec3() * piece.area;
            area += piece.area;
        }
        Means {
            reflectance: Reflectance::clamped((reflected / area).as_vec3()),
            emission: Radiance((emitted / area).as_vec3()),
        }
    }
}

/// What a surface's shading is made of.
struct Shading<'a> {
    material: &'a Material,
    geometry: &'a Geometry,
    base: Option<Layer<'a>>,
    metallic: Option<Layer<'a>>,
    emission: Option<Layer<'a>>,
}

impl Shading<'_> {
    /// Mean reflectance and emission over one piece.
    fn piece(&self, corners: [usize; 3], corner: DVec2, piece: &Piece, mapped: &Mapped) -> (Vec3, Vec3) {
        if self.material.unlit {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        let centroid = corner + DVec2::new(f64::from(piece.centroid[0]), f64::from(piece.centroid[1]));
        let layers = [&self.base, &self.metallic, &self.emission];
        let rates = layers.map(|layer| layer.as_ref().map(|layer| self.rate(layer, corners, mapped)));
        let widest = |axis: usize| rates.iter().flatten().fold(0.0, |w: f32, rate| w.max(rate[axis]));
        let counts = counts(widest(0), widest(1));
        let spacing = rates.map(|rate| rate.map_or(0.0, |[u, v]| (u / counts[0]).max(v / counts[1])));

        let mut sum = Sum::default();
        let whole = piece.coverage > 1.0 - 1e-6;
        if counts != [1.0, 1.0] || whole {
            for j in 0..counts[1] as u32 {
                for i in 0..counts[0] as u32 {
                    let p = corner
                        + (DVec2::new(f64::from(i), f64::from(j)) + 0.5) / DVec2::from(counts.map(f64::from));
                    match mapped.weights(p) {
                        Some(w) if w.min_element() >= 0.0 => sum.add(self.at(corners, w, spacing)),
                        _ => {}
                    }
                }
            }
        }
        if sum.count == 0.0 {
            let w = mapped.weights(centroid).map_or(DVec3::splat(1.0 / 3.0), |w| w.max(DVec3::ZERO));
            sum.add(self.at(corners, w / w.element_sum(), spacing));
        }
        sum.mean()
    }

    /// Texture pixels per lightmap texel, along u and along v.
    fn rate(&self, layer: &Layer, corners: [usize; 3], mapped: &Mapped) -> [f32; 2] {
        let Some(set) = self.geometry.texcoords.get(layer.slot.texcoord) else { return [0.0; 2] };
        let pixels = corners.map(|i| layer.slot.transform.transform_point2(set[i]) * layer.mips.size());
        let corner = |w: DVec3| pixels[0] * w.x as f32 + pixels[1] * w.y as f32 + pixels[2] * w.z as f32;
        let at = |d: DVec2| mapped.weights(mapped.uv[0] + d).map(corner);
        let (Some(o), Some(u), Some(v)) = (at(DVec2::ZERO), at(DVec2::X), at(DVec2::Y)) else {
            return [0.0; 2];
        };
        [u, v].map(|end| (end - o).abs().max_element()).map(|rate| if rate.is_finite() { rate } else { 0.0 })
    }

    /// Reflectance, its weight, and emission at a point of the triangle.
    fn at(&self, corners: [usize; 3], weights: DVec3, spacing: [f32; 3]) -> (Vec3, f32, Vec3) {
        let w = weights.as_vec3();
        let read = |layer: &Option<Layer>, spacing: f32| match layer {
            None => Vec4::ONE,
            Some(layer) => {
                let uv = match self.geometry.texcoords.get(layer.slot.texcoord) {
                    Some(set) => {
                        let uv = set[corners[0]] * w.x + set[corners[1]] * w.y + set[corners[2]] * w.z;
                        layer.slot.transform.transform_point2(uv)
                    }
                    None => Vec2::ZERO,
                };
                layer.mips.sample(uv, spacing)
            }
        };
        let mut color = self.material.base_color * read(&self.base, spacing[0]);
        if !self.geometry.color.is_empty() {
            let vertex = corners.map(|i| self.geometry.color[i]);
            color *= vertex[0] * w.x + vertex[1] * w.y + vertex[2] * w.z;
        }
        let metallic = self.material.metallic * read(&self.metallic, spacing[1]).z;
        let kept = (1.0 - metallic).clamp(0.0, 1.0) * (1.0 - self.material.transmission).clamp(0.0, 1.0);
        let emission = self.material.emission.0 * read(&self.emission, spacing[2]).truncate().max(Vec3::ZERO);
        // What is cut out has no colour to count; of a veil, the dense parts count more.
        let weight = match self.material.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask { cutoff } if spacing[0] <= 2.0 => f32::from(u8::from(color.w >= cutoff)),
            Alpha::Mask { .. } | Alpha::Blend => color.w.clamp(0.0, 1.0),
        };
        (Reflectance::clamped(color.truncate() * kept).0, weight, emission)
    }
}

/// Samples along u and v for footprints that many pixels wide: two where the texture is finer than the lightmap, more
/// along the longer side so that the shorter one is not blurred.
fn counts(u: f32, v: f32) -> [f32; 2] {
    let shorter = u.min(v).max(1.0);
    [u, v]
        .map(|width| if width <= 1.0 { 1.0 } else { (2.0 * width / shorter).ceil().clamp(2.0, MOST_SAMPLES) })
}

#[derive(Default)]
struct Sum {
    count: f32,
    weight: f32,
    weighted: Vec3,
    plain: Vec3,
    emission: Vec3,
}

impl Sum {
    fn add(&mut self, (reflectance, weight, emission): (Vec3, f32, Vec3)) {
        self.count += 1.0;
        self.weight += weight;
        self.weighted += reflectance * weight;
        self.plain += reflectance;
        self.emission += emission;
    }

    fn mean(&self) -> (Vec3, Vec3) {
        let plain = self.plain / self.count;
        let reflectance = if self.weight > 0.0 { self.weighted / self.weight } else { plain };
        (reflectance, self.emission / self.count)
    }
}
