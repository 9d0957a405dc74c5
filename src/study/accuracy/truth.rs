//! The converged solution that everything is judged by.

use super::measure::{Errors, errors};
use super::{Cost, timed_once};
use crate::bake::{Lit, Run};
use crate::error::{Error, Result};
use crate::export::{self, Metadata};
use crate::import::Document;
use crate::options::{BakeOptions, ExportOptions, LightOptions, Quality};
use crate::resolve;
use crate::scene::Scene;
use crate::units::Irradiance;
use glam::Vec3;
use std::path::{Path, PathBuf};

/// Two references agree when their mean is off by this much at the most, rms as a share of the mean light: then the
/// smallest error that a user is offered, 0.5 %, seems √(0.5² + 0.3²) = 0.58 % at the most, a sixth more than it is.
pub const AGREEMENT: f64 = 3e-3;

/// How often the effort is raised until they do.
const ROUNDS: usize = 2;

/// Seeds of the two: none that a bake uses unless told to.
const SEEDS: [u32; 2] = [0x5eed_0001, 0x5eed_0002];

/// The texels that are judged and what is right there.
#[derive(Clone, Debug, Default)]
pub struct Judged {
    /// Rows of [`crate::elements::Elements`]: valid ones on pages that are written.
    pub element: Vec<u32>,
    /// Their areas, m².
    pub area: Vec<f64>,
    /// Irradiance.
    pub truth: Vec<Vec3>,
}

impl Judged {
    /// The texels of a bake, its light as the truth.
    pub fn of(lit: &Lit) -> Self {
        let exported = lit.elements.charts.iter().filter(|chart| chart.exported);
        let element: Vec<u32> = exported
            .flat_map(|chart| chart.elements.clone())
            .filter(|&e| lit.elements.valid[e as usize])
            .collect();
        let area = element.iter().map(|&e| f64::from(lit.elements.area[e as usize].0)).collect();
        let mut judged = Self { element, area, truth: Vec::new() };
        judged.truth = judged.light(lit);
        judged
    }

    /// The light of another bake of the same texture space at the same texels.
    pub fn light(&self, lit: &Lit) -> Vec<Vec3> {
        self.element.iter().map(|&e| lit.irradiance(e as usize).0).collect()
    }
}

/// A pair of references.
#[derive(Clone, Debug)]
pub struct Round {
    /// The effort of the first.
    pub light: LightOptions,
    /// What each took.
    pub cost: [Cost; 2],
    /// What they differ by.
    pub difference: Errors,
}

impl Round {
    /// What their mean is off by, rms as a share of the mean light, at the most.
    ///
    /// Where errors come from sampling, each has the variance v, their difference 2v and their mean v/2: this is twice
    /// as much, and leaves room for what the cutting into patches adds. To first order in a patch's area the second
    /// reference, with half the patches, errs by 2b where the first errs by b; their difference is b and their mean errs
    /// by 1.5 b: so there is room up to 2v + b² = 2 (v/2 + 2.25 b²), b² = 0.29 v.
    pub fn error(&self) -> f64 {
        self.difference.rms * std::f64::consts::FRAC_1_SQRT_2
    }

    /// Whether they agree well enough to judge others by.
    pub fn agrees(&self) -> bool {
        self.error() <= AGREEMENT
    }
}

/// The truth and how well it is known.
pub struct Truth {
    /// The first reference of the last round: its texture space is that of all bakes.
    pub lit: Lit,
    /// Irradiance of its elements, the mean of the two.
    pub light: Vec<Irradiance>,
    /// What is judged.
    pub judged: Judged,
    /// All pairs, the last one counts.
    pub rounds: Vec<Round>,
}

impl Truth {
    /// What the truth itself is off by, rms as a share of the mean, at the most; see [`Round::error`].
    pub fn own_error(&self) -> f64 {
        self.rounds.last().map_or(f64::INFINITY, Round::error)
    }

    /// Whether the last pair agrees.
    pub fn agrees(&self) -> bool {
        self.rounds.last().is_some_and(Round::agrees)
    }
}

/// Shadow rays of the reference. No probes decide what is refined: where 512 of them do, single texels still differ by a
/// tenth of the mean from one seed to the next, as a shadow border is seen or not that passes between two texels.
const SHADOW_RAYS: [u32; 2] = [0, 4096];

