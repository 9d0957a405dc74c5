//! Light per element -> pages: seams, dilation, validity, the stored unit.

use crate::atlas::Atlas;
use crate::elements::{Elements, NO_ELEMENT};
use crate::options::Store;
use crate::units::Irradiance;
use glam::Vec3;
use std::f32::consts::PI;

/// One page, ready to be written.
#[derive(Clone, Debug)]
pub struct LightmapPage {
    /// Width and height.
    pub size_texels: u32,
    /// Row by row from the top, in the stored unit; finite and not negative everywhere.
    pub value: Vec<Vec3>,
    /// Whether a chart covers the texel (dilated texels are not covered).
    pub covered: Vec<bool>,
}

/// All exported pages, in the atlas' order.
#[derive(Clone, Debug, Default)]
pub struct Lightmap {
    /// The pages.
    pub pages: Vec<LightmapPage>,
}

impl Lightmap {
    /// Every value times `factor`.
    pub fn scaled(mut self, factor: f32) -> Self {
        self.pages.iter_mut().for_each(|p| p.value.iter_mut().for_each(|v| *v *= factor));
        self
    }
}

/// TEMPORARY.
pub fn resolve(elements: &Elements, atlas: &Atlas, irradiance: &[Irradiance], store: Store) -> Lightmap {
    let mut pages = Vec::new();
    for (index, page) in atlas.pages.iter().enumerate().filter(|(_, p)| p.exported) {
        let n = page.size_texels as usize;
        let map = &elements.pages[index];
        let mut value = vec![Vec3::ZERO; n * n];
        let mut known = vec![false; n * n];
        let mut covered = vec![false; n * n];
        for (t, &e) in map.element.iter().enumerate() {
            if e != NO_ELEMENT {
                covered[t] = true;
                let e = e as usize;
                if elements.valid[e] {
                    known[t] = true;
                    value[t] = match store {
                        Store::IrradianceOverPi => irradiance[e].0 / PI,
                        Store::Irradiance => irradiance[e].0,
                        Store::Radiosity => (elements.reflectance[e] * irradiance[e]).0,
                    };
                }
            }
        }
        for _ in 0..16 {
            let before = (known.clone(), value.clone());
            for y in 0..n {
                for x in 0..n {
                    if before.0[y * n + x] {
                        continue;
                    }
                    let (mut sum, mut count) = (Vec3::ZERO, 0.0);
                    for (dx, dy) in
                        [(-1i32, 0i32), (1, 0), (0, -1), (0, 1), (-1, -1), (1, 1), (-1, 1), (1, -1)]
                    {
                        let (a, b) = (x as i32 + dx, y as i32 + dy);
                        if a >= 0 && b >= 0 && (a as usize) < n && (b as usize) < n {
                            let t = b as usize * n + a as usize;
                            if before.0[t] {
                                sum += before.1[t];
                                count += 1.0;
                            }
                        }
                    }
                    if count > 0.0 {
                        known[y * n + x] = true;
                        value[y * n + x] = sum / count;
                    }
                }
            }
        }
        pages.push(LightmapPage { size_texels: page.size_texels, value, covered });
    }
    Lightmap { pages }
}
