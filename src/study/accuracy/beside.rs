//! Results of others, judged elsewhere by the same reference: a table with the columns of `accuracy.csv`.

use crate::error::{Error, Result};
use std::io::Read;
use std::path::Path;

/// A row of others: shares of the mean, as in `accuracy.csv`. What is not known is empty.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize)]
pub struct Beside {
    /// Who: "Cycles".
    pub sweep: String,
    /// How: "16 samples".
    pub setting: String,
    /// How long it took.
    pub seconds: Option<f64>,
    /// Rays it sent.
    #[serde(default)]
    pub rays: Option<u64>,
    /// See [`super::Errors`].
    pub rms: Option<f64>,
    #[serde(default)]
    #[allow(missing_docs)]
    pub median: Option<f64>,
    #[serde(default, rename = "95th percentile")]
    #[allow(missing_docs)]
    pub p95: Option<f64>,
    #[serde(default)]
    #[allow(missing_docs)]
    pub largest: Option<f64>,
    #[serde(default)]
    #[allow(missing_docs)]
    pub bias: Option<f64>,
    #[serde(default)]
    #[allow(missing_docs)]
    pub energy: Option<f64>,
}

/// Reads a table. Columns that are not known are left alone.
pub fn read(path: &Path) -> Result<Vec<Beside>> {
    let file = std::fs::File::open(path).map_err(|error| Error::io(path, error))?;
    parse(file).map_err(|what| Error::invalid(path.display().to_string(), what))
}

/// The same of a table in memory; on a row that makes no sense, its line and what is wrong.
pub(super) fn parse(table: impl Read) -> std::result::Result<Vec<Beside>, String> {
    let mut reader = csv::Reader::from_reader(table);
    let mut rows = Vec::new();
    for row in reader.deserialize::<Beside>() {
        let row = row.map_err(|error| {
            format!(
                "{error}; needed are the columns sweep, setting, seconds and rms, as accuracy.csv has them"
            )
        })?;
        let numbers = [row.seconds, row.rms, row.median, row.p95, row.largest];
        if numbers.into_iter().flatten().any(|x| !(x.is_finite() && x >= 0.0)) {
            return Err(format!("{}, {}: times and errors are not negative", row.sweep, row.setting));
        }
        rows.push(row);
    }
    Ok(rows)
}
