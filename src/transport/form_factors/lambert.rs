//! The two evaluations behind [`super::polygon`]: Lambert's sum over edges, four at a time, and a cubature rule for
//! polygons far away.

use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI, SQRT_2};

/// Beyond this distance, in sizes of the polygon, [`far_rule`] replaces [`lambert`]. The rule's error falls with the
/// fourth power of size / distance (the third where the polygon touches the horizon), while the closed form loses
/// digits to cancellation in proportion to distance / size, and takes longer.
const FAR_SIZES: f64 = 40.0;

/// Whether the polygon (corners relative to the receiver) is far away for its size.
#[inline]
pub(super) fn is_far(corners: &[DVec3]) -> bool {
    let size_squared =
        corners[1..].iter().map(|&corner| (corner - corners[0]).length_squared()).fold(0.0, f64::max);
    corners[0].length_squared() > FAR_SIZES * FAR_SIZES * size_squared
}

/// How many edges are worked on together.
const LANES: usize = 4;

type Lanes = [f64; LANES];

/// Lambert's sum over the edges of a polygon above the horizon, corners relative to the receiver.
#[inline]
pub(super) fn lambert(corners: &[DVec3], normal: DVec3) -> f64 {
    let mut sum = 0.0;
    let mut first = 0;
    while first < corners.len() {
        // Lanes that are left over repeat a corner: an edge without length subtends no angle.
        let corner = |lane: usize| {
            let index = first + lane;
            if index < corners.len() { corners[index] } else { corners[0] }
        };
        let at: [DVec3; LANES + 1] = std::array::from_fn(corner);
        sum += edge_terms(&at, normal);
        first += LANES;
    }
    -0.5 * FRAC_1_PI * sum
}

/// The same for four edges between five corners, the last of which is the first.
#[inline]
pub(super) fn lambert_of_four(at: &[DVec3; LANES + 1], normal: DVec3) -> f64 {
    -0.5 * FRAC_1_PI * edge_terms(at, normal)
}

/// Σ θ n·ĉ over the four edges between five corners.
#[inline]
fn edge_terms(at: &[DVec3; LANES + 1], normal: DVec3) -> f64 {
    let (mut sine, mut cosine, mut toward) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        let (a, b) = (at[lane], at[lane + 1]);
        let c = a.cross(b);
        sine[lane] = c.length_squared();
        cosine[lane] = a.dot(b);
        toward[lane] = c.dot(normal);
    }
    let sine = sine.map(f64::sqrt);
    let angle = angles(&sine, &cosine);
    let mut terms = [0.0; LANES];
    for lane in 0..LANES {
        // An edge whose line meets the receiver bounds no solid angle of its own.
        let scale = if sine[lane] > 0.0 { sine[lane] } else { 1.0 };
        let toward = if sine[lane] > 0.0 { toward[lane] } else { 0.0 };
        terms[lane] = angle[lane] * (toward / scale);
    }
    (terms[0] + terms[1]) + (terms[2] + terms[3])
}

/// The angles whose sines and cosines are proportional to `sine` ≥ 0 and `cosine`: `atan2` with a relative error
/// below 2e-15, without branches, so that the processor works on several at once. Arbitrary where both are 0.
#[inline]
fn angles(sine: &Lanes, cosine: &Lanes) -> Lanes {
    /// Minimax polynomial of atan(t)/t in t² on `[0, tan²(π/8)]`, relative error 1e-15.
    const ATAN: [f64; 10] = [
        0.999_999_999_999_999,
        -0.333_333_333_332_214_3,
        0.199_999_999_783_926_63,
        -0.142_857_126_616_848_43,
        0.111_110_488_537_512_96,
        -0.090_895_299_565_623_07,
        0.076_735_354_281_832_85,
        -0.065_059_829_671_708_4,
        0.050_247_621_189_401_28,
        -0.025_316_479_573_776_477,
    ];
    let mut angle = [0.0; LANES];
    for lane in 0..LANES {
        let (s, c) = (sine[lane], cosine[lane]);
        let size = c.abs();
        let steep = s > size;
        let (small, large) = if steep { (size, s) } else { (s, size) };
        // atan(x) = π/4 + atan((x − 1)/(x + 1)) halves the range.
        let upper = small > large * (SQRT_2 - 1.0);
        let top = if upper { small - large } else { small };
        let bottom = if upper { small + large } else { large };
        let t = top / if bottom > 0.0 { bottom } else { 1.0 };
        let z = t * t;
        // Estrin's order: a third of the latency of Horner's.
        let (z2, pair) = (z * z, |i: usize| ATAN[i] + ATAN[i + 1] * z);
        let (z4, four) = (z2 * z2, |i: usize| pair(i) + pair(i + 2) * z2);
        let polynomial = four(0) + z4 * (four(4) + z4 * pair(8));
        let eighth = if upper { FRAC_PI_4 } else { 0.0 } + t * polynomial;
        let quarter = if steep { FRAC_PI_2 - eighth } else { eighth };
        angle[lane] = if c < 0.0 { PI - quarter } else { quarter };
    }
    angle
}

