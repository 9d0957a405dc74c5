//! One number for all effort: how far off the light may be.
//!
//! A level of quality and a tolerance both become an [`ErrorBudget`], which is split over the stages; what each may err
//! becomes a place on that stage's ladder of effort ([`Effort`]), and the place its settings. The ladders' rungs are the
//! levels; what a rung usually errs was measured on the fixtures, and only says where to begin: a bake to a tolerance
//! measures, and goes on from there.

use super::{DirectOptions, GatherOptions, LightOptions, Quality, SolveOptions};

/// What the rungs usually err, as a share of the mean light: `study accuracy`, fixtures at 256².
const USUAL: [f64; RUNGS] = [0.030, 0.021, 0.014, 0.006, 0.0026];
const RUNGS: usize = 5;
/// The highest places: there shadow rays, patches and gather rays are as many as is of any use.
pub(super) const MOST: Effort = Effort { direct: 7.0, solve: 5.0, gather: 6.5, nodes: 6.5 };

/// Shares of the mean square that may be off, in the order of [`Effort`]'s parts. What a part costs falls with a power a of
/// its mean square, and all together cost least where shares are as a times what the part costs: gathers cost most, by
/// their rays (a = 1/1.2) and by their nodes (a about 0.4).
pub(super) const SHARES: [f64; PARTS] = [0.25, 0.15, 0.4, 0.2];
pub(super) const PARTS: usize = 4;
/// Above this rung what few probes miss, shadows smaller than a texel, is more than what shadow rays err: passes to a goal
/// refine every texel.
const REFINED_EVERYWHERE: f64 = 2.0;
/// The lowest place that does.
pub(super) const LEAST_REFINED: f64 = REFINED_EVERYWHERE + 0.01;
/// The share of texels that a shadow border passes, about.
const BORDERS: f64 = 0.12;

/// Probe and shadow rays.
const DIRECT: [[f64; 2]; RUNGS] = [[4.0, 16.0], [6.0, 32.0], [8.0, 64.0], [16.0, 128.0], [16.0, 256.0]];
/// Patches, and rays of each: a texel in a corner sees little but one patch, and with it that patch's noise. Where patches
/// come down to texels it is the rays that count (corridor, 128², 16,000 patches: 0.95, 0.40 and 0.22 % by 64, 256 and 1024).
const SOLVE: [[f64; 2]; RUNGS] =
    [[1000.0, 32.0], [2000.0, 32.0], [4000.0, 32.0], [8000.0, 128.0], [16000.0, 256.0]];
/// Gather rays.
const GATHER: [[f64; 1]; RUNGS] = [[128.0], [192.0], [256.0], [1024.0], [4096.0]];
/// The difference of nodes that is interpolated over.
const NODES: [[f64; 1]; RUNGS] = [[0.12], [0.08], [0.05], [0.02], [0.008]];

/// How far off the light may be: root mean squares as shares of the mean light. The total is of what is stored, at texels;
/// the same again may be added by looking up between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorBudget {
    /// In all.
    pub total: f64,
    /// Of it shadow borders,
    pub direct: f64,
    /// the coarse solution as seen by gathers,
    pub solve: f64,
    /// the few rays of a gather,
    pub gather: f64,
    /// and interpolation between gathers.
    pub interpolation: f64,
    /// Apart from the total, which is that at texels: lookups between them. Only more texels make it less.
    pub between_texels: f64,
}

/// What an audit found, in the same parts.
pub type Errors = ErrorBudget;

/// A place on every stage's ladder: 0 is draft's, 4 reference's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Shadow rays.
    pub direct: f64,
    /// Patches and their rays.
    pub solve: f64,
    /// Gather rays.
    pub gather: f64,
    /// How close to each other gathers are.
    pub nodes: f64,
}

impl ErrorBudget {
    /// So much in all, split as pays best.
    pub fn new(total: f64) -> Self {
        let [direct, solve, gather, interpolation] = SHARES.map(|share| share.sqrt() * total);
        Self { total, direct, solve, gather, interpolation, between_texels: total }
    }

    pub(super) fn parts(&self) -> [f64; PARTS] {
        [self.direct, self.solve, self.gather, self.interpolation]
    }

    /// What a level usually errs.
    pub fn of(quality: Quality) -> Self {
        Self::new(USUAL[quality as usize])
    }

    /// The places where stages usually err as much.
    pub fn effort(&self) -> Effort {
        let parts = self.parts();
        Effort::of_parts(std::array::from_fn(|k| place(parts[k] / SHARES[k].sqrt()))).within_reach()
    }
}

