//! lightkiln bakes light into glTF: progressive radiosity on the CPU, stored as EXR lightmaps.
//!
//! The modules stand in the order the data flows:
//! import → plan → atlas → transport → elements → direct → solve → gather → resolve → export.
//!
//! A baked file is read back (baked) to be looked at (render) or examined (check).
//!
//! *texel*: pixel of an atlas page. *element*: lit texel footprint on a surface, the receiver; it has position,
//! normal, area, reflectance. *patch*: group of elements that shoots and receives interreflected light in the coarse
//! solution. *chart*: connected piece of unwrapped surface. *page*: one square atlas image, one EXR. *shot*: one
//! patch's unshot power sent to all others. *form factor* F_ij: fraction of the power leaving i that arrives at j.
//! *radiosity* b: W/m² leaving. *irradiance* E: W/m² arriving. *unshot power*: A_i Δb_i. *lamp*: punctual light.

#![deny(unsafe_code)]

pub mod error;
pub mod options;
pub mod progress;
pub mod sampling;
pub mod text;
pub mod units;

pub mod scene;

pub mod import;
pub mod plan;
pub mod atlas;
// SIMD loads in the tree's traversal.
#[allow(unsafe_code)]
pub mod transport;
pub mod elements;
pub mod direct;
pub mod solve;
pub mod gather;
pub mod audit;
pub mod resolve;
pub mod export;

pub mod baked;
pub mod render;
pub mod check;

pub mod bake;
pub mod forecast;
mod memory;
pub mod report;
pub mod study;

pub use error::{Error, Result, Warning};
