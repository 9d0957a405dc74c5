//! Triangles cut into texels: exact areas and centroids, in f64.

use glam::DVec2;
use std::ops::Range;

/// The part of a triangle inside one texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    /// Column of the texel.
    pub x: i32,
    /// Row of the texel.
    pub y: i32,
    /// Share of the triangle's area, in `[0, 1]`.
    pub share: f64,
    /// Area in texels².
    pub coverage: f64,
    /// Centroid, texels from the page's top left corner.
    pub centroid: DVec2,
}

/// A convex polygon of at most nine corners: a triangle cut by six half planes at most.
#[derive(Clone, Copy)]
struct Polygon {
    count: usize,
    corners: [DVec2; 9],
}

/// A triangle narrower than this many texels has no area that f64 could share out (the product of coordinates up to
/// 1e5 texels rounds at 1e-6 of it); it is spread along its longest edge instead.
const THINNEST_TEXELS: f64 = 1e-7;

/// Calls `emit` for every texel of `rows` that the triangle covers, row by row, left to right. The shares of all rows
/// add up to 1.
pub(super) fn cut(uv: [DVec2; 3], rows: Range<i32>, mut emit: impl FnMut(Part)) {
    if !uv.iter().all(|p| p.is_finite()) {
        return;
    }
    let [a, b, c] = uv;
    let area = 0.5 * (b - a).perp_dot(c - a).abs();
    let min = a.min(b).min(c);
    let max = a.max(b).max(c);
    let (x0, y0) = (min.x.floor(), min.y.floor());
    let one_texel = max.x <= x0 + 1.0 && max.y <= y0 + 1.0;
    if one_texel || area <= THINNEST_TEXELS * longest_edge(uv).1.sqrt() {
        return spread(uv, area, one_texel, rows, emit);
    }
    let mut whole = Polygon { count: 3, corners: [DVec2::ZERO; 9] };
    whole.corners[..3].copy_from_slice(&uv);
    let first = (y0 as i32).max(rows.start);
    let last = (max.y.ceil() as i32).min(rows.end);
    for y in first..last {
        let (top, bottom) = (f64::from(y), f64::from(y) + 1.0);
        let row = whole.keep(1, top, 1.0).keep(1, bottom, -1.0);
        if row.count < 3 {
            continue;
        }
        let (left, right) = row.extent();
        let full = row.full_columns(top, bottom);
        for x in left.floor() as i32..(right.ceil() as i32).max(left.floor() as i32 + 1) {
            if full.contains(&x) {
                let centroid = DVec2::new(f64::from(x) + 0.5, top + 0.5);
                emit(Part { x, y, share: 1.0 / area, coverage: 1.0, centroid });
                continue;
            }
            let piece = row.keep(0, f64::from(x), 1.0).keep(0, f64::from(x) + 1.0, -1.0);
            let (coverage, centroid) = piece.area_and_centroid();
            if coverage > 0.0 {
                emit(Part { x, y, share: coverage / area, coverage, centroid });
            }
        }
    }
}

/// A triangle inside one texel, or too thin for areas: points along its longest edge, at most a texel apart.
fn spread(uv: [DVec2; 3], area: f64, one_texel: bool, rows: Range<i32>, mut emit: impl FnMut(Part)) {
    let ([from, to], squared) = longest_edge(uv);
    let steps = if one_texel { 1 } else { squared.sqrt().ceil().clamp(1.0, 1e5) as usize };
    let centre = (uv[0] + uv[1] + uv[2]) / 3.0;
    for i in 0..steps {
        let along = (i as f64 + 0.5) / steps as f64 - 0.5;
        let centroid = if steps == 1 { centre } else { (from + to) * 0.5 + (to - from) * along };
        let (x, y) = (centroid.x.floor() as i32, centroid.y.floor() as i32);
        if rows.contains(&y) {
            let share = 1.0 / steps as f64;
            emit(Part { x, y, share, coverage: area * share, centroid });
        }
    }
}

fn longest_edge([a, b, c]: [DVec2; 3]) -> ([DVec2; 2], f64) {
    let edges = [[a, b], [b, c], [c, a]].map(|[p, q]| ([p, q], p.distance_squared(q)));
    edges.into_iter().fold(edges[0], |best, edge| if edge.1 > best.1 { edge } else { best })
}

