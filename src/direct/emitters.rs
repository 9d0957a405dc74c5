//! All light sources of a scene, ready to be asked.

use super::area::{AreaEmitter, Polygon};
use super::point::PointEmitter;
use super::sky;
use super::sun::SunEmitter;
use super::{Emitter, Receiver, ShadowRay};
use crate::options::Effect;
use crate::plan::{Lights, Plan, Rooms, Shining, meet};
use crate::scene::{Cone, LampKind, Scene, Sky, SpotFalloff, Surface, SurfacePoint};
use crate::transport::Shaft;
use crate::units::{Intensity, Irradiance};
use glam::{Vec2, Vec3};

/// Where no more emitters than this exist, none is faint.
const FEW: usize = 16;
/// The most emitters that are asked one by one at one place.
const MOST_BRIGHT: usize = 32;
/// An emitter that adds less than this share of the light is faint.
const SEEN_SHARE: f32 = 0.005;
/// Receivers of a block that are looked at to judge its emitters.
const PLACES: usize = 16;
/// Polygons that share shadow rays, at the most.
const GROUP: usize = 64;
/// An emissive texture is cut into at most 4^this pieces a triangle.
const DEEPEST_CUT: u32 = 4;

/// One source of any kind.
pub enum AnyEmitter {
    /// An emissive surface, or a part of one.
    Area(AreaEmitter),
    /// A point or spot lamp.
    Point(PointEmitter),
    /// A sun or a bright part of the sky.
    Sun(SunEmitter),
}

/// All sources.
#[derive(Default)]
pub struct EmitterList {
    /// Neighbours stand together; those that are asked in vain come last.
    pub emitters: Vec<AnyEmitter>,
    /// The rooms each counts in, see [`Rooms`]; none where it is asked in vain.
    rooms: Vec<Vec<u32>>,
    /// Whether lights are asked in rooms they do not count in.
    everywhere: bool,
    /// How many count anywhere.
    counting: usize,
    /// Whether lights without extent are probed as often as those with.
    pub(super) sharp_as_soft: bool,
    /// Whether those that nothing stands in the way of are probed, too.
    pub(super) clear_probed: bool,
}

impl EmitterList {
    /// Whether nothing shines.
    pub fn is_empty(&self) -> bool {
        self.emitters.is_empty()
    }

    /// Number of sources.
    pub fn len(&self) -> usize {
        self.emitters.len()
    }

    /// The emitters that count in one of these rooms (ascending), ascending.
    pub(super) fn within(&self, rooms: &[u32]) -> Vec<u32> {
        (0..).zip(&self.rooms).filter(|(_, within)| meet(within, rooms)).map(|(k, _)| k).collect()
    }

    /// Adds to what is asked one by one what is asked in vain, where `counting` are all that count.
    pub(super) fn add_vain(&self, counting: &[u32], asked: &mut Vec<u32>) {
        let from = if self.everywhere { 0 } else { self.counting as u32 };
        asked.extend((from..self.len() as u32).filter(|k| counting.binary_search(k).is_err()));
        asked.sort_unstable();
    }

    /// Of these emitters those whose shadow borders show among these receivers, ascending: all where they are few, else the
    /// brightest, each at least [`SEEN_SHARE`] of the light. What is left out is faint here, see [`super::Faint`].
    pub(super) fn bright_at(&self, within: &[u32], receivers: &[Receiver]) -> Vec<u32> {
        if within.len() <= FEW {
            return within.to_vec();
        }
        let stride = receivers.len().div_ceil(PLACES).max(1);
        let places: Vec<&Receiver> = receivers.iter().step_by(stride).collect();
        let mut strength: Vec<(f32, u32)> = within
            .iter()
            .map(|&k| {
                let emitter = &self.emitters[k as usize];
                (places.iter().map(|r| emitter.unoccluded(r).mean()).fold(0.0, f32::max), k)
            })
            .collect();
        let total: f32 = strength.iter().map(|s| s.0).sum();
        strength.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        strength.truncate(MOST_BRIGHT);
        let mut bright: Vec<u32> =
            strength.iter().filter(|s| s.0 > SEEN_SHARE * total).map(|s| s.1).collect();
        bright.sort_unstable();
        bright
    }
}

