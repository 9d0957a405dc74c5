//! Every solver against closed answers: one suite for all of them.

mod radiosity;

use glam::{DVec3, dvec3};
use lightkiln::Error;
use lightkiln::options::{Quality, SolveOptions, Solver};
use lightkiln::progress::{Progress, Silent, Stage};
use lightkiln::solve::matrix::{self, MatrixOptions};
use lightkiln::solve::{Made, Problem, Progressive, Relaxation, RowSource, Rows, Solution, solve};
use lightkiln::transport::form_factors::Row;
use radiosity::{Method, World, box_room, cube, grey, sphere};
use std::sync::atomic::AtomicBool;

/// Where every solver stops, as a share of the power that is to be distributed.
const TOLERANCE: f64 = 1e-12;

/// The ways to a solution.
#[derive(Clone, Copy, Debug)]
enum Way {
    Shots,
    PlainShots,
    Sweeps,
    RemadeShots,
    RemadeSweeps,
    Matrix(Relaxation),
}

impl Way {
    fn solve<R: RowSource>(self, problem: &Problem<R>) -> Solution {
        let kept = || {
            let rows = Rows::collect(problem.rows()).unwrap();
            let (area, rho, source) = (problem.area(), problem.reflectance(), problem.source());
            Problem::new(area.to_vec(), rho.to_vec(), source.to_vec(), rows).unwrap()
        };
        match self {
            Self::Shots => shoot(Progressive::new(&kept())),
            Self::PlainShots => shoot(Progressive::new(&kept()).without_overshooting()),
            Self::RemadeShots => shoot(Progressive::remaking(problem)),
            Self::Sweeps => sweep(Progressive::new(&kept())),
            Self::RemadeSweeps => sweep(Progressive::remaking(problem)),
            Self::Matrix(relaxation) => matrix::solve(
                problem,
                &MatrixOptions {
                    relaxation,
                    tolerance: TOLERANCE,
                    max_sweeps: 100_000,
                    ..MatrixOptions::default()
                },
            )
            .unwrap(),
        }
    }
}

fn shoot<T: lightkiln::solve::Transfer>(mut solver: Progressive<T>) -> Solution {
    for _ in 0..2_000_000 {
        let report = solver.step();
        if report.unshot_fraction <= TOLERANCE || report.shooter.is_none() {
            break;
        }
    }
    solver.solution()
}

fn sweep<T: lightkiln::solve::Transfer + Sync>(mut solver: Progressive<T>) -> Solution {
    for _ in 0..20_000 {
        if solver.sweep().unshot_fraction <= TOLERANCE {
            break;
        }
    }
    solver.solution()
}

/// n patches of equal area on a ring, each of which sees its neighbours in shares of 1/64: reciprocal, closed, and
/// exact in f32.
fn ring(patches: u32) -> Rows {
    let counts = [0u32, 20, 9, 3];
    let hits: Vec<Vec<(u32, u32)>> = (0..patches)
        .map(|i| {
            let neighbour =
                |step: u32, count| [((i + step) % patches, count), ((i + patches - step) % patches, count)];
            (1..4).flat_map(|step| neighbour(step, counts[step as usize])).collect()
        })
        .collect();
    Rows::from_counts(64, &hits, &vec![0; patches as usize]).unwrap()
}

/// Numbers in `[0, 1)`, the same at every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn colour(&mut self) -> DVec3 {
        dvec3(self.next(), self.next(), self.next())
    }
}

/// A cube whose patches have colours and lights of their own, on rows from rays that are made reciprocal.
fn colourful(n: u32, brightest: f64) -> Problem {
    let world = cube(n, 2.0);
    let mut numbers = Numbers(9);
    let rows = Method::Rays(64).rows(&world).balanced(&world.area()).unwrap();
    let rho = (0..world.len()).map(|_| numbers.colour() * brightest).collect();
    let source = (0..world.len()).map(|_| numbers.colour() * numbers.next().powi(4)).collect();
    Problem::new(world.area(), rho, source, rows).unwrap()
}

/// Exact form factors between the surfaces of a world without occlusion, in f64.
fn analytic(world: &World) -> impl RowSource {
    Method::Analytic.source(world)
}

fn assert_close(found: DVec3, expected: DVec3, relative: f64, what: &str) {
    assert!(
        (found - expected).abs().max_element() <= relative * expected.max_element(),
        "{what}: {found}, not {expected}"
    );
}

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

