//! The second file, for looking: every surface is black and shines with the light that leaves it, so that stock Blender
//! and any other viewer shows the result without knowing what a lightmap is.
//!
//! The pages are PNGs inside the file, with 16 bits so that dark corners of bright materials have no steps; readers that
//! know 8 bits only see those. Brighter than one is said by KHR_materials_emissive_strength.

use super::carrier::{self, Carrier, RadiancePng};
use super::files::Batch;
use super::gltf::{self, Edit};
use super::picture;
use super::radiance::{self, RadiancePage};
use super::stage_gltf;
use super::target::{self, Target};
use crate::atlas::Atlas;
use crate::error::{Error, Result, Warning};
use crate::import::Document;
use crate::options::{ExportOptions, LampsOut, LightPart};
use crate::resolve::Lightmap;
use crate::scene::{Role, Scene, Surface};
use std::path::Path;

/// Where a preview goes; `main` is the baked file.
pub(super) fn target(input: &Path, path: &Path, main: &Target) -> Result<Target> {
    let target = Target::new(input, Some(path))?;
    if target.path == main.path {
        return Err(Error::invalid(
            path.display().to_string(),
            "the preview needs another name than the output",
        ));
    }
    Ok(target)
}

/// What a preview is made of.
pub(super) struct Job<'a> {
    pub document: &'a Document,
    pub scene: &'a Scene,
    pub atlas: &'a Atlas,
    /// E/π of all light.
    pub light: &'a Lightmap,
    pub baked_scene: Option<usize>,
}

impl Job<'_> {
    /// Adds the preview to the batch.
    pub fn stage(&self, target: &Target, batch: &mut Batch, warnings: &mut Vec<Warning>) -> Result<()> {
        let Self { scene, atlas, light, .. } = *self;
        let mut edit = Edit::new(self.document, target.form)?;
        target::bring_resources(&mut edit.json, self.document, target, batch, warnings)?;
        let mut pages = Vec::new();
        for (number, light) in (0..).zip(&light.pages) {
            let name = format!("{}.radiance{number}", target.stem);
            let RadiancePage { size_texels, value, white } = radiance::paint(scene, atlas, number, light);
            let png = picture::deep_png(&name, size_texels, &value)?;
            pages.push(RadiancePng { name, png, white });
        }
        let carrier = Carrier::radiance(&mut edit, pages);
        gltf::dress(&mut edit, scene, atlas, &carrier)?;
        self.light_the_bare(&mut edit);
        gltf::settle_variants(&mut edit);
        let dark =
            ExportOptions { lamps: LampsOut::Remove, light: LightPart::Full, ..ExportOptions::default() };
        gltf::settle_lamps(&mut edit, self.baked_scene, &dark);
        // The baked file has said it all.
        edit.warnings.clear();
        stage_gltf(edit, target, batch, warnings)
    }

    /// What has no lightmap, a character for one, is lit by the mean of all light, as `lightkiln render` does it.
    fn light_the_bare(&self, edit: &mut Edit) {
        let scene = self.scene;
        let bare = |s: &&Surface| s.role == Role::Reflects && !scene.material(s).unlit;
        if !scene.surfaces.iter().any(|surface| bare(&surface)) {
            return;
        }
        let white = radiance::mean_white_radiance(scene, self.atlas, self.light);
        gltf::repaint(edit, scene.surfaces.iter().filter(bare), |original, surface| {
            carrier::evenly_lit(original, scene.material(surface), white)
        });
    }
}
