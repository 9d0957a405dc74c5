//! Scene + options -> which sides of which surfaces take part, and why.

mod effects;
mod sides;

pub use sides::{BackEvidence, SidesFound, sides, sides_with_evidence};

use crate::scene::Scene;

/// What one side of a surface does in the solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Gets texels in a page that is written.
    Lightmapped,
    /// Gets coarse texels in a page that is not written: it reflects, nobody looks it up.
    Hidden,
    /// Neither receives nor reflects; it only blocks.
    Dark,
}

/// The sides of one surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Sides {
    /// The side its triangles wind counter-clockwise on.
    pub front: Side,
    /// The other.
    pub back: Side,
}

/// One effect, on or off.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Effect {
    /// Short name.
    pub name: &'static str,
    /// Whether it is simulated.
    pub on: bool,
    /// Why, in the artist's words.
    pub reason: String,
}

/// Decisions made once, before any loop.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Plan {
    /// One per surface of the scene.
    pub sides: Vec<Sides>,
    /// Every effect with its reason.
    pub effects: Vec<Effect>,
}

/// Decides what takes part.
pub fn plan(scene: &Scene) -> Plan {
    let sides = sides::sides(scene);
    let effects = effects::effects(scene, &sides);
    Plan { sides, effects }
}