/// Σ A |a − b| per channel.
fn distance(problem: &Problem, a: &[DVec3], b: &[DVec3]) -> DVec3 {
    (0..a.len()).map(|i| (a[i] - b[i]).abs() * problem.area()[i]).sum()
}

/// At every single step, with every kind of row.
#[test]
fn the_ledger_closes_at_every_step() {
    let sampled = {
        let world = cube(4, 2.0);
        let problem = colourful(4, 0.9);
        let rows = Method::Rays(64).rows(&world);
        Problem::new(world.area(), problem.reflectance().to_vec(), problem.source().to_vec(), rows).unwrap()
    };
    for problem in [colourful(4, 0.9), sampled] {
        for overshoot in [true, false] {
            let mut solver = Progressive::new(&problem);
            if !overshoot {
                solver = solver.without_overshooting();
            }
            for step in 0..400 {
                let report = solver.step();
                let ledger = solver.ledger();
                assert!(ledger.imbalance() < 1e-12, "step {step}: {ledger:?}");
                assert!(report.unshot_power.is_finite());
            }
            for _ in 0..5 {
                solver.sweep();
                assert!(solver.ledger().imbalance() < 1e-12, "{:?}", solver.ledger());
                solver.step();
                assert!(solver.ledger().imbalance() < 1e-12, "{:?}", solver.ledger());
            }
            // B = s + ρE, with E = F(B − u): the state is what it says it is.
            let solution = solver.solution();
            for i in 0..problem.len() {
                let b = problem.source()[i] + problem.reflectance()[i] * solution.received[i];
                assert_close(solution.radiosity[i], b, 1e-12, "radiosity");
            }
        }
    }
}

/// Reciprocal rows: a plain shot hands on at most what it takes, so |unshot| never rises.
#[test]
fn without_overshooting_the_unshot_power_falls_from_shot_to_shot() {
    let problem = colourful(5, 0.95);
    let mut solver = Progressive::new(&problem).without_overshooting();
    let mut before = f64::INFINITY;
    for step in 0..3000 {
        let unshot = solver.step().unshot_power;
        assert!(unshot <= before * (1.0 + 1e-7), "step {step}: {before} to {unshot}");
        before = unshot;
    }
}

/// The measured rates of the research notes, roughly: after as many shots as patches, plain shooting still misses a
/// fifth of the light at a mean reflectance of 0.7 and half of it at 0.87, ambient overshooting a tenth of that.
#[test]
fn overshooting_pays() {
    for (rho, plain_misses, ambient_misses) in [(0.7, [0.1, 0.4], 0.04), (0.87, [0.3, 0.65], 0.12)] {
        let problem = colourful(8, 0.5);
        let count = problem.len();
        // One bright corner.
        let mut source = vec![grey(0.0); count];
        source[..5].fill(grey(1.0));
        let problem = problem.relit(vec![grey(rho); count], source).unwrap();
        let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).radiosity;
        let total: DVec3 = distance(&problem, &exact, &vec![DVec3::ZERO; count]);
        let missing = |mut solver: Progressive<_>, shots: usize| {
            for _ in 0..shots {
                solver.step();
            }
            (distance(&problem, &solver.radiosity(), &exact) / total).x
        };
        let plain = missing(Progressive::new(&problem).without_overshooting(), count);
        let ambient = missing(Progressive::new(&problem), count);
        assert!(plain > plain_misses[0] && plain < plain_misses[1], "ρ = {rho}: plain {plain}");
        assert!(ambient < ambient_misses && ambient < plain / 4.0, "ρ = {rho}: ambient {ambient}");
        let later = missing(Progressive::new(&problem), 4 * count);
        assert!(later < ambient / 10.0, "ρ = {rho}: after four times as many {later}");
        let mut swept = Progressive::new(&problem);
        for _ in 0..4 {
            swept.sweep();
        }
        let swept = (distance(&problem, &swept.radiosity(), &exact) / total).x;
        assert!(swept < ambient / 5.0, "ρ = {rho}: four sweeps {swept}");
    }
}

/// The ambient estimate makes the early picture better than it is without.
#[test]
fn the_display_estimate_is_nearer_than_the_bare_solution() {
    let problem = colourful(6, 0.9);
    let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).radiosity;
    let mut solver = Progressive::new(&problem).without_overshooting();
    for _ in 0..problem.len() / 2 {
        solver.step();
    }
    let bare = distance(&problem, &solver.radiosity(), &exact).element_sum();
    let display = distance(&problem, &solver.display(), &exact).element_sum();
    assert!(display < 0.5 * bare, "{display} {bare}");
}

