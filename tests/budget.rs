//! The estimate of the error against the error itself, and the goals that follow it: tolerance, time, snapshots.
//!
//! The truth is two bakes with other samples, at every texel, with eight times as many gather rays as `good`. They err
//! too, at contacts by as much as `high`; but the product of what a bake differs from the one and from the other by is
//! right on average for its squared error, whatever two that err independently are off by themselves.

mod common;

use lightkiln::bake::{self, Lit, Run};
use lightkiln::import;
use lightkiln::options::{BakeOptions, Goal, ImportOptions, LightOptions, Quality};
use lightkiln::progress::{Observer, Stage};
use lightkiln::scene::Scene;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// What an estimate may be off by.
const FACTOR: f64 = 1.5;
/// Errors below this share of the mean are nothing: half floats round by half of that.
const NOTHING: f64 = 1e-3;
/// What two estimates one after the other may differ by: half a factor each.
const SURELY: f64 = 1.22;
/// What a tolerance may cost where a level reaches it, in rays of the cheapest one: a draft, which costs no more than that; a pass
/// that aims at 0.85 of the tolerance, for which rays grow by the power 2/1.2, 1.31; and 0.18 of both for audits.
const COSTLIEST: f64 = 1.18 * (1.0 + 1.31);
const PAGE: u32 = 128;
const LEVELS: [Quality; 4] = [Quality::Draft, Quality::Preview, Quality::Good, Quality::High];

fn path_of(fixture: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(format!("{fixture}.glb"))
}

fn scene_of(fixture: &str) -> Scene {
    import::load(&path_of(fixture), &ImportOptions::default()).expect("the fixture can be read").1
}

fn options(quality: Quality) -> BakeOptions {
    let mut options = common::options(quality, PAGE);
    options.atlas.max_pages = 1;
    options
}

fn lit(scene: &Scene, options: &BakeOptions) -> Lit {
    bake::light(scene, options, &Run::default()).expect("it can be lit")
}

fn truth(scene: &Scene) -> [Lit; 2] {
    [77, 78].map(|seed| {
        let mut options = options(Quality::Reference);
        options.light.direct.probe_rays = 0;
        options.light.direct.penumbra_rays = 1024;
        options.light.gather.rays = 2048;
        options.light.seed = seed;
        options.light.audit_share = 0.0;
        lit(scene, &options)
    })
}

/// The error as `lightkiln::audit` defines it.
fn error(lit: &Lit, truth: &[Lit; 2]) -> f64 {
    let charts = lit.elements.charts.iter().filter(|chart| chart.exported);
    let elements = charts.flat_map(|chart| chart.elements.clone()).map(|e| e as usize);
    let (mut square, mut mean, mut count) = (0.0, 0.0, 0.0);
    for e in elements.filter(|&e| lit.elements.valid[e]) {
        let found = f64::from(lit.irradiance(e).mean());
        let [one, other] = [0, 1].map(|k| f64::from(truth[k].irradiance(e).mean()));
        square += (found - one) * (found - other);
        mean += (one + other) / 2.0;
        count += 1.0;
    }
    let count = f64::max(count, 1.0);
    f64::max(square / count, 0.0).sqrt() / f64::max(mean / count, f64::MIN_POSITIVE)
}

