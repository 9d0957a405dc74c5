//! What was found, as tables, plots and pictures.

use super::{AGREEMENT, By, Errors, Outcome, Round, Trial, maps, pareto};
use crate::study::{Axis, Cell, Figure, Look, Mark, Row, Series, Sheet, Study};
use crate::text;

pub fn study(outcome: &Outcome) -> Study {
    Study {
        name: "accuracy",
        title: format!("What accuracy costs: {}", outcome.name),
        text: words(outcome),
        sheets: vec![trials(outcome), references(outcome)],
        figures: figures(outcome),
        pictures: outcome.maps.clone(),
    }
}

fn words(outcome: &Outcome) -> Vec<String> {
    let truth = &outcome.truth;
    let own = text::percent(truth.own_error());
    let verdict = if truth.agrees() {
        format!(
            "By what the two differ, their mean, which is the reference, is off by {own} rms at the most."
        )
    } else {
        format!(
            "By what the two differ, their mean, which is the reference, may be off by {own} rms, more than the {} \
             that was asked for: errors of that size say nothing.",
            text::percent(AGREEMENT)
        )
    };
    vec![
        format!(
            "The same scene is baked with more and with less effort, one setting changed at a time, and compared \
             texel by texel with a reference that is gathered at each of its {} texels. The error of a texel is \
             |E − E_ref|, mean of red, green and blue, as a share of the mean of E_ref.",
            text::count(truth.judged.element.len() as u64)
        ),
        format!(
            "The reference is baked twice, with samples that no other bake uses; the second has half the patches. \
             {verdict}"
        ),
        "Seconds are those of all stages from plan to gather, the shortest of some repetitions where they are few. \
         Memory is foretold from texels, triangles, patches and form factors. Rows that no other beats both in time \
         and in rms error are marked. Bakes of other densities have other texels: they are compared by bilinear \
         lookup, as a viewer shows them, at the texels of a converged bake of twice the density, and only with each \
         other."
            .to_owned(),
        maps::legend(),
    ]
}

fn trials(outcome: &Outcome) -> Sheet {
    let errors = |errors: &Errors| {
        let Errors { rms, median, p95, largest, bias, energy } = *errors;
        [rms, median, p95, largest, bias, energy].map(Cell::Share)
    };
    let share = |value: Option<f64>| value.map_or(Cell::Empty, Cell::Share);
    let own = outcome.trials.iter().map(|trial| {
        let Trial { sweep, setting, cost, best, .. } = trial;
        let mut cells = vec![
            (*sweep).into(),
            setting.as_str().into(),
            Cell::Seconds(cost.seconds),
            Cell::Count(cost.rays),
            Cell::Bytes(cost.memory_bytes),
        ];
        cells.extend(errors(&trial.errors));
        cells.push(share(cost.estimated_error));
        Row { cells, mark: if *best { Mark::Best } else { Mark::Plain } }
    });
    let beside = outcome.beside.iter().map(|other| {
        Row::plain(vec![
            other.sweep.as_str().into(),
            other.setting.as_str().into(),
            other.seconds.map_or(Cell::Empty, Cell::Seconds),
            other.rays.map_or(Cell::Empty, Cell::Count),
            Cell::Empty,
            share(other.rms),
            share(other.median),
            share(other.p95),
            share(other.largest),
            share(other.bias),
            share(other.energy),
            Cell::Empty,
        ])
    });
    let columns = [
        "sweep",
        "setting",
        "seconds",
        "rays",
        "memory",
        "rms",
        "median",
        "95th percentile",
        "largest",
        "bias",
        "energy",
        "rms estimated",
    ];
    Sheet {
        name: "trials",
        title: format!("Bakes of {}, errors as shares of the mean", outcome.name),
        columns: columns.to_vec(),
        rows: own.chain(beside).collect(),
    }
}

