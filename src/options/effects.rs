//! What light does in a scene, one name an effect.

use serde::Serialize;

/// Something that light does, or a way to compute it, which a scene may or may not call for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Effect {
    /// Surfaces that emit.
    AreaLights,
    /// Surfaces that emit unevenly.
    TexturedEmission,
    /// Point lamps.
    PointLamps,
    /// Spot lamps.
    SpotLamps,
    /// Suns.
    Suns,
    /// Suns with an angular size.
    SoftSuns,
    /// Point and spot lamps with a radius.
    SoftLamps,
    /// Lamps whose light ends before it meets anything that counts.
    FarLamps,
    /// Light from all around.
    Sky,
    /// Things that stand between a light and a surface.
    Shadows,
    /// The soft borders of shadows, refined.
    Penumbras,
    /// Holes in surfaces.
    AlphaTest,
    /// Surfaces that let some of the light pass, coloured.
    TintedShadows,
    /// Light on the backs of double-sided surfaces.
    BackFaces,
    /// Light on surfaces that no lightmapped surface sees.
    UnseenSurfaces,
    /// Light from one sealed room in another.
    LightBetweenRooms,
    /// Light that surfaces reflect.
    Bounces,
    /// The final gather.
    FinalGather,
    /// Red, green and blue apart.
    ColourChannels,
    /// Reflectance out of images.
    AlbedoTextures,
    /// Normals that differ from those of the triangles.
    SmoothNormals,
    /// Meshes that stand in several places.
    Instancing,
}

impl Effect {
    /// All, in the order they are told.
    pub const ALL: [Self; 22] = [
        Self::AreaLights,
        Self::TexturedEmission,
        Self::PointLamps,
        Self::SpotLamps,
        Self::Suns,
        Self::SoftSuns,
        Self::SoftLamps,
        Self::FarLamps,
        Self::Sky,
        Self::Shadows,
        Self::Penumbras,
        Self::AlphaTest,
        Self::TintedShadows,
        Self::BackFaces,
        Self::UnseenSurfaces,
        Self::LightBetweenRooms,
        Self::Bounces,
        Self::FinalGather,
        Self::ColourChannels,
        Self::AlbedoTextures,
        Self::SmoothNormals,
        Self::Instancing,
    ];

    /// As people read it.
    pub fn name(self) -> &'static str {
        match self {
            Self::AreaLights => "area lights",
            Self::TexturedEmission => "textured emission",
            Self::PointLamps => "point lamps",
            Self::SpotLamps => "spot lamps",
            Self::Suns => "suns",
            Self::SoftSuns => "soft suns",
            Self::SoftLamps => "soft lamps",
            Self::FarLamps => "far lamps",
            Self::Sky => "sky",
            Self::Shadows => "shadows",
            Self::Penumbras => "penumbras",
            Self::AlphaTest => "alpha test",
            Self::TintedShadows => "tinted shadows",
            Self::BackFaces => "back faces",
            Self::UnseenSurfaces => "unseen surfaces",
            Self::LightBetweenRooms => "light between rooms",
            Self::Bounces => "bounces",
            Self::FinalGather => "final gather",
            Self::ColourChannels => "colour channels",
            Self::AlbedoTextures => "albedo textures",
            Self::SmoothNormals => "smooth normals",
            Self::Instancing => "instancing",
        }
    }
}

/// Effects that are simulated although the scene does not call for them, to show that this changes nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Forced(Vec<Effect>);

impl Forced {
    /// None: what the scene calls for is simulated.
    pub fn none() -> Self {
        Self::default()
    }

    /// All.
    pub fn all() -> Self {
        Self(Effect::ALL.to_vec())
    }

    /// This one alone.
    pub fn one(effect: Effect) -> Self {
        Self(vec![effect])
    }

    /// Whether the effect is forced.
    pub fn has(&self, effect: Effect) -> bool {
        self.0.contains(&effect)
    }
}
