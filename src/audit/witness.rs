//! One texel lit again, twice, by samples that nothing else uses.

use super::survey::Off;
use crate::direct::{Again, Direct, EmitterList, Faint};
use crate::elements::{Elements, Lookup, Patches};
use crate::gather::{Bright, DirectionSet, Surroundings};
use crate::plan::Sight;
use crate::sampling::mixed;
use crate::scene::Sky;
use crate::transport::{Hit, Tracer};
use crate::units::{Irradiance, Radiosity};
use glam::Vec3;
use std::cell::RefCell;
use std::sync::OnceLock;

/// Shadow rays towards every emitter whose border passes.
const SHADOW_RAYS: u32 = 64;
/// Rays of a gather: this part of the stage's, so that a witness errs about 1.5 times as much as what it judges; were it much
/// more, hundreds of texels would not tell the error from the witness' noise.
const GATHER_PART: u32 = 2;
/// Not fewer than this.
const LEAST_GATHER_RAYS: u32 = 128;
/// Rays that look for places where the coarse solution is compared with a gather, and of how many of them one is used.
const LOOKS: u32 = 16;
const EVERY: usize = 2;
/// Rays of these gathers.
const PLACE_RAYS: u32 = 32;
/// Sets of samples of faint emitters,
const FAINT_SETS: u32 = 8;
/// and of directions: to order one takes as long as some rays, and those of so many texels have little in common.
const DIRECTION_SETS: usize = 32;
/// Squared errors of gathers fall with this power of their rays: 2.1, 1.3, 0.56 % for 128, 256, 1024 in the Cornell box.
const NOISE_POWER: f64 = 1.2;

/// Light that is to be judged.
pub struct Lit<'a, T> {
    /// Receivers.
    pub elements: &'a Elements,
    /// The sources.
    pub emitters: &'a EmitterList,
    /// Light straight from bright ones.
    pub direct: &'a Direct,
    /// What is known to be seen by nobody.
    pub sight: &'a Sight,
    /// The world.
    pub tracer: &'a T,
    /// All other light, where there is any.
    pub reflections: Option<Reflections<'a>>,
}

/// Light that no bright emitter sent straight, and what it was made from.
pub struct Reflections<'a> {
    /// One row an element.
    pub irradiance: &'a [Irradiance],
    /// Whether an element sent rays, one row an element.
    pub gathered: &'a [bool],
    /// Rays of one gather.
    pub rays: u32,
    /// From hits to elements.
    pub lookup: &'a Lookup<'a>,
    /// Radiance of rays that leave.
    pub sky: &'a Sky,
    /// What gather rays saw: the coarse solution, where surfaces reflect anything.
    pub coarse: Option<(&'a Patches, &'a [Irradiance])>,
}

impl<T> Lit<'_, T> {
    /// All light of an element.
    pub fn irradiance(&self, element: u32) -> Irradiance {
        let e = element as usize;
        let reflected = self.reflections.as_ref().map_or(Irradiance::ZERO, |r| r.irradiance[e]);
        self.direct.irradiance[e] + reflected
    }
}

/// Lights texels again.
pub(super) struct Witness<'a, T> {
    lit: &'a Lit<'a, T>,
    again: Again<'a>,
    /// [`FAINT_SETS`] for each of the two: one set errs alike everywhere.
    faint: [Vec<Option<Faint<'a>>>; 2],
    /// Two with different samples.
    bright: [Option<Bright>; 2],
    /// What rays meet, without the bright patches; empty where nothing is reflected.
    radiosity: Vec<Radiosity>,
    directions: [Directions; 3],
    seed: u32,
}

/// Sets of as many directions, made when they are first asked for.
struct Directions {
    sets: [OnceLock<DirectionSet>; DIRECTION_SETS],
    rays: u32,
    seed: u32,
    sky_is_lit: bool,
}

impl Directions {
    fn new(rays: u32, seed: u32, sky_is_lit: bool) -> Self {
        Self { sets: std::array::from_fn(|_| OnceLock::new()), rays, seed, sky_is_lit }
    }

    /// One of those for the first or for the second of two: they have none in common.
    fn any(&self, of_two: usize, number: u32) -> &DirectionSet {
        let k = number.wrapping_mul(2).wrapping_add(of_two as u32) % DIRECTION_SETS as u32;
        self.sets[k as usize]
            .get_or_init(|| DirectionSet::new(self.rays, mixed(self.seed ^ (k + 1)), self.sky_is_lit))
    }
}

