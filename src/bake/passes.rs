//! Passes of the light stages over the same elements, from coarse to fine: a stop at any moment leaves the last whole pass
//! or better.

use super::Glimpse;
use super::log::Log;
use super::reflect::{Around, Reflected, Straight};
use super::schedule::{self, Next, Schedule};
use super::snapshots::Snapshots;
use crate::atlas::Atlas;
use crate::audit::{self, Audit, Reflections};
use crate::direct::{self, Direct, EmitterList, Faint};
use crate::elements::{Elements, Lookup};
use crate::error::{Result, Warning};
use crate::options::{BakeOptions, LightOptions, LightPart};
use crate::plan::Plan;
use crate::progress::{Look, Stage};
use crate::scene::{Scene, Sky};
use crate::transport::Tracer;
use crate::units::Irradiance;
use std::cell::OnceCell;
use std::sync::Arc;

/// What all passes share.
pub struct Ground<'a, T> {
    pub scene: &'a Scene,
    pub plan: &'a Plan,
    pub atlas: &'a Atlas,
    pub elements: &'a Elements,
    pub emitters: &'a EmitterList,
    pub sky: &'a Sky,
    pub tracer: &'a T,
    pub options: &'a BakeOptions,
}

/// One pass, and what it found.
#[derive(Clone)]
pub struct Pass {
    pub effort: LightOptions,
    pub direct: Arc<Direct>,
    pub reflected: Reflected,
    /// Rays of a gather, those of all passes that are blended.
    pub gather_rays: u32,
    pub audit: Option<Audit>,
    /// Whether it ran to its end.
    pub whole: bool,
}

/// Runs passes until the goal is met; the last one, and what there is to say about it.
pub fn passes<T: Tracer>(
    ground: &Ground<T>,
    log: &mut Log,
    snapshots: Option<&Snapshots>,
) -> Result<(Pass, Vec<Warning>)> {
    let lookup = OnceCell::new();
    let lookup = || {
        let Ground { scene, atlas, elements, tracer, .. } = *ground;
        lookup.get_or_init(|| Lookup::new(scene, atlas, tracer.world(), elements))
    };
    let mut schedule = Schedule::new(ground.options, snapshots.is_some());
    let run = |next: &Next, until: Option<f64>, last: Option<&Pass>, log: &mut Log| {
        let rays_before = log.rays();
        log.until = until;
        let made = ground.pass(next, last, &lookup, log, snapshots);
        log.until = None;
        let mut pass = made?;
        if pass.audit.is_none() {
            // Nothing of it is worse than what was there.
            let before = last.and_then(|last| last.audit);
            pass.audit = ground.audit(&pass, log.rays() - rays_before, &lookup, log)?.or(before);
        }
        if let Some(audit) = pass.audit {
            log.run.observer.error(audit.total);
        }
        if let Some(snapshots) = snapshots {
            snapshots.offer(&ground.glimpse(&pass.direct, &pass.reflected));
        }
        Ok::<Pass, crate::Error>(pass)
    };
    let first = schedule.first(log);
    schedule.tell(&first, log);
    let mut last = run(&first, None, None, log)?;
    while let Some(next) = schedule.next(&last, log) {
        schedule.tell(&next, log);
        last = run(&next, schedule.until(log), Some(&last), log)?;
    }
    Ok((last, schedule.warnings))
}