impl Effort {
    /// All stages at one place.
    pub fn all(place: f64) -> Self {
        Self::of_parts([place; PARTS]).within_reach()
    }

    pub(super) fn of_parts([direct, solve, gather, nodes]: [f64; PARTS]) -> Self {
        Self { direct, solve, gather, nodes }
    }

    pub(super) fn parts(&self) -> [f64; PARTS] {
        [self.direct, self.solve, self.gather, self.nodes]
    }

    /// Neither below draft nor beyond what is of use.
    pub(super) fn within_reach(self) -> Self {
        let (parts, most) = (self.parts(), MOST.parts());
        Self::of_parts(std::array::from_fn(|k| parts[k].clamp(0.0, most[k])))
    }

    /// Whether no stage could do more.
    pub fn is_most(&self) -> bool {
        *self == MOST
    }

    /// So many rungs higher, everywhere.
    pub fn raised(self, by: f64) -> Self {
        Self::of_parts(self.parts().map(|part| part + by)).within_reach()
    }

    /// The settings; everything else is as in `base`.
    pub fn light(&self, base: &LightOptions) -> LightOptions {
        let whole = |x: f64| x.round().max(1.0) as u32;
        let [probe, shadow] = between(&DIRECT, self.direct);
        let [patches, rays_per_patch] = between(&SOLVE, self.solve);
        let ([rays], [tolerance]) = (between(&GATHER, self.gather), between(&NODES, self.nodes));
        LightOptions {
            direct: DirectOptions { probe_rays: whole(probe).min(64), penumbra_rays: whole(shadow) },
            solve: SolveOptions {
                patches: whole(patches),
                rays_per_patch: whole(rays_per_patch).next_power_of_two(),
                ..base.solve.clone()
            },
            gather: GatherOptions {
                // Sobol's points are spread best by powers of two, and well by many of them.
                rays: whole(rays / 32.0) * 32,
                tolerance: tolerance as f32,
                ..base.gather.clone()
            },
            ..base.clone()
        }
    }

    /// Whether a pass to a goal refines every texel that may be in shadow.
    pub(super) fn refines_everywhere(&self) -> bool {
        self.direct > REFINED_EVERYWHERE
    }

    /// The settings of a pass to a goal.
    pub fn light_of_pass(&self, base: &LightOptions) -> LightOptions {
        let mut light = self.light(base);
        if self.refines_everywhere() {
            light.direct.probe_rays = 0;
        }
        light
    }

    /// The places where settings stand.
    pub fn of(light: &LightOptions) -> Self {
        Self {
            direct: place_of(&DIRECT, 1, f64::from(light.direct.penumbra_rays)),
            solve: place_of(&SOLVE, 0, f64::from(light.solve.patches)),
            gather: place_of(&GATHER, 0, f64::from(light.gather.rays)),
            nodes: place_of(&NODES, 0, node_tolerance(&light.gather)),
        }
        .within_reach()
    }

    /// The error of the parts that could not do more.
    pub fn beyond_help(&self, found: &Errors) -> f64 {
        let (at, most, off) = (self.parts(), MOST.parts(), found.parts());
        (0..PARTS).filter(|&k| at[k] >= most[k]).map(|k| off[k].powi(2)).sum::<f64>().sqrt()
    }
}

/// How many times more direct light, coarse solution and gather usually take with one set of options than with another.
pub fn growth(from: &LightOptions, to: &LightOptions) -> [f64; 3] {
    let work = |light: &LightOptions| {
        let LightOptions { direct, solve, gather, .. } = light;
        let shadow = f64::from(direct.penumbra_rays);
        let direct = match direct.probe_rays {
            0 => shadow,
            probe => f64::from(probe) + BORDERS * shadow,
        };
        let solve = f64::from(solve.patches) * f64::from(solve.rays_per_patch);
        // Nodes stand as far apart as the root of the tolerance allows for a bend, and along edges they do not thin out:
        // between -1/2 and -1 by power.
        [direct, solve, f64::from(gather.rays) * node_tolerance(gather).powf(-0.6)]
    };
    let (to, from) = (work(to), work(from));
    std::array::from_fn(|k| to[k] / from[k])
}

/// The difference of nodes that is interpolated over; gathers at every texel are about as many as the last rung's.
fn node_tolerance(gather: &GatherOptions) -> f64 {
    if gather.tolerance > 0.0 { f64::from(gather.tolerance) } else { NODES[RUNGS - 1][0] }
}

