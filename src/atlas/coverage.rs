//! Which texels a chart touches. A texel is touched when a bilinear lookup somewhere on the chart reads it: when its
//! centre is nearer than one texel, along both axes, to the chart.

use super::shape::Shape;
use glam::{DVec2, Vec2};
use std::borrow::Cow;

/// A lookup that gives a texel less weight than this does not count as reading it; graphics hardware rounds such
/// weights to nothing. Keeps rounding from adding a rim to charts whose borders lie exactly on texel centres.
const WEIGHT: f64 = 1.0 / 1024.0;

/// A chart in whole texels.
#[derive(Clone, Debug)]
pub(super) struct Cover {
    /// Width and height of what it touches, texels. The chart itself spans one less: its box reaches from the centre
    /// of the first texel to the centre of the last.
    pub size: [u16; 2],
    /// Which of them it touches; `None` when all.
    pub mask: Option<Mask>,
}

/// Touched texels of a box.
#[derive(Clone, Debug)]
pub(super) struct Mask {
    /// Words a row.
    pub stride: usize,
    /// Bit x of row y; all rows.
    pub bits: Vec<u64>,
    /// First and last touched texel of each column, then of each row.
    pub columns: Vec<[i16; 2]>,
    pub rows: Vec<[i16; 2]>,
    /// Number of touched texels.
    pub count: u32,
}

/// Texels that a chart's box spans from first to last centre, at `density` texels per metre: whole, at least one, at
/// most `most`.
pub(super) fn span(shape: &Shape, density: f64, most: u16) -> [u16; 2] {
    [shape.size_m.x, shape.size_m.y].map(|metres| {
        let texels = (metres * density).round();
        if texels.is_finite() { texels.clamp(1.0, f64::from(most)) as u16 } else { 1 }
    })
}

impl Cover {
    /// A chart that takes its whole box.
    pub fn full(span: [u16; 2]) -> Self {
        Self { size: span.map(|texels| texels + 1), mask: None }
    }

    /// What a chart touches whose box spans `span` texels. `triangles` gives its corners in the unit box.
    pub fn of(shape: &Shape, span: [u16; 2], triangles: impl Iterator<Item = [Vec2; 3]>) -> Self {
        let size = span.map(|texels| texels + 1);
        if shape.filled || size == [2, 2] {
            return Self::full(span);
        }
        let stride = usize::from(size[0]).div_ceil(64);
        let mut bits = vec![0u64; stride * usize::from(size[1])];
        let scale = DVec2::new(f64::from(span[0]), f64::from(span[1]));
        for corners in triangles {
            // In texels whose centres are whole numbers.
            touch(corners.map(|uv| uv.as_dvec2() * scale), size, stride, &mut bits);
        }
        Self { size, mask: Mask::of(size, stride, bits) }
    }

    /// Number of touched texels.
    pub fn texels(&self) -> u32 {
        let [w, h] = self.size.map(u32::from);
        self.mask.as_ref().map_or(w * h, |mask| mask.count)
    }
}

impl Mask {
    /// Bits after `turns` quarter turns, each of which takes (x, y) to (height − 1 − y, x), with their words a row.
    pub fn turned(&self, [w, h]: [usize; 2], turns: u8) -> (usize, Cow<'_, [u64]>) {
        if turns == 0 {
            return (self.stride, Cow::Borrowed(&self.bits));
        }
        let (new_w, new_h) = if turns == 2 { (w, h) } else { (h, w) };
        let stride = new_w.div_ceil(64);
        let mut bits = vec![0u64; stride * new_h];
        let mut nothing = vec![0u64; self.stride];
        for y in 0..h {
            nothing.fill(0);
            each_new(&mut nothing, &self.bits[y * self.stride..(y + 1) * self.stride], |x| {
                let (x, y) = match turns {
                    1 => (h - 1 - y, x),
                    2 => (w - 1 - x, h - 1 - y),
                    _ => (y, w - 1 - x),
                };
                bits[y * stride + x / 64] |= 1 << (x % 64);
            });
        }
        (stride, Cow::Owned(bits))
    }

