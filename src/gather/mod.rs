//! Coarse radiosity -> indirect irradiance of every element: the final gather.
//!
//! A gather sends a fixed set of cosine-distributed rays from one element and averages the radiosity they meet
//! (Reichert 1992; Lischinski, Tampieri & Greenberg 1993). It is done at the nodes of an adaptive grid in texture
//! space; where neighbouring nodes agree, the elements between them are interpolated.

mod bright;
mod cells;
mod hemisphere;
mod interpolate;
mod openings;
mod parted;
mod smooth;

pub use bright::Bright;
pub use hemisphere::{DirectionSet, Gathered};
pub use smooth::spread_over_elements;

use crate::direct::{Direct, Faint};
use crate::elements::Elements;
use crate::options::GatherOptions;
use crate::plan::Sight;
use crate::progress::Progress;
use crate::scene::Sky;
use crate::transport::{Hit, Tracer};
use crate::units::{Irradiance, Radiosity};

/// What a gather ray can meet.
pub struct Surroundings<'a, T, S> {
    /// The world.
    pub tracer: &'a T,
    /// Where nothing can be seen.
    pub sight: &'a Sight,
    /// Radiosity of the surface at a hit: reflected light only, emitters are met by the direct light.
    pub radiosity: S,
    /// Radiance of rays that leave.
    pub sky: &'a Sky,
    /// Emitters that are too many and too faint for every texel, where there are such.
    pub faint: Option<&'a Faint<'a>>,
    /// Patches too bright to be met by chance, where there are such; `radiosity` does not hold them.
    pub bright: Option<&'a Bright>,
}

/// What the stage found.
pub struct Indirect {
    /// Irradiance that did not come straight from a bright emitter, one row an element.
    pub irradiance: Vec<Irradiance>,
    /// Whether an element sent gather rays, one row an element; the others were interpolated.
    pub gathered: Vec<bool>,
    /// Elements that sent gather rays.
    pub nodes: u64,
    /// Rays sent.
    pub rays: u64,
}

/// Gathers for all elements of exported pages. `direct` tells how bright a place is, hence how much error shows;
/// `coarse` is what elements keep that a cancelled run did not reach.
pub fn gather<T: Tracer, S: Fn(&Hit) -> Radiosity + Sync>(
    elements: &Elements,
    direct: &Direct,
    coarse: &[Irradiance],
    around: &Surroundings<T, S>,
    options: &GatherOptions,
    seed: u32,
    progress: &mut Progress,
) -> Indirect {
    let set = DirectionSet::new(options.rays, seed, around.sky.is_lit());
    cells::fill(elements, direct, coarse, around, &set, options, progress)
}
