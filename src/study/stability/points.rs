//! Lambert's formula and what is built on it, at a point.

use super::Check;
use super::bodies::circle;
use crate::error::Result;
use crate::transport::form_factors::area::{Polygon, polygon_to_polygon};
use crate::transport::form_factors::polygon::point_to_polygon;
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::PI;

/// A point that faces up under the corner of a rectangle a × b at distance c; 30-digit arithmetic.
const UNDER_A_CORNER: [(f64, f64, f64, f64); 5] = [
    (1.0, 1.0, 1.0, 0.138531605994893),
    (2.0, 1.0, 1.0, 0.167375009914384),
    (0.5, 0.5, 1.0, 0.0598641176151934),
    (1.0, 1.0, 0.1, 0.24797140829531),
    (1.0, 1.0, 1e-3, 0.249999795422702),
];

/// A point that faces up at distance c from the foot of a wall a high, whose edge, b wide, begins beside it.
const BESIDE_A_WALL: [(f64, f64, f64, f64); 6] = [
    (1.0, 1.0, 1.0, 0.0557341970025535),
    (2.0, 1.0, 1.0, 0.0950679411924033),
    (1.0, 2.0, 1.0, 0.068697298875593),
    (1.0, 1.0, 0.1, 0.221738670869958),
    (1.0, 1.0, 1e-3, 0.249715845212248),
    (1.0, 1000.0, 1.0, 0.0732233046503116),
];

/// A point at distance a off the axis of a disc of radius r at height h: a, h, r.
const UNDER_A_DISC: [(f64, f64, f64, f64); 3] =
    [(2.0, 1.0, 1.0, 0.0527864045), (0.5, 2.0, 1.0, 0.184703687453), (10.0, 1.0, 1.0, 9.99700099965e-5)];

/// f64 leaves the formula 1e-12 (four edges, each an arctangent of sums of three products, near cancellation 1e-3); the
/// tables have 13 digits after the first.
const ROUNDING: f64 = 2e-12;
const WHY_ROUNDING: &str = "f64 in the formula, and the table's digits";

/// All of them, at three sizes, turned, and far from the origin.
pub fn points() -> Result<Vec<Check>> {
    let mut checks = Vec::new();
    let mut rectangle = |case: String, corners: [DVec3; 4], factor: f64, smallest: f64| {
        let turn = DQuat::from_rotation_x(1.1) * DQuat::from_rotation_y(0.7);
        for (scale, turn, by, place) in [
            (1.0, DQuat::IDENTITY, DVec3::ZERO, "×1"),
            (1e-3, turn, DVec3::ZERO, "×1e-3, turned"),
            (1e6, turn, DVec3::ZERO, "×1e6, turned"),
            (1.0, turn, dvec3(1e6, -1e6, 1e6), "×1, turned, 1e6 m away"),
        ] {
            let placed = corners.map(|corner| turn * (corner * scale) + by);
            let found = point_to_polygon(by, turn * DVec3::Z, &placed);
            // Corners rounded to 2⁻⁵³ of where they are, four of them along two axes.
            let moved = 8.0 * by.abs().max_element() / (1u64 << 53) as f64 / (smallest * scale);
            // Turned, heights of 1e-3 are differences of lengths of 1.
            let lost = 8.0 / (1u64 << 53) as f64 / smallest;
            let bound = ROUNDING + moved + lost;
            checks
                .push(Check::new(case.clone(), factor, found, bound, WHY_ROUNDING).by("analytic").at(place));
        }
    };
    for (a, b, c, factor) in UNDER_A_CORNER {
        let corners = [dvec3(0.0, 0.0, c), dvec3(0.0, b, c), dvec3(a, b, c), dvec3(a, 0.0, c)];
        rectangle(format!("under the corner of {a} × {b} at {c}"), corners, factor, a.min(b).min(c));
    }
    for (a, b, c, factor) in BESIDE_A_WALL {
        let corners = [dvec3(-c, 0.0, 0.0), dvec3(-c, b, 0.0), dvec3(-c, b, a), dvec3(-c, 0.0, a)];
        rectangle(format!("{c} from a wall {a} high and {b} wide"), corners, factor, a.min(b).min(c));
    }
    // The window of the research notes: 1.6 wide, from 1 to 2.2 high, 2 in front.
    let window = [dvec3(2.0, -0.8, 1.0), dvec3(2.0, 0.8, 1.0), dvec3(2.0, 0.8, 2.2), dvec3(2.0, -0.8, 2.2)]
        .map(|c| c * dvec3(1.0, -1.0, 1.0));
    rectangle("a window 2 m away, sill 1, head 2.2, 1.6 wide".to_owned(), window, 0.0415394426022, 0.8);
    let triangles = [
        (
            "Lambert's triangle",
            [dvec3(0.0, 0.0, 1.0), dvec3(1.0, 0.0, 1.0), dvec3(0.0, 1.0, 1.0)],
            0.0962250448649376,
        ),
        (
            "a tilted triangle",
            [dvec3(-1.0, -1.0, 2.0), dvec3(1.0, -1.0, 2.0), dvec3(0.0, 1.0, 3.0)],
            0.10662653456389,
        ),
    ];
    for (case, [a, b, c], factor) in triangles {
        let found = point_to_polygon(DVec3::ZERO, DVec3::Z, &[a, c, b]);
        checks.push(Check::new(case, factor, found, ROUNDING, WHY_ROUNDING).by("analytic").at("×1"));
    }
    for (a, h, r, factor) in UNDER_A_DISC {
        let seen = |about| point_to_polygon(dvec3(a, 0.0, 0.0), DVec3::Z, &circle(r, h, false, about));
        let (low, high) = (seen(false), seen(true));
        let bound = 0.5 * (high - low) / factor + 1e-9;
        let why = "between a polygon of 64 corners inside the disc and one about it; the table's digits";
        let case = format!("{a} off the axis of a disc of radius {r} at {h}");
        checks.push(Check::new(case, factor, 0.5 * (low + high), bound, why).by("analytic").at("×1"));
    }
    checks.extend(strips());
    Ok(checks)
}

