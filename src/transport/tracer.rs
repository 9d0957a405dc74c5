//! The three ways a world stops light.

use super::traverse::{Ask, Solid};
use super::{Blocking, Hit, Ray, Tracer, World};
use crate::scene::Scene;
use glam::Vec3;

/// For worlds where every triangle stops all light.
#[derive(Clone, Copy)]
pub struct OpaqueTracer<'a> {
    world: &'a World,
}

/// For worlds where some triangles have holes; only those are asked.
#[derive(Clone, Copy)]
pub struct CutoutTracer<'a> {
    world: &'a World,
    scene: &'a Scene,
}

/// For worlds where some triangles let a share of the light pass; only those are asked.
#[derive(Clone, Copy)]
pub struct TintedTracer<'a> {
    world: &'a World,
    scene: &'a Scene,
}

/// One of the three, chosen once; [`with_tracer!`](crate::with_tracer) hands it to a generic function.
#[derive(Clone, Copy)]
pub enum AnyTracer<'a> {
    /// See [`OpaqueTracer`].
    Opaque(OpaqueTracer<'a>),
    /// See [`CutoutTracer`].
    Cutout(CutoutTracer<'a>),
    /// See [`TintedTracer`].
    Tinted(TintedTracer<'a>),
}

/// Evaluates an expression with the tracer inside an [`AnyTracer`](crate::transport::AnyTracer), once for each of
/// its types, so that what the expression calls is compiled for each:
/// `with_tracer!(world.tracer(&scene), tracer => direct_light(tracer, &elements))` gives `tracer: &impl Tracer`.
#[macro_export]
macro_rules! with_tracer {
    ($any:expr, $tracer:ident => $body:expr) => {
        match &$any {
            $crate::transport::AnyTracer::Opaque($tracer) => $body,
            $crate::transport::AnyTracer::Cutout($tracer) => $body,
            $crate::transport::AnyTracer::Tinted($tracer) => $body,
        }
    };
}

impl<'a> AnyTracer<'a> {
    /// The tracer for `blocking`, which may be more than the world needs but not less.
    pub fn new(blocking: Blocking, world: &'a World, scene: &'a Scene) -> Self {
        match blocking.max(world.blocking()) {
            Blocking::Opaque => Self::Opaque(OpaqueTracer { world }),
            Blocking::Cutout => Self::Cutout(CutoutTracer { world, scene }),
            Blocking::Tinted => Self::Tinted(TintedTracer { world, scene }),
        }
    }
}

impl<'a> OpaqueTracer<'a> {
    /// Takes every triangle as opaque, even those that are not.
    pub fn new(world: &'a World) -> Self {
        Self { world }
    }
}

/// A tracer for places where nothing stands in the way: every ray passes, none is sent.
pub struct ClearTracer<'a> {
    world: &'a World,
}

impl<'a> ClearTracer<'a> {
    /// Of a world whose triangles are known not to be in the way.
    pub fn new(world: &'a World) -> Self {
        Self { world }
    }
}

impl Tracer for ClearTracer<'_> {
    const SENDS: bool = false;

    fn world(&self) -> &World {
        self.world
    }

    #[inline]
    fn closest(&self, _: &Ray) -> Option<Hit> {
        None
    }

    #[inline]
    fn occluded(&self, _: &Ray) -> bool {
        false
    }

    #[inline]
    fn transmittance(&self, _: &Ray) -> Vec3 {
        Vec3::ONE
    }

    #[inline]
    fn walk(&self, _: &Ray, _: impl FnMut(&Hit, Vec3)) -> Vec3 {
        Vec3::ONE
    }
}

impl Tracer for OpaqueTracer<'_> {
    fn world(&self) -> &World {
        self.world
    }

    #[inline]
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.world.tree.closest(ray, 0.0, Solid)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.world.tree.any(ray, Solid)
    }

    #[inline]
    fn transmittance(&self, ray: &Ray) -> Vec3 {
        all_or_nothing(self.occluded(ray))
    }

    #[inline]
    fn walk(&self, ray: &Ray, visit: impl FnMut(&Hit, Vec3)) -> Vec3 {
        visit_one(self.closest(ray), visit)
    }
}

impl CutoutTracer<'_> {
    fn solid_at(&self, hit: &Hit) -> bool {
        self.scene.opacity(self.world.surface_point(hit)).0 > 0.0
    }
}

impl Tracer for CutoutTracer<'_> {
    fn world(&self) -> &World {
        self.world
    }

    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.world.tree.closest(ray, 0.0, Ask(|hit: &Hit| self.solid_at(hit)))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.world.tree.any(ray, Ask(|hit: &Hit| self.solid_at(hit)))
    }

    fn transmittance(&self, ray: &Ray) -> Vec3 {
        all_or_nothing(self.occluded(ray))
    }

    fn walk(&self, ray: &Ray, visit: impl FnMut(&Hit, Vec3)) -> Vec3 {
        visit_one(self.closest(ray), visit)
    }
}

impl TintedTracer<'_> {
    /// The share of light taken at a hit and the share per channel that passes.
    fn taken_and_passed(&self, hit: &Hit) -> (f32, Vec3) {
        let (opacity, tint) = self.scene.opacity(self.world.surface_point(hit));
        (opacity, tint * (1.0 - opacity))
    }

    /// The nearest surface that changes the light and comes after `(t, triangle)` in the order of distance, then index.
    fn next(&self, ray: &Ray, after: Option<(f32, u32)>) -> Option<Hit> {
        let t_min = after.map_or(0.0, |(t, _)| t);
        let question = |hit: &Hit| {
            let comes_after = after.is_none_or(|(t, triangle)| (hit.t, hit.triangle) > (t, triangle));
            comes_after && self.taken_and_passed(hit).1 != Vec3::ONE
        };
        self.world.tree.closest(ray, t_min, Ask(question))
    }
}

impl Tracer for TintedTracer<'_> {
    fn world(&self) -> &World {
        self.world
    }

    fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.world.tree.closest(ray, 0.0, Ask(|hit: &Hit| self.taken_and_passed(hit).0 > 0.0))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.transmittance(ray) == Vec3::ZERO
    }

    fn transmittance(&self, ray: &Ray) -> Vec3 {
        let mut left = Vec3::ONE;
        let question = |hit: &Hit| {
            left *= self.taken_and_passed(hit).1;
            left == Vec3::ZERO
        };
        all_or_nothing(self.world.tree.any(ray, Ask(question))) * left
    }

    fn walk(&self, ray: &Ray, mut visit: impl FnMut(&Hit, Vec3)) -> Vec3 {
        let (mut left, mut after) = (Vec3::ONE, None);
        while left != Vec3::ZERO {
            let Some(hit) = self.next(ray, after) else { break };
            let (opacity, passed) = self.taken_and_passed(&hit);
            if opacity > 0.0 {
                visit(&hit, left * opacity);
            }
            left *= passed;
            after = Some((hit.t, hit.triangle));
        }
        left
    }
}

fn all_or_nothing(occluded: bool) -> Vec3 {
    if occluded { Vec3::ZERO } else { Vec3::ONE }
}

fn visit_one(hit: Option<Hit>, mut visit: impl FnMut(&Hit, Vec3)) -> Vec3 {
    let Some(hit) = hit else { return Vec3::ONE };
    visit(&hit, Vec3::ONE);
    Vec3::ZERO
}