fn first() -> LightOptions {
    let mut first = LightOptions { seed: SEEDS[0], ..Quality::Reference.light() };
    [first.direct.probe_rays, first.direct.penumbra_rays] = SHADOW_RAYS;
    first
}

/// The effort of a converged bake of four times the texels: not all of them are gathered at.
pub fn of_fine_texels() -> LightOptions {
    let mut light = first();
    (light.gather.rays, light.gather.tolerance) = (2048, 0.01);
    light
}

/// Efforts of the first reference, each about four times the one before.
pub fn efforts() -> impl Iterator<Item = LightOptions> {
    let mut next = first();
    std::iter::repeat_with(move || {
        let this = next.clone();
        next.direct.penumbra_rays *= 4;
        next.solve.patches *= 2;
        next.solve.rays_per_patch *= 2;
        next.gather.rays *= 4;
        this
    })
}

/// The second reference beside `first`: other samples, and patches cut otherwise.
pub fn beside(first: &LightOptions) -> LightOptions {
    let mut second = LightOptions { seed: SEEDS[1], ..first.clone() };
    second.solve.patches /= 2;
    second
}

/// Bakes pairs of references with more and more of `efforts` until two agree.
pub fn find(
    scene: &Scene,
    options: &BakeOptions,
    efforts: impl Iterator<Item = LightOptions>,
    run: &Run,
    told: &dyn Fn(&str),
) -> Result<Truth> {
    let mut rounds = Vec::new();
    let mut found = None;
    for (round, light) in efforts.take(ROUNDS).enumerate() {
        let bake = |light: LightOptions, number: usize| {
            told(&format!("reference {number} of 2: {} gather rays a texel", light.gather.rays));
            timed_once(scene, &BakeOptions { light, ..options.clone() }, run)
        };
        let (first, lit) = bake(light.clone(), 1)?;
        let (second, other) = bake(beside(&light), 2)?;
        let judged = Judged::of(&lit);
        let difference = errors(&judged.light(&other), &judged.truth, &judged.area).ok_or_else(|| {
            Error::invalid("the scene", "no light arrives on any lightmap, so there is nothing to study")
        })?;
        let mean = |e: usize| Irradiance((lit.irradiance(e).0 + other.irradiance(e).0) / 2.0);
        let mean: Vec<Irradiance> = (0..lit.elements.len()).map(mean).collect();
        let truth = judged.element.iter().map(|&e| mean[e as usize].0).collect();
        let last = Round { light, cost: [first, second], difference };
        let (agrees, difference) = (last.agrees(), crate::text::percent(difference.rms));
        rounds.push(last);
        found = Some((lit, mean, Judged { truth, ..judged }));
        match (agrees, round + 1 < ROUNDS) {
            (true, _) => told(&format!("the references agree: they differ by {difference} rms")),
            (false, true) => {
                told(&format!("the references differ by {difference} rms: once more, with more rays"))
            }
            (false, false) => told(&format!("the references still differ by {difference} rms")),
        }
        if agrees {
            break;
        }
    }
    let (lit, light, judged) =
        found.ok_or_else(|| Error::invalid("the reference", "no effort to bake it with"))?;
    Ok(Truth { lit, light, judged, rounds })
}

/// Writes the truth as a baked file, `reference.glb` with its pages, 32 bit, beside the study: for others to be judged
/// by. Returns the files.
pub fn write(
    document: &Document,
    scene: &Scene,
    options: &BakeOptions,
    truth: &Truth,
    folder: &Path,
) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
    let Truth { lit, light, rounds, .. } = truth;
    let export = ExportOptions {
        output: Some(folder.join("reference.glb")),
        full_float: true,
        ..ExportOptions::default()
    };
    let lightmap = resolve::resolve(scene, &lit.elements, &lit.atlas, light, export.store);
    let effort = rounds.last().map_or_else(LightOptions::default, |round| round.light.clone());
    let settings = BakeOptions { light: effort, export: export.clone(), ..options.clone() };
    let metadata = Metadata {
        generator: concat!("lightkiln ", env!("CARGO_PKG_VERSION")).to_owned(),
        settings: serde_json::to_value(&settings).unwrap_or_default(),
        convergence: vec![("unshot".to_owned(), lit.light.unshot_fraction)],
        scene: scene.index,
    };
    let written = export::write(document, scene, &lit.atlas, &lightmap, None, &metadata, &export)?;
    Ok(written.files)
}
