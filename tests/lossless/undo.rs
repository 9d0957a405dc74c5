//! Takes away from an output what the export declares to add, and compares the rest with the input as text.

use lightkiln::import::Document;
use serde_json::{Map, Value};

/// Arrays of the root that only grow.
const LISTS: [&str; 10] = [
    "accessors",
    "bufferViews",
    "buffers",
    "extensionsUsed",
    "images",
    "materials",
    "meshes",
    "nodes",
    "samplers",
    "textures",
];
const INSTANCING: &str = "EXT_mesh_gpu_instancing";
const DRACO: &str = "KHR_draco_mesh_compression";

/// `Err` says what is left that is neither the input's nor declared.
pub fn compare(before: &Document, after: &Document) -> Result<(), String> {
    let (old, mut json) = (&before.json, after.json.clone());
    let grown = json.clone();
    let root = json.as_object_mut().ok_or("the root is not an object")?;
    for list in LISTS {
        let Some(items) = root.get_mut(list).and_then(Value::as_array_mut) else { continue };
        match old.get(list).and_then(Value::as_array) {
            Some(known) if list == "extensionsUsed" => {
                // Only what nothing uses any more may go.
                let gone: Vec<&Value> = known.iter().filter(|name| !items.contains(name)).collect();
                if gone.iter().any(|name| *name != INSTANCING && *name != DRACO) {
                    return Err(format!("{gone:?} went from extensionsUsed"));
                }
                *items = known.clone();
            }
            Some(known) if items.len() < known.len() => return Err(format!("{list} lost entries")),
            Some(known) => items.truncate(known.len()),
            None => drop(root.shift_remove(list)),
        }
    }
    retired(root, old, "extensionsUsed")?;
    retired(root, old, "extensionsRequired")?;
    undo_buffers(root, old);
    undo_nodes(root, old, &grown)?;
    undo_scenes(root, old);
    undo_materials(root, old);
    undo_meshes(root, old, &grown)?;

    let (old, new) = (old.to_string(), json.to_string());
    if old == new {
        return Ok(());
    }
    let first = old.bytes().zip(new.bytes()).take_while(|(a, b)| a == b).count();
    let around = |text: &str| {
        let bytes = &text.as_bytes()[first.saturating_sub(60)..text.len().min(first + 60)];
        String::from_utf8_lossy(bytes).into_owned()
    };
    Err(format!("the JSON differs:\n  was …{}…\n  is  …{}…", around(&old), around(&new)))
}

/// An extension that became unused may leave the lists.
fn retired(root: &mut Map<String, Value>, old: &Value, list: &str) -> Result<(), String> {
    let Some(known) = old.get(list).and_then(Value::as_array) else { return Ok(()) };
    let now = root.get(list).and_then(Value::as_array).cloned().unwrap_or_default();
    let gone: Vec<&Value> = known.iter().filter(|name| !now.contains(name)).collect();
    if gone.iter().any(|name| *name != INSTANCING && *name != DRACO) {
        return Err(format!("{gone:?} went from {list}"));
    }
    if !gone.is_empty() {
        // Back to the place it had.
        let order: Vec<String> = old.as_object().map(|o| o.keys().cloned().collect()).unwrap_or_default();
        root.insert(list.to_owned(), known.clone().into());
        let mut sorted = Map::new();
        for key in order.iter().chain(root.keys()) {
            if let Some(value) = root.get(key) {
                sorted.entry(key.clone()).or_insert_with(|| value.clone());
            }
        }
        *root = sorted;
    }
    Ok(())
}

/// The first buffer's length grows when its bytes do.
fn undo_buffers(root: &mut Map<String, Value>, old: &Value) {
    let first = |json: &Value| json["buffers"][0]["byteLength"].clone();
    let length = first(old);
    if let Some(new) = root.get_mut("buffers").and_then(|list| list.get_mut(0))
        && new["byteLength"].as_u64() > length.as_u64()
    {
        new["byteLength"] = length;
    }
}

