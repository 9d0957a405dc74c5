//! What nodes, materials, scene and EXR headers say about the light: whether it is all there and agrees.

use super::{Kind, Problem};
use crate::baked::{Baked, Page, Stated, store_named, store_of_intensity};
use crate::export::file_of_uri;
use crate::options::Store;
use serde_json::Value;
use std::path::Path;

/// Everything that is missing or contradicts something else.
pub(super) fn problems(baked: &Baked) -> Vec<Problem> {
    let mut found = Vec::new();
    for page in &baked.pages {
        if let Err(what) = &page.image {
            found.push(Problem::grave(Kind::Missing, &page.file, what.clone()));
        }
    }
    for (index, stated) in baked.stated.iter().enumerate() {
        let surface = &baked.scene.surfaces[index];
        let name = &surface.origin.name;
        for (kind, what) in of_surface(baked, index, stated) {
            found.push(Problem::grave(kind, name, what));
        }
        if let (Some(entry), None) = (&stated.entry, &stated.material) {
            let page = baked.lightmaps[index].map(|lightmap| &baked.pages[lightmap.page]);
            if page.is_some_and(|page| page.store != Store::Radiosity) && entry.file.is_some() {
                let what = "its material has no MOZ_lightmap: only programs that read extras show its light";
                found.push(Problem::mild(Kind::Links, name, what));
            }
        }
    }
    for name in ["MOZ_lightmap", "EXT_texture_exr"] {
        let required = baked.document.json.get("extensionsRequired").and_then(Value::as_array);
        if required.is_some_and(|list| list.iter().any(|entry| entry == name)) {
            let what =
                format!("{name} is a required extension: programs that do not know it refuse the file");
            found.push(Problem::grave(Kind::Links, "the file", what));
        }
    }
    found.extend(of_scene(baked));
    found
}

/// What is wrong with the light of one surface.
fn of_surface(baked: &Baked, index: usize, stated: &Stated) -> Vec<(Kind, String)> {
    let mut found = Vec::new();
    let Some(lightmap) = baked.lightmaps[index] else {
        if stated.entry.is_some() || stated.material.is_some() {
            found.push((Kind::Links, "it names a lightmap without file or texture coordinates".to_owned()));
        }
        return found;
    };
    let page = &baked.pages[lightmap.page];
    let scene = &baked.scene;
    if scene.geometry(&scene.surfaces[index]).texcoords.len() <= lightmap.texcoord {
        let set = lightmap.texcoord;
        found.push((Kind::Range, format!("it has no TEXCOORD_{set}, which its lightmap is read with")));
    }
    if let Some(link) = &stated.material {
        if link.texcoord != lightmap.texcoord {
            let (node, own) = (lightmap.texcoord, link.texcoord);
            found.push((Kind::Links, format!("its node names TEXCOORD_{node}, its material TEXCOORD_{own}")));
        }
        match &link.uri {
            Some(uri) if file_of_uri(uri) != Path::new(&page.file) => {
                found.push((Kind::Links, format!("its node names {}, its material {uri}", page.file)));
            }
            None if !link.embedded => {
                found.push((Kind::Links, "its material leads to no EXR".to_owned()));
            }
            _ => {}
        }
        if !link.fallback {
            let what =
                "its lightmap texture has no fallback image, without which Bevy refuses the whole file";
            found.push((Kind::Links, what.to_owned()));
        }
        if let Some(what) = intensity_problem(page, link.intensity) {
            found.push((Kind::Unit, what));
        }
    }
    let said = stated.entry.as_ref().and_then(|entry| entry.store.as_deref());
    if let Some(said) = said.filter(|said| store_named(said) != Some(page.store)) {
        let header = name_of(page.store);
        found.push((Kind::Unit, format!("its node says the page holds {said}, the page is {header}")));
    }
    found
}

fn intensity_problem(page: &Page, intensity: Option<f64>) -> Option<String> {
    let Some(intensity) = intensity else {
        return Some("its lightmap has no intensity, without which Hubs' importer fails".to_owned());
    };
    if store_of_intensity(intensity) == Some(page.store) {
        return None;
    }
    let holds = name_of(page.store);
    Some(format!("its lightmap's intensity is {intensity}, which is not right for a page of {holds}"))
}

fn of_scene(baked: &Baked) -> Vec<Problem> {
    let listed = baked
        .scene
        .index
        .and_then(|scene| {
            baked.document.json.get("scenes")?.get(scene)?.get("extras")?.get("lightmaps")?.as_array()
        })
        .map(Vec::as_slice)
        .unwrap_or_default();
    let mut found = Vec::new();
    for entry in listed {
        let text = |key: &str| entry.get(key).and_then(Value::as_str).unwrap_or_default();
        let file = text("file");
        let Some(page) = baked.pages.iter().find(|page| page.file == file) else {
            found.push(Problem::mild(Kind::Links, file, "the scene lists this page, but no object uses it"));
            continue;
        };
        if store_named(text("store")).is_some_and(|store| store != page.store) {
            let what =
                format!("the scene says it holds {}, the page is {}", text("store"), name_of(page.store));
            found.push(Problem::grave(Kind::Unit, file, what));
        }
        let size = entry.get("size").and_then(Value::as_u64);
        if let (Some(size), Ok(image)) = (size, &page.image)
            && image.size.iter().any(|&side| side as u64 != size)
        {
            let [w, h] = image.size;
            let what = format!("the scene says it is {size} texels wide and high, but it has {w} × {h}");
            found.push(Problem::grave(Kind::Links, file, what));
        }
    }
    found
}

/// As the command line spells it.
pub(super) fn name_of(store: Store) -> String {
    serde_json::to_value(store).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}
