//! The lightmap, and where it errs, as pictures.

use super::{Errors, Truth};
use crate::elements::TexelRef;
use crate::export;
use crate::options::Store;
use crate::resolve;
use crate::scene::Scene;
use crate::study::Picture;
use crate::text;

/// The scale of errors, shares of the mean: logarithmic, from dark to bright.
const SCALE: [f32; 2] = [1e-3, 1e-1];
/// Pictures are made smaller until they are this wide at most, pixels.
const WIDEST: usize = 1024;

/// A picture of the lightmap.
pub fn light(scene: &Scene, truth: &Truth) -> Picture {
    let Truth { lit, light, .. } = truth;
    let lightmap = resolve::resolve(scene, &lit.elements, &lit.atlas, light, Store::IrradianceOverPi);
    let (size, rgb) = export::picture_rgb(&lightmap);
    picture("the lightmap".to_owned(), size, rgb)
}

/// A picture of where a lightmap errs, laid out as the lightmap.
pub fn error(name: &str, truth: &Truth, texelwise: &[f32], errors: &Errors) -> Picture {
    let pages: Vec<usize> = truth.lit.atlas.pages.iter().map(|page| page.size_texels as usize).collect();
    let exported: Vec<bool> = truth.lit.atlas.pages.iter().map(|page| page.exported).collect();
    let mut left = vec![0; pages.len()];
    let (mut width, mut height) = (0, 0);
    for page in (0..pages.len()).filter(|&page| exported[page]) {
        left[page] = width;
        width += pages[page];
        height = height.max(pages[page]);
    }
    let mut rgb = vec![0x30; width * height * 3];
    for (&element, &error) in truth.judged.element.iter().zip(texelwise) {
        let TexelRef { page, x, y } = truth.lit.elements.texel[element as usize];
        let at = (usize::from(y) * width + left[page as usize] + usize::from(x)) * 3;
        rgb[at..at + 3].copy_from_slice(&colour(error));
    }
    let caption = format!(
        "errors of {name}: {} rms, 95 % of the texels below {}",
        text::percent(errors.rms),
        text::percent(errors.p95)
    );
    picture(caption, [width, height], rgb)
}

fn colour(error: f32) -> [u8; 3] {
    let [low, high] = SCALE;
    let along = (error.max(low) / low).ln() / (high / low).ln();
    let colour = colorous::INFERNO.eval_continuous(f64::from(along.clamp(0.0, 1.0)));
    [colour.r, colour.g, colour.b]
}

/// Every second pixel of every second row, as often as it takes; the eye needs no more.
fn picture(caption: String, [mut width, mut height]: [usize; 2], mut rgb: Vec<u8>) -> Picture {
    while width > WIDEST {
        let (w, h) = (width / 2, height.div_ceil(2));
        let pixel = |i: usize| {
            let at = ((i / w * 2) * width + i % w * 2) * 3;
            rgb[at..at + 3].to_vec()
        };
        let half: Vec<u8> = (0..w * h).flat_map(pixel).collect();
        (width, height, rgb) = (w, h, half);
    }
    // A picture of no pixels shows nothing, and nothing is lost.
    let png = export::encode_png([width as u32, height as u32], &rgb).unwrap_or_default();
    Picture { caption, png }
}

/// What the colours mean.
pub fn legend() -> String {
    let [low, high] = SCALE.map(|share| text::percent(share.into()));
    format!(
        "Errors of single texels, as shares of the mean: black {low} and less, through violet and orange to pale \
         yellow, {high} and more, on a logarithmic scale."
    )
}
