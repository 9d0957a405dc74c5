//! Vertices that a chart seam splits: every attribute is copied element by element, as the bytes it had.

use super::append::{ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, Edit, index_at, items};
use crate::atlas::{Placement, Unwrap};
use crate::error::{Error, Result};
use crate::import::RawAccessor;
use glam::Vec2;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::Arc;

pub(super) const DRACO: &str = "KHR_draco_mesh_compression";

/// How a primitive's vertices relate to the file's.
#[derive(Clone, Debug)]
pub(super) enum Wiring {
    /// No vertex is split: the file's accessors stay in use. For each vertex of the file, the unwrapped vertex that it
    /// became, if any triangle uses it.
    Kept { unwrapped: Vec<Option<u32>> },
    /// New accessors, in the order of the unwrapped vertices.
    Split { attributes: Vec<(String, usize)>, targets: Vec<Vec<(String, usize)>>, indices: usize },
}

/// Makes each split once, however many nodes share it.
#[derive(Default)]
pub(super) struct Splitter {
    /// By mesh, primitive and unwrap.
    wirings: HashMap<(usize, usize, usize), Arc<Wiring>>,
    /// Copies of accessors, by accessor, unwrap and whether it has bounds.
    copies: HashMap<(usize, usize, bool), usize>,
}

impl Splitter {
    /// The wiring of a primitive under an unwrap.
    pub fn wiring(
        &mut self,
        edit: &mut Edit,
        mesh: usize,
        primitive: usize,
        unwrap: &Arc<Unwrap>,
        at: &str,
    ) -> Result<Arc<Wiring>> {
        let unwrap_id = Arc::as_ptr(unwrap) as usize; // unique: the atlas keeps it alive
        let key = (mesh, primitive, unwrap_id);
        if let Some(known) = self.wirings.get(&key) {
            return Ok(known.clone());
        }
        let object = &edit.document.json["meshes"][mesh]["primitives"][primitive];
        let position = object.get("attributes").and_then(|all| index_at(all, "POSITION"));
        let count = position
            .and_then(|accessor| items(&edit.document.json, "accessors").get(accessor))
            .and_then(|accessor| index_at(accessor, "count"));
        let draco = super::append::extension(object, DRACO).is_some();
        let kept = count.filter(|_| !draco).and_then(|count| unsplit(unwrap, count));
        let wiring = Arc::new(match kept {
            Some(unwrapped) => Wiring::Kept { unwrapped },
            None => self.split(edit, mesh, primitive, unwrap, !draco, at)?,
        });
        self.wirings.insert(key, wiring.clone());
        Ok(wiring)
    }

    fn split(
        &mut self,
        edit: &mut Edit,
        mesh: usize,
        primitive: usize,
        unwrap: &Arc<Unwrap>,
        share: bool,
        at: &str,
    ) -> Result<Wiring> {
        let raw = edit.document.raw_primitive(mesh, primitive)?;
        let vertex_count = raw.attributes.first().map_or(0, |(_, accessor)| accessor.count);
        let unwrapped = unwrap.source_vertex.len() as u32;
        if raw.triangles.len() != unwrap.triangles.len()
            || unwrap.source_vertex.iter().any(|&source| source as usize >= vertex_count)
            || unwrap.triangles.iter().flatten().any(|&corner| corner >= unwrapped)
        {
            return Err(Error::invalid(
                at,
                "its unwrap belongs to another mesh; this is a fault of the program",
            ));
        }
        let object = &edit.document.json["meshes"][mesh]["primitives"][primitive];
        let named = |set: Option<&Value>, name: &str| set.and_then(|set| index_at(set, name));
        let sources = |set: Option<&Value>, raws: &[(String, RawAccessor)]| -> Vec<Option<usize>> {
            raws.iter().map(|(name, _)| named(set, name)).collect()
        };
        let plain = sources(object.get("attributes"), &raw.attributes);
        let morphs: Vec<_> = (0..raw.targets.len())
            .map(|t| sources(object.get("targets").and_then(|all| all.get(t)), &raw.targets[t]))
            .collect();

        let mut copy = |edit: &mut Edit, source: Option<usize>, (name, raw): &(String, RawAccessor)| {
            let bounded = name == "POSITION";
            let key = source.filter(|_| share).map(|source| (source, Arc::as_ptr(unwrap) as usize, bounded));
            if let Some(&known) = key.as_ref().and_then(|key| self.copies.get(key)) {
                return (name.clone(), known);
            }
            let made = copy_accessor(edit, source, raw, &unwrap.source_vertex, bounded);
            if let Some(key) = key {
                self.copies.insert(key, made);
            }
            (name.clone(), made)
        };
        let attributes =
            raw.attributes.iter().zip(plain).map(|(raw, source)| copy(edit, source, raw)).collect();
        let targets = raw
            .targets
            .iter()
            .zip(morphs)
            .map(|(target, sources)| {
                target.iter().zip(sources).map(|(raw, source)| copy(edit, source, raw)).collect()
            })
            .collect();
        let indices = push_indices(edit, &unwrap.triangles, unwrapped as usize);
        Ok(Wiring::Split { attributes, targets, indices })
    }
}

