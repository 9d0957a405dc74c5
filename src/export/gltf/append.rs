//! Appending to a glTF: new entries stand behind the old ones, new bytes behind the old bytes, nothing is renumbered.

use super::super::target::Form;
use crate::error::{Error, Result, Warning};
use crate::import::{Container, Document};
use base64::Engine;
use serde_json::{Map, Value, json};
use std::borrow::Cow;

/// `bufferView.target` of vertex attributes.
pub(in super::super) const ARRAY_BUFFER: u32 = 34962;
/// `bufferView.target` of indices.
pub(in super::super) const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Arrays of the root that are appended to.
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

/// Where new bytes go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Home {
    /// Behind the bytes of buffer 0, which is the BIN chunk of the output.
    Bin,
    /// Behind the bytes of buffer 0, which was the BIN chunk of the input and becomes a file of its own.
    Unpacked,
    /// A buffer of their own in a file beside the output.
    File,
    /// A buffer of their own, written into the JSON.
    Data,
}

/// A glTF being added to.
pub(in super::super) struct Edit<'a> {
    /// The input, never changed.
    pub document: &'a Document,
    /// The output's JSON so far.
    pub json: Value,
    /// What the artist should know.
    pub warnings: Vec<Warning>,
    form: Form,
    home: Home,
    /// Index of the buffer that new bytes go to.
    buffer: usize,
    /// New bytes; they begin at `base` in that buffer.
    bytes: Vec<u8>,
    base: usize,
}

/// The bytes of an output, in pieces that borrow the input's.
pub(in super::super) struct Pieces<'a> {
    /// The glTF file, piece by piece.
    pub gltf: Vec<Piece<'a>>,
    /// The buffer beside it.
    pub buffer: Option<Vec<Piece<'a>>>,
}

/// Some bytes of a file.
pub(in super::super) enum Piece<'a> {
    /// New ones.
    New(Vec<u8>),
    /// The input's.
    Old(&'a [u8]),
}

impl AsRef<[u8]> for Piece<'_> {
    fn as_ref(&self) -> &[u8] {
        match self {
            Self::New(bytes) => bytes,
            Self::Old(bytes) => bytes,
        }
    }
}

impl<'a> Edit<'a> {
    /// Begins with the input as it is, to be wrapped as `form`.
    pub fn new(document: &'a Document, form: Form) -> Result<Self> {
        let json = document.json.clone();
        for list in LISTS {
            if json.get(list).is_some_and(|value| !value.is_array()) {
                let at = document.path.display().to_string();
                return Err(Error::invalid(
                    at,
                    format!("\"{list}\" is not an array: export the scene again"),
                ));
            }
        }
        let buffers = items(&json, "buffers");
        let first = buffers.first();
        let bin_is_first = bin(document).is_some()
            && first.is_some_and(|buffer| buffer.get("uri").is_none() && !is_fallback(buffer));
        let home = match (form, &document.container) {
            (Form::Binary, _) if first.is_none() || bin_is_first => Home::Bin,
            // A .gltf becomes a .glb: its first buffer moves into the BIN chunk.
            (Form::Binary, Container::Json) if first.is_some_and(|buffer| buffer.get("uri").is_some()) => {
                Home::Bin
            }
            (Form::Json, _) if bin_is_first => Home::Unpacked,
            _ if only_data_uris(buffers) => Home::Data,
            _ => Home::File,
        };
        let (buffer, base) = match home {
            Home::Bin | Home::Unpacked => (0, first_bytes(document).len().next_multiple_of(4)),
            Home::File | Home::Data => (buffers.len(), 0),
        };
        let mut edit =
            Self { document, json, warnings: Vec::new(), form, home, buffer, bytes: Vec::new(), base };
        if home == Home::Bin
            && let Some(first) = edit.json.get_mut("buffers").and_then(|list| list.get_mut(0))
            && let Some(first) = first.as_object_mut()
        {
            first.shift_remove("uri");
        }
        if form == Form::Json {
            edit.warn_of_lost_chunks(bin_is_first);
        }
        Ok(edit)
    }

    /// Appends to a top-level array and returns the index.
    pub fn push(&mut self, array: &str, value: Value) -> usize {
        let Some(root) = self.json.as_object_mut() else { return 0 };
        let list = root.entry(array).or_insert_with(|| json!([]));
        let Some(list) = list.as_array_mut() else { return 0 };
        list.push(value);
        list.len() - 1
    }

    /// Appends bytes as a buffer view at a multiple of four.
    pub fn view(&mut self, bytes: &[u8], target: Option<u32>, stride: Option<usize>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({
            "buffer": self.buffer,
            "byteOffset": self.base + self.bytes.len(),
            "byteLength": bytes.len(),
        });
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(bytes);
        self.push("bufferViews", view)
    }

