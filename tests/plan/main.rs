//! The plan: every effect is left out where it cannot matter, never where it might, and leaving it out changes nothing.

#[path = "../common/mod.rs"]
mod common;
mod fixtures;
mod idle;
mod random;
mod scenes;
mod shared;
mod twins;
mod words;

use lightkiln::bake::Run;
use lightkiln::options::{BakeOptions, Effect, Quality};
use lightkiln::plan::{Finding, Plan, Wanted, plan};
use lightkiln::scene::Scene;
use lightkiln::study::effects::{Outcome, Subject, compare};

/// What is planned when nothing is forced.
fn planned(scene: &Scene) -> Plan {
    plan(scene, &Wanted::default())
}

fn finding(plan: &Plan, effect: Effect) -> &Finding {
    plan.effects.iter().find(|finding| finding.effect == effect).expect("every effect has a finding")
}

/// Bakes a scene as planned and in vain, and fails on a difference that should not be.
#[track_caller]
fn changes_nothing(name: &str, scene: &Scene, options: &BakeOptions) -> Outcome {
    let subject = Subject { name: name.to_owned(), scene: scene.clone(), read_seconds: 0.0, cost: None };
    let outcome = compare(&subject, options, &Run::default()).expect("it can be baked");
    let failed: Vec<_> = outcome.forced.iter().filter(|trial| !trial.holds()).collect();
    assert!(failed.is_empty(), "{name}: {failed:#?}");
    outcome
}

fn draft() -> BakeOptions {
    common::options(Quality::Draft, 64)
}