/// At every stage, for kept and remade rows; and in a furnace it is no more than the truth.
#[test]
fn the_error_bound_holds() {
    let problem = colourful(4, 0.95);
    let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).radiosity;
    let check = |solution: &Solution, slack: f64, what: &str| {
        let error = distance(&problem, &solution.radiosity, &exact);
        let rounding = 1e-9 * solution.ledger.emitted;
        assert!(
            error.cmple(solution.error_bound + rounding).all(),
            "{what}: {error} > {}",
            solution.error_bound
        );
        let bound = solution.error_bound.cmple(error * slack + rounding);
        assert!(bound.all(), "{what}: {} is {slack} times more than {error}", solution.error_bound);
    };
    let (mut plain, mut ambient) =
        (Progressive::new(&problem).without_overshooting(), Progressive::new(&problem));
    let mut remade = Progressive::remaking(&problem);
    for shots in 0..800 {
        if shots % 50 == 0 {
            check(&plain.solution(), 3.0, &format!("plain, {shots} shots"));
            // Signs cancel in the truth, not in the bound.
            check(&ambient.solution(), 300.0, &format!("ambient, {shots} shots"));
            check(&remade.solution(), 1e4, &format!("remade, {shots} shots"));
        }
        plain.step();
        ambient.step();
        remade.step();
    }
    let source = problem.source().to_vec();
    let furnace = problem.clone().relit(vec![grey(0.9); problem.len()], source).unwrap();
    let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&furnace).radiosity;
    let solution = Progressive::new(&furnace).solution();
    let error = distance(&furnace, &solution.radiosity, &exact);
    assert_close(solution.error_bound, error, 1e-5, "furnace");
}

/// Sampled rows of a real place: the same rays kept or traced again give the same solution, and any number of threads
/// the same bits.
#[test]
fn kept_and_remade_rows_agree_and_threads_change_nothing() {
    let world = cube(6, 1.0);
    let mut numbers = Numbers(3);
    let rho: Vec<_> = (0..world.len()).map(|_| numbers.colour() * 0.9).collect();
    let source: Vec<_> = (0..world.len()).map(|_| numbers.colour()).collect();
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let kept = Problem::new(world.area(), rho.clone(), source.clone(), Method::Rays(64).rows(&world))
                .unwrap();
            let remade =
                Problem::new(world.area(), rho.clone(), source.clone(), Method::Rays(64).source(&world))
                    .unwrap();
            let (mut a, mut b) = (Progressive::new(&kept), Progressive::remaking(&remade));
            for _ in 0..40 {
                a.sweep();
                b.sweep();
            }
            let shots = Way::Shots.solve(&kept).radiosity;
            let oracle = Way::Matrix(Relaxation::ConjugateGradient).solve(&kept).radiosity;
            (a.radiosity(), b.radiosity(), shots, oracle)
        })
    };
    let one = with_threads(1);
    assert!(one == with_threads(3), "another number of threads gave other bits");
    for (kept, remade) in one.0.iter().zip(&one.1) {
        assert_close(*kept, *remade, 1e-13, "kept and remade");
    }
}

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

/// Light in one room, none in the next: overshooting must not guess any into it.
#[test]
fn a_room_without_light_stays_dark_at_every_step() {
    let (lit, dark) = (ring(16), ring(16));
    let mut row = Row::default();
    let rows = Rows::new((0..32).map(|i| {
        (if i < 16 { &lit } else { &dark }).row(i % 16, &mut row);
        row.column.iter_mut().for_each(|column| *column += 16 * (i as u32 / 16));
        row.clone()
    }))
    .unwrap();
    let mut source = vec![grey(0.0); 32];
    source[3] = grey(1.0);
    let problem = Problem::new(vec![1.0; 32], vec![grey(0.9); 32], source, rows).unwrap();
    let mut solver = Progressive::new(&problem);
    for _ in 0..300 {
        solver.step();
        assert!(solver.radiosity()[16..].iter().chain(&solver.display()[16..]).all(|b| *b == DVec3::ZERO));
    }
    solver.sweep();
    assert!(solver.solution().radiosity[16..].iter().all(|b| *b == DVec3::ZERO));
    assert!(solver.solution().radiosity[..16].iter().all(|b| b.x > 0.01));
}

