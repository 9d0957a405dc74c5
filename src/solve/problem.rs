//! What is to be solved: plain numbers, one row a patch.

use super::Rgb;
use super::rows::{RowSource, Rows};
use crate::error::{Error, Result};
use crate::transport::form_factors::Row;
use crate::units::Reflectance;

/// The radiosity equation b = s + ρ F b of n patches.
#[derive(Clone, Debug)]
pub struct Problem<R = Rows> {
    area: Vec<f64>,
    reflectance: Vec<Rgb>,
    source: Vec<Rgb>,
    rows: R,
}

impl<R: RowSource> Problem<R> {
    /// * `area`: of each patch, m², above 0;
    /// * `reflectance`: ρ, each channel in `[0, 0.999]`, or up to 1 where the patch sees out of the scene;
    /// * `source`: s, the radiosity that still has to be distributed, W/m²: what is reflected of the light straight
    ///   from lamps, emitters and sky, ρ E_direct. Not negative. Emission that `direct` already took to the patches
    ///   is left out, or it would arrive twice;
    /// * `rows`: the form factors F.
    pub fn new(area: Vec<f64>, reflectance: Vec<Rgb>, source: Vec<Rgb>, rows: R) -> Result<Self> {
        let count = rows.len();
        if [area.len(), reflectance.len(), source.len()] != [count; 3] {
            return Err(invalid(
                "area, reflectance, source and form factors have different numbers of patches",
            ));
        }
        for patch in 0..count {
            let fault = |what: &str| Err(invalid(&format!("patch {patch}: {what}")));
            if !(area[patch].is_finite() && area[patch] > 0.0) {
                return fault("its area must be finite and above 0");
            }
            if !reflectance[patch].to_array().iter().all(|rho| (0.0..=1.0).contains(rho)) {
                return fault("its reflectance must lie in [0, 1]");
            }
            if !(source[patch].is_finite() && source[patch].min_element() >= 0.0) {
                return fault("its source radiosity must be finite and not negative");
            }
        }
        let problem = Self { area, reflectance, source, rows };
        problem.require_a_steady_state()?;
        Ok(problem)
    }

    /// The same patches under another light, or with other reflectances; needs no new form factors.
    pub fn relit(self, reflectance: Vec<Rgb>, source: Vec<Rgb>) -> Result<Self> {
        Self::new(self.area, reflectance, source, self.rows)
    }

    /// Light that nothing absorbs and nothing lets out grows for ever. Where every patch returns 0.999 of what it
    /// receives at most, and so ‖ρF‖ ≤ 0.999, every iteration here converges.
    fn require_a_steady_state(&self) -> Result<()> {
        let limit = f64::from(Reflectance::MAX) + 1e-6;
        let mut row = Row::default();
        for (patch, reflectance) in self.reflectance.iter().enumerate() {
            let largest = reflectance.max_element();
            if largest > limit {
                self.rows.row(patch, &mut row);
                if largest * row.weight.iter().sum::<f64>() > limit {
                    return Err(invalid(&format!(
                        "patch {patch}: reflects {largest} of the light in a closed place, which has no steady \
                         state; lower its reflectance to {}",
                        Reflectance::MAX
                    )));
                }
            }
        }
        Ok(())
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.area.len()
    }

    /// Whether there is no patch.
    pub fn is_empty(&self) -> bool {
        self.area.is_empty()
    }

    /// Area of each patch, m².
    pub fn area(&self) -> &[f64] {
        &self.area
    }

    /// ρ of each patch.
    pub fn reflectance(&self) -> &[Rgb] {
        &self.reflectance
    }

    /// s of each patch, W/m².
    pub fn source(&self) -> &[Rgb] {
        &self.source
    }

    /// The form factors.
    pub fn rows(&self) -> &R {
        &self.rows
    }

    /// Power that is to be distributed, Σ A s, W.
    pub fn emitted(&self) -> Rgb {
        super::weighted_sum(&self.area, &self.source)
    }
}

fn invalid(what: &str) -> Error {
    Error::invalid("coarse solution", what)
}
