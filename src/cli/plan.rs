//! `lightkiln plan`.

use super::args::{AtlasArgs, EffectArgs, SceneArgs};
use super::failure;
use super::memory;
use super::study::terminal_width;
use super::values::{self, Pick};
use clap::Args;
use lightkiln::bake::Run;
use lightkiln::forecast::{Forecast, forecast};
use lightkiln::options::{BakeOptions, ErrorBudget, Quality};
use lightkiln::study::{Cell, Row, Sheet};
use lightkiln::text::{bytes, count, duration, percent, plural, printable, significant};
use lightkiln::{Error, Result, export, import};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

const EXAMPLES: &str = "\
Examples:
  lightkiln plan room.glb                    which effects, why, and what the bake will take
  lightkiln plan room.glb --quality high     the same of another effort
  lightkiln plan room.glb --json > plan.json for programs

Texture space is made, and two small trials are baked, to tell the time; nothing is written.";

/// The arguments of `plan`, as typed.
#[derive(Debug, Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
pub struct PlanArgs {
    /// The scene, a .glb or .gltf file
    #[arg(value_name = "SCENE")]
    pub input: PathBuf,

    /// How much effort goes into the light
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = Pick(Quality::default()))]
    pub quality: Pick<Quality>,

    /// Print the plan as JSON
    #[arg(long)]
    pub json: bool,

    /// Texture space.
    #[command(flatten)]
    pub atlas: AtlasArgs,

    /// How the scene is read.
    #[command(flatten)]
    pub scene: SceneArgs,

    /// Which effects are simulated.
    #[command(flatten)]
    pub effects: EffectArgs,

    /// Worker threads [default: one per core]
    #[arg(long, value_name = "NUMBER", value_parser = values::threads())]
    pub threads: Option<u16>,
}

/// Plans, prints, and returns the exit code.
pub fn run(args: &PlanArgs) -> ExitCode {
    match foresee(args).and_then(|forecast| print(&forecast, args.json)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => failure::error(&error, &args.input),
    }
}

fn foresee(args: &PlanArgs) -> Result<Forecast> {
    let started = Instant::now();
    let options = BakeOptions {
        import: args.scene.import(),
        atlas: args.atlas.atlas(&ErrorBudget::of(args.quality.0)),
        light: args.quality.0.light(),
        effects: args.effects.effects.0.forced(),
        ..BakeOptions::default()
    };
    export::settle(&args.input);
    let (_, scene) = import::load(&args.input, &options.import)?;
    let read = started.elapsed().as_secs_f64();
    let run = Run {
        threads: args.threads.map(usize::from),
        clock: &|| started.elapsed().as_secs_f64(),
        memory: &memory::peak_bytes,
        ..Run::default()
    };
    Ok(forecast(&scene, &options, &run)?.after_reading(read))
}

fn print(forecast: &Forecast, json: bool) -> Result<()> {
    let to_stdout = |error| Error::io("standard output", error);
    let text = if json {
        let value = serde_json::json!({ "seconds": forecast.seconds(), "forecast": forecast });
        format!("{value:#}\n")
    } else {
        table(forecast)
    };
    std::io::stdout().lock().write_all(text.as_bytes()).map_err(to_stdout)
}

fn table(forecast: &Forecast) -> String {
    let rows = forecast.effects.iter().map(|finding| {
        let state = match (finding.on, finding.forced) {
            (true, true) => "forced",
            (true, false) => "on",
            (false, _) => "off",
        };
        let cells: [Cell; 4] = [
            finding.effect.name().into(),
            state.into(),
            printable(&finding.reason).into(),
            finding.saving.text().into(),
        ];
        Row::plain(cells.to_vec())
    });
    let sheet = Sheet {
        name: "plan",
        title: "Effects".to_owned(),
        columns: vec!["effect", "", "why", "what that saves"],
        rows: rows.collect(),
    };
    let stages =
        forecast.stages.iter().map(|(stage, seconds)| format!("{} {}", stage.name(), duration(*seconds)));
    let Forecast { pages, page_size_texels: size, elements, patches, rays, .. } = forecast;
    format!(
        "{}\n{} of {size} × {size}, {} texels per metre\nabout {} texels, {} patches, {} rays\nabout {} ({})\nabout {} of memory\n{}",
        sheet.screen(terminal_width()),
        plural((*pages).into(), "page"),
        significant(forecast.density_texels_per_m.into()),
        count(*elements),
        count(*patches),
        count(*rays),
        duration(forecast.seconds()),
        stages.collect::<Vec<_>>().join(", "),
        bytes(forecast.memory_bytes),
        accuracy(forecast),
    )
}

/// What the light will be off by, and what other errors cost.
fn accuracy(forecast: &Forecast) -> String {
    let Some(error) = forecast.error else { return String::new() };
    let prices = forecast.prices.iter().map(|price| {
        let cost = if price.within_reach { duration(price.seconds) } else { "out of reach".to_owned() };
        format!("{} {cost}", percent(price.error))
    });
    let prices = prices.collect::<Vec<_>>().join(", ");
    format!("error about {} of the mean light; with --tolerance {prices}\n", percent(error))
}
