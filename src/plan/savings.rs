//! What leaving effects out saves, in words; the numbers come from a forecast, which knows texels and rays.

use super::Facts;
use super::effects::can_be_forced;
use crate::options::Effect;
use crate::text;
use serde::Serialize;

/// What leaving an effect out saves.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Saving {
    /// In words; empty when nothing is left out.
    pub what: String,
    /// Foretold numbers, each about; none in a plan alone, and none where no honest number is known.
    pub amounts: Vec<Amount>,
}

/// So much of something that is not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Amount {
    /// Rays that are not sent.
    Rays(u64),
    /// Texels of hidden pages that are not lit.
    Texels(u64),
    /// Times that a light is not asked what it sends to a texel.
    Questions(u64),
    /// Hits that do not ask how much light the surface stops there.
    Lookups(u64),
    /// Patches whose form factors are not found.
    Patches(u64),
    /// Memory that is not taken, bytes.
    Bytes(u64),
}

impl Amount {
    /// As people read it: three digits are more than such a number is worth.
    pub fn text(self) -> String {
        let about = |number: u64, one: &str, more: &str| {
            format!("{} {}", text::about(number), if number == 1 { one } else { more })
        };
        match self {
            Self::Rays(number) => about(number, "ray", "rays"),
            Self::Texels(number) => about(number, "texel", "texels"),
            Self::Questions(number) => about(number, "question", "questions"),
            Self::Lookups(number) => about(number, "lookup", "lookups"),
            Self::Patches(number) => about(number, "patch", "patches"),
            Self::Bytes(number) => text::bytes(number),
        }
    }
}

impl Saving {
    /// Words and numbers together.
    pub fn text(&self) -> String {
        let amounts: Vec<String> = self.amounts.iter().map(|amount| amount.text()).collect();
        match (&self.what, amounts.is_empty()) {
            (what, true) => what.clone(),
            (what, false) => format!("{what}: about {}", amounts.join(", ")),
        }
    }

    /// The rays among the amounts.
    pub fn rays(&self) -> Option<u64> {
        self.amounts.iter().find_map(|amount| match amount {
            Amount::Rays(rays) => Some(*rays),
            _ => None,
        })
    }
}

/// What shadows that are computed save where nothing stands in the way.
pub(super) const PARTLY_SAVED: &str = "shadow rays from where nothing stands in the way of a light";

/// What leaving an effect out saves, in words.
pub(super) fn saved(facts: &Facts, effect: Effect) -> &'static str {
    if !can_be_forced(facts, effect, false) {
        return match effect {
            Effect::TexturedEmission | Effect::AlbedoTextures => "nothing: there is no image to read",
            Effect::SmoothNormals => "nothing: there is nothing to interpolate",
            _ => "nothing: there is nothing to leave out",
        };
    }
    match effect {
        Effect::AreaLights | Effect::PointLamps | Effect::SpotLamps | Effect::Suns => {
            "asking one more light at every texel"
        }
        Effect::SoftSuns | Effect::SoftLamps => "half of the rays that look for shadow borders",
        Effect::FarLamps => "shadow rays from every texel to these lights",
        Effect::Sky => "shadow rays from every texel to the bright parts of the sky",
        Effect::Shadows => "all shadow rays",
        Effect::Penumbras => "the same: what has no shadows has no borders of shadows",
        Effect::AlphaTest => "asking every hit for a hole",
        Effect::TintedShadows => "asking every hit how much light it lets through",
        Effect::BackFaces | Effect::UnseenSurfaces => "lighting these sides",
        Effect::LightBetweenRooms => "shadow rays from every texel to the lights of other rooms",
        Effect::Bounces => "form factors and gather rays",
        Effect::FinalGather => "all gather rays, and the form factors of all patches",
        Effect::ColourChannels => "two of three channels of what gather rays read",
        Effect::TexturedEmission | Effect::AlbedoTextures | Effect::SmoothNormals | Effect::Instancing => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn savings_are_read_in_words_and_three_digits() {
        let saving = |amounts: &[Amount]| Saving { what: "all of it".into(), amounts: amounts.to_vec() };
        assert_eq!(saving(&[]).text(), "all of it");
        assert_eq!(saving(&[Amount::Rays(1)]).text(), "all of it: about 1 ray");
        let two = saving(&[Amount::Patches(1_500), Amount::Rays(173_456)]);
        assert_eq!(two.text(), "all of it: about 1,500 patches, 173,000 rays");
        assert_eq!(two.rays(), Some(173_456));
        assert_eq!(saving(&[Amount::Texels(2_876_543)]).text(), "all of it: about 2.88 million texels");
        let json = serde_json::to_string(&saving(&[Amount::Bytes(12)])).expect("it can be written");
        assert_eq!(json, r#"{"what":"all of it","amounts":[{"bytes":12}]}"#);
    }
}
