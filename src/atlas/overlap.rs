//! Whether a flattened chart covers itself.

use glam::{DVec2, Vec2};

/// Triangles that reach into each other by less than this share of their heights only touch.
const TOUCH: f64 = 1e-3;
/// Most cells and most pairs that are looked at, per triangle.
const EFFORT: usize = 64;

/// Whether two triangles, all of positive winding, cover the same place.
pub(super) fn any(triangles: &[[Vec2; 3]]) -> bool {
    // Two positive triangles that share an edge lie on its two sides; one cannot overlap itself.
    if triangles.len() <= 2 {
        return false;
    }
    let round = rounded(triangles);
    pairs(&round).unwrap_or_else(|| samples(&round))
}

/// The triangles under the affine map that makes their corners spread equally in all directions: it changes no
/// overlap, and long thin charts become easy to look at.
fn rounded(triangles: &[[Vec2; 3]]) -> Vec<[DVec2; 3]> {
    let points = || triangles.iter().flatten().map(|uv| uv.as_dvec2());
    let count = 3.0 * triangles.len() as f64;
    let mean = points().sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points().map(|p| p - mean) {
        xx += p.x * p.x / count;
        xy += p.x * p.y / count;
        yy += p.y * p.y / count;
    }
    // The inverse of the Cholesky factor of the covariance.
    let wide = xx.sqrt();
    let slope = xy / xx;
    let high = (yy - xy * slope).sqrt();
    let map = |uv: Vec2| {
        let p = uv.as_dvec2() - mean;
        let q = DVec2::new(p.x / wide, (p.y - slope * p.x) / high);
        if q.is_finite() { q } else { p }
    };
    triangles.iter().map(|corners| corners.map(map)).collect()
}

fn area(triangles: &[[DVec2; 3]]) -> f64 {
    triangles.iter().map(|[a, b, c]| 0.5 * (*b - *a).perp_dot(*c - *a)).sum()
}

/// Whether any two triangles overlap, tested pair by pair in the cells of a grid. `None` when that would take too
/// many comparisons, as with long slivers or very many triangles around one corner.
fn pairs(triangles: &[[DVec2; 3]]) -> Option<bool> {
    let corners = |t: usize| triangles[t];
    let boxes: Vec<[DVec2; 2]> = (0..triangles.len())
        .map(|t| {
            let [a, b, c] = corners(t);
            [a.min(b).min(c), a.max(b).max(c)]
        })
        .collect();
    let low = boxes.iter().fold(DVec2::INFINITY, |low, b| low.min(b[0]));
    let size = boxes.iter().fold(DVec2::NEG_INFINITY, |high, b| high.max(b[1])) - low;
    // As large as the box of a typical triangle.
    let edge = (2.0 * area(triangles) / triangles.len() as f64).sqrt();
    let side =
        edge.max((size.x * size.y / (4.0 * triangles.len() as f64)).sqrt()).max(size.max_element() / 4096.0);
    let columns = (size.x / side) as usize + 1;
    let rows = (size.y / side) as usize + 1;
    let cell = |p: DVec2| {
        let at = (p - low) / side;
        [(at.x as usize).min(columns - 1), (at.y as usize).min(rows - 1)]
    };
    let cells_of = |t: usize| {
        let [from, to] = [cell(boxes[t][0]), cell(boxes[t][1])];
        (from[1]..=to[1]).flat_map(move |y| (from[0]..=to[0]).map(move |x| y * columns + x))
    };
    let mut first = vec![0u32; columns * rows + 1];
    let mut entries = 0;
    for (t, corners) in boxes.iter().enumerate() {
        let [from, to] = [cell(corners[0]), cell(corners[1])];
        entries += (to[0] - from[0] + 1) * (to[1] - from[1] + 1);
        if entries > EFFORT * triangles.len() + 10_000 {
            return None;
        }
        cells_of(t).for_each(|c| first[c + 1] += 1);
    }
    let comparisons: usize = first.iter().map(|&n| (n as usize).pow(2) / 2).sum();
    if comparisons > EFFORT * triangles.len() + 10_000 {
        return None;
    }
    for c in 0..columns * rows {
        first[c + 1] += first[c];
    }
    let mut next = first.clone();
    let mut members = vec![0u32; entries];
    for t in 0..triangles.len() {
        for c in cells_of(t) {
            members[next[c] as usize] = t as u32;
            next[c] += 1;
        }
    }
    let meet = |s: usize, t: usize, c: usize| {
        let (from, to) = (boxes[s][0].max(boxes[t][0]), boxes[s][1].min(boxes[t][1]));
        // Of the cells both lie in, only the first one compares them.
        let at = cell(from);
        from.cmple(to).all() && at[1] * columns + at[0] == c && depth(corners(s), corners(t)) > TOUCH
    };
    let crowded = |c: usize| {
        let inside = &members[first[c] as usize..first[c + 1] as usize];
        inside.iter().enumerate().any(|(n, &s)| inside[..n].iter().any(|&t| meet(s as usize, t as usize, c)))
    };
    Some((0..columns * rows).any(crowded))
}

