//! What holds after every step of every solver, and what must not matter to any.

use super::*;

/// Sampled rows as they come, balanced ones, hemicubes, closed forms; closed and open rooms.
fn problems() -> Vec<(&'static str, Problem)> {
    let mut numbers = Numbers(21);
    let mut of = |world: &lightkiln::study::stability::world::World, rows: Rows| {
        let rho = (0..world.len()).map(|_| numbers.colour() * 0.95).collect();
        let source = (0..world.len()).map(|_| numbers.colour()).collect();
        Problem::new(world.area(), rho, source, rows).unwrap()
    };
    let closed = box_room(3, dvec3(1.0, 2.0, 0.7));
    let mut open = closed.clone();
    open.truncate(5);
    let hemicube = Method::Hemicube { resolution: 16, points: 1 };
    let rays = Method::Rays(64).rows(&closed).unwrap();
    let balanced = rays.balanced(&closed.area()).unwrap();
    vec![
        ("rays", of(&closed, rays)),
        ("balanced rays", of(&closed, balanced)),
        ("hemicubes", of(&closed, hemicube.rows(&closed).unwrap())),
        ("closed forms", of(&closed, Method::Analytic.rows(&closed).unwrap())),
        ("open room, rays", of(&open, Method::Rays(64).rows(&open).unwrap())),
        ("open room, closed forms", of(&open, Method::Analytic.rows(&open).unwrap())),
    ]
}

/// Finite, nowhere negative, balanced: emitted = absorbed + escaped + unshot; and sums of rows are at most 1.
#[track_caller]
fn lawful(problem: &Problem, solution: &Solution, what: &str) {
    for i in 0..problem.len() {
        let (b, e) = (solution.radiosity[i], solution.received[i]);
        assert!(b.is_finite() && e.is_finite(), "{what}: patch {i} is {b}, {e}");
        assert!(e.min_element() >= 0.0 && b.min_element() >= 0.0, "{what}: patch {i} is {b}, {e}");
    }
    // Rounding alone: n additions of 2⁻⁵³ each. What sampling makes or loses has its own line in the ledger.
    let imbalance = solution.ledger.imbalance();
    assert!(imbalance < 1e-12, "{what}: {:?}", solution.ledger);
    assert!(imbalance <= lightkiln::solve::Ledger::CLOSES_TO);
    assert!(solution.unshot_power.is_finite() && solution.unshot_power >= 0.0, "{what}");
}

#[test]
fn rows_are_lawful_and_balanced_ones_reciprocal() {
    for (name, problem) in problems() {
        let (rows, area) = (problem.rows(), problem.area());
        let factor = |i: usize, j: usize| {
            let (column, weight) = rows.patch(i);
            column.binary_search(&(j as u32)).map_or(0.0, |at| f64::from(weight[at]))
        };
        for i in 0..problem.len() {
            let sum = rows.sum(i) + f64::from(rows.miss()[i]);
            // Shares of f32, each off by 2⁻²⁵ of itself; closed forms to their tolerance of 1e-10.
            assert!((sum - 1.0).abs() < 1e-7, "{name}: row {i} adds up to {sum}");
            assert!(rows.patch(i).1.iter().all(|weight| *weight >= 0.0 && weight.is_finite()));
            if name.starts_with("balanced") || name.ends_with("closed forms") {
                for j in 0..i {
                    let (there, back) = (area[i] * factor(i, j), area[j] * factor(j, i));
                    assert!(
                        (there - back).abs() <= 1e-6 * there.max(back),
                        "{name}: {i} {j}: {there} {back}"
                    );
                }
            }
        }
    }
}

#[test]
fn laws_hold_after_every_step_of_the_progressive_solvers() {
    for (name, problem) in problems() {
        let reciprocal = name.starts_with("balanced") || name.ends_with("closed forms");
        let mut plain = Progressive::new(&problem).without_overshooting();
        let mut ambient = Progressive::new(&problem);
        let mut remade = Progressive::remaking(&problem);
        let mut sweeps = Progressive::new(&problem);
        let mut remade_sweeps = Progressive::remaking(&problem);
        let mut before = f64::INFINITY;
        for step in 0..150 {
            let unshot = plain.step().unshot_power;
            ambient.step();
            remade.step();
            lawful(&problem, &plain.solution(), &format!("{name}: plain, shot {step}"));
            lawful(&problem, &ambient.solution(), &format!("{name}: overshooting, shot {step}"));
            lawful(&problem, &remade.solution(), &format!("{name}: made again, shot {step}"));
            // A plain shot hands on at most what it takes, where what arrives is what leaves.
            assert!(
                !reciprocal || unshot <= before * (1.0 + 1e-7),
                "{name}: shot {step}: {before} to {unshot}"
            );
            before = unshot;
        }
        for sweep in 0..12 {
            sweeps.sweep();
            remade_sweeps.sweep();
            lawful(&problem, &sweeps.solution(), &format!("{name}: sweep {sweep}"));
            lawful(&problem, &remade_sweeps.solution(), &format!("{name}: made again, sweep {sweep}"));
        }
    }
}

