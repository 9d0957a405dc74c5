//! What leaving effects out saves, and that it changes nothing: every scene baked as planned, with everything forced
//! on, and with each effect alone forced on.

mod forecasts;

use super::{Axis, Cell, Figure, Look, Row, Series, Sheet, Study};
use crate::bake::{Lit, Run, light, sized};
use crate::error::Result;
use crate::forecast::{Forecast, forecast};
use crate::options::{BakeOptions, Effect, Forced, LightOptions};
use crate::plan::{Finding, Proven, Solids};
use crate::scene::Scene;
use crate::text;
use std::cell::OnceCell;

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
    /// What reading it took, seconds.
    pub read_seconds: f64,
    /// What a bake of it took that had a process of its own, where that was measured.
    pub cost: Option<Cost>,
}

/// What a bake took from file to file.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Cost {
    /// From start to end, seconds.
    pub seconds: f64,
    /// Most memory resident, bytes, where the system tells.
    pub memory_bytes: Option<u64>,
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
    /// All elements, those on hidden pages included.
    pub elements: u64,
    /// Largest difference of any texel of an exported page from the planned bake, as a share of its mean; infinite
    /// where the texels are not even the same ones.
    pub difference: f64,
    /// The same of texels that have nothing but their own surface within a texel and are not inside a solid; where that
    /// is not 0, of bakes that gather at every texel.
    pub difference_free: f64,
    /// How large the difference may be.
    pub bound: Bound,
}

/// What was found for one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The subject's name.
    pub name: String,
    /// What the plan says of every effect.
    pub findings: Vec<Finding>,
    /// What it foretells.
    pub forecast: Forecast,
    /// The subject's own.
    pub cost: Option<Cost>,
    /// The planned bake.
    pub planned: Trial,
    /// Everything forced, then each effect that can be.
    pub forced: Vec<Trial>,
}

/// How far a bake with a forced effect may be from the planned one, as a share of the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// What is left out is exactly zero, and sums of zeros are exact: nowhere at all.
    Nothing,
    /// This much where nothing but the own surface is within a texel, outside of solids.
    Free(f64),
}

impl Bound {
    /// The bound for an effect; `None` is everything at once.
    ///
    /// What is on the other side of a closed skin is proven to be dark, or unseen; but where something stands on the
    /// skin or pierces it, a patch or a texel lies on both sides of it: lit in vain, the other side gets some of that
    /// patch's light and gives it back where it came from. Of n patches one has a share of 1/n of the light; a place is
    /// given four of them: an estimate. What lies inside a solid for good, such as the end of a leaf in a beam, is lit by
    /// that light alone: there is nothing to be compared with, and nobody to see it ([`Solids`]).
    pub fn of(effect: Option<Effect>, options: &BakeOptions) -> Self {
        match effect {
            None
            | Some(
                Effect::BackFaces
                | Effect::UnseenSurfaces
                | Effect::FarLamps
                | Effect::Sky
                | Effect::LightBetweenRooms,
            ) => Self::Free(4.0 / f64::from(options.light.solve.patches.max(1))),
            Some(_) => Self::Nothing,
        }
    }
}

impl Trial {
    /// Whether the difference is as small as it must be.
    pub fn holds(&self) -> bool {
        match self.bound {
            Bound::Nothing => self.difference == 0.0,
            Bound::Free(bound) => self.difference_free <= bound,
        }
    }
}

