//! glTF file -> (Document, Scene): the file as it is, and the world it describes.

mod document;

pub use document::{Buffer, Container, Document, RawAccessor, RawPrimitive};
