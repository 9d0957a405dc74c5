//! The mean over all texels of what is known of few: texels that err alike are a class, and few of each tell about all.

use super::witness::Lit;
use crate::elements::NO_ELEMENT;
use crate::progress::Progress;
use rayon::prelude::*;

/// Steps to the neighbours' mean that part the rough from the smooth, as shares of the mean light.
const ROUGH: [f64; 4] = [0.005, 0.02, 0.08, 0.3];
/// Texels of a round after the first.
const ROUND: usize = 64;
/// Most texels in all.
const MOST: usize = 4096;
/// Good enough is a mean square known to this share of itself, standard error: twice that of the error.
const GOOD_ENOUGH: f64 = 0.2;

/// What one texel is off by, mean of the channels, W/m²: twice, independently; and the rays that took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Off {
    pub by: [f64; 2],
    pub rays: u64,
}

/// How texels are parted and how many are looked at.
pub(super) struct Sampling<'a> {
    /// Texels to draw from.
    pub texels: &'a [u32],
    /// The class of each.
    pub class: &'a [u8],
    /// Texels of every class to begin with.
    pub first: usize,
    /// About the most rays.
    pub rays: u64,
    /// Mean squares far below this need not be told from nothing.
    pub resolution: f64,
}

/// Mean squares over all texels, (W/m²)².
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    /// Of what the light is off by. Right on average, so perhaps below nothing.
    pub square: f64,
    /// Of what one witness is off by.
    pub noise: f64,
    /// The parts of both that texels of even classes make.
    pub of_even: [f64; 2],
    /// Standard error of `square`.
    pub doubt: f64,
    pub texels: u64,
    pub rays: u64,
}

/// A look at few of many texels, which can be gone on with.
pub(super) struct Survey<'a> {
    sampling: Sampling<'a>,
    strata: Vec<Stratum>,
    /// How many texels of each class come next.
    next: Vec<usize>,
    rays: u64,
    /// Whether there is nothing more to look at.
    pub spent: bool,
}

impl<'a> Survey<'a> {
    pub fn new(sampling: Sampling<'a>) -> Self {
        let strata = strata(&sampling);
        let next = vec![sampling.first; strata.len()];
        Self { sampling, strata, next, rays: 0, spent: false }
    }

    /// Looks at texels until it is known well enough what all are off by, or the rays are used up; `None` when the caller
    /// stops it.
    pub fn run(&mut self, off: impl Fn(u32) -> Off + Sync, progress: &Progress) -> Option<()> {
        loop {
            self.round(&off, progress)?;
            let found = self.found();
            let known = found.doubt <= GOOD_ENOUGH * found.square.max(self.sampling.resolution);
            if known || self.spent || self.rays >= self.sampling.rays {
                return Some(());
            }
        }
    }

    /// Looks at some more texels; `None` when the caller stops it.
    pub fn round(&mut self, off: impl Fn(u32) -> Off + Sync, progress: &Progress) -> Option<()> {
        let drawn: Vec<(usize, u32)> = (0..self.strata.len())
            .flat_map(|s| self.strata[s].draw(self.next[s]).into_iter().map(move |e| (s, e)))
            .collect();
        let seen: Vec<Option<Off>> =
            drawn.par_iter().map(|&(_, element)| (!progress.cancelled()).then(|| off(element))).collect();
        let before = self.rays;
        for ((s, _), off) in drawn.iter().zip(seen) {
            let Off { by: [a, b], rays } = off?;
            self.rays += rays;
            self.strata[*s].seen.push([a * b, (a - b).powi(2) / 2.0]);
        }
        progress.advance(self.rays - before);
        self.spent = drawn.is_empty() || self.texels() >= MOST;
        self.next = shares(&self.strata);
        Some(())
    }

    /// What is known so far.
    pub fn found(&self) -> Found {
        let sums = |strata: &mut dyn Iterator<Item = &Stratum>| -> [f64; 2] {
            let weighed = strata.map(|s| s.mean().map(|square| s.weight * square));
            weighed.fold([0.0; 2], |sum, add| [sum[0] + add[0], sum[1] + add[1]])
        };
        let [square, noise] = sums(&mut self.strata.iter());
        let of_even = sums(&mut self.strata.iter().filter(|s| s.is_even));
        let (doubt, texels) = (doubt(&self.strata), self.texels() as u64);
        Found { square, noise, of_even, doubt, texels, rays: self.rays }
    }

