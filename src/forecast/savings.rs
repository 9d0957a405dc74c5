//! Numbers for what leaving effects out saves.

use crate::bake::Lit;
use crate::direct::{collect, probe_rays};
use crate::elements::Chart;
use crate::options::{BakeOptions, Effect, Forced};
use crate::plan::{Amount, Plan, Proven};
use crate::scene::Scene;
use crate::transport::World;
use std::cell::OnceCell;

/// Rays that every patch sends to see whether it must be cut, besides those of its form factors.
const CUT_RAYS: f64 = 64.0;
/// What one colour of one texel takes, bytes.
const CHANNEL_BYTES: u64 = 4;
/// Patches of a bake that has none now: about as many as are wanted, half as many again where edges cut them.
const PATCHES_CUT: f64 = 1.5;

/// What savings are counted from: a bake at a lower density, and what there is more of in the whole.
pub(super) struct Counted<'a> {
    pub scene: &'a Scene,
    pub options: &'a BakeOptions,
    pub proven: &'a Proven<'a>,
    pub trial: &'a Lit,
    /// Density of the trial over that of the bake.
    pub share: f64,
    /// Of the bake, all about.
    pub elements: u64,
    pub rays: u64,
    /// Texels per metre of hidden pages.
    pub hidden_density: f64,
    /// Made when needed.
    pub world: OnceCell<World>,
}

impl Counted<'_> {
    /// What leaving an effect out saves, as far as there is an honest number.
    pub fn amounts(&self, effect: Effect) -> Vec<Amount> {
        match effect {
            Effect::AreaLights | Effect::PointLamps | Effect::SpotLamps | Effect::Suns => {
                vec![Amount::Questions(self.elements)]
            }
            Effect::SoftSuns
            | Effect::SoftLamps
            | Effect::FarLamps
            | Effect::Sky
            | Effect::Shadows
            | Effect::Penumbras
            | Effect::LightBetweenRooms => vec![Amount::Rays(self.probes(effect))],
            Effect::AlphaTest | Effect::TintedShadows => vec![Amount::Lookups(self.rays)],
            Effect::BackFaces | Effect::UnseenSurfaces => vec![Amount::Texels(self.hidden_texels(effect))],
            Effect::Bounces | Effect::FinalGather => self.reflected(),
            Effect::ColourChannels => vec![Amount::Bytes(2 * CHANNEL_BYTES * self.elements)],
            Effect::TexturedEmission
            | Effect::AlbedoTextures
            | Effect::SmoothNormals
            | Effect::Instancing => Vec::new(),
        }
    }

    /// Rays by which texels probe lights with the effect forced, beyond those as planned.
    fn probes(&self, effect: Effect) -> u64 {
        let world = self.world.get_or_init(|| World::new(self.scene));
        let of = |plan: &Plan| {
            let (emitters, _) = collect(self.scene, plan);
            probe_rays(&self.trial.elements, &emitters, plan, world, &self.options.light.direct)
        };
        let (with, without) = (of(&self.proven.plan(&Forced::one(effect))), of(&self.trial.plan));
        (with.saturating_sub(without) as f64 / self.share.powi(2)) as u64
    }

    /// Texels of the sides that the effect forces to take light.
    fn hidden_texels(&self, effect: Effect) -> u64 {
        let plan = self.proven.plan(&Forced::one(effect));
        let mut area = 0.0;
        for (surface, by_force) in self.scene.surfaces.iter().zip(&plan.by_force) {
            let sides = by_force.iter().filter(|forced| **forced).count();
            if sides == 0 {
                continue;
            }
            for triangle in 0..self.scene.geometry(surface).triangles.len() as u32 {
                let [a, b, c] = self.scene.corners_world(surface, triangle).map(|corner| corner.as_dvec3());
                let own = (b - a).cross(c - a).length() / 2.0;
                area += sides as f64 * if own.is_finite() { own } else { 0.0 };
            }
        }
        (area * self.hidden_density.powi(2)) as u64
    }

    /// What the coarse solution and a gather that finds nothing would take: rows of all patches, rays of those that see
    /// something, and the widest cells' corners and middles.
    fn reflected(&self) -> Vec<Amount> {
        let light = &self.options.light;
        let elements = &self.trial.elements;
        let sees = (0..elements.len()).step_by(elements.len().div_ceil(4096).max(1));
        let (all, open) = sees.fold((0_u32, 0_u32), |(all, open), e| {
            (all + 1, open + u32::from(elements.is_open(e as u32, &self.trial.plan.sight)))
        });
        let seeing = 1.0 - f64::from(open) / f64::from(all.max(1));
        let patches = PATCHES_CUT * f64::from(light.solve.patches);
        let nodes: f64 =
            elements.charts.iter().filter(|chart| chart.exported).map(|chart| self.nodes(chart)).sum();
        let rays = patches * (f64::from(light.solve.rays_per_patch) + CUT_RAYS)
            + nodes * f64::from(light.gather.rays);
        vec![Amount::Patches(patches as u64), Amount::Rays((seeing * rays) as u64)]
    }

    fn nodes(&self, chart: &Chart) -> f64 {
        let widest = f64::from(self.options.light.gather.widest_cell.max(1));
        let cells = [0, 1].map(|axis| {
            let texels = f64::from(chart.max[axis] - chart.min[axis]) / self.share;
            (texels / widest).ceil().max(1.0)
        });
        let corners = (cells[0] + 1.0) * (cells[1] + 1.0) + cells[0] * cells[1];
        corners.min(chart.elements.len() as f64 / self.share.powi(2))
    }
}
