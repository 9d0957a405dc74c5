//! How glTF points at the pages: MOZ_lightmap and EXT_texture_exr on materials, names in extras.
//!
//! The extensions are what viewers read; extras with file names are what survives Blender and other tools. Nothing is
//! ever required: a reader that knows none of it shows the scene as it was.

use super::exr::{light_name, store_name};
use super::gltf::{Edit, LIGHTMAP, Worn, extension, set_extension};
use super::uri;
use crate::options::{LightPart, Store};
use crate::scene::Material;
use glam::Vec3;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::f64::consts::PI;

const TEXTURE_EXR: &str = "EXT_texture_exr";
const SPECULAR: &str = "KHR_materials_specular";
const STRENGTH: &str = "KHR_materials_emissive_strength";
const LINEAR: u32 = 9729;
const CLAMP_TO_EDGE: u32 = 33071;

/// A page as the glTF names it.
pub(super) struct PageFile {
    /// The EXR's file name; also what extras call it when it is embedded.
    pub file: String,
    /// Width and height, texels.
    pub size_texels: u32,
}

impl PageFile {
    fn name(&self) -> &str {
        self.file.strip_suffix(".exr").unwrap_or(&self.file)
    }
}

/// A page of radiance as the glTF holds it.
pub(super) struct RadiancePng {
    pub name: String,
    pub png: Vec<u8>,
    /// The radiance that its white stands for, by material of the file.
    pub white: BTreeMap<Option<usize>, f32>,
}

/// What lit materials look like.
pub(super) enum Carrier {
    /// The material as it was, with a lightmap in this texture of each page.
    Lightmap { textures: Vec<usize>, intensity: f64 },
    /// Lightmapped by extras alone: no viewer's law fits what is stored.
    ExtrasOnly,
    /// Black, and shining with this texture of each page, as strongly as each material of the file needs there.
    Radiance { pages: Vec<(usize, BTreeMap<Option<usize>, f32>)> },
}

/// What a viewer multiplies a texel with to get irradiance; `None` where nothing gives it.
pub(super) fn intensity(store: Store) -> Option<f64> {
    match store {
        Store::IrradianceOverPi => Some(PI),
        Store::Irradiance => Some(1.0),
        // b = ρE + e; viewers would multiply by the reflectance once more.
        Store::Radiosity => None,
    }
}

impl Carrier {
    /// Adds the pages as textures: a PNG every reader knows, and the EXR beside it. `embedded` holds the EXRs' bytes
    /// when they go into the file.
    pub fn lightmap(
        edit: &mut Edit,
        pages: &[PageFile],
        fallbacks: &[Vec<u8>],
        embedded: Option<&[Vec<u8>]>,
        store: Store,
    ) -> Self {
        let sampler = (!pages.is_empty()).then(|| push_sampler(edit));
        let textures = pages
            .iter()
            .enumerate()
            .map(|(i, page)| {
                let png = edit.view(&fallbacks[i], None, None);
                let fallback = edit.push(
                    "images",
                    json!({"name": format!("{}.fallback", page.name()), "bufferView": png, "mimeType": "image/png"}),
                );
                let mut image = json!({"name": page.name()});
                match embedded {
                    Some(bytes) => image["bufferView"] = json!(edit.view(&bytes[i], None, None)),
                    None => image["uri"] = json!(uri::from_name(&page.file)),
                }
                image["mimeType"] = json!("image/x-exr");
                let exr = edit.push("images", image);
                edit.push(
                    "textures",
                    json!({"name": page.name(), "sampler": sampler, "source": fallback,
                           "extensions": {TEXTURE_EXR: {"source": exr}}}),
                )
            })
            .collect::<Vec<_>>();
        if !textures.is_empty() {
            edit.use_extension(TEXTURE_EXR);
        }
        match intensity(store) {
            Some(intensity) => {
                if !textures.is_empty() {
                    edit.use_extension(LIGHTMAP);
                }
                Self::Lightmap { textures, intensity }
            }
            None => Self::ExtrasOnly,
        }
    }

    /// Adds pages of radiance as textures.
    pub fn radiance(edit: &mut Edit, pages: Vec<RadiancePng>) -> Self {
        let sampler = (!pages.is_empty()).then(|| push_sampler(edit));
        let pages = pages
            .into_iter()
            .map(|RadiancePng { name, png, white }| {
                let view = edit.view(&png, None, None);
                let image = json!({"name": name, "bufferView": view, "mimeType": "image/png"});
                let source = edit.push("images", image);
                let texture =
                    edit.push("textures", json!({"name": name, "sampler": sampler, "source": source}));
                (texture, white)
            })
            .collect::<Vec<_>>();
        if !pages.is_empty() {
            edit.use_extension(SPECULAR);
        }
        if pages.iter().any(|(_, white)| white.values().any(|white| *white > 1.0)) {
            edit.use_extension(STRENGTH);
        }
        Self::Radiance { pages }
    }

