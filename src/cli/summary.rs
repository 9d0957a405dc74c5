//! A report as people read it.

use super::progress::Verbosity;
use super::values::Named as _;
use lightkiln::Warning;
use lightkiln::audit::Audit;
use lightkiln::options::LampUnits;
use lightkiln::report::{EnergyReport, Report};
use lightkiln::text::{bytes, count, duration, percent, plural, printable, significant};
use std::fmt::Write as _;

/// Warnings that are shown unless everything is.
const SHOWN_WARNINGS: usize = 10;

/// What a bake did, in a few lines; in many with [`Verbosity::Verbose`].
pub fn render(report: &Report, verbosity: Verbosity) -> String {
    let mut out = String::new();
    let verbose = verbosity == Verbosity::Verbose;
    if verbose {
        stages(&mut out, report);
        effects(&mut out, report);
        energy(&mut out, report);
    }
    warnings(&mut out, &report.warnings, if verbose { usize::MAX } else { SHOWN_WARNINGS });
    for path in &report.outputs {
        line(&mut out, &format!("wrote {}", printable(&path.display().to_string())));
    }
    atlas(&mut out, report);
    if report.settings.import.lamp_units == LampUnits::Auto {
        let name = report.lamp_units.describe().0;
        line(&mut out, &format!("lamps read as {name} (--lamp-units to change)"));
    }
    line(&mut out, &last_line(report));
    out
}

fn line(out: &mut String, text: &str) {
    out.push_str(text);
    out.push('\n');
}

fn atlas(out: &mut String, report: &Report) {
    let atlas = &report.atlas;
    let pages = plural(atlas.pages.into(), "page");
    let mut text = format!("{pages} of {size} × {size}: ", size = atlas.page_size_texels);
    text += &plural(atlas.texels, "texel");
    let _ = write!(text, ", {} per metre", significant(atlas.density_texels_per_m.into()));
    let _ = write!(text, ", {} filled", percent(atlas.fill.into()));
    if atlas.invalid_texels > 0 {
        let _ = write!(text, ", {} buried in geometry", count(atlas.invalid_texels));
    }
    line(out, &text);
}

fn last_line(report: &Report) -> String {
    let light = &report.light;
    let mut text = if report.interrupted { "interrupted after " } else { "baked in " }.to_owned();
    let _ = write!(
        text,
        "{}: {}, {}, {} of the reflected light unshot",
        duration(report.seconds_total),
        plural(light.shots, "shot"),
        plural(light.rays, "ray"),
        percent(light.unshot_fraction),
    );
    if let Some(error) = light.estimated_error {
        let _ = write!(text, ", error about {}", percent(error));
    }
    text
}

fn stages(out: &mut String, report: &Report) {
    line(out, "stage         seconds            rays   peak memory");
    for stage in &report.stages {
        let memory = stage.peak_memory_bytes.map_or_else(|| "-".to_owned(), bytes);
        let row = format!(
            "{:<9} {:>11.3} {:>15} {memory:>13}",
            stage.stage.name(),
            stage.seconds,
            count(stage.rays)
        );
        line(out, &row);
    }
    let memory = report.stages.iter().filter_map(|s| s.peak_memory_bytes).max();
    let memory = memory.map_or_else(|| "-".to_owned(), bytes);
    line(
        out,
        &format!("{:<9} {:>11.3} {:>15} {memory:>13}", "all", report.seconds_total, count(report.light.rays)),
    );
}

fn effects(out: &mut String, report: &Report) {
    if report.effects.is_empty() {
        return;
    }
    line(out, "effects");
    let width = report.effects.iter().map(|effect| effect.effect.name().chars().count()).max().unwrap_or(0);
    for effect in &report.effects {
        let state = if effect.on { "on " } else { "off" };
        line(out, &format!("  {:<width$}  {state}  {}", effect.effect.name(), printable(&effect.reason)));
    }
}

fn energy(out: &mut String, report: &Report) {
    let EnergyReport { emitted, absorbed, escaped, unshot, sampling } = report.light.ledger;
    let unit = if report.lamp_units == LampUnits::Gltf { "lm" } else { "W" };
    line(out, &format!("energy, {unit}             red        green         blue"));
    for (name, [r, g, b]) in [
        ("emitted", emitted),
        ("absorbed", absorbed),
        ("escaped", escaped),
        ("unshot", unshot),
        ("sampling", sampling),
    ] {
        line(out, &format!("  {name:<10} {r:>12.5} {g:>12.5} {b:>12.5}"));
    }
    if let Some(audit) = report.light.error_parts {
        let Audit { direct, solve, gather, interpolation, uncertainty, between_texels, texels, .. } = audit;
        let parts = [
            ("shadow borders", direct),
            ("patches", solve),
            ("gather rays", gather),
            ("interpolation", interpolation),
        ];
        let parts = parts.map(|(name, share)| format!("{name} {}", percent(share))).join(", ");
        let (texels, doubt) = (plural(texels, "texel"), percent(uncertainty));
        line(out, &format!("error by {texels} lit again, ± {doubt}: {parts}"));
        line(
            out,
            &format!("between the texels' centres {} more, by the light's bends", percent(between_texels)),
        );
    }
    let (patches, elements) = (count(report.light.patches), count(report.atlas.elements));
    line(out, &format!("patches {patches}, elements {elements}"));
}