/// Estimates at every level, and what tolerances reach.
fn holds(fixture: &str) {
    let scene = scene_of(fixture);
    let truth = truth(&scene);
    let mut levels = Vec::new();
    for quality in LEVELS {
        let lit = lit(&scene, &options(quality));
        let error = error(&lit, &truth);
        levels.push((error, lit.light.rays));
        let Some(estimate) = lit.light.estimated_error else {
            assert_eq!(error, 0.0, "{fixture}, {quality:?}: no estimate, and an error");
            continue;
        };
        let within = (error / FACTOR..=error * FACTOR).contains(&estimate);
        let same = within || (estimate < NOTHING && error < NOTHING);
        assert!(same, "{fixture}, {quality:?}: {estimate:.5} estimated, {error:.5} found");
    }
    for wanted in [0.02, 0.01, 0.005] {
        let lit = lit(&scene, &BakeOptions { goal: Goal::Tolerance(wanted), ..options(Quality::Good) });
        let error = error(&lit, &truth);
        let given_up = lit.warnings.iter().any(|warning| warning.at == "tolerance");
        let best = levels.iter().filter(|(error, _)| *error <= wanted).map(|(_, rays)| *rays).min();
        let cost = best.map_or(0.0, |best| lit.light.rays as f64 / best as f64);
        assert!(
            cost <= COSTLIEST,
            "{fixture}: {wanted} costs {cost:.2} times the cheapest level that reaches it"
        );
        assert!(error <= FACTOR * wanted, "{fixture}: {error:.5} for a tolerance of {wanted}");
        assert!(!given_up, "{fixture}: a tolerance of {wanted} is in reach");
    }
}

macro_rules! fixtures {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            holds(stringify!($name));
        })*
    };
}

fixtures! {
    blend_glass closed_furnace cornell corridor double_sided emissive_texture grey_hall grey_lamp instances leaves
    lone_pedestal sealed_hall skinned unlit_and_names window_room
}

#[test]
fn every_fixture_is_held() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures");
    let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let scenes = names.filter(|path| path.extension().is_some_and(|extension| extension == "glb"));
    let source = include_str!("budget.rs");
    let list = source.split_once("fixtures! {").unwrap().1.split_once('}').unwrap().0;
    for scene in scenes {
        let name = scene.file_stem().unwrap().to_str().unwrap().to_owned();
        assert!(list.split_whitespace().any(|held| held == name), "{name} is not held");
    }
}

/// Writes down what it hears.
#[derive(Default)]
struct Ear {
    errors: Mutex<Vec<f64>>,
    passes: Mutex<Vec<f64>>,
    unfinished: Mutex<Vec<f64>>,
}

impl Observer for Ear {
    fn error(&self, share: f64) {
        self.errors.lock().unwrap().push(share);
    }
    fn pass(&self, number: usize, _: &LightOptions, usual_error: f64) {
        let mut passes = self.passes.lock().unwrap();
        passes.push(usual_error);
        assert_eq!(passes.len(), number);
    }
    fn unfinished(&self, share: f64) {
        self.unfinished.lock().unwrap().push(share);
    }
}

#[test]
fn a_tolerance_is_approached_from_above_and_costs_what_it_must() {
    let scene = scene_of("cornell");
    let mut rays = 0;
    for wanted in [0.04, 0.02, 0.01] {
        let ear = Ear::default();
        let options = BakeOptions { goal: Goal::Tolerance(wanted), ..options(Quality::Good) };
        let lit = bake::light(&scene, &options, &Run { observer: &ear, ..Run::default() }).unwrap();
        let errors = ear.errors.into_inner().unwrap();
        // Each of them is an estimate of its own.
        assert!(errors.windows(2).all(|pair| pair[1] < SURELY * pair[0]), "{errors:?}");
        let last = *errors.last().expect("it is audited");
        assert!(last <= wanted && (errors.len() == 1 || last < errors[0]), "{wanted}: {errors:?}");
        assert_eq!(ear.passes.into_inner().unwrap().len(), errors.len());
        assert_eq!(lit.light.estimated_error, errors.last().copied());
        assert!(lit.light.rays > rays, "{wanted} costs no more than twice that");
        rays = lit.light.rays;
    }
}