#[test]
fn rows_that_are_balanced_are_reciprocal_and_keep_their_sums() {
    let mut world = box_room(3, dvec3(1.0, 3.0, 0.5));
    world.add_quad(dvec3(0.5, 1.5, 0.2), DVec3::X * 0.01, DVec3::Y * 0.01, [1, 1]);
    let area = world.area();
    let rows = Method::Rays(64).rows(&world);
    let balanced = rows.balanced(&area).unwrap();
    let factor = |i: usize, j: usize| {
        let (column, weight) = balanced.patch(i);
        column.binary_search(&(j as u32)).map_or(0.0, |at| f64::from(weight[at]))
    };
    for i in 0..world.len() {
        assert!(
            (balanced.sum(i) - rows.sum(i)).abs() < 1e-6,
            "patch {i}: {} {}",
            balanced.sum(i),
            rows.sum(i)
        );
        for j in 0..world.len() {
            let (there, back) = (area[i] * factor(i, j), area[j] * factor(j, i));
            assert!((there - back).abs() <= 1e-6 * there.max(back), "{i} {j}: {there} {back}");
        }
    }
    // Rows that are reciprocal already stay.
    let ring = ring(12);
    let again = ring.balanced(&[1.0; 12]).unwrap();
    for i in 0..12 {
        for (a, b) in ring.patch(i).1.iter().zip(again.patch(i).1) {
            assert!((a - b).abs() < 1e-7);
        }
    }
}

#[test]
fn a_closed_white_room_is_refused_and_so_is_nonsense() {
    let area = vec![1.0; 8];
    let make = |rho: f64, source: f64, area: Vec<f64>| {
        Problem::new(area, vec![grey(rho); 8], vec![grey(source); 8], ring(8))
    };
    assert!(make(0.999, 1.0, area.clone()).is_ok());
    for (rho, source, area, word) in [
        (1.0, 1.0, area.clone(), "steady state"),
        (1.1, 1.0, area.clone(), "reflectance"),
        (-0.1, 1.0, area.clone(), "reflectance"),
        (f64::NAN, 1.0, area.clone(), "reflectance"),
        (0.5, f64::INFINITY, area.clone(), "source"),
        (0.5, -1.0, area.clone(), "source"),
        (0.5, 1.0, vec![0.0; 8], "area"),
        (0.5, 1.0, vec![f64::NAN; 8], "area"),
        (0.5, 1.0, vec![1.0; 7], "different numbers"),
    ] {
        let error = make(rho, source, area).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn a_matrix_that_does_not_fit_is_refused_with_its_size() {
    let problem = colourful(3, 0.5);
    let wanted = matrix::predicted_bytes(problem.len(), problem.rows().entries(), Relaxation::GaussSeidel);
    let options = |memory_bytes| MatrixOptions { memory_bytes, ..MatrixOptions::default() };
    assert!(matrix::solve(&problem, &options(wanted)).is_ok());
    match matrix::solve(&problem, &options(wanted - 1)) {
        Err(Error::TooLarge { what, .. }) => {
            assert!(what.contains("MiB") && what.contains("54 patches"), "{what}")
        }
        other => panic!("{other:?}"),
    }
    // A million patches that all see each other: 12 TB, refused before anything is allocated.
    assert!(matrix::predicted_bytes(1_000_000, usize::MAX, Relaxation::ConjugateGradient) > 1 << 60);
    let bad = MatrixOptions { relaxation: Relaxation::Sor(2.0), ..MatrixOptions::default() };
    assert!(matrix::solve(&problem, &bad).is_err());
}

/// The straight line's entrance: both solvers, to the tolerance; a cancelled one gives what it has.
#[test]
fn solve_reaches_the_tolerance_or_stops_when_told() {
    let problem = colourful(6, 0.9);
    let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).radiosity;
    for solver in [Solver::Progressive, Solver::Matrix] {
        let options = SolveOptions { solver, tolerance: 1e-4, ..Quality::Good.light().solve };
        let run = |cancelled: bool| {
            let cancel = AtomicBool::new(cancelled);
            solve(&problem, &options, &Progress::begin(&Silent, &cancel, Stage::Solve, 1)).unwrap()
        };
        let solution = run(false);
        assert!(solution.unshot_fraction <= 1e-4);
        let error = distance(&problem, &solution.radiosity, &exact);
        assert!(error.cmple(solution.error_bound + 1e-9).all());
        if solver == Solver::Progressive {
            let stopped = run(true);
            assert!(stopped.shots <= 1 && stopped.sweeps == 0);
            assert!(stopped.ledger.imbalance() < 1e-12 && stopped.unshot_fraction > 0.5);
        }
    }
}
