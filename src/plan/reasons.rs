//! Why a scene calls for an effect or not, from what was proven.

use super::effects::{Called, Evidence};
use super::lamps::Idle;
use super::materials::emits;
use super::rooms::Rooms;
use super::{Facts, Side};
use crate::scene::{LampKind, Material, Origin, Role, Scene, Sky};
use crate::text;
use std::collections::BTreeMap;

pub(super) fn lamps(facts: &Facts, what: &str, kind: &dyn Fn(&LampKind) -> bool) -> Called {
    let of_kind = || facts.scene.lamps.iter().zip(&facts.idle).filter(|(lamp, _)| kind(&lamp.kind));
    let shining =
        Evidence::new(of_kind().filter(|(_, idle)| idle.is_none()).map(|(lamp, _)| lamp.name.as_str()));
    if shining.count > 0 {
        return (true, format!("{}: {}", counted(shining.count, what), shining.some()), shining);
    }
    let idle = Evidence::new(of_kind().map(|(lamp, _)| lamp.name.as_str()));
    let reason = match idle.count {
        0 => format!("the scene has no {}", what.replace("{s}", "")),
        _ => format!("{} without effect: {}", counted(idle.count, what), idle.some()),
    };
    (false, reason, idle)
}

pub(super) fn surfaces(
    facts: &Facts,
    what: &str,
    none: &str,
    test: &dyn Fn(usize, &Material) -> bool,
) -> Called {
    let scene = facts.scene;
    let meant = |i: &usize| test(*i, scene.material(&scene.surfaces[*i]));
    let evidence = objects(scene, (0..scene.surfaces.len()).filter(meant));
    match evidence.count {
        0 => (false, none.to_owned(), evidence),
        count => (true, format!("{}: {}", counted(count, what), evidence.some()), evidence),
    }
}

/// The objects that surfaces belong to, each once, however many materials it has.
fn objects(scene: &Scene, surfaces: impl Iterator<Item = usize>) -> Evidence {
    let mut origins: Vec<&Origin> = surfaces.map(|surface| &scene.surfaces[surface].origin).collect();
    let place = |origin: &Origin| (origin.node, origin.instance);
    origins.sort_by_key(|origin| place(origin));
    origins.dedup_by_key(|origin| place(origin));
    Evidence::new(origins.iter().map(|origin| origin.name.as_str()))
}

pub(super) fn far_lamps(facts: &Facts) -> Called {
    let why = |why: Idle| {
        let lamps = facts.scene.lamps.iter().zip(&facts.idle).filter(move |(_, idle)| **idle == Some(why));
        Evidence::new(lamps.map(|(lamp, _)| lamp.name.as_str()))
    };
    let said = [
        (Idle::Black, "without power"),
        (Idle::SealedOff, "sealed off from everything that is lightmapped"),
        (Idle::OutOfReach, "whose light ends before it meets anything"),
        (Idle::FacingAway, "behind everything that takes light"),
    ];
    let parts: Vec<(Evidence, &str)> = said
        .into_iter()
        .map(|(idle, words)| (why(idle), words))
        .filter(|(lamps, _)| lamps.count > 0)
        .collect();
    if parts.is_empty() {
        let area_lamps = facts.scene.surfaces.iter().any(|surface| surface.role == Role::Emits);
        let reason = match (facts.scene.lamps.len(), area_lamps) {
            (0, false) => "the scene has no lamps",
            (0, true) => "the scene has no lamps but area lamps",
            _ => "no lamp was found that lights nothing",
        };
        return (false, reason.to_owned(), Evidence::default());
    }
    let words = parts
        .iter()
        .map(|(lamps, words)| format!("{} {words}: {}", counted(lamps.count, "lamp{s}"), lamps.some()));
    let reason = words.collect::<Vec<_>>().join("; ");
    (false, reason, Evidence::new(parts.iter().flat_map(|(lamps, _)| lamps.names.iter().map(String::as_str))))
}