#[test]
fn what_is_not_gathered_yet_is_told_and_falls() {
    let ear = Ear::default();
    let mut options = options(Quality::Good);
    options.atlas.page_size = 256;
    let lit = bake::light(&scene_of("cornell"), &options, &Run { observer: &ear, ..Run::default() }).unwrap();
    let unfinished = ear.unfinished.into_inner().unwrap();
    // The coarse solution is off by some percent; where nodes come close together there is little left, and it is hard.
    let (first, last) = (unfinished[0], *unfinished.last().unwrap());
    assert!((0.005..0.3).contains(&first) && last < first / 2.0, "{unfinished:?}");
    let doubled = unfinished.windows(2).any(|pair| pair[1] > 2.0 * pair[0]);
    assert!(unfinished.len() >= 4 && !doubled, "{unfinished:?}");
    let usual = ear.passes.into_inner().unwrap();
    let found = lit.light.estimated_error.unwrap();
    assert!(usual.len() == 1 && (found / 2.0..found * 2.0).contains(&usual[0]), "{usual:?} for {found}");
}

#[test]
fn what_cannot_be_reached_is_told_with_what_was() {
    let scene = scene_of("grey_hall");
    let mut options = BakeOptions { goal: Goal::Tolerance(1e-7), ..options(Quality::Good) };
    options.atlas.page_size = 16;
    let lit = lit(&scene, &options);
    let reached = lit.light.estimated_error.unwrap();
    let told =
        lit.warnings.iter().any(|warning| warning.at == "tolerance" && warning.what.contains("reached"));
    assert!(told || reached <= 1e-7, "{reached}, {:?}", lit.warnings);
}

#[test]
fn an_estimate_costs_a_tenth_at_most() {
    let scene = scene_of("window_room");
    let mut options = options(Quality::Good);
    options.atlas.page_size = 512;
    let lit = lit(&scene, &options);
    let audit = lit.stages.iter().find(|report| report.stage == Stage::Audit).unwrap();
    assert!(audit.rays * 10 < lit.light.rays, "{} of {}", audit.rays, lit.light.rays);
}

#[test]
fn a_tolerance_gives_the_same_light_for_any_number_of_threads() {
    let scene = scene_of("window_room");
    let options = BakeOptions { goal: Goal::Tolerance(0.02), ..options(Quality::Good) };
    let with = |threads| {
        let run = Run { threads: Some(threads), ..Run::default() };
        bake::light(&scene, &options, &run).unwrap()
    };
    let (one, more) = (with(1), with(5));
    assert_eq!((one.direct, one.indirect), (more.direct, more.indirect));
    assert_eq!(one.light, more.light);
}

/// A clock that every look at it moves on: time as the stages' own work tells it, however loaded the machine is.
struct WorkClock(AtomicU64);

impl WorkClock {
    /// Seconds that a look takes: stages look at it about once a gather.
    const LOOK_S: f64 = 1e-4;

    fn now(&self) -> f64 {
        self.0.fetch_add(1, Ordering::Relaxed) as f64 * Self::LOOK_S
    }
}

#[test]
fn time_is_kept_and_more_of_it_is_better() {
    let scene = scene_of("cornell");
    let truth = truth(&scene);
    let mut before = f64::INFINITY;
    for seconds in [2.0, 4.0] {
        let clock = WorkClock(AtomicU64::new(0));
        let options = BakeOptions { goal: Goal::Seconds(seconds), ..options(Quality::Good) };
        let run = Run { clock: &|| clock.now(), ..Run::default() };
        let lit = bake::light(&scene, &options, &run).unwrap();
        let took = clock.now();
        let too_short = lit.warnings.iter().any(|warning| warning.at == "time");
        assert!(too_short || took <= 1.1 * seconds, "{took} s of {seconds}");
        let error = error(&lit, &truth);
        assert!(error < before, "{error} after {seconds} s, {before} after less");
        before = error;
    }
}

#[test]
fn no_time_at_all_gives_the_draft_and_says_so() {
    let scene = scene_of("grey_lamp");
    let clock = WorkClock(AtomicU64::new(0));
    let options = BakeOptions { goal: Goal::Seconds(1e-3), ..options(Quality::Good) };
    let lit = bake::light(&scene, &options, &Run { clock: &|| clock.now(), ..Run::default() }).unwrap();
    assert!(lit.warnings.iter().any(|warning| warning.at == "time"), "{:?}", lit.warnings);
    let draft = self::lit(&scene, &self::options(Quality::Draft));
    assert_eq!((lit.direct, lit.indirect), (draft.direct, draft.indirect));
}

