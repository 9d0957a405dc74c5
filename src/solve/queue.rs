//! Which patch has the most unshot power, without looking at all of them.

/// Steps per doubling of the power. The patch that is found holds at least 8/9 of the largest power: exact order
/// would cost a logarithm at each of a shot's receivers and does not converge faster.
const STEPS_PER_OCTAVE_LOG2: u32 = 3;

/// Powers below 2⁻⁶⁰ of the largest are nobody's turn: they are below the rounding of the sum.
const OCTAVES: usize = 64;

const BINS: usize = (OCTAVES << STEPS_PER_OCTAVE_LOG2) + 1;

/// A bucket queue over patches, with lazy updates: entries are only added, and checked when their turn comes. Both
/// operations take constant time on average.
#[derive(Clone, Debug)]
pub(super) struct Queue {
    bins: Vec<Vec<u32>>,
    /// The bin in which the patch's valid entry lies; 0 when it has none.
    bin_of: Vec<u16>,
    top: usize,
    entries: usize,
    /// Bits of the power at which bin 1 begins.
    base: u64,
}

impl Queue {
    /// An empty queue for powers up to a few times `largest`.
    pub fn new(patches: usize, largest: f64) -> Self {
        let base = (largest.clamp(1e-290, 1e290) * 0.5f64.powi(OCTAVES as i32 - 4)).to_bits();
        Self { bins: vec![vec![]; BINS], bin_of: vec![0; patches], top: 0, entries: 0, base }
    }

    fn bin(&self, power: f64) -> usize {
        // The bits of positive floats ascend as they do: the exponent and the first bits of the mantissa are a
        // logarithm in steps.
        let steps = power.max(0.0).to_bits().saturating_sub(self.base) >> (52 - STEPS_PER_OCTAVE_LOG2);
        if power.to_bits() <= self.base { 0 } else { (steps as usize + 1).min(BINS - 1) }
    }

    /// Forgets all entries.
    pub fn clear(&mut self) {
        self.bins.iter_mut().for_each(Vec::clear);
        self.bin_of.fill(0);
        self.top = 0;
        self.entries = 0;
    }

    /// Number of entries, valid or not.
    pub fn entries(&self) -> usize {
        self.entries
    }

    /// The patch now has this power (not negative).
    pub fn update(&mut self, patch: u32, power: f64) {
        let bin = self.bin(power);
        let known = &mut self.bin_of[patch as usize];
        if bin > usize::from(*known) {
            *known = bin as u16;
            self.bins[bin].push(patch);
            self.entries += 1;
            self.top = self.top.max(bin);
        }
    }

    /// Takes out a patch with about the largest power; `power` tells what a patch has now.
    pub fn pop(&mut self, power: impl Fn(u32) -> f64) -> Option<u32> {
        while self.top > 0 {
            let Some(patch) = self.bins[self.top].pop() else {
                self.top -= 1;
                continue;
            };
            self.entries -= 1;
            if usize::from(self.bin_of[patch as usize]) != self.top {
                continue;
            }
            self.bin_of[patch as usize] = 0;
            let now = power(patch);
            if self.bin(now) >= self.top {
                return Some(patch);
            }
            self.update(patch, now);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against a full search, with powers that rise and fall over 15 decades.
    #[test]
    fn the_patch_found_has_nearly_the_largest_power() {
        let count = 500;
        let mut seed = 1u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut power: Vec<f64> = (0..count).map(|_| 10f64.powf(-15.0 * number())).collect();
        let mut queue = Queue::new(count, 1.0);
        (0..count).for_each(|patch| queue.update(patch as u32, power[patch]));
        for _ in 0..20_000 {
            let found = queue.pop(|patch| power[patch as usize]).unwrap() as usize;
            let largest = power.iter().copied().fold(0.0, f64::max);
            assert!(power[found] >= largest * 8.0 / 9.0, "{} of {largest}", power[found]);
            power[found] = 10f64.powf(-15.0 * number());
            queue.update(found as u32, power[found]);
            for _ in 0..8 {
                let other = (number() * count as f64) as usize;
                power[other] *= 2.0 * number();
                queue.update(other as u32, power[other]);
            }
        }
    }

    #[test]
    fn nothing_is_left_at_the_end() {
        let mut queue = Queue::new(3, 5.0);
        assert_eq!(queue.pop(|_| 0.0), None);
        queue.update(1, 5.0);
        queue.update(0, 0.0);
        queue.update(2, 1e-30);
        assert_eq!(queue.pop(|_| 5.0), Some(1));
        assert_eq!(queue.pop(|_| 0.0), None);
        assert_eq!(Queue::new(0, f64::INFINITY).pop(|_| 0.0), None);
    }
}
