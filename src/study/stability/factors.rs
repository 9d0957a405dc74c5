//! Form factors between rectangles and needles, by every method.

use super::Check;
use super::world::{Method, World, box_room, cube, parallel, perpendicular};
use crate::error::Result;
use crate::transport::form_factors::area::{Polygon, polygon_to_polygon};
use glam::{DVec3, dvec3};
use rayon::prelude::*;

/// The methods, as fine as a single pair deserves.
pub const FINE: [Method; 3] =
    [Method::Rays(1 << 16), Method::Hemicube { resolution: 64, points: 8 }, Method::Analytic];
/// The same for worlds of many patches.
pub const COARSE: [Method; 3] =
    [Method::Rays(4096), Method::Hemicube { resolution: 64, points: 2 }, Method::Analytic];

/// C-11 of Howell's catalogue, from 30-digit arithmetic: a, b, distance, factor.
pub const PARALLEL: [(f64, f64, f64, f64); 14] = [
    (1.0, 1.0, 1.0, 0.199824895698387),
    (2.0, 1.0, 1.0, 0.285875384850715),
    (1.0, 1.0, 0.5, 0.415253283577147),
    (1.0, 1.0, 2.0, 0.0685895888185524),
    (4.0, 3.0, 2.5, 0.292073999834271),
    (100.0, 0.01, 1.0, 0.00496804560909578),
    (1.0, 1.0, 10.0, 0.0031620568387576),
    (1.0, 1.0, 100.0, 3.182886673e-5),
    (1.0, 1.0, 1000.0, 3.1830967397738e-7),
    (1.0, 1.0, 0.1, 0.826994522397257),
    (1.0, 1.0, 0.01, 0.980416602925973),
    (1.0, 1.0, 1e-3, 0.99800563190758),
    (1.0, 1.0, 1e-4, 0.999800070977788),
    (1.0, 1.0, 1e-6, 0.99999800001003),
];

/// C-14: height of the wall, width of the floor, common edge, factor from floor to wall.
pub const PERPENDICULAR: [(f64, f64, f64, f64); 11] = [
    (1.0, 1.0, 1.0, 0.200043776075403),
    (2.0, 1.0, 1.0, 0.232852602795362),
    (1.0, 2.0, 1.0, 0.116426301397681),
    (3.0, 4.0, 5.0, 0.19100101371043),
    (0.5, 1.0, 1.0, 0.146186679105713),
    (0.1, 1.0, 1.0, 0.0432513694006859),
    (0.01, 1.0, 1.0, 0.00489584926850668),
    (1e-4, 1.0, 1.0, 4.99822555528782e-5),
    (1.0, 1e-4, 1.0, 0.499822555528782),
    (1.0, 1.0, 1e-3, 0.00128297693281318),
    (1.0, 1.0, 1000.0, 0.292782901039902),
];

/// Parallel unit squares at distance 1, shifted; 30-digit arithmetic.
const SHIFTED: [([f64; 2], f64); 2] = [([2.0, 0.0], 0.0152754500880168), ([1.0, 1.0], 0.0433274095741047)];

/// Perpendicular unit squares: gap to the edge, shift along it, factor; the gaps by the algebra of C-14.
const APART: [(f64, f64, f64); 3] =
    [(0.0, 1.0, 0.0405922301015585), (1.0, 0.0, 0.0328088267199587), (1e-3, 0.0, 0.199610808935920)];

/// Opposite faces of a cube, and adjacent ones.
const OPPOSITE: f64 = 0.199824895698387;
const ADJACENT: f64 = 0.200043776075403;

/// A size, and where: only closed forms are in f64 from end to end; scenes that are far away are moved to their middle
/// before any ray is sent, which whole bakes show.
fn places(method: Method) -> Vec<(f64, DVec3, &'static str)> {
    let mut places = vec![(1e-3, DVec3::ZERO, "×1e-3"), (1.0, DVec3::ZERO, "×1"), (1e6, DVec3::ZERO, "×1e6")];
    if matches!(method, Method::Analytic) {
        places.push((1.0, FAR, "×1, 1e6 m away"));
    }
    places
}

/// A million metres away along every axis.
const FAR: DVec3 = dvec3(1e6, -1e6, 1e6);
/// Corners out there are rounded by this many metres.
const FAR_ROUNDING: f64 = 1e6 / (1u64 << 53) as f64;

