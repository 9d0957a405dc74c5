//! Whole files through the whole stage, one topic a file.

mod area_lamps;
mod broken;
mod compressed;
mod lights;
mod materials;
mod skies;
mod world;

use super::testing::Builder;
use crate::error::{Error, Result};
use crate::options::ImportOptions;
use crate::scene::Scene;
use serde_json::Value;

fn square(rest: Value) -> Result<Scene> {
    Builder::square().load_square(rest, &ImportOptions::default()).map(|(_, scene)| scene)
}

fn refusal(result: Result<Scene>) -> String {
    match result {
        Ok(_) => panic!("accepted"),
        Err(error @ (Error::Invalid { .. } | Error::Unsupported { .. } | Error::TooLarge { .. })) => {
            error.to_string()
        }
        Err(other) => panic!("{other:?}"),
    }
}

/// Warnings that mention `word`.
fn warnings<'s>(scene: &'s Scene, word: &str) -> Vec<&'s str> {
    scene.warnings.iter().filter(|w| w.what.contains(word)).map(|w| w.at.as_str()).collect()
}
