//! What leaving effects out saves, and that it changes nothing: every scene baked as planned, with everything forced
//! on, and with each effect alone forced on.

use super::{Axis, Cell, Figure, Look, Row, Series, Sheet, Study};
use crate::bake::{Lit, Run, light};
use crate::error::Result;
use crate::options::{BakeOptions, Effect, Forced};
use crate::plan::{Finding, Wanted, plan};
use crate::scene::Scene;
use crate::text;

/// Bakes that take less than this are repeated, seconds.
const SHORT_SECONDS: f64 = 2.0;
/// How often; the shortest time counts.
const REPEATS: usize = 3;

/// A scene to study.
pub struct Subject {
    /// What the tables call it.
    pub name: String,
    /// The scene.
    pub scene: Scene,
}

/// A bake with some effects forced on.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// What was forced; `None` is everything at once.
    pub effect: Option<Effect>,
    /// All stages from plan to gather, the shortest of some repetitions.
    pub seconds: f64,
    /// All rays.
    pub rays: u64,
    /// Largest difference of any texel of an exported page from the planned bake, as a share of its mean; infinite
    /// where the texels are not even the same ones.
    pub difference: f64,
    /// How large that may be; see [`bound`].
    pub bound: f64,
}

/// What was found for one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The subject's name.
    pub name: String,
    /// What the plan says of every effect.
    pub findings: Vec<Finding>,
    /// The planned bake.
    pub planned: Trial,
    /// Everything forced, then each effect that can be.
    pub forced: Vec<Trial>,
}

/// How far a bake with a forced effect may be from the planned one, as a share of the mean.
///
/// What is left out is exactly zero, and sums of zeros are exact: no difference is allowed. Sides that are lit in vain are
/// more patches, though: the solver then takes other steps to the same solution, which it knows to its tolerance.
pub fn bound(effect: Option<Effect>, options: &BakeOptions) -> f64 {
    match effect {
        None | Some(Effect::BackFaces | Effect::UnseenSurfaces) => options.light.solve.tolerance,
        Some(_) => 0.0,
    }
}

/// Bakes a scene in all ways.
pub fn compare(subject: &Subject, options: &BakeOptions, run: &Run) -> Result<Outcome> {
    let with = |forced: Forced| BakeOptions { effects: forced, ..options.clone() };
    let (seconds, lit) = timed(&subject.scene, &with(Forced::none()), run)?;
    let planned = Trial { effect: None, seconds, rays: lit.light.rays, difference: 0.0, bound: 0.0 };
    let wanted = |forced| Wanted { forced, ..Wanted::default() };
    let acts = |effect: &Effect| {
        let forced = plan(&subject.scene, &wanted(Forced::one(*effect))).effects;
        forced.iter().any(|finding| finding.forced)
    };
    let trials = [None].into_iter().chain(Effect::ALL.into_iter().filter(acts).map(Some));
    let forced = trials.map(|effect| {
        let (seconds, other) =
            timed(&subject.scene, &with(effect.map_or_else(Forced::all, Forced::one)), run)?;
        Ok(Trial {
            effect,
            seconds,
            rays: other.light.rays,
            difference: difference(&lit, &other),
            bound: bound(effect, options),
        })
    });
    let forced = forced.collect::<Result<_>>()?;
    Ok(Outcome { name: subject.name.clone(), findings: lit.plan.effects, planned, forced })
}

/// The bake and its shortest time.
fn timed(scene: &Scene, options: &BakeOptions, run: &Run) -> Result<(f64, Lit)> {
    let once = || {
        let started = (run.clock)();
        light(scene, options, run).map(|lit| ((run.clock)() - started, lit))
    };
    let (mut best, lit) = once()?;
    for _ in 1..REPEATS {
        if best > 0.0 && best < SHORT_SECONDS {
            best = best.min(once()?.0);
        }
    }
    Ok((best, lit))
}

/// Largest difference of any exported texel, as a share of the first one's mean.
fn difference(a: &Lit, b: &Lit) -> f64 {
    let texels = |lit: &Lit| -> Vec<(u32, u16, u16, u32)> {
        let pages: Vec<u32> =
            (0..).zip(&lit.atlas.pages).filter(|(_, page)| page.exported).map(|(number, _)| number).collect();
        let exported = lit.elements.charts.iter().filter(|chart| chart.exported);
        let mut rows: Vec<_> = exported
            .flat_map(|chart| chart.elements.clone())
            .map(|e| {
                let texel = lit.elements.texel[e as usize];
                let page = pages.iter().position(|&page| page == texel.page).unwrap_or(0);
                (page as u32, texel.y, texel.x, e)
            })
            .collect();
        rows.sort_unstable();
        rows
    };
    let (ours, theirs) = (texels(a), texels(b));
    if ours.len() != theirs.len() {
        return f64::INFINITY;
    }
    let (mut sum, mut most) = (0.0_f64, 0.0_f64);
    for (x, y) in ours.iter().zip(&theirs) {
        if (x.0, x.1, x.2) != (y.0, y.1, y.2) {
            return f64::INFINITY;
        }
        let (one, other) = (a.irradiance(x.3 as usize), b.irradiance(y.3 as usize));
        sum += f64::from(one.mean());
        most = most.max(f64::from((one.0 - other.0).abs().max_element()));
    }
    let mean = sum / ours.len().max(1) as f64;
    match (mean > 0.0, most > 0.0) {
        (true, _) => most / mean,
        (false, true) => f64::INFINITY,
        (false, false) => 0.0,
    }
}