/// Reads what the bake wrote so far whenever a stage begins or an error is told.
struct Reader {
    page: PathBuf,
    seen: Mutex<Vec<Vec<u8>>>,
}

impl Reader {
    fn read(&self) {
        let mut seen = self.seen.lock().unwrap();
        if let Ok(bytes) = std::fs::read(&self.page)
            && seen.last() != Some(&bytes)
        {
            seen.push(bytes);
        }
    }
}

impl Observer for Reader {
    fn stage(&self, _: Stage) {
        self.read();
    }
    fn advance(&self, _: Stage, _: u64, _: u64) {
        self.read();
    }
}

#[test]
fn snapshots_are_whole_and_each_is_nearer_to_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("cornell.glb");
    std::fs::copy(path_of("cornell"), &input).unwrap();
    let reader = Reader { page: folder.path().join("cornell.baked.lightmap0.exr"), seen: Mutex::default() };
    let mut options = options(Quality::High);
    options.export.full_float = true;
    let clock = WorkClock(AtomicU64::new(0));
    let run = Run {
        observer: &reader,
        clock: &|| clock.now(),
        snapshot_every_s: Some(0.5 * WorkClock::LOOK_S),
        threads: Some(1),
        ..Run::default()
    };
    bake::bake(&input, &options, &run).unwrap();
    reader.read();
    let seen = reader.seen.into_inner().unwrap();
    assert!(seen.len() >= 3, "{} snapshots", seen.len());
    let pages: Vec<Vec<f32>> = seen
        .iter()
        .map(|bytes| {
            let image = lightkiln::export::decode_exr("snapshot", bytes).expect("it is whole");
            image.value.iter().map(|rgb| (rgb.x + rgb.y + rgb.z) / 3.0).collect()
        })
        .collect();
    let end = pages.last().unwrap();
    let off = |page: &Vec<f32>| page.iter().zip(end).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
    let off: Vec<f64> = pages.iter().map(off).collect();
    assert!(off.windows(2).all(|pair| pair[1] < pair[0]), "{off:?}");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(!left.iter().any(|name| name.to_string_lossy().ends_with(".tmp")), "{left:?}");
}

/// Runs `lightkiln bake cornell.glb` in a folder of its own; exit code, report, what was said.
fn typed(arguments: &str) -> (Option<i32>, serde_json::Value, String) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(path_of("cornell"), folder.path().join("cornell.glb")).unwrap();
    let mut command = assert_cmd::Command::new(assert_cmd::cargo::cargo_bin!("lightkiln"));
    command.current_dir(folder.path()).args(["bake", "cornell.glb", "--page-size", "64", "--report", "-"]);
    let output = command.args(arguments.split_whitespace()).output().unwrap();
    let report = serde_json::from_slice(&output.stdout).unwrap_or_default();
    (output.status.code(), report, String::from_utf8(output.stderr).unwrap())
}

#[test]
fn goals_are_typed_and_told() {
    let (code, report, said) = typed("--tolerance 5%");
    assert_eq!(code, Some(0), "{said}");
    assert!(report["light"]["estimated_error"].as_f64().is_some_and(|error| error <= 0.05), "{said}");
    assert!(said.contains("error about"), "{said}");
    let (code, report, said) = typed("--time 1ms --snapshot-every 1ms");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("warning: time: even a draft takes longer"), "{said}");
    assert_eq!(report["settings"]["goal"]["seconds"], 0.001);
    for wrong in ["--tolerance 2", "--time 5", "--tolerance 1% --quality high", "--time 1s --tolerance 1%"] {
        assert_eq!(typed(wrong).0, Some(2), "{wrong}");
    }
}
