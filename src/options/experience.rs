//! What a scene errs more or less than usual, as passes find out, and which pass is next.

use super::budget::{Effort, Errors, LEAST_REFINED, MOST, PARTS, SHARES, place, usual};

/// What is usual counts as this part of a look.
const USUAL_LOOKS: f64 = 0.3;
/// Estimates are off themselves, so a little less than what is allowed is aimed at.
const AIM: f64 = 0.85;
/// A smaller step up is not worth doing a stage again.
const LEAST_STEP: f64 = 0.25;
/// Further up than so many rungs, what a scene errs is not foretold well: a pass one rung below comes first.
const FARTHEST: f64 = 2.0;
/// An error of this many times a tolerance surely needs no other pass, or surely does.
const UNSURE: [f64; 2] = [0.7, 1.3];

const DIRECT: usize = 0;
const SOLVE: usize = 1;
const GATHER: usize = 2;
const NODES: usize = 3;

/// What a pass does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// How much.
    pub effort: Effort,
    /// Which light it finds anew.
    pub anew: Anew,
}

/// Which light a pass finds anew; the other is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Anew {
    /// Straight from lights.
    pub direct: bool,
    /// All other.
    pub reflected: bool,
}

impl Anew {
    /// All light.
    pub const ALL: Self = Self { direct: true, reflected: true };
}

impl Step {
    /// Whether shadow rays of its own make the direct light better together with others: few probes all miss the same shadows.
    fn blends_direct(&self) -> bool {
        self.anew.direct && self.effort.refines_everywhere()
    }

    /// Whether a part of its error is made smaller by other passes, as if all had been one. What patches and interpolation are off
    /// by is much the same in all.
    fn blends(&self, part: usize) -> bool {
        match part {
            DIRECT => self.blends_direct(),
            GATHER => self.anew.reflected,
            _ => false,
        }
    }

    /// All light at one effort.
    pub fn whole(effort: Effort) -> Self {
        Self { effort, anew: Anew::ALL }
    }
}

/// How many times as much as usual, in the mean square, each part errs in a scene. One look at few texels tells that badly, and
/// whoever follows it does too little where it happened to see too little: so looks are pooled, and what is usual counts as a
/// part of one.
#[derive(Clone, Debug)]
pub struct Experience {
    ratios: [f64; PARTS],
    looks: f64,
    /// The passes whose light is blended.
    passes: Vec<Step>,
}

impl Default for Experience {
    fn default() -> Self {
        Self { ratios: [USUAL_LOOKS; PARTS], looks: USUAL_LOOKS, passes: Vec::new() }
    }
}

impl Experience {
    /// Of one look alone, at light that no pass goes on with.
    pub fn of(at: Effort, found: &Errors) -> Self {
        let mut known = Self { ratios: [0.0; PARTS], looks: 0.0, passes: Vec::new() };
        known.look(usual_squares(at), found);
        known
    }

    /// Adds what was found after a pass.
    pub fn learn(&mut self, step: Step, found: &Errors) {
        self.passes.push(step);
        self.look(self.usual_together(), found);
    }

    fn look(&mut self, usual: [f64; PARTS], found: &Errors) {
        let found = found.parts();
        for k in 0..PARTS {
            self.ratios[k] += found[k].powi(2) / usual[k];
        }
        self.looks += 1.0;
    }

    /// The error that is to be expected at a place.
    pub fn error(&self, at: Effort) -> f64 {
        self.squares(at).iter().sum::<f64>().sqrt()
    }

    /// The shares of a pass in the blends of its direct and of its reflected light with what earlier ones found: by the squares of
    /// what they are expected to be off by.
    pub fn shares(&self, step: Step) -> [f64; 2] {
        let share = |parts: &[usize], blends: fn(&Step) -> bool| {
            let precision = |step: &Step| {
                let square: f64 = parts.iter().map(|&k| self.squares(step.effort)[k]).sum();
                1.0 / square.max(f64::MIN_POSITIVE.sqrt())
            };
            let before: f64 = self.passes.iter().filter(|step| blends(step)).map(precision).sum();
            if blends(&step) { precision(&step) / (precision(&step) + before) } else { 1.0 }
        };
        [share(&[DIRECT], Step::blends_direct), share(&[SOLVE, GATHER, NODES], |step| step.anew.reflected)]
    }

