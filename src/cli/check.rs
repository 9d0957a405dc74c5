//! `lightkiln check`.

use super::failure;
use super::render::{SceneArgs, ViewArgs};
use super::values;
use clap::Args;
use lightkiln::bake::in_pool;
use lightkiln::check::{self, Findings, ObjectReport};
use lightkiln::options::RenderOptions;
use lightkiln::text::{count, percent, plural, printable, significant};
use lightkiln::{Error, Result, baked, export};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Objects that are listed unless all are asked for.
const SHOWN: usize = 20;

const EXAMPLES: &str = "\
Examples:
  lightkiln check room.baked.glb                         a table, and what is wrong
  lightkiln check room.baked.glb --json > room.json      the same for programs
  lightkiln check room.baked.glb --picture density.png   the scene coloured by its texels per metre

Exit codes: 0 nothing grave, 1 something is wrong, 2 wrong usage.";

/// The arguments of `check`, as typed.
#[derive(Debug, Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
pub struct CheckArgs {
    /// A file that `lightkiln bake` wrote, its pages beside it
    #[arg(value_name = "BAKED")]
    pub input: PathBuf,

    /// Print the findings as JSON
    #[arg(long)]
    pub json: bool,

    /// Also a picture: green has the usual texels per metre, blue a quarter, red four times as many
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,

    /// Where the picture is taken from.
    #[command(flatten)]
    pub view: ViewArgs,

    /// How the file is read.
    #[command(flatten)]
    pub scene: SceneArgs,

    /// Worker threads [default: one per core]
    #[arg(long, value_name = "NUMBER", value_parser = values::threads())]
    pub threads: Option<u16>,

    /// List all objects
    #[arg(short, long)]
    pub verbose: bool,
}

/// Examines, prints, and returns the exit code.
pub fn run(args: &CheckArgs) -> ExitCode {
    let examined = in_pool(args.threads.map(usize::from), || examine(args)).and_then(|examined| examined);
    let findings = match examined {
        Ok(findings) => findings,
        Err(error) => return failure::error(&error, &args.input),
    };
    let text = if args.json { json(&findings) } else { Ok(table(&findings, args.verbose)) };
    let printed = text.and_then(|text| {
        let to_stdout = |error| Error::io("standard output", error);
        std::io::stdout().lock().write_all(text.as_bytes()).map_err(to_stdout)
    });
    match printed {
        Err(error) => failure::error(&error, &args.input),
        Ok(()) if findings.passes() => ExitCode::SUCCESS,
        Ok(()) => ExitCode::from(failure::COULD_NOT),
    }
}

fn examine(args: &CheckArgs) -> Result<Findings> {
    export::settle(&args.input);
    let baked = baked::read(&args.input, &args.scene.import())?;
    let findings = check::check(&baked);
    if let Some(path) = &args.picture {
        let (view, size) = (args.view.view(), args.view.size);
        let options = RenderOptions { view, size, ..RenderOptions::default() };
        let picture = check::density_picture(&baked, &findings.objects, &options)?;
        export::write_png(path, picture.size, &picture.rgb)?;
        failure::say(&format!("wrote {}", printable(&path.display().to_string())));
    }
    Ok(findings)
}

fn json(findings: &Findings) -> Result<String> {
    let text = serde_json::to_string_pretty(findings);
    text.map(|text| text + "\n").map_err(|error| Error::io("standard output", error.into()))
}

/// The findings as people read them.
fn table(findings: &Findings, all: bool) -> String {
    let mut out = String::new();
    pages(&mut out, findings);
    objects(&mut out, findings, if all { usize::MAX } else { SHOWN });
    let seams = &findings.seams;
    if seams.edges > 0 {
        let _ = writeln!(
            out,
            "\n{}: 95 % of the places step by less than {} of the mean light, the largest by {} ({})",
            plural(seams.edges as u64, "smooth seam"),
            percent(seams.p95),
            percent(seams.largest),
            between(&seams.between),
        );
    }
    if findings.surfaces_without > 0 {
        let _ = writeln!(out, "{} without a lightmap", plural(findings.surfaces_without as u64, "surface"));
    }
    out.push('\n');
    for problem in &findings.problems {
        let word = if problem.grave { "error" } else { "warning" };
        let _ = writeln!(out, "{word}: {}: {}", printable(&problem.at), printable(&problem.what));
    }
    let grave = findings.problems.iter().filter(|problem| problem.grave).count();
    let mild = findings.problems.len() - grave;
    let _ = writeln!(out, "{}, {}", plural(grave as u64, "error"), plural(mild as u64, "warning"));
    out
}

fn between([one, other]: &[String; 2]) -> String {
    if one == other { printable(one) } else { format!("{} and {}", printable(one), printable(other)) }
}

fn pages(out: &mut String, findings: &Findings) {
    let rows = findings.pages.iter().map(|page| {
        let size = page.size.map_or_else(|| "unreadable".to_owned(), |[w, h]| format!("{w} × {h}"));
        let gap = match (page.gap_texels, page.size) {
            (Some(gap), _) => gap.to_string(),
            (None, _) => "-".to_owned(),
        };
        [printable(&page.file), size, percent(page.filled), gap, page.store.clone()]
    });
    columns(out, [["page", "texels", "filled", "gap", "holds"].map(str::to_owned)].into_iter().chain(rows));
}

fn objects(out: &mut String, findings: &Findings, shown: usize) {
    let head =
        ["object", "triangles", "charts", "texels", "per metre", "5 %", "95 %", "stretch", "light", "seam"];
    let row = |object: &ObjectReport| {
        let density = &object.density;
        [
            printable(&object.name),
            count(object.triangles as u64),
            count(object.charts as u64),
            count(object.texels as u64),
            significant(density.texels_per_m),
            significant(density.low),
            significant(density.high),
            format!("{:.2}", density.stretch),
            significant(f64::from(object.light.iter().sum::<f32>() / 3.0)),
            percent(object.largest_seam),
        ]
    };
    out.push('\n');
    columns(out, [head.map(str::to_owned)].into_iter().chain(findings.objects.iter().take(shown).map(row)));
    if let Some(more) = findings.objects.len().checked_sub(shown).filter(|more| *more > 0) {
        let _ = writeln!(out, "… and {more} more, see -v or --json");
    }
}

/// Lines up; the first column to the left, the others to the right.
fn columns<const N: usize>(out: &mut String, rows: impl Iterator<Item = [String; N]>) {
    let rows: Vec<[String; N]> = rows.collect();
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    for row in &rows {
        let cells = row.iter().zip(widths).enumerate().map(|(k, (cell, width))| {
            if k == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        let _ = writeln!(out, "{}", cells.collect::<Vec<_>>().join("  "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let mut out = String::new();
        let rows = [["a", "b"], ["long", "1"], ["é", "100"]].map(|row| row.map(str::to_owned));
        columns(&mut out, rows.into_iter());
        assert_eq!(out, "a       b\nlong    1\né     100\n");
    }
}
