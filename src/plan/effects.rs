//! Which effects a scene calls for, said in the artist's words.

use super::lamps::Idle;
use super::materials::emits;
use super::reasons::{
    back_faces, between_rooms, bounces, channels, far_lamps, final_gather, instancing, lamps, lights,
    penumbras, shadows, sky, surfaces, unseen,
};
use super::savings::{PARTLY_SAVED, Saving, saved};
use super::{Facts, Side};
use crate::options::{Effect, Forced};
use crate::scene::{Alpha, LampKind, Opacity, Role, Surface};
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
    /// Whether it could be simulated in vain: it is left out, wholly or for a part, and there is something to leave out.
    #[serde(skip)]
    pub can_be_forced: bool,
    /// Why the scene calls for it or not, in the artist's words.
    pub reason: String,
    /// What the reason rests on.
    pub evidence: Evidence,
    /// What leaving it out saves.
    pub saving: Saving,
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

    pub(super) fn new<'n>(names: impl IntoIterator<Item = &'n str>) -> Self {
        let mut names: Vec<&str> = names.into_iter().collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        names.truncate(Self::MOST);
        Self { count, names: names.into_iter().map(str::to_owned).collect() }
    }

    pub(super) fn number(count: usize) -> Self {
        Self { count, names: Vec::new() }
    }

    pub(super) fn some(&self) -> String {
        let shown = self.names.iter().take(4).map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", ");
        if self.names.len() > 4 { format!("{shown}, ...") } else { shown }
    }
}

/// Kinds of light of which one that sends nothing can be asked at every texel.
pub(super) const LISTED_LIGHTS: [Effect; 4] =
    [Effect::AreaLights, Effect::PointLamps, Effect::SpotLamps, Effect::Suns];

/// Whether the scene calls for an effect, and why.
pub(super) type Called = (bool, String, Evidence);

/// Every effect with its reason.
pub(super) fn findings(facts: &Facts, wanted: &Forced) -> Vec<Finding> {
    let opacity = |surface: usize| facts.scene.opacity_of(&facts.scene.surfaces[surface]);
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
            Effect::AlphaTest => surfaces(facts, "object{s} with holes", no_holes(facts), &|i, _| {
                facts.scene.surfaces[i].role != Role::Emits && opacity(i) == Opacity::Holes
            }),
            Effect::TintedShadows => {
                surfaces(facts, "object{s} that let{s'} light through", no_veils(facts), &|i, _| {
                    facts.scene.surfaces[i].role != Role::Emits && opacity(i) == Opacity::Partial
                })
            }
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
        let forceable = can_be_forced(facts, effect, called);
        let forced = forceable && wanted.has(effect);
        let on = called || forced;
        let what = match (on, forced) {
            // For some texels they are left out; for how many, a bake finds as it goes.
            (true, false) if forceable && effect == Effect::Shadows => PARTLY_SAVED.to_owned(),
            (true, _) => String::new(),
            (false, _) => saved(facts, effect).to_owned(),
        };
        let saving = Saving { what, amounts: Vec::new() };
        Finding { effect, on, forced, can_be_forced: forceable && !on, reason, evidence, saving }
    };
    Effect::ALL.into_iter().map(finding).collect()
}

/// Whether there is anything that could be computed in vain: an image that is not there cannot be read, and what is
/// called for is not in vain.
pub(super) fn can_be_forced(facts: &Facts, effect: Effect, called: bool) -> bool {
    match effect {
        Effect::TexturedEmission | Effect::AlbedoTextures | Effect::SmoothNormals | Effect::Instancing => {
            false
        }
        Effect::Sky => facts.scene.sky.is_lit(),
        Effect::BackFaces => facts.found.backs.iter().any(|back| back.dropped),
        Effect::UnseenSurfaces => facts.lit != facts.sides,
        Effect::LightBetweenRooms => facts.rooms.len() > 1,
        Effect::FarLamps => facts.idle.iter().flatten().any(|idle| *idle != Idle::Black),
        Effect::Shadows | Effect::Penumbras => lights(facts) > 0,
        _ => !called,
    }
}

/// Why no surface has holes.
fn no_holes(facts: &Facts) -> &'static str {
    let scene = facts.scene;
    let masked = |surface: &&Surface| {
        surface.role != Role::Emits && matches!(scene.material(surface).alpha, Alpha::Mask { .. })
    };
    let mut masked = scene.surfaces.iter().filter(masked).peekable();
    if masked.peek().is_none() {
        return "no material uses alphaMode MASK";
    }
    match masked.any(|surface| scene.opacity_of(surface) == Opacity::Clear) {
        true => "what uses alphaMode MASK is a hole as a whole, or has none",
        false => "no image of a material with alphaMode MASK has a hole",
    }
}

/// Why no surface lets a share of the light pass.
fn no_veils(facts: &Facts) -> &'static str {
    let blends = |surface: &Surface| {
        surface.role != Role::Emits && facts.scene.material(surface).alpha == Alpha::Blend
    };
    match facts.scene.surfaces.iter().any(blends) {
        true => "all that uses alphaMode BLEND is opaque",
        false => "no material uses alphaMode BLEND",
    }
}
