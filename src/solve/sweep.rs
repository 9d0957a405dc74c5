//! The end of the progressive solution: Gauss-Seidel sweeps over all patches.

use super::Rgb;
use super::progressive::{Progressive, StepReport};
use super::transfer::Transfer;
use rayon::prelude::*;

/// Patches that gather at the same time, from what the ones before have already received: few enough to converge like
/// one at a time (neighbours see little of each other), many enough to keep processors busy where rows are made anew.
/// Fixed, so that nothing depends on the number of threads.
const CHUNK: usize = 64;

/// A sweep with the ambient correction that does not bring the unshot power below this share is the last with it.
const WORTHWHILE: f64 = 0.9;

impl<T: Transfer + Sync> Progressive<'_, T> {
    /// One Gauss-Seidel sweep over the rows of all patches, from the ambient estimate on: within every set of patches
    /// that see each other the constant mode, for which sweeps alone take 1/(1 − ρ) rounds, is solved at once
    /// (deflation).
    ///
    /// Costs two passes over the form factors and no search: meant for the end, when nearly all patches have power
    /// left. Every patch gathers by its own row, kept or made again, so a solution that ends with sweeps is the same
    /// for both.
    pub fn sweep(&mut self) -> StepReport {
        let patches = self.area.len();
        let before = self.unshot_power.element_sum();
        let mut shot = if self.overshoot { self.display() } else { self.radiosity() };
        for first in (0..patches).step_by(CHUNK) {
            let chunk = first..(first + CHUNK).min(patches);
            let gathered = self.transfer.gather(chunk.clone(), &shot);
            for (i, (arriving, _)) in chunk.zip(gathered) {
                shot[i] = self.source[i] + self.reflectance[i] * arriving;
            }
        }
        // What the patches now hold is taken as shot, and one more pass tells what arrives of it.
        let transfer = &self.transfer;
        let received: Vec<(Rgb, f64)> = (0..patches.div_ceil(CHUNK))
            .into_par_iter()
            .flat_map_iter(|chunk| transfer.gather(chunk * CHUNK..((chunk + 1) * CHUNK).min(patches), &shot))
            .collect();
        (self.escaped, self.sampling) = (Rgb::ZERO, Rgb::ZERO);
        for (i, &(received, arriving)) in received.iter().enumerate() {
            self.received[i] = received;
            self.unshot[i] = self.source[i] + self.reflectance[i] * received - shot[i];
            self.components.observe(i, self.area[i], arriving);
            self.escaped += (shot[i] - received) * self.area[i];
            self.sampling += (shot[i] * arriving - received) * self.area[i];
        }
        self.sweeps += 1;
        self.refresh();
        if self.unshot_power.element_sum() > WORTHWHILE * before {
            self.overshoot = false;
        }
        debug_assert!(self.is_lawful(), "after sweep {}: {:?}", self.sweeps, self.ledger());
        self.report(None)
    }
}