fn references(outcome: &Outcome) -> Sheet {
    let rounds = &outcome.truth.rounds;
    let row = |(i, round): (usize, &Round)| {
        let [first, second] = &round.cost;
        let cells = vec![
            Cell::Count(round.light.gather.rays.into()),
            Cell::Count(round.light.direct.penumbra_rays.into()),
            Cell::Count(round.light.solve.patches.into()),
            Cell::Seconds(first.seconds + second.seconds),
            Cell::Count(first.rays + second.rays),
            Cell::Share(round.difference.rms),
            Cell::Share(round.difference.median),
            Cell::Share(round.difference.largest),
            Cell::Share(round.difference.bias),
            Cell::Share(round.error()),
            Cell::Share(AGREEMENT),
        ];
        // What was made better afterwards is no failure.
        Row::judged(cells, round.agrees() || i + 1 < rounds.len())
    };
    Sheet {
        name: "references",
        title: "The two references: what they differ by".to_owned(),
        columns: vec![
            "gather rays",
            "penumbra rays",
            "patches",
            "seconds of both",
            "rays of both",
            "rms",
            "median",
            "largest",
            "bias",
            "rms of their mean",
            "allowed",
        ],
        rows: rounds.iter().enumerate().map(row).collect(),
    }
}

fn figures(outcome: &Outcome) -> Vec<Figure> {
    let log = |label: &str| Axis { label: label.to_owned(), logarithmic: true };
    let percent = "rms error, % of the mean";
    let by_seconds = Figure {
        title: "Error against time".to_owned(),
        x: log("seconds, plan to gather"),
        y: log(percent),
        series: against(outcome, By::Texels, &|trial| trial.cost.seconds, Some(&|seconds| seconds)),
    };
    let by_rays = Figure {
        title: "Error against rays".to_owned(),
        x: log("million rays"),
        y: log(percent),
        series: against(outcome, By::Texels, &|trial| trial.cost.rays as f64 / 1e6, None),
    };
    let convergence = Figure {
        title: "Convergence of the coarse solution".to_owned(),
        x: Axis { label: "passes over all form factors".to_owned(), logarithmic: false },
        y: log("unshot power, share of all reflected power"),
        series: outcome
            .traces
            .iter()
            .map(|trace| Series {
                name: trace.solver.to_owned(),
                x: trace.unshot.iter().map(|point| point[0]).collect(),
                y: trace.unshot.iter().map(|point| point[1]).collect(),
                ..Series::default()
            })
            .collect(),
    };
    let density = Figure {
        title: "Texel density: error at points of the surfaces against time".to_owned(),
        x: log("seconds, plan to gather"),
        y: log(percent),
        series: against(outcome, By::Places, &|trial| trial.cost.seconds, None),
    };
    vec![by_seconds, by_rays, convergence, density]
}

/// A line for each sweep, one for the best of all, and the points of others where they have a place on the axis.
fn against(
    outcome: &Outcome,
    by: By,
    x: &dyn Fn(&Trial) -> f64,
    of_others: Option<&dyn Fn(f64) -> f64>,
) -> Vec<Series> {
    let mut series: Vec<Series> = Vec::new();
    let mut add = |name: &str, look: Look, x: f64, rms: f64, words: String| {
        if !(x > 0.0 && rms > 0.0) {
            return;
        }
        let at = series.iter().position(|known| known.name == name).unwrap_or_else(|| {
            series.push(Series { name: name.to_owned(), look, ..Series::default() });
            series.len() - 1
        });
        let line = &mut series[at];
        line.x.push(x);
        line.y.push(rms * 100.0);
        line.words.push(words);
    };
    for trial in outcome.trials.iter().filter(|trial| trial.by == by) {
        let words = format!("{} {}", trial.sweep, trial.setting);
        add(trial.sweep, Look::Lines, x(trial), trial.errors.rms, words);
    }
    if let Some(of_others) = of_others {
        for other in &outcome.beside {
            if let (Some(seconds), Some(rms)) = (other.seconds, other.rms) {
                let words = format!("{}, {}", other.sweep, other.setting);
                add(&other.sweep, Look::Lines, of_others(seconds), rms, words);
            }
        }
    }
    let mut best: Vec<[f64; 2]> = outcome
        .trials
        .iter()
        .filter(|trial| trial.by == by)
        .map(|trial| [x(trial), trial.errors.rms])
        .collect();
    let marked = pareto(&best);
    let mut kept = marked.into_iter();
    best.retain(|_| kept.next() == Some(true));
    best.sort_by(|a, b| a[0].total_cmp(&b[0]));
    for [x, rms] in best {
        add("no better one", Look::Front, x, rms, String::new());
    }
    series
}
