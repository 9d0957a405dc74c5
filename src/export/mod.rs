//! Document + atlas + lightmap -> files.
//!
//! The glTF is edited by appending: every object, number and byte of the input stays where it was (`gltf/`). Pages
//! become EXRs (`exr.rs`), materials and extras point at them (`carrier.rs`). All files appear together, the glTF last,
//! or none does (`files.rs`).

mod carrier;
mod exr;
mod files;
mod gltf;
mod journal;
mod lookup;
mod picture;
mod preview;
mod radiance;
mod target;
mod temporary;
mod uri;

pub use exr::{ExrImage, HALF_MAX, decode_exr, read_exr};
pub(crate) use lookup::{bilinear, mean_over_triangle};
pub use picture::{encode_png, picture_png, picture_rgb, write_png};
pub use temporary::TEMPORARY_PREFIX;

use crate::atlas::Atlas;
use crate::error::{Error, Result, Warning};
use crate::import::Document;
use crate::options::{ExportOptions, LampUnits};
use crate::resolve::{Lightmap, LightmapPage};
use crate::scene::Scene;
use carrier::{Carrier, PageFile, SceneFacts};
use exr::{Attribute, Header, Mended};
use files::Batch;
use gltf::Edit;
use serde_json::Value;
use std::path::{Path, PathBuf};
use target::Target;

/// What is written about a bake beside its light.
#[derive(Clone, Debug, Default)]
pub struct Metadata {
    /// Name and version of the program, such as "lightkiln 0.1.0".
    pub generator: String,
    /// The options of the bake, as JSON.
    pub settings: Value,
    /// How far the solution got: `(name, value)`, such as the unshot share of the power. Names of up to 9 letters suit old
    /// readers of EXR.
    pub convergence: Vec<(String, f64)>,
    /// The scene of the file that was baked; found by its objects when absent.
    pub scene: Option<usize>,
}

/// What [`write`] did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Written {
    /// Every file, in the order they appeared; the baked glTF is the last one, or the one before the preview's.
    pub files: Vec<PathBuf>,
    /// What was changed beyond the declared additions, and what viewers may trip over.
    pub warnings: Vec<Warning>,
}

/// Where the baked file of `input` goes: `options.output`, or beside the input with `.baked` in its name.
///
/// Fails where [`write`] could not write, the preview and the picture included, so that no light is computed in vain.
pub fn output_path(input: &Path, options: &ExportOptions) -> Result<PathBuf> {
    let target = Target::new(input, options.output.as_deref())?;
    target.check()?;
    if let Some(path) = &options.preview {
        preview::target(input, path, &target)?.check()?;
    }
    if let Some(path) = &options.picture {
        target::check_picture(path)?;
    }
    Ok(target.path)
}

/// Fails where no file of this name can be written; leaves nothing behind, of killed runs neither.
pub fn check_place(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::invalid(path.display().to_string(), "this is a folder, not a file"));
    }
    files::check_folder(files::folder_of(path))
}

/// Ends what a killed run began to rename in the folder of `path`, which is to be read.
pub fn settle(path: &Path) {
    journal::settle(files::folder_of(path));
}

/// Fails where a file that `options` name is one that the input is made of: those are never changed.
pub fn check_names(document: &Document, options: &ExportOptions) -> Result<()> {
    let batch = Batch::new(target::input_files(document));
    let target = Target::new(&document.path, options.output.as_deref())?;
    let named = [Some(&target.path), options.preview.as_ref(), options.picture.as_ref()];
    named.into_iter().flatten().try_for_each(|path| batch.refuse_input(path))
}

/// Writes files that are not a bake's, all or none; returns their names.
pub fn write_all(files: Vec<(PathBuf, Vec<u8>)>) -> Result<Vec<PathBuf>> {
    let mut batch = Batch::new([]);
    for (path, bytes) in &files {
        batch.add(path, &[bytes])?;
    }
    batch.commit()
}

