//! Which effects a scene calls for, said in the artist's words.

use super::lamps::Idle;
use super::materials::emits;
use super::rooms::Rooms;
use super::{Facts, Side};
use crate::options::Effect;
use crate::scene::{Alpha, LampKind, Material, Role, Scene};
use serde::Serialize;

/// One effect, on or off.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Which.
    pub effect: Effect,
    /// Whether it is simulated.
    pub on: bool,
    /// Whether it, or a part of it, is simulated only because that was asked for.
    pub forced: bool,
    /// Why the scene calls for it or not, in the artist's words.
    pub reason: String,
    /// What the reason rests on.
    pub evidence: Evidence,
    /// What leaving it out saves; empty when nothing is left out.
    pub saves: String,
}

/// What a reason rests on.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Evidence {
    /// How many objects, lamps or triangles call for the effect, or let it be left out.
    pub count: usize,
    /// Names of those that have some, each once, at most [`Evidence::MOST`].
    pub names: Vec<String>,
}

impl Evidence {
    /// The most names that are kept.
    pub const MOST: usize = 16;

    fn new<'n>(names: impl IntoIterator<Item = &'n str>) -> Self {
        let mut names: Vec<&str> = names.into_iter().collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        names.truncate(Self::MOST);
        Self { count, names: names.into_iter().map(str::to_owned).collect() }
    }

    fn number(count: usize) -> Self {
        Self { count, names: Vec::new() }
    }

    fn some(&self) -> String {
        let shown = self.names.iter().take(4).map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", ");
        if self.names.len() > 4 { format!("{shown}, ...") } else { shown }
    }
}

/// Kinds of light of which one that sends nothing can be asked at every texel.
pub(super) const LISTED_LIGHTS: [Effect; 4] =
    [Effect::AreaLights, Effect::PointLamps, Effect::SpotLamps, Effect::Suns];

/// Whether the scene calls for an effect, and why.
type Called = (bool, String, Evidence);

/// Every effect with its reason.
pub(super) fn findings(facts: &Facts) -> Vec<Finding> {
    let call = |effect| -> Called {
        match effect {
            Effect::AreaLights => {
                surfaces(facts, "glowing object{s}", "no material emits light", &|i, _| emits(facts.scene, i))
            }
            Effect::TexturedEmission => surfaces(
                facts,
                "object{s} with an emissive image",
                "no material emits through an image",
                &|i, m| emits(facts.scene, i) && m.emission_texture.is_some(),
            ),
            Effect::PointLamps => {
                lamps(facts, "point lamp{s}", &|k| matches!(k, LampKind::Point { cone: None, .. }))
            }
            Effect::SpotLamps => {
                lamps(facts, "spot lamp{s}", &|k| matches!(k, LampKind::Point { cone: Some(_), .. }))
            }
            Effect::Suns => lamps(facts, "sun{s}", &|k| matches!(k, LampKind::Sun { .. })),
            Effect::SoftSuns => lamps(
                facts,
                "sun{s} with an angular size",
                &|k| matches!(k, LampKind::Sun { angle_rad, .. } if *angle_rad > 0.0),
            ),
            Effect::SoftLamps => lamps(
                facts,
                "lamp{s} with a radius",
                &|k| matches!(k, LampKind::Point { radius_m, .. } if *radius_m > 0.0),
            ),
            Effect::FarLamps => far_lamps(facts),
            Effect::Sky => sky(facts),
            Effect::Shadows => shadows(facts),
            Effect::Penumbras => penumbras(facts),
            Effect::AlphaTest => {
                surfaces(facts, "object{s} with a mask", "no material uses alphaMode MASK", &|i, m| {
                    matches!(m.alpha, Alpha::Mask { .. }) && facts.scene.surfaces[i].role != Role::Emits
                })
            }
            Effect::TintedShadows => surfaces(
                facts,
                "object{s} that let{s'} light through",
                "no material uses alphaMode BLEND",
                &|_, m| m.alpha == Alpha::Blend,
            ),
            Effect::BackFaces => back_faces(facts),
            Effect::UnseenSurfaces => unseen(facts),
            Effect::LightBetweenRooms => between_rooms(facts),
            Effect::Bounces => bounces(facts),
            Effect::FinalGather => final_gather(facts),
            Effect::ColourChannels => channels(facts),
            Effect::AlbedoTextures => surfaces(
                facts,
                "object{s} with a colour image",
                "no lit material has a colour image",
                &|i, m| m.base_color_texture.is_some() && facts.sides[i].both() != [Side::Dark; 2],
            ),
            Effect::SmoothNormals => {
                surfaces(facts, "object{s} with smooth normals", "all objects are shaded flat", &|i, _| {
                    facts.scene.geometry(&facts.scene.surfaces[i]).smooth
                        && facts.sides[i].both() != [Side::Dark; 2]
                })
            }
            Effect::Instancing => instancing(facts.scene),
        }
    };
    let finding = |effect: Effect| {
        let (called, reason, evidence) = call(effect);
        let forced = can_be_forced(facts, effect, called) && facts.wanted.forced.has(effect);
        let on = called || forced;
        let saves = if on { String::new() } else { saves(facts, effect).to_owned() };
        Finding { effect, on, forced, reason, evidence, saves }
    };
    Effect::ALL.into_iter().map(finding).collect()
}

