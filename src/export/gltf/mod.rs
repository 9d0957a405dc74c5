//! The lossless, append-only edit of a glTF.

mod append;
mod glb;
mod instances;
mod lamps;
mod materials;
mod meshes;
mod texcoord;
mod vertices;

pub(super) use append::{Edit, extension, set_extension};
pub(super) use lamps::{scene_of, settle as settle_lamps};
pub(super) use materials::{repaint, settle_variants};
pub(super) use meshes::{Worn, dress};
pub(super) use texcoord::LIGHTMAP;
