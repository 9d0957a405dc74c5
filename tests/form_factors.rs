//! What form factors promise beside the closed answers of `lightkiln study stability`.

use glam::{DVec3, dvec3};
use lightkiln::study::stability::world::{Method, cube};
use lightkiln::study::stability::world::{parallel, perpendicular};
use lightkiln::study::stability::{PARALLEL, PERPENDICULAR};
use lightkiln::transport::form_factors::area::{Polygon, polygon_to_polygon};

#[test]
fn rows_repeat_to_the_bit() {
    let world = cube(2, 1.0);
    for method in [Method::Rays(4096), Method::Hemicube { resolution: 64, points: 2 }, Method::Analytic] {
        assert_eq!(method.row(&world, 5), method.row(&world, 5));
        assert_eq!(method.rows(&world).unwrap(), method.rows(&world).unwrap());
        assert!(method.row(&world, 5).weight.iter().all(|&weight| weight >= 0.0));
    }
}

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
        .chain(PERPENDICULAR.iter().map(|&(h, w, l, f)| (perpendicular(h, w, l, 0.0, 0.0), f)));
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
