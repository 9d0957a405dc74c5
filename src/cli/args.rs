//! What can be typed. Every default is read from the library.

use super::amounts;
use super::check::CheckArgs;
use super::plan::PlanArgs;
use super::render::RenderArgs;
use super::study::StudyArgs;
use super::values::{self, Effects, PageSize, Pick, Sky, WIDEST_AUTO_PAGE};
use clap::{Args, Parser, Subcommand};
use lightkiln::options::{
    AtlasOptions, ErrorBudget, ExportOptions, FormFactors, ImportOptions, LampUnits, LampsOut, LightPart,
    Quality, Relaxation, SolveOptions, Solver, Store,
};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  lightkiln bake room.glb                                writes room.baked.glb and its EXR beside it
  lightkiln bake room.glb -o out/lit.glb --quality high  choose the file and the effort
  lightkiln bake room.glb --tolerance 0.01               until the light is off by about 1 %
  lightkiln bake room.glb --time 30s                     the best that 30 seconds allow
  lightkiln bake house.glb --sky 0.35,0.55,1.0           a blue sky around the scene
  lightkiln bake house.glb --sky noon.hdr,0.5            an image of a sky at half strength
  lightkiln bake room.glb --preview lit.glb              also a file that Blender and any viewer show lit
  lightkiln plan room.glb                                which effects the scene calls for, seconds, memory
  lightkiln render room.baked.glb -o room.png            a picture of the result";

const EXIT_CODES: &str = "\
Ctrl-C stops the bake and writes the solution so far; a second Ctrl-C quits at once.
Exit codes: 0 done, 1 could not, 2 wrong usage, 130 interrupted.";

/// Bakes light into glTF: unwraps, solves radiosity, writes EXR lightmaps back.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true, after_help = EXAMPLES)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Bake the light of a scene into lightmaps
    Bake(Box<BakeArgs>),
    /// Take a picture of a baked file
    Render(RenderArgs),
    /// Examine a baked file: texture space, pages, units, seams
    Check(CheckArgs),
    /// Tell which effects a scene calls for, why, and what baking it will take
    Plan(Box<PlanArgs>),
    /// Bake scenes many times over and show what comes of it
    Study(Box<StudyArgs>),
}

/// The arguments of `bake`, as typed.
#[derive(Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = EXAMPLES,
    after_long_help = format!("{EXAMPLES}\n\n{EXIT_CODES}"),
)]
pub struct BakeArgs {
    /// The scene, a .glb or .gltf file; it is never changed
    #[arg(value_name = "SCENE")]
    pub input: PathBuf,

    /// How much effort goes into the light
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = Pick(Quality::default()))]
    pub quality: Pick<Quality>,

    /// How far off the light may be, as a share of its mean, such as 0.01 or 1%; takes what effort that takes
    #[arg(
        long,
        value_name = "SHARE",
        value_parser = amounts::tolerance,
        conflicts_with_all = ["quality", "time"],
        allow_negative_numbers = true,
    )]
    pub tolerance: Option<f64>,

    /// The best light within this time, such as 500ms, 30s or 2m, and what writing takes
    #[arg(long, value_name = "TIME", value_parser = amounts::seconds, conflicts_with = "quality")]
    pub time: Option<f64>,

    /// What is written.
    #[command(flatten)]
    pub output: OutputArgs,

    /// Texture space.
    #[command(flatten)]
    pub atlas: AtlasArgs,

    /// How the scene is read.
    #[command(flatten)]
    pub scene: SceneArgs,

    /// How light between surfaces is found.
    #[command(flatten)]
    pub solve: SolveArgs,

    /// Which effects are simulated.
    #[command(flatten)]
    pub effects: EffectArgs,

    /// How the bake runs.
    #[command(flatten)]
    pub run: RunArgs,
}

/// What is written.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
pub struct OutputArgs {
    /// The baked file, .glb or .gltf [default: SCENE.baked beside the scene]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,

    /// A second file that Blender and any viewer show lit
    #[arg(long, value_name = "FILE")]
    pub preview: Option<PathBuf>,

    /// A picture of the result, a .png; see `lightkiln render`
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,

    /// What the bake did, as JSON; - is standard output
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,

    /// What a texel holds
    #[arg(long, value_name = "UNIT", value_enum, default_value_t = Pick(ExportOptions::default().store))]
    pub store: Pick<Store>,

    /// Which light is stored
    #[arg(long, value_name = "PART", value_enum, default_value_t = Pick(ExportOptions::default().light))]
    pub light: Pick<LightPart>,

    /// What happens to the lamps of the file
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = Pick(ExportOptions::default().lamps))]
    pub lamps: Pick<LampsOut>,

    /// Put the EXRs into the GLB instead of beside it
    #[arg(long)]
    pub embed: bool,

    /// Store 32 bit instead of 16 bit floats
    #[arg(long)]
    pub float: bool,
}

