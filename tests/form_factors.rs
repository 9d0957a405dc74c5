//! Every form-factor method against closed forms: one suite for all of them.

mod radiosity;

use glam::{DVec3, dvec3};
use lightkiln::transport::form_factors::area::{Polygon, polygon_to_polygon};
use radiosity::{Method, World, box_room, cube, parallel, perpendicular, sphere};

/// C-11 of Howell's catalogue, from 30-digit arithmetic: a, b, distance, factor.
const PARALLEL: [(f64, f64, f64, f64); 12] = [
    (1.0, 1.0, 1.0, 0.199824895698387),
    (2.0, 1.0, 1.0, 0.285875384850715),
    (1.0, 1.0, 0.5, 0.415253283577147),
    (1.0, 1.0, 2.0, 0.0685895888185524),
    (4.0, 3.0, 2.5, 0.292073999834271),
    (100.0, 0.01, 1.0, 0.00496804560909578),
    (1.0, 1.0, 10.0, 0.0031620568387576),
    (1.0, 1.0, 100.0, 3.182886673e-5),
    (1.0, 1.0, 0.1, 0.826994522397257),
    (1.0, 1.0, 0.01, 0.980416602925973),
    (1.0, 1.0, 1e-3, 0.99800563190758),
    (1.0, 1.0, 1e-6, 0.99999800001003),
];

/// C-14: height of the wall, width of the floor, common edge, factor from floor to wall.
const PERPENDICULAR: [(f64, f64, f64, f64); 10] = [
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
];

/// Parallel unit squares at distance 1, shifted; 30-digit arithmetic.
const SHIFTED: [([f64; 2], f64); 2] = [([2.0, 0.0], 0.0152754500880168), ([1.0, 1.0], 0.0433274095741047)];

/// Perpendicular unit squares: gap to the edge, shift along it, factor; the gaps by the algebra of C-14.
const APART: [(f64, f64, f64); 3] =
    [(0.0, 1.0, 0.0405922301015585), (1.0, 0.0, 0.0328088267199587), (1e-3, 0.0, 0.199610808935920)];

fn check(method: Method, world: &World, expected: f64, what: &str) {
    check_within(method, world, expected, 0.0, what);
}

/// `known_to`: what the expected value is itself off by, relatively.
fn check_within(method: Method, world: &World, expected: f64, known_to: f64, what: &str) {
    let found = method.factor(world, 0, 1);
    let bound = method.error(world, 0, 1, expected) + known_to * expected;
    assert!((found - expected).abs() <= bound, "{what}: {found}, expected {expected} ± {bound:e}");
}

/// Factors are shares of what leaves: none is negative, they and the miss add up to 1.
fn check_shares(method: Method, world: &World, closed: bool) {
    for patch in 0..world.len() as u32 {
        let row = method.row(world, patch);
        let sum: f64 = row.weight.iter().sum();
        assert!(row.weight.iter().all(|&weight| weight >= 0.0));
        assert!((sum + row.miss - 1.0).abs() < 1e-9, "patch {patch}: {sum} + {}", row.miss);
        if closed {
            assert!(row.miss < 1e-9, "patch {patch} misses {}", row.miss);
        }
    }
}

