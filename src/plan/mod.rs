//! Scene + options -> which effects are simulated and why: decisions made once, before any loop.
//!
//! What cannot matter is proven not to, from materials and lamps, and from geometry: closed outward skins ([`sides`]),
//! sealed rooms ([`Rooms`]), views that nothing stands in ([`Sight`]). Where no proof is cheap, the effect stays on.

mod bodies;
mod columns;
mod effects;
mod lamps;
mod materials;
mod reasons;
mod rooms;
mod savings;
mod sides;
mod sight;
mod solid;
mod solids;

pub use effects::{Evidence, Finding};
pub use rooms::{Rooms, meet};
pub use savings::{Amount, Saving};
pub use sides::{BackEvidence, SidesFound, sides, sides_with_evidence};
pub use sight::Sight;
pub use solids::Solids;

use crate::options::{Effect, Forced};
use crate::scene::{Scene, Sky};
use bodies::Bodies;

/// What one side of a surface does in the solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Gets texels in a page that is written.
    Lightmapped,
    /// Gets coarse texels in a page that is not written: it reflects, nobody looks it up.
    Hidden,
    /// The same only because that was asked for. Its texels have pages of their own: where those of the others lie must
    /// not hang on it, or they would sample other places.
    InVain,
    /// Neither receives nor reflects; it only blocks.
    Dark,
}

/// The sides of one surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Sides {
    /// The side its triangles wind counter-clockwise on.
    pub front: Side,
    /// The other.
    pub back: Side,
}

impl Sides {
    /// Front, then back.
    pub fn both(&self) -> [Side; 2] {
        [self.front, self.back]
    }
}

/// Whether a light is asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shining {
    /// Not at all.
    #[default]
    Not,
    /// It counts.
    Counts,
    /// It lights nothing that counts and is asked all the same.
    InVain,
}

impl Shining {
    fn of(counts: bool, forced: bool) -> Self {
        match (counts, forced) {
            (true, _) => Self::Counts,
            (false, true) => Self::InVain,
            (false, false) => Self::Not,
        }
    }
}

/// What shines.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lights {
    /// Per lamp of the scene.
    pub lamps: Vec<Shining>,
    /// Per surface of the scene: its emission.
    pub surfaces: Vec<Shining>,
    /// The sky.
    pub sky: Shining,
    /// Whether lights are asked in rooms that they are not in.
    pub between_rooms: bool,
    /// Kinds of light that are asked at every texel although none of them shines.
    pub black: Vec<Effect>,
    /// Whether lights without extent are probed as often as those with.
    pub sharp_as_soft: bool,
    /// Whether lights are probed from where nothing stands in their way, too.
    pub clear_probed: bool,
}

/// What is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work {
    /// Whether anything that is reflected meets anything that counts.
    pub bounces: bool,
    /// Whether light arrives that no lamp sends straight.
    pub gather: bool,
    /// Whether red, green and blue are the same everywhere.
    pub grey: bool,
    /// Whether rays ask every surface how much it lets through.
    pub tinted: bool,
}

/// Decisions made once, before any loop.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Plan {
    /// One per surface of the scene.
    pub sides: Vec<Sides>,
    /// Every effect with its reason.
    pub effects: Vec<Finding>,
    /// Per surface its sides (front, back) that take light only because that was asked for.
    #[serde(skip)]
    pub by_force: Vec<[bool; 2]>,
    /// Which lights can meet which surfaces.
    #[serde(skip)]
    pub rooms: Rooms,
    /// Where nothing stands in the way.
    #[serde(skip)]
    pub sight: Sight,
    /// What shines.
    #[serde(skip)]
    pub lights: Lights,
    /// What is computed.
    #[serde(skip)]
    pub work: Work,
}

/// What the caller wants.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// Effects that are simulated whether the scene calls for them or not.
    pub forced: Forced,
    /// Whether only light straight from lamps and emitters is stored.
    pub direct_alone: bool,
}

/// Everything that proofs found, before anything is forced.
struct Facts<'a> {
    scene: &'a Scene,
    direct_alone: bool,
    found: SidesFound,
    /// Sides before those that nobody sees were left out, and after.
    lit: Vec<Sides>,
    sides: Vec<Sides>,
    rooms: Rooms,
    /// Those with a lightmapped side.
    seen: Vec<u32>,
    idle: Vec<Option<lamps::Idle>>,
    sight: Sight,
    sky_seen: bool,
    grey: bool,
    /// Whether a side reflects and is seen.
    reflects: bool,
}

/// What is proven of a scene: plans that force different effects share it.
pub struct Proven<'a>(Facts<'a>);

/// Decides what takes part.
pub fn plan(scene: &Scene, wanted: &Wanted) -> Plan {
    Proven::new(scene, wanted.direct_alone).plan(&wanted.forced)
}