/// Texture space.
#[derive(Debug, Args)]
#[command(next_help_heading = "Texture space")]
pub struct AtlasArgs {
    /// Texels per metre [default: one page is well filled]
    #[arg(long, value_name = "NUMBER", value_parser = values::density, allow_negative_numbers = true)]
    pub density: Option<f32>,

    /// Width and height of a page, texels; auto: as few as keep lookups between texels within --tolerance, or within what
    /// the quality usually errs
    #[arg(long, value_name = "TEXELS", value_parser = values::page_size, default_value_t = PageSize::default())]
    pub page_size: PageSize,

    /// The most pages that may be written; the density gives way
    #[arg(
        long,
        value_name = "NUMBER",
        value_parser = values::pages(),
        default_value_t = AtlasOptions::default().max_pages,
    )]
    pub max_pages: u32,
}

impl AtlasArgs {
    /// What they mean for a bake that may err so much.
    pub fn atlas(&self, budget: &ErrorBudget) -> AtlasOptions {
        let (page_size, between_texels) = match self.page_size {
            PageSize::Texels(texels) => (texels, None),
            PageSize::Auto => (WIDEST_AUTO_PAGE, Some(budget.between_texels)),
        };
        AtlasOptions {
            density: self.density,
            page_size,
            between_texels,
            max_pages: self.max_pages,
            ..AtlasOptions::default()
        }
    }
}

/// How the scene is read.
#[derive(Debug, Args)]
#[command(next_help_heading = "Scene")]
pub struct SceneArgs {
    /// Name or number of the glTF scene [default: the file's default scene]
    #[arg(long, value_name = "NAME")]
    pub scene: Option<String>,

    /// R,G,B[,STRENGTH], or an equirectangular .exr or .hdr FILE[,STRENGTH] [default: the file's]
    #[arg(long, value_parser = values::sky, allow_hyphen_values = true)]
    pub sky: Option<Sky>,

    /// Angular diameter of every sun; 0 is sharp [default: the file's]
    #[arg(long, value_name = "DEGREES", value_parser = values::sun_angle, allow_negative_numbers = true)]
    pub sun_angle: Option<f32>,

    /// How the numbers of lamps are meant
    #[arg(long, value_name = "UNITS", value_enum, default_value_t = Pick(ImportOptions::default().lamp_units))]
    pub lamp_units: Pick<LampUnits>,

    /// Let the scene name files outside its own folder
    #[arg(long)]
    pub allow_outside: bool,
}

impl SceneArgs {
    /// What they mean.
    pub fn import(&self) -> ImportOptions {
        ImportOptions {
            scene: self.scene.clone(),
            lamp_units: self.lamp_units.0,
            sky: self.sky.clone().map(|sky| sky.0),
            sun_angle_deg: self.sun_angle,
            allow_outside: self.allow_outside,
        }
    }
}

/// How light between surfaces is found.
#[derive(Debug, Args)]
#[command(next_help_heading = "Interreflection")]
pub struct SolveArgs {
    /// How the radiosity between patches is solved
    #[arg(long, value_name = "SOLVER", value_enum, default_value_t = Pick(SolveOptions::default().solver))]
    pub solver: Pick<Solver>,

    /// What --solver matrix does [default: gauss-seidel]
    #[arg(long, value_name = "METHOD", value_enum)]
    pub relaxation: Option<Pick<Relaxation>>,

    /// How the form factors between patches are found
    #[arg(
        long,
        value_name = "METHOD",
        value_enum,
        default_value_t = Pick(SolveOptions::default().form_factors),
    )]
    pub form_factors: Pick<FormFactors>,
}

/// Which effects are simulated.
#[derive(Debug, Args)]
#[command(next_help_heading = "Effects")]
pub struct EffectArgs {
    /// Which effects of light are simulated
    #[arg(long, value_name = "WHICH", value_enum, default_value_t = Pick(Effects::Auto))]
    pub effects: Pick<Effects>,
}

/// How the bake runs.
#[derive(Debug, Args)]
#[command(next_help_heading = "Run")]
pub struct RunArgs {
    /// Worker threads [default: one per core]
    #[arg(long, value_name = "NUMBER", value_parser = values::threads())]
    pub threads: Option<u16>,

    /// The most memory to use, such as 512MiB or 4GiB [default: no limit]
    #[arg(long, value_name = "SIZE", value_parser = amounts::memory_bytes)]
    pub memory: Option<u64>,

    /// Write the light so far every so often, such as 5s; each time better than the last
    #[arg(long, value_name = "TIME", value_parser = amounts::seconds)]
    pub snapshot_every: Option<f64>,

    /// Print errors only
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,

    /// Print everything: stages, effects, energy, every warning
    #[arg(short, long)]
    pub verbose: bool,
}