impl Emitter for AnyEmitter {
    fn unoccluded(&self, receiver: &Receiver) -> Irradiance {
        match self {
            Self::Area(e) => e.unoccluded(receiver),
            Self::Point(e) => e.unoccluded(receiver),
            Self::Sun(e) => e.unoccluded(receiver),
        }
    }

    fn shadow_ray(&self, receiver: &Receiver, uv: [f32; 2]) -> Option<ShadowRay> {
        match self {
            Self::Area(e) => e.shadow_ray(receiver, uv),
            Self::Point(e) => e.shadow_ray(receiver, uv),
            Self::Sun(e) => e.shadow_ray(receiver, uv),
        }
    }

    fn is_sharp(&self) -> bool {
        match self {
            Self::Area(e) => e.is_sharp(),
            Self::Point(e) => e.is_sharp(),
            Self::Sun(e) => e.is_sharp(),
        }
    }

    fn shaft(&self, from: [Vec3; 2], world: [Vec3; 2]) -> Shaft {
        match self {
            Self::Area(e) => e.shaft(from, world),
            Self::Point(e) => e.shaft(from, world),
            Self::Sun(e) => e.shaft(from, world),
        }
    }
}

impl AnyEmitter {
    /// A light of this kind that sends nothing, in the middle of the scene.
    fn black(kind: Effect) -> Option<Self> {
        let point = |cone| {
            Self::Point(PointEmitter {
                position_world: Vec3::ZERO,
                intensity: Intensity::grey(0.0),
                range_m: None,
                radius_m: 0.0,
                soft_falloff: false,
                cone,
            })
        };
        let down =
            Cone { direction_world: -Vec3::Y, inner_rad: 0.5, outer_rad: 0.7, falloff: SpotFalloff::Blender };
        match kind {
            Effect::PointLamps => Some(point(None)),
            Effect::SpotLamps => Some(point(Some(down))),
            Effect::Suns => Some(Self::Sun(SunEmitter {
                toward_world: Vec3::Y,
                irradiance: Irradiance::ZERO,
                sin_radius: 0.0,
            })),
            Effect::AreaLights => AreaEmitter::black(&[Vec3::ZERO, Vec3::X, Vec3::Z]).map(Self::Area),
            _ => None,
        }
    }

    /// A place that stands for the emitter, for sorting neighbours together.
    fn place(&self) -> Vec3 {
        match self {
            Self::Area(e) => e.centre(),
            Self::Point(e) => e.position_world,
            Self::Sun(e) => e.toward_world * f32::MAX.sqrt(),
        }
    }
}

/// Finds every source that the plan asks; returns also the sky without what became a source.
pub fn collect(scene: &Scene, plan: &Plan) -> (EmitterList, Sky) {
    let mut found: Vec<(AnyEmitter, Vec<u32>)> = Vec::new();
    let mut vain: Vec<AnyEmitter> = Vec::new();
    let mut add = |emitter: AnyEmitter, shining: Shining, within: &dyn Fn() -> Vec<u32>| match shining {
        Shining::Counts => found.push((emitter, within())),
        Shining::InVain => vain.push(emitter),
        Shining::Not => {}
    };
    for (lamp, &shining) in plan.lights.lamps.iter().enumerate() {
        add(lamp_emitter(&scene.lamps[lamp].kind), shining, &|| plan.rooms.of_lamp[lamp].clone());
    }
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let shining = plan.lights.surfaces[index];
        if shining == Shining::Not {
            continue;
        }
        let [front, back] = &plan.rooms.of_side[index];
        let mut within = front.clone();
        if scene.material(surface).double_sided {
            within.extend(back);
            within.sort_unstable();
            within.dedup();
        }
        let groups = grouped(polygons(scene, index as u32, surface)).into_iter();
        groups
            .filter_map(AreaEmitter::new)
            .for_each(|e| add(AnyEmitter::Area(e), shining, &|| within.clone()));
    }
    let sky = if plan.lights.sky == Shining::Not { &Sky::None } else { &scene.sky };
    let (suns, rest) = sky::split(sky);
    for sun in suns.into_iter().filter(|sun| sun.irradiance != Irradiance::ZERO) {
        add(AnyEmitter::Sun(sun), plan.lights.sky, &|| vec![Rooms::OUTSIDE]);
    }
    vain.extend(plan.lights.black.iter().filter_map(|&kind| AnyEmitter::black(kind)));
    sort_by_place(&mut found);
    let (mut emitters, mut rooms): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let counting = emitters.len();
    emitters.extend(vain);
    rooms.resize(emitters.len(), Vec::new());
    let Lights { between_rooms: everywhere, sharp_as_soft, clear_probed, .. } = plan.lights;
    (EmitterList { emitters, rooms, everywhere, counting, sharp_as_soft, clear_probed }, rest)
}

