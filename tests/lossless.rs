//! Nothing of a file is lost: for every fixture, and every scene of the collection beside the project where that is
//! present, what the export added is taken away again, and what remains must be the input, text of numbers included.

#![allow(clippy::print_stderr)] // It says how much it saw.

#[path = "export/kit.rs"]
mod kit;
#[path = "lossless/undo.rs"]
mod undo;

use kit::{Baked, CUTS, Cut};
use lightkiln::import::{self, Container, Document, RawAccessor, RawPrimitive};
use lightkiln::options::{ExportOptions, ImportOptions};
use lightkiln::scene::{Scene, Surface};
use rayon::prelude::*;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// What can be told apart after a bake.
#[derive(Default)]
struct Tally {
    files: usize,
    refused: usize,
    triangles: usize,
    surfaces: usize,
}

#[test]
fn fixtures_lose_nothing() {
    let fixtures = scenes_below(Path::new("fixtures"));
    assert!(fixtures.len() >= 7, "{} fixtures", fixtures.len());
    let tally = check_all(&fixtures, true);
    assert_eq!(tally.refused, 0);
}

#[test]
fn the_collection_loses_nothing() {
    let Some(root) = ["../shared/scenes", "../../shared/scenes"].iter().map(Path::new).find(|p| p.is_dir())
    else {
        eprintln!("skipped: no collection of scenes beside the project");
        return;
    };
    let files = scenes_below(root);
    let tally = check_all(&files, false);
    eprintln!(
        "{} files, {} refused by the import, {} surfaces, {} triangles",
        tally.files, tally.refused, tally.surfaces, tally.triangles
    );
    assert!(tally.files - tally.refused > files.len() / 3, "hardly any file could be read");
}

fn scenes_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Every file is cut into single triangles, and in one more way in turn; `all_cuts` takes all ways.
fn check_all(files: &[PathBuf], all_cuts: bool) -> Tally {
    let outcomes: Vec<(Tally, Vec<String>)> = files
        .par_iter()
        .enumerate()
        .map(|(number, file)| {
            let other = [Cut::Thirds, Cut::Nowhere, Cut::Reversed][number % 3];
            let cuts = if all_cuts { &CUTS[..] } else { &[Cut::Triangles, other] };
            check_file(file, cuts)
        })
        .collect();
    let failures: Vec<&String> = outcomes.iter().flat_map(|(_, failures)| failures).collect();
    assert!(failures.is_empty(), "{} failures:\n{failures:#?}", failures.len());
    outcomes.iter().fold(Tally::default(), |sum, (tally, _)| Tally {
        files: sum.files + 1,
        refused: sum.refused + tally.refused,
        surfaces: sum.surfaces + tally.surfaces,
        triangles: sum.triangles + tally.triangles,
    })
}

fn check_file(file: &Path, cuts: &[Cut]) -> (Tally, Vec<String>) {
    let (mut tally, mut failures) = (Tally::default(), Vec::new());
    for &cut in cuts {
        match check(file, cut) {
            Ok(Some(baked)) => {
                let placed = || baked.atlas.fronts.iter().flatten();
                tally.surfaces = placed().count();
                tally.triangles = placed().map(|front| front.unwrap.triangles.len()).sum();
            }
            Ok(None) => return (Tally { refused: 1, ..tally }, failures),
            Err(why) => failures.push(format!("{} cut {cut:?}: {why}", file.display())),
        }
    }
    (tally, failures)
}

/// Bakes a file with made-up pages and compares; `None` when the import refuses the file.
fn check(file: &Path, cut: Cut) -> Result<Option<Baked>, String> {
    let end = if file.extension().is_some_and(|e| e == "glb") { "glb" } else { "gltf" };
    let options = ExportOptions { output: Some(format!("out.{end}").into()), ..ExportOptions::default() };
    let page_of = |node: usize| (node % 2) as u32;
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let loaded = match import::load(file, &ImportOptions { allow_outside: true, ..ImportOptions::default() })
    {
        Ok(loaded) => loaded,
        // Which files that should be is a matter of the import's tests.
        Err(_) => return Ok(None),
    };
    let baked = Baked::of_scene(folder, loaded, cut, page_of, options).map_err(|e| e.to_string())?;

    undo::compare(&baked.before, &baked.after)?;
    compare_bytes(&baked.before, &baked.after)?;
    compare_worlds(&baked)?;
    compare_corners(&baked)?;
    compare_readers(file, &baked)?;
    Ok(Some(baked))
}

