//! Samples that are buried in other geometry or pressed against it: found by rays, moved within their texel, or given
//! up.
//!
//! A sample is buried when every ray of its hemisphere says so: the first thing it meets, not counting solids it
//! passes through altogether, is the back of a surface whose back is never lit. Under a ceiling without an underside,
//! among double-sided leaves or next to a wall some ray always says otherwise. A sample is pressed when something
//! opaque lies right above it, closer than the lightmap can show: a carpet on a floor, a cupboard at a wall; or when
//! something opaque touches it face to face.

use super::charts::ChartPlan;
use super::near::Near;
use super::probe::Probe;
use super::spot::Spot;
use super::texel::COMFORTABLE;
use crate::atlas::Atlas;
use crate::scene::{Alpha, Role, Scene};
use crate::transport::{Ray, Tracer, World};
use glam::Vec3;

/// What rays need to judge a sample.
pub(super) struct Judge<'a, T> {
    tracer: &'a T,
    near: Near<'a>,
    scene: &'a Scene,
    /// Per surface.
    matter: Vec<Matter>,
    /// Directions of [`RINGS`].
    slanted: [[f32; 3]; SLANTED],
}

/// What a surface tells a ray.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Matter {
    /// Its back is the inside of something solid.
    Solid,
    /// Its back is lit.
    Sheet,
    /// It lets light through.
    Clear,
}

/// What is known about the place of a sample.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Verdict {
    Free,
    /// Something crosses the surface within `COMFORTABLE` texels.
    Crowded,
    /// Inside something, or covered closely.
    Buried(Walls),
}

/// What stands around a buried sample: horizontal directions and the distances at which low rays meet the inside of
/// something there, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Walls([(Vec3, f32); LOW]);

/// What stands around a sample that is covered, not walled in.
const NOWHERE: Walls = Walls([(Vec3::ZERO, 0.0); LOW]);

impl Walls {
    /// Whether a point that far from the sample may lie beyond a wall. The nearest direction is at most 22.5° off the
    /// wall's normal, in which the ray sees the wall 1/cos farther away and the way to the point cos shorter: cos² is
    /// 0.85.
    pub(super) fn may_end_before(&self, offset_world: Vec3) -> bool {
        self.0.iter().any(|(direction, distance_m)| offset_world.dot(*direction) >= 0.8 * distance_m)
    }
}

/// Rings of rays around the normal: elevation and first azimuth (degrees), number. The lowest looks far enough under
/// any ceiling to find a wall that faces the room; the lowest two tell how far away the walls are, every 45°.
const RINGS: [(f32, f32, u32); 4] = [(2.0, 11.0, 4), (14.0, 56.0, 4), (38.0, 20.0, 4), (64.0, 70.0, 3)];
/// Rays after the normal one.
const SLANTED: usize = 15;
/// Of these, the ones near enough to the horizon to tell of walls.
const LOW: usize = 8;
/// What presses on a sample is about parallel, to this cosine; what is steeper is the next facet of something rough.
const COVERS: f32 = 0.7;
/// Surfaces a ray passes before it gives up and says that the sample is free.
const MOST_PASSED: u32 = 8;

impl<'a, T: Tracer> Judge<'a, T> {
    pub(super) fn new(
        scene: &'a Scene,
        atlas: &Atlas,
        back_counts: &dyn Fn(usize) -> bool,
        tracer: &'a T,
    ) -> Self {
        let matter = |(i, surface): (usize, &crate::scene::Surface)| {
            let material = scene.material(surface);
            let lit = atlas.backs.get(i).is_some_and(Option::is_some) && back_counts(i);
            // Nobody asked whether a double-sided thing that only blocks is solid: it may be a leaf.
            let leaf = material.double_sided && (surface.role == Role::Blocks || material.unlit);
            match material.alpha {
                Alpha::Blend => Matter::Clear,
                _ if material.transmission > 0.0 => Matter::Clear,
                _ if lit || leaf => Matter::Sheet,
                _ => Matter::Solid,
            }
        };
        let matter = scene.surfaces.iter().enumerate().map(matter).collect();
        Self { tracer, near: Near::new(tracer.world()), scene, matter, slanted: slanted() }
    }

