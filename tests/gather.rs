//! The adaptive gather against the strict one, which gathers at every texel with the same rays.

mod common;

use common::options;
use lightkiln::bake::{self, Lit, Run};
use lightkiln::import;
use lightkiln::options::Quality;
use std::path::Path;

fn lit(fixture: &str, tolerance: f32) -> (f32, Lit) {
    let mut options = options(Quality::Good, 256);
    options.atlas.max_pages = 1;
    let preset = options.light.gather.tolerance;
    options.light.gather.tolerance = preset * tolerance;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(fixture);
    let (_, scene) = import::load(&path, &options.import).expect("the fixture can be read");
    (preset, bake::light(&scene, &options, &Run::default()).expect("it can be lit"))
}

/// Both send the same rays from the nodes, so what is left is interpolation alone. A cell is kept when its middle node is
/// within the tolerance of its corners. At contacts light bends between the nodes: cells are kept there when their nodes
/// span four times the tolerance at most, and a bend that falls like the root of the distance, the steepest that solid
/// angles make, leaves its chord by up to a quarter of its rise twice over. Over walls and creases it would be off by more.
#[test]
fn what_is_interpolated_is_what_would_have_been_gathered() {
    for fixture in ["cornell.glb", "corridor.glb", "window_room.glb", "leaves.glb", "double_sided.glb"] {
        let ((tolerance, adaptive), (_, strict)) = (lit(fixture, 1.0), lit(fixture, 0.0));
        assert!(adaptive.light.rays < strict.light.rays / 2, "{fixture}: nothing was saved");
        let exported = strict.elements.charts.iter().filter(|c| c.exported);
        let elements: Vec<usize> = exported
            .flat_map(|c| c.elements.start as usize..c.elements.end as usize)
            .filter(|&e| strict.elements.valid[e])
            .collect();
        let of = |lit: &Lit, e: usize| lit.irradiance(e).mean();
        let mean = elements.iter().map(|&e| of(&strict, e)).sum::<f32>() / elements.len() as f32;
        let mut errors: Vec<f32> = elements
            .iter()
            .map(|&e| (of(&adaptive, e) - of(&strict, e)).abs() / of(&strict, e).max(0.1 * mean))
            .collect();
        errors.sort_by(f32::total_cmp);
        let at = |share: f32| errors[((errors.len() - 1) as f32 * share) as usize];
        let bias = elements.iter().map(|&e| of(&adaptive, e) - of(&strict, e)).sum::<f32>()
            / (mean * elements.len() as f32);
        // The tolerance is a share of the light at the cell's middle; an element at its rim may be darker by 30 %.
        let tolerance = 1.5 * tolerance;
        assert!(at(0.95) <= tolerance, "{fixture}: {} at 95 %", at(0.95));
        assert!(at(0.99) <= 2.0 * tolerance, "{fixture}: {} at 99 %", at(0.99));
        assert!(at(0.5) <= tolerance / 7.0, "{fixture}: {} at 50 %", at(0.5));
        assert!(bias.abs() < tolerance / 15.0, "{fixture}: bias {bias}");
    }
}
