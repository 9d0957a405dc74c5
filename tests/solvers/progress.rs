//! What holds on the way: energy at every step, rates, bounds.

use super::*;

/// At every single step, with every kind of row.
#[test]
fn the_ledger_closes_at_every_step() {
    let sampled = {
        let world = cube(4, 2.0);
        let problem = colourful(4, 0.9);
        let rows = Method::Rays(64).rows(&world).unwrap();
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
        let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).unwrap().radiosity;
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
    let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).unwrap().radiosity;
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
    let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&problem).unwrap().radiosity;
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
    let exact = Way::Matrix(Relaxation::GaussSeidel).solve(&furnace).unwrap().radiosity;
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
            let kept = Problem::new(
                world.area(),
                rho.clone(),
                source.clone(),
                Method::Rays(64).rows(&world).unwrap(),
            )
            .unwrap();
            let remade =
                Problem::new(world.area(), rho.clone(), source.clone(), Method::Rays(64).source(&world))
                    .unwrap();
            let (mut a, mut b) = (Progressive::new(&kept), Progressive::remaking(&remade));
            for _ in 0..40 {
                a.sweep();
                b.sweep();
            }
            let shots = Way::Shots.solve(&kept).unwrap().radiosity;
            let oracle = Way::Matrix(Relaxation::ConjugateGradient).solve(&kept).unwrap().radiosity;
            (a.radiosity(), b.radiosity(), shots, oracle)
        })
    };
    let one = with_threads(1);
    assert!(one == with_threads(3), "another number of threads gave other bits");
    for (kept, remade) in one.0.iter().zip(&one.1) {
        assert_close(*kept, *remade, 1e-13, "kept and remade");
    }
}

/// Light in one room, none in the next: overshooting must not guess any into it.
#[test]
fn a_room_without_light_stays_dark_at_every_step() {
    let (lit, dark) = (ring(16).unwrap(), ring(16).unwrap());
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
