//! Document + atlas + lightmap -> files.
//!
//! The glTF is edited by appending: every object, number and byte of the input stays where it was (`gltf/`). Pages
//! become EXRs (`exr.rs`), materials and extras point at them (`carrier.rs`). All files appear together, the glTF last,
//! or none does (`files.rs`).

mod carrier;
mod exr;
mod files;
mod gltf;
mod picture;
mod preview;
mod target;
mod uri;

pub use exr::{ExrImage, HALF_MAX, decode_exr, read_exr};
pub use files::TEMPORARY_PREFIX;
pub use picture::picture_png;

use crate::atlas::Atlas;
use crate::error::{Error, Result, Warning};
use crate::import::Document;
use crate::options::ExportOptions;
use crate::resolve::{Lightmap, LightmapPage};
use crate::scene::Scene;
use carrier::{Carrier, PageFile, SceneFacts};
use exr::{Attribute, Encoded, Header};
use files::Batch;
use gltf::{Edit, items};
use serde_json::Value;
use std::path::PathBuf;
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
    /// Whether light is measured in lumens instead of watts.
    pub photometric: bool,
    /// The scene of the file that was baked; its default scene when absent.
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

/// Fails where [`write`] would not be able to write: to be asked before the light is computed.
pub fn check(document: &Document, options: &ExportOptions) -> Result<()> {
    let target = Target::new(document, options.output.as_deref())?;
    target.check()?;
    match &options.preview {
        Some(path) => preview::target(document, path, &target)?.check(),
        None => Ok(()),
    }
}

/// Writes the baked glTF with its pages, and the preview if one is wanted.
///
/// `lightmap` holds the exported pages in the stored unit. `radiance` holds the same pages as outgoing radiance
/// ρE/π + L_e; only the preview needs it. Every file is complete under its name or absent: on an error, whatever was
/// begun vanishes, and the input is never touched.
pub fn write(
    document: &Document,
    scene: &Scene,
    atlas: &Atlas,
    lightmap: &Lightmap,
    radiance: Option<&Lightmap>,
    metadata: &Metadata,
    options: &ExportOptions,
) -> Result<Written> {
    let target = Target::new(document, options.output.as_deref())?;
    let mut batch = Batch::new(target::input_files(document));
    let mut warnings = Vec::new();

    let preview = match &options.preview {
        Some(path) => Some(preview::target(document, path, &target)?),
        None => None,
    };
    for (target, kind) in
        std::iter::once((&target, "lightmap")).chain(preview.iter().map(|p| (p, preview::KIND)))
    {
        let pages = (0..lightmap.pages.len()).map(|number| page_name(target, kind, number));
        batch.reserve(pages.chain([buffer_name(target)]).map(|name| target.beside(&name)));
        batch.reserve([target.path.clone()]);
    }

    let mut edit = Edit::new(document, target.form);
    target::bring_resources(&mut edit.json, document, &target, &mut batch, &mut warnings)?;
    let pages = encode_pages(&target, "lightmap", atlas, lightmap, metadata, options, &mut warnings)?;
    let fallbacks = fallbacks(&pages, lightmap)?;
    let embedded = options.embed.then_some(pages.bytes.as_slice());
    let carrier = Carrier::lightmap(&mut edit, &pages.files, &fallbacks, embedded, options.store);
    let worn = gltf::dress(&mut edit, scene, atlas, &carrier)?;
    let baked_scene = metadata.scene.or_else(|| default_scene(&document.json));
    carrier::tell_nodes(&mut edit, &worn, &pages.files, options.store);
    let facts = SceneFacts {
        store: options.store,
        light: options.light,
        unit: exr::unit(options.store, metadata.photometric),
        density: atlas.density,
        embedded: options.embed,
        generator: metadata.generator.clone(),
    };
    carrier::tell_scene(&mut edit, baked_scene, &pages.files, &facts);
    gltf::settle_lamps(&mut edit, baked_scene, options);
    if worn.is_empty() {
        edit.warn(document.path.display().to_string(), "no object took a lightmap, so none was added");
    }

    if !options.embed {
        pages.stage(&target, &mut batch)?;
    }
    stage_gltf(edit, &target, &mut batch, &mut warnings)?;
    if let Some(preview) = preview {
        let Some(radiance) = radiance else {
            let at = preview.path.display().to_string();
            return Err(Error::invalid(at, "a preview needs the outgoing radiance"));
        };
        let job = preview::Job { document, scene, atlas, radiance, metadata, options, baked_scene };
        job.stage(&preview, &mut batch, &mut warnings)?;
    }
    let files = batch.commit()?;
    Ok(Written { files, warnings })
}