/// Whether there is anything that could be computed in vain: an image that is not there cannot be read, and what is
/// called for is not in vain.
fn can_be_forced(facts: &Facts, effect: Effect, called: bool) -> bool {
    match effect {
        Effect::TexturedEmission | Effect::AlbedoTextures | Effect::SmoothNormals | Effect::Instancing => {
            false
        }
        Effect::Sky => facts.scene.sky.is_lit(),
        Effect::BackFaces => facts.found.backs.iter().any(|back| back.dropped),
        Effect::UnseenSurfaces => facts.lit != facts.sides,
        Effect::LightBetweenRooms => facts.rooms.len() > 1,
        Effect::FarLamps => facts.idle.iter().flatten().any(|idle| *idle != Idle::Black),
        Effect::Shadows | Effect::Penumbras => !facts.sight.is_empty(),
        _ => !called,
    }
}

fn saves(facts: &Facts, effect: Effect) -> &'static str {
    if !can_be_forced(facts, effect, false) {
        return match effect {
            Effect::Sky | Effect::BackFaces | Effect::FarLamps => "nothing to leave out",
            _ => "no lookups, no memory",
        };
    }
    match effect {
        Effect::AreaLights | Effect::PointLamps | Effect::SpotLamps | Effect::Suns => {
            "one light to ask at every texel"
        }
        Effect::TexturedEmission | Effect::AlbedoTextures => "image lookups",
        Effect::SoftSuns | Effect::SoftLamps => "all shadow rays of a texel but one",
        Effect::FarLamps => "shadow rays from every texel to these lights",
        Effect::Sky => "shadow rays from every texel to up to 64 bright parts of the sky, if it is an image",
        Effect::Shadows => "all shadow rays",
        Effect::Penumbras => "the rays of shadow borders",
        Effect::AlphaTest => "an image lookup a hit",
        Effect::TintedShadows => "going on behind every hit",
        Effect::BackFaces | Effect::UnseenSurfaces => "the elements, direct light and patches of these sides",
        Effect::LightBetweenRooms => "shadow rays from every texel to the lamps of other rooms",
        Effect::Bounces => "the form factors of all patches",
        Effect::FinalGather => "all gather rays",
        Effect::ColourChannels => "two thirds of the memory that gather rays read",
        Effect::SmoothNormals => "interpolating normals",
        Effect::Instancing => "nothing",
    }
}