/// Old bytes stand where they stood.
fn compare_bytes(before: &Document, after: &Document) -> Result<(), String> {
    for (index, (old, new)) in before.buffers.iter().zip(&after.buffers).enumerate() {
        if !new.bytes.starts_with(&old.bytes) {
            return Err(format!("buffer {index} does not begin with its old bytes"));
        }
        if index > 0 && old.bytes != new.bytes {
            return Err(format!("buffer {index} grew"));
        }
    }
    let (
        Container::Binary { bin: old, other_chunks: old_chunks },
        Container::Binary { bin: new, other_chunks },
    ) = (&before.container, &after.container)
    else {
        return Ok(());
    };
    let (old, new) = (old.as_deref().unwrap_or_default(), new.as_deref().unwrap_or_default());
    if !new.starts_with(old) {
        return Err("the BIN chunk does not begin with the old one".to_owned());
    }
    if old_chunks != other_chunks {
        return Err("unknown chunks changed".to_owned());
    }
    Ok(())
}

/// The output's surface for each of the input's.
fn matched(baked: &Baked) -> Result<Vec<(&Surface, &Surface)>, String> {
    let node_after = |surface: &Surface| match surface.origin.instance {
        Some(instance) => {
            let children = |doc: &Document| doc.json["nodes"][surface.origin.node]["children"].clone();
            let added =
                baked.before.json["nodes"][surface.origin.node]["children"].as_array().map_or(0, Vec::len);
            let expanded = baked.after.json["nodes"].as_array().map_or(0, Vec::len)
                > baked.before.json["nodes"].as_array().map_or(0, Vec::len);
            let child = children(&baked.after)[added + instance].as_u64();
            if expanded { child.map_or(usize::MAX, |child| child as usize) } else { surface.origin.node }
        }
        None => surface.origin.node,
    };
    let mut pairs = Vec::new();
    for surface in &baked.scene.surfaces {
        let node = node_after(surface);
        let twin = baked.scene_after.surfaces.iter().find(|other| {
            other.origin.node == node
                && other.origin.primitive == surface.origin.primitive
                && (node != surface.origin.node || other.origin.instance == surface.origin.instance)
        });
        pairs.push((surface, twin.ok_or_else(|| format!("{:?} is gone", surface.origin))?));
    }
    if baked.scene.surfaces.len() != baked.scene_after.surfaces.len() {
        return Err("there are other surfaces now".to_owned());
    }
    Ok(pairs)
}

/// Every triangle is where it was in the world, corner by corner.
fn compare_worlds(baked: &Baked) -> Result<(), String> {
    let (a, b): (&Scene, &Scene) = (&baked.scene, &baked.scene_after);
    for (old, new) in matched(baked)? {
        let count = a.geometry(old).triangles.len();
        if count != b.geometry(new).triangles.len() {
            return Err(format!("{}: another number of triangles", old.origin.name));
        }
        let shift = (b.origin_world - a.origin_world).as_vec3();
        // Instances' rotations are rounded once more, and the world's origin may move with a rounded bound.
        let slack = if old.origin.instance.is_some() || shift != glam::Vec3::ZERO { 1e-5 } else { 0.0 };
        for triangle in 0..count as u32 {
            for (p, q) in a.corners_world(old, triangle).iter().zip(&b.corners_world(new, triangle)) {
                let off = (*p - (*q + shift)).abs().max_element();
                if off > slack * (1.0 + p.abs().max_element()) {
                    return Err(format!("{}: triangle {triangle} moved by {off}", old.origin.name));
                }
            }
        }
        if slack == 0.0 && old.world_from_local != new.world_from_local {
            return Err(format!("{}: it stands elsewhere", old.origin.name));
        }
    }
    Ok(())
}