macro_rules! form_factor_suite {
    ($name:ident, $method:expr, $coarse:expr) => {
        mod $name {
            use super::*;

            const METHOD: Method = $method;
            /// For worlds of many patches.
            const COARSE: Method = $coarse;

            #[test]
            fn parallel_rectangles() {
                for (a, b, c, expected) in PARALLEL {
                    check(METHOD, &parallel(a, b, c, [0.0; 2]), expected, &format!("{a} × {b} at {c}"));
                }
            }

            #[test]
            fn perpendicular_rectangles() {
                for (h, w, l, expected) in PERPENDICULAR {
                    let world = perpendicular(h, w, l, 0.0, 0.0);
                    check(METHOD, &world, expected, &format!("{h} over {w}, edge {l}"));
                }
            }

            #[test]
            fn shifted_squares() {
                for (shift, expected) in SHIFTED {
                    check(METHOD, &parallel(1.0, 1.0, 1.0, shift), expected, &format!("{shift:?}"));
                }
                for (gap, along, expected) in APART {
                    let world = perpendicular(1.0, 1.0, 1.0, gap, along);
                    check(METHOD, &world, expected, &format!("gap {gap}, {along} along"));
                }
            }

            #[test]
            fn the_faces_of_a_cube() {
                let world = cube(1, 1.0);
                for from in 0..6 {
                    let row = METHOD.row(&world, from);
                    assert_eq!(row.column.len(), 5);
                    for (&to, &found) in row.column.iter().zip(&row.weight) {
                        let expected = if from / 2 == to / 2 { 0.199824895698387 } else { 0.200043776075403 };
                        let bound = METHOD.error(&world, from, to, expected);
                        assert!((found - expected).abs() <= bound, "{from} to {to}: {found} ± {bound:e}");
                    }
                }
            }

            #[test]
            fn size_and_place_do_not_matter() {
                for (size, expected) in [(1e-3, 0.200043776075403), (1e6, 0.200043776075403)] {
                    check(METHOD, &perpendicular(size, size, size, 0.0, 0.0), expected, &format!("{size} m"));
                }
            }

            /// A needle of 1 : 10,000 is the sum of its thousand pieces.
            #[test]
            fn a_sliver_is_the_sum_of_its_parts() {
                let needle = |length: f64| {
                    let mut world = World::default();
                    world.add_quad(DVec3::ZERO, DVec3::X, DVec3::Y, [1, 1]);
                    world.add_triangle([
                        dvec3(0.0, 0.5, 0.5),
                        dvec3(0.0, 0.5 + 1e-4, 0.5),
                        dvec3(length, 0.5, 0.5),
                    ]);
                    world
                };
                let parts = 1000;
                let at = |i: i32| f64::from(i) / f64::from(parts);
                let floor = Polygon::new(needle(1.0).polygons[0].corners().to_vec()).unwrap();
                let expected: f64 = (0..parts)
                    .map(|i| {
                        let width = |i: i32| dvec3(at(i), 0.5 + 1e-4 * (1.0 - at(i)), 0.5);
                        let low = |i: i32| dvec3(at(i), 0.5, 0.5);
                        let piece = Polygon::new(vec![low(i), width(i), width(i + 1), low(i + 1)]).unwrap();
                        polygon_to_polygon(&piece, &floor, 1e-10).factor * piece.area() / floor.area()
                    })
                    .sum();
                check(METHOD, &needle(1.0), expected, "needle");
            }

            /// Areas of 10⁸ : 1: the small one sees what a point sees, and reciprocity gives the other way.
            #[test]
            fn extreme_ratios_of_area() {
                let mut world = World::default();
                let corner = dvec3(0.5 - 0.5e-4, 0.5 - 0.5e-4, 0.0);
                world.add_quad(corner, DVec3::X * 1e-4, DVec3::Y * 1e-4, [1, 1]);
                world.add_quad(dvec3(0.0, 0.0, 1.0), DVec3::Y, DVec3::X, [1, 1]);
                // Four corner factors of ½ × ½ at distance 1, for the middle of the small one; its own extent adds
                // second order.
                check_within(METHOD, &world, 4.0 * 0.0598641176151934, 1e-8, "from the small one");
            }

            #[test]
            fn a_closed_room_receives_all_and_an_open_one_does_not() {
                check_shares(COARSE, &box_room(2, dvec3(1.0, 2.0, 0.5)), true);
                let mut open = box_room(2, DVec3::ONE);
                open.surfaces.truncate(5);
                open.polygons.truncate(20);
                check_shares(COARSE, &open, false);
                assert!(COARSE.row(&open, 0).miss > 0.1);
            }

            /// A_i F_ij = A_j F_ji within both errors.
            #[test]
            fn reciprocity() {
                let world = box_room(2, dvec3(1.0, 2.0, 0.5));
                let area = world.area();
                for (i, j) in [(0, 5), (0, 12), (3, 22), (9, 17), (11, 4), (20, 0)] {
                    let (there, back) = (METHOD.factor(&world, i, j), METHOD.factor(&world, j, i));
                    let (a, b) = (area[i as usize], area[j as usize]);
                    let bound = a * METHOD.error(&world, i, j, there) + b * METHOD.error(&world, j, i, back);
                    assert!((a * there - b * back).abs() <= bound, "{i} {j}: {} {}", a * there, b * back);
                }
            }

            /// Inside a sphere every patch takes its share of the area from every other: F = A_j/A. A facet of extent
            /// h stands for the arc within h²/8 of its radius; the mean error over a row is what the method's own
            /// error leaves of it.
            #[test]
            fn inside_a_sphere_all_factors_are_shares_of_the_area() {
                let mut world = World::default();
                sphere(&mut world, 1.0, 3, true);
                let area = world.area();
                let total: f64 = area.iter().sum();
                for from in [0, 7, 40] {
                    let row = COARSE.row(&world, from);
                    let mut off = 0.0;
                    let mut bound = 0.0;
                    for (&to, &weight) in row.column.iter().zip(&row.weight) {
                        let expected = area[to as usize] / total;
                        off += (weight - expected).abs();
                        bound += COARSE.error(&world, from, to, expected);
                    }
                    // Facets of an octant cut in three are 0.55 across.
                    assert!(off < bound + 0.55 * 0.55 / 2.0, "{off} {bound}");
                }
            }

            #[test]
            fn rows_repeat_to_the_bit() {
                let world = cube(2, 1.0);
                assert_eq!(COARSE.row(&world, 5), COARSE.row(&world, 5));
                assert_eq!(COARSE.rows(&world), COARSE.rows(&world));
            }
        }
    };
}

