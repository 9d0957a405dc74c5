//! `study accuracy` on a room small enough to be baked fifty times: its measures against arrays worked out by hand, its
//! references, its sweeps, its files. And what makes its two references independent and free of luck.

mod common;

use common::{Builder, mean, options};
use glam::Vec3;
use lightkiln::bake::{Lit, Run, light};
use lightkiln::options::{BakeOptions, LightOptions, Quality};
use lightkiln::scene::Scene;
use lightkiln::study::accuracy::{
    AGREEMENT, By, Errors, Judged, Outcome, accuracy, efforts, errors, find_truth, pareto, read_beside,
};
use lightkiln::study::write;
use std::f32::consts::PI;
use std::time::Instant;

const RADIANCE: f32 = 3.0;
const REFLECTANCE: f32 = 0.6;
const SIZE: Vec3 = Vec3::new(3.0, 2.0, 2.5);
const LAMP: [f32; 2] = [0.8, 0.6];
const PAGE: u32 = 40;

/// A closed grey room with a lamp under its ceiling and a board that throws a shadow.
fn room() -> Scene {
    let mut b = Builder::new();
    let (grey, lamp) = (b.material(REFLECTANCE, 0.0), b.material(0.0, RADIANCE));
    b.room(Vec3::ZERO, SIZE, [grey; 6]);
    b.quad(Vec3::new(1.1, 1.99, 0.9), Vec3::X * LAMP[0], Vec3::Z * LAMP[1], lamp);
    b.scene
}

fn baked(scene: &Scene, effort: &LightOptions) -> Lit {
    let options = BakeOptions { light: effort.clone(), ..options(Quality::Good, PAGE) };
    light(scene, &options, &Run::default()).expect("the scene can be lit")
}

fn silent(_: &str) {}

#[test]
fn what_is_best_is_beaten_by_nothing() {
    let choices = [[1.0, 5.0], [2.0, 3.0], [2.0, 4.0], [3.0, 3.0], [4.0, 1.0], [2.0, 3.0], [9.0, 9.0]];
    // 2, 4 costs as much as 2, 3 and is worse; 3, 3 is no better and costs more; equal ones do not beat each other.
    assert_eq!(pareto(&choices), [true, true, false, false, true, true, false]);
    assert_eq!(pareto(&[]), [false; 0]);
}

#[test]
fn errors_are_what_their_names_say() {
    let truth = [1.0, 1.0, 1.0, 5.0].map(Vec3::splat);
    let found = [Vec3::new(1.3, 1.0, 1.0), Vec3::splat(0.5), Vec3::splat(1.0), Vec3::splat(5.8)];
    // The mean is 2. Errors of the texels, mean of the channels: 0.1, 0.5, 0, 0.8.
    let e = errors(&found, &truth, &[1.0, 1.0, 1.0, 3.0]).unwrap();
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} instead of {b}");
    near(e.rms, (0.01_f64 + 0.25 + 0.64).sqrt() / 2.0 / 2.0);
    near(e.median, 0.25);
    near(e.p95, 0.4);
    near(e.largest, 0.4);
    near(e.bias, (0.1 - 0.5 + 0.8) / 4.0 / 2.0);
    near(e.energy, (0.1 - 0.5 + 2.4) / (3.0 + 15.0));
    assert_eq!(errors(&truth, &truth, &[1.0; 4]), Some(Errors::default()));
    assert_eq!(errors(&[Vec3::ONE], &[Vec3::ZERO], &[1.0]), None, "the dark has no relative error");
    assert_eq!(errors(&[Vec3::ONE], &truth, &[1.0; 4]), None, "other texels");
}

/// Light of few rays is told from converged light, and is baked again with more.
#[test]
fn references_that_disagree_are_found_and_made_better() {
    let scene = room();
    let options = options(Quality::Good, PAGE);
    let few = LightOptions { seed: 1, ..Quality::Draft.light() };
    let find = |list: Vec<LightOptions>| {
        find_truth(&scene, &options, list.into_iter(), &Run::default(), &silent).unwrap()
    };
    let spoiled = find(vec![few.clone()]);
    assert!(!spoiled.agrees() && spoiled.own_error() > AGREEMENT);
    let mended = find([vec![few], efforts().take(1).collect()].concat());
    assert_eq!(mended.rounds.iter().map(|round| round.agrees()).collect::<Vec<_>>(), [false, true]);
    assert!(mended.own_error() <= AGREEMENT, "{}", mended.own_error());
    let dark = Scene { materials: vec![scene.materials[1].clone(); 3], ..scene.clone() };
    let refused = find_truth(&dark, &options, efforts(), &Run::default(), &silent);
    assert!(refused.err().unwrap().to_string().contains("no light"));
}