/// Writes the baked glTF with its pages, and the preview if one is wanted.
///
/// `lightmap` holds the exported pages in the stored unit. `white` holds the same pages with E/π of all light; only the
/// preview needs it. Every file is complete under its name or absent: on an error, whatever was
/// begun vanishes, and the input is never touched.
pub fn write(
    document: &Document,
    scene: &Scene,
    atlas: &Atlas,
    lightmap: &Lightmap,
    white: Option<&Lightmap>,
    metadata: &Metadata,
    options: &ExportOptions,
) -> Result<Written> {
    let target = Target::new(&document.path, options.output.as_deref())?;
    let mut batch = Batch::new(target::input_files(document));
    let mut warnings = Vec::new();

    let preview = match &options.preview {
        Some(path) => Some(preview::target(&document.path, path, &target)?),
        None => None,
    };
    let pages = (0..lightmap.pages.len()).map(|number| page_name(&target, number));
    batch.reserve(pages.map(|name| target.beside(&name)));
    for target in std::iter::once(&target).chain(&preview) {
        batch.reserve([target.beside(&buffer_name(target)), target.path.clone()]);
    }

    let mut edit = Edit::new(document, target.form)?;
    target::bring_resources(&mut edit.json, document, &target, &mut batch, &mut warnings)?;
    let photometric = scene.lamp_units == LampUnits::Gltf;
    let printer = PagePrinter { target: &target, atlas, photometric, metadata, options };
    let pages = printer.print(lightmap, options.embed, &mut batch, &mut warnings)?;
    let fallbacks = fallbacks(&pages, lightmap)?;
    let carrier = Carrier::lightmap(&mut edit, &pages.files, &fallbacks, pages.embedded(), options.store);
    let worn = gltf::dress(&mut edit, scene, atlas, &carrier)?;
    let baked_scene = metadata.scene.or_else(|| gltf::scene_of(&document.json, scene));
    carrier::tell_nodes(&mut edit, &worn, &pages.files, options.store);
    let facts = SceneFacts {
        store: options.store,
        light: options.light,
        unit: exr::unit(options.store, photometric),
        density: atlas.density,
        embedded: options.embed,
        generator: metadata.generator.clone(),
    };
    carrier::tell_scene(&mut edit, baked_scene, &pages.files, &facts);
    gltf::settle_lamps(&mut edit, baked_scene, options);
    if worn.is_empty() {
        edit.warn(document.path.display().to_string(), "no object took a lightmap, so none was added");
    }

    stage_gltf(edit, &target, &mut batch, &mut warnings)?;
    if let Some(preview) = preview {
        let Some(light) = white else {
            let at = preview.path.display().to_string();
            return Err(Error::invalid(at, "a preview needs all light as E/π"));
        };
        printer.check(light)?;
        let job = preview::Job { document, scene, atlas, light, baked_scene };
        job.stage(&preview, &mut batch, &mut warnings)?;
    }
    let files = batch.commit()?;
    Ok(Written { files, warnings })
}

/// The file that a relative `uri` of a glTF names, percent-encoding undone.
pub fn file_of_uri(uri: &str) -> PathBuf {
    uri::to_path(uri)
}

/// Writes a picture of all pages to look at, see [`picture_png`]; whole or not at all.
pub fn write_picture(path: &Path, lightmap: &Lightmap) -> Result<()> {
    let mut batch = Batch::new([]);
    batch.add(path, &[&picture_png(lightmap)?])?;
    batch.commit().map(drop)
}

/// Pages under their names.
struct Pages {
    files: Vec<PageFile>,
    /// Their bytes, when they go into the glTF.
    bytes: Option<Vec<Vec<u8>>>,
}

impl Pages {
    fn embedded(&self) -> Option<&[Vec<u8>]> {
        self.bytes.as_deref()
    }
}

/// Turns pages into EXRs.
struct PagePrinter<'a> {
    target: &'a Target,
    atlas: &'a Atlas,
    photometric: bool,
    metadata: &'a Metadata,
    options: &'a ExportOptions,
}

