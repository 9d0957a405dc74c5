//! Where the energy went.

use super::Rgb;

/// Powers per colour channel, W: emitted = absorbed + escaped + unshot at every step of a solver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ledger {
    /// Power that was to be distributed, Σ A s.
    pub emitted: Rgb,
    /// What patches took from each other and did not reflect, Σ A (1 − ρ) E.
    pub absorbed: Rgb,
    /// What was shot and arrived at no patch: it left the scene, or ended on back faces and the unlit.
    pub escaped: Rgb,
    /// What still has to be shot, with its sign: overshooting may leave less than nothing.
    pub unshot: Rgb,
    /// The part of `escaped` that the rows' own sums do not explain: sampled form factors are reciprocal on average
    /// only, so what one patch sends is not quite what the others receive. 0 for reciprocal rows.
    pub sampling: Rgb,
}

impl Ledger {
    /// Share of the emitted power to which the balance closes after every step of every solver.
    pub const CLOSES_TO: f64 = 1e-5;

    /// What is missing to the balance, as a share of the emitted power, in the worst channel. Rounding only.
    pub fn imbalance(&self) -> f64 {
        let missing = self.emitted - self.absorbed - self.escaped - self.unshot;
        (missing.abs() / self.emitted.max(Rgb::splat(f64::MIN_POSITIVE))).max_element()
    }
}
