//! Patches and form factors -> radiosity: the coarse solution of all interreflection.
//!
//! The radiosity equation for n patches, one colour channel: b = s + ρ F b, where s is the radiosity that is given
//! ([`Problem::source`]), ρ the reflectance and F_ij the form factor from i to j. F b is the irradiance that patches
//! receive from each other.
//!
//! [`progressive`] is the product: it shoots the power that was not yet distributed, largest first. [`matrix`] is its
//! oracle: the same equation by the classical iterations. [`ledger`] shows that no energy is lost on the way.

pub mod coarse;
pub mod ledger;
pub mod matrix;
pub mod problem;
pub mod progressive;
pub mod rows;

mod balance;
mod bound;
mod components;
mod queue;
mod sweep;
mod transfer;

pub use ledger::Ledger;
pub use matrix::{MatrixOptions, Relaxation};
pub use problem::Problem;
pub use progressive::{Progressive, Solution, StepReport};
pub use rows::{Made, RowSource, Rows};
pub use transfer::{Kept, Remade, Transfer};

/// One value per colour channel, linear Rec.709.
pub type Rgb = glam::DVec3;

/// Σ w |x| over the patches, per channel.
fn weighted_sum_abs(weight: &[f64], values: &[Rgb]) -> Rgb {
    weight.iter().zip(values).map(|(&weight, value)| value.abs() * weight).sum()
}

/// Σ w x over the patches, per channel.
fn weighted_sum(weight: &[f64], values: &[Rgb]) -> Rgb {
    weight.iter().zip(values).map(|(&weight, &value)| value * weight).sum()
}