impl PagePrinter<'_> {
    /// Encodes every page; files go to the batch at once, as all pages together may be large.
    fn print(
        &self,
        lightmap: &Lightmap,
        embed: bool,
        batch: &mut Batch,
        warnings: &mut Vec<Warning>,
    ) -> Result<Pages> {
        self.check(lightmap)?;
        let mut pages = Pages { files: Vec::new(), bytes: embed.then(Vec::new) };
        for (number, page) in lightmap.pages.iter().enumerate() {
            let file = page_name(self.target, number);
            let header = self.header(number, lightmap.pages.len());
            let exr = exr::encode(&file, page.size_texels, &page.value, &header, self.options.full_float)?;
            warn_of_mended(&file, exr.mended, warnings);
            match &mut pages.bytes {
                Some(bytes) => bytes.push(exr.bytes),
                None => batch.add(&self.target.beside(&file), &[&exr.bytes])?,
            }
            pages.files.push(PageFile { file, size_texels: page.size_texels });
        }
        Ok(pages)
    }

    fn check(&self, lightmap: &Lightmap) -> Result<()> {
        let pages = &self.atlas.pages;
        let exported = pages.iter().take_while(|page| page.exported).count();
        let first = pages.iter().filter(|page| page.exported).count() == exported;
        let same =
            pages.iter().zip(&lightmap.pages).all(|(page, light)| page.size_texels == light.size_texels);
        if first && same && exported == lightmap.pages.len() {
            return Ok(());
        }
        let what = "the pages of light are not those of the atlas; this is a fault of the program";
        Err(Error::invalid(self.target.path.display().to_string(), what))
    }

    fn header(&self, number: usize, count: usize) -> Header {
        let Self { metadata, options, .. } = self;
        let text = |s: &str| Attribute::Text(s.to_owned());
        let whole = |n: usize| Attribute::Integer(i32::try_from(n).unwrap_or(i32::MAX));
        let mut attributes: Vec<(String, Attribute)> = [
            ("store", text(exr::store_name(options.store))),
            ("unit", text(exr::unit(options.store, self.photometric))),
            ("light", text(exr::light_name(options.light))),
            ("version", text(&metadata.generator)),
            ("settings", text(&metadata.settings.to_string())),
            ("page", whole(number)),
            ("pages", whole(count)),
            ("texelsPerMetre", Attribute::Float(self.atlas.density)),
        ]
        .map(|(name, value)| (format!("lightkiln.{name}"), value))
        .into();
        for (name, value) in &metadata.convergence {
            attributes.push((format!("lightkiln.convergence.{name}"), Attribute::Double(*value)));
        }
        Header { attributes, software: metadata.generator.clone() }
    }
}

fn warn_of_mended(file: &str, mended: Mended, warnings: &mut Vec<Warning>) {
    if mended.clipped > 0 {
        let what = format!(
            "{} texels are brighter than {HALF_MAX}, the most a half float holds, and were cut to it: bake with \
             32 bit floats, or make the emitter weaker",
            mended.clipped
        );
        warnings.push(Warning::new(file, what));
    }
    if mended.unlawful > 0 {
        let what = format!(
            "{} texels were negative or not a number and are black: a fault of the program",
            mended.unlawful
        );
        warnings.push(Warning::new(file, what));
    }
}

fn page_name(target: &Target, number: usize) -> String {
    format!("{}.lightmap{number}.exr", target.stem)
}

/// The buffer beside a `.gltf`; the name differs from what other exporters choose, so that none is replaced.
fn buffer_name(target: &Target) -> String {
    format!("{}.lightmap.bin", target.stem)
}

fn fallbacks(pages: &Pages, lightmap: &Lightmap) -> Result<Vec<Vec<u8>>> {
    let png = |(page, light): (&PageFile, &LightmapPage)| picture::fallback_png(&page.file, light);
    pages.files.iter().zip(&lightmap.pages).map(png).collect()
}

/// The bytes of an edited glTF go to the batch, its own buffer first.
fn stage_gltf(edit: Edit, target: &Target, batch: &mut Batch, warnings: &mut Vec<Warning>) -> Result<()> {
    let name = buffer_name(target);
    let (pieces, said) = edit.finish(&target.path.display().to_string(), &name)?;
    warnings.extend(said);
    if let Some(buffer) = pieces.buffer {
        let parts: Vec<&[u8]> = buffer.iter().map(AsRef::as_ref).collect();
        batch.add(&target.beside(&name), &parts)?;
    }
    let parts: Vec<&[u8]> = pieces.gltf.iter().map(AsRef::as_ref).collect();
    batch.add(&target.path, &parts)
}