fn lamp_emitter(kind: &LampKind) -> AnyEmitter {
    match *kind {
        LampKind::Point { position_world, intensity, range_m, radius_m, soft_falloff, cone } => {
            let lamp = PointEmitter { position_world, intensity, range_m, radius_m, soft_falloff, cone };
            AnyEmitter::Point(lamp)
        }
        LampKind::Sun { toward_world, irradiance, angle_rad } => {
            let sin_radius = (angle_rad / 2.0).clamp(0.0, 1.5).sin();
            AnyEmitter::Sun(SunEmitter { toward_world, irradiance, sin_radius })
        }
    }
}

/// Neighbours come together: samples dealt along the list are then dealt through space.
fn sort_by_place(emitters: &mut [(AnyEmitter, Vec<u32>)]) {
    let finite = |e: &&AnyEmitter| !matches!(e, AnyEmitter::Sun(_));
    let (low, high) = emitters
        .iter()
        .map(|(emitter, _)| emitter)
        .filter(finite)
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), e| (l.min(e.place()), h.max(e.place())));
    let scale = 1023.0 / (high - low).max_element().max(f32::MIN_POSITIVE);
    let key = |e: &AnyEmitter| {
        let cell = ((e.place() - low) * scale).clamp(Vec3::ZERO, Vec3::splat(1023.0)).as_uvec3();
        (0..10).fold(0_u32, |code, bit| {
            code | (cell.x >> bit & 1) << (3 * bit)
                | (cell.y >> bit & 1) << (3 * bit + 1)
                | (cell.z >> bit & 1) << (3 * bit + 2)
        })
    };
    emitters.sort_by_key(|(emitter, _)| key(emitter));
}

fn polygons(scene: &Scene, index: u32, surface: &Surface) -> Vec<Polygon> {
    let material = scene.material(surface);
    let mut out = Vec::new();
    let count = scene.geometry(surface).triangles.len() as u32;
    if material.emission_texture.is_some() {
        for triangle in 0..count {
            cut_textured(scene, index, surface, triangle, &mut out);
        }
    } else {
        let mut triangle = 0;
        while triangle < count {
            let corners = scene.corners_world(surface, triangle);
            let next = (triangle + 1 < count).then(|| scene.corners_world(surface, triangle + 1));
            let quad = next.and_then(|next| convex_quad(&corners, &next));
            triangle += if quad.is_some() { 2 } else { 1 };
            out.extend(match quad {
                Some(quad) => Polygon::new(&quad, material.emission.0),
                None => Polygon::new(&corners, material.emission.0),
            });
        }
    }
    if material.double_sided {
        let backs: Vec<_> = out.iter().filter_map(Polygon::flipped).collect();
        out.extend(backs);
    }
    out
}

/// The quad of two triangles that share an edge and a plane, when it is convex.
fn convex_quad(a: &[Vec3; 3], b: &[Vec3; 3]) -> Option<[Vec3; 4]> {
    for i in 0..3 {
        let (p, q, apex) = (a[i], a[(i + 1) % 3], a[(i + 2) % 3]);
        for j in 0..3 {
            if b[j] == q && b[(j + 1) % 3] == p {
                let quad = [apex, p, b[(j + 2) % 3], q];
                let corner = |k: usize| {
                    let (before, at, after) = (quad[(k + 3) % 4], quad[k], quad[(k + 1) % 4]);
                    (at - before).cross(after - at).try_normalize()
                };
                let normals = [corner(0)?, corner(1)?, corner(2)?, corner(3)?];
                return normals.iter().all(|n| n.dot(normals[0]) > 1.0 - 1e-6).then_some(quad);
            }
        }
    }
    None
}

