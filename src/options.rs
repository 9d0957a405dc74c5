//! What a caller may choose: one struct a stage, every default written once, beside its field.

mod budget;
mod effects;
mod experience;

pub use budget::{Effort, ErrorBudget, Errors, growth};
pub use effects::{Effect, Forced};
pub use experience::{Anew, Experience, Step};

use crate::units::Radiance;
use std::path::PathBuf;

/// Everything `bake` can be told.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct BakeOptions {
    /// Reading the file.
    pub import: ImportOptions,
    /// Texture space.
    pub atlas: AtlasOptions,
    /// The effort of the light stages; see [`Quality::light`].
    pub light: LightOptions,
    /// When the light is good enough.
    pub goal: Goal,
    /// Effects that are simulated although the scene does not call for them.
    pub effects: Forced,
    /// What is written and how.
    pub export: ExportOptions,
}

/// When the light is good enough.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Goal {
    /// After the effort that [`BakeOptions::light`] tells.
    #[default]
    Effort,
    /// When it is estimated to be off by no more than this share of its mean, in `]0, 1[`; see [`crate::audit`].
    Tolerance(f64),
    /// When so many seconds have passed since the bake began, without those that writing takes.
    Seconds(f64),
}

/// How the numbers of lamps are meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LampUnits {
    /// `Blender` when Blender's exporter wrote the file, else `Gltf`.
    #[default]
    Auto,
    /// Blender's "Standard" export: divided by 683 lm/W; emission as is; Blender's spot curve.
    Blender,
    /// Numbers as they are, W/sr and W/m²; Blender's spot curve.
    Unitless,
    /// Candela and lux taken literally; the result is photometric.
    Gltf,
}

/// Where the sky comes from when the caller gives one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SkyOption {
    /// The same radiance from everywhere.
    Constant(#[serde(serialize_with = "rgb")] Radiance),
    /// An equirectangular image (EXR or Radiance HDR), multiplied by a strength.
    Image {
        /// The file.
        path: PathBuf,
        /// Multiplies every pixel.
        strength: f32,
    },
}

fn rgb<S: serde::Serializer>(radiance: &Radiance, to: S) -> Result<S::Ok, S::Error> {
    serde::Serialize::serialize(&radiance.0.to_array(), to)
}

/// Reading the file.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct ImportOptions {
    /// Name or index of the scene; the file's default scene when absent.
    pub scene: Option<String>,
    /// How the numbers of lamps are meant.
    pub lamp_units: LampUnits,
    /// Replaces the sky of the scene's extras.
    pub sky: Option<SkyOption>,
    /// Replaces the angular diameter of every sun, degrees.
    pub sun_angle_deg: Option<f32>,
    /// Whether a `uri` may lead out of the scene's folder.
    pub allow_outside: bool,
}

/// Texture space.
#[derive(Clone, Debug, serde::Serialize)]
pub struct AtlasOptions {
    /// Texels per metre; when absent, chosen so that one page is well filled.
    pub density: Option<f32>,
    /// Width and height of a page, texels; the most where `between_texels` says how wide.
    pub page_size: u32,
    /// What lookups between texels may be off by, as a share of the mean light: pages are then as narrow as that allows.
    /// Not together with a density.
    pub between_texels: Option<f64>,
    /// The most pages that may be written; when the density wants more, it is lowered with a warning.
    pub max_pages: u32,
    /// Empty texels kept around every chart, so that a bilinear lookup stays inside.
    pub gutter: u32,
}

impl Default for AtlasOptions {
    fn default() -> Self {
        Self { density: None, page_size: 1024, between_texels: None, max_pages: 16, gutter: 2 }
    }
}

/// The one knob.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Quality {
    Draft,
    Preview,
    #[default]
    Good,
    High,
    Reference,
}

/// The effort of the light stages.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct LightOptions {
    /// Direct light.
    pub direct: DirectOptions,
    /// The coarse solution.
    pub solve: SolveOptions,
    /// The final gather.
    pub gather: GatherOptions,
    /// Which of many independent sets of samples the light stages use: bakes that differ in nothing else err
    /// independently, as far as their errors come from sampling.
    pub seed: u32,
    /// Rays that may be spent on an estimate of the error, as a share of all others; 0 is without.
    pub audit_share: f32,
}

impl LightOptions {
    /// The share of an audit that must be, whether one was asked for or not.
    pub(crate) fn least_audit_share(&self) -> f32 {
        self.audit_share.max(AUDIT_SHARE)
    }
}

/// What an audit costs where nobody says anything.
const AUDIT_SHARE: f32 = 0.06;

impl Default for LightOptions {
    fn default() -> Self {
        Quality::default().light()
    }
}

/// Direct light.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DirectOptions {
    /// Visibility rays every texel sends towards every lamp it may see, before anything is refined; 0 refines every
    /// texel, so that each holds the mean over its own square and nothing hangs on what a few rays meet.
    pub probe_rays: u32,
    /// Visibility rays where the probes disagree.
    pub penumbra_rays: u32,
}

/// Which solver finds the coarse solution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// Shooting by largest unshot power, with ambient overshooting.
    #[default]
    Progressive,
    /// The whole matrix, by [`Relaxation`].
    Matrix,
}