impl<'a, T: Tracer> Witness<'a, T> {
    pub fn new(lit: &'a Lit<'a, T>, seed: u32) -> Self {
        let seed = mixed(seed ^ 0x5eed_a0d1);
        let seeds = [mixed(seed ^ 1), mixed(seed ^ 2)];
        let Lit { elements, emitters, direct, sight, .. } = *lit;
        let faint = seeds.map(|seed| {
            let set = |number| Faint::new(elements, emitters, direct, mixed(seed ^ number));
            (0..FAINT_SETS).map(set).collect()
        });
        let coarse = lit.reflections.as_ref().and_then(|r| r.coarse.map(|coarse| (coarse, rays(r.rays))));
        let mut radiosity = Vec::new();
        let mut bright = None;
        if let Some(((patches, smooth), rays)) = coarse {
            let leaving = |e: usize| elements.reflectance[e] * (direct.irradiance[e] + smooth[e]);
            radiosity = (0..elements.len()).map(leaving).collect();
            bright = Bright::take(elements, patches, &mut radiosity, rays);
        }
        let bright = seeds.map(|seed| bright.as_ref().map(|bright| bright.aimed_anywhere(seed)));
        let (gathers, sky_is_lit) =
            lit.reflections.as_ref().map_or((LEAST_GATHER_RAYS, false), |r| (rays(r.rays), r.sky.is_lit()));
        let directions = [
            Directions::new(gathers, mixed(seed ^ 3), sky_is_lit),
            Directions::new(LOOKS, mixed(seed ^ 4), false),
            Directions::new(PLACE_RAYS, mixed(seed ^ 5), sky_is_lit),
        ];
        Self {
            again: Again::new(elements, emitters, direct, sight),
            lit,
            faint,
            bright,
            radiosity,
            directions,
            seed,
        }
    }

    /// Twice something that differs by its samples alone.
    fn twice(&self, element: u32, purpose: u32, off: impl Fn(usize, u32) -> (f64, u64)) -> Off {
        let seed = |k: u32| mixed(self.seed ^ mixed(element ^ mixed(2 * purpose + k + 1)));
        let (a, b) = (off(0, seed(0)), off(1, seed(1)));
        Off { by: [a.0, b.0], rays: a.1 + b.1 }
    }

    /// What a texel's direct light is off by.
    pub fn direct_off(&self, element: u32) -> Off {
        let stored = grey(self.lit.direct.irradiance[element as usize]);
        self.twice(element, 1, |_, seed| {
            let (again, rays) = self.again.irradiance(element, SHADOW_RAYS, seed, self.lit.tracer);
            (stored - grey(again), rays)
        })
    }

    /// What its other light is off by, were the coarse solution right.
    pub fn gather_off(&self, from: &Reflections, element: u32) -> Off {
        let stored = grey(from.irradiance[element as usize]);
        let seen = |hit: &Hit| self.place(from, hit).map_or(Radiosity::ZERO, |e| self.radiosity[e as usize]);
        self.twice(element, 2, |k, seed| {
            let set = self.directions[0].any(k, seed);
            let (again, rays) = set.gather(self.lit.elements, element, &self.around(from, element, k, seen));
            (stored - grey(again.irradiance), rays)
        })
    }

    /// What the coarse solution adds to that: what it says too much at places that a texel's rays meet.
    pub fn solve_off(&self, from: &Reflections, element: u32) -> Off {
        let Some((_, smooth)) = from.coarse else { return Off::default() };
        let elements = self.lit.elements;
        let seen = |hit: &Hit| self.place(from, hit).map_or(Radiosity::ZERO, |e| self.radiosity[e as usize]);
        self.twice(element, 3, |k, seed| {
            let set = self.directions[1].any(k, seed);
            let met = RefCell::new(Vec::with_capacity(set.len()));
            let note = |hit: &Hit| {
                met.borrow_mut().push(self.place(from, hit));
                Radiosity::ZERO
            };
            let bare = Surroundings { faint: None, bright: None, ..self.around(from, element, k, note) };
            let (_, mut sent) = set.gather(elements, element, &bare);
            let mut excess = 0.0;
            let met = met.into_inner();
            // Directions are in an order in which neighbours follow each other.
            for (number, e) in (1..).zip(met.iter().skip(seed as usize % EVERY).step_by(EVERY)) {
                let &Some(e) = e else { continue };
                let at = e as usize;
                if !elements.valid[at] || elements.reflectance[at].0 == Vec3::ZERO {
                    continue;
                }
                let set = self.directions[2].any(k, mixed(seed ^ number));
                let (there, rays) = set.gather(elements, e, &self.around(from, e, k, seen));
                let off = smooth[at] - there.irradiance;
                excess += f64::from((elements.reflectance[at] * off).mean());
                sent += rays;
            }
            (excess * EVERY as f64 / set.len() as f64, sent)
        })
    }

    /// The element that a ray meets, where it reflects anything.
    fn place(&self, from: &Reflections, hit: &Hit) -> Option<u32> {
        if self.radiosity.is_empty() { None } else { from.lookup.element_at(hit) }
    }

    fn around<S: Fn(&Hit) -> Radiosity>(
        &self,
        from: &Reflections<'a>,
        element: u32,
        k: usize,
        radiosity: S,
    ) -> Surroundings<'_, T, S> {
        Surroundings {
            tracer: self.lit.tracer,
            sight: self.lit.sight,
            radiosity,
            sky: from.sky,
            faint: self.faint[k][element as usize % FAINT_SETS as usize].as_ref(),
            bright: self.bright[k].as_ref(),
        }
    }
}

/// How many times its noise a witness' square is the least that the stage's gathers are off by.
pub(super) fn noise_to_stage(of_stage: u32) -> f64 {
    (f64::from(rays(of_stage)) / f64::from(of_stage.max(1))).powf(NOISE_POWER)
}

/// Light, mean of the channels.
fn grey(irradiance: Irradiance) -> f64 {
    f64::from(irradiance.mean())
}

/// Rays of the witness' gathers where the stage's have `of_stage`.
fn rays(of_stage: u32) -> u32 {
    (of_stage / GATHER_PART).max(LEAST_GATHER_RAYS)
}
