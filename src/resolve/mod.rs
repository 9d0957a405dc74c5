//! Light per element -> pages: seams, dilation, validity, the stored unit.

mod canvas;
mod dilate;
mod seams;
mod stitch;
#[cfg(test)]
mod tests;

pub(crate) use dilate::push_pull;

use crate::atlas::Atlas;
use crate::elements::{Elements, NO_ELEMENT};
use crate::options::Store;
use crate::scene::Scene;
use crate::units::{Irradiance, Radiosity, Reflectance};
use canvas::Canvas;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;

/// One page, ready to be written.
#[derive(Clone, Debug, PartialEq)]
pub struct LightmapPage {
    /// Width and height.
    pub size_texels: u32,
    /// Row by row from the top, in the stored unit; finite and not negative everywhere.
    pub value: Vec<Vec3>,
    /// Whether a chart covers the texel (dilated texels are not covered).
    pub covered: Vec<bool>,
}

/// All exported pages, in the atlas' order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lightmap {
    /// The pages.
    pub pages: Vec<LightmapPage>,
}

/// Makes the exported pages from the irradiance of every element.
///
/// Invalid elements, and those whose irradiance is not finite, take the value of the nearest valid ones of their
/// chart. Borders of charts that are one smooth edge of the surface are made equal for bilinear lookups; a crease is
/// not touched. All other texels are filled from the charts around them, so that neither a bilinear lookup nor a
/// smaller copy of the page darkens a border.
pub fn resolve(
    scene: &Scene,
    elements: &Elements,
    atlas: &Atlas,
    irradiance: &[Irradiance],
    store: Store,
) -> Lightmap {
    let exported = (0..).zip(&atlas.pages).filter(|(_, page)| page.exported).map(|(i, _)| i);
    let exported: Vec<u32> = exported.filter(|&i: &u32| (i as usize) < elements.pages.len()).collect();
    let mut canvases: Vec<Canvas> =
        exported.par_iter().map(|&page| Canvas::new(elements, irradiance, page)).collect();

    let covered =
        |canvas: usize, texel: usize| elements.pages[exported[canvas] as usize].element[texel] != NO_ELEMENT;
    stitch::stitch(&mut canvases, &seams::seams(scene, atlas), covered);

    let emission = match store {
        Store::Radiosity => emission(elements),
        Store::Irradiance | Store::IrradianceOverPi => Vec::new(),
    };
    let of = |irradiance: Irradiance, reflectance: Reflectance, emitted: Radiosity| match store {
        Store::IrradianceOverPi => irradiance.0 / PI,
        Store::Irradiance => irradiance.0,
        Store::Radiosity => (reflectance * irradiance + emitted).0,
    };
    let finish = |canvas: Canvas| finish(canvas, elements, &emission, of);
    Lightmap { pages: canvases.into_par_iter().map(finish).collect() }
}

/// Emitted radiosity of every element, e = πL.
fn emission(elements: &Elements) -> Vec<Radiosity> {
    let mut all = vec![Radiosity::ZERO; elements.len()];
    for &(e, radiance) in &elements.emission {
        all[e as usize] = radiance.to_radiosity();
    }
    all
}

fn finish(
    mut canvas: Canvas,
    elements: &Elements,
    emission: &[Radiosity],
    of: impl Fn(Irradiance, Reflectance, Radiosity) -> Vec3,
) -> LightmapPage {
    canvas.store(elements, emission, of);
    dilate::dilate(&mut canvas);
    let map = &elements.pages[canvas.page as usize];
    let lawful =
        |v: Vec3| Vec3::from_array(v.to_array().map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 }));
    canvas.value.par_iter_mut().for_each(|value| *value = lawful(*value));
    LightmapPage {
        size_texels: map.size_texels,
        value: canvas.value,
        covered: map.element.iter().map(|&e| e != NO_ELEMENT).collect(),
    }
}
