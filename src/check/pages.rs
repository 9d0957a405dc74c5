//! Texels that two charts claim, or that bilinear lookups of two charts read.

use super::layout::{NO_CHART, Side};
use glam::Vec2;
use std::collections::BTreeMap;

/// A texel is claimed where its centre lies inside by more than this, texels.
const INSIDE: f32 = 1e-3;
/// A bilinear lookup reads texels whose centres are less than a texel away per axis; this much of it counts, so that
/// rounding of coordinates that lie on a centre does not.
const REACH: f32 = 0.99;
/// Gaps wider than this are not measured, texels.
const WIDEST_GAP: u32 = 16;

/// Marks a texel that was counted already.
const CLASH: u32 = NO_CHART - 1;

/// What a page's texels say.
#[derive(Debug, Default, PartialEq)]
pub(super) struct PageFacts {
    /// Texels whose centre a chart covers.
    pub covered: usize,
    /// Texels claimed twice, by the surfaces that do: lower index first.
    pub claimed_twice: BTreeMap<(usize, usize), usize>,
    /// Texels that lookups of two charts read, by the surfaces.
    pub read_twice: BTreeMap<(usize, usize), usize>,
    /// Fewest texels between what lookups of two charts read, that neither reads; `None` when they are further apart than
    /// is measured, or there is one chart only.
    pub gap: Option<u32>,
}

/// Looks at one page.
pub(super) fn look(sides: &[Side], page: usize, size: [usize; 2]) -> PageFacts {
    let mut facts = PageFacts::default();
    let here = || sides.iter().filter(|side| side.page == page);
    let surface_of = |chart: u32| sides.iter().find(|s| s.charts.contains(&chart)).map_or(0, |s| s.surface);
    let pair = |a: usize, b: usize| (a.min(b), a.max(b));

    // The surface that claims each texel, plus one.
    let mut owner = vec![0_u32; size[0] * size[1]];
    for side in here() {
        for (corners, _) in side.corners.iter().zip(&side.chart).filter(|(_, chart)| **chart != NO_CHART) {
            claimed(corners, size, |i| {
                if owner[i] == CLASH {
                } else if owner[i] > 0 {
                    *facts.claimed_twice.entry(pair(owner[i] as usize - 1, side.surface)).or_default() += 1;
                    owner[i] = CLASH;
                } else {
                    owner[i] = side.surface as u32 + 1;
                    facts.covered += 1;
                }
            });
        }
    }
    drop(owner);

    let mut reader = vec![NO_CHART; size[0] * size[1]];
    for side in here() {
        for (corners, &chart) in side.corners.iter().zip(&side.chart).filter(|(_, chart)| **chart != NO_CHART)
        {
            texels(
                corners,
                size,
                |p| is_near(corners, p),
                |i| {
                    if reader[i] == NO_CHART {
                        reader[i] = chart;
                    } else if reader[i] != chart && reader[i] != CLASH {
                        let other = surface_of(reader[i]);
                        *facts.read_twice.entry(pair(other, side.surface)).or_default() += 1;
                        reader[i] = CLASH;
                    }
                },
            );
        }
    }
    facts.gap = if facts.read_twice.is_empty() { gap(reader, size) } else { None };
    facts
}

/// Calls `visit` with the texels whose centres lie inside a triangle.
pub(super) fn claimed(corners: &[Vec2; 3], size: [usize; 2], visit: impl FnMut(usize)) {
    texels(corners, size, |p| depth_inside(corners, p) > INSIDE, visit);
}

/// Calls `visit` with the texels around a triangle whose centres pass `test`.
fn texels(corners: &[Vec2; 3], size: [usize; 2], test: impl Fn(Vec2) -> bool, mut visit: impl FnMut(usize)) {
    let [a, b, c] = *corners;
    let limit = |p: f32, side: usize| p.clamp(0.0, side as f32) as usize;
    let (low, high) = (a.min(b).min(c).floor() - 1.0, a.max(b).max(c).ceil() + 1.0);
    for y in limit(low.y, size[1])..limit(high.y, size[1]) {
        for x in limit(low.x, size[0])..limit(high.x, size[0]) {
            if test(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)) {
                visit(y * size[0] + x);
            }
        }
    }
}

/// Distance to the nearest edge, positive inside.
fn depth_inside([a, b, c]: &[Vec2; 3], p: Vec2) -> f32 {
    let sign = (*b - *a).perp_dot(*c - *a).signum();
    let depth = |from: Vec2, to: Vec2| sign * (to - from).perp_dot(p - from) / (to - from).length();
    depth(*a, *b).min(depth(*b, *c)).min(depth(*c, *a))
}

