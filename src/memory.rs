//! How much memory a bake will want, before it takes it.

use crate::atlas::Atlas;
use crate::error::{Error, Result};
use crate::plan::{Lights, Plan, Shining};
use crate::scene::Scene;

/// Bytes every texel of a page costs, lit or not: the map to elements, the stored value, its copies while it is
/// written.
const PER_TEXEL: u64 = 4 + 12 + 1 + 12;
/// Bytes every element costs: the rows of [`crate::elements::Elements`] (98), direct, coarse and indirect irradiance,
/// radiosity, the sum (12 each), the gather's notes (5) and what audits ask for (2).
const PER_ELEMENT: u64 = 98 + 5 * 12 + 5 + 2;
/// What an element does without where all light comes straight from lamps: coarse irradiance, radiosity, the sum, the
/// gather's notes.
const PER_ELEMENT_REFLECTED: u64 = 3 * 12 + 5;
/// More lights than this may be too many for every texel to ask: the faint ones are then gathered.
const FEW_LIGHTS: usize = 16;
/// Bytes a triangle costs: corners, tree, place in texture space.
const PER_TRIANGLE: u64 = 260;
/// Bytes a patch costs without its form factors.
const PER_PATCH_AT_REST: u64 = 128;
/// Bytes a patch costs: 64 sampled form factors, kept forwards and backwards.
const PER_PATCH: u64 = 64 * 2 * 8 + PER_PATCH_AT_REST;
/// Bytes an element costs while a stage collects what its tasks made; tasks are bounded, so only the first
/// [`MOST_IN_FLIGHT`] elements do.
const PER_ELEMENT_IN_FLIGHT: u64 = 70;
/// Bytes an element that emits costs besides: its radiance in a list that doubles as it grows, and its part in a
/// polygon.
const PER_EMITTING_ELEMENT: u64 = 32;
/// See [`PER_ELEMENT_IN_FLIGHT`].
const MOST_IN_FLIGHT: u64 = 1 << 20;
/// The process itself, its threads and the bytes of a small file.
const BASE: u64 = 9 << 20;

/// Predicts the most memory a bake holds at once, bytes: within 20 %, see `tests/memory.rs`.
pub fn predict(scene: &Scene, atlas: &Atlas, patches: u32) -> u64 {
    let texels: u64 = atlas.pages.iter().map(|p| u64::from(p.size_texels).pow(2)).sum();
    let lit: u64 = atlas
        .pages
        .iter()
        .map(|p| {
            let share = if p.exported { f64::from(atlas.fill) } else { 1.0 };
            ((u64::from(p.size_texels).pow(2) as f64) * share) as u64
        })
        .sum();
    let triangles: u64 = scene.surfaces.iter().map(|s| scene.geometry(s).triangles.len() as u64).sum();
    let textures: u64 =
        scene.textures.iter().map(|t| u64::from(t.size()[0]) * u64::from(t.size()[1]) * 4).sum();
    BASE + texels * PER_TEXEL
        + lit * PER_ELEMENT
        + (lit as f64 * emitting_share(scene)) as u64 * PER_EMITTING_ELEMENT
        + lit.min(MOST_IN_FLIGHT) * PER_ELEMENT_IN_FLIGHT
        + triangles * PER_TRIANGLE
        + textures
        + u64::from(patches) * PER_PATCH
}

/// The same of a bake that follows a plan: without what it leaves out.
pub fn predict_planned(scene: &Scene, atlas: &Atlas, plan: &Plan, patches: u32) -> u64 {
    if plan.work.gather || many_lights(&plan.lights) {
        return predict(scene, atlas, patches);
    }
    let pages = atlas.pages.iter();
    let texels = pages.map(|page| {
        let share = if page.exported { f64::from(atlas.fill) } else { 1.0 };
        f64::from(page.size_texels).powi(2) * share
    });
    predict(scene, atlas, 0) - texels.sum::<f64>() as u64 * PER_ELEMENT_REFLECTED
}

/// Whether there may be more than [`FEW_LIGHTS`]: a glowing surface may be many.
fn many_lights(lights: &Lights) -> bool {
    let lamps = lights.lamps.iter().filter(|&&lamp| lamp != Shining::Not).count();
    lamps > FEW_LIGHTS || lights.surfaces.iter().any(|&surface| surface != Shining::Not)
}

/// Share of the scene's surface that emits.
fn emitting_share(scene: &Scene) -> f64 {
    let (mut emitting, mut all) = (0.0, 0.0);
    for surface in &scene.surfaces {
        let area: f64 = (0..scene.geometry(surface).triangles.len() as u32)
            .map(|triangle| {
                let [a, b, c] = scene.corners_world(surface, triangle).map(|corner| corner.as_dvec3());
                (b - a).cross(c - a).length() / 2.0
            })
            .filter(|area| area.is_finite())
            .sum();
        all += area;
        if scene.material(surface).emission.0.max_element() > 0.0 {
            emitting += area;
        }
    }
    if all > 0.0 { emitting / all } else { 0.0 }
}

/// Refuses a bake that would want more than it may have; tells what it will want, bytes.
pub fn check(
    scene: &Scene,
    atlas: &Atlas,
    plan: &Plan,
    patches: u32,
    limit_bytes: Option<u64>,
    available_bytes: Option<u64>,
) -> Result<u64> {
    let wanted = predict_planned(scene, atlas, plan, patches);
    let too_large = |has: String| {
        let what = format!("the bake wants about {} and {has}", human(wanted));
        Err(Error::TooLarge { at: "memory".into(), what })
    };
    match (limit_bytes, available_bytes) {
        (Some(limit), _) if wanted > limit => {
            too_large(format!("may have {}; lower --density or --page-size, or raise --memory", human(limit)))
        }
        (_, Some(left)) if wanted > left => {
            too_large(format!("{} are left; lower --density, --page-size or --max-pages", human(left)))
        }
        _ => Ok(wanted),
    }
}

/// Form factors may take this much where nobody set a limit, bytes.
const FORM_FACTORS: u64 = 4 << 30;

/// What the bake's limit leaves for form factors, bytes; 4 GiB without one.
pub fn left_for_form_factors(scene: &Scene, atlas: &Atlas, patches: usize, limit_bytes: Option<u64>) -> u64 {
    let rest = predict(scene, atlas, 0) + patches as u64 * PER_PATCH_AT_REST;
    limit_bytes.map_or(FORM_FACTORS, |limit| limit.saturating_sub(rest))
}

fn human(bytes: u64) -> String {
    format!("{:.2} GiB", bytes as f64 / f64::from(1 << 30))
}
