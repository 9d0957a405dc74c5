//! Shadows smaller than a texel: what is found of them, and what may be missed.

mod common;

use common::{Builder, of_surface};
use glam::{Vec2, Vec3, Vec3Swizzles};
use lightkiln::bake::Lit;
use lightkiln::options::Quality;

/// Squares that hang over the floor, between the origin and this, one in every cell of a grid of this width; metres.
const SIDE: f32 = 8.0;
const CELLS: usize = 16;

/// Corners of the squares: from a tenth of a cell to half of one, anywhere in it.
fn squares() -> Vec<[Vec2; 2]> {
    let cell = SIDE / CELLS as f32;
    (0..CELLS * CELLS)
        .map(|k| {
            let fraction = |ratio: f32| (0.5 + k as f32 * ratio).fract();
            let size = cell * (0.1 + 0.4 * fraction(0.819_172_5));
            let room = Vec2::splat(cell - size) * Vec2::new(fraction(0.671_043_6), fraction(0.549_700_5));
            let low = Vec2::new((k % CELLS) as f32, (k / CELLS) as f32) * cell + room;
            [low, low + size]
        })
        .collect()
}

/// A sun above the squares, above a floor that reflects nothing.
fn lit(quality: Quality, everywhere: bool) -> (Lit, usize) {
    let mut b = Builder::new();
    let black = b.material(0.0, 0.0);
    let floor = b.quad(Vec3::ZERO, Vec3::Z * SIDE, Vec3::X * SIDE, black);
    for [low, high] in squares() {
        let corner = |at: Vec2| Vec3::new(at.x, 1.0, at.y);
        let size = high - low;
        b.quad(corner(low), Vec3::Z * size.y, Vec3::X * size.x, black);
    }
    b.sun(Vec3::Y, 1.0, 0.0);
    let mut options = common::options(quality, 512);
    // Texels of a quarter of a metre: half a cell.
    options.atlas.density = Some(4.0);
    if everywhere {
        options.light.direct.probe_rays = 0;
    }
    (lightkiln::bake::light(&b.scene, &options, &Default::default()).unwrap(), floor)
}

/// The share of an element in the shadow of the squares, exactly: the sun stands overhead.
fn covered(lit: &Lit, element: usize, squares: &[[Vec2; 2]]) -> f64 {
    let elements = &lit.elements;
    let half = elements.half_u_world[element].abs() + elements.half_v_world[element].abs();
    let (middle, half) = (elements.position_world[element].xz(), half.xz());
    let overlap = |[low, high]: &[Vec2; 2]| {
        let size = (high.min(middle + half) - low.max(middle - half)).max(Vec2::ZERO);
        f64::from(size.x * size.y)
    };
    squares.iter().map(overlap).sum::<f64>() / f64::from(4.0 * half.x * half.y)
}

/// Root mean squares over the floor: of what is off, and of what may be.
fn errors(quality: Quality, probes: Option<f64>, rays: f64) -> (f64, f64) {
    let (lit, floor) = lit(quality, probes.is_none());
    let squares = squares();
    let (mut found, mut allowed, mut count, mut shaded) = (0.0, 0.0, 0.0, 0);
    for element in of_surface(&lit, floor) {
        let covered = covered(&lit, element, &squares);
        let off = f64::from(lit.direct[element].mean()) - (1.0 - covered);
        // All probes miss a shadow that covers the share c with (1 − c)^n, all meet it with cⁿ; else n rays that are well
        // spread over the texel err by half a share of each of the √n cells that a border passes.
        let missed = probes.map_or(0.0, |probes| {
            covered.powi(2) * (1.0 - covered).powf(probes) + (1.0 - covered).powi(2) * covered.powf(probes)
        });
        let refined = if covered > 0.0 { 0.25 * rays.powf(-1.5) } else { 0.0 };
        found += off * off;
        allowed += missed + refined;
        count += 1.0;
        shaded += usize::from(covered > 0.0);
        assert!(covered > 0.0 || off.abs() < 1e-6, "{quality:?}: {off} in the open");
    }
    assert!(shaded > 200, "{shaded} texels in shadow show nothing");
    ((found / count).sqrt(), (allowed / count).sqrt())
}

#[test]
fn shadows_smaller_than_a_texel_are_met_as_often_as_probes_can() {
    for (quality, probes, rays) in [
        (Quality::Draft, 2.0, 16.0),
        (Quality::Preview, 3.0, 32.0),
        (Quality::Good, 4.0, 64.0),
        (Quality::High, 8.0, 128.0),
    ] {
        let (found, allowed) = errors(quality, Some(probes), rays);
        // Some hundred texels tell a root mean square to within a tenth.
        assert!(found <= 1.2 * allowed, "{quality:?}: {found:.4} off, {allowed:.4} may be");
    }
}

#[test]
fn what_is_refined_everywhere_misses_none() {
    let (found, allowed) = errors(Quality::Good, None, 64.0);
    assert!(found <= allowed, "{found:.5} off, {allowed:.5} may be");
}

/// Two panels of one object that face down, one high and one low: what hangs between them shades the high one, though it is
/// above the other.
#[test]
fn what_hangs_above_the_lower_of_two_panels_shades_the_higher() {
    let lit = |covered: bool| {
        let mut b = Builder::new();
        let (black, glow) = (b.material(0.0, 0.0), b.material(0.0, 1.0));
        let floor = b.quad(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, black);
        let panel = |x: f32, y: f32| {
            [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(s, t)| Vec3::new(x + s, y, t))
        };
        let corners = [panel(-1.0, 2.0), panel(1.0, 1.0)].concat();
        b.mesh(corners, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], glow);
        if covered {
            // Just below the high panel, and wider: nothing of it is seen from the floor.
            b.quad(Vec3::new(-1.9, 1.9, -0.9), Vec3::Z * 1.8, Vec3::X * 1.8, black);
        }
        let lit = b.light(Quality::Good, 128);
        common::at(&lit, floor, Vec3::new(-1.0, 0.0, 0.0)).mean()
    };
    let (open, covered) = (lit(false), lit(true));
    // Straight below the high panel, what is left is the low one's, 2 m to the side: E = πL F, by its middle alone
    // h² A / (h² + d²)² = 0.04, which a panel as wide as it is high may be off by a third.
    assert!(open > 2.0 * covered, "{open} without, {covered} with a cover");
    common::close(covered, 0.04, 0.34, "of the low panel");
}