/// Every attribute of every corner is the same bytes; what is new are texture coordinates, those of the lightmap at
/// the place the atlas gave them.
fn compare_corners(baked: &Baked) -> Result<(), String> {
    for ((old, new), front) in matched(baked)?.into_iter().zip(&baked.atlas.fronts) {
        let raw = |document: &Document, surface: &Surface| -> Result<RawPrimitive, String> {
            let origin = &surface.origin;
            document.raw_primitive(origin.mesh, origin.primitive).map_err(|e| e.to_string())
        };
        let (before, after) = (raw(&baked.before, old)?, raw(&baked.after, new)?);
        let at = |what: &str| format!("{} primitive {}: {what}", old.origin.name, old.origin.primitive);
        if before.triangles.len() != after.triangles.len() || before.targets.len() != after.targets.len() {
            return Err(at("another number of triangles or morph targets"));
        }
        let corners = || {
            before
                .triangles
                .as_flattened()
                .iter()
                .copied()
                .zip(after.triangles.as_flattened().iter().copied())
        };
        let same =
            |(name, a): &(String, RawAccessor), list: &[(String, RawAccessor)]| -> Result<(), String> {
                let Some((_, b)) = list.iter().find(|(other, _)| other == name) else {
                    return Err(at(&format!("{name} is gone")));
                };
                if (a.component_type, &a.kind, a.normalized) != (b.component_type, &b.kind, b.normalized) {
                    return Err(at(&format!("{name} has another type")));
                }
                let element = |raw: &RawAccessor, i: u32| -> Vec<u8> {
                    raw.bytes[i as usize * raw.element_bytes..][..raw.element_bytes].to_vec()
                };
                match corners().position(|(i, j)| element(a, i) != element(b, j)) {
                    Some(corner) => Err(at(&format!("{name} differs at corner {corner}"))),
                    None => Ok(()),
                }
            };
        for attribute in &before.attributes {
            let replaced = attribute.0.starts_with("TEXCOORD_") && was_lightmap(baked, old, &attribute.0);
            if !replaced {
                same(attribute, &after.attributes)?;
            }
        }
        for (a, b) in before.targets.iter().zip(&after.targets) {
            a.iter().try_for_each(|attribute| same(attribute, b))?;
        }
        let added =
            after.attributes.iter().filter(|(name, _)| !before.attributes.iter().any(|(old, _)| old == name));
        for (name, _) in added {
            if front.is_none() || !name.starts_with("TEXCOORD_") {
                return Err(at(&format!("{name} is new")));
            }
        }
        let Some(front) = front else { continue };
        let entry = &baked.after.json["nodes"][new.origin.node]["extras"]["lightmap"];
        let extras_take_it =
            baked.before.json["nodes"][old.origin.node].get("extras").is_none_or(Value::is_object);
        let Some(set) = entry["texCoord"].as_u64() else {
            if extras_take_it || old.origin.instance.is_some() {
                return Err(at("its extras do not name the lightmap"));
            }
            continue;
        };
        let name = format!("TEXCOORD_{set}");
        let (_, uv) =
            after.attributes.iter().find(|(other, _)| *other == name).ok_or_else(|| at("no coordinates"))?;
        let uv = uv.to_floats();
        for (cut, corner) in front.unwrap.triangles.as_flattened().iter().zip(after.triangles.as_flattened())
        {
            let wanted = front.uv_texels[*cut as usize] / 64.0;
            let found = &uv[2 * *corner as usize..][..2];
            if found != wanted.to_array() {
                return Err(at(&format!("lightmap coordinates {found:?} instead of {wanted}")));
            }
        }
    }
    Ok(())
}

fn was_lightmap(baked: &Baked, surface: &Surface, name: &str) -> bool {
    let json = &baked.before.json;
    let primitive = &json["meshes"][surface.origin.mesh]["primitives"][surface.origin.primitive];
    let Some(material) = primitive["material"].as_u64() else { return false };
    let set = &json["materials"][material as usize]["extensions"]["MOZ_lightmap"]["texCoord"];
    set.as_u64().is_some_and(|set| name == format!("TEXCOORD_{set}"))
}

/// The reader that Bevy uses takes the output where it took the input.
fn compare_readers(file: &Path, baked: &Baked) -> Result<(), String> {
    let reads = |path: &Path| gltf::Gltf::from_slice(&fs::read(path).unwrap()).map_err(|e| e.to_string());
    if reads(file).is_err() {
        return Ok(());
    }
    let output = baked.written.files.last().unwrap();
    reads(output).map(drop).map_err(|why| format!("the gltf crate refuses the output: {why}"))
}