/// Studies scenes; `told` hears which comes next.
pub fn effects(subjects: &[Subject], options: &BakeOptions, run: &Run, told: &dyn Fn(&str)) -> Result<Study> {
    let mut outcomes = Vec::new();
    for subject in subjects {
        told(&subject.name);
        outcomes.push(compare(subject, options, run)?);
    }
    Ok(study(&outcomes))
}

fn study(outcomes: &[Outcome]) -> Study {
    let all = |outcome: &Outcome| outcome.forced.iter().find(|trial| trial.effect.is_none()).cloned();
    let bars = |name: &str, value: &dyn Fn(&Outcome) -> f64| Series {
        name: name.to_owned(),
        look: Look::Bars,
        y: outcomes.iter().map(value).collect(),
        words: outcomes.iter().map(|outcome| outcome.name.clone()).collect(),
        ..Series::default()
    };
    let figure = |title: &str, label: &str, value: &dyn Fn(&Trial) -> f64| Figure {
        title: title.to_owned(),
        y: Axis { label: label.to_owned(), logarithmic: false },
        series: vec![
            bars("planned", &|outcome| value(&outcome.planned)),
            bars("everything forced on", &|outcome| all(outcome).map_or(0.0, |trial| value(&trial))),
        ],
        ..Figure::default()
    };
    Study {
        name: "effects",
        title: "What leaving effects out saves".to_owned(),
        text: vec![
            "Every scene is baked as planned, with every effect forced on, and with each effect alone forced on \
             that the plan leaves out. Seconds are those of all stages from plan to gather, the shortest of some \
             repetitions; the difference is the largest of any texel, as a share of the lightmap's mean."
                .to_owned(),
            "What is left out is proven to add nothing, so the difference must be exactly 0. Surfaces lit in vain \
             are more patches: the solver then takes other steps to the same solution, and the difference is bounded \
             by its tolerance."
                .to_owned(),
        ],
        sheets: vec![trials(outcomes), findings(outcomes)],
        figures: vec![
            figure("Seconds", "seconds, plan to gather", &|trial| trial.seconds),
            figure("Rays", "million rays", &|trial| trial.rays as f64 / 1e6),
        ],
        pictures: Vec::new(),
    }
}

fn trials(outcomes: &[Outcome]) -> Sheet {
    let row = |outcome: &Outcome, what: &str, trial: &Trial| {
        let cells = vec![
            outcome.name.as_str().into(),
            what.into(),
            Cell::Seconds(trial.seconds),
            Cell::Number(trial.seconds / outcome.planned.seconds),
            Cell::Count(trial.rays),
            Cell::Share(trial.difference),
            Cell::Share(trial.bound),
        ];
        Row::judged(cells, trial.difference <= trial.bound)
    };
    let rows = outcomes.iter().flat_map(|outcome| {
        let forced = outcome.forced.iter().map(|trial| {
            let what =
                trial.effect.map_or("everything forced on".to_owned(), |e| format!("with {}", e.name()));
            row(outcome, &what, trial)
        });
        [row(outcome, "planned", &outcome.planned)].into_iter().chain(forced).collect::<Vec<_>>()
    });
    Sheet {
        name: "trials",
        title: "Bakes".to_owned(),
        columns: vec!["scene", "bake", "time", "× planned", "rays", "largest difference", "allowed"],
        rows: rows.collect(),
    }
}

fn findings(outcomes: &[Outcome]) -> Sheet {
    let rows = outcomes.iter().flat_map(|outcome| {
        outcome.findings.iter().map(|finding| {
            Row::plain(vec![
                outcome.name.as_str().into(),
                finding.effect.name().into(),
                if finding.on { "on" } else { "off" }.into(),
                text::printable(&finding.reason).into(),
                finding.saves.as_str().into(),
            ])
        })
    });
    Sheet {
        name: "plans",
        title: "Plans".to_owned(),
        columns: vec!["scene", "effect", "", "why", "what that saves"],
        rows: rows.collect(),
    }
}
