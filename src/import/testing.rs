//! Tiny files for the tests of this stage.

use super::document::Document;
use crate::error::Result;
use crate::options::ImportOptions;
use crate::scene::Scene;
use serde_json::{Value, json};
use std::path::Path;

/// A GLB of this JSON and BIN chunk.
pub(super) fn glb(json: &Value, bin: &[u8]) -> Vec<u8> {
    let pad = |mut bytes: Vec<u8>, fill: u8| {
        bytes.resize(bytes.len().next_multiple_of(4), fill);
        bytes
    };
    let (json, bin) = (pad(json.to_string().into_bytes(), b' '), pad(bin.to_vec(), 0));
    let length = 12 + 8 + json.len() + 8 + bin.len();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", bin)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// Collects bytes and writes the buffer views and accessors that describe them.
#[derive(Default)]
pub(super) struct Builder {
    pub bin: Vec<u8>,
    pub views: Vec<Value>,
    pub accessors: Vec<Value>,
}

impl Builder {
    /// Appends bytes as a new buffer view.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend(bytes);
        self.views.len() - 1
    }

    /// Appends an accessor.
    pub fn accessor(&mut self, bytes: &[u8], component_type: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        let accessor =
            json!({"bufferView": view, "componentType": component_type, "type": kind, "count": count});
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Appends an accessor of floats.
    pub fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, kind, values.len() / width)
    }

    /// Appends an accessor of 16 bit indices.
    pub fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5123, "SCALAR", values.len())
    }

    /// The file: `rest` is merged into what was collected.
    pub fn file(&self, rest: Value) -> Vec<u8> {
        let mut json = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": self.bin.len()}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        if let (Some(json), Value::Object(rest)) = (json.as_object_mut(), rest) {
            json.extend(rest);
        }
        glb(&json, &self.bin)
    }

    /// Appends a square of 1 m in the xy plane that faces +z: accessors 0 to 3 are positions, normals, texture
    /// coordinates and indices.
    pub fn square() -> Self {
        let mut builder = Self::default();
        builder.floats(&[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.], "VEC3");
        builder.floats(&[0., 0., 1.].repeat(4), "VEC3");
        builder.floats(&[0., 1., 1., 1., 1., 0., 0., 0.], "VEC2");
        builder.indices(&[0, 1, 2, 0, 2, 3]);
        builder
    }

    /// Appends a PNG and returns its buffer view.
    pub fn png(&mut self, size: [u32; 2], texels: &[[u8; 4]]) -> usize {
        let picture = image::RgbaImage::from_raw(size[0], size[1], texels.concat()).unwrap();
        let mut bytes = Vec::new();
        picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
        self.view(&bytes)
    }

    /// Loads the file with a mesh 'Square' of the square's accessors and a node 'Wall' that uses it, merged with `rest`.
    pub fn load_square(&self, rest: Value, options: &ImportOptions) -> Result<(Document, Scene)> {
        let primitive = json!({
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3,
            "material": if rest.get("materials").is_some() { json!(0) } else { Value::Null }
        });
        let mut primitive = primitive;
        if let Some(object) = primitive.as_object_mut() {
            object.retain(|_, value| !value.is_null());
        }
        let mut json = json!({
            "meshes": [{"name": "Square", "primitives": [primitive]}],
            "nodes": [{"name": "Wall", "mesh": 0}],
            "scenes": [{"name": "Room", "nodes": [0]}]
        });
        if let (Some(json), Value::Object(rest)) = (json.as_object_mut(), rest) {
            json.extend(rest);
        }
        super::load_bytes(Path::new("test.glb"), &self.file(json), options)
    }

    /// The file taken apart.
    pub fn document(&self, rest: Value) -> Result<Document> {
        Document::open(Path::new("test.glb"), &self.file(rest), &ImportOptions::default(), &mut Vec::new())
    }
}
