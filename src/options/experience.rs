//! What a scene errs more or less than usual, as passes find out.

use super::budget::{Effort, ErrorBudget, Errors, MOST, PARTS, SHARES, usual};

/// How many times as much as usual, in the mean square, each part errs in a scene. One look at few texels tells that badly, and
/// whoever follows it does too little where it happened to see too little: so looks are pooled, and what is usual counts as a
/// part of one.
#[derive(Clone, Copy, Debug)]
pub struct Experience {
    ratios: [f64; PARTS],
    looks: f64,
}

/// An error of this many times a tolerance surely needs no other pass, or surely does.
const UNSURE: [f64; 2] = [0.7, 1.3];

/// What is usual counts as this part of a look.
const USUAL_LOOKS: f64 = 0.3;

impl Default for Experience {
    fn default() -> Self {
        Self { ratios: [USUAL_LOOKS; PARTS], looks: USUAL_LOOKS }
    }
}

impl Experience {
    /// Of one look alone.
    pub fn of(at: Effort, found: &Errors) -> Self {
        let mut known = Self { ratios: [0.0; PARTS], looks: 0.0 };
        known.learn(at, found);
        known
    }

    /// Adds what was found at a place.
    pub fn learn(&mut self, at: Effort, found: &Errors) {
        let (usual, found) = (usual_squares(at), found.parts());
        for k in 0..PARTS {
            self.ratios[k] += found[k].powi(2) / usual[k];
        }
        self.looks += 1.0;
    }

    /// The error that is to be expected at a place.
    pub fn error(&self, at: Effort) -> f64 {
        self.squares(at).iter().sum::<f64>().sqrt()
    }

    /// The passes that a tolerance is likely to take, each with how likely it is to be taken; and whether the tolerance is
    /// likely to be reached.
    pub fn passes_to(&self, wanted: f64) -> ([(Effort, f64); 2], bool) {
        let first = ErrorBudget::new(wanted).first_look();
        // Estimates are off by up to a third.
        let [surely_not, surely] = UNSURE.map(|times| times * wanted);
        let second = ((self.error(first) - surely_not) / (surely - surely_not)).clamp(0.0, 1.0);
        ([(first, 1.0), (first.towards(self, wanted), second)], self.error(MOST) <= wanted)
    }

    /// Mean squares that are to be expected at a place.
    pub(super) fn squares(&self, at: Effort) -> [f64; PARTS] {
        let usual = usual_squares(at);
        std::array::from_fn(|k| usual[k] * self.ratios[k] / self.looks)
    }
}

fn usual_squares(at: Effort) -> [f64; PARTS] {
    let places = at.parts();
    std::array::from_fn(|k| SHARES[k] * usual(places[k]).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_look_does_not_tell_everything() {
        let from = Effort::all(1.0);
        let nothing = Errors {
            total: 0.0,
            direct: 0.0,
            solve: 0.0,
            gather: 0.0,
            interpolation: 0.0,
            between_texels: 0.0,
        };
        let mut known = Experience::default();
        let of_usual = |known: &Experience| -> [f64; PARTS] {
            std::array::from_fn(|k| known.squares(from)[k] / usual_squares(from)[k])
        };
        assert!(of_usual(&known).iter().all(|ratio| (ratio - 1.0).abs() < 1e-12));
        known.learn(from, &nothing);
        let left = USUAL_LOOKS / (1.0 + USUAL_LOOKS);
        assert!(of_usual(&known).iter().all(|ratio| (ratio - left).abs() < 1e-12));
    }
}