/// The errors of bakes under different seeds have nothing in common.
#[test]
fn seeds_err_independently_and_repeat_to_the_bit() {
    let scene = room();
    let mut effort = Quality::Draft.light();
    (effort.gather.tolerance, effort.gather.rays) = (0.0, 64);
    let seeded = |seed: u32| baked(&scene, &LightOptions { seed, ..effort.clone() });
    let bits = |lit: &Lit| -> Vec<[u32; 3]> {
        (0..lit.elements.len()).map(|e| lit.irradiance(e).0.to_array().map(f32::to_bits)).collect()
    };
    assert_eq!(bits(&seeded(7)), bits(&seeded(7)));
    let truth = Judged::of(&baked(&scene, &Quality::Reference.light()));
    let found: Vec<Vec<Vec3>> = (0..8).map(|seed| truth.light(&seeded(seed))).collect();
    let own: f64 = found.iter().map(|a| errors(a, &truth.truth, &truth.area).unwrap().rms.powi(2)).sum();
    let (mut between, mut pairs) = (0.0, 0.0);
    for (i, a) in found.iter().enumerate() {
        for b in &found[..i] {
            between += errors(a, b, &truth.area).unwrap().rms.powi(2);
            pairs += 1.0;
        }
    }
    // Of independent errors the squares add up: the ratio is 1. What all seeds err by alike, being no matter of
    // sampling, lowers it; it is 8/7 at the most, and 0 if seeds changed nothing.
    let ratio = between / pairs / (2.0 * own / found.len() as f64);
    assert!((0.6..=8.0 / 7.0 + 1e-3).contains(&ratio), "{ratio}");
}

/// The shadow of a board that is narrower than a texel falls between the places that probes ask for. Where every texel is
/// refined, the light that is missing is that of the board's width.
#[test]
fn no_shadow_is_too_narrow_where_every_texel_is_refined() {
    const WIDTH: f32 = 0.004;
    let mut b = Builder::new();
    let black = b.material(0.0, 0.0);
    let floor = b.quad(Vec3::ZERO, Vec3::Z, Vec3::X, black);
    b.quad(Vec3::new(0.403, 0.5, -0.1), Vec3::Z * 1.2, Vec3::X * WIDTH, black);
    b.sun(Vec3::Y, 1.0, 0.0);
    let mut effort = Quality::Good.light();
    [effort.direct.probe_rays, effort.direct.penumbra_rays] = [0, 1024];
    let lit = baked(&b.scene, &effort);
    let texel = lit.elements.half_u_world[common::nearest(&lit, floor, Vec3::new(0.5, 0.0, 0.5))];
    assert!(texel.length() * 2.0 > 3.0 * WIDTH, "the shadow is narrow");
    let missing: f32 = common::of_surface(&lit, floor)
        .map(|e| (1.0 - lit.irradiance(e).mean()) * lit.elements.area[e].0)
        .sum();
    // A share of 1024 stratified places in a square is off by about 1 in 1024^(3/4) there: 2 % of this shadow.
    assert!((missing / WIDTH - 1.0).abs() < 0.03, "{missing} m² instead of {WIDTH}");
}

fn studied() -> (Scene, Outcome) {
    let scene = room();
    let started = Instant::now();
    let clock = || started.elapsed().as_secs_f64();
    let run = Run { clock: &clock, ..Run::default() };
    let outcome = accuracy("room", &scene, &options(Quality::Good, PAGE), Vec::new(), &run, &silent).unwrap();
    (scene, outcome)
}

