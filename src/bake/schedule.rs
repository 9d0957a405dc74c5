//! How much effort goes into the next pass: from coarse to fine, until the goal is met.

use super::Log;
use super::passes::Pass;
use crate::audit::Audit;
use crate::error::Warning;
use crate::options::{Anew, BakeOptions, Effort, Errors, Experience, Goal, LightOptions, Step, growth};
use crate::progress::Stage;
use crate::sampling::mixed;
use crate::text;

/// Passes to a tolerance, at the most.
const MOST_PASSES: usize = 8;
/// A pass that brings the error below this share of the last one's was worth it.
const WORTHWHILE: f64 = 0.92;
/// So many passes in a row that were not, and the tolerance is out of reach.
const MOST_IDLE: usize = 3;
/// The smallest step up that is worth a pass.
const LEAST_STEP: f64 = 0.5;
/// A pass that takes longer than this many times the last one is not foretold well: one between them comes first.
const FAR: f64 = 8.0;
/// Forecasts are trusted to this share.
const TRUST: f64 = 0.9;
/// An audit is given this share of the time that is left, and what the last one took at least.
const AUDIT_TIME: f64 = 0.07;
/// Where it decides what comes next, an audit may take this many times what it may otherwise.
const DECIDING: f64 = 3.0;
/// A tolerance is reached when the error is below it, and even with what the estimate may be off by below this many times.
const SURELY: f64 = 1.25;

/// What audits may cost, as a share of the rays, and the error that they must tell from nothing.
pub fn audit(options: &BakeOptions) -> (f64, f64) {
    match options.goal {
        Goal::Tolerance(wanted) => (DECIDING * f64::from(options.light.least_audit_share()), wanted),
        Goal::Effort | Goal::Seconds(_) => (f64::from(options.light.audit_share), 0.0),
    }
}

const STAGES: [Stage; 3] = [Stage::Direct, Stage::Solve, Stage::Gather];

/// Between the seeds of passes: 2³² by the golden ratio.
const SEED_STEP: u32 = 0x9e37_79b9;

/// A pass to come.
pub struct Next {
    pub light: LightOptions,
    /// What of the last pass is not kept.
    pub anew: Anew,
    /// The shares of what it finds, direct and reflected, in the blends with what there is.
    pub shares: [f64; 2],
}

impl Next {
    /// One that begins from nothing.
    fn alone(light: LightOptions) -> Self {
        Self { light, anew: Anew::ALL, shares: [1.0; 2] }
    }
}

/// Decides.
pub struct Schedule<'a> {
    options: &'a BakeOptions,
    /// Passes so far.
    passes: usize,
    step: Step,
    /// Seconds of the light stages and the audit before the last pass.
    before_s: [f64; 4],
    /// Seconds of the last audit.
    audit_s: f64,
    last_error: Option<f64>,
    /// What passes so far tell of the scene.
    known: Experience,
    idle: usize,
    /// Whether a glance at the whole comes before the work.
    look_first: bool,
    pub warnings: Vec<Warning>,
}

impl<'a> Schedule<'a> {
    /// `look_first`: somebody wants to see something soon.
    pub fn new(options: &'a BakeOptions, look_first: bool) -> Self {
        Self {
            options,
            passes: 0,
            step: Step::whole(Effort::all(0.0)),
            before_s: [0.0; 4],
            audit_s: 0.0,
            last_error: None,
            known: Experience::default(),
            idle: 0,
            look_first,
            warnings: Vec::new(),
        }
    }

    /// The first pass.
    pub fn first(&mut self, log: &Log) -> Next {
        (self.passes, self.before_s) = (1, spent(log));
        match self.options.goal {
            Goal::Effort if !self.draft_first() => Next::alone(self.options.light.clone()),
            _ => self.of_step(),
        }
    }

    /// Tells of a pass that is about to begin.
    pub fn tell(&self, next: &Next, log: &Log) {
        log.run.observer.pass(self.passes, &next.light, self.known.error(Effort::of(&next.light)));
    }

    /// The pass that the present step asks for. Each has samples of its own.
    fn of_step(&self) -> Next {
        let mut light = self.step.effort.light_of_pass(&self.options.light);
        if self.passes > 1 {
            light.seed = mixed(light.seed.wrapping_add(SEED_STEP.wrapping_mul(self.passes as u32)));
        }
        Next { light, anew: self.step.anew, shares: self.known.shares(self.step) }
    }

