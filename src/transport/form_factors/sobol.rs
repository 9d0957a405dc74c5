//! Sobol points in four dimensions with Owen scrambling by hashing (Burley 2020, *Practical hash-based Owen
//! scrambling*): any power of two of them is stratified in every dimension and in all pairs of the first two.

/// Joe and Kuo's direction numbers (new-joe-kuo-6) for dimensions 2 to 4: the polynomial's degree and coefficients,
/// and the first numbers m.
const POLYNOMIALS: [(usize, u32, [u32; 3]); 3] = [(1, 0, [1, 0, 0]), (2, 1, [1, 3, 0]), (3, 1, [1, 3, 1])];

/// Bits of an index that are used: more than 2¹⁶ points of one set are not asked for.
const BITS: usize = 16;

/// The binary digits of the points, one row a dimension.
const DIRECTIONS: [[u32; BITS]; 4] = directions();

const fn directions() -> [[u32; BITS]; 4] {
    let mut all = [[0; BITS]; 4];
    let mut bit = 0;
    while bit < BITS {
        all[0][bit] = 1 << (31 - bit);
        bit += 1;
    }
    let mut dimension = 0;
    while dimension < POLYNOMIALS.len() {
        let (degree, coefficients, first) = POLYNOMIALS[dimension];
        let v = &mut all[dimension + 1];
        let mut bit = 0;
        while bit < BITS {
            if bit < degree {
                v[bit] = first[bit] << (31 - bit);
            } else {
                v[bit] = v[bit - degree] ^ (v[bit - degree] >> degree);
                let mut k = 1;
                while k < degree {
                    v[bit] ^= ((coefficients >> (degree - 1 - k)) & 1) * v[bit - k];
                    k += 1;
                }
            }
            bit += 1;
        }
        dimension += 1;
    }
    all
}

/// The binary digits of point `index` before scrambling, mirrored: the first digit after the point is the lowest bit.
pub(super) fn mirrored(index: u32) -> [u32; 4] {
    std::array::from_fn(|dimension| {
        let digits = DIRECTIONS[dimension].iter().enumerate();
        digits.fold(0, |bits, (k, digit)| bits ^ (digit * (index >> k & 1))).reverse_bits()
    })
}

/// One scrambling of the points: the same for all points of a set.
pub(super) struct Scramble([u32; 4]);

impl Scramble {
    /// The scrambling that belongs to `seed`.
    pub fn new(seed: u32) -> Self {
        Self(std::array::from_fn(|dimension| hash(seed ^ hash(dimension as u32 + 1))))
    }

    /// The coordinate in `[0, 1)` of a point from [`mirrored`], along one of the four dimensions.
    #[inline]
    pub fn coordinate(&self, mirrored: &[u32; 4], dimension: usize) -> f32 {
        let scrambled = owen_scrambled(mirrored[dimension], self.0[dimension]);
        // 24 bits: all that f32 holds without rounding up to 1.
        (scrambled >> 8) as f32 * (1.0 / (1 << 24) as f32)
    }
}

/// Flips every digit by a hash of those before it (Laine & Karras 2011, constants by Vegdahl 2021). Digits come
/// mirrored.
#[inline]
fn owen_scrambled(mirrored: u32, seed: u32) -> u32 {
    let mut x = mirrored;
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// A mixing of 32 bits in which every bit depends on every other (Ettinger's lowbias32).
pub(super) fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(index: u32, seed: u32) -> [f32; 4] {
        let (digits, scramble) = (mirrored(index), Scramble::new(seed));
        std::array::from_fn(|dimension| scramble.coordinate(&digits, dimension))
    }

    /// Exactly one of 2^k points in each of 2^k equal strips, in every dimension, whatever the seed.
    #[test]
    fn every_dimension_is_stratified() {
        for seed in [0, 1, 77, u32::MAX] {
            for log in 0..11 {
                let count = 1u32 << log;
                for dimension in 0..4 {
                    let mut strips: Vec<_> =
                        (0..count).map(|i| (point(i, seed)[dimension] * count as f32) as u32).collect();
                    strips.sort_unstable();
                    assert!(strips.iter().copied().eq(0..count), "{count} points, dimension {dimension}");
                }
            }
        }
    }

    /// The first two dimensions are a (0, 2)-sequence: one point in every box of area 2^-k, of any shape.
    #[test]
    fn the_first_two_dimensions_fill_every_elementary_box() {
        for log_x in 0..=8u32 {
            let (columns, rows) = (1 << log_x, 1 << (8 - log_x));
            let mut boxes: Vec<_> = (0..256)
                .map(|i| point(i, 5))
                .map(|p| (p[0] * columns as f32) as u32 * rows + (p[1] * rows as f32) as u32)
                .collect();
            boxes.sort_unstable();
            assert!(boxes.iter().copied().eq(0..256), "{columns} × {rows}");
        }
    }

    #[test]
    fn different_seeds_give_different_points() {
        assert_ne!(point(3, 1), point(3, 2));
        assert!(point(65_535, 9).iter().all(|x| (0.0..1.0).contains(x)));
    }
}
