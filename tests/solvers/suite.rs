//! What every solver must get right.

use super::*;

macro_rules! solver_suite {
    ($name:ident, $way:expr) => {
        mod $name {
            use super::*;

            const WAY: Way = $way;

            /// All solvers give the oracle's answer, in each channel, and what each channel alone would get.
            #[test]
            fn a_colourful_room_agrees_with_the_oracle() {
                let problem = colourful(4, 0.9);
                let expected = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).unwrap();
                let found = WAY.solve(&problem).unwrap();
                for (found, expected) in found.radiosity.iter().zip(&expected.radiosity) {
                    // Balanced rows are reciprocal to the rounding of f32, and ways that use reciprocity differ by it.
                    assert_close(*found, *expected, 1e-6, "patch");
                }
                for channel in [DVec3::X, DVec3::Y, DVec3::Z] {
                    let alone = |values: &[DVec3]| values.iter().map(|value| *value * channel).collect();
                    let (rho, source) = (alone(problem.reflectance()), alone(problem.source()));
                    let alone = WAY.solve(&problem.clone().relit(rho, source).unwrap()).unwrap();
                    for (alone, all) in alone.radiosity.iter().zip(&found.radiosity) {
                        assert!(((*alone - *all) * channel).length() < 1e-9, "{alone} {all}");
                    }
                }
            }

            /// Twice the light is twice the result, to the bit for powers of two.
            #[test]
            fn light_is_linear() {
                let problem = colourful(3, 0.8);
                let once = WAY.solve(&problem).unwrap();
                let scale = 2f64.powi(27);
                let bright = problem.source().iter().map(|source| *source * scale).collect();
                let bright = WAY
                    .solve(&problem.clone().relit(problem.reflectance().to_vec(), bright).unwrap())
                    .unwrap();
                for (once, bright) in once.radiosity.iter().zip(&bright.radiosity) {
                    assert_eq!(*once * scale, *bright);
                }
                let mut numbers = Numbers(77);
                let other: Vec<_> = problem.source().iter().map(|_| numbers.colour()).collect();
                let both = problem.source().iter().zip(&other).map(|(a, b)| *a + *b).collect();
                let rho = problem.reflectance().to_vec();
                let other = WAY.solve(&problem.clone().relit(rho.clone(), other).unwrap()).unwrap();
                let both = WAY.solve(&problem.clone().relit(rho, both).unwrap()).unwrap();
                for i in 0..problem.len() {
                    let sum = once.radiosity[i] + other.radiosity[i];
                    assert_close(both.radiosity[i], sum, 1e-9, "sum of lights");
                }
            }

            /// Nothing reflects: b = s at once, and what arrives is one gather.
            #[test]
            fn black_walls_end_it() {
                let problem = colourful(3, 0.0);
                let solution = WAY.solve(&problem).unwrap();
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
                open.truncate(5);
                let rows = Method::Rays(256).rows(&open).unwrap().balanced(&open.area()).unwrap();
                let source: Vec<_> = (0..open.len()).map(|i| dvec3(1.0, i as f64, 0.5)).collect();
                let rho = vec![dvec3(0.2, 0.7, 1.0); open.len()];
                let problem = Problem::new(open.area(), rho, source, rows).unwrap();
                let solution = WAY.solve(&problem).unwrap();
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
                    Problem::new(vec![1.0; 8], vec![grey(0.9); 8], vec![grey(0.0); 8], ring(8).unwrap())
                        .unwrap();
                let solution = WAY.solve(&dark).unwrap();
                assert!(solution.radiosity.iter().all(|b| *b == DVec3::ZERO));
                assert_eq!((solution.unshot_fraction, solution.ledger.imbalance()), (0.0, 0.0));
                let empty = Problem::new(vec![], vec![], vec![], Rows::new([]).unwrap()).unwrap();
                assert!(WAY.solve(&empty).unwrap().radiosity.is_empty());
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