/// Bakes a scene in all ways.
pub fn compare(subject: &Subject, given: &BakeOptions, run: &Run) -> Result<Outcome> {
    let options = &sized(&subject.scene, given, run)?;
    // What the light is off by is not the question here.
    let effort = LightOptions { audit_share: 0.0, ..options.light.clone() };
    let with = |forced: Forced| BakeOptions { effects: forced, light: effort.clone(), ..options.clone() };
    let (seconds, lit) = timed(&subject.scene, &with(Forced::none()), run)?;
    let planned = Trial {
        effect: None,
        seconds,
        rays: lit.light.rays,
        elements: lit.elements.len() as u64,
        difference: 0.0,
        difference_free: 0.0,
        bound: Bound::Nothing,
    };
    let (proven, solids) = (Proven::new(&subject.scene, false), Solids::of(&subject.scene));
    let acts = |effect: &Effect| {
        let forced = proven.plan(&Forced::one(*effect)).effects;
        forced.iter().any(|finding| finding.forced)
    };
    let trials = [None].into_iter().chain(Effect::ALL.into_iter().filter(acts).map(Some));
    // Light from inside a solid gets to texels outside through nodes in there that they are interpolated from.
    let strict = |forced: Forced| {
        let mut options = with(forced);
        options.light.gather.tolerance = 0.0;
        light(&subject.scene, &options, run)
    };
    let planned_strictly = OnceCell::new();
    let forced = trials.map(|effect| {
        let wanted = || effect.map_or_else(Forced::all, Forced::one);
        let (seconds, other) = timed(&subject.scene, &with(wanted()), run)?;
        let [difference, mut difference_free] = differences(&lit, &other, &solids);
        let bound = Bound::of(effect, options);
        if bound != Bound::Nothing && difference_free > 0.0 {
            let planned = match planned_strictly.get() {
                Some(planned) => planned,
                None => {
                    let planned = strict(Forced::none())?;
                    planned_strictly.get_or_init(|| planned)
                }
            };
            difference_free = differences(planned, &strict(wanted())?, &solids)[1];
        }
        let (rays, elements) = (other.light.rays, other.elements.len() as u64);
        Ok(Trial { effect, seconds, rays, elements, difference, difference_free, bound })
    });
    let forced = forced.collect::<Result<_>>()?;
    let forecast = forecast(&subject.scene, given, run)?.after_reading(subject.read_seconds);
    let findings = forecast.effects.clone();
    Ok(Outcome { name: subject.name.clone(), findings, forecast, cost: subject.cost, planned, forced })
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

/// Largest difference of any exported texel, and of those that nothing else is near or around, as shares of the first
/// one's mean.
fn differences(a: &Lit, b: &Lit, solids: &Solids) -> [f64; 2] {
    let (ours, theirs) = (texels(a), texels(b));
    if !ours.iter().map(|texel| texel.0).eq(theirs.iter().map(|texel| texel.0)) {
        return [f64::INFINITY; 2];
    }
    let (mut sum, mut most) = (0.0_f64, [0.0_f64; 2]);
    for (&(_, x), &(_, y)) in ours.iter().zip(&theirs) {
        let (one, other) = (a.irradiance(x), b.irradiance(y));
        sum += f64::from(one.mean());
        let difference = f64::from((one.0 - other.0).abs().max_element());
        most[0] = most[0].max(difference);
        let free = difference > most[1] && !a.elements.among_others[x];
        if free && !solids.hold(a.elements.position_world[x]) {
            most[1] = most[1].max(difference);
        }
    }
    let mean = sum / ours.len().max(1) as f64;
    most.map(|most| match (mean > 0.0, most > 0.0) {
        (true, _) => most / mean,
        (false, true) => f64::INFINITY,
        (false, false) => 0.0,
    })
}

/// Texels of exported pages, `(page, row, column)` and element, in that order.
fn texels(lit: &Lit) -> Vec<((usize, u16, u16), usize)> {
    let exported: Vec<usize> =
        (0..lit.atlas.pages.len()).filter(|&page| lit.atlas.pages[page].exported).collect();
    let charts = lit.elements.charts.iter().filter(|chart| chart.exported);
    let place = |e: u32| {
        let texel = lit.elements.texel[e as usize];
        let page = exported.partition_point(|&page| page < texel.page as usize);
        ((page, texel.y, texel.x), e as usize)
    };
    let mut rows: Vec<_> = charts.flat_map(|chart| chart.elements.clone()).map(place).collect();
    rows.sort_unstable();
    rows
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
            "What is left out is proven to add nothing, so the difference must be exactly 0. Only the insides of \
             solids and the outsides of rooms, lit in vain, get and give back some light through patches that lie on \
             both sides of a skin, where things stand on or pierce each other: away from there, and outside of solids, \
             by four patches' share at the most. What an effect saves was foretold from a bake at a lower density."
                .to_owned(),
        ],
        sheets: [summary(outcomes), trials(outcomes)]
            .into_iter()
            .chain(forecasts::sheet(outcomes))
            .chain([findings(outcomes)])
            .collect(),
        figures: vec![
            figure("Seconds", "seconds, plan to gather", &|trial| trial.seconds),
            figure("Rays", "million rays", &|trial| trial.rays as f64 / 1e6),
        ],
        pictures: Vec::new(),
    }
}

/// One row a scene: what the plan saves in all.
fn summary(outcomes: &[Outcome]) -> Sheet {
    let row = |outcome: &Outcome| {
        let all = outcome.forced.iter().find(|trial| trial.effect.is_none())?;
        let off = outcome.findings.iter().filter(|finding| !finding.on).count();
        let most = outcome.forced.iter().map(|trial| trial.difference).fold(0.0, f64::max);
        let cells = vec![
            outcome.name.as_str().into(),
            format!("{off} of {}", outcome.findings.len()).into(),
            Cell::Seconds(outcome.planned.seconds),
            Cell::Seconds(all.seconds),
            Cell::Number(all.seconds / outcome.planned.seconds),
            Cell::Count(outcome.planned.rays),
            Cell::Count(all.rays),
            Cell::Share(most),
        ];
        Some(Row::judged(cells, outcome.forced.iter().all(Trial::holds)))
    };
    Sheet {
        name: "summary",
        title: "What the plan saves".to_owned(),
        columns: vec![
            "scene",
            "effects off",
            "planned",
            "all forced",
            "× planned",
            "rays",
            "all forced ",
            "largest difference",
        ],
        rows: outcomes.iter().filter_map(row).collect(),
    }
}

fn trials(outcomes: &[Outcome]) -> Sheet {
    let row = |outcome: &Outcome, what: &str, trial: &Trial| {
        let finding = outcome.findings.iter().find(|finding| Some(finding.effect) == trial.effect);
        let off = finding.filter(|finding| finding.can_be_forced);
        let foretold = off.and_then(|finding| finding.saving.rays());
        let more = |now: u64, before: u64| match now.checked_sub(before) {
            Some(more) => Cell::Count(more),
            None => Cell::Number(now as f64 - before as f64),
        };
        let cells = vec![
            outcome.name.as_str().into(),
            what.into(),
            Cell::Seconds(trial.seconds),
            Cell::Number(trial.seconds / outcome.planned.seconds),
            Cell::Count(trial.rays),
            off.map_or(Cell::Empty, |_| more(trial.rays, outcome.planned.rays)),
            foretold.map_or(Cell::Empty, Cell::Count),
            off.map_or(Cell::Empty, |_| more(trial.elements, outcome.planned.elements)),
            Cell::Share(trial.difference),
            Cell::Share(trial.difference_free),
            match trial.bound {
                Bound::Nothing => "0 %".into(),
                Bound::Free(bound) => format!("{} away from others", text::percent(bound)).into(),
            },
        ];
        Row::judged(cells, trial.holds())
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
        columns: vec![
            "scene",
            "bake",
            "time",
            "× planned",
            "rays",
            "more rays",
            "foretold",
            "more texels",
            "largest difference",
            "away from others",
            "allowed",
        ],
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
                finding.saving.text().into(),
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