    fn texels(&self) -> usize {
        self.strata.iter().map(|s| s.seen.len()).sum()
    }
}

/// Standard error of the mean square.
fn doubt(strata: &[Stratum]) -> f64 {
    let variance = |s: &Stratum| (s.weight * s.deviation()).powi(2) / s.seen.len().max(1) as f64 * s.unseen();
    strata.iter().map(variance).sum::<f64>().sqrt()
}

/// How many more texels of each class: most where classes are large and differ most in themselves (Neyman 1934).
fn shares(strata: &[Stratum]) -> Vec<usize> {
    let worth: Vec<f64> = strata.iter().map(|s| s.weight * s.deviation() * s.unseen().sqrt()).collect();
    let all: f64 = worth.iter().sum();
    let share = |worth: &f64| if all > 0.0 { (ROUND as f64 * worth / all).round() as usize } else { 0 };
    worth.iter().map(share).collect()
}

/// A class.
struct Stratum {
    members: Vec<u32>,
    is_even: bool,
    drawn: usize,
    /// Share of all texels.
    weight: f64,
    /// Of those that were looked at: the product of what they are off by, and half the square of the difference.
    seen: Vec<[f64; 2]>,
}

/// Parts texels into classes; empty ones are left out.
fn strata(sampling: &Sampling) -> Vec<Stratum> {
    let classes = sampling.class.iter().max().map_or(0, |&most| usize::from(most) + 1);
    let mut members = vec![Vec::new(); classes];
    for (&e, &class) in sampling.texels.iter().zip(sampling.class) {
        members[usize::from(class)].push(e);
    }
    let weight = |members: &Vec<u32>| members.len() as f64 / sampling.texels.len() as f64;
    let stratum = |(class, members): (usize, Vec<u32>)| {
        let (weight, is_even) = (weight(&members), class % 2 == 0);
        Stratum { weight, is_even, drawn: 0, seen: Vec::new(), members }
    };
    members.into_iter().enumerate().filter(|(_, members)| !members.is_empty()).map(stratum).collect()
}

/// How rough the light is at each of these texels, as a class.
pub(super) fn roughness<T: Sync>(lit: &Lit<T>, texels: &[u32], mean: f64) -> Vec<u8> {
    let class = |&e: &u32| ROUGH.iter().filter(|&&limit| step(lit, e) > limit * mean).count() as u8;
    texels.par_iter().map(class).collect()
}

/// How far a texel is from the mean of its neighbours.
fn step<T>(lit: &Lit<T>, element: u32) -> f64 {
    let (elements, e) = (lit.elements, element as usize);
    let chart = &elements.charts[elements.chart[e] as usize];
    let page = &elements.pages[chart.page as usize];
    let (texel, size) = (elements.texel[e], page.size_texels as i32);
    let beside =
        [(-1, 0), (1, 0), (0, -1), (0, 1)].map(|(dx, dy)| (i32::from(texel.x) + dx, i32::from(texel.y) + dy));
    let (mut sum, mut count) = (0.0, 0.0);
    for (x, y) in beside {
        if !(0..size).contains(&x) || !(0..size).contains(&y) {
            continue;
        }
        let n = page.element[(y * size + x) as usize];
        if n != NO_ELEMENT && chart.elements.contains(&n) && elements.valid[n as usize] {
            sum += f64::from(lit.irradiance(n).mean());
            count += 1.0;
        }
    }
    if count > 0.0 { (sum / count - f64::from(lit.irradiance(element).mean())).abs() } else { 0.0 }
}