impl Wiring {
    /// The lightmap coordinates of a placement in this wiring's vertex order: fractions of the page, v downwards.
    pub fn texcoords(&self, placement: &Placement, page_size: u32) -> Vec<[f32; 2]> {
        let scale = 1.0 / f64::from(page_size.max(1));
        let fraction = |texels: &Vec2| {
            let part = |x: f32| if x.is_finite() { (f64::from(x) * scale) as f32 } else { 0.0 };
            [part(texels.x), part(texels.y)]
        };
        let at = |vertex: usize| placement.uv_texels.get(vertex).map_or([0.0; 2], fraction);
        match self {
            Self::Kept { unwrapped } => {
                unwrapped.iter().map(|vertex| vertex.map_or([0.0; 2], |vertex| at(vertex as usize))).collect()
            }
            Self::Split { .. } => (0..placement.unwrap.source_vertex.len()).map(at).collect(),
        }
    }
}

/// For each of `count` vertices of the file, what it became; `None` when a vertex became several.
fn unsplit(unwrap: &Unwrap, count: usize) -> Option<Vec<Option<u32>>> {
    let mut unwrapped = vec![None; count];
    for (vertex, &source) in unwrap.source_vertex.iter().enumerate() {
        let slot = unwrapped.get_mut(source as usize)?;
        if slot.replace(vertex as u32).is_some() {
            return None;
        }
    }
    Some(unwrapped)
}

/// Appends the elements `source_vertex` names. Name, extras and type are the original's; the data are uncompressed,
/// dense, and every element starts at a multiple of four bytes.
fn copy_accessor(
    edit: &mut Edit,
    source: Option<usize>,
    raw: &RawAccessor,
    source_vertex: &[u32],
    bounded: bool,
) -> usize {
    let columns = padded_columns(raw);
    let padded: usize = columns.iter().map(|(_, padded)| padded).sum();
    let mut bytes = Vec::with_capacity(source_vertex.len() * padded);
    for &vertex in source_vertex {
        let mut element = &raw.bytes[vertex as usize * raw.element_bytes..][..raw.element_bytes];
        for &(used, padded) in &columns {
            let (column, rest) = element.split_at(used);
            bytes.extend_from_slice(column);
            bytes.resize(bytes.len() + padded - used, 0);
            element = rest;
        }
    }
    let stride = (padded != raw.element_bytes).then_some(padded);
    let view = edit.view(&bytes, Some(ARRAY_BUFFER), stride);

    let original = source.and_then(|source| items(&edit.document.json, "accessors").get(source));
    let mut accessor = original.filter(|a| a.is_object()).cloned().unwrap_or_else(|| json!({}));
    if let Some(fields) = accessor.as_object_mut() {
        for stale in ["byteOffset", "sparse", "min", "max", "normalized"] {
            fields.shift_remove(stale);
        }
    }
    accessor["bufferView"] = json!(view);
    accessor["componentType"] = json!(raw.component_type);
    accessor["count"] = json!(source_vertex.len());
    accessor["type"] = json!(raw.kind);
    if raw.normalized {
        accessor["normalized"] = json!(true);
    }
    if bounded {
        let (min, max) = bounds(raw, source_vertex);
        accessor["min"] = min;
        accessor["max"] = max;
    }
    edit.push("accessors", accessor)
}

/// `(bytes, bytes with padding)` of each column: a vector is one column, the columns of a matrix and every element
/// begin at multiples of four (glTF 2.0 section 3.6.2.4).
fn padded_columns(raw: &RawAccessor) -> Vec<(usize, usize)> {
    let columns = match raw.kind.as_str() {
        "MAT2" => 2,
        "MAT3" => 3,
        "MAT4" => 4,
        _ => 1,
    };
    let used = raw.element_bytes / columns;
    vec![(used, used.next_multiple_of(4)); columns]
}

/// Smallest and largest of each component, exact: floats are printed so that they parse to the same float.
fn bounds(raw: &RawAccessor, source_vertex: &[u32]) -> (Value, Value) {
    let width = raw.components().max(1);
    let mut low = vec![f64::INFINITY; width];
    let mut high = vec![f64::NEG_INFINITY; width];
    let step = raw.element_bytes / width;
    for &vertex in source_vertex {
        let element = &raw.bytes[vertex as usize * raw.element_bytes..][..raw.element_bytes];
        for (i, bytes) in element.chunks_exact(step.max(1)).enumerate() {
            let x = match (raw.component_type, bytes) {
                (5120, &[b]) => f64::from(b as i8),
                (5121, &[b]) => f64::from(b),
                (5122, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
                (5123, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
                (5125, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
                (_, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
                _ => continue,
            };
            if x.is_finite() {
                low[i] = low[i].min(x);
                high[i] = high[i].max(x);
            }
        }
    }
    let whole = raw.component_type != 5126;
    let numbers = |values: Vec<f64>| -> Value {
        let number = |x: f64| match (x.is_finite(), whole) {
            (false, _) => json!(0),
            (true, true) => json!(x as i64),
            (true, false) => json!(x),
        };
        values.into_iter().map(number).collect()
    };
    (numbers(low), numbers(high))
}

/// 16 bit where no index would reach the restart value 65535.
fn push_indices(edit: &mut Edit, triangles: &[[u32; 3]], vertex_count: usize) -> usize {
    let corners = triangles.as_flattened();
    let narrow = vertex_count <= usize::from(u16::MAX);
    let bytes: Vec<u8> = if narrow {
        corners.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect()
    } else {
        corners.iter().flat_map(|&i| i.to_le_bytes()).collect()
    };
    let view = edit.view(&bytes, Some(ELEMENT_ARRAY_BUFFER), None);
    let component_type = if narrow { 5123 } else { 5125 };
    edit.push(
        "accessors",
        json!({"bufferView": view, "componentType": component_type, "count": corners.len(), "type": "SCALAR"}),
    )
}