pub(super) fn sky(facts: &Facts) -> Called {
    let reason = match (facts.scene.sky.is_lit(), facts.sky_seen) {
        (false, _) => "the sky is black".to_owned(),
        (true, true) => "the sky is lit".to_owned(),
        (true, false) => format!("everything lightmapped is sealed in: {}", closed_rooms(facts).some()),
    };
    (facts.sky_seen, reason, Evidence::number(usize::from(facts.scene.sky.is_lit())))
}

fn closed_rooms(facts: &Facts) -> Evidence {
    let scene = facts.scene;
    // The inside of a solid is as sealed, but nobody would call it a room: that has a light in it, or other things.
    let has_anything = |room: &u32| {
        let lamp = facts.rooms.of_lamp.iter().any(|within| within.contains(room));
        let takes_or_gives = |surface: usize| {
            let sides = facts.lit[surface].both().into_iter().zip(&facts.rooms.of_side[surface]);
            let within = |(side, rooms): (Side, &Vec<u32>)| {
                let other = scene.surfaces[surface].origin.name != facts.rooms.names[*room as usize];
                rooms.contains(room)
                    && (emits(scene, surface) || side != Side::Dark && (other || rooms.len() == 1))
            };
            sides.into_iter().any(within)
        };
        lamp || (0..scene.surfaces.len()).any(takes_or_gives)
    };
    let rooms = (Rooms::OUTSIDE + 1..facts.rooms.len() as u32).filter(has_anything);
    Evidence::new(rooms.map(|room| facts.rooms.names[room as usize].as_str()))
}

/// Lights whose shadows are computed.
pub(super) fn lights(facts: &Facts) -> usize {
    let surfaces = (0..facts.scene.surfaces.len()).filter(|&surface| emits(facts.scene, surface)).count();
    let in_sky = facts.sky_seen && matches!(facts.scene.sky, Sky::Image(_));
    facts.idle.iter().filter(|idle| idle.is_none()).count() + surfaces + usize::from(in_sky)
}

pub(super) fn shadows(facts: &Facts) -> Called {
    if lights(facts) == 0 {
        return (false, "no lamp and no surface sends light".to_owned(), Evidence::default());
    }
    let [all, open, clear] = facts.sight.count(facts.scene, &facts.sides);
    let reason = match (open, clear) {
        _ if all == 0 => return (false, "nothing takes light".to_owned(), Evidence::default()),
        (open, _) if open == all => "nothing stands in front of any surface".to_owned(),
        (_, clear) if clear == all => "nothing stands between the lights and any surface".to_owned(),
        (_, 0) => "other triangles may stand in front of every surface".to_owned(),
        _ => {
            format!(
                "{} of {} sides of triangles may be shaded",
                text::count((all - clear) as u64),
                text::count(all as u64)
            )
        }
    };
    (clear < all, reason, Evidence::number(all - clear))
}

pub(super) fn penumbras(facts: &Facts) -> Called {
    let (on, reason, evidence) = shadows(facts);
    let reason = if on { "shadows have borders".to_owned() } else { format!("no shadows: {reason}") };
    (on, reason, evidence)
}

pub(super) fn back_faces(facts: &Facts) -> Called {
    let name = |surface: usize| facts.scene.surfaces[surface].origin.name.as_str();
    let lit = objects(facts.scene, (0..facts.sides.len()).filter(|&i| facts.sides[i].back != Side::Dark));
    if lit.count > 0 {
        let why = facts
            .found
            .backs
            .iter()
            .find(|back| !back.dropped && name(back.surface as usize) == lit.names[0]);
        let why = why.map_or(String::new(), |back| format!(" ('{}': {})", lit.names[0], back.reason));
        let what = counted(lit.count, "object{s} whose back can be lit");
        return (true, format!("{what}: {}{why}", lit.some()), lit);
    }
    let backs = || facts.found.backs.iter();
    let dropped = objects(facts.scene, backs().filter(|back| back.dropped).map(|back| back.surface as usize));
    let reason = match backs().count() {
        0 => "no material is double-sided".to_owned(),
        _ if backs().all(|back| back.dropped) => {
            format!("every double-sided object is closed and faces outward: {}", dropped.some())
        }
        _ => "no back of a double-sided object is seen by anything lightmapped".to_owned(),
    };
    (false, reason, dropped)
}

