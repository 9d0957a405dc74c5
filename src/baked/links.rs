//! How a baked file says where its light is: extras of nodes and scene by name, MOZ_lightmap on materials by index.

use crate::error::{Error, Result};
use crate::export::{ExrImage, file_of_uri};
use crate::import::Document;
use crate::options::{ImportOptions, Store};
use crate::scene::Surface;
use serde_json::Value;
use std::borrow::Cow;
use std::f64::consts::PI;

/// What a node's extras say about its lightmap.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entry {
    /// The page's file name.
    pub file: Option<String>,
    /// Texture coordinate set.
    pub texcoord: Option<usize>,
    /// What the texels hold, as the command line spells it.
    pub store: Option<String>,
    /// `[u0, v0, u1, v1]`, v downwards.
    pub rect: Option<[f32; 4]>,
}

/// What a material's MOZ_lightmap says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialLink {
    /// The image that holds the EXR; `None` when the texture names none.
    pub image: Option<usize>,
    /// That image's `uri`, as it stands in the file.
    pub uri: Option<String>,
    /// That image's name.
    pub name: Option<String>,
    /// Whether the EXR is in the file itself.
    pub embedded: bool,
    /// Whether the texture has an image for readers that know no EXR.
    pub fallback: bool,
    /// Texture coordinate set.
    pub texcoord: usize,
    /// What a texel is multiplied with to get irradiance.
    pub intensity: Option<f64>,
}

/// Everything a file says about the light of one surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stated {
    /// By the node.
    pub entry: Option<Entry>,
    /// By the material.
    pub material: Option<MaterialLink>,
}

/// Where the bytes of a page are.
pub(super) enum Source {
    Image(usize),
    Beside(String),
}

impl Source {
    pub fn bytes<'a>(&self, document: &'a Document, options: &ImportOptions) -> Result<Cow<'a, [u8]>> {
        match self {
            Self::Image(image) => document.image_bytes(*image, options),
            Self::Beside(file) => {
                document.companion_bytes(file, options, file).map(Cow::Owned).map_err(|e| match e {
                    Error::Io { path, source } if source.kind() == std::io::ErrorKind::NotFound => {
                        let what = "the page is missing: keep it beside the glTF, or bake with --embed";
                        Error::invalid(path.display().to_string(), what)
                    }
                    other => other,
                })
            }
        }
    }
}

fn item<'a>(json: &'a Value, list: &str, index: usize) -> Option<&'a Value> {
    json.get(list)?.get(index)
}

fn index(value: &Value, key: &str) -> Option<usize> {
    value.get(key)?.as_u64().and_then(|i| usize::try_from(i).ok())
}

fn text(value: &Value, key: &str) -> Option<String> {
    value.get(key)?.as_str().map(str::to_owned)
}

/// What the file says about a surface.
pub(super) fn stated(json: &Value, surface: &Surface) -> Stated {
    let origin = &surface.origin;
    let entry = item(json, "nodes", origin.node)
        .and_then(|node| node.get("extras")?.get("lightmap"))
        .filter(|entry| entry.is_object())
        .map(|entry| Entry {
            file: text(entry, "file"),
            texcoord: index(entry, "texCoord"),
            store: text(entry, "store"),
            rect: rect(entry),
        });
    let material = item(json, "meshes", origin.mesh)
        .and_then(|mesh| mesh.get("primitives")?.get(origin.primitive))
        .and_then(|primitive| item(json, "materials", index(primitive, "material")?))
        .and_then(|material| material.get("extensions")?.get("MOZ_lightmap"))
        .map(|link| material_link(json, link));
    Stated { entry, material }
}

fn rect(entry: &Value) -> Option<[f32; 4]> {
    let numbers: Vec<f32> =
        entry.get("rect")?.as_array()?.iter().filter_map(Value::as_f64).map(|x| x as f32).collect();
    numbers.try_into().ok()
}

fn material_link(json: &Value, link: &Value) -> MaterialLink {
    let texture = index(link, "index").and_then(|i| item(json, "textures", i));
    let image = texture.and_then(|t| index(t.get("extensions")?.get("EXT_texture_exr")?, "source"));
    let exr = image.and_then(|i| item(json, "images", i));
    MaterialLink {
        image: exr.and(image),
        uri: exr.and_then(|image| text(image, "uri")),
        name: exr.and_then(|image| text(image, "name")),
        embedded: exr.is_some_and(|image| image.get("bufferView").is_some()),
        fallback: texture.is_some_and(|t| t.get("source").is_some()),
        texcoord: index(link, "texCoord").unwrap_or(0),
        intensity: link.get("intensity").and_then(Value::as_f64),
    }
}

impl Stated {
    /// Texture coordinate set of the lightmap.
    pub fn texcoord(&self) -> Option<usize> {
        let entry = self.entry.as_ref().and_then(|entry| entry.texcoord);
        entry.or_else(|| self.material.as_ref().map(|link| link.texcoord))
    }

    /// The page's name and where its bytes are. Names in extras survive other programs, indices do not, so they come
    /// first; an embedded page is found by its image's name.
    pub(super) fn source(&self, json: &Value) -> Option<(String, Source)> {
        if let Some(file) = self.entry.as_ref().and_then(|entry| entry.file.clone()) {
            let stem = file.strip_suffix(".exr").unwrap_or(&file);
            let images = json.get("images").and_then(Value::as_array);
            let embedded = images.into_iter().flatten().position(|image| {
                image.get("bufferView").is_some() && text(image, "name").as_deref() == Some(stem)
            });
            let source = match embedded {
                Some(image) => Source::Image(image),
                None => Source::Beside(file.clone()),
            };
            return Some((file, source));
        }
        let link = self.material.as_ref()?;
        let image = link.image?;
        let file = match (&link.uri, &link.name) {
            (Some(uri), _) => file_of_uri(uri).to_string_lossy().into_owned(),
            (None, Some(name)) => format!("{name}.exr"),
            (None, None) => format!("image {image}"),
        };
        Some((file, Source::Image(image)))
    }
}

/// The meaning of the word in extras or header.
pub(crate) fn store_named(name: &str) -> Option<Store> {
    let named = |store: &Store| serde_json::to_value(store).is_ok_and(|value| value == name);
    [Store::IrradianceOverPi, Store::Irradiance, Store::Radiosity].into_iter().find(named)
}

/// What viewers that multiply by this get irradiance from.
pub(crate) fn store_of_intensity(intensity: f64) -> Option<Store> {
    let near = |wanted: f64| (intensity / wanted - 1.0).abs() < 1e-3;
    match intensity {
        _ if near(PI) => Some(Store::IrradianceOverPi),
        _ if near(1.0) => Some(Store::Irradiance),
        _ => None,
    }
}

/// What the texels of a page hold: the header travels with the numbers and is believed first, then the node, then the
/// material; E/π where nothing says anything.
pub(super) fn store(file: &str, image: Option<&ExrImage>, stated: &[Stated], json: &Value) -> Store {
    let header = image.and_then(|image| store_named(image.attributes.get("lightkiln.store")?));
    let here = || stated.iter().filter(|s| s.source(json).is_some_and(|(name, _)| name == file));
    let node = || here().find_map(|s| store_named(s.entry.as_ref()?.store.as_ref()?));
    let material = || here().find_map(|s| store_of_intensity(s.material.as_ref()?.intensity?));
    header.or_else(node).or_else(material).unwrap_or_default()
}