/// Grouped by place; the report has them sorted.
fn warnings(out: &mut String, warnings: &[Warning], shown: usize) {
    let mut previous = None;
    for warning in warnings.iter().take(shown) {
        if previous == Some(&warning.at) {
            line(out, &format!("         {}", printable(&warning.what)));
        } else {
            line(out, &format!("warning: {}: {}", printable(&warning.at), printable(&warning.what)));
        }
        previous = Some(&warning.at);
    }
    if let Some(more) = warnings.len().checked_sub(shown).filter(|more| *more > 0) {
        line(out, &format!("… and {more} more, see --report or -v"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightkiln::audit::Audit;
    use lightkiln::options::BakeOptions;
    use lightkiln::options::Effect;
    use lightkiln::plan::Finding;
    use lightkiln::progress::Stage;
    use lightkiln::report::{AtlasReport, LightReport, StageReport, sorted};

    fn report(warnings: usize) -> Report {
        let stage =
            |stage, seconds, rays| StageReport { stage, seconds, rays, peak_memory_bytes: Some(64 << 20) };
        Report {
            version: "1.2.3",
            input: "room.glb".into(),
            outputs: vec!["room.baked.glb".into(), "room.lightmap0.exr".into()],
            interrupted: false,
            settings: BakeOptions::default(),
            lamp_units: LampUnits::Blender,
            stages: vec![stage(Stage::Direct, 1.5, 1_000_000), stage(Stage::Solve, 0.25, 250_000)],
            seconds_total: 1.75,
            predicted_memory_bytes: 64 << 20,
            atlas: AtlasReport {
                pages: 1,
                page_size_texels: 512,
                density_texels_per_m: 64.125,
                fill: 0.8,
                texels: 209_715,
                elements: 210_000,
                invalid_texels: 12,
            },
            light: LightReport {
                patches: 4000,
                shots: 321,
                sweeps: 5,
                form_factors: 100_000,
                rays: 1_250_000,
                ledger: EnergyReport::default(),
                unshot_fraction: 5e-4,
                unshot_error_bound: Some(1e-3),
                estimated_error: Some(0.011),
                error_parts: Some(Audit {
                    total: 0.011,
                    direct: 0.004,
                    solve: 0.002,
                    gather: 0.009,
                    interpolation: 0.003,
                    uncertainty: 0.001,
                    between_texels: 0.02,
                    texels: 400,
                    rays: 50_000,
                }),
            },
            effects: vec![Finding {
                effect: Effect::Sky,
                on: false,
                forced: false,
                reason: "no sky".to_owned(),
                evidence: Default::default(),
                can_be_forced: false,
                saving: Default::default(),
            }],
            warnings: sorted(
                (0..warnings)
                    .map(|i| Warning::new(format!("wall {}", i / 2), format!("thing {i}")))
                    .collect(),
            ),
        }
    }

    #[test]
    fn the_summary_is_short() {
        let text = render(&report(0), Verbosity::Normal);
        let expected = "\
wrote room.baked.glb
wrote room.lightmap0.exr
1 page of 512 × 512: 209,715 texels, 64.1 per metre, 80 % filled, 12 buried in geometry
lamps read as blender (--lamp-units to change)
baked in 1.75 s: 321 shots, 1,250,000 rays, 0.050 % of the reflected light unshot, error about 1.1 %
";
        assert_eq!(text, expected);
    }

    #[test]
    fn ten_warnings_are_shown_and_the_rest_counted() {
        let text = render(&report(13), Verbosity::Normal);
        assert!(text.starts_with("warning: wall 0: thing 0\n         thing 1\nwarning: wall 1: thing 2\n"));
        assert!(text.contains("thing 9\n… and 3 more, see --report or -v\n"));
        assert!(!text.contains("thing 10"));
        assert!(!render(&report(10), Verbosity::Normal).contains('…'));
    }

    #[test]
    fn everything_is_shown_when_asked_for() {
        let text = render(&report(13), Verbosity::Verbose);
        for part in
            ["thing 12", "direct          1.500       1,000,000        64 MiB", "sky  off  no sky", "emitted"]
        {
            assert!(text.contains(part), "{part} is missing from\n{text}");
        }
        assert!(!text.contains('…'));
    }

    #[test]
    fn an_interrupted_bake_says_so() {
        let interrupted = Report { interrupted: true, ..report(0) };
        assert!(render(&interrupted, Verbosity::Normal).contains("interrupted after 1.75 s"));
    }
}