/// Strips without end, by strips of 10⁴ widths.
///
/// Of what the endless ones exchange, the ends lose E|z|/L, z being how far along the strip a ray gets. Rays leave with
/// the cosine to the axis distributed so that z = r t, r the distance across and t of density (2/π)/(1 + t²)²: E|t| is
/// 2/π, and r at most the largest distance across.
fn strips() -> Vec<Check> {
    const LENGTH: f64 = 1e4;
    let strip = |foot: [f64; 2], head: [f64; 2]| {
        let at = |[x, z]: [f64; 2], y: f64| dvec3(x, y, z);
        Polygon::new(vec![at(foot, 0.0), at(head, 0.0), at(head, LENGTH), at(foot, LENGTH)])
    };
    let wedge = |degrees: f64, width: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        (strip([0.0, 0.0], [1.0, 0.0]), strip([cos * width, sin * width], [0.0, 0.0]), 1.0 + width)
    };
    let parallel = |height: f64| {
        (strip([0.0, 0.0], [1.0, 0.0]), strip([1.0, height], [0.0, height]), (1.0 + height * height).sqrt())
    };
    let cases = [
        ("perpendicular strips of equal width", wedge(90.0, 1.0), 0.292893218813),
        ("a strip and one twice as wide across it", wedge(90.0, 2.0), 0.38196601125),
        ("a strip and one a tenth as wide across it", wedge(90.0, 0.1), 0.047506218944),
        ("a wedge of 60°", wedge(60.0, 1.0), 0.5),
        ("a wedge of 30°", wedge(30.0, 1.0), 0.741180954897),
        ("a wedge of 120°", wedge(120.0, 1.0), 0.133974596216),
        ("parallel strips 1 apart", parallel(1.0), 0.414213562373),
        ("parallel strips 0.1 apart", parallel(0.1), 0.904987562112),
        ("parallel strips 0.01 apart", parallel(0.01), 0.99004999875),
    ];
    let checks = cases.into_iter().filter_map(|(case, (from, to, across), factor)| {
        let found = polygon_to_polygon(&from?, &to?, 1e-6);
        let bound = 2.0 / PI * across / LENGTH + found.error / factor;
        let why = "the ends of strips of 1e4 widths lose (2/π) r/L at most, r the largest distance across";
        Some(Check::new(case, factor, found.factor, bound, why).by("analytic").at("×1"))
    });
    checks.collect()
}
