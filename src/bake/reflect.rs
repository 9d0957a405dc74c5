//! Light that no bright emitter sent straight: the coarse solution, then the final gather.

use super::log::Log;
use crate::atlas::Atlas;
use crate::direct::{Direct, Faint, blend};
use crate::elements::{self, Elements, Lookup, Patches};
use crate::error::Result;
use crate::gather::{self, Bright, Indirect, Surroundings};
use crate::memory;
use crate::options::LightOptions;
use crate::plan::{Plan, Shining};
use crate::progress::{Look, Progress, Stage};
use crate::scene::{Scene, Sky};
use crate::solve::coarse::{Coarse, Sources, Surfaces, coarse};
use crate::transport::{Hit, Tracer};
use crate::units::{Irradiance, Radiosity};
use std::sync::Arc;

/// What light is reflected between.
pub struct Around<'a, T> {
    pub scene: &'a Scene,
    pub plan: &'a Plan,
    pub atlas: &'a Atlas,
    pub elements: &'a Elements,
    pub lookup: &'a Lookup<'a>,
    pub tracer: &'a T,
}

/// Light before its first reflection.
pub struct Straight<'a> {
    pub direct: &'a Direct,
    pub faint: Option<&'a Faint<'a>>,
    pub sky: &'a Sky,
}

/// The coarse solution.
pub struct Solved {
    pub patches: Patches,
    pub coarse: Coarse,
    /// Its irradiance, one row an element.
    pub smooth: Vec<Irradiance>,
}

/// All irradiance that no bright emitter sent straight.
#[derive(Clone)]
pub struct Reflected {
    pub irradiance: Vec<Irradiance>,
    /// Whether an element was gathered, one row an element.
    pub gathered: Vec<bool>,
    /// The part of it that no surface reflected, where that was asked for.
    pub sky: Option<Vec<Irradiance>>,
    /// What it was made from, where there is such light.
    pub solved: Option<Arc<Solved>>,
}

impl Reflected {
    /// Where there is no such light.
    pub fn nothing(elements: usize) -> Self {
        let irradiance = vec![Irradiance::ZERO; elements];
        Self { irradiance, gathered: Vec::new(), sky: None, solved: None }
    }

    /// With this share of itself, and the rest of what was there before.
    pub fn blended(mut self, before: &Self, share: f32) -> Self {
        if share < 1.0 {
            blend(&mut self.irradiance, &before.irradiance, share);
            if let (Some(own), Some(before)) = (&mut self.sky, &before.sky) {
                blend(own, before, share);
            }
        }
        self
    }
}

