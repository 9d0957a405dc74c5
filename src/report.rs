//! What a bake did, as plain data. Who prints it decides how it looks.

use crate::audit::Audit;
use crate::error::Warning;
use crate::options::{BakeOptions, LampUnits};
use crate::plan::Finding;
use crate::progress::Stage;
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};

/// What a bake did.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of lightkiln.
    pub version: &'static str,
    /// The scene that was read.
    #[serde(serialize_with = "lossy")]
    pub input: PathBuf,
    /// Every file that was written, the baked scene first.
    #[serde(serialize_with = "lossy_each")]
    pub outputs: Vec<PathBuf>,
    /// Whether the caller stopped the bake; then the outputs hold the solution so far.
    pub interrupted: bool,
    /// What the bake was told.
    pub settings: BakeOptions,
    /// How the numbers of lamps were understood; never `Auto`.
    pub lamp_units: LampUnits,
    /// What every stage cost, in the order they ran.
    pub stages: Vec<StageReport>,
    /// From start to end, seconds.
    pub seconds_total: f64,
    /// The most memory that the bake was thought to take, before its light stages, bytes; the last stage tells what it took.
    pub predicted_memory_bytes: u64,
    /// Texture space.
    pub atlas: AtlasReport,
    /// Light.
    pub light: LightReport,
    /// Which effects were simulated and why.
    pub effects: Vec<Finding>,
    /// What was dropped, approximated or looks wrong, sorted by place; see [`sorted`].
    pub warnings: Vec<Warning>,
}

/// What one stage cost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageReport {
    /// Which stage.
    pub stage: Stage,
    /// From its start to its end, seconds.
    pub seconds: f64,
    /// Rays it sent.
    pub rays: u64,
    /// The most memory the process ever had resident up to the end of the stage, bytes; `None` where the system
    /// does not tell.
    pub peak_memory_bytes: Option<u64>,
}

/// Texture space.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AtlasReport {
    /// Pages that were written.
    pub pages: u32,
    /// Width and height of a page.
    pub page_size_texels: u32,
    /// Texels per metre.
    pub density_texels_per_m: f32,
    /// Share of the written pages' texels that charts cover, in `[0, 1]`.
    pub fill: f32,
    /// Texels of the written pages that charts cover.
    pub texels: u64,
    /// Receivers of light, those on hidden pages included.
    pub elements: u64,
    /// Texels buried in or pressed against other geometry; they take their neighbours' light.
    pub invalid_texels: u64,
}

/// Light.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LightReport {
    /// Shooters of the coarse solution.
    pub patches: u64,
    /// Shots of the coarse solution: single patches to all that see them.
    pub shots: u64,
    /// Sweeps of the coarse solution: each patch from all that it sees.
    pub sweeps: u64,
    /// Form factors that were kept; 0 where they were made again at every sweep.
    pub form_factors: u64,
    /// Rays of all stages.
    pub rays: u64,
    /// Where the power went.
    pub ledger: EnergyReport,
    /// Share of the reflected power that was not distributed when the solver stopped.
    pub unshot_fraction: f64,
    /// Bound on what stopping there cost: the radiosity that is missing, in W over all patches, is at most this share of
    /// the reflected power. `None` where no bound is known.
    pub unshot_error_bound: Option<f64>,
    /// Estimated root mean square error over the lightmap's valid texels, as a share of their mean; see
    /// [`crate::audit`]. `None` where nothing is lit, or no rays were to be spent on it.
    pub estimated_error: Option<f64>,
    /// Where that comes from.
    pub error_parts: Option<Audit>,
}

/// Where the power of the coarse solution went, red, green and blue: watts, or lumens when the report's lamp units
/// are [`LampUnits::Gltf`]. `emitted` is the sum of the others. Nothing escapes from
/// a closed room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EnergyReport {
    /// Sent out by lamps, sky and surfaces.
    pub emitted: [f64; 3],
    /// Taken up by surfaces.
    pub absorbed: [f64; 3],
    /// Gone where there is nothing, or to back faces and the unlit.
    pub escaped: [f64; 3],
    /// Lost, or made where negative, because sampled form factors are reciprocal on average only: what one patch sends is
    /// not quite what the others receive.
    pub sampling: [f64; 3],
    /// Still to be distributed when the solver stopped.
    pub unshot: [f64; 3],
}

/// Sorts warnings by place, then text, and drops repetitions, so that the order of the work does not show.
pub fn sorted(mut warnings: Vec<Warning>) -> Vec<Warning> {
    warnings.sort();
    warnings.dedup();
    warnings
}

fn lossy<S: Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(&path.display())
}

fn lossy_each<S: Serializer>(paths: &[PathBuf], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(paths.iter().map(|path| path.display().to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_come_sorted_by_place_and_once() {
        let given = [("wall", "b"), ("floor", "z"), ("wall", "a"), ("wall", "b")];
        let sorted = sorted(given.map(|(at, what)| Warning::new(at, what)).to_vec());
        let places: Vec<_> = sorted.iter().map(|w| (w.at.as_str(), w.what.as_str())).collect();
        assert_eq!(places, [("floor", "z"), ("wall", "a"), ("wall", "b")]);
    }
}
