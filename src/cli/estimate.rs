//! How far a bake is and how long it will take: stages weighted by what they usually cost, corrected by what they
//! did cost. Pure arithmetic; whoever has a clock passes the time in.

use lightkiln::options::{LightOptions, Quality, growth};
use lightkiln::progress::Stage;

/// Usual cost of each stage at quality `good`, in shares of no particular whole.
const TYPICAL: [(Stage, f64); Stage::ALL.len()] = [
    (Stage::Import, 1.0),
    (Stage::Sizing, 0.0),
    (Stage::Plan, 0.2),
    (Stage::Atlas, 6.0),
    (Stage::Transport, 1.0),
    (Stage::Elements, 4.0),
    (Stage::Direct, 30.0),
    (Stage::Solve, 10.0),
    (Stage::Gather, 40.0),
    (Stage::Audit, 4.0),
    (Stage::Resolve, 3.0),
    (Stage::Export, 4.0),
];

/// No time left is told before this share is done: it would jump about.
const FIRST_ESTIMATE: f64 = 0.03;
/// Nor before this much time has passed, seconds.
const FIRST_ESTIMATE_S: f64 = 1.0;

/// Where a bake stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Share that is done, in `[0, 1]`; never falls.
    pub share: f64,
    /// Seconds to go, once there is enough to go by.
    pub left_s: Option<f64>,
}

/// Follows a bake through its stages, or through those of one pass.
#[derive(Debug)]
pub struct Estimate {
    weights: [f64; Stage::ALL.len()],
    began_s: f64,
    stage: usize,
    stage_began_s: f64,
    share: f64,
}

impl Estimate {
    /// A bake at this effort, about to begin.
    pub fn new(light: &LightOptions) -> Self {
        Self { weights: weights(light), began_s: 0.0, stage: 0, stage_began_s: 0.0, share: 0.0 }
    }

    /// A pass at this effort begins `now_s` seconds after the start. The first goes on with what came before it; those that
    /// follow are followed for themselves: nobody knows how many there will be.
    pub fn pass(&mut self, number: usize, light: &LightOptions, now_s: f64) {
        self.weights = weights(light);
        if number > 1 {
            self.weights[..Stage::Direct as usize].fill(0.0);
            (self.began_s, self.share) = (now_s, 0.0);
        }
    }

    /// A stage begins `now_s` seconds after the start.
    pub fn begin(&mut self, stage: Stage, now_s: f64) {
        self.stage = stage as usize;
        self.stage_began_s = now_s;
    }

    /// Where the bake stands `now_s` seconds after its start, when the current stage has done `stage_share` of its
    /// work.
    pub fn at(&mut self, now_s: f64, stage_share: f64) -> Standing {
        let stage_share = stage_share.clamp(0.0, 1.0);
        let (before, rest) = self.weights.split_at(self.stage);
        let current = rest[0];
        let after: f64 = rest[1..].iter().sum();
        let done = before.iter().sum::<f64>() + current * stage_share;
        let total = done + current * (1.0 - stage_share) + after;
        self.share = self.share.max(done / total);

        let took_s = now_s - self.began_s;
        let told = done / total >= FIRST_ESTIMATE && took_s >= FIRST_ESTIMATE_S;
        let left_s = told.then(|| {
            // The stage's own pace beats the table as soon as it has one.
            let seconds_per_weight = took_s / done;
            let own = if stage_share > 0.02 {
                (now_s - self.stage_began_s) * (1.0 - stage_share) / stage_share
            } else {
                seconds_per_weight * current * (1.0 - stage_share)
            };
            own + seconds_per_weight * after
        });
        Standing { share: self.share, left_s }
    }
}

/// Where a bake stands that ends in time.
pub fn within_time(now_s: f64, seconds: f64) -> Standing {
    Standing { share: (now_s / seconds).clamp(0.0, 1.0), left_s: Some((seconds - now_s).max(0.0)) }
}

fn weights(light: &LightOptions) -> [f64; Stage::ALL.len()] {
    let effort = relative_effort(light);
    TYPICAL.map(|(stage, weight)| match stage {
        Stage::Direct => weight * effort.direct,
        Stage::Solve => weight * effort.solve,
        Stage::Gather => weight * effort.gather,
        _ => weight,
    })
}

