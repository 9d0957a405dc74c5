//! Which shadow rays an element sends.

use super::EmitterList;
use crate::options::DirectOptions;
use crate::sampling::{seeded, shifted, sobol4};

/// Patterns repeat every three texels, so that any 3×3 neighbourhood holds each of them once (interleaved sampling,
/// Keller & Heidrich 2001): averaging nine neighbours then averages nine different sets.
pub const PERIOD: usize = 3;

/// The sample sets, made once.
pub struct Patterns {
    /// Per texel phase: `[texel u, texel v, emitter u, emitter v]` of the probe,
    probe: Vec<Vec<[f32; 4]>>,
    /// of the probe of a light without extent,
    sharp_probe: Vec<Vec<[f32; 4]>>,
    /// and of the refinement.
    pub refine: Vec<Vec<[f32; 4]>>,
    /// Whether every texel counts as one that a shadow border passes, and none is averaged with its neighbours.
    pub everywhere: bool,
    /// Whether texels are probed from which surely all of the emitter is seen.
    pub clear_probed: bool,
    /// Standard error of a visible share found by one set of the refinement. The border of a shadow cuts the four
    /// dimensions of texel and emitter into two parts; of n cells that n well-spread points stand for it passes through
    /// about n^(3/4), each of which errs by up to a half: n^(3/8) / (2n).
    pub visibility_error: f32,
}

impl Patterns {
    /// Sets for the given effort and these emitters; other ones for every `seed`.
    pub fn new(options: &DirectOptions, emitters: &EmitterList, seed: u32) -> Self {
        let phases = PERIOD * PERIOD;
        let probe_rays = options.probe_rays.max(1);
        // One stratified set over all phases, dealt out so that each phase gets a spread-out share.
        let all = sobol4(probe_rays * phases as u32, 0, seeded(seed, 1));
        let probe: Vec<Vec<_>> =
            (0..phases).map(|k| (0..probe_rays as usize).map(|i| all[i * phases + k]).collect()).collect();
        let refine_rays = options.penumbra_rays.max(4);
        let base = sobol4(refine_rays, 0, seeded(seed, 2));
        let refine = (0..phases)
            .map(|k| {
                let k = k as f32;
                // R4: the generalised golden ratio's powers, a well-spread set of turns.
                let turn = |ratio: f32| (k * ratio).fract();
                shifted(&base, [turn(0.856_674_9), turn(0.733_891_9), turn(0.628_706_7), turn(0.538_597_3)])
            })
            .collect();
        // Two dimensions less: half the points. Asked as if there were an extent, each stands for two points of the light.
        let times = if emitters.sharp_as_soft { 2 } else { 1 };
        let half = |points: &Vec<[f32; 4]>| {
            let points = points[..points.len().div_ceil(2)].iter();
            points.flat_map(|&point| std::iter::repeat_n(point, times)).collect()
        };
        let sharp_probe = probe.iter().map(half).collect();
        let visibility_error = 0.5 * (refine_rays as f32).powf(-0.625);
        let (everywhere, clear_probed) = (options.probe_rays == 0, emitters.clear_probed);
        Self { probe, sharp_probe, refine, everywhere, clear_probed, visibility_error }
    }

    /// Points of a texel's probe.
    pub fn probe(&self, phase: usize, is_sharp: bool) -> &[[f32; 4]] {
        if is_sharp { &self.sharp_probe[phase] } else { &self.probe[phase] }
    }

    /// The phase of a texel.
    pub fn phase(x: usize, y: usize) -> usize {
        (y % PERIOD) * PERIOD + x % PERIOD
    }
}
