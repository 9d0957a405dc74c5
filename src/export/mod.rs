//! Document + atlas + lightmap -> files.

mod exr;
mod files;
mod picture;
mod target;
mod uri;
pub use exr::{ExrImage, decode_exr, read_exr};
pub use picture::picture_png;
