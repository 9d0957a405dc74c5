//! From light to files.

use super::{Glimpse, Log};
use crate::error::{Result, Warning};
use crate::export::{self, Metadata, Written};
use crate::import::Document;
use crate::options::{BakeOptions, ImportOptions, LightPart, RenderOptions, SkyOption, Store};
use crate::progress::Stage;
use crate::resolve::{self, Lightmap};
use crate::scene::Scene;
use crate::{baked, render};
use serde_json::Value;
use std::path::Path;

/// Where a bake's light goes.
pub struct Output<'a> {
    pub document: &'a Document,
    pub scene: &'a Scene,
    pub options: &'a BakeOptions,
    /// The baked file.
    pub path: &'a Path,
}

impl Output<'_> {
    /// Writes everything, as two stages.
    pub fn write(&self, light: &Glimpse, log: &mut Log) -> Result<Written> {
        let pages = log.stage(Stage::Resolve, 1, |_| Ok((self.pages(light), 0)))?;
        log.stage(Stage::Export, 1, |_| Ok((self.files(light, pages)?, 0)))
    }

    /// Writes everything, in the middle of another stage.
    pub fn write_so_far(&self, light: &Glimpse) -> Result<()> {
        self.files(light, self.pages(light)).map(drop)
    }

    /// The lightmap, and all light on white where a preview wants that.
    fn pages(&self, light: &Glimpse) -> (Lightmap, Option<Lightmap>) {
        let Glimpse { atlas, elements, .. } = *light;
        let export = &self.options.export;
        let part = light.part(export.light);
        let lightmap = resolve::resolve(self.scene, elements, atlas, &part, export.store);
        let white = export.preview.as_ref().map(|_| {
            let all = light.part(LightPart::Full);
            resolve::resolve(self.scene, elements, atlas, &all, Store::IrradianceOverPi)
        });
        (lightmap, white)
    }

    fn files(&self, light: &Glimpse, (lightmap, white): (Lightmap, Option<Lightmap>)) -> Result<Written> {
        let Self { document, scene, options, .. } = *self;
        let metadata = Metadata {
            generator: concat!("lightkiln ", env!("CARGO_PKG_VERSION")).to_owned(),
            settings: settings(options),
            convergence: vec![("unshot".to_owned(), light.unshot_fraction)],
            scene: scene.index,
        };
        let (export, white) = (&options.export, white.as_ref());
        let mut written = export::write(document, scene, light.atlas, &lightmap, white, &metadata, export)?;
        if let Some(path) = &export.picture {
            written.warnings.extend(take_picture(path, self.path, &options.import)?);
            written.files.push(path.clone());
        }
        Ok(written)
    }
}

/// The options, as JSON, without where files lie: the same bake into another folder is the same bytes, and what is
/// given away tells nothing of the disk it was made on.
fn settings(options: &BakeOptions) -> Value {
    let mut options = options.clone();
    if let Some(SkyOption::Image { path, .. }) = &mut options.import.sky {
        *path = path.file_name().unwrap_or_default().into();
    }
    let mut settings = serde_json::to_value(options).unwrap_or_default();
    if let Some(export) = settings["export"].as_object_mut() {
        for place in ["output", "preview", "picture"] {
            export.shift_remove(place);
        }
    }
    settings
}

/// A picture of what was just written, as `lightkiln render` would take it; a warning where there is nothing to see.
fn take_picture(path: &Path, output: &Path, import: &ImportOptions) -> Result<Option<Warning>> {
    let seen =
        baked::read(output, import).and_then(|baked| render::picture(&baked, &RenderOptions::default()));
    match seen {
        Ok(picture) => export::write_png(path, picture.size, &picture.rgb).map(|()| None),
        Err(error) => Ok(Some(Warning::new(path.display().to_string(), format!("no picture: {error}")))),
    }
}