/// How far two triangles must move to no longer overlap, as a share of the least height of either; not positive when
/// they do not overlap (separating axes).
fn depth(a: [DVec2; 3], b: [DVec2; 3]) -> f64 {
    let (mut least, mut height) = (f64::INFINITY, f64::INFINITY);
    for triangle in [a, b] {
        for k in 0..3 {
            let Some(axis) = (triangle[(k + 1) % 3] - triangle[k]).perp().try_normalize() else { continue };
            // Relative to one corner, so that a shared edge gives exactly nothing.
            let reach = |other: [DVec2; 3]| other.map(|p| axis.dot(p - triangle[k]));
            let range = |d: [f64; 3]| (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2]));
            let ((a_low, a_high), (b_low, b_high)) = (range(reach(a)), range(reach(b)));
            least = least.min(a_high.min(b_high) - a_low.max(b_low));
            if least <= 0.0 {
                return least;
            }
            let (low, high) = range(reach(triangle));
            height = height.min(high - low);
        }
    }
    least / height
}

/// Samples a mean triangle gets when overlaps are looked for.
const SAMPLES_PER_TRIANGLE: f64 = 64.0;
/// Most samples of a chart's bounding box.
const MOST_SAMPLES: f64 = 16_777_216.0;

/// Whether some sample is inside two triangles. Triangles that share an edge never share a sample: the edge's equation
/// is evaluated the same way round for both, and a sample on it belongs to one.
fn samples(triangles: &[[DVec2; 3]]) -> bool {
    let points = || triangles.iter().flatten().copied();
    let low = points().fold(DVec2::INFINITY, DVec2::min);
    let size = points().fold(DVec2::NEG_INFINITY, DVec2::max) - low;
    let wanted = (SAMPLES_PER_TRIANGLE * triangles.len() as f64 / area(triangles)).sqrt();
    let most = (MOST_SAMPLES / (size.x * size.y)).sqrt();
    let scale = wanted.min(most).min(32768.0 / size.max_element());
    let columns = (size.x * scale) as usize + 1;
    let rows = (size.y * scale) as usize + 1;
    let mut seen = vec![0u64; (columns * rows).div_ceil(64)];
    for corners in triangles {
        let p = corners.map(|p| (p - low) * scale - 0.5);
        let first = p[0].min(p[1]).min(p[2]).ceil().max(DVec2::ZERO);
        let last = p[0].max(p[1]).max(p[2]).floor().min(DVec2::new(columns as f64, rows as f64) - 1.0);
        let edges = [Edge::new(p[0], p[1]), Edge::new(p[1], p[2]), Edge::new(p[2], p[0])];
        let mut y = first.y;
        while y <= last.y {
            let mut x = first.x;
            while x <= last.x {
                if edges.iter().all(|edge| edge.holds(DVec2::new(x, y))) {
                    let n = y as usize * columns + x as usize;
                    if seen[n / 64] >> (n % 64) & 1 == 1 {
                        return true;
                    }
                    seen[n / 64] |= 1 << (n % 64);
                }
                x += 1.0;
            }
            y += 1.0;
        }
    }
    false
}

/// An edge with the triangle to its left.
struct Edge {
    from: DVec2,
    along: DVec2,
    /// −1 when the edge was turned round to be evaluated like its twin.
    sign: f64,
    owns_border: bool,
}

impl Edge {
    fn new(a: DVec2, b: DVec2) -> Self {
        let ordered = (a.x, a.y) <= (b.x, b.y);
        let (from, to, sign) = if ordered { (a, b, 1.0) } else { (b, a, -1.0) };
        Self { from, along: to - from, sign, owns_border: ordered }
    }

    fn holds(&self, p: DVec2) -> bool {
        let side = self.along.perp_dot(p - self.from) * self.sign;
        side > 0.0 || (side == 0.0 && self.owns_border)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What both ways find, which must be the same.
    fn overlap(triangles: &[[Vec2; 3]]) -> bool {
        let found = any(triangles);
        assert_eq!(samples(&rounded(triangles)), found);
        found
    }

    fn fan(turns: f32, n: usize) -> Vec<[Vec2; 3]> {
        let at = |k: usize| Vec2::from_angle(turns * std::f32::consts::TAU * k as f32 / n as f32);
        (0..n).map(|k| [Vec2::ZERO, at(k), at(k + 1)]).collect()
    }

    #[test]
    fn a_fan_that_closes_does_not_overlap_and_one_that_goes_on_does() {
        assert!(!overlap(&fan(1.0, 31)));
        assert!(!overlap(&fan(0.9, 31)));
        assert!(overlap(&fan(1.2, 31)));
        assert!(overlap(&fan(2.0, 31)));
    }

    #[test]
    fn a_long_thin_strip_is_seen_whole() {
        let strip = |lift: f32| {
            let at = move |k: i32| Vec2::new(k as f32, k as f32 + lift * (k % 2) as f32);
            (0..999).map(move |k| {
                if k % 2 == 0 { [at(k), at(k + 2), at(k + 1)] } else { [at(k), at(k + 1), at(k + 2)] }
            })
        };
        let once: Vec<_> = strip(0.1).collect();
        assert!(!overlap(&once));
        let twice: Vec<_> = strip(0.1).chain(strip(0.1)).collect();
        assert!(overlap(&twice));
    }
}
