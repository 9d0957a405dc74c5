//! Radiometric quantities as types, one RGB triple each (linear Rec.709).
//!
//! Only lawful operators exist: a missing π or a reflectance applied twice does not compile.
//! Names and relations follow Cohen & Wallace, *Radiosity and Realistic Image Synthesis*, chapter 2.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::f32::consts::PI;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Mul, Sub};

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[repr(transparent)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        pub struct $name(
            /// Linear Rec.709 red, green and blue.
            pub Vec3,
        );

        impl $name {
            /// No light at all.
            pub const ZERO: Self = Self(Vec3::ZERO);

            /// The same value in all three channels.
            pub const fn grey(value: f32) -> Self {
                Self(Vec3::splat(value))
            }

            /// Mean of the three channels.
            pub fn mean(self) -> f32 {
                (self.0.x + self.0.y + self.0.z) / 3.0
            }

            /// Whether every channel is finite.
            pub fn is_finite(self) -> bool {
                self.0.is_finite()
            }
        }
    };
}

macro_rules! additive {
    ($name:ident) => {
        impl Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl Sub for $name {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl AddAssign for $name {
            fn add_assign(&mut self, other: Self) {
                self.0 += other.0;
            }
        }

        impl Mul<f32> for $name {
            type Output = Self;
            fn mul(self, factor: f32) -> Self {
                Self(self.0 * factor)
            }
        }

        impl Sum for $name {
            fn sum<I: Iterator<Item = Self>>(items: I) -> Self {
                items.fold(Self::ZERO, Add::add)
            }
        }
    };
}

quantity!(
    /// ρ: the fraction of arriving light that leaves again, in `[0, 0.999]` per channel.
    Reflectance
);
quantity!(
    /// E: power arriving per area, W/m².
    Irradiance
);
quantity!(
    /// b: power leaving per area into the whole hemisphere, W/m².
    Radiosity
);
quantity!(
    /// L: power per area and solid angle, W/(m² sr).
    Radiance
);
quantity!(
    /// Φ: power, W.
    Power
);
quantity!(
    /// I: power per solid angle, W/sr.
    Intensity
);

additive!(Irradiance);
additive!(Radiosity);
additive!(Radiance);
additive!(Power);
additive!(Intensity);

/// Surface area, m².
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, Pod, Zeroable)]
pub struct Area(pub f32);

impl Reflectance {
    /// The largest reflectance a surface may have: at 1 a closed room has no steady state.
    pub const MAX: f32 = 0.999;

    /// Clamps every channel into `[0, MAX]`; NaN becomes 0.
    pub fn clamped(value: Vec3) -> Self {
        let channel = |x: f32| if x > 0.0 { x.min(Self::MAX) } else { 0.0 };
        Self(Vec3::new(channel(value.x), channel(value.y), channel(value.z)))
    }
}

impl Mul<Irradiance> for Reflectance {
    type Output = Radiosity;
    /// b = ρE, the reflected part of the radiosity of a diffuse surface.
    fn mul(self, irradiance: Irradiance) -> Radiosity {
        Radiosity(self.0 * irradiance.0)
    }
}

impl Mul<Area> for Radiosity {
    type Output = Power;
    fn mul(self, area: Area) -> Power {
        Power(self.0 * area.0)
    }
}

impl Mul<Area> for Irradiance {
    type Output = Power;
    fn mul(self, area: Area) -> Power {
        Power(self.0 * area.0)
    }
}

impl Radiance {
    /// Radiosity of a diffuse surface of this radiance: b = πL.
    pub fn to_radiosity(self) -> Radiosity {
        Radiosity(self.0 * PI)
    }

    /// Irradiance under a source of this radiance that covers the configuration factor `factor`: E = πLF.
    pub fn to_irradiance(self, factor: f32) -> Irradiance {
        Irradiance(self.0 * (PI * factor))
    }
}

impl Radiosity {
    /// Radiance of a diffuse surface of this radiosity: L = b/π.
    pub fn to_radiance(self) -> Radiance {
        Radiance(self.0 / PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_white_floor_under_a_uniform_sky_shows_the_sky() {
        let sky = Radiance::grey(2.0);
        let floor = Reflectance(Vec3::ONE) * sky.to_irradiance(1.0);
        assert!((floor.to_radiance().mean() - 2.0).abs() < 1e-6);
    }

    #[test]
    fn reflectance_is_clamped_and_never_nan() {
        let r = Reflectance::clamped(Vec3::new(f32::NAN, -1.0, 7.0));
        assert_eq!(r.0, Vec3::new(0.0, 0.0, Reflectance::MAX));
    }
}