/// A world whose first patch sees the second by a factor that is known to so many digits, and its smallest length.
struct Pair {
    case: String,
    world: World,
    factor: f64,
    known_to: f64,
    smallest: f64,
}

impl Pair {
    fn checks(&self) -> Vec<Check> {
        let tasks: Vec<_> = FINE
            .into_iter()
            .flat_map(|method| places(method).into_iter().map(move |at| (method, at)))
            .collect();
        tasks
            .into_par_iter()
            .filter_map(|(method, (scale, by, place))| {
                let world = self.world.placed(scale, by);
                let mut bound = method.error(&world, 0, 1, self.factor) / self.factor + self.known_to;
                let mut why = method.why().to_owned();
                if by != DVec3::ZERO {
                    // Each of eight corners moves by the rounding, along two axes of its plane.
                    bound += 16.0 * FAR_ROUNDING / self.smallest;
                    why += "; corners rounded to f64 at that distance, as a share of the smallest length";
                }
                if self.known_to > 0.0 {
                    why += "; digits of the table, or of the formula";
                }
                // A method that cannot tell half of the factor does not apply.
                (bound < 0.5).then(|| {
                    Check::new(self.case.clone(), self.factor, method.factor(&world, 0, 1), bound, why)
                        .by(method.name())
                        .at(place)
                })
            })
            .collect()
    }
}

fn all(pairs: impl IntoIterator<Item = Pair>) -> Vec<Check> {
    pairs.into_iter().flat_map(|pair| pair.checks()).collect()
}

/// From contact to 10³ sizes, shifted.
pub fn parallel_rectangles() -> Result<Vec<Check>> {
    let facing = PARALLEL.map(|(a, b, c, factor)| Pair {
        case: format!("{a} × {b} at {c}"),
        world: parallel(a, b, c, [0.0; 2]),
        factor,
        // As printed; small factors have fewer digits.
        known_to: if factor < 1e-3 { 1e-9 } else { 0.0 },
        smallest: a.min(b).min(c),
    });
    let shifted = SHIFTED.map(|(shift, factor)| Pair {
        case: format!("1 × 1 at 1, shifted by {} and {}", shift[0], shift[1]),
        world: parallel(1.0, 1.0, 1.0, shift),
        factor,
        known_to: 0.0,
        smallest: 1.0,
    });
    Ok(all(facing.into_iter().chain(shifted)))
}

/// With an edge in common, and apart.
pub fn perpendicular_rectangles() -> Result<Vec<Check>> {
    let touching = PERPENDICULAR.map(|(h, w, l, factor)| Pair {
        case: format!("wall {h} high on a floor {w} wide, edge {l}"),
        world: perpendicular(h, w, l, 0.0, 0.0),
        factor,
        known_to: 0.0,
        smallest: h.min(w).min(l),
    });
    let apart = APART.map(|(gap, along, factor)| Pair {
        case: format!("unit squares {gap} apart, {along} along"),
        world: perpendicular(1.0, 1.0, 1.0, gap, along),
        factor,
        known_to: 0.0,
        smallest: if gap > 0.0 { gap } else { 1.0 },
    });
    Ok(all(touching.into_iter().chain(apart)))
}

