//! Plans of every scene of the collection beside the project end well, and agree with what the files say; skipped where
//! there is none.
#![allow(clippy::print_stderr)] // It says when it is skipped.

use crate::common::{options, shared_scenes};
use crate::{finding, planned};
use lightkiln::bake::Run;
use lightkiln::forecast::forecast;
use lightkiln::import;
use lightkiln::options::{Effect, ImportOptions, Quality};
use lightkiln::scene::{Alpha, Cone, LampKind, Material, Scene};

/// What a reason may say of kinds of things that are not there, and whether there are any.
fn denials(scene: &Scene) -> [(&'static str, bool); 8] {
    let lamps = |kind: &dyn Fn(&LampKind) -> bool| scene.lamps.iter().any(|lamp| kind(&lamp.kind));
    let cone = |kind: &LampKind| match kind {
        LampKind::Point { cone, .. } => Some(*cone),
        LampKind::Sun { .. } => None,
    };
    let is = |wanted: fn(Option<Cone>) -> bool| lamps(&|kind| cone(kind).is_some_and(wanted));
    let materials = |test: &dyn Fn(&Material) -> bool| scene.surfaces.iter().any(|s| test(scene.material(s)));
    [
        ("the scene has no point lamp", is(|cone| cone.is_none())),
        ("the scene has no spot lamp", is(|cone| cone.is_some())),
        ("the scene has no sun", lamps(&|kind| matches!(kind, LampKind::Sun { .. }))),
        ("the scene has no lamps", !scene.lamps.is_empty()),
        ("no material uses alphaMode MASK", materials(&|m| matches!(m.alpha, Alpha::Mask { .. }))),
        ("no material uses alphaMode BLEND", materials(&|m| m.alpha == Alpha::Blend)),
        ("all objects are shaded flat", false),
        ("no mesh stands in several places", {
            let mut uses: Vec<u32> = scene.surfaces.iter().map(|surface| surface.geometry.0).collect();
            uses.sort_unstable();
            uses.windows(2).any(|pair| pair[0] == pair[1])
        }),
    ]
}

#[test]
fn every_scene_has_a_plan_that_is_true() {
    let Some(scenes) = shared_scenes(&["features", "real", "kits"]) else {
        eprintln!("skipped: there is no ../shared/scenes beside the repository");
        return;
    };
    let mut planned_scenes = 0;
    for path in scenes {
        let Ok((_, scene)) = import::load(&path, &ImportOptions::default()) else { continue };
        planned_scenes += 1;
        let at = path.display();
        let plan = planned(&scene);
        for (denial, there_are_some) in denials(&scene) {
            let said = plan.effects.iter().any(|finding| finding.reason == denial);
            assert!(!(said && there_are_some), "{at}: \"{denial}\"");
        }
        for finding in plan.effects.iter().filter(|finding| !finding.on) {
            assert!(!finding.reason.is_empty() && !finding.saving.what.is_empty(), "{at}: {finding:?}");
        }
        // The sky is black in all of them, and nobody forces anything.
        assert!(!finding(&plan, Effect::Sky).on, "{at}");
    }
    assert!(planned_scenes > 200, "{planned_scenes} of the scenes can be read");
}

#[test]
fn forecasts_of_scenes_end_well() {
    let Some(scenes) = shared_scenes(&["features"]) else { return };
    // Every ninth: they take longer than plans.
    for path in scenes.iter().step_by(9) {
        let Ok((_, scene)) = import::load(path, &ImportOptions::default()) else { continue };
        let foreseen = forecast(&scene, &options(Quality::Draft, 64), &Run::default());
        assert!(foreseen.is_ok(), "{}: {foreseen:?}", path.display());
    }
}
