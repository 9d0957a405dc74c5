//! A baked file, read back: the scene, its pages of light, and which surface finds its light where.
//!
//! Everything is taken from the file and what lies beside it, as a viewer would; nothing is remembered from the bake.

mod links;

pub use links::{Entry, MaterialLink, Stated};
pub(crate) use links::{store_named, store_of_intensity};

use crate::error::{Error, Result};
use crate::export::{ExrImage, bilinear, decode_exr};
use crate::import::{self, Document};
use crate::options::{ImportOptions, Store};
use crate::scene::{Role, Scene};
use glam::{Vec2, Vec3};
use links::Source;
use std::collections::BTreeMap;
use std::f32::consts::PI;
use std::path::Path;

/// One page of light.
#[derive(Debug)]
pub struct Page {
    /// The EXR's file name; when it is embedded, the name it would have.
    pub file: String,
    /// Its texels, or why there are none.
    pub image: std::result::Result<ExrImage, String>,
    /// What its texels hold.
    pub store: Store,
}

/// Where a surface finds its light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lightmapped {
    /// Index into [`Baked::pages`].
    pub page: usize,
    /// Texture coordinate set.
    pub texcoord: usize,
}

/// A baked file.
pub struct Baked {
    /// The file.
    pub document: Document,
    /// The world it describes.
    pub scene: Scene,
    /// Its pages, by name.
    pub pages: Vec<Page>,
    /// One per surface of the scene; `None` where it names no lightmap.
    pub lightmaps: Vec<Option<Lightmapped>>,
    /// What nodes, materials and the scene say, one row per surface.
    pub stated: Vec<Stated>,
}

/// Reads a baked file and its pages. A page that cannot be read is kept as the error it is; a file that names no
/// lightmap at all is refused.
pub fn read(path: &Path, options: &ImportOptions) -> Result<Baked> {
    let (document, scene) = import::load(path, options)?;
    let stated: Vec<Stated> = scene.surfaces.iter().map(|s| links::stated(&document.json, s)).collect();
    let mut sources: BTreeMap<String, Source> = BTreeMap::new();
    for stated in &stated {
        if let Some((file, source)) = stated.source(&document.json) {
            sources.entry(file).or_insert(source);
        }
    }
    if sources.is_empty() {
        let what =
            "it names no lightmap: give the output of `lightkiln bake`, not the scene it was made from";
        return Err(Error::invalid(path.display().to_string(), what));
    }
    let pages: Vec<Page> = sources
        .into_iter()
        .map(|(file, source)| {
            let image = source.bytes(&document, options).and_then(|bytes| decode_exr(&file, &bytes));
            let image = image.map_err(|error| match error {
                Error::Invalid { what, .. } => what,
                other => other.to_string(),
            });
            let store = links::store(&file, image.as_ref().ok(), &stated, &document.json);
            Page { file, image, store }
        })
        .collect();
    let lightmaps = stated
        .iter()
        .map(|stated| {
            let (file, _) = stated.source(&document.json)?;
            let page = pages.binary_search_by(|page| page.file.cmp(&file)).ok()?;
            Some(Lightmapped { page, texcoord: stated.texcoord()? })
        })
        .collect();
    Ok(Baked { document, scene, pages, lightmaps, stated })
}

impl Baked {
    /// The surfaces that are seen and name no lightmap.
    pub fn bare_surfaces(&self) -> impl Iterator<Item = usize> + '_ {
        let seen = |i: &usize| self.scene.surfaces[*i].role != Role::Emits;
        (0..self.lightmaps.len()).filter(seen).filter(|&i| self.lightmaps[i].is_none())
    }
}

impl Page {
    /// The stored value at a texture coordinate, bilinear, clamped to the page; black where there is no page.
    pub fn sample(&self, uv: Vec2) -> Vec3 {
        let Ok(image) = &self.image else { return Vec3::ZERO };
        let [width, height] = image.size;
        if !uv.is_finite() || width == 0 || height == 0 {
            return Vec3::ZERO;
        }
        bilinear(&image.value, image.size, uv * Vec2::new(width as f32, height as f32))
    }

    /// What turns a stored value into what a white diffuse surface would radiate, E/π; `None` when what is stored has
    /// the surface's own colour in it.
    pub fn white_radiance_scale(&self) -> Option<f32> {
        match self.store {
            Store::IrradianceOverPi => Some(1.0),
            Store::Irradiance => Some(1.0 / PI),
            Store::Radiosity => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_read_bilinearly_and_end_at_their_borders() {
        let value = [1.0, 3.0, 5.0, 7.0].map(Vec3::splat).to_vec();
        let image = Ok(ExrImage { size: [2, 2], value, attributes: BTreeMap::new() });
        let page = Page { file: "p".into(), image, store: Store::IrradianceOverPi };
        let at = |u, v| page.sample(Vec2::new(u, v)).x;
        assert_eq!([at(0.25, 0.25), at(0.75, 0.25), at(0.25, 0.75), at(0.75, 0.75)], [1.0, 3.0, 5.0, 7.0]);
        assert_eq!([at(0.5, 0.5), at(0.5, 0.25), at(0.0, 0.0), at(2.0, -1.0)], [4.0, 2.0, 1.0, 3.0]);
        assert_eq!(at(f32::NAN, 0.0), 0.0);
    }
}