fn lamps(facts: &Facts, what: &str, kind: &dyn Fn(&LampKind) -> bool) -> Called {
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

fn surfaces(facts: &Facts, what: &str, none: &str, test: &dyn Fn(usize, &Material) -> bool) -> Called {
    let scene = facts.scene;
    let meant = |i: &usize| test(*i, scene.material(&scene.surfaces[*i]));
    let names = (0..scene.surfaces.len()).filter(meant).map(|i| scene.surfaces[i].origin.name.as_str());
    let evidence = Evidence::new(names);
    match evidence.count {
        0 => (false, none.to_owned(), evidence),
        count => (true, format!("{}: {}", counted(count, what), evidence.some()), evidence),
    }
}

fn far_lamps(facts: &Facts) -> Called {
    let why = |why: Idle| {
        let lamps = facts.scene.lamps.iter().zip(&facts.idle).filter(move |(_, idle)| **idle == Some(why));
        Evidence::new(lamps.map(|(lamp, _)| lamp.name.as_str()))
    };
    let said = [
        (Idle::SealedOff, "sealed off from everything that is lightmapped"),
        (Idle::OutOfReach, "whose light ends before it meets anything"),
    ];
    let parts: Vec<(Evidence, &str)> = said
        .into_iter()
        .map(|(idle, words)| (why(idle), words))
        .filter(|(lamps, _)| lamps.count > 0)
        .collect();
    if parts.is_empty() {
        return (false, "every lamp lights something".to_owned(), Evidence::default());
    }
    let words = parts
        .iter()
        .map(|(lamps, words)| format!("{} {words}: {}", counted(lamps.count, "lamp{s}"), lamps.some()));
    let reason = words.collect::<Vec<_>>().join("; ");
    (false, reason, Evidence::new(parts.iter().flat_map(|(lamps, _)| lamps.names.iter().map(String::as_str))))
}

fn sky(facts: &Facts) -> Called {
    let reason = match (facts.scene.sky.is_lit(), facts.sky_seen) {
        (false, _) => "the sky is black".to_owned(),
        (true, true) => "the sky is lit".to_owned(),
        (true, false) => format!("everything lightmapped is sealed in: {}", closed_rooms(facts).some()),
    };
    (facts.sky_seen, reason, Evidence::number(usize::from(facts.scene.sky.is_lit())))
}

fn closed_rooms(facts: &Facts) -> Evidence {
    Evidence::new(facts.rooms.names.iter().skip(Rooms::OUTSIDE as usize + 1).map(String::as_str))
}

/// Lights whose shadows are computed.
fn lights(facts: &Facts) -> usize {
    let surfaces = (0..facts.scene.surfaces.len()).filter(|&surface| emits(facts.scene, surface)).count();
    let in_sky = facts.sky_seen && matches!(facts.scene.sky, crate::scene::Sky::Image(_));
    facts.idle.iter().filter(|idle| idle.is_none()).count() + surfaces + usize::from(in_sky)
}

fn shadows(facts: &Facts) -> Called {
    if lights(facts) == 0 {
        return (false, "no lamp and no surface sends light".to_owned(), Evidence::default());
    }
    let [all, open, clear] = facts.sight.count(facts.scene, &facts.sides);
    let reason = match (open, clear) {
        _ if all == 0 => return (false, "nothing takes light".to_owned(), Evidence::default()),
        (open, _) if open == all => "nothing stands in front of any surface".to_owned(),
        (_, clear) if clear == all => "nothing stands between the lights and any surface".to_owned(),
        (_, 0) => "other triangles may stand in front of every surface".to_owned(),
        _ => format!("{} of {all} triangles may be shaded", all - clear),
    };
    (clear < all, reason, Evidence::number(all - clear))
}

fn penumbras(facts: &Facts) -> Called {
    let (on, reason, evidence) = shadows(facts);
    let reason = if on { "shadows have borders".to_owned() } else { format!("no shadows: {reason}") };
    (on, reason, evidence)
}

fn back_faces(facts: &Facts) -> Called {
    let name = |surface: usize| facts.scene.surfaces[surface].origin.name.as_str();
    let lit = (0..facts.sides.len()).filter(|&i| facts.sides[i].back != Side::Dark);
    let lit = Evidence::new(lit.map(name));
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
    let dropped =
        Evidence::new(facts.found.backs.iter().filter(|b| b.dropped).map(|b| name(b.surface as usize)));
    let reason = match (facts.found.backs.len(), dropped.count) {
        (0, _) => "no material is double-sided".to_owned(),
        (all, dropped_count) if all == dropped_count => {
            format!("every double-sided object is closed and faces outward: {}", dropped.some())
        }
        _ => "no back of a double-sided object is seen by anything lightmapped".to_owned(),
    };
    (false, reason, dropped)
}

fn unseen(facts: &Facts) -> Called {
    let left_out = |i: &usize| facts.lit[*i] != facts.sides[*i];
    let names = (0..facts.lit.len()).filter(left_out).map(|i| facts.scene.surfaces[i].origin.name.as_str());
    let evidence = Evidence::new(names);
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

fn between_rooms(facts: &Facts) -> Called {
    let closed = closed_rooms(facts);
    let reason = match facts.rooms.len() {
        1 => "no closed object has anything inside: all is one room".to_owned(),
        _ => format!(
            "{} sealed off by closed opaque objects: {}",
            counted(closed.count, "room{s}"),
            closed.some()
        ),
    };
    (false, reason, closed)
}

fn shines(facts: &Facts) -> bool {
    lights(facts) > 0 || facts.sky_seen
}

fn bounces(facts: &Facts) -> Called {
    let off = |reason: &str| (false, reason.to_owned(), Evidence::default());
    let scene = facts.scene;
    if facts.wanted.direct_alone {
        return off("only direct light is stored (--light direct)");
    }
    if !shines(facts) {
        return off("nothing sends light");
    }
    let reflecting = (0..scene.surfaces.len())
        .filter(|&i| facts.sides[i].both() != [Side::Dark; 2] && super::materials::reflects(scene, i))
        .map(|i| scene.surfaces[i].origin.name.as_str());
    let evidence = Evidence::new(reflecting);
    match (evidence.count, facts.reflects) {
        (0, _) => off("every surface is black"),
        (_, false) => (false, "no surface sees another".to_owned(), evidence),
        (count, true) => {
            (true, format!("{}: {}", counted(count, "reflecting object{s}"), evidence.some()), evidence)
        }
    }
}

fn final_gather(facts: &Facts) -> Called {
    let (bounces, reason, _) = bounces(facts);
    if bounces {
        return (true, "light bounces".to_owned(), Evidence::default());
    }
    if facts.sky_seen && !facts.wanted.direct_alone {
        return (true, "the sky is lit".to_owned(), Evidence::default());
    }
    (false, format!("no light but straight from lamps: {reason}"), Evidence::default())
}

fn channels(facts: &Facts) -> Called {
    let reason =
        if facts.grey { "everything is grey: one channel does" } else { "lights or surfaces are coloured" };
    (!facts.grey, reason.to_owned(), Evidence::default())
}

fn instancing(scene: &Scene) -> Called {
    let mut uses = vec![0; scene.geometries.len()];
    scene.surfaces.iter().for_each(|surface| uses[surface.geometry.0 as usize] += 1);
    let shared = (0..uses.len()).filter(|&g| uses[g] > 1).map(|g| scene.geometries[g].name.as_str());
    let evidence = Evidence::new(shared);
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
    format!("{} {what}", crate::text::count(n as u64))
}
