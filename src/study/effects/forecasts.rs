//! What `plan` foretells against what a bake took.

use super::{Cost, Outcome};
use crate::forecast::Forecast;
use crate::study::{Cell, Row, Sheet};

/// A forecast of seconds holds within this factor.
const SECONDS_FACTOR: f64 = 1.5;
/// Seconds that two runs of the same bake differ by, whatever the scene: starting threads, the system's own work.
const SECONDS_JITTER: f64 = 0.05;
/// A forecast of memory holds within this share.
const MEMORY_SHARE: f64 = 0.2;

/// Whether a forecast was right about the seconds, and about the memory.
pub(super) fn holds(forecast: &Forecast, cost: &Cost) -> [bool; 2] {
    let [told, took] = [forecast.seconds(), cost.seconds];
    let seconds =
        told <= took * SECONDS_FACTOR + SECONDS_JITTER && took <= told * SECONDS_FACTOR + SECONDS_JITTER;
    let memory = cost
        .memory_bytes
        .is_none_or(|took| (forecast.memory_bytes as f64 / took as f64 - 1.0).abs() <= MEMORY_SHARE);
    [seconds, memory]
}

pub(super) fn sheet(outcomes: &[Outcome]) -> Option<Sheet> {
    let rows: Vec<Row> = outcomes
        .iter()
        .filter_map(|outcome| Some((outcome, outcome.cost.as_ref()?)))
        .map(|(outcome, cost)| {
            let forecast = &outcome.forecast;
            let memory = cost.memory_bytes;
            let cells = vec![
                outcome.name.as_str().into(),
                Cell::Seconds(forecast.seconds()),
                Cell::Seconds(cost.seconds),
                Cell::Number(forecast.seconds() / cost.seconds),
                Cell::Bytes(forecast.memory_bytes),
                memory.map_or(Cell::Empty, Cell::Bytes),
                memory.map_or(Cell::Empty, |took| Cell::Number(forecast.memory_bytes as f64 / took as f64)),
                Cell::Count(forecast.rays),
                Cell::Count(outcome.planned.rays),
            ];
            Row::judged(cells, holds(forecast, cost) == [true; 2])
        })
        .collect();
    (!rows.is_empty()).then(|| Sheet {
        name: "forecasts",
        title: "Forecasts and what it took, files read and written too".to_owned(),
        columns: vec![
            "scene",
            "time foretold",
            "time",
            "foretold / took",
            "memory foretold",
            "memory",
            "foretold / took ",
            "rays foretold",
            "rays",
        ],
        rows,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Stage;

    #[test]
    fn a_forecast_holds_within_its_factor() {
        let forecast = |seconds| Forecast {
            stages: vec![(Stage::Direct, seconds)],
            memory_bytes: 100,
            ..Forecast::default()
        };
        let cost = |seconds, memory_bytes| Cost { seconds, memory_bytes };
        assert_eq!(holds(&forecast(10.0), &cost(14.9, Some(120))), [true, true]);
        assert_eq!(holds(&forecast(10.0), &cost(15.1, Some(126))), [false, false]);
        assert_eq!(holds(&forecast(15.0), &cost(9.9, None)), [false, true]);
        assert_eq!(holds(&forecast(0.01), &cost(0.05, Some(84))), [true, true], "too short to tell");
    }
}