    /// The passes that a tolerance is likely to take, each with how likely it is to be taken; and whether the tolerance is
    /// likely to be reached.
    pub fn passes_to(&self, wanted: f64) -> ([(Step, f64); 2], bool) {
        let first = Step::whole(Effort::all(0.0));
        // Estimates are off by up to a third.
        let [surely_not, surely] = UNSURE.map(|times| times * wanted);
        let second = ((self.error(first.effort) - surely_not) / (surely - surely_not)).clamp(0.0, 1.0);
        let after = Self { passes: vec![first], ..self.clone() };
        ([(first, 1.0), (after.straight_to(wanted), second)], self.error(MOST) <= wanted)
    }

    /// The pass after those so far that is to bring the error down to `wanted`, or near to it.
    pub fn towards(&self, wanted: f64) -> Step {
        let mut step = self.straight_to(wanted);
        let (at, mut places) = (self.last().parts(), step.effort.parts());
        for k in (0..PARTS).filter(|&k| step.effort.parts()[k] > at[k] + FARTHEST) {
            places[k] -= 1.0;
        }
        step.effort = Effort::of_parts(places);
        step
    }

    /// What a stage does not need of its share of the error is left to the others.
    fn straight_to(&self, wanted: f64) -> Step {
        let at = self.last().parts();
        let usual_now = self.usual_together();
        let ratios = self.ratios.map(|sum| (sum / self.looks).max(1e-12));
        let off: [f64; PARTS] = std::array::from_fn(|k| usual_now[k] * ratios[k]);
        let (mut left, mut shares, mut short) = ((AIM * wanted).powi(2), 1.0, [true; PARTS]);
        // Stages that err less than their share keep what they have, which leaves more for the others: at most thrice.
        for _ in 0..PARTS {
            for k in 0..PARTS {
                if short[k] && off[k] <= left * SHARES[k] / shares {
                    (short[k], left, shares) = (false, left - off[k], shares - SHARES[k]);
                }
            }
        }
        // A part that earlier passes blended goes on so.
        let blend = |k: usize| self.passes.iter().any(|step| step.blends(k));
        let (mut places, mut anew) = (at, [false; PARTS]);
        for k in (0..PARTS).filter(|&k| short[k]) {
            let allowed = (left.max(0.0) * SHARES[k] / shares).max(1e-18) / ratios[k];
            let own = if blend(k) { 1.0 / (1.0 / allowed - 1.0 / usual_now[k]) } else { allowed };
            let wanted = place((own / SHARES[k]).sqrt());
            if blend(k) || wanted >= at[k] + LEAST_STEP {
                (places[k], anew[k]) = (wanted, true);
            }
        }
        if !anew.contains(&true) {
            // What errs most of what can do more.
            let can = |&k: &usize| blend(k) || at[k] < MOST.parts()[k];
            let worst = (0..PARTS).filter(can).max_by(|&a, &b| off[a].total_cmp(&off[b])).unwrap_or(GATHER);
            anew[worst] = true;
            if !blend(worst) {
                places[worst] += 2.0 * LEAST_STEP;
            }
        }
        // Better patches and nodes only show where the light that they are found by outweighs what there is.
        if anew[SOLVE] || anew[NODES] {
            places[GATHER] = places[GATHER].max(at[GATHER]);
        }
        if blend(DIRECT) {
            places[DIRECT] = places[DIRECT].max(LEAST_REFINED);
        }
        let reflected = anew[SOLVE] || anew[GATHER] || anew[NODES];
        Step {
            effort: Effort::of_parts(places).within_reach(),
            anew: Anew { direct: anew[DIRECT], reflected },
        }
    }

    fn last(&self) -> Effort {
        self.passes.last().map_or(Effort::all(0.0), |step| step.effort)
    }

    /// Mean squares that are to be expected of one pass at a place.
    fn squares(&self, at: Effort) -> [f64; PARTS] {
        let usual = usual_squares(at);
        std::array::from_fn(|k| usual[k] * self.ratios[k] / self.looks)
    }

    /// Mean squares that are usual for what the passes so far add up to.
    fn usual_together(&self) -> [f64; PARTS] {
        let mut together = usual_squares(self.last());
        for (k, together) in together.iter_mut().enumerate() {
            let blended = self.passes.iter().filter(|step| step.blends(k));
            let precision: f64 = blended.map(|step| 1.0 / usual_squares(step.effort)[k]).sum();
            if precision > 0.0 {
                *together = 1.0 / precision;
            }
        }
        together
    }
}

