//! Which settings are tried.

use crate::options::{BakeOptions, FormFactors, Goal, LightOptions, Quality, Relaxation, Solver};

/// Patches at which the methods of form factors are compared: closed forms take all pairs of them.
const PATCHES_OF_METHODS: u32 = 1000;

/// One setting of one sweep.
#[derive(Clone, Debug)]
pub struct Setting {
    /// What is varied.
    pub sweep: &'static str,
    /// To what.
    pub value: String,
    /// All that the bake is told.
    pub options: BakeOptions,
}

/// Names of the levels, from the least effort on.
const LEVELS: [(&str, Quality); 5] = [
    ("draft", Quality::Draft),
    ("preview", Quality::Preview),
    ("good", Quality::Good),
    ("high", Quality::High),
    ("reference", Quality::Reference),
];

/// The sweeps of the one knob: by level,
pub const QUALITY: &str = "quality";
/// and by what the light may be off by.
pub const TOLERANCE: &str = "tolerance";
/// Shares of the mean light.
const TOLERANCES: [(&str, f64); 4] = [("5 %", 0.05), ("2 %", 0.02), ("1 %", 0.01), ("0.5 %", 0.005)];

/// All sweeps around the effort of `base`: everything else is as there.
pub fn settings(base: &BakeOptions) -> Vec<Setting> {
    let mut all = Vec::new();
    let mut add = |sweep, value: String, change: &dyn Fn(&mut LightOptions)| {
        let mut options = base.clone();
        change(&mut options.light);
        all.push(Setting { sweep, value, options });
    };
    for (name, level) in LEVELS {
        let seed = base.light.seed;
        add(QUALITY, name.to_owned(), &|light| *light = LightOptions { seed, ..level.light() });
    }
    for patches in [500, 1000, 2000, 4000, 8000, 16000] {
        add("patches", patches.to_string(), &|light| light.solve.patches = patches);
    }
    let methods = [
        ("ray", FormFactors::Ray),
        ("hemicube", FormFactors::Hemicube),
        ("analytic", FormFactors::Analytic),
        ("auto", FormFactors::Auto),
    ];
    for (name, method) in methods {
        add("form factors", format!("{name}, {PATCHES_OF_METHODS} patches"), &|light| {
            light.solve.form_factors = method;
            light.solve.patches = PATCHES_OF_METHODS;
        });
    }
    for (name, solver, relaxation) in SOLVERS {
        add("solver", name.to_owned(), &|light| {
            (light.solve.solver, light.solve.relaxation) = (solver, relaxation);
        });
    }
    for rays in [32, 64, 128, 256, 512, 1024, 2048] {
        add("gather rays", rays.to_string(), &|light| light.gather.rays = rays);
    }
    for (name, tolerance) in
        [("0.2", 0.2), ("0.1", 0.1), ("0.05", 0.05), ("0.02", 0.02), ("0.01", 0.01), ("0", 0.0)]
    {
        add("gather tolerance", name.to_owned(), &|light| light.gather.tolerance = tolerance);
    }
    for rays in [4, 16, 32, 64, 128, 256] {
        add("penumbra rays", rays.to_string(), &|light| light.direct.penumbra_rays = rays);
    }
    for rays in [1, 2, 4, 8, 16] {
        add("probe rays", rays.to_string(), &|light| light.direct.probe_rays = rays);
    }
    all.extend(TOLERANCES.map(|(name, tolerance)| {
        let options = BakeOptions { goal: Goal::Tolerance(tolerance), ..base.clone() };
        Setting { sweep: TOLERANCE, value: name.to_owned(), options }
    }));
    all
}

/// The solvers, with what the matrix does.
pub const SOLVERS: [(&str, Solver, Relaxation); 4] = [
    ("progressive", Solver::Progressive, Relaxation::GaussSeidel),
    ("Gauss-Seidel", Solver::Matrix, Relaxation::GaussSeidel),
    ("SOR", Solver::Matrix, Relaxation::Sor),
    ("conjugate gradient", Solver::Matrix, Relaxation::Cg),
];

/// Shares of the density that are tried.
pub const DENSITIES: [(&str, f32); 4] =
    [("1/4", 0.25), ("1/2", 0.5), ("1/√2", std::f32::consts::FRAC_1_SQRT_2), ("1", 1.0)];
