//! Hard cases: every classic killer of radiosity with its exact answer beside ours.
//!
//! All cases are built in code, at several sizes and far from the origin, and go through every solver and every method
//! of form factors that applies. What they may be off by follows from the method and is written beside each.

pub mod way;
pub mod world;

pub mod baked;
mod bakes;
mod bodies;
mod check;
mod cube;
mod factors;
mod hard;
mod lamps;
mod limits;
pub mod model;
mod points;
mod same;
mod skies;
mod solutions;
mod sphere;
mod written;

pub use check::Check;
pub use factors::{PARALLEL, PERPENDICULAR};

use super::{Cell, Row, Sheet, Study};
use crate::error::Result;

/// Cases of one kind.
pub struct Group {
    /// One word or two, for programs.
    pub name: &'static str,
    /// For people.
    pub title: &'static str,
    /// Runs all of them.
    pub run: fn() -> Result<Vec<Check>>,
}

/// All of them, from form factors to whole bakes.
pub const GROUPS: &[Group] = &[
    group("parallel", "form factors of parallel rectangles", factors::parallel_rectangles),
    group("perpendicular", "form factors of perpendicular rectangles", factors::perpendicular_rectangles),
    group("closed", "rows, sums and reciprocity in closed rooms", factors::closed_rooms),
    group("needles", "slivers and ratios of area", factors::needles),
    group("discs", "form factors of discs", bodies::discs),
    group("points", "closed forms at a point", points::points),
    group("facets", "spheres seen from inside", bodies::spheres),
    group("furnaces", "white furnaces, solvers alone", solutions::furnaces),
    group("plates", "two plates and the cube's faces, solvers alone", solutions::plates),
    group("shells", "concentric spheres, closed means, extremes, solvers alone", solutions::shells),
    group("integrating", "integrating spheres, solvers alone", solutions::integrating_spheres),
    group("khodulev", "a point light in a cube, solvers alone", cube::khodulev),
    group("baked_furnaces", "white furnaces, whole bakes", bakes::furnaces),
    group("baked_rooms", "a point light in a cube, whole bakes", bakes::rooms),
    group("baked_bodies", "plates and spheres, whole bakes", bakes::bodies),
    group("lamps", "every kind of lamp, whole bakes", lamps::lamps),
    group("skies", "skies, walls and windows, whole bakes", skies::skies),
    group("geometry", "thin walls, duplicates, needles, whole bakes", hard::geometry),
    group(
        "extremes",
        "reflectance, brightness and size at their limits, nothing, nonsense",
        limits::extremes,
    ),
    group("written", "vertices, indices and attributes as files write them, whole bakes", written::writings),
    group("invariance", "turned, moved, scaled, renamed, cut", same::invariance),
];

const fn group(name: &'static str, title: &'static str, run: fn() -> Result<Vec<Check>>) -> Group {
    Group { name, title, run }
}

/// Runs every case; `told` hears which group comes next.
pub fn stability(told: &dyn Fn(&str)) -> Result<Study> {
    let mut results = Vec::new();
    for group in GROUPS {
        told(group.title);
        results.push((group, (group.run)()?));
    }
    Ok(study(&results))
}

fn study(results: &[(&Group, Vec<Check>)]) -> Study {
    Study {
        name: "stability",
        title: "Hard cases and their exact answers".to_owned(),
        text: vec![
            "Every case has an answer that is known without any solver: a closed form, a table computed with 30 digits, \
             or a law of conservation. The error is relative, or absolute where zero is expected; the bound follows from \
             the method, as the last column says, and from nothing that was found here."
                .to_owned(),
            "\"exact\" means to the bit.".to_owned(),
        ],
        sheets: vec![cases(results), summary(results)],
        ..Study::default()
    }
}

fn cases(results: &[(&Group, Vec<Check>)]) -> Sheet {
    let row = |group: &Group, check: &Check| {
        let cells = vec![
            group.title.into(),
            check.case.as_str().into(),
            check.way.as_str().into(),
            check.place.as_str().into(),
            digits(check.expected).into(),
            digits(check.found).into(),
            Cell::Number(check.error()),
            Cell::Number(check.bound),
            if check.holds() { "pass" } else { "FAIL" }.into(),
            check.why.as_ref().into(),
        ];
        Row::judged(cells, check.holds())
    };
    let rows = results.iter().flat_map(|(group, checks)| checks.iter().map(move |check| row(group, check)));
    Sheet {
        name: "cases",
        title: "Cases".to_owned(),
        columns: vec![
            "group",
            "case",
            "method",
            "size and place",
            "expected",
            "ours",
            "error",
            "bound",
            "",
            "where the bound comes from",
        ],
        rows: rows.collect(),
    }
}

/// Each group in one line.
fn summary(results: &[(&Group, Vec<Check>)]) -> Sheet {
    let row = |(group, checks): &(&Group, Vec<Check>)| {
        let passed = checks.iter().filter(|check| check.holds()).count();
        let exact = checks.iter().filter(|check| check.bound == 0.0).count();
        let used = |check: &&Check| if check.bound > 0.0 { check.error() / check.bound } else { 0.0 };
        let nearest = checks.iter().max_by(|a, b| used(a).total_cmp(&used(b)));
        let near = nearest.filter(|check| check.bound > 0.0);
        let words = |check: &Check| {
            let parts = [check.case.as_str(), &check.way, &check.place];
            parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ")
        };
        let cells = vec![
            group.title.into(),
            Cell::Count(checks.len() as u64),
            Cell::Count(passed as u64),
            Cell::Count(exact as u64),
            near.map_or(Cell::Empty, |check| Cell::Number(check.error())),
            near.map_or(Cell::Empty, |check| Cell::Number(check.bound)),
            near.map_or(Cell::Empty, |check| words(check).into()),
        ];
        Row::judged(cells, passed == checks.len())
    };
    Sheet {
        name: "groups",
        title: "Hard cases".to_owned(),
        columns: vec!["group", "cases", "passed", "exact", "error", "bound", "nearest to its bound"],
        rows: results.iter().map(row).collect(),
    }
}

/// Ten digits.
fn digits(number: f64) -> String {
    match number.abs() {
        0.0 => "0".to_owned(),
        x if (1e-3..1e6).contains(&x) => {
            let whole = x.log10().floor().max(0.0) as usize;
            format!("{number:.*}", 9 - whole)
        }
        _ => format!("{number:.9e}"),
    }
}

#[cfg(test)]
mod tests;