/// Stopped after 0, 1, 2, … sweeps, which is to look after every step.
#[test]
fn laws_hold_after_every_sweep_of_the_matrix() {
    for (name, problem) in problems() {
        let reciprocal = name.starts_with("balanced") || name.ends_with("closed forms");
        for relaxation in
            [Relaxation::Jacobi, Relaxation::GaussSeidel, Relaxation::Sor(1.2), Relaxation::ConjugateGradient]
        {
            let mut before = f64::INFINITY;
            for max_sweeps in 0..25 {
                let options =
                    MatrixOptions { relaxation, tolerance: 1e-13, max_sweeps, ..MatrixOptions::default() };
                let solution = watched(|progress| matrix::solve(&problem, &options, progress)).unwrap();
                let what = format!("{name}: {relaxation:?}, sweep {max_sweeps}");
                lawful(&problem, &solution, &what);
                // Each hands on at most ρ of what is left; longer steps and conjugate ones do so in other norms.
                let falls = matches!(relaxation, Relaxation::Jacobi | Relaxation::GaussSeidel) && reciprocal;
                let unshot = solution.unshot_power;
                assert!(!falls || unshot <= before * (1.0 + 1e-7), "{what}: {before} to {unshot}");
                before = unshot;
            }
            assert!(
                before < 0.05 * problem.emitted().element_sum(),
                "{name}: {relaxation:?} leaves {before}"
            );
        }
    }
}

/// The same patches under other numbers, and one of them cut in two.
#[test]
fn numbering_and_cutting_do_not_matter() {
    for (name, problem) in problems() {
        // Cut a reciprocal room: ways that turn rows round see the halves by their areas.
        if !name.ends_with("closed forms") {
            continue;
        }
        let count = problem.len();
        let turned = reordered(&problem);
        let cut = halved(&problem, 4);
        for way in Way::ALL {
            let expected = way.solve(&problem).unwrap().radiosity;
            let found = way.solve(&turned).unwrap().radiosity;
            for i in 0..count {
                // Both stop at 1e-12 of the light; f32 rows are the same numbers.
                assert_close(
                    found[count - 1 - i],
                    expected[i],
                    1e-9,
                    &format!("{name}, {way:?}: in reverse"),
                );
            }
            let found = way.solve(&cut).unwrap().radiosity;
            for (i, found) in found.iter().enumerate() {
                let whole = if i == count { 4 } else { i };
                // Halved factors are exact; only their order of summation is another.
                assert_close(*found, expected[whole], 2e-7, &format!("{name}, {way:?}: cut in two"));
            }
        }
    }
}

fn reordered(problem: &Problem) -> Problem {
    let last = problem.len() - 1;
    let turn = |values: &[DVec3]| values.iter().rev().copied().collect::<Vec<_>>();
    let rows = (0..=last).map(|i| {
        let (column, weight) = problem.rows().patch(last - i);
        Row {
            column: column.iter().rev().map(|&j| last as u32 - j).collect(),
            weight: weight.iter().rev().map(|&weight| f64::from(weight)).collect(),
            miss: f64::from(problem.rows().miss()[last - i]),
            ..Row::default()
        }
    });
    let area = problem.area().iter().rev().copied().collect();
    Problem::new(area, turn(problem.reflectance()), turn(problem.source()), Rows::new(rows).unwrap()).unwrap()
}

/// Patch `which` in two halves in the same place, the second with the last number.
fn halved(problem: &Problem, which: usize) -> Problem {
    let count = problem.len();
    let rows = (0..=count).map(|i| {
        let own = if i == count { which } else { i };
        let (column, weight) = problem.rows().patch(own);
        let mut row = Row { miss: f64::from(problem.rows().miss()[own]), ..Row::default() };
        let mut second = 0.0;
        for (&j, &weight) in column.iter().zip(weight) {
            let part = if j as usize == which { 0.5 } else { 1.0 };
            row.column.push(j);
            row.weight.push(f64::from(weight) * part);
            second += f64::from(weight) * (1.0 - part);
        }
        if second > 0.0 {
            row.column.push(count as u32);
            row.weight.push(second);
        }
        row
    });
    let mut area = problem.area().to_vec();
    area[which] *= 0.5;
    area.push(area[which]);
    let with_copy = |values: &[DVec3]| values.iter().copied().chain([values[which]]).collect::<Vec<_>>();
    let (rho, source) = (with_copy(problem.reflectance()), with_copy(problem.source()));
    Problem::new(area, rho, source, Rows::new(rows).unwrap()).unwrap()
}
