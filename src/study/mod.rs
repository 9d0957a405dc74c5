//! Studies: many bakes, driven as any user would, and what they show as tables, plots and one page.
//!
//! A study is plain data ([`Study`]): [`Study::html`] makes one page that needs nothing from outside, [`Sheet::csv`]
//! a table for programs, [`write`] puts both into a folder.

pub mod accuracy;
pub mod effects;
mod figure;
mod page;
mod sheet;
pub mod stability;

pub use figure::{Axis, Figure, Look, Picture, Series};
pub use sheet::{Cell, Mark, Row, Sheet};

use crate::error::{Error, Result};
use crate::export;
use std::path::{Path, PathBuf};

/// Rows of a table that is shown whole in a terminal.
const MOST_ON_SCREEN: usize = 1000;

/// What a study found.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Study {
    /// One word; the files are named after it.
    pub name: &'static str,
    /// One line.
    pub title: String,
    /// What was done and how to read it, a paragraph each.
    pub text: Vec<String>,
    /// Tables, the most telling first.
    pub sheets: Vec<Sheet>,
    /// Plots.
    pub figures: Vec<Figure>,
    /// Pictures.
    pub pictures: Vec<Picture>,
}

impl Study {
    /// Whether no row of any table failed.
    pub fn passes(&self) -> bool {
        self.sheets.iter().flat_map(|sheet| &sheet.rows).all(|row| row.mark != Mark::Failed)
    }

    /// The tables that people read in a terminal: of those that go on for pages, the rows that failed.
    pub fn on_screen(&self) -> Vec<Sheet> {
        let shown = |sheet: &Sheet| {
            if sheet.rows.len() <= MOST_ON_SCREEN {
                return Some(sheet.clone());
            }
            let failed = Sheet {
                title: format!("{}: what failed", sheet.title),
                rows: sheet.rows.iter().filter(|row| row.mark == Mark::Failed).cloned().collect(),
                ..sheet.clone()
            };
            (!failed.rows.is_empty()).then_some(failed)
        };
        self.sheets.iter().filter_map(shown).collect()
    }

    /// One page with everything, which works offline.
    pub fn html(&self) -> String {
        page::html(self)
    }
}

/// Writes `NAME.csv` (`NAME-SHEET.csv` where there are several tables) and `NAME.html` into a folder, which is made
/// when missing; returns what was written.
pub fn write(study: &Study, folder: &Path) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
    let mut files = Vec::new();
    for (i, sheet) in study.sheets.iter().enumerate() {
        let name =
            if i == 0 { format!("{}.csv", study.name) } else { format!("{}-{}.csv", study.name, sheet.name) };
        files.push((folder.join(name), sheet.csv()?.into_bytes()));
    }
    files.push((folder.join(format!("{}.html", study.name)), study.html().into_bytes()));
    export::write_all(files)
}

#[cfg(test)]
mod tests;