    /// The lit form of a material, the file's number `index`, on a page; `None` when materials stay as they are.
    pub fn lit(
        &self,
        original: &Map<String, Value>,
        index: Option<usize>,
        page: u32,
        set: usize,
    ) -> Option<Map<String, Value>> {
        let page = page as usize;
        match self {
            Self::Lightmap { textures, intensity } => {
                let mut material = original.clone();
                let lightmap = json!({"index": textures.get(page)?, "texCoord": set, "intensity": intensity});
                set_extension(&mut material, LIGHTMAP, lightmap);
                Some(material)
            }
            Self::ExtrasOnly => None,
            Self::Radiance { pages } => {
                let (texture, white) = pages.get(page)?;
                let white = white.get(&index).copied().unwrap_or(1.0);
                let texture = json!({"index": texture, "texCoord": set});
                Some(shining(original, Some(texture), Vec3::splat(white)))
            }
        }
    }

    /// Whether a material may become its lit form in place: nothing it has is lost then.
    pub fn keeps(&self, original: &Value) -> bool {
        matches!(self, Self::Lightmap { .. }) && extension(original, LIGHTMAP).is_none()
    }
}

fn push_sampler(edit: &mut Edit) -> usize {
    let sampler =
        json!({"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE});
    edit.push("samplers", sampler)
}

/// A surface that reflects nothing and shines with a texture times `radiance`; what makes it transparent stays.
fn shining(original: &Map<String, Value>, texture: Option<Value>, radiance: Vec3) -> Map<String, Value> {
    let mut material = Map::new();
    for key in ["name", "doubleSided", "alphaMode", "alphaCutoff"] {
        if let Some(value) = original.get(key) {
            material.insert(key.to_owned(), value.clone());
        }
    }
    let old = original.get("pbrMetallicRoughness");
    let alpha = old.and_then(|pbr| pbr.get("baseColorFactor")?.get(3)).cloned().unwrap_or(json!(1));
    let mut pbr = json!({"baseColorFactor": [0, 0, 0, alpha], "metallicFactor": 0, "roughnessFactor": 1});
    if let Some(texture) = old.and_then(|pbr| pbr.get("baseColorTexture")) {
        pbr["baseColorTexture"] = texture.clone();
    }
    material.insert("pbrMetallicRoughness".to_owned(), pbr);
    if let Some(texture) = texture {
        material.insert("emissiveTexture".to_owned(), texture);
    }
    // A factor ends at one; what is more goes into the strength.
    let strength = radiance.max_element().max(1.0);
    material.insert("emissiveFactor".to_owned(), json!((radiance / strength).to_array()));
    if strength > 1.0 {
        set_extension(&mut material, STRENGTH, json!({"emissiveStrength": strength}));
    }
    set_extension(&mut material, SPECULAR, json!({"specularFactor": 0}));
    material
}

/// A surface without lightmap in light that is the same everywhere: `white` is E/π. One texture is all that a black
/// material can shine with, so a glowing texture leaves no room for the surface's own colour.
pub(super) fn evenly_lit(
    original: &Map<String, Value>,
    material: &Material,
    white: Vec3,
) -> Map<String, Value> {
    if material.emission_texture.is_some() {
        return shining(original, original.get("emissiveTexture").cloned(), material.emission.0);
    }
    let metallic = if material.metallic_texture.is_some() { 0.0 } else { material.metallic.clamp(0.0, 1.0) };
    let reflected = material.base_color.truncate() * (1.0 - metallic) * white;
    let texture = original.get("pbrMetallicRoughness").and_then(|pbr| pbr.get("baseColorTexture"));
    match texture {
        Some(texture) => shining(original, Some(texture.clone()), reflected),
        None => shining(original, None, reflected + material.emission.0),
    }
}

/// Names file, set, rectangle and unit in the extras of every lightmapped node.
pub(super) fn tell_nodes(edit: &mut Edit, worn: &[Worn], pages: &[PageFile], store: Store) {
    for node in worn {
        let Some(page) = pages.get(node.page as usize) else { continue };
        let entry = json!({
            "file": page.file,
            "texCoord": node.set,
            "rect": node.rect,
            "store": store_name(store),
        });
        edit.merge_extras("nodes", node.node, &node.name, "lightmap", entry);
    }
}

/// What the scene's extras say about all pages.
pub(super) struct SceneFacts {
    /// What a texel holds.
    pub store: Store,
    /// Which light.
    pub light: LightPart,
    /// The unit, as in the EXR's header.
    pub unit: &'static str,
    /// Texels per metre.
    pub density: f32,
    /// Whether the EXRs are in the file.
    pub embedded: bool,
    /// Name and version of the program.
    pub generator: String,
}

/// Lists the pages in the extras of the baked scene.
pub(super) fn tell_scene(edit: &mut Edit, scene: Option<usize>, pages: &[PageFile], facts: &SceneFacts) {
    let Some(scene) = scene else { return };
    if pages.is_empty() {
        return;
    }
    let entries = pages
        .iter()
        .map(|page| {
            let mut entry = json!({
                "file": page.file,
                "store": store_name(facts.store),
                "unit": facts.unit,
                "light": light_name(facts.light),
                "size": page.size_texels,
                "texelsPerMetre": facts.density,
                "embedded": facts.embedded,
                "generator": facts.generator,
            });
            if let Some(intensity) = intensity(facts.store) {
                entry["intensity"] = json!(intensity);
            }
            entry
        })
        .collect();
    edit.merge_extras("scenes", scene, &format!("scene {scene}"), "lightmaps", entries);
}
