//! EXT_mesh_gpu_instancing: instances of one node cannot wear different lightmaps, so they become its child nodes.
//!
//! This is the one place where an object of the input is rewritten: the node keeps its index, name, transform and
//! everything else, and hands its mesh to new children that stand where the instances stood.

use super::append::{Edit, extension, index_at, items, remove_extension};
use crate::error::{Error, Result};
use serde_json::{Value, json};
use std::collections::BTreeMap;

pub(super) const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// The new nodes of each expanded node, by instance.
pub(super) type Children = BTreeMap<usize, Vec<usize>>;

/// Replaces the instances of these nodes by child nodes.
pub(super) fn expand(edit: &mut Edit, nodes: impl IntoIterator<Item = usize>) -> Result<Children> {
    let mut children = Children::new();
    for node in nodes {
        let made = expand_node(edit, node)?;
        children.insert(node, made);
    }
    if !children.is_empty() {
        edit.retire_extension(INSTANCING);
    }
    Ok(children)
}

fn expand_node(edit: &mut Edit, node: usize) -> Result<Vec<usize>> {
    let old = &edit.document.json["nodes"][node];
    let name = old.get("name").and_then(Value::as_str).map_or_else(|| format!("node {node}"), str::to_owned);
    let attributes = extension(old, INSTANCING).and_then(|e| e.get("attributes")).and_then(Value::as_object);
    let Some(attributes) = attributes else {
        return Err(Error::invalid(name, format!("its {INSTANCING} has no attributes")));
    };
    let mut columns: Vec<(&str, usize, Vec<f32>)> = Vec::new();
    for semantic in attributes.keys() {
        let accessor = attributes.get(semantic).and_then(super::append::index);
        let Some(accessor) = accessor else { continue };
        let raw = edit.document.raw_accessor(accessor)?;
        // JSON has no infinities.
        let values = raw.to_floats().into_iter().map(|x| if x.is_finite() { x } else { 0.0 }).collect();
        columns.push((semantic, raw.components().max(1), values));
    }
    let count = columns.iter().map(|(_, width, values)| values.len() / width).min().unwrap_or(0);
    let given = items(&edit.document.json, "nodes").get(node);
    let mesh = given.and_then(|node| index_at(node, "mesh"));
    let weights = given.and_then(|node| node.get("weights")).cloned();
    let custom: Vec<&str> =
        columns.iter().map(|column| column.0).filter(|name| name.starts_with('_')).collect();
    if !custom.is_empty() {
        let what = format!(
            "its {count} instances became nodes; their attributes {} are in these nodes' extras now, as \"instance\"",
            custom.join(", ")
        );
        edit.warn(&name, what);
    }

    let mut made = Vec::with_capacity(count);
    for instance in 0..count {
        let mut child = json!({ "name": format!("{name}.{instance:03}") });
        let mut extras = json!({});
        for (semantic, width, values) in &columns {
            let value = &values[instance * width..][..*width];
            match *semantic {
                "TRANSLATION" => child["translation"] = json!(value),
                "ROTATION" => child["rotation"] = json!(unit(value)),
                "SCALE" => child["scale"] = json!(value),
                other => extras[other] = json!(value),
            }
        }
        if let Some(mesh) = mesh {
            child["mesh"] = json!(mesh);
        }
        if let Some(weights) = &weights {
            child["weights"] = weights.clone();
        }
        if extras.as_object().is_some_and(|extras| !extras.is_empty()) {
            child["extras"] = json!({ "instance": extras });
        }
        made.push(edit.push("nodes", child));
    }

    let node = &mut edit.json["nodes"][node];
    remove_extension(node, INSTANCING);
    if let Some(object) = node.as_object_mut() {
        object.shift_remove("mesh");
        object.shift_remove("weights");
        let list = object.entry("children").or_insert_with(|| json!([]));
        if let Some(list) = list.as_array_mut() {
            list.extend(made.iter().map(|&child| json!(child)));
        }
    }
    Ok(made)
}

/// A quaternion of length 1; rotations of 8 or 16 bit are not quite.
fn unit(value: &[f32]) -> Vec<f32> {
    let length = value.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() {
        value.iter().map(|&x| (f64::from(x) / length) as f32).collect()
    } else {
        vec![0.0, 0.0, 0.0, 1.0]
    }
}