    /// Appends an accessor of texture coordinates.
    pub fn texcoords(&mut self, uv: &[[f32; 2]]) -> usize {
        let bytes: Cow<[u8]> = if cfg!(target_endian = "little") {
            bytemuck::cast_slice(uv).into()
        } else {
            uv.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
        };
        let view = self.view(&bytes, Some(ARRAY_BUFFER), None);
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": 5126, "count": uv.len(), "type": "VEC2"}),
        )
    }

    /// Names an extension in `extensionsUsed`.
    pub fn use_extension(&mut self, name: &str) {
        let known = items(&self.json, "extensionsUsed").iter().any(|used| used == name);
        if !known {
            self.push("extensionsUsed", json!(name));
        }
    }

    /// Takes an extension off the lists when nothing in the file has it any more.
    pub fn retire_extension(&mut self, name: &str) {
        let Some(root) = self.json.as_object_mut() else { return };
        if root.iter().any(|(key, value)| key != "extras" && has_extension(value, name))
            || root.get("extensions").and_then(|all| all.get(name)).is_some()
        {
            return;
        }
        for list in ["extensionsUsed", "extensionsRequired"] {
            let Some(names) = root.get_mut(list).and_then(Value::as_array_mut) else { continue };
            names.retain(|used| used != name);
            // glTF forbids empty arrays.
            if names.is_empty() {
                root.shift_remove(list);
            }
        }
    }

    /// One warning more.
    pub fn warn(&mut self, at: impl Into<String>, what: impl Into<String>) {
        self.warnings.push(Warning::new(at, what));
    }

    /// Adds an entry to an object's extras. Extras that are not an object are the artist's and stay as they are.
    pub fn merge_extras(&mut self, array: &str, index: usize, at: &str, key: &str, value: Value) {
        let Some(object) = self.json.get_mut(array).and_then(|list| list.get_mut(index)) else { return };
        if !merge_extras(object, key, value) {
            let what = format!("its extras are not an object, so \"{key}\" was not added to them");
            self.warn(at, what);
        }
    }

    /// The output's bytes. `buffer_name` is the file of a buffer beside the glTF, should there be one.
    pub fn finish(mut self, at: &str, buffer_name: &str) -> Result<(Pieces<'a>, Vec<Warning>)> {
        let added = std::mem::take(&mut self.bytes);
        let uri = super::super::uri::from_name(buffer_name);
        match self.home {
            Home::Bin => self.grow_first_buffer(added.len()),
            Home::Unpacked => {
                self.grow_first_buffer(added.len());
                self.json["buffers"][0]["uri"] = json!(uri);
            }
            _ if added.is_empty() => {}
            Home::File => drop(self.push("buffers", json!({"byteLength": added.len(), "uri": uri}))),
            Home::Data => {
                let text = base64::engine::general_purpose::STANDARD.encode(&added);
                let uri = format!("data:application/octet-stream;base64,{text}");
                self.push("buffers", json!({"byteLength": added.len(), "uri": uri}));
            }
        }

        let old = first_bytes(self.document);
        let mut bin = bin(self.document).map(|old| vec![Piece::Old(old)]);
        let mut buffer = None;
        match self.home {
            Home::Bin if bin.is_some() || old.len() + added.len() > 0 => {
                bin = Some(grown(old, added, self.base))
            }
            Home::Unpacked => buffer = Some(grown(old, added, self.base)),
            Home::File if !added.is_empty() => buffer = Some(vec![Piece::New(added)]),
            _ => {}
        }
        let written = |json: serde_json::Result<Vec<u8>>| {
            let told = |error| Error::invalid(at, format!("the JSON cannot be written: {error}"));
            json.map(|json| self.document.exponents.restore(json)).map_err(told)
        };
        let gltf = match self.form {
            Form::Json => vec![Piece::New(written(serde_json::to_vec_pretty(&self.json))?)],
            Form::Binary => {
                let other = match &self.document.container {
                    Container::Binary { other_chunks, .. } => other_chunks.as_slice(),
                    Container::Json => &[],
                };
                super::glb::pieces(at, written(serde_json::to_vec(&self.json))?, bin, other)?
            }
        };
        Ok((Pieces { gltf, buffer }, self.warnings))
    }

    fn grow_first_buffer(&mut self, added: usize) {
        if added == 0 {
            return;
        }
        let length = json!(self.base + added);
        if items(&self.json, "buffers").is_empty() {
            self.push("buffers", json!({"byteLength": length}));
        } else if let Some(first) = self.json["buffers"].get_mut(0) {
            first["byteLength"] = length;
        }
    }

    fn warn_of_lost_chunks(&mut self, bin_is_first: bool) {
        let Container::Binary { bin, other_chunks } = &self.document.container else { return };
        let orphan = bin.is_some() && !bin_is_first;
        let names =
            other_chunks.iter().map(|(kind, _)| String::from_utf8_lossy(&kind.to_le_bytes()).into_owned());
        let lost: Vec<String> =
            orphan.then(|| "BIN (no buffer uses it)".to_owned()).into_iter().chain(names).collect();
        if !lost.is_empty() {
            let what = format!(
                "a .gltf cannot hold the chunks {} of this .glb, so they were left out: write a .glb to keep them",
                lost.join(", ")
            );
            self.warn(self.document.path.display().to_string(), what);
        }
    }
}