    /// The next pass; `None` when there is to be none.
    pub fn next(&mut self, last: &Pass, log: &Log) -> Option<Next> {
        if log.cancelled() {
            return None;
        }
        self.passes += 1;
        let next = match self.options.goal {
            Goal::Effort => {
                (self.passes == 2 && self.draft_first()).then(|| Next::alone(self.options.light.clone()))
            }
            Goal::Tolerance(wanted) => self.of_tolerance(wanted, last.audit?),
            Goal::Seconds(seconds) => self.of_seconds(seconds, last, log),
        };
        self.before_s = spent(log);
        next
    }

    /// Whether a draft comes before the effort that was asked for.
    fn draft_first(&self) -> bool {
        let wanted = &self.options.light;
        self.look_first && wanted.gather.rays > Effort::all(0.0).light(wanted).gather.rays
    }

    /// When the next pass is cut short, in the clock's seconds; the first never is.
    pub fn until(&self, log: &Log) -> Option<f64> {
        match self.options.goal {
            Goal::Seconds(seconds) if self.passes > 1 => {
                let left = seconds - log.seconds();
                Some(log.started + seconds - self.audit_s.max(AUDIT_TIME * left))
            }
            _ => None,
        }
    }

    fn of_tolerance(&mut self, wanted: f64, audit: Audit) -> Option<Next> {
        let at_most = (audit.total.powi(2) + 2.0 * audit.total * audit.uncertainty).sqrt();
        if audit.total <= wanted && at_most <= SURELY * wanted {
            return None;
        }
        self.known.learn(self.step, &parts_of(&audit));
        let gained = self.last_error.is_none_or(|before| audit.total < WORTHWHILE * before);
        self.idle = if gained { 0 } else { self.idle + 1 };
        self.last_error = Some(audit.total);
        let out_of_reach = self.step.effort.beyond_help(&parts_of(&audit)) > wanted;
        if out_of_reach || self.step.effort.is_most() || self.idle == MOST_IDLE || self.passes > MOST_PASSES {
            self.warnings.push(Warning::new(
                "tolerance",
                format!(
                    "{} was asked for and about {} reached: more rays do not help",
                    text::percent(wanted),
                    text::percent(audit.total),
                ),
            ));
            return None;
        }
        // What the estimate may be off by counts: where it is small enough but not surely, more effort makes it so.
        let surely = if audit.total <= wanted { at_most / audit.total } else { 1.0 };
        // Estimates err: what helped little may have been too little.
        self.step = self.known.towards(wanted / surely);
        if self.idle > 0 {
            self.step = Step::whole(self.step.effort.raised(LEAST_STEP * self.idle as f64));
        }
        Some(self.of_step())
    }

    fn of_seconds(&mut self, seconds: f64, last: &Pass, log: &Log) -> Option<Next> {
        if let Some(audit) = last.audit.filter(|_| last.whole) {
            self.known.learn(self.step, &parts_of(&audit));
        }
        let now = spent(log);
        self.audit_s = now[3] - self.before_s[3];
        let left = seconds - log.seconds();
        let left = left - self.audit_s.max(AUDIT_TIME * left);
        if self.passes == 2 && left < 0.0 {
            self.warnings.push(Warning::new(
                "time",
                format!("even a draft takes longer than the {seconds:.3} s it was given; this is one"),
            ));
        }
        if left <= 0.0 || !last.whole || self.step.effort.is_most() {
            return None;
        }
        let took: [f64; 3] = std::array::from_fn(|k| now[k] - self.before_s[k]);
        let predicted = |by: f64| -> f64 {
            let [from, to] =
                [0.0, by].map(|by| self.step.effort.raised(by).light_of_pass(&self.options.light));
            took.iter().zip(growth(&from, &to)).map(|(seconds, growth)| seconds * growth).sum()
        };
        let highest = |limit: f64| {
            let steps = (2..=36).map(|k| f64::from(k) / 4.0);
            steps.take_while(|&by| predicted(by) <= limit).last().unwrap_or(LEAST_STEP)
        };
        let by =
            if left > FAR * took.iter().sum::<f64>() { highest(left / FAR) } else { highest(TRUST * left) };
        self.step = Step::whole(self.step.effort.raised(by.max(LEAST_STEP)));
        Some(self.of_step())
    }
}

fn parts_of(audit: &Audit) -> Errors {
    let Audit { total, direct, solve, gather, interpolation, between_texels, .. } = *audit;
    Errors { total, direct, solve, gather, interpolation, between_texels }
}

/// Seconds that the light stages and the audit took so far.
fn spent(log: &Log) -> [f64; 4] {
    let [a, b, c] = STAGES.map(|stage| log.seconds_of(stage));
    [a, b, c, log.seconds_of(Stage::Audit)]
}