fn usual_squares(at: Effort) -> [f64; PARTS] {
    let places = at.parts();
    std::array::from_fn(|k| SHARES[k] * usual(places[k]).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors([direct, solve, gather, interpolation]: [f64; PARTS]) -> Errors {
        let total = [direct, solve, gather, interpolation].map(|part| part * part).iter().sum::<f64>().sqrt();
        Errors { total, direct, solve, gather, interpolation, between_texels: 0.0 }
    }

    /// After one pass that was found to err so, as often as leaves nothing of what is usual.
    fn after(first: Step, found: [f64; PARTS]) -> Experience {
        Experience { passes: vec![first], ..Experience::of(first.effort, &errors(found)) }
    }

    #[test]
    fn one_look_does_not_tell_everything() {
        let first = Step::whole(Effort::all(1.0));
        let mut known = Experience::default();
        let of_usual = |known: &Experience| -> [f64; PARTS] {
            std::array::from_fn(|k| known.squares(first.effort)[k] / usual_squares(first.effort)[k])
        };
        assert!(of_usual(&known).iter().all(|ratio| (ratio - 1.0).abs() < 1e-12));
        known.learn(first, &errors([0.0; PARTS]));
        let left = USUAL_LOOKS / (1.0 + USUAL_LOOKS);
        assert!(of_usual(&known).iter().all(|ratio| (ratio - left).abs() < 1e-12));
    }

    #[test]
    fn who_errs_works_again_and_who_does_not_is_kept() {
        let first = Step::whole(Effort::all(1.0));
        let known = after(first, [0.0005, 0.001, 0.02, 0.0008]);
        let next = known.towards(0.01);
        assert_eq!(next.anew, Anew { direct: false, reflected: true });
        assert_eq!((next.effort.direct, next.effort.solve, next.effort.nodes), (1.0, 1.0, 1.0));
        // Both passes together come down to what the others leave of the aim.
        let left =
            [0.0005_f64, 0.001, 0.0008].iter().fold((AIM * 0.01).powi(2), |left, part| left - part * part);
        let squares = [first.effort, next.effort].map(|effort| known.squares(effort)[GATHER]);
        let together = 1.0 / squares.map(|square| 1.0 / square).iter().sum::<f64>();
        assert!((together / left - 1.0).abs() < 1e-6, "{together} for {left}");
    }

    #[test]
    fn what_all_passes_share_is_made_finer() {
        let first = Step::whole(Effort::all(1.0));
        let next = after(first, [0.0, 0.02, 0.005, 0.02]).towards(0.01);
        assert_eq!(next.anew, Anew { direct: false, reflected: true });
        assert!(next.effort.solve > 2.0 && next.effort.nodes > 2.0 && next.effort.gather >= 1.0);
    }

    #[test]
    fn a_long_way_is_gone_in_two_steps() {
        let first = Step::whole(Effort::all(0.0));
        let known = after(first, [0.015, 0.012, 0.019, 0.014]);
        let (straight, next) = (known.straight_to(0.003), known.towards(0.003));
        let rungs = |step: Step| step.effort.parts().into_iter().fold(0.0, f64::max);
        assert!(rungs(straight) > FARTHEST && (rungs(straight) - rungs(next) - 1.0).abs() < 1e-9);
        assert!(known.towards(1e-9).effort.parts().iter().all(|&place| place > 3.0));
    }

    #[test]
    fn there_is_always_something_to_do() {
        let mut known = Experience::default();
        let mut step = Step::whole(Effort::all(0.0));
        for _ in 0..20 {
            known.learn(step, &errors([0.001; PARTS]));
            step = known.towards(0.5);
            assert!(step.anew.direct || step.anew.reflected);
        }
    }

    #[test]
    fn equal_passes_count_alike() {
        let first = Step::whole(Effort::all(1.0));
        let mut known = after(first, [0.01; PARTS]);
        let close = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 1e-12 && (b - d).abs() < 1e-12;
        // With few probes, direct light is not blended.
        assert!(close(known.shares(first), [1.0, 0.5]));
        known.passes.push(first);
        assert!(close(known.shares(first), [1.0, 1.0 / 3.0]));
        let finer = Step::whole(Effort::all(3.0));
        known.passes = vec![finer];
        assert!(close(known.shares(finer), [0.5; 2]));
        // Where nothing is off, whatever is found is as good.
        let none = after(first, [0.0; PARTS]);
        assert!(close(none.shares(first), [1.0, 0.5]));
    }
}