/// Faces of a cube; sums of rows, closed and open; A_i F_ij = A_j F_ji.
pub fn closed_rooms() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    for method in FINE {
        for (scale, _, place) in places(method).into_iter().filter(|place| place.1 == DVec3::ZERO) {
            let world = cube(1, scale);
            for (to, expected) in [(1, OPPOSITE), (2, ADJACENT), (5, ADJACENT)] {
                let bound = method.error(&world, 0, to, expected) / expected;
                let found = method.factor(&world, 0, to);
                let case = format!("floor of a cube to its face {to}");
                checks
                    .push(Check::new(case, expected, found, bound, method.why()).by(method.name()).at(place));
            }
        }
    }
    for method in COARSE {
        let sides = dvec3(1.0, 2.0, 0.5);
        let (closed, mut open) = (box_room(2, sides), box_room(2, DVec3::ONE));
        open.truncate(5);
        // Hits and misses are counted, or scaled to what was counted: f64 rounds each of n terms.
        let sums = "rounding of a sum of f64 shares, 1e-12; closed forms: their tolerance 1e-9";
        let bound = if matches!(method, Method::Analytic) { 1e-9 } else { 1e-12 };
        let worst = |world: &World, value: &dyn Fn(f64, f64) -> f64| {
            let rows = (0..world.len() as u32).map(|patch| {
                let row = method.row(world, patch);
                value(row.weight.iter().sum(), row.miss)
            });
            rows.max_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs())).unwrap_or(1.0)
        };
        let by = |check: Check| check.by(method.name());
        checks.push(by(Check::new(
            "sums of rows in a closed room",
            1.0,
            worst(&closed, &|sum, _| sum),
            bound,
            sums,
        )));
        checks.push(by(Check::new(
            "sums of rows and sky in an open room",
            1.0,
            worst(&open, &|sum, miss| sum + miss),
            bound,
            sums,
        )));
    }
    for method in FINE {
        let by = |check: Check| check.by(method.name());
        let closed = box_room(2, dvec3(1.0, 2.0, 0.5));
        let area = closed.area();
        for (i, j) in [(0, 5), (0, 12), (3, 22), (9, 17), (11, 4), (20, 0)] {
            let (there, back) = (method.factor(&closed, i, j), method.factor(&closed, j, i));
            let (a, b) = (area[i as usize] * there, area[j as usize] * back);
            let errors =
                method.error(&closed, i, j, there) / there + method.error(&closed, j, i, back) / back;
            let case = format!("A F of patches {i} and {j} of a room, there and back");
            if errors < 0.5 {
                checks.push(by(Check::new(case, a, b, errors, method.why())));
            }
        }
    }
    Ok(checks)
}

/// A needle of 1 : 10⁴ and 1 : 10⁶, which is the sum of its pieces; areas of 10⁸ : 1.
pub fn needles() -> Result<Vec<Check>> {
    let mut pairs = Vec::new();
    for width in [1e-4, 1e-6] {
        let mut world = World::default();
        world.add_quad(DVec3::ZERO, DVec3::X, DVec3::Y, [1, 1]);
        let corners = [dvec3(0.0, 0.5, 0.5), dvec3(0.0, 0.5 + width, 0.5), dvec3(1.0, 0.5, 0.5)];
        world.add_triangle(corners);
        pairs.push(Pair {
            case: format!("a needle {width} wide and 1 long over a square"),
            factor: needle_in_pieces(&world.polygons[0], width),
            world,
            // Lengths and areas of a needle have as many digits less as it is thin.
            known_to: 1e-16 / width * 8.0,
            smallest: width,
        });
    }
    let mut world = World::default();
    let corner = dvec3(0.5 - 0.5e-4, 0.5 - 0.5e-4, 0.0);
    world.add_quad(corner, DVec3::X * 1e-4, DVec3::Y * 1e-4, [1, 1]);
    world.add_quad(dvec3(0.0, 0.0, 1.0), DVec3::Y, DVec3::X, [1, 1]);
    pairs.push(Pair {
        case: "areas of 1e-8 : 1, from the small one".to_owned(),
        world,
        // Four corner factors of ½ × ½ at distance 1.
        factor: 4.0 * 0.0598641176151934,
        // For the middle of the small one: its extent adds second order.
        known_to: 1e-8,
        smallest: 1e-4,
    });
    let mut world = World::default();
    world.add_quad(dvec3(0.0, 0.0, 1.0), DVec3::Y, DVec3::X, [1, 1]);
    world.add_quad(corner, DVec3::X * 1e-4, DVec3::Y * 1e-4, [1, 1]);
    pairs.push(Pair {
        case: "areas of 1e-8 : 1, from the large one".to_owned(),
        world,
        factor: 4.0 * 0.0598641176151934 * 1e-8,
        known_to: 1e-8,
        smallest: 1e-4,
    });
    Ok(all(pairs))
}

/// Factor from the square to the needle as the sum over a thousand pieces of good shape, each by reciprocity.
fn needle_in_pieces(square: &Polygon, width: f64) -> f64 {
    const PIECES: i32 = 1000;
    let at = |i: i32| f64::from(i) / f64::from(PIECES);
    let low = |i: i32| dvec3(at(i), 0.5, 0.5);
    let high = |i: i32| dvec3(at(i), 0.5 + width * (1.0 - at(i)), 0.5);
    let pieces = (0..PIECES).filter_map(|i| Polygon::new(vec![low(i), high(i), high(i + 1), low(i + 1)]));
    pieces.map(|piece| polygon_to_polygon(&piece, square, 1e-10).factor * piece.area() / square.area()).sum()
}