/// Cuts a triangle with an emissive texture into evenly bright pieces: a piece is cut into four while its quarters
/// differ, down to about one texture texel.
fn cut_textured(scene: &Scene, index: u32, surface: &Surface, triangle: u32, out: &mut Vec<Polygon>) {
    let material = scene.material(surface);
    let Some(slot) = &material.emission_texture else { return };
    let size = scene.textures[slot.texture.0 as usize].size();
    let reach = scene.geometry(surface).texcoords.get(slot.texcoord).map_or(1.0, |set| {
        let [a, b, c] =
            scene.corner_indices(surface, triangle).map(|i| slot.transform.transform_point2(set[i]));
        let texels = Vec2::new(size[0] as f32, size[1] as f32);
        ((b - a).abs().max((c - a).abs()) * texels).max_element()
    });
    let levels = (reach.max(1.0).log2().ceil() as u32).min(DEEPEST_CUT);
    let corners = scene.corners_world(surface, triangle);
    let whole = [Vec2::ZERO, Vec2::X, Vec2::Y];
    let mut stack = vec![(whole, levels)];
    while let Some((piece, level)) = stack.pop() {
        let [a, b, c] = piece;
        let middles = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        let quarters =
            [[a, middles[0], middles[2]], [middles[0], b, middles[1]], [middles[2], middles[1], c], middles];
        let mean =
            |t: &[Vec2; 3]| mean_radiance(scene, index, triangle, t, (reach / 16.0).ceil().max(1.0) as u32);
        let radiances = quarters.map(|q| mean(&q));
        let average = (radiances[0] + radiances[1] + radiances[2] + radiances[3]) / 4.0;
        let uneven =
            radiances.iter().any(|r| (*r - average).abs().max_element() > 0.02 * average.max_element());
        if level > 0 && (uneven || level == levels) {
            stack.extend(quarters.map(|q| (q, level - 1)));
        } else if average.max_element() > 0.0 {
            let world =
                piece.map(|w| corners[0] + (corners[1] - corners[0]) * w.x + (corners[2] - corners[0]) * w.y);
            out.extend(Polygon::new(&world, average).map(|p| p.part_of(&corners)));
        }
    }
}

fn mean_radiance(scene: &Scene, surface: u32, triangle: u32, piece: &[Vec2; 3], steps: u32) -> Vec3 {
    let n = steps.clamp(2, 16);
    let mut sum = Vec3::ZERO;
    let mut count = 0.0;
    for i in 0..n {
        for j in 0..n - i {
            let (u, v) = ((i as f32 + 1.0 / 3.0) / n as f32, (j as f32 + 1.0 / 3.0) / n as f32);
            let barycentric = piece[0] + (piece[1] - piece[0]) * u + (piece[2] - piece[0]) * v;
            sum += scene.emission(SurfacePoint { surface, triangle, barycentric }).0;
            count += 1.0;
        }
    }
    sum / count
}

/// Splits polygons at the median of their longest axis until a group is small and faces one way.
fn grouped(polygons: Vec<Polygon>) -> Vec<Vec<Polygon>> {
    let mut done = Vec::new();
    let mut stack = vec![polygons];
    while let Some(mut group) = stack.pop() {
        let Some(first) = group.first() else { continue };
        let facing = first.normal();
        if group.len() > 1 && group.iter().any(|p| p.normal().dot(facing) < 0.5) {
            let (same, other) = group.into_iter().partition(|p| p.normal().dot(facing) >= 0.5);
            stack.push(other);
            stack.push(same);
        } else if group.len() > GROUP {
            let (lo, hi) = group.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| {
                (lo.min(p.centre()), hi.max(p.centre()))
            });
            let axis = (hi - lo).max_position();
            group.sort_by(|a, b| a.centre()[axis].total_cmp(&b.centre()[axis]));
            let tail = group.split_off(group.len() / 2);
            stack.push(tail);
            stack.push(group);
        } else {
            done.push(group);
        }
    }
    done
}
