//! What lookups between texels are off by, against closed forms, and pages as wide as that wants them.

mod common;

use common::Builder;
use glam::Vec3;
use lightkiln::Error;
use lightkiln::audit;
use lightkiln::bake::{self, Lit, Run};
use lightkiln::import;
use lightkiln::options::{BakeOptions, ImportOptions, Quality};
use lightkiln::progress::{Observer, Stage};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Points along each side of the square between four texels.
const ACROSS: usize = 8;

/// A floor of 2 m under a lamp half a metre above its middle, which is 1 W/sr.
const HALF: f32 = 1.0;
const HEIGHT: f32 = 0.5;

/// E = I cosθ/d².
fn irradiance(at: Vec3) -> f64 {
    let square = f64::from(at.x).powi(2) + f64::from(at.z).powi(2) + f64::from(HEIGHT).powi(2);
    f64::from(HEIGHT) / square.powf(1.5)
}

fn floor(page: u32) -> Lit {
    let mut b = Builder::new();
    let black = b.material(0.0, 0.0);
    b.quad(Vec3::new(-HALF, 0.0, -HALF), Vec3::Z * 2.0 * HALF, Vec3::X * 2.0 * HALF, black);
    b.point(Vec3::Y * HEIGHT, 1.0);
    b.light(Quality::Good, page)
}

/// Root mean square of what lookups between the centres of the floor's texels are off by, and of the mean.
fn truly_between(lit: &Lit) -> f64 {
    let elements = &lit.elements;
    let chart = elements.charts.iter().find(|chart| chart.exported && !chart.elements.is_empty()).unwrap();
    let page = &elements.pages[chart.page as usize];
    let (mut square, mut count, mut sum) = (0.0, 0.0, 0.0);
    for e in chart.elements.clone() {
        let (texel, size) = (elements.texel[e as usize], page.size_texels as usize);
        sum += irradiance(elements.position_world[e as usize]) / chart.elements.len() as f64;
        let at = |dx: usize, dy: usize| {
            let (x, y) = (usize::from(texel.x) + dx, usize::from(texel.y) + dy);
            let element = *page.element.get(y * size + x)? as usize;
            (x < size && element < elements.len()).then(|| elements.position_world[element])
        };
        let (Some(a), Some(b), Some(c), Some(d)) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1)) else { continue };
        for k in 0..ACROSS * ACROSS {
            let [s, t] = [k % ACROSS, k / ACROSS].map(|k| (k as f32 + 0.5) / ACROSS as f32);
            let truth = irradiance(a.lerp(b, s).lerp(c.lerp(d, s), t));
            let [e, f, g, h] = [a, b, c, d].map(irradiance);
            let [s, t] = [f64::from(s), f64::from(t)];
            let seen = (e * (1.0 - s) + f * s) * (1.0 - t) + (g * (1.0 - s) + h * s) * t;
            square += (seen - truth).powi(2);
            count += 1.0;
        }
    }
    f64::sqrt(square / count) / sum
}

#[test]
fn under_a_lamp_lookups_are_off_by_what_its_closed_form_says() {
    for page in [16, 32, 64, 128] {
        let lit = floor(page);
        let told = audit::between_texels(&lit.elements, &|e| f64::from(lit.irradiance(e as usize).mean()));
        let truth = truly_between(&lit);
        // Bends along both axes are added, as if both always had one sign: right where they have, and up to twice too much
        // in the ring around the lamp where they have not.
        assert!((0.95..1.35).contains(&(told / truth)), "{page}²: {told:.3e} told, {truth:.3e} found");
    }
}

fn fixture(name: &str) -> lightkiln::scene::Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(format!("{name}.glb"));
    import::load(&path, &ImportOptions::default()).unwrap().1
}

fn auto(wanted: f64, widest: u32) -> BakeOptions {
    let mut options = common::options(Quality::Draft, widest);
    (options.atlas.between_texels, options.atlas.max_pages) = (Some(wanted), 1);
    options
}

#[test]
fn pages_are_as_wide_as_the_error_wants_and_no_wider() {
    // Smooth light, light that falls in through a window, bounces in a corridor, and sharp shadows.
    for (name, wanted) in
        [("sealed_hall", 0.005), ("window_room", 0.01), ("corridor", 0.02), ("double_sided", 0.02)]
    {
        let scene = fixture(name);
        let lit = bake::light(&scene, &auto(wanted, 4096), &Run::default()).unwrap();
        let between = |lit: &Lit| lit.light.error_parts.unwrap().between_texels;
        let width = lit.elements.pages.iter().map(|page| page.size_texels).max().unwrap();
        assert!(between(&lit) <= wanted, "{name}: {} between texels of {width}²", between(&lit));
        assert!(!lit.warnings.iter().any(|warning| warning.at == "texel density"), "{name}");
        if width > 128 {
            let mut half = auto(wanted, width / 2);
            half.atlas.between_texels = None;
            let half = bake::light(&scene, &half, &Run::default()).unwrap();
            assert!(between(&half) > 0.8 * wanted, "{name}: {} would do with {}²", between(&half), width / 2);
        }
    }
}

#[test]
fn what_no_page_can_hold_is_told() {
    let lit = bake::light(&fixture("leaves"), &auto(0.005, 256), &Run::default()).unwrap();
    assert_eq!(lit.elements.pages.iter().map(|page| page.size_texels).max(), Some(256));
    let told = lit.warnings.iter().find(|warning| warning.at == "texel density").expect("it is told");
    assert!(told.what.contains("0.5 %"), "{}", told.what);
}

#[test]
fn a_density_and_an_error_between_texels_contradict_each_other() {
    let mut options = auto(0.01, 1024);
    options.atlas.density = Some(10.0);
    let refused = bake::light(&fixture("cornell"), &options, &Run::default()).map(drop).unwrap_err();
    assert!(refused.to_string().contains("density"), "{refused}");
}

/// Stops the bake as soon as pages are looked at.
struct Impatient<'a>(&'a AtomicBool);

impl Observer for Impatient<'_> {
    fn stage(&self, stage: Stage) {
        self.0.fetch_or(stage == Stage::Sizing, Ordering::Relaxed);
    }
}

#[test]
fn a_bake_that_is_stopped_while_it_looks_has_no_light_yet() {
    let stop = AtomicBool::new(false);
    let run = Run { observer: &Impatient(&stop), cancel: &stop, ..Run::default() };
    let ended = bake::light(&fixture("cornell"), &auto(0.01, 1024), &run);
    assert!(matches!(ended, Err(Error::Cancelled)));
}
