//! The file as it is: kept whole, so that export can append to it without losing anything.

use super::compression::DecodedView;
use super::exponents::Exponents;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// How the file is wrapped.
#[derive(Clone, Debug)]
pub enum Container {
    /// A `.gltf` with buffers in other files or data URIs.
    Json,
    /// A `.glb`.
    Binary {
        /// The BIN chunk's bytes, padding included.
        bin: Option<Vec<u8>>,
        /// Chunks after BIN, `(type, bytes)`, kept as they are.
        other_chunks: Vec<(u32, Vec<u8>)>,
    },
}

/// The bytes of one entry of `buffers`.
#[derive(Clone, Debug)]
pub struct Buffer {
    /// Exactly `byteLength` bytes; empty for a buffer that has none (a fallback of EXT_meshopt_compression).
    pub bytes: Vec<u8>,
    /// The file it was read from, for external buffers.
    pub path: Option<PathBuf>,
    /// The buffer views that EXT_meshopt_compression hides in it, by index and rising; decoded when first asked for,
    /// because one view often serves hundreds of accessors.
    pub(super) packed_views: Vec<(usize, OnceLock<DecodedView>)>,
}

/// The file: JSON untouched, buffers, container.
#[derive(Clone, Debug)]
pub struct Document {
    /// Where it was read from.
    pub path: PathBuf,
    /// The JSON, order and number text kept.
    pub json: Value,
    /// Number text that `json` does not keep.
    pub exponents: Exponents,
    /// How it is wrapped.
    pub container: Container,
    /// One per entry of `buffers`.
    pub buffers: Vec<Buffer>,
}

impl Document {
    /// The folder that relative uris start from.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }
}

/// Elements of an accessor as raw little-endian bytes, tightly packed, sparse values applied, compression undone.
#[derive(Clone, Debug, PartialEq)]
pub struct RawAccessor {
    /// glTF component type, 5120..=5126.
    pub component_type: u32,
    /// "SCALAR", "VEC2", ...
    pub kind: String,
    /// Whether integers stand for fractions.
    pub normalized: bool,
    /// Number of elements.
    pub count: usize,
    /// Bytes of one element without padding.
    pub element_bytes: usize,
    /// `count × element_bytes` bytes.
    pub bytes: Vec<u8>,
}

/// A primitive's vertex data and triangles, whatever way the file stores them.
#[derive(Clone, Debug, PartialEq)]
pub struct RawPrimitive {
    /// `(semantic, elements)` in the file's order.
    pub attributes: Vec<(String, RawAccessor)>,
    /// Morph targets.
    pub targets: Vec<Vec<(String, RawAccessor)>>,
    /// Strips and fans expanded; indices checked against the vertex count.
    pub triangles: Vec<[u32; 3]>,
}
