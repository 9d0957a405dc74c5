//! Document + atlas + lightmap -> files.

mod exr;
mod files;
mod picture;
mod uri;
pub use exr::{ExrImage, decode, read_exr};
pub use picture::picture_png;