    fn of(size: [u16; 2], stride: usize, bits: Vec<u64>) -> Option<Self> {
        let [w, h] = size.map(usize::from);
        let count: u32 = bits.iter().map(|word| word.count_ones()).sum();
        if count as usize == w * h {
            return None;
        }
        let line = |y: usize| &bits[y * stride..(y + 1) * stride];
        let rows: Vec<[i16; 2]> = (0..h).map(|y| ends(line(y))).collect();
        let mut columns = vec![[i16::MAX, -1]; w];
        // A column begins where its bit is first seen from above and ends where it is first seen from below.
        let mut seen = vec![0u64; stride];
        for y in 0..h {
            each_new(&mut seen, line(y), |x| columns[x][0] = y as i16);
        }
        seen.fill(0);
        for y in (0..h).rev() {
            each_new(&mut seen, line(y), |x| columns[x][1] = y as i16);
        }
        // A chart is connected and reaches all sides of its box, so no column or row is empty, unless rounding took
        // one away: then the whole box counts.
        let whole = columns.iter().chain(&rows).all(|range| range[1] >= 0);
        whole.then_some(Self { stride, bits, columns, rows, count })
    }
}

/// First and last set bit.
fn ends(words: &[u64]) -> [i16; 2] {
    let first = words.iter().position(|&word| word != 0).map(|n| n * 64 + words[n].trailing_zeros() as usize);
    let last =
        words.iter().rposition(|&word| word != 0).map(|n| n * 64 + 63 - words[n].leading_zeros() as usize);
    first.zip(last).map_or([i16::MAX, -1], |(first, last)| [first as i16, last as i16])
}

/// Calls with every bit of `words` that is not in `seen`, and adds it there.
fn each_new(seen: &mut [u64], words: &[u64], mut tell: impl FnMut(usize)) {
    for (n, (seen, &word)) in seen.iter_mut().zip(words).enumerate() {
        let mut fresh = word & !*seen;
        *seen |= word;
        while fresh != 0 {
            tell(n * 64 + fresh.trailing_zeros() as usize);
            fresh &= fresh - 1;
        }
    }
}

/// Marks the texels that lie nearer than one texel to a triangle, along both axes.
fn touch(corners: [DVec2; 3], size: [u16; 2], stride: usize, bits: &mut [u64]) {
    let reach = 1.0 - WEIGHT;
    let low = corners[0].min(corners[1]).min(corners[2]);
    let high = corners[0].max(corners[1]).max(corners[2]);
    let first = (low.y - reach).ceil().max(0.0) as usize;
    let last = (high.y + reach).floor().min(f64::from(size[1]) - 1.0) as usize;
    let right = f64::from(size[0]) - 1.0;
    for y in first..=last {
        // What of the triangle lies within reach of this row, from left to right.
        let (bottom, top) = (y as f64 - reach, y as f64 + reach);
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if a.y >= bottom && a.y <= top {
                least = least.min(a.x);
                most = most.max(a.x);
            }
            for border in [bottom, top] {
                if (a.y < border) != (b.y < border) {
                    let x = a.x + (b.x - a.x) * ((border - a.y) / (b.y - a.y));
                    least = least.min(x);
                    most = most.max(x);
                }
            }
        }
        if least > most {
            continue;
        }
        let from = (least - reach).ceil().max(0.0) as usize;
        let to = (most + reach).floor().min(right) as usize;
        if from <= to {
            fill(&mut bits[y * stride..(y + 1) * stride], from, to);
        }
    }
}

/// Sets bits `from..=to`.
pub(super) fn fill(words: &mut [u64], from: usize, to: usize) {
    let (first, last) = (from / 64, to / 64);
    let head = u64::MAX << (from % 64);
    let tail = u64::MAX >> (63 - to % 64);
    if first == last {
        words[first] |= head & tail;
        return;
    }
    words[first] |= head;
    words[first + 1..last].fill(u64::MAX);
    words[last] |= tail;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diagonal_triangle_leaves_the_far_corner_free() {
        let shape = Shape { size_m: DVec2::splat(10.0), filled: false };
        let triangle = [Vec2::ZERO, Vec2::X, Vec2::Y];
        let cover = Cover::of(&shape, [10, 10], [triangle].into_iter());
        assert_eq!(cover.size, [11, 11]);
        let mask = cover.mask.unwrap();
        for y in 0..11usize {
            // The hypotenuse is x + y = 10: nearer than one texel along both axes means x + y < 12.
            let expected = (11 - y as i16).min(10);
            assert_eq!(mask.rows[y], [0, expected], "row {y}");
        }
    }

    #[test]
    fn a_range_of_bits_is_set_across_words() {
        let mut words = [0u64; 4];
        fill(&mut words, 60, 190);
        let set: u32 = words.iter().map(|w| w.count_ones()).sum();
        assert_eq!(set, 131);
        assert_eq!(words[0] >> 59 & 1, 0);
        assert_eq!(words[2] >> 62 & 1, 1);
        assert_eq!(words[2] >> 63 & 1, 0);
    }
}