/// The items of a top-level array; none when it is absent.
pub(in super::super) fn items<'a>(json: &'a Value, array: &str) -> &'a [Value] {
    json.get(array).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// An index, also where it is written as 1.0.
pub(in super::super) fn index(value: &Value) -> Option<usize> {
    let whole = value
        .as_u64()
        .or_else(|| value.as_f64().filter(|x| x.fract() == 0.0 && (0.0..9e15).contains(x)).map(|x| x as u64));
    whole.and_then(|n| usize::try_from(n).ok())
}

/// The index under a key.
pub(in super::super) fn index_at(object: &Value, key: &str) -> Option<usize> {
    object.get(key).and_then(index)
}

/// An object's extension.
pub(in super::super) fn extension<'a>(object: &'a Value, name: &str) -> Option<&'a Value> {
    object.get("extensions").and_then(|all| all.get(name))
}

/// Takes an extension off an object, and the empty `extensions` with it, which glTF forbids.
pub(in super::super) fn remove_extension(object: &mut Value, name: &str) -> Option<Value> {
    let owner = object.as_object_mut()?;
    let all = owner.get_mut("extensions")?.as_object_mut()?;
    let removed = all.shift_remove(name);
    if all.is_empty() {
        owner.shift_remove("extensions");
    }
    removed
}

/// Sets an extension of an object.
pub(in super::super) fn set_extension(object: &mut Map<String, Value>, name: &str, value: Value) {
    let all = object.entry("extensions").or_insert_with(|| json!({}));
    if !all.is_object() {
        *all = json!({});
    }
    all[name] = value;
}

/// Adds an entry to the extras of an object; `false` when it has extras that cannot take one.
pub(in super::super) fn merge_extras(object: &mut Value, key: &str, value: Value) -> bool {
    let Some(owner) = object.as_object_mut() else { return false };
    match owner.entry("extras").or_insert_with(|| json!({})) {
        Value::Object(extras) => {
            extras.insert(key.to_owned(), value);
            true
        }
        _ => false,
    }
}

fn has_extension(value: &Value, name: &str) -> bool {
    match value {
        Value::Object(map) => map.iter().any(|(key, inner)| {
            key != "extras"
                && (key == "extensions" && inner.get(name).is_some() || has_extension(inner, name))
        }),
        Value::Array(list) => list.iter().any(|inner| has_extension(inner, name)),
        _ => false,
    }
}

fn bin(document: &Document) -> Option<&[u8]> {
    match &document.container {
        Container::Binary { bin, .. } => bin.as_deref(),
        Container::Json => None,
    }
}

/// What stands before the new bytes when they go behind buffer 0: the whole BIN chunk with its padding, or the first
/// buffer of a `.gltf`.
fn first_bytes(document: &Document) -> &[u8] {
    match &document.container {
        Container::Binary { bin, .. } => bin.as_deref().unwrap_or_default(),
        Container::Json => document.buffers.first().map_or(&[], |buffer| &buffer.bytes),
    }
}

/// Old bytes, padding, new bytes.
fn grown(old: &[u8], new: Vec<u8>, base: usize) -> Vec<Piece<'_>> {
    if new.is_empty() {
        return vec![Piece::Old(old)];
    }
    vec![Piece::Old(old), Piece::New(vec![0; base - old.len()]), Piece::New(new)]
}

/// A placeholder that EXT_meshopt_compression puts where uncompressed bytes would be: it has none.
fn is_fallback(buffer: &Value) -> bool {
    ["EXT_meshopt_compression", "KHR_meshopt_compression"]
        .iter()
        .any(|name| extension(buffer, name).and_then(|e| e.get("fallback")) == Some(&Value::Bool(true)))
}

fn only_data_uris(buffers: &[Value]) -> bool {
    let mut uris = buffers.iter().filter_map(|buffer| buffer.get("uri")?.as_str()).peekable();
    uris.peek().is_some()
        && uris.all(|uri| uri.get(..5).is_some_and(|start| start.eq_ignore_ascii_case("data:")))
}
