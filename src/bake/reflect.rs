//! Light that no bright emitter sent straight: the coarse solution, then the final gather.

use super::Log;
use crate::atlas::Atlas;
use crate::direct::{Direct, Faint};
use crate::elements::{self, Elements, Lookup, Patches};
use crate::error::Result;
use crate::gather::{self, Bright, Indirect, Surroundings};
use crate::memory;
use crate::options::LightOptions;
use crate::plan::{Plan, Shining};
use crate::progress::{Progress, Stage};
use crate::scene::{Scene, Sky};
use crate::solve::coarse::{Coarse, Sources, Surfaces, coarse};
use crate::transport::{Hit, Tracer};
use crate::units::{Irradiance, Radiosity};

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

/// All irradiance that no bright emitter sent straight.
pub struct Reflected {
    pub irradiance: Vec<Irradiance>,
    /// The part of it that no surface reflected, where that was asked for.
    pub sky: Option<Vec<Irradiance>>,
    pub coarse: Coarse,
    pub patches: usize,
}

impl Reflected {
    /// Where there is no such light.
    pub fn nothing(elements: usize) -> Self {
        let irradiance = vec![Irradiance::ZERO; elements];
        Self { irradiance, sky: None, coarse: Coarse::default(), patches: 0 }
    }
}

impl<T: Tracer> Around<'_, T> {
    /// Solves and gathers. `sky_apart` also finds what no surface reflected.
    pub fn reflect(
        &self,
        from: &Straight,
        effort: &LightOptions,
        sky_apart: bool,
        log: &mut Log,
    ) -> Result<Reflected> {
        let limit_bytes = log.run.memory_limit_bytes;
        let (patches, coarse) = log.stage(Stage::Solve, u64::from(effort.solve.patches), |progress| {
            let (patches, adapt_rays) = self.patches(effort.solve.patches);
            let Self { elements, lookup, plan, tracer, .. } = *self;
            let surfaces = Surfaces { elements, lookup, patches: &patches, sight: &plan.sight, tracer };
            let sky = |direction| from.sky.radiance(direction);
            let sources = Sources { direct: from.direct, faint: from.faint, sky };
            let memory_bytes =
                memory::left_for_form_factors(self.scene, self.atlas, patches.len(), limit_bytes);
            let coarse = coarse(&surfaces, &sources, &effort.solve, effort.seed, memory_bytes, progress)?;
            let rays = coarse.rays + adapt_rays;
            Ok(((patches, coarse), rays))
        })?;
        let (irradiance, sky) = log.stage(Stage::Gather, self.elements.len() as u64, |progress| {
            let smooth = gather::spread_over_elements(self.elements, &patches, &coarse.irradiance);
            let black = |progress: &mut Progress| {
                self.gather(from, &smooth, None, |_| Radiosity::ZERO, effort, progress)
            };
            if !self.plan.work.bounces {
                let Indirect { irradiance, rays, .. } = black(progress);
                let sky = sky_apart.then(|| irradiance.clone());
                return Ok(((irradiance, sky), rays));
            }
            let all = self.gather_radiosity(from, &patches, &smooth, effort, progress);
            let apart = sky_apart && (self.plan.lights.sky != Shining::Not || from.faint.is_some());
            let sky = apart.then(|| black(progress));
            let rays = all.rays + sky.as_ref().map_or(0, |sky| sky.rays);
            Ok(((all.irradiance, sky.map(|sky| sky.irradiance)), rays))
        })?;
        Ok(Reflected { irradiance, sky, patches: patches.len(), coarse })
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
        patches: &Patches,
        smooth: &[Irradiance],
        effort: &LightOptions,
        progress: &mut Progress,
    ) -> Indirect {
        let Self { elements, lookup, .. } = *self;
        let mut radiosity: Vec<Radiosity> = (0..elements.len())
            .map(|e| elements.reflectance[e] * (from.direct.irradiance[e] + smooth[e]))
            .collect();
        let bright = Bright::take(elements, patches, &mut radiosity, effort.gather.rays);
        let bright = bright.as_ref();
        if self.plan.work.grey {
            let grey: Vec<f32> = radiosity.into_iter().map(|radiosity| radiosity.0.x).collect();
            let seen = |hit: &Hit| lookup.element_at(hit).map_or(0.0, |e| grey[e as usize]);
            self.gather(from, smooth, bright, |hit| Radiosity::grey(seen(hit)), effort, progress)
        } else {
            let seen = |hit: &Hit| lookup.element_at(hit).map_or(Radiosity::ZERO, |e| radiosity[e as usize]);
            self.gather(from, smooth, bright, seen, effort, progress)
        }
    }

    fn gather(
        &self,
        from: &Straight,
        smooth: &[Irradiance],
        bright: Option<&Bright>,
        radiosity: impl Fn(&Hit) -> Radiosity + Sync,
        effort: &LightOptions,
        progress: &mut Progress,
    ) -> Indirect {
        let (tracer, sight) = (self.tracer, &self.plan.sight);
        let around = Surroundings { tracer, sight, radiosity, sky: from.sky, faint: from.faint, bright };
        gather::gather(self.elements, from.direct, smooth, &around, &effort.gather, effort.seed, progress)
    }
}