pub(super) fn unseen(facts: &Facts) -> Called {
    let left_out = |i: &usize| facts.lit[*i] != facts.sides[*i];
    let evidence = objects(facts.scene, (0..facts.lit.len()).filter(left_out));
    let reason = match evidence.count {
        0 => "every lit side may be seen by something lightmapped".to_owned(),
        count => format!(
            "{} sealed off from everything lightmapped: {}",
            counted(count, "object{s} with a side"),
            evidence.some()
        ),
    };
    (false, reason, evidence)
}

pub(super) fn between_rooms(facts: &Facts) -> Called {
    let closed = closed_rooms(facts);
    let reason = match closed.count {
        0 => "nothing was found that is sealed off: all counts as one room".to_owned(),
        _ => format!("{} sealed off inside {}", counted(closed.count, "room{s}"), closed.some()),
    };
    (false, reason, closed)
}

fn shines(facts: &Facts) -> bool {
    lights(facts) > 0 || facts.sky_seen
}

pub(super) fn bounces(facts: &Facts) -> Called {
    let off = |reason: &str| (false, reason.to_owned(), Evidence::default());
    let scene = facts.scene;
    if facts.direct_alone {
        return off("only direct light is stored (--light direct)");
    }
    if !shines(facts) {
        return off("nothing sends light");
    }
    let reflects =
        |i: &usize| facts.sides[*i].both() != [Side::Dark; 2] && super::materials::reflects(scene, *i);
    let evidence = objects(scene, (0..scene.surfaces.len()).filter(reflects));
    match (evidence.count, facts.reflects) {
        (0, _) => off("every surface is black"),
        (_, false) => (false, "no surface sees another".to_owned(), evidence),
        (count, true) => {
            (true, format!("{}: {}", counted(count, "reflecting object{s}"), evidence.some()), evidence)
        }
    }
}

pub(super) fn final_gather(facts: &Facts) -> Called {
    let (bounces, reason, _) = bounces(facts);
    if bounces {
        return (true, "light bounces".to_owned(), Evidence::default());
    }
    if facts.sky_seen && !facts.direct_alone {
        return (true, "the sky is lit".to_owned(), Evidence::default());
    }
    (false, format!("no light but straight from lamps: {reason}"), Evidence::default())
}

pub(super) fn channels(facts: &Facts) -> Called {
    let reason =
        if facts.grey { "everything is grey: one channel does" } else { "lights or surfaces are coloured" };
    (!facts.grey, reason.to_owned(), Evidence::default())
}

pub(super) fn instancing(scene: &Scene) -> Called {
    let mut uses = vec![0; scene.geometries.len()];
    scene.surfaces.iter().for_each(|surface| uses[surface.geometry.0 as usize] += 1);
    // A mesh of several materials is several geometries.
    let shared = scene.surfaces.iter().filter(|surface| uses[surface.geometry.0 as usize] > 1);
    let meshes: BTreeMap<usize, &str> =
        shared.map(|surface| (surface.origin.mesh, scene.geometry(surface).name.as_str())).collect();
    let evidence = Evidence::new(meshes.into_values());
    match evidence.count {
        0 => (false, "no mesh stands in several places".to_owned(), evidence),
        count => {
            (true, format!("{} in several places: {}", counted(count, "mesh{es}"), evidence.some()), evidence)
        }
    }
}

/// "1 sun with a size", "3 suns with a size" of "sun{s} with a size".
fn counted(n: usize, what: &str) -> String {
    let (noun, verb) = if n == 1 { ("", "s") } else { ("s", "") };
    let es = if n == 1 { "" } else { "es" };
    let what = what.replace("{s}", noun).replace("{es}", es).replace("{s'}", verb);
    format!("{} {what}", text::count(n as u64))
}