/// How the matrix solver goes from one approximation to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Relaxation {
    /// Patch after patch from the newest values.
    #[default]
    GaussSeidel,
    /// The same with longer steps: successive over-relaxation by [`SolveOptions::over_relaxation`].
    Sor,
    /// Conjugate gradients on the symmetric system.
    Cg,
}

/// How form factors are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FormFactors {
    /// By cosine-distributed rays from all over the patch.
    Ray,
    /// By the pixels of hemicubes over a few points of the patch.
    Hemicube,
    /// By Lambert's formula, pair by pair, times visibility.
    Analytic,
    /// In closed form where patches stand so close that rays would be noisy and nothing stands between them, by rays
    /// elsewhere.
    #[default]
    Auto,
}

/// The coarse solution.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SolveOptions {
    /// Which solver.
    pub solver: Solver,
    /// What the matrix solver does; the progressive solver has no use for it.
    pub relaxation: Relaxation,
    /// By how much [`Relaxation::Sor`] lengthens its steps, in ]0, 2[.
    pub over_relaxation: f64,
    /// How form factors are found.
    pub form_factors: FormFactors,
    /// About how many patches the scene is cut into.
    pub patches: u32,
    /// Rays a patch of mean area sends to find its form factors, a power of two; others in proportion to the root of
    /// their area. Few will do: the gather averages over many patches.
    pub rays_per_patch: u32,
    /// Stops when the unshot power is below this share of all reflected power.
    pub tolerance: f64,
}

impl Default for SolveOptions {
    fn default() -> Self {
        Self {
            solver: Solver::default(),
            relaxation: Relaxation::default(),
            over_relaxation: 1.2,
            form_factors: FormFactors::default(),
            patches: 4000,
            rays_per_patch: 32,
            tolerance: 1e-4,
        }
    }
}

/// The final gather.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct GatherOptions {
    /// Rays of one gather.
    pub rays: u32,
    /// Interpolates where nodes agree within this share of the local light; 0 gathers at every texel.
    pub tolerance: f32,
    /// Widest distance between nodes, texels; a power of two.
    pub widest_cell: u32,
}

impl Quality {
    /// The settings a level stands for: those of its [`ErrorBudget`]; reference gathers at every texel.
    pub fn light(self) -> LightOptions {
        let base = LightOptions {
            direct: DirectOptions { probe_rays: 0, penumbra_rays: 0 },
            solve: SolveOptions::default(),
            gather: GatherOptions { rays: 0, tolerance: 0.0, widest_cell: 16 },
            seed: 0,
            audit_share: AUDIT_SHARE,
        };
        let mut light = ErrorBudget::of(self).effort().light(&base);
        if self == Self::Reference {
            light.gather.tolerance = 0.0;
        }
        light
    }
}

/// What a texel holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Store {
    /// E/π: what a white diffuse surface would radiate.
    #[default]
    IrradianceOverPi,
    /// E.
    Irradiance,
    /// b = ρE + e.
    Radiosity,
}

/// Which light is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum LightPart {
    #[default]
    Full,
    Indirect,
    Direct,
}

/// What happens to the lamps of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LampsOut {
    /// They stay.
    #[default]
    Keep,
    /// They stay and get `extras.baked: true`.
    Tag,
    /// Nodes lose their lamp.
    Remove,
}

/// What is written and how.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct ExportOptions {
    /// The baked file; beside the input with `.baked` in its name when absent.
    pub output: Option<PathBuf>,
    /// What a texel holds.
    pub store: Store,
    /// Which light is stored.
    pub light: LightPart,
    /// What happens to the lamps.
    pub lamps: LampsOut,
    /// Whether the EXRs go into the GLB.
    pub embed: bool,
    /// Whether texels are 32 bit instead of 16 bit floats.
    pub full_float: bool,
    /// A second file that stock viewers show lit.
    pub preview: Option<PathBuf>,
    /// A picture of the baked scene, a PNG.
    pub picture: Option<PathBuf>,
}

/// Where a picture is taken from.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum View {
    /// The file's first camera; from outside where it has none.
    #[default]
    First,
    /// The camera of this name.
    Camera(String),
    /// From outside and above, so far away that all of the scene is seen.
    Orbit {
        /// Way around the scene, degrees from +z towards +x.
        azimuth_deg: f32,
    },
}

impl View {
    /// Where a look from outside is from when nobody says.
    pub const AZIMUTH_DEG: f32 = 35.0;
}

/// How bright a picture is.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Exposure {
    /// The middle of what is seen becomes a middle grey.
    #[default]
    Auto,
    /// Radiances are multiplied by 2 to this power.
    Ev(f32),
}

/// How radiance becomes a colour of the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    /// A curve like film's: highlights roll off.
    #[default]
    Filmic,
    /// As it is, cut at white.
    Clip,
}

/// A picture of a baked file.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct RenderOptions {
    /// Where it is taken from.
    pub view: View,
    /// Width and height, pixels; 720 high and as wide as the camera says when absent.
    pub size: Option<[u32; 2]>,
    /// How bright it is.
    pub exposure: Exposure,
    /// How radiance becomes colour.
    pub tone: Tone,
}
