//! What is refused, and the entrance of the straight line.

use super::*;

#[test]
fn rows_that_are_balanced_are_reciprocal_and_keep_their_sums() {
    let mut world = box_room(3, dvec3(1.0, 3.0, 0.5));
    world.add_quad(dvec3(0.5, 1.5, 0.2), DVec3::X * 0.01, DVec3::Y * 0.01, [1, 1]);
    let area = world.area();
    let rows = Method::Rays(64).rows(&world).unwrap();
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
    let ring = ring(12).unwrap();
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
        Problem::new(area, vec![grey(rho); 8], vec![grey(source); 8], ring(8).unwrap())
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
    let solve = |options: &MatrixOptions| watched(|progress| matrix::solve(&problem, options, progress));
    assert!(solve(&options(wanted)).is_ok());
    match solve(&options(wanted - 1)) {
        Err(Error::TooLarge { what, .. }) => {
            assert!(what.contains("MiB") && what.contains("54 patches"), "{what}")
        }
        other => panic!("{other:?}"),
    }
    // A million patches that all see each other: 12 TB, refused before anything is allocated.
    assert!(matrix::predicted_bytes(1_000_000, usize::MAX, Relaxation::ConjugateGradient) > 1 << 60);
    let bad = MatrixOptions { relaxation: Relaxation::Sor(2.0), ..MatrixOptions::default() };
    assert!(solve(&bad).is_err());
}

/// The straight line's entrance: both solvers, to the tolerance; a cancelled one gives what it has.
#[test]
fn solve_reaches_the_tolerance_or_stops_when_told() {
    let problem = colourful(6, 0.9);
    let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).unwrap().radiosity;
    for (solver, relaxation) in [
        (Solver::Progressive, options::Relaxation::GaussSeidel),
        (Solver::Matrix, options::Relaxation::GaussSeidel),
        (Solver::Matrix, options::Relaxation::Sor),
        (Solver::Matrix, options::Relaxation::Cg),
    ] {
        let options = SolveOptions { solver, relaxation, tolerance: 1e-4, ..Quality::Good.light().solve };
        let run = |cancelled: bool| {
            let cancel = AtomicBool::new(cancelled);
            let progress = Progress::begin(&Silent, &cancel, Stage::Solve, 1);
            solve(&problem, &options, 1 << 30, &progress).unwrap()
        };
        let solution = run(false);
        assert!(solution.unshot_fraction <= 1e-4);
        let error = distance(&problem, &solution.radiosity, &exact);
        assert!(error.cmple(solution.error_bound + 1e-9).all());
        let stopped = run(true);
        assert!(stopped.shots <= 1 && stopped.sweeps == 0);
        assert!(stopped.ledger.imbalance() < 1e-12 && stopped.unshot_fraction > 10.0 * options.tolerance);
    }
}
