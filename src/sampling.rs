//! Fixed low-discrepancy sets: the same numbers for every bake, so results repeat to the bit and stay smooth.

use glam::Vec3;
use std::f32::consts::PI;

/// `count` points of the four-dimensional Owen-scrambled Sobol sequence (Burley, "Practical Hash-based Owen
/// Scrambling", JCGT 2020), starting at dimension `4 × set`. Every component is in `[0, 1)`.
pub fn sobol4(count: u32, set: u32, seed: u32) -> Vec<[f32; 4]> {
    (0..count).map(|i| sobol_burley::sample_4d(i, set, seed)).collect()
}

/// The seed of one use of samples, `purpose`, under the seed of the whole bake: `purpose` itself under 0, another
/// number for every other seed, so that sets under different seeds have nothing in common.
pub fn seeded(seed: u32, purpose: u32) -> u32 {
    if seed == 0 { purpose } else { purpose ^ mixed(seed) }
}

/// A mixing of 32 bits in which every bit depends on every other (Ettinger's lowbias32); 0 stays 0.
pub fn mixed(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A point set turned on the torus (Cranley & Patterson 1976).
pub fn shifted(points: &[[f32; 4]], shift: [f32; 4]) -> Vec<[f32; 4]> {
    points
        .iter()
        .map(|p| {
            std::array::from_fn(|k| {
                let x = p[k] + shift[k];
                if x >= 1.0 { x - 1.0 } else { x }
            })
        })
        .collect()
}

/// Maps the unit square to the unit disc, keeping area and neighbourhood (Shirley & Chiu 1997).
pub fn disc(u: f32, v: f32) -> [f32; 2] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0, 0.0];
    }
    let (r, phi) =
        if a.abs() > b.abs() { (a, PI / 4.0 * (b / a)) } else { (b, PI / 2.0 - PI / 4.0 * (a / b)) };
    [r * phi.cos(), r * phi.sin()]
}

/// A direction about +z with density cosθ/π (Malley's method).
pub fn cosine_hemisphere(u: f32, v: f32) -> Vec3 {
    let [x, y] = disc(u, v);
    Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// `[tangent, bitangent, normal]` for a unit normal, with the tangent as near to `along` as it can be.
pub fn frame(normal: Vec3, along: Vec3) -> [Vec3; 3] {
    let tangent = (along - normal * normal.dot(along))
        .try_normalize()
        .unwrap_or_else(|| normal.any_orthonormal_vector());
    [tangent, normal.cross(tangent), normal]
}

/// A local vector in world axes.
#[inline]
pub fn to_world(frame: &[Vec3; 3], local: Vec3) -> Vec3 {
    frame[0] * local.x + frame[1] * local.y + frame[2] * local.z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosine_directions_average_to_two_thirds() {
        let points = sobol4(1024, 0, 7);
        let mean: f32 = points.iter().map(|p| cosine_hemisphere(p[0], p[1]).z).sum::<f32>() / 1024.0;
        // E[cosθ] under density cosθ/π is 2/3; a (0,2)-net of 1024 points errs by less than its width 1/32.
        assert!((mean - 2.0 / 3.0).abs() < 1.0 / 32.0 / 10.0, "{mean}");
    }

    #[test]
    fn seeds_do_not_share_samples_and_0_is_the_purpose_alone() {
        assert_eq!([1, 2, 3].map(|purpose| seeded(0, purpose)), [1, 2, 3]);
        let keys: std::collections::BTreeSet<u32> =
            (0..100).flat_map(|seed| (0..10).map(move |purpose| seeded(seed, purpose))).collect();
        assert_eq!(keys.len(), 1000);
        assert_ne!(sobol4(16, 0, seeded(1, 3)), sobol4(16, 0, seeded(2, 3)));
    }

    #[test]
    fn frames_are_orthonormal_even_when_the_hint_is_useless() {
        for along in [Vec3::X, Vec3::Y, Vec3::ZERO, Vec3::NAN] {
            let [t, b, n] = frame(Vec3::Y, along);
            assert!(t.dot(b).abs() < 1e-6 && t.dot(n).abs() < 1e-6 && (t.length() - 1.0).abs() < 1e-6);
            assert!((t.cross(b) - n).length() < 1e-6);
        }
    }
}
