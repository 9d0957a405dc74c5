use super::meshes::*;
use super::verify::*;
use super::{atlas, page};
use crate::plan::Side;

#[test]
fn a_cube_has_six_square_charts() {
    let scene = scene(vec![cube()]);
    let result = atlas(&scene, Side::Dark, &page(256)).unwrap();
    let measured = verify(&scene, &result, 2, 0.0);
    assert_eq!(measured.charts, 6);
    assert!(measured.density[0] > 0.99 && measured.density[1] < 1.01, "{measured:?}");
    assert!(result.warnings.is_empty(), "{:?}", result.warnings);
    // Nothing had to be split.
    assert_eq!(result.fronts[0].as_ref().unwrap().unwrap.source_vertex.len(), 36);
}
