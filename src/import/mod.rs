//! glTF file -> (Document, Scene): the file as it is, and the world it describes.
//!
//! Whatever the bytes are, the answer is a scene or an [`Error`]: nothing is read or reserved before it is known to be
//! there, and foreign decoders are fenced in.

mod accessor;
mod area_lamps;
mod buffers;
mod cameras;
mod claims;
mod compression;
mod container;
mod document;
mod exponents;
mod extensions;
mod extras;
mod geometry;
mod images;
mod instances;
mod json;
mod lights;
mod materials;
mod nodes;
mod pose;
mod primitive;
mod sky;
mod sky_image;
mod surfaces;
mod uri;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use document::{Buffer, Container, Document, RawAccessor, RawPrimitive};
pub use exponents::Exponents;

use crate::error::{Error, Result, Warning};
use crate::options::ImportOptions;
use crate::scene::{Role, Scene};
use std::path::Path;

/// The most vertices, and the most triangles, a scene may place in the world: about 5 GB of positions and normals.
pub const MAX_VERTICES: usize = 100_000_000;

/// Reads a `.gltf` or `.glb` and everything it names.
pub fn load(path: &Path, options: &ImportOptions) -> Result<(Document, Scene)> {
    let bytes = std::fs::read(path).map_err(|source| Error::io(path, source))?;
    load_bytes(path, &bytes, options)
}

/// Reads a `.gltf` or `.glb` from memory. `path` names it in messages, and relative uris start in its folder.
pub fn load_bytes(path: &Path, bytes: &[u8], options: &ImportOptions) -> Result<(Document, Scene)> {
    read(path, bytes, options).map_err(|error| error.in_file(path))
}

fn read(path: &Path, bytes: &[u8], options: &ImportOptions) -> Result<(Document, Scene)> {
    let mut warnings = Vec::new();
    let document = Document::open(path, bytes, options, &mut warnings)?;
    let hierarchy = nodes::place(&document.json, options.scene.as_deref(), &mut warnings)?;
    let placed = surfaces::place(&document, &hierarchy, &mut warnings)?;

    let material_count = json::items(&document.json, json::MATERIALS)?.len() + 1;
    let mut used = vec![false; material_count];
    for surface in &placed.surfaces {
        used[surface.material.0 as usize] = true;
    }
    let (materials, textures) = materials::read(&document, &used, options, &mut warnings)?;
    let (lamps, lamp_units) =
        lights::read(&document, &hierarchy, placed.origin_world, options, &mut warnings)?;
    let sky = sky::read(&document, hierarchy.scene, options, &mut warnings)?;

    let cameras = cameras::read(&document, &hierarchy, &mut warnings);

    let mut scene = Scene {
        geometries: placed.geometries,
        surfaces: placed.surfaces,
        materials,
        textures,
        lamps,
        sky,
        cameras,
        origin_world: placed.origin_world,
        lamp_units,
        index: hierarchy.scene,
        warnings,
    };
    refuse_nothing(&scene, path)?;
    area_lamps::add(&document, &hierarchy, &mut scene)?;
    finish(&mut scene, path);
    Ok((document, scene))
}

/// A scene without a single triangle is a mistake.
fn refuse_nothing(scene: &Scene, path: &Path) -> Result<()> {
    if scene.surfaces.iter().any(|surface| !scene.geometry(surface).triangles.is_empty()) {
        return Ok(());
    }
    let what = "the scene holds no triangles to bake: check that the objects are exported (Blender: Include > Selected \
                Objects is off), or choose another scene with --scene";
    Err(Error::invalid(path.display().to_string(), what))
}

/// What can only be said when everything is there.
fn finish(scene: &mut Scene, path: &Path) {
    let file = path.display().to_string();
    for surface in &mut scene.surfaces {
        if scene.materials[surface.material.0 as usize].unlit {
            surface.role = Role::Blocks;
        }
    }
    warn_of_missing_texcoords(scene);
    let lit = scene.lamps_shine()
        || scene.sky.is_lit()
        || scene.surfaces.iter().any(|surface| scene.material(surface).emits());
    if !lit {
        let what = "nothing in the scene gives light, so the lightmap will be black: in Blender's glTF exporter tick \
                    Include > Data > Punctual Lights (it is off by default), give a material emission, or pass --sky";
        scene.warnings.push(Warning::new(file.clone(), what));
    }
    if scene.surfaces.iter().all(|surface| surface.role != Role::Lightmapped) {
        let what = "nothing in the scene takes a lightmap: all of it is skinned, morphed, unlit, without area or \
                    excluded by lightkiln.bake";
        scene.warnings.push(Warning::new(file, what));
    }
}

/// A texture on a set that the mesh does not have is read at one point; once a material, that is worth a word.
fn warn_of_missing_texcoords(scene: &mut Scene) {
    let mut warned = vec![false; scene.materials.len()];
    let mut warnings = Vec::new();
    for surface in &scene.surfaces {
        let (material, geometry) = (scene.material(surface), scene.geometry(surface));
        let slots = [&material.base_color_texture, &material.metallic_texture, &material.emission_texture];
        let missing = slots.into_iter().flatten().find(|slot| slot.texcoord >= geometry.texcoords.len());
        let index = surface.material.0 as usize;
        if let (Some(slot), false) = (missing, warned[index]) {
            warned[index] = true;
            let what = format!(
                "it has a texture on TEXCOORD_{}, which mesh '{}' does not have: its first texel is used all over",
                slot.texcoord, geometry.name
            );
            warnings.push(Warning::new(material.name.clone(), what));
        }
    }
    scene.warnings.append(&mut warnings);
}