impl Polygon {
    /// The part where `side * (p[axis] - bound) >= 0`. Cut corners lie on the bound exactly.
    fn keep(&self, axis: usize, bound: f64, side: f64) -> Self {
        let mut kept = Self { count: 0, corners: [DVec2::ZERO; 9] };
        for i in 0..self.count {
            let (p, q) = (self.corners[i], self.corners[(i + 1) % self.count]);
            let (dp, dq) = (side * (p[axis] - bound), side * (q[axis] - bound));
            if dp >= 0.0 {
                kept.push(p);
            }
            if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
                // From the inner to the outer corner, so that both polygons of a shared edge cut it alike.
                let (p, q, dp, dq) = if dp > 0.0 { (p, q, dp, dq) } else { (q, p, dq, dp) };
                let mut cut = p + (q - p) * (dp / (dp - dq));
                cut[axis] = bound;
                kept.push(cut);
            }
        }
        kept
    }

    fn push(&mut self, p: DVec2) {
        // A convex polygon gains at most one corner a cut; rounding cannot make it gain more than the array holds.
        if self.count < self.corners.len() {
            self.corners[self.count] = p;
            self.count += 1;
        }
    }

    fn extent(&self) -> (f64, f64) {
        let xs = self.corners[..self.count].iter().map(|p| p.x);
        xs.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(x), hi.max(x)))
    }

    /// Columns whose texel lies inside altogether: a convex shape holds the square if it holds its top and bottom.
    fn full_columns(&self, top: f64, bottom: f64) -> Range<i32> {
        let span = |y: f64| {
            let on = self.corners[..self.count].iter().filter(|p| p.y == y).map(|p| p.x);
            on.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(x), hi.max(x)))
        };
        let ((a, b), (c, d)) = (span(top), span(bottom));
        let (left, right) = (a.max(c), b.min(d));
        if left < right { left.ceil() as i32..right.floor() as i32 } else { 0..0 }
    }

    fn area_and_centroid(&self) -> (f64, DVec2) {
        let origin = self.corners[0];
        let (mut doubled, mut moment) = (0.0, DVec2::ZERO);
        for i in 1..self.count.max(1) - 1 {
            let (p, q) = (self.corners[i] - origin, self.corners[i + 1] - origin);
            let cross = p.perp_dot(q);
            doubled += cross;
            moment += (p + q) * cross;
        }
        if doubled == 0.0 || self.count < 3 {
            return (0.0, origin);
        }
        (0.5 * doubled.abs(), origin + moment / (3.0 * doubled))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parts(uv: [DVec2; 3]) -> Vec<Part> {
        let mut parts = Vec::new();
        cut(uv, -10_000..100_000, |part| parts.push(part));
        parts
    }

    #[test]
    fn a_square_of_two_triangles_fills_its_texels() {
        let corner = |x, y| DVec2::new(x, y);
        let (a, b, c, d) = (corner(2.0, 3.0), corner(7.0, 3.0), corner(7.0, 9.0), corner(2.0, 9.0));
        let mut area = std::collections::BTreeMap::new();
        for part in parts([a, b, c]).into_iter().chain(parts([a, c, d])) {
            *area.entry((part.x, part.y)).or_insert(0.0) += part.coverage;
        }
        assert_eq!(area.len(), 30);
        assert!(area.values().all(|a: &f64| (a - 1.0).abs() < 1e-12));
    }

    #[test]
    fn a_needle_is_spread_over_every_texel_it_crosses() {
        let uv = [DVec2::new(0.5, 0.5), DVec2::new(20.5, 0.5), DVec2::new(10.0, 0.5 + 1e-9)];
        let parts = parts(uv);
        assert_eq!(parts.len(), 20);
        assert!((parts.iter().map(|p| p.share).sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn nonsense_gives_nothing() {
        assert!(parts([DVec2::NAN, DVec2::ONE, DVec2::ZERO]).is_empty());
    }

    fn coordinate() -> impl Strategy<Value = f64> {
        // On a grid of 1/8 texel half of the time, so that edges run through corners and along texel borders.
        prop_oneof![(0..320_i32).prop_map(|i| f64::from(i) / 8.0), (0.0..40.0)]
    }

    proptest! {
        #[test]
        fn shares_add_up_and_centroids_lie_in_their_texel(p in proptest::array::uniform6(coordinate())) {
            let uv = [DVec2::new(p[0], p[1]), DVec2::new(p[2], p[3]), DVec2::new(p[4], p[5])];
            let parts = parts(uv);
            let total: f64 = parts.iter().map(|part| part.share).sum();
            prop_assert!((total - 1.0).abs() < 1e-6, "{total}");
            let area = 0.5 * (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs();
            let covered: f64 = parts.iter().map(|part| part.coverage).sum();
            prop_assert!((covered - area).abs() < 1e-9, "{covered} {area}");
            let mean = parts.iter().map(|part| part.centroid * part.share).sum::<DVec2>();
            if area > 1e-3 {
                prop_assert!(mean.distance((uv[0] + uv[1] + uv[2]) / 3.0) < 1e-6);
            }
            for part in &parts {
                let corner = DVec2::new(f64::from(part.x), f64::from(part.y));
                let inside = part.centroid - corner;
                prop_assert!(part.coverage <= 1.0 + 1e-12);
                prop_assert!(inside.cmpge(DVec2::splat(-1e-9)).all() && inside.cmple(DVec2::splat(1.0 + 1e-9)).all());
            }
        }

        #[test]
        fn bands_of_rows_add_up_to_the_whole(p in proptest::array::uniform6(coordinate()), split in 0..40_i32) {
            let uv = [DVec2::new(p[0], p[1]), DVec2::new(p[2], p[3]), DVec2::new(p[4], p[5])];
            let mut banded = Vec::new();
            cut(uv, 0..split, |part| banded.push(part));
            cut(uv, split..41, |part| banded.push(part));
            prop_assert_eq!(banded, parts(uv));
        }
    }
}
