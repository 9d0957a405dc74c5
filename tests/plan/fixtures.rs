//! The same on every fixture, and what the plan says of some.

use crate::common::options;
use crate::{changes_nothing, finding, planned};
use lightkiln::bake::Run;
use lightkiln::forecast::forecast;
use lightkiln::import;
use lightkiln::options::{BakeOptions, Effect, Goal, ImportOptions, Quality};
use lightkiln::plan::Amount;
use lightkiln::scene::Scene;
use std::path::PathBuf;

fn fixtures() -> Vec<(String, Scene)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures");
    let files =
        std::fs::read_dir(folder).expect("the fixtures are there").flatten().map(|entry| entry.path());
    let mut scenes: Vec<PathBuf> =
        files.filter(|file| file.extension().is_some_and(|ext| ext == "glb")).collect();
    scenes.sort();
    assert!(scenes.len() >= 12);
    scenes
        .into_iter()
        .map(|file| {
            let (_, scene) = import::load(&file, &ImportOptions::default()).expect("a fixture can be read");
            (file.file_stem().expect("it has a name").to_string_lossy().into_owned(), scene)
        })
        .collect()
}

#[test]
fn forecasts_count_texels() {
    for (name, scene) in fixtures() {
        let options = options(Quality::Draft, 256);
        let foreseen = forecast(&scene, &options, &Run::default()).expect("it can be foreseen");
        let lit = lightkiln::bake::light(&scene, &options, &Run::default()).expect("it can be baked");
        let (told, true_count) = (foreseen.elements as f64, lit.elements.len() as f64);
        assert!((told / true_count - 1.0).abs() < 0.2, "{name}: {told} texels foreseen, {true_count} lit");
        let (told, sent) = (foreseen.rays as f64, lit.light.rays as f64);
        assert!((0.5..2.0).contains(&(told / sent)), "{name}: {told} rays foreseen, {sent} sent");
    }
}

/// Errors below this share of the mean are told as they come.
const NOTHING: f64 = 1e-3;

/// Both errors are estimates, each within a factor of 1.5 (`tests/budget.rs`), and what smaller texels change lies between
/// nothing and the root of the densities' ratio, 2 at the most.
const ERROR_FACTOR: f64 = 1.5 * 1.5 * std::f64::consts::SQRT_2;

/// What a foretold error is off by, rays are by its power: squared errors fall with the power 1.2 of the rays.
fn ray_factor() -> f64 {
    ERROR_FACTOR.powf(2.0 / 1.2)
}

/// Errors within that; the rays of a tolerance within 2 mostly, and always within what the error may be off by: a draft may be
/// enough for it, or not.
#[test]
fn what_accuracy_costs_is_foretold() {
    let within = |told: f64, found: f64, factor: f64| told <= factor * found && found <= factor * told;
    let mut near = Vec::new();
    for (name, scene) in fixtures() {
        let options = options(Quality::Good, 256);
        let foreseen = forecast(&scene, &options, &Run::default()).expect("it can be foreseen");
        let told = foreseen.error.expect("none of them is dark");
        let lit = lightkiln::bake::light(&scene, &options, &Run::default()).expect("it can be baked");
        let found = lit.light.estimated_error.expect("it is audited");
        let close = within(told, found, ERROR_FACTOR) || told.max(found) < NOTHING;
        assert!(close, "{name}: an error of {told:.5} foretold, {found:.5} found");
        for price in foreseen.prices.iter().filter(|price| price.error < 0.03 && price.error > 0.006) {
            let goal = BakeOptions { goal: Goal::Tolerance(price.error), ..options.clone() };
            let lit = lightkiln::bake::light(&scene, &goal, &Run::default()).expect("it can be baked");
            let (told, sent) = (price.rays as f64, lit.light.rays as f64);
            assert!(price.within_reach, "{name}: {price:?}");
            assert!(within(told, sent, ray_factor()), "{name}: {price:?}, but {sent} rays sent");
            near.push(within(told, sent, 2.0));
        }
        assert!(
            foreseen.prices.windows(2).all(|pair| pair[0].seconds <= pair[1].seconds),
            "{name}: {foreseen:?}"
        );
    }
    let share = near.iter().filter(|near| **near).count() as f64 / near.len() as f64;
    assert!(share >= 0.8, "{share} of the prices were right within a factor of two");
}

/// And changes nothing.
#[test]
fn what_leaving_out_saves_is_foretold() {
    for (name, scene) in fixtures() {
        let outcome = changes_nothing(&name, &scene, &options(Quality::Draft, 256));
        for finding in outcome.findings.iter().filter(|finding| !finding.on) {
            let forced = outcome.forced.iter().find(|trial| trial.effect == Some(finding.effect));
            let Some(forced) = forced else {
                // There is nothing to leave out, and so it says.
                assert!(finding.saving.amounts.is_empty(), "{name}: {finding:?}");
                assert!(finding.saving.what.starts_with("nothing"), "{name}: {finding:?}");
                continue;
            };
            let at = format!("{name}, {}: {:?}", finding.effect.name(), finding.saving);
            assert!(!finding.saving.amounts.is_empty(), "{at}");
            let of_planned = outcome.planned.rays as f64;
            for amount in &finding.saving.amounts {
                // A number is worth saying when it is of the right size. Below a twentieth of the bake none is.
                let (told, found) = match *amount {
                    Amount::Rays(rays) => (rays as f64, forced.rays as f64 - of_planned),
                    Amount::Texels(texels) => {
                        (texels as f64, forced.elements as f64 - outcome.planned.elements as f64)
                    }
                    _ => continue,
                };
                let slack = 0.05 * of_planned;
                assert!(told <= 2.0 * found + slack && found <= 2.0 * told + slack, "{at}: {found} found");
            }
        }
    }
}

#[test]
fn reasons_are_in_the_artist_s_words() {
    let expected = [
        ("cornell", Effect::BackFaces, false, "no material is double-sided"),
        ("cornell", Effect::AreaLights, true, "1 glowing object: 'light'"),
        ("grey_lamp", Effect::Shadows, false, "nothing stands between the lights and any surface"),
        ("grey_lamp", Effect::ColourChannels, false, "everything is grey: one channel does"),
        ("closed_furnace", Effect::LightBetweenRooms, false, "1 room sealed off inside 'room'"),
        ("leaves", Effect::AlphaTest, true, "1 object with holes: 'leaves'"),
        ("emissive_texture", Effect::TexturedEmission, true, "1 object with an emissive image: 'panel'"),
        ("window_room", Effect::Sky, true, "the sky is lit"),
    ];
    let scenes = fixtures();
    for (name, effect, on, reason) in expected {
        let (_, scene) = scenes.iter().find(|(fixture, _)| fixture == name).expect("the fixture is there");
        let plan = planned(scene);
        let found = finding(&plan, effect);
        assert_eq!((found.on, found.reason.as_str()), (on, reason), "{name}");
    }
}