/// Pages under their names, encoded.
struct Pages {
    files: Vec<PageFile>,
    bytes: Vec<Vec<u8>>,
}

impl Pages {
    fn stage(&self, target: &Target, batch: &mut Batch) -> Result<()> {
        for (page, bytes) in self.files.iter().zip(&self.bytes) {
            batch.add(&target.beside(&page.file), &[bytes])?;
        }
        Ok(())
    }
}

fn page_name(target: &Target, kind: &str, number: usize) -> String {
    format!("{}.{kind}{number}.exr", target.stem)
}

/// The buffer beside a `.gltf`; the name differs from what other exporters choose, so that none is replaced.
fn buffer_name(target: &Target) -> String {
    format!("{}.lightmap.bin", target.stem)
}

fn encode_pages(
    target: &Target,
    kind: &str,
    atlas: &Atlas,
    lightmap: &Lightmap,
    metadata: &Metadata,
    options: &ExportOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Pages> {
    let exported = atlas.pages.iter().filter(|page| page.exported).count();
    let fits =
        atlas.pages.iter().zip(&lightmap.pages).all(|(page, light)| page.size_texels == light.size_texels);
    if lightmap.pages.len() != exported
        || !fits
        || !atlas.pages.iter().take(exported).all(|page| page.exported)
    {
        let what = "the pages of light are not those of the atlas; this is a fault of the program";
        return Err(Error::invalid(target.path.display().to_string(), what));
    }
    let mut pages = Pages { files: Vec::new(), bytes: Vec::new() };
    for (number, page) in lightmap.pages.iter().enumerate() {
        let file = page_name(target, kind, number);
        let header = header(kind, number, lightmap.pages.len(), atlas, metadata, options);
        let Encoded { bytes, mended } =
            exr::encode(&file, page.size_texels, &page.value, &header, options.full_float)?;
        if mended.clipped > 0 {
            let what = format!(
                "{} texels are brighter than {HALF_MAX}, the most a half float holds, and were cut to it: bake with \
                 32 bit floats, or make the emitter weaker",
                mended.clipped
            );
            warnings.push(Warning::new(&file, what));
        }
        if mended.unlawful > 0 {
            let what = format!(
                "{} texels were negative or not a number and are black: a fault of the program",
                mended.unlawful
            );
            warnings.push(Warning::new(&file, what));
        }
        pages.files.push(PageFile { file, size_texels: page.size_texels });
        pages.bytes.push(bytes);
    }
    Ok(pages)
}

fn header(
    kind: &str,
    number: usize,
    count: usize,
    atlas: &Atlas,
    metadata: &Metadata,
    options: &ExportOptions,
) -> Header {
    let text = |s: &str| Attribute::Text(s.to_owned());
    let whole = |n: usize| Attribute::Integer(i32::try_from(n).unwrap_or(i32::MAX));
    let (store, unit) = match kind {
        preview::KIND => ("radiance", exr::radiance_unit(metadata.photometric)),
        _ => (exr::store_name(options.store), exr::unit(options.store, metadata.photometric)),
    };
    let mut attributes: Vec<(String, Attribute)> = [
        ("store", text(store)),
        ("unit", text(unit)),
        ("light", text(exr::light_name(options.light))),
        ("version", text(&metadata.generator)),
        ("settings", text(&metadata.settings.to_string())),
        ("page", whole(number)),
        ("pages", whole(count)),
        ("texelsPerMetre", Attribute::Float(atlas.density)),
    ]
    .map(|(name, value)| (format!("lightkiln.{name}"), value))
    .into();
    let convergence = metadata.convergence.iter();
    attributes.extend(
        convergence.map(|(name, value)| (format!("lightkiln.convergence.{name}"), Attribute::Double(*value))),
    );
    Header { attributes, software: metadata.generator.clone() }
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

fn default_scene(json: &Value) -> Option<usize> {
    let named = json.get("scene").and_then(Value::as_u64).map(|scene| scene as usize);
    let scene = named.unwrap_or(0);
    (scene < items(json, "scenes").len()).then_some(scene)
}
