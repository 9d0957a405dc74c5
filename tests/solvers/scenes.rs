//! Places whose light is known from elsewhere.

use super::*;

/// Khodulev's cube: 10 m, ρ = 2/3, a lamp of 50,000 cd in the middle. Total illuminance at face coordinates, by
/// collocation and extrapolation to ± 0.01 lx; the mean is 1000 π exactly.
#[test]
fn a_point_light_in_a_cube() {
    // Cells whose centres lie at 0, ±0.4 and ±0.8.
    let n = 15;
    let world = cube(n, 10.0);
    let (rho, intensity) = (2.0 / 3.0, 50_000.0);
    let area = world.area();
    // Flux into a patch: the intensity times its solid angle, which is 2π times what a half-space would gather.
    let lamp = DVec3::splat(5.0);
    let direct: Vec<f64> =
        world.polygons.iter().map(|p| intensity * solid_angle(lamp, p.corners()) / p.area()).collect();
    let source = direct.iter().map(|e| grey(rho * e)).collect();
    let problem =
        Problem::new(area.clone(), vec![grey(rho); world.len()], source, Method::Rays(256).rows(&world))
            .unwrap();
    let solution = Way::Sweeps.solve(&problem);
    let total = |i: usize| direct[i] + solution.received[i].x;
    let mean = (0..world.len()).map(|i| total(i) * area[i]).sum::<f64>() / 600.0;
    // Sampling makes rows reciprocal on average: a few 10⁻⁴ of the energy, and the ledger knows it.
    let known = solution.ledger.sampling.x / solution.ledger.emitted.x;
    assert!(
        (mean / (1000.0 * std::f64::consts::PI) - 1.0).abs() < 3.0 * known.abs() + 1e-9,
        "{mean} {known}"
    );
    assert!(known.abs() < 2e-3, "{known}");
    for (x, y, expected) in [
        (0.0, 0.0, 4207.21),
        (0.4, 0.0, 3798.40),
        (0.4, 0.4, 3494.72),
        (0.8, 0.0, 3095.55),
        (0.8, 0.4, 2920.36),
        (0.8, 0.8, 2514.77),
    ] {
        // All places on the six faces that are alike: 6 to 48, whose noise averages out.
        let cell = |at: f64| ((at + 1.0) * 0.5 * f64::from(n)) as u32;
        let mut sum = (0.0, 0.0);
        for face in 0..6 {
            for (u, v) in [(x, y), (y, x)] {
                for signs in 0..4 {
                    let (u, v) = (if signs & 1 == 0 { u } else { -u }, if signs & 2 == 0 { v } else { -v });
                    let patch = (face * n * n + cell(u) + n * cell(v)) as usize;
                    let lit = intensity * 5.0 / (25.0 * (1.0 + u * u + v * v)).powf(1.5);
                    sum = (sum.0 + lit + solution.received[patch].x, sum.1 + 1.0);
                }
            }
        }
        // Indirect light here varies by 1/4 over half a face: h²/24 of its curvature is 0.05 %; a row of 256 rays is
        // off by 256^−0.625 = 3 % of the light's relative deviation (0.3), over √6 places at least.
        let found = sum.0 / sum.1;
        assert!((found / expected - 1.0).abs() < 6e-3, "({x}, {y}): {found}, not {expected}");
    }
}

/// Solid angle of a convex polygon, as a sum of triangles (van Oosterom & Strackee 1983).
fn solid_angle(from: DVec3, corners: &[DVec3]) -> f64 {
    let unit: Vec<DVec3> = corners.iter().map(|corner| (*corner - from).normalize()).collect();
    (1..unit.len() - 1)
        .map(|i| {
            let (a, b, c) = (unit[0], unit[i], unit[i + 1]);
            2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
        })
        .sum()
}

/// Inside a sphere every patch receives the same, H = mean(s)/(1 − mean ρ), whatever is where: b = s + ρH. Facets
/// make it so up to h².
#[test]
fn an_integrating_sphere_is_uniform() {
    let mut off = vec![];
    // Facets cover h²/8 of their radius less than the sphere.
    for (n, facet) in [(3, 0.038), (6, 0.009)] {
        let mut world = World::default();
        sphere(&mut world, 1.0, n, true);
        let area = world.area();
        let upper = |i: usize| world.polygons[i].corners().iter().sum::<DVec3>().z > 0.0;
        let rho =
            (0..world.len()).map(|i| if upper(i) { dvec3(0.8, 0.9, 0.0) } else { dvec3(0.2, 0.5, 0.0) });
        let rho: Vec<DVec3> = rho.collect();
        let source: Vec<_> = (0..world.len())
            .map(|i| if upper(i) { dvec3(1.0, 0.0, 1.0) } else { dvec3(0.0, 1.0, 1.0) })
            .collect();
        let problem = Problem::new(area.clone(), rho, source, Method::Rays(1024).rows(&world)).unwrap();
        let received = Way::Sweeps.solve(&problem).received;
        let total: f64 = area.iter().sum();
        let expected = dvec3(1.0, 5.0 / 3.0, 1.0);
        let mean = received.iter().zip(&area).map(|(e, a)| *e * (a / total)).sum::<DVec3>();
        let spread = received
            .iter()
            .zip(&area)
            .map(|(e, a)| (*e - expected).abs() / expected * (a / total))
            .sum::<DVec3>();
        assert_close(mean, expected, facet, "mean irradiance");
        off.push(spread.max_element());
    }
    // Facets 0.55 and 0.27 across, and rays to 1024^−0.625 = 1.3 %.
    assert!(off[0] < 0.05 && off[1] < 0.022 && off[1] < off[0], "{off:?}");
}