/// Whether the square of half width [`REACH`] around `p` meets the triangle (separating axes).
fn is_near(corners: &[Vec2; 3], p: Vec2) -> bool {
    let [a, b, c] = corners.map(|corner| corner - p);
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    if low.max_element() >= REACH || high.min_element() <= -REACH {
        return false;
    }
    [(a, b, c), (b, c, a), (c, a, b)].into_iter().all(|(from, to, apex)| {
        let axis = (to - from).perp();
        let (edge, other) = (axis.dot(from), axis.dot(apex));
        let reach = REACH * (axis.x.abs() + axis.y.abs());
        edge.min(other) < reach && edge.max(other) > -reach
    })
}

/// Grows all charts at once, a texel a step in eight directions; where two meet, the steps of both add up to the gap.
fn gap(mut reader: Vec<u32>, [width, height]: [usize; 2]) -> Option<u32> {
    let mut steps = vec![0_u8; reader.len()];
    let mut front: Vec<u32> = (0..reader.len() as u32).filter(|&i| reader[i as usize] != NO_CHART).collect();
    let mut least = WIDEST_GAP + 1;
    for step in 0..=WIDEST_GAP / 2 {
        let mut next = Vec::new();
        for &i in &front {
            let (x, y, chart) = (i as usize % width, i as usize / width, reader[i as usize]);
            for ny in y.saturating_sub(1)..(y + 2).min(height) {
                for nx in x.saturating_sub(1)..(x + 2).min(width) {
                    let n = ny * width + nx;
                    if reader[n] == NO_CHART {
                        (reader[n], steps[n]) = (chart, step as u8 + 1);
                        next.push(n as u32);
                    } else if reader[n] != chart {
                        least = least.min(u32::from(steps[i as usize]) + u32::from(steps[n]));
                    }
                }
            }
        }
        if 2 * step >= least || next.is_empty() {
            break;
        }
        front = next;
    }
    (least <= WIDEST_GAP).then_some(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rectangle of texels as two triangles.
    fn side(surface: usize, chart: u32, low: [f32; 2], high: [f32; 2]) -> Side {
        let [a, b, c, d] =
            [[low[0], low[1]], [high[0], low[1]], high, [low[0], high[1]]].map(Vec2::from_array);
        Side {
            surface,
            page: 0,
            corners: vec![[a, b, c], [a, c, d]],
            chart: vec![chart; 2],
            charts: chart..chart + 1,
        }
    }

    #[test]
    fn counts_what_is_covered_and_what_is_claimed_twice() {
        let one = side(3, 0, [1.0, 1.0], [5.0, 4.0]);
        let two = side(7, 1, [4.0, 2.0], [8.0, 8.0]);
        let facts = look(&[one, two], 0, [16, 16]);
        // 4 × 3 and 4 × 6 texels, of which 1 × 2 are shared.
        assert_eq!(facts.covered, 12 + 24 - 2);
        assert_eq!(facts.claimed_twice, BTreeMap::from([((3, 7), 2)]));
        assert_eq!(facts.gap, None);
    }

    #[test]
    fn a_chart_that_folds_over_itself_is_found() {
        let mut folded = side(0, 0, [1.0, 1.0], [5.0, 5.0]);
        folded.corners[1] = folded.corners[0];
        let facts = look(&[folded], 0, [8, 8]);
        assert_eq!(facts.claimed_twice.get(&(0, 0)), Some(&6));
    }

    #[test]
    fn measures_the_texels_between_what_lookups_read() {
        // From texel centre to texel centre, as charts are laid: lookups read columns 0..=4 and then 7..=9.
        let at = |left: f32| [side(0, 0, [0.5, 0.5], [4.5, 4.5]), side(1, 1, [left, 0.5], [left + 2.0, 4.5])];
        assert_eq!(look(&at(7.5), 0, [16, 8]).gap, Some(2));
        assert_eq!(look(&at(6.5), 0, [16, 8]).gap, Some(1));
        let touching = look(&at(5.5), 0, [16, 8]);
        assert_eq!((touching.gap, touching.read_twice.len()), (Some(0), 0));
        // Borders between centres read the texels beyond: five rows of column 4, then of columns 4 and 5.
        assert_eq!(look(&at(5.25), 0, [16, 8]).read_twice, BTreeMap::from([((0, 1), 5)]));
        let both = [side(0, 0, [0.5, 0.5], [4.75, 4.5]), side(1, 1, [5.25, 0.5], [8.5, 4.5])];
        assert_eq!(look(&both, 0, [16, 8]).read_twice, BTreeMap::from([((0, 1), 10)]));
        assert_eq!(look(&[side(0, 0, [0.5, 0.5], [4.5, 4.5])], 0, [8, 8]).gap, None);
    }
}
