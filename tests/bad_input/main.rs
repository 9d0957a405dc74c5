//! Files that are broken, hostile or absurd: each ends as an error that says something, or as a sound bake.

mod claims;
mod command;
mod mutate;
mod outside;
// The fuzz targets ask for single stages too.
#[allow(dead_code)]
mod sound;

use lightkiln::options::ImportOptions;
use mutate::{Dice, Parts};
use proptest::prelude::*;
use std::path::Path;

/// The smallest fixtures that together hold lamps, emission, textures, instances, skins and blending.
const FIXTURES: [&str; 7] = [
    "blend_glass",
    "closed_furnace",
    "double_sided",
    "emissive_texture",
    "grey_lamp",
    "instances",
    "skinned",
];

fn fixture(number: usize) -> Parts {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures");
    let name = FIXTURES[number % FIXTURES.len()];
    mutate::split(&std::fs::read(folder.join(name).with_extension("glb")).unwrap()).unwrap()
}

/// A fixture after some changes.
fn damaged(number: usize, seed: u64, changes: usize) -> Vec<u8> {
    let (mut parts, mut dice) = (fixture(number), Dice(seed));
    // What the options are is part of the file, so it is changed with it.
    parts.json["asset"]["extras"]["choices"] = (0..16).map(|_| dice.below(60)).collect();
    for _ in 0..changes {
        mutate::change(&mut parts, &mut dice);
    }
    mutate::join(&parts)
}

/// As many cases as are quick, or `LIGHTKILN_DAMAGED`.
fn some(quick: u32) -> ProptestConfig {
    let wanted = std::env::var("LIGHTKILN_DAMAGED").ok().and_then(|n| n.parse().ok());
    let cases = wanted.unwrap_or(quick);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(some(1500))]
    #[test]
    fn damaged_files_are_refused_with_words_or_read_whole(number in 0..7_usize, seed: u64, changes in 1..6_usize) {
        let _ = sound::import(&damaged(number, seed, changes), &ImportOptions::default());
    }
}

proptest! {
    #![proptest_config(some(60))]
    #[test]
    fn damaged_files_bake_soundly_or_say_why_not(number in 0..7_usize, seed: u64, changes in 1..4_usize) {
        let bytes = damaged(number, seed, changes);
        let Ok((document, scene)) = sound::import(&bytes, &ImportOptions::default()) else { return Ok(()) };
        if sound::small(&scene) {
            let options = sound::options(&document.json);
            let folder = tempfile::tempdir().unwrap();
            let _ = sound::bake(&bytes, &options, folder.path());
        }
    }
}

/// Without it the two above could pass because nothing gets far.
#[test]
fn damage_is_small_enough_that_much_is_still_read() {
    let read = (0..200)
        .filter(|&seed| sound::import(&damaged(seed as usize, seed, 3), &ImportOptions::default()).is_ok())
        .count();
    assert!((40..200).contains(&read), "{read} of 200 could be read");
}