/// Takes an entry out of an object's extras, and the extras when they were new.
fn undo_extras(object: &mut Value, old: &Value, key: &str) {
    let Some(object) = object.as_object_mut() else { return };
    let Some(extras) = object.get_mut("extras").and_then(Value::as_object_mut) else { return };
    match old.get("extras").and_then(|extras| extras.get(key)) {
        Some(earlier) => drop(extras.insert(key.to_owned(), earlier.clone())),
        None => drop(extras.shift_remove(key)),
    }
    if old.get("extras").is_none() && extras.is_empty() {
        object.shift_remove("extras");
    }
}

fn undo_nodes(root: &mut Map<String, Value>, old: &Value, grown: &Value) -> Result<(), String> {
    let Some(nodes) = root.get_mut("nodes").and_then(Value::as_array_mut) else { return Ok(()) };
    for (index, node) in nodes.iter_mut().enumerate() {
        let before = &old["nodes"][index];
        undo_extras(node, before, "lightmap");
        if before["extensions"].get(INSTANCING).is_some() && node["extensions"].get(INSTANCING).is_none() {
            undo_instances(node, before, old, grown)?;
        }
        if node.get("mesh") != before.get("mesh") {
            let known = old["meshes"].as_array().map_or(0, Vec::len) as u64;
            let (was, is) = (before["mesh"].as_u64(), node["mesh"].as_u64());
            let (Some(was), Some(is)) = (was, is) else { return Err(format!("node {index} lost its mesh")) };
            if is < known {
                return Err(format!("node {index} wears another mesh of the file"));
            }
            same_but_primitives(&old["meshes"][was as usize], &grown["meshes"][is as usize])?;
            node["mesh"] = before["mesh"].clone();
        }
    }
    Ok(())
}

/// Instances became children, which must come last; the rest of the node stays.
fn undo_instances(node: &mut Value, before: &Value, old: &Value, grown: &Value) -> Result<(), String> {
    let known = before["children"].as_array().cloned().unwrap_or_default();
    let now = node["children"].as_array().cloned().unwrap_or_default();
    let first_new = old["nodes"].as_array().map_or(0, Vec::len) as u64;
    let added = &now[known.len().min(now.len())..];
    if !now.starts_with(&known) || added.iter().any(|child| child.as_u64() < Some(first_new)) {
        return Err("instances did not become new children behind the old ones".to_owned());
    }
    for child in added {
        let mesh = grown["nodes"][child.as_u64().unwrap_or(0) as usize]["mesh"].as_u64();
        let mesh = mesh.ok_or("an instance has no mesh")? as usize;
        let source = before["mesh"].as_u64().ok_or("instances of no mesh")? as usize;
        same_but_primitives(&old["meshes"][source], &grown["meshes"][mesh])?;
    }
    let left: Vec<(&String, &Value)> = node
        .as_object()
        .ok_or("a node is no object")?
        .iter()
        .filter(|(key, _)| !["children", "extensions"].contains(&key.as_str()))
        .collect();
    let kept: Vec<(&String, &Value)> = before
        .as_object()
        .ok_or("a node is no object")?
        .iter()
        .filter(|(key, _)| !["children", "extensions", "mesh", "weights"].contains(&key.as_str()))
        .collect();
    if left != kept {
        return Err(format!("an instanced node changed: {left:?}, was {kept:?}"));
    }
    *node = before.clone();
    Ok(())
}

fn same_but_primitives(old: &Value, new: &Value) -> Result<(), String> {
    let rest = |mesh: &Value| {
        let mut mesh = mesh.clone();
        mesh["primitives"] = Value::Null;
        mesh.to_string()
    };
    if rest(old) != rest(new) {
        return Err(format!("a mesh's copy differs: {} was {}", rest(new), rest(old)));
    }
    let count = |mesh: &Value| mesh["primitives"].as_array().map_or(0, Vec::len);
    if count(old) != count(new) {
        return Err("a mesh's copy has other primitives".to_owned());
    }
    Ok(())
}

fn undo_scenes(root: &mut Map<String, Value>, old: &Value) {
    for (index, scene) in
        root.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten().enumerate()
    {
        undo_extras(scene, &old["scenes"][index], "lightmaps");
    }
}

