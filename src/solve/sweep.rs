//! The end of the progressive solution: Gauss-Seidel sweeps over all patches.

use super::Rgb;
use super::progressive::{Progressive, StepReport};
use super::rows::Rows;
use super::transfer::{Kept, Transfer};
use rayon::prelude::*;

/// A sweep with the ambient correction that does not bring the unshot power below this share is the last with it.
const WORTHWHILE: f64 = 0.9;

impl<'p> Progressive<'p, Kept<'p>> {
    /// One Gauss-Seidel sweep over the rows of all patches, from the ambient estimate on: within every set of patches
    /// that see each other the constant mode, for which sweeps alone take 1/(1 − ρ) rounds, is solved at once
    /// (deflation). Costs two passes over the form factors and no search: meant for the end, when nearly all patches
    /// have power left.
    pub fn sweep(&mut self) -> StepReport {
        let rows = self.transfer.problem.rows();
        let before = self.unshot_power();
        let mut shot = if self.overshoot { self.display() } else { self.radiosity() };
        for i in 0..shot.len() {
            let arriving = gather(rows, i, &shot);
            shot[i] = self.source[i] + self.reflectance[i] * arriving;
        }
        // What the patches now hold is taken as shot, and one more pass tells what arrives of it.
        let received: Vec<Rgb> =
            (0..shot.len()).into_par_iter().with_min_len(256).map(|i| gather(rows, i, &shot)).collect();
        (self.escaped, self.sampling) = (Rgb::ZERO, Rgb::ZERO);
        for (j, &shot) in shot.iter().enumerate() {
            let mut arrived = 0.0;
            self.transfer.shoot(j, self.area, |i, factor| arrived += self.area[i] * factor);
            let promised = self.transfer.arriving(j).map_or(arrived, |share| self.area[j] * share);
            self.escaped += shot * (self.area[j] - arrived);
            self.sampling += shot * (promised - arrived);
        }
        for (i, unshot) in self.unshot.iter_mut().enumerate() {
            *unshot = self.source[i] + self.reflectance[i] * received[i] - shot[i];
        }
        self.received = received;
        self.sweeps += 1;
        self.refresh();
        if self.unshot_power() > WORTHWHILE * before {
            self.overshoot = false;
        }
        self.report(None)
    }

    fn unshot_power(&self) -> f64 {
        self.unshot_power.element_sum()
    }
}

/// Σ_j F_ij b_j.
fn gather(rows: &Rows, patch: usize, radiosity: &[Rgb]) -> Rgb {
    let (column, weight) = rows.patch(patch);
    column.iter().zip(weight).map(|(&j, &weight)| radiosity[j as usize] * f64::from(weight)).sum()
}
