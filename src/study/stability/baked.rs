//! The light that a bake finds in a model, texel by texel.

use super::model::Place;
use crate::bake::{self, Lit, Run};
use crate::error::Result;
use crate::options::BakeOptions;
use crate::scene::Scene;
use glam::DVec3;

/// A scene with its light.
pub struct Baked {
    /// As it was read.
    pub scene: Scene,
    /// Where it was put.
    pub place: Place,
    /// Its light.
    pub lit: Lit,
}

/// An element of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Texel {
    /// Its number.
    pub element: usize,
    /// Its sample, as the model has it.
    pub at: DVec3,
    /// All irradiance, the mean of the channels.
    pub irradiance: f64,
    /// World m².
    pub area: f64,
}

impl Baked {
    /// Lights a scene.
    pub fn of(scene: Scene, place: Place, options: &BakeOptions) -> Result<Self> {
        let lit = bake::light(&scene, options, &Run::default())?;
        Ok(Self { scene, place, lit })
    }

    /// All valid elements of a surface's front.
    pub fn texels(&self, surface: usize) -> Vec<Texel> {
        self.side(surface, false)
    }

    /// All valid elements of a side of a surface.
    pub fn side(&self, surface: usize, back: bool) -> Vec<Texel> {
        let elements = &self.lit.elements;
        let charts = elements.charts.iter().filter(|c| c.surface as usize == surface && c.back == back);
        charts
            .flat_map(|c| c.elements.start as usize..c.elements.end as usize)
            .filter(|&e| elements.valid[e])
            .map(|element| Texel {
                element,
                at: self.place.in_model(&self.scene, elements.position_world[element]),
                irradiance: f64::from(self.lit.irradiance(element).mean()),
                area: f64::from(elements.area[element].0),
            })
            .collect()
    }

    /// Of all surfaces.
    pub fn all(&self) -> Vec<Texel> {
        (0..self.scene.surfaces.len()).flat_map(|surface| self.texels(surface)).collect()
    }

    /// The texel of a surface that is nearest to a place of the model.
    pub fn nearest(&self, surface: usize, at: DVec3) -> Option<Texel> {
        let distance = |texel: &Texel| texel.at.distance_squared(at);
        self.texels(surface).into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

/// Mean irradiance by area.
pub fn mean(texels: &[Texel]) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for texel in texels {
        sum += texel.irradiance * texel.area;
        area += texel.area;
    }
    sum / area
}

/// Standard deviation of the irradiance by area, as a share of its mean: of what all rays of a closed room meet, since they
/// meet every place as often.
pub fn deviation(texels: &[Texel]) -> f64 {
    let middle = mean(texels);
    let (mut sum, mut area) = (0.0, 0.0);
    for texel in texels {
        sum += (texel.irradiance - middle).powi(2) * texel.area;
        area += texel.area;
    }
    (sum / area).sqrt() / middle
}

/// Half of the range of the irradiance, as a share of its mean: no deviation is larger, wherever it is met (Popoviciu).
pub fn half_range(texels: &[Texel]) -> f64 {
    let (low, high) = texels.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), texel| {
        (low.min(texel.irradiance), high.max(texel.irradiance))
    });
    (high - low) / 2.0 / mean(texels)
}

/// What is expected and found at the texel that is farthest off, relatively; absolutely where nothing is expected.
pub fn farthest(texels: &[Texel], expected: impl Fn(&Texel) -> f64) -> (f64, f64) {
    let mut worst = (f64::NAN, f64::NAN, -1.0);
    for texel in texels {
        let expected = expected(texel);
        let off = (texel.irradiance - expected).abs();
        let off = if expected == 0.0 { off } else { off / expected.abs() };
        if off > worst.2 || off.is_nan() {
            worst = (expected, texel.irradiance, off);
        }
    }
    (worst.0, worst.1)
}