    /// Rays to judge with, counted.
    pub(super) fn probe(&self) -> Probe<'a, T> {
        Probe::new(self.tracer)
    }

    fn world(&self) -> &World {
        self.tracer.world()
    }

    /// Whether geometry other than the chart itself lies within a texel of any of the spots. Where there is none, all
    /// of them are on the same side of everything.
    pub(super) fn others_near(&self, chart: &ChartPlan, spots: impl Iterator<Item = Spot>) -> bool {
        let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for spot in spots {
            let [u, v] = spot.per_texel;
            let reach = u.abs() + v.abs() + spot.normal_geometric.abs() * (u.length() + v.length()) * 0.5;
            min = min.min(spot.on_plane.min(spot.position) - reach);
            max = max.max(spot.on_plane.max(spot.position) + reach);
        }
        let world = self.world();
        self.near.any(min, max, |t| {
            let own = world.surface_of(t) == chart.surface;
            !own || chart.placement.unwrap.chart_of_triangle[world.local_triangle(t) as usize] != chart.chart
        })
    }

    /// Judges a sample among other geometry.
    pub(super) fn judge(&self, probe: &Probe<T>, spot: &Spot) -> Verdict {
        match self.buried(probe, spot) {
            Some(walls) => Verdict::Buried(walls),
            None if self.touched(spot) => Verdict::Buried(NOWHERE),
            None if self.crowded(probe, spot) => Verdict::Crowded,
            None => Verdict::Free,
        }
    }

    /// What is around when every ray finds the sample inside something, or something presses on it.
    pub(super) fn buried(&self, probe: &Probe<T>, spot: &Spot) -> Option<Walls> {
        let normal = spot.normal_geometric;
        let origin = self.world().offset_origin(spot.triangle, spot.position, normal);
        let up = Ray::unbounded(origin, normal);
        let first = probe.closest(&up)?;
        let matter = self.matter(first.triangle);
        let parallel = || self.world().normal(first.triangle).dot(normal).abs() > COVERS;
        if matter != Matter::Clear && first.t < spot.pressed_m && parallel() {
            return Some(NOWHERE);
        }
        // The usual answer, without asking further: the sample sees the front of something.
        if first.front || matter != Matter::Solid {
            return None;
        }
        let along = spot.per_texel[0].try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        let along = (along - normal * normal.dot(along))
            .try_normalize()
            .unwrap_or_else(|| normal.any_orthonormal_vector());
        let across = normal.cross(along);
        let mut walls = NOWHERE;
        for (i, [x, y, z]) in self.slanted.into_iter().enumerate() {
            let direction = (along * x + across * y + normal * z).normalize();
            let distance = self.inside_along(probe, Ray::unbounded(origin, direction))?;
            if i < LOW {
                let flat = along * x + across * y;
                let shorter = flat.length();
                walls.0[i] = (flat / shorter, distance * shorter);
            }
        }
        Some(walls)
    }

    /// Whether something solid lies face to face with the sample, as a floor does with the underside of what stands on
    /// it. Rays that leave either start beyond the other, since no rounding tells which comes first.
    fn touched(&self, spot: &Spot) -> bool {
        let (world, normal) = (self.world(), spot.normal_geometric);
        // Seen from its back, a surface faces away from itself.
        let own = world.surface_of(spot.triangle);
        let is_back = world.normal(spot.triangle).dot(normal) < 0.0;
        let rounding = world.offset_origin(spot.triangle, spot.on_plane, normal) - spot.on_plane;
        let reach = Vec3::splat(rounding.length());
        self.near.any(spot.on_plane - reach, spot.on_plane + reach, |t| {
            self.matter(t) == Matter::Solid
                && world.normal(t).dot(normal) < -COVERS
                && !(is_back && world.surface_of(t) == own)
        })
    }

    /// The distance to the back that says that the ray's origin is inside; `None` when the ray says it is not.
    fn inside_along(&self, probe: &Probe<T>, mut ray: Ray) -> Option<f32> {
        let (mut depth, mut travelled) = (0, 0.0);
        for _ in 0..MOST_PASSED {
            let hit = probe.closest(&ray)?;
            travelled += hit.t;
            if hit.front {
                depth -= 1;
            } else if self.matter(hit.triangle) == Matter::Solid {
                depth += 1;
            } else {
                return None;
            }
            if depth > 0 {
                return Some(travelled);
            }
            let world = self.world();
            let normal = world.normal(hit.triangle);
            let beyond = if normal.dot(ray.direction) < 0.0 { -normal } else { normal };
            let point = self.scene.position(world.surface_point(&hit));
            ray.origin = world.offset_origin(hit.triangle, point, beyond);
        }
        None
    }

    /// Whether something crosses the surface right beside the sample: rays across it, a little above.
    fn crowded(&self, probe: &Probe<T>, spot: &Spot) -> bool {
        // A sample at the chart's own border is already as far from it as the texel allows.
        if f64::from(spot.reach) < COMFORTABLE {
            return false;
        }
        let normal = spot.normal_geometric;
        let origin = self.world().offset_origin(spot.triangle, spot.position, normal);
        let [u, v] = spot.per_texel;
        let above = origin + normal * ((u.length() + v.length()) / 32.0);
        let half = 0.8 * COMFORTABLE as f32;
        [u, v].into_iter().any(|axis| {
            let length = axis.length();
            length > 0.0
                && probe.occluded(&Ray {
                    origin: above - axis * half,
                    direction: axis / length,
                    t_max: 2.0 * half * length,
                })
        })
    }

    fn matter(&self, triangle: u32) -> Matter {
        self.matter[self.world().surface_of(triangle) as usize]
    }
}

/// See [`RINGS`].
fn slanted() -> [[f32; 3]; SLANTED] {
    let mut directions = [[0.0; 3]; SLANTED];
    let mut next = directions.iter_mut();
    for (elevation, turn, count) in RINGS {
        let (z, flat) = elevation.to_radians().sin_cos();
        for i in 0..count {
            let (y, x) = (turn + 360.0 * i as f32 / count as f32).to_radians().sin_cos();
            if let Some(direction) = next.next() {
                *direction = [flat * x, flat * y, z];
            }
        }
    }
    directions
}
