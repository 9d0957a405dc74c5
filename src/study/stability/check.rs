//! One number beside what it should be.

use std::borrow::Cow;

/// A comparison and how far apart the two may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// What is looked at.
    pub case: String,
    /// By which method: form factors, solver, or stage.
    pub way: String,
    /// How large, and how far from the origin.
    pub place: String,
    /// The exact answer.
    pub expected: f64,
    /// Ours.
    pub found: f64,
    /// The largest error that the method allows, relative; absolute where zero is expected.
    pub bound: f64,
    /// Where the bound comes from.
    pub why: Cow<'static, str>,
}

impl Check {
    /// A comparison; `bound` is relative, or absolute where zero is expected. 0 is to the bit.
    pub fn new(
        case: impl Into<String>,
        expected: f64,
        found: f64,
        bound: f64,
        why: impl Into<Cow<'static, str>>,
    ) -> Self {
        let (way, place) = (String::new(), String::new());
        Self { case: case.into(), way, place, expected, found, bound, why: why.into() }
    }

    /// Something that must be so.
    pub fn fact(case: impl Into<String>, holds: bool, why: impl Into<Cow<'static, str>>) -> Self {
        Self::new(case, 1.0, f64::from(u8::from(holds)), 0.0, why)
    }

    /// By this method.
    pub fn by(self, way: impl Into<String>) -> Self {
        Self { way: way.into(), ..self }
    }

    /// At this size and place.
    pub fn at(self, place: impl Into<String>) -> Self {
        Self { place: place.into(), ..self }
    }

    /// Relative error; absolute where zero is expected, infinite for what is no number.
    pub fn error(&self) -> f64 {
        let off = (self.found - self.expected).abs();
        match (off.is_finite(), self.expected == 0.0) {
            (false, _) => f64::INFINITY,
            (true, true) => off,
            (true, false) => off / self.expected.abs(),
        }
    }

    /// Whether the error is within the bound.
    pub fn holds(&self) -> bool {
        self.error() <= self.bound
    }
}