struct Effort {
    direct: f64,
    solve: f64,
    gather: f64,
}

/// Rays of the light stages, relative to quality `good`.
fn relative_effort(light: &LightOptions) -> Effort {
    // Interpolation gathers at about 4 % of the texels.
    let good = Quality::Good.light();
    let [direct, solve, _] = growth(&good, light);
    let gathered = |light: &LightOptions| {
        f64::from(light.gather.rays) * if light.gather.tolerance > 0.0 { 0.04 } else { 1.0 }
    };
    Effort { direct, solve, gather: gathered(light) / gathered(&good) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs a bake whose stages take `seconds`; returns the worst relative error of the estimates made after
    /// `from` of the time has passed.
    fn worst_error(seconds: [f64; Stage::ALL.len()], from: f64) -> f64 {
        let mut estimate = Estimate::new(&LightOptions::default());
        let total: f64 = seconds.iter().sum();
        let (mut now, mut worst, mut share) = (0.0, 0.0_f64, 0.0);
        for (stage, length) in Stage::ALL.into_iter().zip(seconds) {
            estimate.begin(stage, now);
            for step in 0..=10 {
                let at = now + length * f64::from(step) / 10.0;
                let standing = estimate.at(at, f64::from(step) / 10.0);
                assert!(standing.share >= share && standing.share <= 1.0 + 1e-12);
                share = standing.share;
                if let Some(left) = standing.left_s.filter(|_| at >= from * total) {
                    worst = worst.max((left - (total - at)).abs() / total);
                }
            }
            now += length;
        }
        assert!((share - 1.0).abs() < 1e-12);
        worst
    }

    #[test]
    fn the_table_follows_the_pipeline() {
        for (index, (stage, _)) in TYPICAL.into_iter().enumerate() {
            assert_eq!(stage, Stage::ALL[index]);
            assert_eq!(stage as usize, index);
        }
    }

    #[test]
    fn a_typical_bake_is_foretold_exactly() {
        assert!(worst_error(TYPICAL.map(|(_, weight)| weight * 0.7), 0.0) < 1e-9);
    }

    #[test]
    fn a_long_last_stage_is_foretold_from_its_own_pace() {
        let mut seconds = TYPICAL.map(|(_, weight)| weight * 0.1);
        seconds[Stage::Gather as usize] = 300.0;
        // What is left after the gather has 11 parts in the table, to 92 before; that much may be wrong.
        assert!(worst_error(seconds, 0.2) < 0.12);
    }

    #[test]
    fn a_bake_that_ends_in_time_is_measured_by_it() {
        assert_eq!(within_time(7.5, 30.0), Standing { share: 0.25, left_s: Some(22.5) });
        assert_eq!(within_time(31.0, 30.0), Standing { share: 1.0, left_s: Some(0.0) });
    }

    #[test]
    fn every_further_pass_begins_anew_and_ends_at_its_end() {
        let light = LightOptions::default();
        let mut estimate = Estimate::new(&light);
        estimate.begin(Stage::Audit, 90.0);
        let first = estimate.at(94.0, 1.0);
        assert!(first.share > 0.9);
        estimate.pass(2, &light, 100.0);
        let of_pass: f64 = TYPICAL[Stage::Direct as usize..].iter().map(|(_, weight)| weight).sum();
        let mut now = 100.0;
        for (stage, weight) in TYPICAL.into_iter().skip(Stage::Direct as usize) {
            estimate.begin(stage, now);
            let half = estimate.at(now + weight / 2.0, 0.5);
            assert!((half.share - (now + weight / 2.0 - 100.0) / of_pass).abs() < 1e-9, "{stage:?}");
            let left = 100.0 + of_pass - now - weight / 2.0;
            assert!(half.left_s.is_none_or(|told| (told - left).abs() < 1e-9), "{stage:?}");
            now += weight;
        }
        assert!(estimate.at(now, 1.0).share > 1.0 - 1e-9);
    }

    #[test]
    fn more_rays_weigh_more() {
        let weight = |quality: Quality| {
            let estimate = Estimate::new(&quality.light());
            estimate.weights[Stage::Gather as usize]
        };
        assert!(weight(Quality::Draft) < weight(Quality::Good));
        assert!(weight(Quality::Reference) > 100.0 * weight(Quality::Good));
    }
}
