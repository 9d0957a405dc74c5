//! The second file, for looking: every lightmapped surface is black and shines with the light that leaves it, so that
//! stock Blender and other viewers show the result without knowing what a lightmap is.
//!
//! It names EXRs where core glTF knows PNG and JPEG only, and takes the lamps away; it is not an asset to go on with.

use super::carrier::Carrier;
use super::files::Batch;
use super::gltf::{self, Edit};
use super::target::{self, Target};
use super::{Metadata, PagePrinter, stage_gltf};
use crate::atlas::Atlas;
use crate::error::{Error, Result, Warning};
use crate::import::Document;
use crate::options::{ExportOptions, LampsOut, LightPart};
use crate::resolve::Lightmap;
use crate::scene::Scene;
use std::path::Path;

/// What its pages are called.
pub(super) const KIND: &str = "radiance";

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
    pub radiance: &'a Lightmap,
    pub photometric: bool,
    pub metadata: &'a Metadata,
    pub options: &'a ExportOptions,
    pub baked_scene: Option<usize>,
}

impl Job<'_> {
    /// Adds the preview and its pages to the batch.
    pub fn stage(&self, target: &Target, batch: &mut Batch, warnings: &mut Vec<Warning>) -> Result<()> {
        let mut edit = Edit::new(self.document, target.form)?;
        target::bring_resources(&mut edit.json, self.document, target, batch, warnings)?;
        let Self { atlas, photometric, metadata, options, .. } = *self;
        let printer = PagePrinter { kind: KIND, target, atlas, photometric, metadata, options };
        let pages = printer.print(self.radiance, false, batch, warnings)?;
        let carrier = Carrier::radiance(&mut edit, &pages.files);
        gltf::dress(&mut edit, self.scene, self.atlas, &carrier)?;
        let dark =
            ExportOptions { lamps: LampsOut::Remove, light: LightPart::Full, ..ExportOptions::default() };
        gltf::settle_lamps(&mut edit, self.baked_scene, &dark);
        // The baked file has said it all.
        edit.warnings.clear();
        stage_gltf(edit, target, batch, warnings)
    }
}
