//! A table that is printed, written as CSV and shown in a page.

use crate::error::{Error, Result};
use crate::text;
use comfy_table::{CellAlignment, ContentArrangement, Table, presets};
use serde::{Serialize, Serializer};

/// A table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Sheet {
    /// One word; its file is named after it.
    pub name: &'static str,
    /// One line.
    pub title: String,
    /// Heads of the columns, with the unit where cells do not show it: "rays", "shadow rays a texel".
    pub columns: Vec<&'static str>,
    /// Rows, as many cells each as there are columns.
    pub rows: Vec<Row>,
}

/// A row of a table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// One a column.
    pub cells: Vec<Cell>,
    /// Whether the row stands out.
    pub mark: Mark,
}

/// How a row stands out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Mark {
    /// It does not.
    #[default]
    Plain,
    /// No other row is better in everything.
    Best,
    /// What was expected did not happen.
    Failed,
}

/// A value, which knows how it is read.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// How many.
    Count(u64),
    /// A number without a unit.
    Number(f64),
    /// A share of one, read in percent.
    Share(f64),
    /// A duration.
    Seconds(f64),
    /// Memory.
    Bytes(u64),
    /// Yes or no.
    Yes(bool),
    /// Not known, or not applicable.
    Empty,
}

impl Cell {
    /// As people read it.
    pub fn text(&self) -> String {
        match self {
            Self::Text(words) => words.clone(),
            Self::Count(count) => text::count(*count),
            Self::Number(number) => text::significant(*number),
            Self::Share(share) => text::percent(*share),
            Self::Seconds(seconds) => text::duration(*seconds),
            Self::Bytes(bytes) => text::bytes(*bytes),
            Self::Yes(yes) => if *yes { "yes" } else { "no" }.to_owned(),
            Self::Empty => String::new(),
        }
    }

    /// As programs read it: plain numbers with all their digits.
    pub fn plain(&self) -> String {
        match self {
            Self::Text(words) => words.clone(),
            Self::Count(number) | Self::Bytes(number) => number.to_string(),
            Self::Number(number) | Self::Share(number) | Self::Seconds(number) => number.to_string(),
            Self::Yes(yes) => yes.to_string(),
            Self::Empty => String::new(),
        }
    }

    /// Whether it lines up on the right.
    pub fn is_number(&self) -> bool {
        !matches!(self, Self::Text(_) | Self::Yes(_) | Self::Empty)
    }
}

impl From<&str> for Cell {
    fn from(words: &str) -> Self {
        Self::Text(words.to_owned())
    }
}

impl From<String> for Cell {
    fn from(words: String) -> Self {
        Self::Text(words)
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            Self::Text(words) => to.serialize_str(words),
            Self::Count(number) | Self::Bytes(number) => to.serialize_u64(*number),
            Self::Number(number) | Self::Share(number) | Self::Seconds(number) => to.serialize_f64(*number),
            Self::Yes(yes) => to.serialize_bool(*yes),
            Self::Empty => to.serialize_none(),
        }
    }
}

impl Row {
    /// A row that does not stand out.
    pub fn plain(cells: Vec<Cell>) -> Self {
        Self { cells, mark: Mark::Plain }
    }

    /// A row that failed unless `passed`.
    pub fn judged(cells: Vec<Cell>, passed: bool) -> Self {
        Self { cells, mark: if passed { Mark::Plain } else { Mark::Failed } }
    }
}

impl Sheet {
    /// The table as text of at most `width` columns; marked rows begin with a sign.
    pub fn screen(&self, width: u16) -> String {
        let mut table = Table::new();
        table
            .load_style(presets::NOTHING)
            .set_content_arrangement(ContentArrangement::Dynamic)
            .set_width(width);
        table.set_header(std::iter::once("").chain(self.columns.iter().copied()));
        for row in &self.rows {
            let sign = match row.mark {
                Mark::Plain => "",
                Mark::Best => "*",
                Mark::Failed => "FAILED",
            };
            let cell = |cell: &Cell| {
                let side = if cell.is_number() { CellAlignment::Right } else { CellAlignment::Left };
                comfy_table::Cell::new(text::printable(&cell.text())).set_alignment(side)
            };
            table.add_row(std::iter::once(comfy_table::Cell::new(sign)).chain(row.cells.iter().map(cell)));
        }
        format!("{}\n{}\n", text::printable(&self.title), table.trim_fmt())
    }

    /// The table as CSV (RFC 4180) with a head line; shares are plain numbers, not percents. The last column tells
    /// the row's mark.
    pub fn csv(&self) -> Result<String> {
        let failed = |error: csv::Error| Error::io(self.name, std::io::Error::other(error));
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.columns.iter().copied().chain(["mark"])).map_err(failed)?;
        for row in &self.rows {
            let mark = match row.mark {
                Mark::Plain => "",
                Mark::Best => "best",
                Mark::Failed => "failed",
            };
            let cells = row.cells.iter().map(Cell::plain).chain([mark.to_owned()]);
            writer.write_record(cells).map_err(failed)?;
        }
        let bytes =
            writer.into_inner().map_err(|e| Error::io(self.name, std::io::Error::other(e.to_string())))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}
