//! What every solver must get right.

use super::*;

macro_rules! solver_suite {
    ($name:ident, $way:expr) => {
        mod $name {
            use super::*;

            const WAY: Way = $way;

            /// b = e/(1 − ρ), everywhere.
            #[test]
            fn a_white_furnace_is_uniform() {
                for rho in [0.0, 0.5, 0.8, 0.9, 0.99, 0.999] {
                    let (area, emitted) = (vec![2.0; 24], vec![dvec3(1.0, 0.0, 4.0); 24]);
                    let problem = Problem::new(area, vec![grey(rho); 24], emitted, ring(24)).unwrap();
                    let solution = WAY.solve(&problem);
                    for b in &solution.radiosity {
                        // What is unshot of 10⁻¹² still grows by 1/(1 − ρ).
                        assert_close(*b, dvec3(1.0, 0.0, 4.0) / (1.0 - rho), 1e-9, &format!("ρ = {rho}"));
                    }
                }
            }

            /// Of any closed scene of one reflectance: mean b = mean s/(1 − ρ).
            #[test]
            fn the_mean_of_a_closed_room_needs_no_solver() {
                let mut numbers = Numbers(5);
                let source: Vec<_> = (0..40).map(|_| numbers.colour()).collect();
                let mean = source.iter().sum::<DVec3>() / 40.0;
                let problem = Problem::new(vec![0.5; 40], vec![grey(0.8); 40], source, ring(40)).unwrap();
                let found = WAY.solve(&problem).radiosity.iter().sum::<DVec3>() / 40.0;
                assert_close(found, mean / 0.2, 1e-10, "mean");
            }

            /// Two unit squares at distance 1: b₁ = 1/(1 − ρ²F²), b₂ = ρFb₁. At ρ = 1 the room is open enough.
            #[test]
            fn two_plates() {
                let world = radiosity::parallel(1.0, 1.0, 1.0, [0.0; 2]);
                for (rho, b1, b2) in [
                    (0.5, 1.01008315227, 0.100919880275),
                    (0.8, 1.02622538777, 0.164052304859),
                    (1.0, 1.04159070535, 1.04159070535 * 0.199824895698387),
                ] {
                    let source = vec![grey(1.0), grey(0.0)];
                    let problem =
                        Problem::new(vec![1.0; 2], vec![grey(rho); 2], source, analytic(&world)).unwrap();
                    let b = WAY.solve(&problem).radiosity;
                    // Kept rows are f32.
                    assert_close(b[0], grey(b1), 1e-7, &format!("first plate, ρ = {rho}"));
                    assert_close(b[1], grey(b2), 1e-7, &format!("second plate, ρ = {rho}"));
                }
            }

            /// Six patches, one of which emits.
            #[test]
            fn the_faces_of_a_cube() {
                let world = cube(1, 1.0);
                for (rho, own, opposite, side) in [
                    (0.5, 1.09090909811, 0.181745826108, 0.181836268946),
                    (0.8, 1.55172415364, 0.689551070738, 0.689681193904),
                ] {
                    let mut source = vec![grey(0.0); 6];
                    source[0] = grey(1.0);
                    let problem =
                        Problem::new(vec![1.0; 6], vec![grey(rho); 6], source, analytic(&world)).unwrap();
                    let b = WAY.solve(&problem).radiosity;
                    for (face, expected) in [own, opposite, side, side, side, side].into_iter().enumerate() {
                        // Kept rows are f32; their rounding grows by 1/(1 − ρ).
                        assert_close(
                            b[face],
                            grey(expected),
                            6e-8 / (1.0 - rho),
                            &format!("face {face}, ρ = {rho}"),
                        );
                    }
                }
            }

            /// F₁₂ = 1, F₂₁ = (r₁/r₂)², F₂₂ = 1 − F₂₁.
            #[test]
            fn concentric_spheres() {
                for (outer, source, rho, expected) in [
                    (2.0, [1.0, 0.0], [0.5, 0.5], [1.1111111111, 0.2222222222]),
                    (2.0, [1.0, 0.0], [0.8, 0.3], [1.08391608, 0.10489510]),
                    (10.0, [0.0, 1.0], [0.5, 0.9], [4.78468900, 9.56937799]),
                ] {
                    let back = 1.0 / f64::from(outer) / f64::from(outer);
                    let make = |patch: usize, row: &mut Row| {
                        let factors: &[(u32, f64)] =
                            if patch == 0 { &[(1, 1.0)] } else { &[(0, back), (1, 1.0 - back)] };
                        (row.column, row.weight) = factors.iter().copied().unzip();
                        row.miss = 0.0;
                    };
                    let area = vec![1.0, f64::from(outer) * f64::from(outer)];
                    let problem = Problem::new(
                        area,
                        rho.map(grey).to_vec(),
                        source.map(grey).to_vec(),
                        Made::new(2, make),
                    )
                    .unwrap();
                    let b = WAY.solve(&problem).radiosity;
                    for i in 0..2 {
                        assert_close(b[i], grey(expected[i]), 2e-7, &format!("sphere {i}, radius {outer}"));
                    }
                }
            }

            /// All solvers give the oracle's answer, in each channel, and what each channel alone would get.
            #[test]
            fn a_colourful_room_agrees_with_the_oracle() {
                let problem = colourful(4, 0.9);
                let expected = Way::Matrix(Relaxation::GaussSeidel).solve(&problem);
                let found = WAY.solve(&problem);
                for (found, expected) in found.radiosity.iter().zip(&expected.radiosity) {
                    // Balanced rows are reciprocal to the rounding of f32, and ways that use reciprocity differ by it.
                    assert_close(*found, *expected, 1e-6, "patch");
                }
                for channel in [DVec3::X, DVec3::Y, DVec3::Z] {
                    let alone = |values: &[DVec3]| values.iter().map(|value| *value * channel).collect();
                    let (rho, source) = (alone(problem.reflectance()), alone(problem.source()));
                    let alone = WAY.solve(&problem.clone().relit(rho, source).unwrap());
                    for (alone, all) in alone.radiosity.iter().zip(&found.radiosity) {
                        assert!(((*alone - *all) * channel).length() < 1e-9, "{alone} {all}");
                    }
                }
            }

            /// Twice the light is twice the result, to the bit for powers of two.
            #[test]
            fn light_is_linear() {
                let problem = colourful(3, 0.8);
                let once = WAY.solve(&problem);
                let scale = 2f64.powi(27);
                let bright = problem.source().iter().map(|source| *source * scale).collect();
                let bright =
                    WAY.solve(&problem.clone().relit(problem.reflectance().to_vec(), bright).unwrap());
                for (once, bright) in once.radiosity.iter().zip(&bright.radiosity) {
                    assert_eq!(*once * scale, *bright);
                }
                let mut numbers = Numbers(77);
                let other: Vec<_> = problem.source().iter().map(|_| numbers.colour()).collect();
                let both = problem.source().iter().zip(&other).map(|(a, b)| *a + *b).collect();
                let rho = problem.reflectance().to_vec();
                let other = WAY.solve(&problem.clone().relit(rho.clone(), other).unwrap());
                let both = WAY.solve(&problem.clone().relit(rho, both).unwrap());
                for i in 0..problem.len() {
                    let sum = once.radiosity[i] + other.radiosity[i];
                    assert_close(both.radiosity[i], sum, 1e-9, "sum of lights");
                }
            }

            /// Nothing reflects: b = s at once, and what arrives is one gather.
            #[test]
            fn black_walls_end_it() {
                let problem = colourful(3, 0.0);
                let solution = WAY.solve(&problem);
                assert_eq!(solution.radiosity, problem.source());
                assert!(solution.shots <= problem.len() as u64 && solution.sweeps <= 2, "{}", solution.shots);
                assert_eq!(solution.error_bound, DVec3::ZERO);
                let ledger = solution.ledger;
                assert_close(ledger.absorbed, ledger.emitted, 1e-7, "all is absorbed");
            }

            /// emitted = absorbed + escaped + unshot, and what escapes is what the open side lets out.
            #[test]
            fn energy_is_conserved_in_an_open_room() {
                let mut open = box_room(3, dvec3(1.0, 2.0, 0.7));
                open.surfaces.truncate(5);
                open.polygons.truncate(45);
                let rows = Method::Rays(256).rows(&open).balanced(&open.area()).unwrap();
                let source: Vec<_> = (0..open.len()).map(|i| dvec3(1.0, i as f64, 0.5)).collect();
                let rho = vec![dvec3(0.2, 0.7, 1.0); open.len()];
                let problem = Problem::new(open.area(), rho, source, rows).unwrap();
                let solution = WAY.solve(&problem);
                let ledger = solution.ledger;
                assert!(ledger.imbalance() < 1e-10, "{ledger:?}");
                assert!(
                    ledger.sampling.abs().max_element() < 1e-6 * ledger.emitted.max_element(),
                    "{ledger:?}"
                );
                let escaped: DVec3 = (0..problem.len())
                    .map(|i| solution.radiosity[i] * problem.area()[i] * f64::from(problem.rows().miss()[i]))
                    .sum();
                assert_close(ledger.escaped, escaped, 1e-6, "escaped");
                // A white room loses its light through the opening alone.
                assert_eq!(ledger.absorbed.z, 0.0);
            }

            #[test]
            fn there_may_be_no_light_and_no_patch() {
                let dark =
                    Problem::new(vec![1.0; 8], vec![grey(0.9); 8], vec![grey(0.0); 8], ring(8)).unwrap();
                let solution = WAY.solve(&dark);
                assert!(solution.radiosity.iter().all(|b| *b == DVec3::ZERO));
                assert_eq!((solution.unshot_fraction, solution.ledger.imbalance()), (0.0, 0.0));
                let empty = Problem::new(vec![], vec![], vec![], Rows::new([]).unwrap()).unwrap();
                assert!(WAY.solve(&empty).radiosity.is_empty());
            }

            /// One patch of 0.999 among dark ones, areas of 1 : 10⁸, an emitter of 10⁸.
            #[test]
            fn extremes_stay_finite_and_balanced() {
                let make = |patch: usize, row: &mut Row| {
                    row.column = vec![1 - patch as u32];
                    row.weight = vec![if patch == 0 { 1.0 } else { 1e-8 }];
                    row.miss = 1.0 - row.weight[0];
                };
                let rho = vec![grey(0.999), grey(0.999)];
                let source = vec![grey(1e8), grey(0.0)];
                let problem = Problem::new(vec![1e-8, 1.0], rho, source, Made::new(2, make)).unwrap();
                let solution = WAY.solve(&problem);
                let b1 = 1e8 / (1.0 - 0.999 * 0.999 * 1e-8);
                assert_close(solution.radiosity[0], grey(b1), 1e-9, "emitter");
                assert_close(solution.radiosity[1], grey(0.999 * 1e-8 * b1), 1e-7, "receiver");
                assert!(solution.ledger.imbalance() < 1e-10);
            }
        }
    };
}

solver_suite!(shots, Way::Shots);
solver_suite!(plain_shots, Way::PlainShots);
solver_suite!(sweeps, Way::Sweeps);
solver_suite!(remade_shots, Way::RemadeShots);
solver_suite!(remade_sweeps, Way::RemadeSweeps);
solver_suite!(jacobi, Way::Matrix(Relaxation::Jacobi));
solver_suite!(gauss_seidel, Way::Matrix(Relaxation::GaussSeidel));
solver_suite!(over_relaxation, Way::Matrix(Relaxation::Sor(1.2)));
solver_suite!(conjugate_gradient, Way::Matrix(Relaxation::ConjugateGradient));