impl Stratum {
    /// The next members, spread evenly over the class however many are drawn in all; fewer once all have been.
    fn draw(&mut self, wanted: usize) -> Vec<u32> {
        let count = self.members.len();
        let until = (self.drawn + wanted).min(count);
        // A step prime to the number of members visits each once; near the golden section of it the visits spread evenly.
        let step = coprime_near((count as f64 * 0.618_034) as usize, count);
        let drawn = (self.drawn..until).map(|k| self.members[(k * step + count / 2) % count]).collect();
        self.drawn = until;
        drawn
    }

    /// Share that was not looked at.
    fn unseen(&self) -> f64 {
        1.0 - self.seen.len() as f64 / self.members.len() as f64
    }

    /// Means of those that were.
    fn mean(&self) -> [f64; 2] {
        let count = self.seen.len().max(1) as f64;
        std::array::from_fn(|k| self.seen.iter().map(|square| square[k]).sum::<f64>() / count)
    }

    /// Standard deviation of the first square within the class.
    fn deviation(&self) -> f64 {
        let count = self.seen.len();
        if count < 2 {
            return self.seen.first().map_or(0.0, |square| square[0].abs());
        }
        let mean = self.mean()[0];
        let sum: f64 = self.seen.iter().map(|square| (square[0] - mean).powi(2)).sum();
        (sum / (count - 1) as f64).sqrt()
    }
}

/// The nearest number at or above `near` that shares no divisor with `count`.
fn coprime_near(near: usize, count: usize) -> usize {
    let prime = |&n: &usize| {
        let (mut a, mut b) = (n, count);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    (near.max(1)..).find(prime).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stratum(count: u32) -> Stratum {
        Stratum { members: (0..count).collect(), is_even: true, drawn: 0, weight: 1.0, seen: Vec::new() }
    }

    #[test]
    fn noise_falls_out_and_its_size_is_told() {
        // Every tenth texel is off by 1, the others by 0.1; witnesses are off by up to 2 (uniformly: a square of 4/3).
        let texels: Vec<u32> = (0..20_000).collect();
        let class: Vec<u8> = texels.iter().map(|e| u8::from(e.is_multiple_of(10))).collect();
        let sampling = Sampling { texels: &texels, class: &class, first: 8, rays: 4000, resolution: 0.0 };
        let noise = |bits: u32| f64::from(crate::sampling::mixed(bits)) / f64::from(u32::MAX) * 4.0 - 2.0;
        let off = |e: u32| {
            let by = if e.is_multiple_of(10) { 1.0 } else { 0.1 };
            Off { by: [by + noise(2 * e + 1), by + noise(2 * e + 2)], rays: 1 }
        };
        let never = std::sync::atomic::AtomicBool::new(false);
        let progress = Progress::begin(&crate::progress::Silent, &never, crate::progress::Stage::Audit, 4000);
        let mut survey = Survey::new(sampling);
        survey.run(off, &progress).unwrap();
        let found = survey.found();
        let truth = 0.1 + 0.9 * 0.01;
        assert!((found.square - truth).abs() < 3.0 * found.doubt, "{found:?}");
        assert!((found.noise / (4.0 / 3.0) - 1.0).abs() < 0.1, "{found:?}");
        assert!((found.of_even[0] - 0.9 * 0.01).abs() < 3.0 * found.doubt, "{found:?}");
        assert!((found.of_even[1] / (0.9 * 4.0 / 3.0) - 1.0).abs() < 0.1, "{found:?}");
        assert!(found.doubt < 0.05 && found.rays <= 4000 + ROUND as u64 + 2, "{found:?}");
    }

    #[test]
    fn every_member_is_drawn_once() {
        for count in [1, 2, 3, 10, 64, 97, 1000] {
            let mut stratum = stratum(count);
            let mut drawn: Vec<u32> = (0..count).flat_map(|_| stratum.draw(3)).collect();
            drawn.sort_unstable();
            assert_eq!(drawn, (0..count).collect::<Vec<_>>(), "{count}");
        }
    }

    #[test]
    fn few_draws_are_spread_out() {
        let mut drawn = stratum(1000).draw(10);
        drawn.sort_unstable();
        // Ten points of the golden section leave no gap wider than 2.1 times the even one (three-gap theorem, φ²/10).
        let gaps = drawn.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(gaps.max().unwrap() <= 262, "{drawn:?}");
    }
}
