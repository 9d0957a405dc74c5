mod cases;
mod meshes;
mod speed;
mod tangles;
mod verify;

use super::{Atlas, unwrap};
use crate::error::Result;
use crate::options::AtlasOptions;
use crate::plan::{Side, Sides};
use crate::progress::{Progress, Silent, Stage};
use crate::scene::Scene;
use std::sync::atomic::AtomicBool;

/// Unwraps with all fronts lit and backs as given.
fn atlas(scene: &Scene, back: Side, options: &AtlasOptions) -> Result<Atlas> {
    let sides = vec![Sides { front: Side::Lightmapped, back }; scene.surfaces.len()];
    let cancel = AtomicBool::new(false);
    let progress = Progress::begin(&Silent, &cancel, Stage::Atlas, scene.geometries.len() as u64);
    unwrap(scene, &sides, options, &progress)
}

fn page(page_size: u32) -> AtlasOptions {
    AtlasOptions { page_size, ..AtlasOptions::default() }
}