impl<T: Tracer> Ground<'_, T> {
    fn glimpse<'b>(&'b self, direct: &'b Direct, reflected: &'b Reflected) -> Glimpse<'b> {
        Glimpse {
            atlas: self.atlas,
            elements: self.elements,
            direct: &direct.irradiance,
            indirect: &reflected.irradiance,
            sky: reflected.sky.as_deref(),
            unshot_fraction: reflected.solved.as_ref().map_or(0.0, |solved| solved.coarse.unshot_fraction),
        }
    }

    /// One pass, blended with `last`, or that where it is kept; and where it is cut short before anything is better than in
    /// `last`, that is what it gives.
    fn pass<'b>(
        &'b self,
        next: &Next,
        last: Option<&Pass>,
        lookup: &dyn Fn() -> &'b Lookup<'b>,
        log: &mut Log,
        snapshots: Option<&Snapshots>,
    ) -> Result<Pass> {
        let Self { scene, plan, atlas, elements, emitters, sky, tracer, options } = *self;
        let Next { light: effort, anew, shares } = next;
        let known = last.filter(|_| !anew.direct);
        let direct = match known {
            Some(last) => Arc::clone(&last.direct),
            None => Arc::new(log.stage(Stage::Direct, elements.len() as u64, |progress| {
                let direct =
                    direct::light(elements, emitters, plan, tracer, &effort.direct, effort.seed, progress);
                let rays = direct.rays;
                let direct = match last {
                    Some(last) if !direct.unfinished => direct.blended(&last.direct, shares[0] as f32),
                    _ => direct,
                };
                Ok((direct, rays))
            })?),
        };
        if let Some(last) = last.filter(|_| log.cut()) {
            return Ok(Pass { whole: false, ..last.clone() });
        }
        // What shadow borders are off by hardly shows in light that bounces, and the audit sees what does.
        let kept = last.filter(|_| !anew.reflected);
        let faint = Faint::new(elements, emitters, &direct, effort.seed);
        let reflected = if let Some(last) = kept {
            last.reflected.clone()
        } else if plan.work.gather || faint.is_some() {
            let around = Around { scene, plan, atlas, elements, lookup: lookup(), tracer };
            let from = Straight { direct: &direct, faint: faint.as_ref(), sky };
            let same = |last: &&Pass| last.effort.solve == effort.solve;
            let solved = match known.filter(same).and_then(|last| last.reflected.solved.clone()) {
                Some(solved) => solved,
                None => Arc::new(around.solve(&from, effort, log)?),
            };
            if let Some(last) = last.filter(|_| log.cut()) {
                return Ok(Pass { whole: false, ..last.clone() });
            }
            let before = last.map(|last| &last.reflected);
            let unshot_fraction = solved.coarse.unshot_fraction;
            let show = |indirect: &[Irradiance]| {
                if let Some(snapshots) = snapshots {
                    snapshots.offer(&Glimpse {
                        atlas,
                        elements,
                        direct: &direct.irradiance,
                        indirect,
                        sky: before.and_then(|before| before.sky.as_deref()),
                        unshot_fraction,
                    });
                }
            };
            let sky_apart = options.export.light != LightPart::Full;
            // Who sees only a part of the light cannot be shown one that is not there yet.
            let look: Option<Look> =
                (snapshots.is_some() && (!sky_apart || before.is_some())).then_some(&show);
            let found = around.gather_all(&from, solved, before, effort, sky_apart, look, log)?;
            match before {
                Some(before) if !log.cut() => found.blended(before, shares[1] as f32),
                _ => found,
            }
        } else {
            Reflected::nothing(elements.len())
        };
        let gather_rays = match (last, kept) {
            (_, Some(kept)) => kept.gather_rays,
            (Some(last), _) if shares[1] < 1.0 => last.gather_rays.saturating_add(effort.gather.rays),
            _ => effort.gather.rays,
        };
        Ok(Pass { effort: effort.clone(), direct, reflected, gather_rays, audit: None, whole: !log.cut() })
    }

    /// How far off a pass is.
    fn audit<'b>(
        &'b self,
        pass: &Pass,
        rays: u64,
        lookup: &dyn Fn() -> &'b Lookup<'b>,
        log: &mut Log,
    ) -> Result<Option<Audit>> {
        let effort = &pass.effort;
        let (share, resolution) = schedule::audit(self.options);
        if share <= 0.0 || log.cancelled() {
            return Ok(None);
        }
        let Self { plan, elements, emitters, sky, tracer, .. } = *self;
        let reflections = pass.reflected.solved.as_ref().map(|solved| Reflections {
            irradiance: &pass.reflected.irradiance,
            gathered: &pass.reflected.gathered,
            rays: pass.gather_rays,
            lookup: lookup(),
            sky,
            coarse: plan.work.bounces.then_some((&solved.patches, &solved.smooth[..])),
        });
        let lit =
            audit::Lit { elements, emitters, direct: &pass.direct, sight: &plan.sight, tracer, reflections };
        let wanted = audit::Wanted { rays: (rays as f64 * share) as u64, resolution, seed: effort.seed };
        log.stage(Stage::Audit, 1, |progress| {
            let audit = audit::audit(&lit, wanted, progress);
            Ok((audit, audit.map_or(0, |audit| audit.rays)))
        })
    }
}