#[test]
fn a_study_ranks_effort_by_its_error() {
    let (scene, outcome) = studied();
    assert!(outcome.truth.agrees(), "{}", outcome.truth.own_error());
    // In a closed room the mean is Φ/(A(1 − ρ)) whatever the shape: here both sides of the lamp are black, and take
    // what the mean sends them.
    let lamp = LAMP[0] * LAMP[1];
    let walls = 2.0 * (SIZE.x * SIZE.y + SIZE.y * SIZE.z + SIZE.z * SIZE.x);
    let power = PI * RADIANCE * lamp;
    let absorbed: f64 = (0..outcome.truth.lit.elements.len())
        .map(|e| {
            let elements = &outcome.truth.lit.elements;
            let kept = 1.0 - f64::from(elements.reflectance[e].0.x);
            kept * f64::from(outcome.truth.lit.irradiance(e).mean()) * f64::from(elements.area[e].0)
        })
        .sum();
    // All power ends on surfaces. Midpoint sums over texels 9 cm wide beside a lamp 1 cm under the ceiling.
    assert!((absorbed / f64::from(power) - 1.0).abs() < 0.02, "{absorbed} W of {power} W");
    assert!(mean(&outcome.truth.lit) > f64::from(power / walls));

    let of = |sweep: &str| -> Vec<_> {
        outcome.trials.iter().filter(|trial| trial.sweep == sweep).map(|trial| trial.errors.rms).collect()
    };
    let quality = of("quality");
    assert_eq!(quality.len(), 5);
    // Between neighbouring levels chance may decide; from draft to reference it may not.
    let best = outcome.trials.iter().filter(|t| t.by == By::Texels).map(|t| t.errors.rms);
    assert_eq!(quality[4], best.fold(f64::INFINITY, f64::min), "strict reference is the nearest of all");
    assert!(quality[4] <= 2.0 * AGREEMENT && quality[0] > 2.0 * quality[4], "{quality:?}");
    let (rays, density) = (of("gather rays"), of("density"));
    assert!(rays[0] > 2.0 * rays[rays.len() - 1], "{rays:?}");
    assert!(density[0] > density[1] && density[1] > density[3], "{density:?}");
    let marked: Vec<_> = outcome.trials.iter().filter(|t| t.best && t.by == By::Texels).collect();
    assert!(marked.iter().any(|t| t.errors.rms == quality[4]), "nothing beats the nearest");
    assert!(marked.len() >= 2 && marked.len() < outcome.trials.len());

    // Every solver comes to the end; each point is further than the one before and none is beyond nothing.
    assert_eq!(outcome.traces.len(), 4);
    for trace in &outcome.traces {
        let last = trace.unshot.last().unwrap();
        assert!(last[1] < 1e-10 && last[0] < 1000.0, "{}: {last:?}", trace.solver);
        assert!(trace.unshot.windows(2).all(|pair| pair[0][0] < pair[1][0]), "{}", trace.solver);
    }

    // What is written can be read, beside another study too.
    let folder = tempfile::tempdir().unwrap();
    let study = outcome.study();
    assert!(study.passes());
    assert!(scene.surfaces.len() == 7 && study.pictures.len() == 6 && study.figures.len() == 4);
    assert!(study.pictures.iter().all(|picture| picture.png.starts_with(b"\x89PNG")));
    let files = write(&study, folder.path()).unwrap();
    let rows = read_beside(&files[0]).unwrap();
    assert_eq!(rows.len(), outcome.trials.len());
    for (row, trial) in rows.iter().zip(&outcome.trials) {
        assert_eq!((row.sweep.as_str(), &row.setting), (trial.sweep, &trial.setting));
        assert_eq!((row.rms, row.seconds), (Some(trial.errors.rms), Some(trial.cost.seconds)));
    }
}

#[test]
fn results_of_others_are_read_or_refused_by_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("others.csv");
    let read = |text: &str| {
        std::fs::write(&file, text).unwrap();
        read_beside(&file)
    };
    let rows =
        read("sweep,setting,seconds,rms,memory\nCycles,\"16, raw\",6.5,0.02,\nCycles,64,,,\n").unwrap();
    assert_eq!((rows.len(), rows[0].setting.as_str(), rows[0].rms), (2, "16, raw", Some(0.02)));
    assert_eq!((rows[1].seconds, rows[1].bias), (None, None));
    for (text, named) in [
        ("who,seconds\nCycles,1\n", "needed are the columns"),
        ("sweep,setting,seconds,rms\nCycles,16,fast,0.1\n", "line: 2"),
        ("sweep,setting,seconds,rms\nCycles,16,-1,0.1\n", "not negative"),
        ("sweep,setting,seconds,rms\nCycles,16,NaN,0.1\n", "not negative"),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains(named) && error.contains("others.csv"), "{error}");
    }
    assert!(read_beside(&folder.path().join("none.csv")).is_err());
}