/// The place on a ladder where one of its columns has this value.
fn place_of<const N: usize>(rungs: &[[f64; N]; RUNGS], column: usize, value: f64) -> f64 {
    let at = rungs.map(|rung| rung[column]);
    let rises = at[RUNGS - 1] > at[0];
    let below =
        (0..RUNGS - 2).find(|&k| (value < at[k + 1]) == rises && value != at[k + 1]).unwrap_or(RUNGS - 2);
    below as f64 + (value / at[below]).ln() / (at[below + 1] / at[below]).ln()
}

/// A row of a ladder at a place: between its rungs, and beyond the last, in equal ratios.
fn between<const N: usize>(rungs: &[[f64; N]; RUNGS], place: f64) -> [f64; N] {
    let below = (place.max(0.0) as usize).min(RUNGS - 2);
    let t = place.max(0.0) - below as f64;
    if t == 0.0 || t == 1.0 {
        return rungs[below + t as usize];
    }
    std::array::from_fn(|k| rungs[below][k] * (rungs[below + 1][k] / rungs[below][k]).powf(t))
}

/// What a place usually errs.
pub(super) fn usual(place: f64) -> f64 {
    between(&USUAL.map(|error| [error]), place)[0]
}

/// The place that usually errs so much; below the first rung and beyond the last in their neighbours' ratios.
pub(super) fn place(error: f64) -> f64 {
    // The errors of rungs are their places to the last bit, so that levels are what they are.
    if let Some(rung) = USUAL.iter().position(|usual| (error / usual - 1.0).abs() < 1e-12) {
        return rung as f64;
    }
    let below = (0..RUNGS - 2).find(|&k| error > USUAL[k + 1]).unwrap_or(RUNGS - 2);
    below as f64 + (error / USUAL[below]).ln() / (USUAL[below + 1] / USUAL[below]).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_what_they_are() {
        let told = |quality: Quality| {
            let LightOptions { direct, solve, gather, .. } = quality.light();
            let rays =
                [direct.probe_rays, direct.penumbra_rays, solve.patches, solve.rays_per_patch, gather.rays];
            (rays, gather.tolerance)
        };
        assert_eq!(told(Quality::Draft), ([4, 16, 1000, 32, 128], 0.12));
        assert_eq!(told(Quality::Preview), ([6, 32, 2000, 32, 192], 0.08));
        assert_eq!(told(Quality::Good), ([8, 64, 4000, 32, 256], 0.05));
        assert_eq!(told(Quality::High), ([16, 128, 8000, 128, 1024], 0.02));
        assert_eq!(told(Quality::Reference), ([16, 256, 16000, 256, 4096], 0.0));
    }

    #[test]
    fn a_level_s_budget_is_that_level() {
        for quality in [Quality::Draft, Quality::Preview, Quality::Good, Quality::High, Quality::Reference] {
            let effort = ErrorBudget::of(quality).effort();
            let level = quality as usize as f64;
            for place in effort.parts().into_iter().chain(Effort::of(&quality.light()).parts()) {
                assert!((place - level).abs() < 1e-6, "{quality:?}: {effort:?}");
            }
        }
    }

    #[test]
    fn places_and_errors_are_inverse_and_monotone() {
        let mut before = f64::INFINITY;
        for step in -10..=70 {
            let at = f64::from(step) / 10.0;
            let error = USUAL[0] * (USUAL[1] / USUAL[0]).powf(at.min(0.0)) * usual(at) / USUAL[0];
            if at >= 0.0 {
                assert!((place(usual(at)) - at).abs() < 1e-9, "{at}");
            }
            assert!(error < before, "{at}");
            before = error;
        }
    }

    #[test]
    fn the_budget_s_parts_add_up() {
        let budget = ErrorBudget::new(0.01);
        let square: f64 = budget.parts().iter().map(|part| part * part).sum();
        assert!((square.sqrt() - budget.total).abs() < 1e-12);
    }

    #[test]
    fn parts_that_could_do_no_more_are_beyond_help() {
        let found = Errors {
            total: 0.05,
            direct: 0.03,
            solve: 0.04,
            gather: 0.1,
            interpolation: 0.2,
            between_texels: 0.0,
        };
        let at = Effort { direct: MOST.direct, solve: MOST.solve, gather: 1.0, nodes: 2.0 };
        assert!((at.beyond_help(&found) - 0.05).abs() < 1e-12);
        assert_eq!(Effort::all(1.0).beyond_help(&found), 0.0);
    }
}
