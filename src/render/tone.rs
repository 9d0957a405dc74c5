//! From radiance to the screen.

use crate::options::{Exposure, Tone};
use glam::Vec3;

/// What the geometric mean of the picture's light becomes: the reflectance of a photographer's grey card.
const MIDDLE_GREY: f32 = 0.18;
/// Luminance of linear Rec.709 (ITU-R BT.709, item 3.2).
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// A chosen exposure and curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Developer {
    scale: f32,
    tone: Tone,
}

impl Developer {
    /// Decides the exposure; `seen` is the light of a part of the picture, surfaces only.
    pub fn new(exposure: Exposure, tone: Tone, seen: impl Iterator<Item = Vec3>) -> Self {
        let scale = match exposure {
            Exposure::Ev(ev) => ev.exp2(),
            Exposure::Auto => MIDDLE_GREY / middle(seen),
        };
        // An endless or vanishing scale would make everything black or a NaN.
        Self { scale: if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }, tone }
    }

    /// The exposure as a power of two.
    pub fn ev(&self) -> f32 {
        self.scale.log2()
    }

    /// What the screen is to show: linear Rec.709 in `[0, 1]`.
    pub fn develop(&self, radiance: Vec3) -> Vec3 {
        let exposed = (radiance * self.scale).max(Vec3::ZERO);
        match self.tone {
            Tone::Clip => exposed.min(Vec3::ONE),
            Tone::Filmic => exposed.map(film),
        }
    }
}

/// The geometric mean of the luminances; black does not count, as its logarithm has no end.
fn middle(seen: impl Iterator<Item = Vec3>) -> f32 {
    let (mut sum, mut count) = (0.0_f64, 0_u64);
    for light in seen {
        let luminance = light.dot(LUMINANCE);
        if luminance > 0.0 && luminance.is_finite() {
            sum += f64::from(luminance.ln());
            count += 1;
        }
    }
    if count == 0 { MIDDLE_GREY } else { (sum / count as f64).exp() as f32 }
}

/// A film's curve: the rational fit to the ACES reference transform of K. Narkowicz ("ACES Filmic Tone Mapping Curve",
/// 2016), with its input scaled by 0.6 as he says for the original's exposure.
fn film(exposed: f32) -> f32 {
    // Beyond this the squares would leave f32; the curve is long at its end.
    let x = (0.6 * exposed).min(1e6);
    ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

/// IEC 61966-2-1, from linear in `[0, 1]`.
pub(crate) fn srgb(linear: Vec3) -> Vec3 {
    linear.map(|x| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 })
}

/// Eight bits of what the screen shows.
pub(crate) fn bytes(srgb: Vec3) -> [u8; 3] {
    srgb.to_array().map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_light_becomes_the_middle_of_the_curve() {
        let seen = [0.5, 2.0, 8.0, 0.0].map(Vec3::splat);
        let auto = Developer::new(Exposure::Auto, Tone::Clip, seen.into_iter());
        // The geometric mean of 0.5, 2 and 8 is 2.
        assert!((auto.develop(Vec3::splat(2.0)).x - 0.18).abs() < 1e-6);
        assert!((auto.ev() - (0.09_f32).log2()).abs() < 1e-5);
        let fixed = Developer::new(Exposure::Ev(1.0), Tone::Clip, seen.into_iter());
        assert_eq!(fixed.develop(Vec3::new(0.25, 3.0, -1.0)), Vec3::new(0.5, 1.0, 0.0));
        assert_eq!(Developer::new(Exposure::Auto, Tone::Clip, [Vec3::ZERO].into_iter()).ev(), 0.0);
    }

    #[test]
    fn film_rises_rolls_off_and_never_leaves_the_screen() {
        let mut last = -1.0;
        for step in -40..60 {
            let shown = film((step as f32 / 2.0).exp2());
            assert!(shown >= last && (0.0..=1.0).contains(&shown), "{step}");
            last = shown;
        }
        assert_eq!([film(0.0), film(f32::INFINITY)], [0.0, 1.0]);
        // A grey card stays a middle grey.
        assert!((0.12..0.2).contains(&film(0.18)));
    }

    #[test]
    fn the_screen_s_curve_is_the_standard_s() {
        assert_eq!(bytes(srgb(Vec3::new(0.0, 0.214_041_14, 1.0))), [0, 128, 255]);
        assert_eq!(bytes(srgb(Vec3::splat(0.002))), [7, 7, 7]);
    }
}
