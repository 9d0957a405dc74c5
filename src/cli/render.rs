//! `lightkiln render`.

use super::failure;
use super::values::{self, Pick, Sky};
use clap::Args;
use lightkiln::bake::in_pool;
use lightkiln::options::{Exposure, ImportOptions, LampUnits, RenderOptions, Tone, View};
use lightkiln::render::Picture;
use lightkiln::text::printable;
use lightkiln::{Result, baked, export, render};
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  lightkiln render room.baked.glb                        room.baked.png, through the file's first camera
  lightkiln render room.baked.glb --camera Door -o a.png through the camera of the object 'Door'
  lightkiln render room.baked.glb --orbit=120            from outside, 120 degrees around
  lightkiln render room.baked.glb --exposure -1.5        always as bright, to compare pictures";

/// The arguments of `render`, as typed.
#[derive(Debug, Args)]
#[command(arg_required_else_help = true, after_help = EXAMPLES)]
pub struct RenderArgs {
    /// A file that `lightkiln bake` wrote, its pages beside it
    #[arg(value_name = "BAKED")]
    pub input: PathBuf,

    /// The picture, a .png [default: beside the file, with its name]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,

    /// Where it is taken from.
    #[command(flatten)]
    pub view: ViewArgs,

    /// Power of two that radiances are multiplied with, or auto
    #[arg(long, value_name = "EV", value_parser = values::exposure, default_value = "auto", allow_hyphen_values = true)]
    pub exposure: Exposure,

    /// How light becomes colour
    #[arg(long, value_name = "CURVE", value_enum, default_value_t = Pick(Tone::default()))]
    pub tone: Pick<Tone>,

    /// How the file is read.
    #[command(flatten)]
    pub scene: SceneArgs,

    /// Worker threads [default: one per core]
    #[arg(long, value_name = "NUMBER", value_parser = values::threads())]
    pub threads: Option<u16>,

    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
}

/// Where a picture is taken from.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// Look through the camera of this name [default: the first one; from outside if there is none]
    #[arg(long, value_name = "NAME", conflicts_with = "orbit")]
    pub camera: Option<String>,

    /// Look from outside, so many degrees around the scene
    #[arg(
        long,
        value_name = "DEGREES",
        value_parser = values::azimuth,
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "35",
    )]
    pub orbit: Option<f32>,

    /// Width and height, pixels [default: 720 high, as wide as the camera says]
    #[arg(long, value_name = "WxH", value_parser = values::picture_size)]
    pub size: Option<[u32; 2]>,
}

/// How a baked file is read.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// What is seen behind the scene: R,G,B[,STRENGTH] or an .exr or .hdr FILE[,STRENGTH] [default: the file's sky]
    #[arg(long, value_parser = values::sky, allow_hyphen_values = true)]
    pub sky: Option<Sky>,

    /// Name or number of the glTF scene [default: the file's default scene]
    #[arg(long, value_name = "NAME")]
    pub scene: Option<String>,

    /// Let the file name files outside its own folder
    #[arg(long)]
    pub allow_outside: bool,
}

impl ViewArgs {
    /// What they mean.
    pub fn view(&self) -> View {
        match (&self.camera, self.orbit) {
            (Some(name), _) => View::Camera(name.clone()),
            (None, Some(azimuth_deg)) => View::Orbit { azimuth_deg },
            (None, None) => View::First,
        }
    }
}

impl SceneArgs {
    /// What they mean.
    pub fn import(&self) -> ImportOptions {
        ImportOptions {
            scene: self.scene.clone(),
            // Lamps are not looked at; this keeps the reader from guessing.
            lamp_units: LampUnits::Unitless,
            sky: self.sky.clone().map(|sky| sky.0),
            sun_angle_deg: None,
            allow_outside: self.allow_outside,
        }
    }
}

/// Takes the picture, tells how, and returns the exit code.
pub fn run(args: &RenderArgs) -> ExitCode {
    let output = args.output.clone().unwrap_or_else(|| args.input.with_extension("png"));
    let taken = in_pool(args.threads.map(usize::from), || -> Result<Picture> {
        export::settle(&args.input);
        let baked = baked::read(&args.input, &args.scene.import())?;
        let (view, size) = (args.view.view(), args.view.size);
        let options = RenderOptions { view, size, exposure: args.exposure, tone: args.tone.0 };
        let picture = render::picture(&baked, &options)?;
        export::write_png(&output, picture.size, &picture.rgb)?;
        Ok(picture)
    });
    match taken.and_then(|taken| taken) {
        Ok(picture) => {
            if !args.quiet {
                let [width, height] = picture.size;
                failure::say(&format!(
                    "wrote {}: {width} × {height}, camera '{}', exposure {:.2}",
                    printable(&output.display().to_string()),
                    printable(&picture.camera),
                    picture.exposure_ev
                ));
            }
            ExitCode::SUCCESS
        }
        Err(error) => failure::error(&error, &args.input),
    }
}