/// Four points per triangle, which integrate cubics exactly: Gauss-Jacobi towards one corner times Gauss-Legendre
/// across. Corners relative to the receiver, all above the horizon.
#[inline]
pub(super) fn far_rule(corners: &[DVec3], normal: DVec3) -> f64 {
    /// (4 ∓ √6)/10 and (9 ± √6)/36: the two-point rule on `[0, 1]` for the weight 1 − x.
    const TOWARDS: [(f64, f64); 2] = [
        (0.155_051_025_721_682_2, 0.318_041_381_743_977_2),
        (0.644_948_974_278_317_8, 0.181_958_618_256_022_8),
    ];
    /// (1 ∓ 1/√3)/2.
    const ACROSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];
    let start = corners[0];
    let mut sum = 0.0;
    for edge in corners[1..].windows(2) {
        let (towards, across) = (edge[0] - start, edge[1] - start);
        // Twice the area times the distance of the receiver from the plane.
        let area_height = -towards.cross(across).dot(start);
        let mut kernel = 0.0;
        for (x, weight) in TOWARDS {
            for y in ACROSS {
                let r = start + towards * x + across * ((1.0 - x) * y);
                let distance_squared = r.length_squared();
                kernel += weight * r.dot(normal) / (distance_squared * distance_squared);
            }
        }
        sum += area_height * kernel;
    }
    0.5 * FRAC_1_PI * sum
}

#[cfg(test)]
pub(super) mod test_numbers {
    use glam::{DVec3, dvec3};

    /// Numbers in `[0, 1)`, the same at every run.
    pub struct Numbers(pub u64);

    impl Numbers {
        pub fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        pub fn direction(&mut self) -> DVec3 {
            let z = 2.0 * self.next() - 1.0;
            let (sine, cosine) = (std::f64::consts::TAU * self.next()).sin_cos();
            dvec3(cosine, sine, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
        }
    }
}

#[cfg(test)]
mod tests {
    use super::test_numbers::Numbers;
    use super::*;

    #[test]
    fn the_angle_is_the_one_of_atan2() {
        let mut numbers = Numbers(1);
        for _ in 0..100_000 {
            let sine = 10f64.powf(numbers.next() * 20.0 - 10.0);
            let cosine = numbers.next() * 2.0 - 1.0;
            let angle = angles(&[sine; LANES], &[cosine; LANES])[3];
            assert!((angle / sine.atan2(cosine) - 1.0).abs() < 2e-15, "{sine} {cosine}");
        }
        assert_eq!(angles(&[0.0; LANES], &[1.0; LANES]), [0.0; LANES]);
        assert_eq!(angles(&[0.0; LANES], &[-1.0; LANES]), [PI; LANES]);
    }

    /// Over shapes down to slivers, directions and grazing angles.
    #[test]
    fn the_far_rule_meets_the_closed_form_at_the_switch() {
        let mut numbers = Numbers(2);
        let (mut worst, mut worst_of_facing, mut compared) = (0f64, 0f64, 0);
        for _ in 0..200_000 {
            let (u, v) = (numbers.direction(), numbers.direction());
            let stretch = 10f64.powf(-3.0 * numbers.next());
            let mut corners = vec![DVec3::ZERO, u, u + v * stretch, v * stretch];
            if numbers.next() < 0.5 {
                corners.remove(2);
            }
            let size = corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
            let away = numbers.direction() * size * (FAR_SIZES * 1.0001);
            let corners: Vec<_> = corners.into_iter().map(|corner| corner + away).collect();
            assert!(is_far(&corners));
            let normal = numbers.direction();
            if corners.iter().all(|corner| corner.dot(normal) > 0.0) && u.cross(v).dot(away) < 0.0 {
                let (exact, far) = (lambert(&corners, normal), far_rule(&corners, normal));
                let facing = lambert(&corners, away.normalize());
                worst = worst.max((far / exact - 1.0).abs());
                worst_of_facing = worst_of_facing.max((far - exact).abs() / facing);
                compared += 1;
            }
        }
        assert!(compared > 20_000, "{compared}");
        assert!(worst < 1e-5, "{worst:e}");
        assert!(worst_of_facing < 1e-6, "{worst_of_facing:e}");
    }
}
