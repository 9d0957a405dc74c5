//! What becomes of lamps whose light is in the lightmap: KHR_lights_punctual has no word for it.

use super::append::{Edit, extension, index_at, items, remove_extension};
use crate::options::{ExportOptions, LampsOut, LightPart};
use crate::scene::Scene;
use serde_json::{Value, json};
use std::collections::BTreeSet;

const LAMPS: &str = "KHR_lights_punctual";

/// Keeps, tags or removes the lamps of a scene, and says what viewers will make of it.
pub(in super::super) fn settle(edit: &mut Edit, scene: Option<usize>, options: &ExportOptions) {
    let lit: Vec<(usize, usize)> = nodes_of(&edit.json, scene)
        .into_iter()
        .filter_map(|node| {
            let lamp = extension(edit.json["nodes"].get(node)?, LAMPS)?;
            Some((node, index_at(lamp, "light")?))
        })
        .collect();
    if lit.is_empty() {
        return;
    }
    let count = lit.len();
    let at = edit.document.path.display().to_string();
    match options.lamps {
        LampsOut::Keep if options.light != LightPart::Indirect => edit.warn(
            at,
            format!(
                "{count} lamps stay in the file and their light is in the lightmap too: a viewer that shows both \
                 lights twice; --lamps remove takes the lamps away, --lamps tag marks them"
            ),
        ),
        LampsOut::Keep => {}
        LampsOut::Tag => tag(edit, &lit),
        LampsOut::Remove => {
            for (node, _) in lit {
                remove_extension(&mut edit.json["nodes"][node], LAMPS);
            }
            if options.light == LightPart::Indirect {
                edit.warn(
                    at,
                    format!(
                        "{count} lamps were removed, but the lightmap holds indirect light only: nothing gives the \
                         direct light any more; bake with --light full, or keep the lamps"
                    ),
                );
            }
        }
    }
}

fn tag(edit: &mut Edit, lit: &[(usize, usize)]) {
    for &(node, _) in lit {
        edit.merge_extras("nodes", node, &format!("node {node}"), "baked", json!(true));
    }
    let lamps: BTreeSet<usize> = lit.iter().map(|&(_, lamp)| lamp).collect();
    let mut refused = Vec::new();
    let list = edit.json.get_mut("extensions").and_then(|all| all.get_mut(LAMPS)?.get_mut("lights"));
    if let Some(list) = list.and_then(Value::as_array_mut) {
        for lamp in lamps {
            let tagged =
                list.get_mut(lamp).is_some_and(|l| super::append::merge_extras(l, "baked", json!(true)));
            if !tagged {
                refused.push(lamp);
            }
        }
    }
    for lamp in refused {
        edit.warn(format!("lamp {lamp}"), "its extras are not an object, so \"baked\" was not added to them");
    }
}

/// The glTF scene that a baked scene came from: the first that holds its objects, the default one before others.
pub(in super::super) fn scene_of(json: &Value, baked: &Scene) -> Option<usize> {
    let count = items(json, "scenes").len();
    let default = index_at(json, "scene").unwrap_or(0);
    let Some(surface) = baked.surfaces.first() else { return (default < count).then_some(default) };
    let mut scenes = std::iter::once(default).filter(|&scene| scene < count).chain(0..count);
    scenes.find(|&scene| nodes_of(json, Some(scene)).contains(&surface.origin.node))
}

/// The nodes of a scene, in order; all nodes where the file has no scene.
fn nodes_of(json: &Value, scene: Option<usize>) -> BTreeSet<usize> {
    let nodes = items(json, "nodes");
    let roots = scene.and_then(|scene| items(json, "scenes").get(scene)).map(|scene| scene.get("nodes"));
    let mut stack: Vec<usize> = match roots {
        None => (0..nodes.len()).collect(),
        Some(list) => indices(list),
    };
    let mut found = BTreeSet::new();
    while let Some(node) = stack.pop() {
        if node < nodes.len() && found.insert(node) {
            stack.extend(indices(nodes[node].get("children")));
        }
    }
    found
}

fn indices(list: Option<&Value>) -> Vec<usize> {
    list.and_then(Value::as_array).into_iter().flatten().filter_map(super::append::index).collect()
}
