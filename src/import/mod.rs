//! glTF file -> (Document, Scene): the file as it is, and the world it describes.

mod accessor;
mod buffers;
mod compression;
mod container;
mod document;
mod extensions;
mod json;
mod primitive;
mod uri;

pub use document::{Buffer, Container, Document, RawAccessor, RawPrimitive};

/// The most vertices, and the most triangles, a scene may place in the world: about 5 GB of positions and normals.
pub const MAX_VERTICES: usize = 100_000_000;

#[cfg(test)]
mod testing;