fn undo_materials(root: &mut Map<String, Value>, old: &Value) {
    let materials = root.get_mut("materials").and_then(Value::as_array_mut);
    for (index, material) in materials.into_iter().flatten().enumerate() {
        let before = &old["materials"][index];
        let known = before.get("extensions");
        if known.and_then(|all| all.get("MOZ_lightmap")).is_some() {
            continue;
        }
        let Some(object) = material.as_object_mut() else { continue };
        if let Some(all) = object.get_mut("extensions").and_then(Value::as_object_mut) {
            all.shift_remove("MOZ_lightmap");
            if all.is_empty() && known.is_none() {
                object.shift_remove("extensions");
            }
        }
    }
}

/// A primitive of an edited mesh: what changed must lead to new entries, and nothing may be gone.
fn undo_meshes(root: &mut Map<String, Value>, old: &Value, grown: &Value) -> Result<(), String> {
    let meshes = root.get_mut("meshes").and_then(Value::as_array_mut);
    for (index, mesh) in meshes.into_iter().flatten().enumerate() {
        let before = &old["meshes"][index];
        same_but_primitives(before, mesh)?;
        for (number, primitive) in mesh["primitives"].as_array_mut().into_iter().flatten().enumerate() {
            let was = &before["primitives"][number];
            if primitive != was {
                allowed(was, primitive, old, grown)
                    .map_err(|why| format!("mesh {index} primitive {number}: {why}"))?;
                *primitive = was.clone();
            }
        }
    }
    Ok(())
}

fn allowed(was: &Value, is: &Value, old: &Value, grown: &Value) -> Result<(), String> {
    let count = |json: &Value, list: &str| json[list].as_array().map_or(0, Vec::len) as u64;
    let new_entry = |list: &str, value: &Value| {
        value.as_u64().is_some_and(|i| (count(old, list)..count(grown, list)).contains(&i))
    };
    let attributes = |set: &Value, other: &Value| -> Result<(), String> {
        for (name, value) in set.as_object().ok_or("no attributes")? {
            let now = other.get(name).ok_or_else(|| format!("{name} is gone"))?;
            if now != value && !new_entry("accessors", now) {
                return Err(format!("{name} leads to another accessor of the file"));
            }
        }
        for name in other.as_object().ok_or("no attributes")?.keys() {
            if set.get(name).is_none() && !name.starts_with("TEXCOORD_") {
                return Err(format!("{name} is new"));
            }
        }
        Ok(())
    };
    attributes(&was["attributes"], &is["attributes"])?;
    let targets = |p: &Value| p["targets"].as_array().cloned().unwrap_or_default();
    let (before, after) = (targets(was), targets(is));
    if before.len() != after.len() {
        return Err("another number of morph targets".to_owned());
    }
    before.iter().zip(&after).try_for_each(|(a, b)| attributes(a, b))?;
    if is.get("indices") != was.get("indices") && !new_entry("accessors", &is["indices"]) {
        return Err("indices lead to another accessor of the file".to_owned());
    }
    if is.get("mode") != was.get("mode") && is["mode"] != 4 {
        return Err("it is not a list of triangles".to_owned());
    }
    let lit = is["material"]
        .as_u64()
        .is_some_and(|m| grown["materials"][m as usize]["extensions"].get("MOZ_lightmap").is_some());
    if is.get("material") != was.get("material") && !lit {
        return Err("another material without a lightmap".to_owned());
    }
    let rest = |primitive: &Value| {
        let mut object = primitive.as_object().cloned().unwrap_or_default();
        for key in ["attributes", "targets", "indices", "mode", "material"] {
            object.shift_remove(key);
        }
        let extensions = object.get_mut("extensions").and_then(Value::as_object_mut);
        if let Some(extensions) = extensions {
            extensions.shift_remove(DRACO);
            // Variants lead to lit copies of their materials.
            extensions.shift_remove("KHR_materials_variants");
            if extensions.is_empty() {
                object.shift_remove("extensions");
            }
        }
        Value::from(object).to_string()
    };
    if rest(was) != rest(is) {
        return Err(format!("something else changed: {} was {}", rest(is), rest(was)));
    }
    Ok(())
}
