//! Sky through openings, seen from one gather.
//!
//! The directions of a gather are a net: the square they come from falls into as many equal cells as there are
//! directions, or fewer, and every cell holds equally many. Where neighbours of a cell differ in whether they see the sky,
//! the border of an opening passes, and how much of such a cell is open is known to a half only: behind a small window
//! that is most of what is seen. So these cells, and no others, are asked again by a regular grid of shadow rays (the
//! adaptive sampling of Whitted 1980, section 4, on the hemisphere). Only the sky's part of the light changes.

use crate::sampling::cosine_hemisphere;
use glam::Vec3;

/// Rays along a side of a cell, from the most to the least.
const FINENESS: [usize; 2] = [4, 2];
/// The most rays a gather may send after its own, as a multiple of them. Where borders are everywhere, as under leaves,
/// errors of many cells even out, and nothing is asked again.
const MOST_MORE: usize = 2;

/// The cells of a set of directions.
pub(super) struct Openings {
    /// Cells along a side of the square, a power of two.
    side: usize,
    /// Cell of each direction.
    cell: Vec<u32>,
}

/// What one gather has seen of the sky.
pub(super) struct Seen {
    of_cell: Vec<Cell>,
}

#[derive(Clone, Copy, Default)]
struct Cell {
    /// Sum of radiances, W/(m² sr).
    sky: Vec3,
    /// Rays.
    rays: u32,
    /// Those that left unhindered.
    open: u32,
    /// Those of which nothing left.
    shut: u32,
}

impl Openings {
    /// For directions that come from these points of the unit square.
    pub fn new(points: &[[f32; 2]]) -> Self {
        let side = 1_usize << (points.len().max(1).ilog2() / 2);
        let along = |x: f32| ((x * side as f32) as usize).min(side - 1);
        let cell = points.iter().map(|&[u, v]| (along(v) * side + along(u)) as u32).collect();
        Self { side, cell }
    }

    /// The middles of `fine` × `fine` equal parts of a cell, as directions.
    fn within(&self, cell: usize, fine: usize) -> impl Iterator<Item = Vec3> + use<> {
        let side = self.side;
        let at = move |cell: usize, k: usize| (cell as f32 + (k as f32 + 0.5) / fine as f32) / side as f32;
        (0..fine * fine).map(move |k| cosine_hemisphere(at(cell % side, k % fine), at(cell / side, k / fine)))
    }

    /// A gather that has seen nothing yet.
    pub fn unseen(&self) -> Seen {
        Seen { of_cell: vec![Cell::default(); self.side * self.side] }
    }

    /// Notes what a direction saw: the share of light that left, and the radiance it met there times that share.
    #[inline]
    pub fn note(&self, seen: &mut Seen, direction: usize, left: Vec3, sky: Vec3) {
        let cell = &mut seen.of_cell[self.cell[direction] as usize];
        cell.rays += 1;
        cell.sky += sky;
        cell.open += u32::from(left == Vec3::ONE);
        cell.shut += u32::from(left == Vec3::ZERO);
    }

    /// Cells whose neighbours, these eight alone, see sky and something else. What a cell's own rays met must not decide
    /// whether it is asked again: a thin thing would vanish wherever it was met by chance, and stay where it was not.
    fn borders(&self, seen: &Seen) -> Vec<usize> {
        let side = self.side;
        let is_border = |&i: &usize| {
            let [x, y] = [i % side, i / side];
            let (mut open, mut shut) = (false, false);
            for v in y.saturating_sub(1)..(y + 2).min(side) {
                for u in x.saturating_sub(1)..(x + 2).min(side) {
                    let cell = &seen.of_cell[v * side + u];
                    if [u, v] != [x, y] && cell.rays > 0 {
                        open |= cell.shut < cell.rays;
                        shut |= cell.open < cell.rays;
                    }
                }
            }
            (open && shut) || seen.of_cell[i].rays == 0
        };
        (0..side * side).filter(is_border).collect()
    }

    /// The mean over the square of what was seen, after `ask`, which gives the sky's radiance times the share of light that
    /// arrives from a local direction, was asked at borders; and how often it was. `None` where there is nothing to mend.
    pub fn mean(&self, seen: &Seen, ask: impl Fn(Vec3) -> Vec3) -> Option<(Vec3, u64)> {
        if seen.of_cell.iter().all(|cell| cell.shut == cell.rays) {
            return None;
        }
        let borders = self.borders(seen);
        let most = MOST_MORE * self.cell.len();
        let fits = |fine: &usize| borders.len() * fine * fine <= most;
        let fine = FINENESS.into_iter().find(fits).filter(|_| !borders.is_empty())?;
        let rays = fine * fine;
        let mut sum = Vec3::ZERO;
        let mut next = borders.iter().copied().peekable();
        for (i, cell) in seen.of_cell.iter().enumerate() {
            sum += if next.next_if_eq(&i).is_some() {
                self.within(i, fine).map(&ask).sum::<Vec3>() / rays as f32
            } else {
                cell.sky / cell.rays as f32
            };
        }
        Some((sum / seen.of_cell.len() as f32, (borders.len() * rays) as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{disc, sobol4};

    /// What a gather knows of a window: everything whose place on the disc is within a rectangle.
    fn share(rays: u32, window: [f32; 4]) -> [f32; 2] {
        let points: Vec<[f32; 2]> = sobol4(rays, 0, 3).iter().map(|p| [p[0], p[1]]).collect();
        let openings = Openings::new(&points);
        let open = |x: f32, y: f32| window[0] < x && x < window[1] && window[2] < y && y < window[3];
        let mut seen = openings.unseen();
        let mut plain = 0.0;
        for (i, &[u, v]) in points.iter().enumerate() {
            let [x, y] = disc(u, v);
            let left = if open(x, y) { Vec3::ONE } else { Vec3::ZERO };
            plain += left.x / rays as f32;
            openings.note(&mut seen, i, left, left);
        }
        let mended =
            openings.mean(&seen, |local| if open(local.x, local.y) { Vec3::ONE } else { Vec3::ZERO });
        [plain, mended.map_or(plain, |(mean, _)| mean.x)]
    }

    #[test]
    fn a_window_s_share_is_known_four_times_better() {
        let mut errors = [0.0_f32; 2];
        for k in 0..64 {
            let (x, y) = (-0.4 + 0.011 * k as f32, -0.3 + 0.007 * k as f32);
            let window = [x, x + 0.23, y, y + 0.31];
            let exact = 0.23 * 0.31 / std::f32::consts::PI;
            for (error, found) in errors.iter_mut().zip(share(256, window)) {
                *error += (found - exact).powi(2) / 64.0;
            }
        }
        // Sixteen rays a border cell in the place of one: their regular grid errs by a fourth along a straight border.
        assert!(errors[1].sqrt() < errors[0].sqrt() / 3.0, "{errors:?}");
    }

    #[test]
    fn whole_skies_and_none_are_left_alone() {
        let points: Vec<[f32; 2]> = sobol4(64, 0, 3).iter().map(|p| [p[0], p[1]]).collect();
        let openings = Openings::new(&points);
        for left in [Vec3::ZERO, Vec3::ONE] {
            let mut seen = openings.unseen();
            (0..64).for_each(|i| openings.note(&mut seen, i, left, left));
            assert!(openings.mean(&seen, |_| panic!("nothing is asked")).is_none());
        }
    }
}