impl<'a> Proven<'a> {
    /// Looks at the scene; `direct_alone` as in [`Wanted`].
    pub fn new(scene: &'a Scene, direct_alone: bool) -> Self {
        let bodies = Bodies::new(scene);
        let found = sides::find(scene, &bodies);
        let rooms = rooms::rooms(scene, &bodies);
        drop(bodies);
        let seen = seen_rooms(&found.sides, &rooms);
        let lit = found.sides.clone();
        let sides: Vec<Sides> = lit
            .iter()
            .zip(&rooms.of_side)
            .map(|(sides, within)| {
                let kept = |side: Side, rooms: &[u32]| match side {
                    Side::Hidden if !meet(rooms, &seen) => Side::Dark,
                    side => side,
                };
                Sides { front: kept(sides.front, &within[0]), back: kept(sides.back, &within[1]) }
            })
            .collect();
        let idle = lamps::idle(scene, &sides, &rooms, &seen);
        let sky_seen = scene.sky.is_lit() && seen.contains(&Rooms::OUTSIDE);
        let shining: Vec<bool> = idle.iter().map(Option::is_none).collect();
        let suns_in_sky = sky_seen && matches!(scene.sky, Sky::Image(_));
        let sight = sight::sight(scene, &sides, &rooms, &shining, suns_in_sky);
        let reflects = reflects(scene, &sides, &sight);
        let grey = materials::all_grey(scene);
        Self(Facts {
            scene,
            direct_alone,
            found,
            lit,
            sides,
            rooms,
            seen,
            idle,
            sight,
            sky_seen,
            grey,
            reflects,
        })
    }

    /// The plan with some effects forced. What is forced comes after what was proven, so that proofs are the same
    /// either way.
    pub fn plan(&self, wanted: &Forced) -> Plan {
        let Facts { scene, found, lit, rooms, seen, idle, sky_seen, .. } = &self.0;
        let forced = |effect| wanted.has(effect);
        let (mut all, mut by_force) = (self.0.sides.clone(), vec![[false; 2]; self.0.sides.len()]);
        let mut force = |surface: usize, side: usize| {
            let slot = if side == 0 { &mut all[surface].front } else { &mut all[surface].back };
            if *slot == Side::Dark {
                *slot = Side::InVain;
                by_force[surface][side] = true;
            }
        };
        if forced(Effect::UnseenSurfaces) {
            for (surface, sides) in lit.iter().enumerate() {
                let lit = sides.both().into_iter().enumerate().filter(|(_, side)| *side != Side::Dark);
                lit.for_each(|(side, _)| force(surface, side));
            }
        }
        if forced(Effect::BackFaces) {
            let dropped = found.backs.iter().filter(|back| back.dropped);
            dropped.for_each(|back| force(back.surface as usize, 1));
        }
        let shines = |(lamp, idle): (usize, &Option<lamps::Idle>)| {
            Shining::of(idle.is_none(), forced(Effect::FarLamps) && scene.lamp_shines(lamp))
        };
        let glows = |surface: usize| match materials::emits(scene, surface) {
            false => Shining::Not,
            true => {
                let counts = rooms.of_side[surface].iter().any(|side| meet(side, seen));
                Shining::of(counts, forced(Effect::FarLamps))
            }
        };
        let lights = Lights {
            lamps: idle.iter().enumerate().map(shines).collect(),
            surfaces: (0..scene.surfaces.len()).map(glows).collect(),
            sky: Shining::of(*sky_seen, forced(Effect::Sky) && scene.sky.is_lit()),
            between_rooms: forced(Effect::LightBetweenRooms),
            black: effects::LISTED_LIGHTS.into_iter().filter(|&kind| forced(kind)).collect(),
            sharp_as_soft: forced(Effect::SoftSuns) || forced(Effect::SoftLamps),
            clear_probed: forced(Effect::Shadows) || forced(Effect::Penumbras),
        };
        let effects = effects::findings(&self.0, wanted);
        let on = |effect: Effect| effects.iter().any(|finding| finding.effect == effect && finding.on);
        let work = Work {
            bounces: on(Effect::Bounces),
            // What bounces is found by gathering.
            gather: on(Effect::FinalGather) || on(Effect::Bounces),
            grey: !on(Effect::ColourChannels),
            tinted: forced(Effect::AlphaTest) || forced(Effect::TintedShadows),
        };
        let vain = [Effect::FarLamps, Effect::Sky, Effect::LightBetweenRooms].into_iter().any(forced);
        let sight = match () {
            () if forced(Effect::Shadows) || forced(Effect::Penumbras) => Sight::default(),
            () if vain => self.0.sight.clone().open_alone(),
            () => self.0.sight.clone(),
        };
        Plan { sides: all, effects, by_force, rooms: rooms.clone(), sight, lights, work }
    }
}

/// Rooms with a lightmapped side; all where nothing is lightmapped.
fn seen_rooms(sides: &[Sides], rooms: &Rooms) -> Vec<u32> {
    let mut seen: Vec<u32> = Vec::new();
    for (sides, within) in sides.iter().zip(&rooms.of_side) {
        for (side, rooms) in sides.both().into_iter().zip(within) {
            if side == Side::Lightmapped {
                seen.extend(rooms);
            }
        }
    }
    seen.sort_unstable();
    seen.dedup();
    if seen.is_empty() { (0..rooms.len() as u32).collect() } else { seen }
}

/// Whether any side reflects and is not open everywhere: then something else might see it.
fn reflects(scene: &Scene, sides: &[Sides], sight: &Sight) -> bool {
    let mut first = 0;
    for (index, (surface, sides)) in scene.surfaces.iter().zip(sides).enumerate() {
        let triangles = scene.geometry(surface).triangles.len() as u32;
        let seen = |side: usize| (first..first + triangles).any(|triangle| !sight.is_open(triangle, side));
        if materials::reflects(scene, index)
            && (sides.front != Side::Dark && seen(0) || sides.back != Side::Dark && seen(1))
        {
            return true;
        }
        first += triangles;
    }
    false
}