impl<T: Tracer> Around<'_, T> {
    /// The coarse solution.
    pub fn solve(&self, from: &Straight, effort: &LightOptions, log: &mut Log) -> Result<Solved> {
        let limit_bytes = log.run.memory_limit_bytes;
        log.stage(Stage::Solve, u64::from(effort.solve.patches), |progress| {
            let (patches, adapt_rays) = self.patches(effort.solve.patches);
            let Self { elements, lookup, plan, tracer, .. } = *self;
            let surfaces = Surfaces { elements, lookup, patches: &patches, sight: &plan.sight, tracer };
            let sky = |direction| from.sky.radiance(direction);
            let sources = Sources { direct: from.direct, faint: from.faint, sky };
            let memory_bytes =
                memory::left_for_form_factors(self.scene, self.atlas, patches.len(), limit_bytes);
            let coarse = coarse(&surfaces, &sources, &effort.solve, effort.seed, memory_bytes, progress)?;
            let smooth = gather::spread_over_elements(elements, &patches, &coarse.irradiance);
            let rays = coarse.rays + adapt_rays;
            Ok((Solved { patches, coarse, smooth }, rays))
        })
    }

    /// Gathers. Elements that it does not come to keep what they had `before`, or what the coarse solution says.
    /// `sky_apart` also finds what no surface reflected.
    #[allow(clippy::too_many_arguments)]
    pub fn gather_all(
        &self,
        from: &Straight,
        solved: Arc<Solved>,
        before: Option<&Reflected>,
        effort: &LightOptions,
        sky_apart: bool,
        look: Option<Look>,
        log: &mut Log,
    ) -> Result<Reflected> {
        let smooth = &solved.smooth;
        let (all, sky) = log.watched_stage(Stage::Gather, self.elements.len() as u64, look, |progress| {
            let at_least = before.map_or(&smooth[..], |before| &before.irradiance);
            let black = |at_least: &[Irradiance], progress: &mut Progress| {
                self.gather(from, at_least, None, |_| Radiosity::ZERO, effort, progress)
            };
            if !self.plan.work.bounces {
                let all = black(at_least, progress);
                let (sky, rays) = (sky_apart.then(|| all.irradiance.clone()), all.rays);
                return Ok(((all, sky), rays));
            }
            let all = self.gather_radiosity(from, &solved, at_least, effort, progress);
            progress.unwatched();
            let apart = sky_apart && (self.plan.lights.sky != Shining::Not || from.faint.is_some());
            let sky_before = before.and_then(|before| before.sky.as_deref());
            let sky = apart.then(|| black(sky_before.unwrap_or(smooth), progress));
            let rays = all.rays + sky.as_ref().map_or(0, |sky| sky.rays);
            Ok(((all, sky.map(|sky| sky.irradiance)), rays))
        })?;
        let Indirect { irradiance, gathered, .. } = all;
        Ok(Reflected { irradiance, gathered, sky, solved: Some(solved) })
    }

    /// Patches and the rays that they took.
    fn patches(&self, wanted: u32) -> (Patches, u64) {
        let Self { elements, plan, .. } = *self;
        let called = |chart: usize| {
            let chart = &elements.charts[chart];
            !plan.by_force[chart.surface as usize][usize::from(chart.back)]
        };
        let cells = elements::patches(elements, wanted, called);
        let is_open = |element: u32| elements.is_open(element, &plan.sight);
        elements::adapt(elements, cells, is_open, called, self.tracer)
    }

    /// Gathers what surfaces reflect, in one channel where that is enough.
    fn gather_radiosity(
        &self,
        from: &Straight,
        solved: &Solved,
        at_least: &[Irradiance],
        effort: &LightOptions,
        progress: &mut Progress,
    ) -> Indirect {
        let Self { elements, lookup, .. } = *self;
        let Solved { patches, smooth, .. } = solved;
        let mut radiosity: Vec<Radiosity> = (0..elements.len())
            .map(|e| elements.reflectance[e] * (from.direct.irradiance[e] + smooth[e]))
            .collect();
        let bright = Bright::take(elements, patches, &mut radiosity, effort.gather.rays);
        let bright = bright.as_ref();
        if self.plan.work.grey {
            let grey: Vec<f32> = radiosity.into_iter().map(|radiosity| radiosity.0.x).collect();
            let seen = |hit: &Hit| lookup.element_at(hit).map_or(0.0, |e| grey[e as usize]);
            self.gather(from, at_least, bright, |hit| Radiosity::grey(seen(hit)), effort, progress)
        } else {
            let seen = |hit: &Hit| lookup.element_at(hit).map_or(Radiosity::ZERO, |e| radiosity[e as usize]);
            self.gather(from, at_least, bright, seen, effort, progress)
        }
    }

    fn gather(
        &self,
        from: &Straight,
        at_least: &[Irradiance],
        bright: Option<&Bright>,
        radiosity: impl Fn(&Hit) -> Radiosity + Sync,
        effort: &LightOptions,
        progress: &mut Progress,
    ) -> Indirect {
        let (tracer, sight) = (self.tracer, &self.plan.sight);
        let around = Surroundings { tracer, sight, radiosity, sky: from.sky, faint: from.faint, bright };
        gather::gather(self.elements, from.direct, at_least, &around, &effort.gather, effort.seed, progress)
    }
}
