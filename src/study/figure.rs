//! Plots and pictures as plain data.

use serde::Serialize;

/// A plot.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figure {
    /// One line.
    pub title: String,
    /// Along the bottom.
    pub x: Axis,
    /// Up the side.
    pub y: Axis,
    /// What is plotted, each with its own colour.
    pub series: Vec<Series>,
}

/// An axis of a plot.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Axis {
    /// What and in which unit.
    pub label: String,
    /// Whether equal ratios are equally far apart.
    pub logarithmic: bool,
}

/// How a series looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Look {
    /// Points joined by lines in the order they are given.
    #[default]
    Lines,
    /// A broad pale line without points, for what lies beneath the others: a front that others do not get past.
    Front,
    /// Points alone.
    Points,
    /// Bars over words.
    Bars,
}

/// One colour of a plot.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Series {
    /// What it is.
    pub name: String,
    /// How it looks.
    pub look: Look,
    /// Where; empty for bars.
    pub x: Vec<f64>,
    /// How high.
    pub y: Vec<f64>,
    /// Words of each point: the bar's name, or what the pointer shows. As many as `y`.
    pub words: Vec<String>,
}

/// A picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Picture {
    /// What is seen.
    pub caption: String,
    /// The bytes of a PNG.
    #[serde(skip)]
    pub png: Vec<u8>,
}