form_factor_suite!(rays, Method::Rays(1 << 16), Method::Rays(4096));
form_factor_suite!(
    hemicube,
    Method::Hemicube { resolution: 64, points: 8 },
    Method::Hemicube { resolution: 64, points: 2 }
);
form_factor_suite!(analytic, Method::Analytic, Method::Analytic);

/// Polygons that reach behind each other's planes are clipped: only the parts before both count.
#[test]
fn polygons_behind_each_other_are_cut() {
    let square = |height: f64, low: f64| {
        Polygon::new(vec![
            dvec3(0.0, 0.0, low),
            dvec3(0.0, 1.0, low),
            dvec3(0.0, 1.0, height),
            dvec3(0.0, 0.0, height),
        ])
        .unwrap()
    };
    let floor = Polygon::new(vec![DVec3::ZERO, DVec3::X, dvec3(1.0, 1.0, 0.0), DVec3::Y]).unwrap();
    let whole = polygon_to_polygon(&floor, &square(1.0, -3.0), 1e-10);
    assert!((whole.factor - 0.200043776075403).abs() < 1e-9, "{whole:?}");
    // A wall through the middle of the floor sees half of it on its front.
    let wide =
        Polygon::new(vec![dvec3(-1.0, 0.0, 0.0), DVec3::X, dvec3(1.0, 1.0, 0.0), dvec3(-1.0, 1.0, 0.0)])
            .unwrap();
    let cut = polygon_to_polygon(&wide, &square(1.0, 0.0), 1e-10);
    assert!((cut.factor - 0.5 * 0.200043776075403).abs() < 1e-9, "{cut:?}");
    let behind = polygon_to_polygon(&floor, &square(-1.0, -3.0), 1e-10);
    assert_eq!(behind.factor, 0.0);
}

/// The error that is stated holds, from contact to 10⁵ sizes, at every tolerance.
#[test]
fn the_stated_error_of_closed_forms_holds() {
    let table = PARALLEL
        .iter()
        .map(|&(a, b, c, f)| (parallel(a, b, c, [0.0; 2]), f))
        .chain(PERPENDICULAR.iter().map(|&(h, w, l, f)| (perpendicular(h, w, l, 0.0, 0.0), f)))
        .chain([(parallel(1.0, 1.0, 1000.0, [0.0; 2]), 3.1830967397738e-7)]);
    for (world, expected) in table {
        for tolerance in [1e-2, 1e-4, 1e-6, 1e-10] {
            let found = polygon_to_polygon(&world.polygons[0], &world.polygons[1], tolerance);
            // The table has 15 digits at best, 10 where the factors are small.
            let off = (found.factor - expected).abs();
            assert!(off <= found.error + 2e-10 * expected, "{expected}: {found:?} is off by {off:e}");
            // Cancellation between the edges of a needle of 1 : 10⁴ leaves eight digits.
            assert!(found.error <= tolerance.max(1e-8) * expected, "{expected}: {found:?} at {tolerance}");
        }
    }
}
