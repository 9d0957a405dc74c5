//! How wide a page must be for what lookups between its texels may be off by.
//!
//! Drafts of small pages are looked at, each twice as wide as the last, until one is fine enough. Where none of those that
//! cost little is, the last two tell by which power of the width the error falls: by 2 where light is smooth, by 1/2 where
//! borders of sharp shadows make most of it.

use super::log::Log;
use super::{Lit, Run, light_into};
use crate::audit;
use crate::error::{Error, Result, Warning};
use crate::options::{AtlasOptions, BakeOptions, Effort, Goal, LightOptions};
use crate::progress::{Silent, Stage};
use crate::report::LightReport;
use crate::scene::Scene;
use crate::text;

/// Where looking begins, texels.
const NARROWEST: u32 = 128;
/// Wider pages are not looked at: a draft of them may take as long as the bake.
const WIDEST_LOOK: u32 = 512;
/// Where the bake has a time, nothing is looked at any more after this share of it.
const SHARE_OF_TIME: f64 = 0.1;
/// A draft's bends are not quite those of the bake.
const AIM: f64 = 0.9;
/// The least and the highest power of the width by which the error can fall.
const POWERS: [f64; 2] = [0.5, 2.0];

/// What a draft told.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Look {
    width: u32,
    between_texels: f64,
}

/// The options with pages as wide as the error between their texels wants it, and never wider than they were; as they are
/// where nothing is wanted.
pub(super) fn sized(scene: &Scene, options: &BakeOptions, log: &mut Log) -> Result<BakeOptions> {
    let Some(wanted) = options.atlas.between_texels else { return Ok(options.clone()) };
    if options.atlas.density.is_some() {
        let what = "cannot follow from the error where the density is given: leave out one of the two";
        return Err(Error::invalid("page size", what));
    }
    let widest = options.atlas.page_size;
    let twice = |width: &u32| Some(width * 2);
    let narrow = |width: &u32| *width <= WIDEST_LOOK.min(widest);
    let widths: Vec<u32> = std::iter::successors(Some(NARROWEST), twice).take_while(narrow).collect();
    let (run, ended) = (log.run, log.seconds());
    let late = |seconds: f64| match options.goal {
        Goal::Seconds(all) => ended + seconds > SHARE_OF_TIME * all,
        Goal::Effort | Goal::Tolerance(_) => false,
    };
    let page_size = log.stage(Stage::Sizing, widths.len() as u64, |progress| {
        let started = (run.clock)();
        let (mut looks, mut rays) = (Vec::new(), 0);
        for width in widths {
            let look = draft(scene, options, width, run)?;
            let between_texels =
                audit::between_texels(&look.elements, &|e| f64::from(look.irradiance(e as usize).mean()));
            rays += look.light.rays;
            looks.push(Look { width: width.max(look.atlas_report().page_size_texels), between_texels });
            progress.advance(1);
            if between_texels <= AIM * wanted || late((run.clock)() - started) {
                break;
            }
        }
        Ok((width_for(&looks, AIM * wanted).min(widest), rays))
    })?;
    Ok(with_page(options, page_size))
}

fn with_page(options: &BakeOptions, page_size: u32) -> BakeOptions {
    let atlas = AtlasOptions { page_size, between_texels: None, ..options.atlas.clone() };
    BakeOptions { atlas, ..options.clone() }
}

/// Where texels are too coarse for what was wanted of them.
pub(super) fn too_coarse(options: &BakeOptions, light: &LightReport) -> Option<Warning> {
    let wanted = match options.goal {
        Goal::Tolerance(wanted) => Some(wanted),
        Goal::Effort | Goal::Seconds(_) => options.atlas.between_texels,
    };
    let (wanted, found) = (wanted?, light.error_parts?.between_texels);
    let told = || {
        let remedy = match options.atlas.between_texels {
            Some(_) => "wider pages are only made for who names their --page-size",
            None => "raise --density or --page-size, or let --page-size auto choose",
        };
        format!(
            "between the texels' centres the light is off by about {}, more than the {} that were asked for: texels are \
             too few for it; {remedy}",
            text::percent(found),
            text::percent(wanted),
        )
    };
    (found > wanted).then(|| Warning::new("texel density", told()))
}

fn draft(scene: &Scene, options: &BakeOptions, width: u32, run: &Run) -> Result<Lit> {
    let light = LightOptions { audit_share: 0.0, ..Effort::all(0.0).light(&options.light) };
    let options = BakeOptions { light, goal: Goal::Effort, ..with_page(options, width) };
    let quiet = Run { observer: &Silent, snapshot_every_s: None, ..*run };
    light_into(scene, &options, &mut Log::new(&quiet), None)
}

/// The width that is fine enough, a power of two times the first that was looked at.
fn width_for(looks: &[Look], wanted: f64) -> u32 {
    let Some(last) = looks.last() else { return u32::MAX };
    if last.between_texels <= wanted {
        return last.width;
    }
    let [least, highest] = POWERS;
    let power = match looks {
        [.., before, last] if before.width < last.width => {
            let falls = (before.between_texels / last.between_texels).ln();
            (falls / (f64::from(last.width) / f64::from(before.width)).ln()).clamp(least, highest)
        }
        // Between the two.
        _ => 1.0,
    };
    let times = (last.between_texels / wanted.max(f64::MIN_POSITIVE)).powf(1.0 / power);
    // The least power of two that is no less; 2³² is wider than any page.
    let doublings = times.log2().ceil().clamp(1.0, 32.0) as u32;
    (u64::from(last.width) << doublings).min(u64::from(u32::MAX)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looks(found: &[(u32, f64)]) -> Vec<Look> {
        found.iter().map(|&(width, between_texels)| Look { width, between_texels }).collect()
    }

    #[test]
    fn the_first_that_is_fine_enough_is_taken() {
        assert_eq!(width_for(&looks(&[(128, 0.009)]), 0.01), 128);
        assert_eq!(width_for(&looks(&[(128, 0.02), (256, 0.008)]), 0.01), 256);
    }

    #[test]
    fn wider_pages_follow_the_law_that_the_last_two_tell() {
        // Smooth: a quarter by twice the width; 1/16 wants four times.
        assert_eq!(width_for(&looks(&[(128, 0.64), (256, 0.16)]), 0.01), 1024);
        // Sharp shadows: 1/√2 by twice the width; half wants four times.
        assert_eq!(width_for(&looks(&[(256, 0.04 * 2_f64.sqrt()), (512, 0.04)]), 0.02001), 2048);
        // What does not fall at all is taken for the slowest law, and what falls too fast for the fastest.
        assert_eq!(width_for(&looks(&[(256, 0.04), (512, 0.04)]), 0.02001), 2048);
        assert_eq!(width_for(&looks(&[(256, 1.0), (512, 0.04)]), 0.01001), 1024);
        // One look alone: as 1 / width.
        assert_eq!(width_for(&looks(&[(128, 0.04)]), 0.01001), 512);
        assert_eq!(width_for(&looks(&[(128, 0.04)]), 0.0), u32::MAX);
    }
}
