//! Single values, from text to what the library takes; the messages say what was expected.

use clap::ValueEnum;
use clap::builder::{PossibleValue, RangedI64ValueParser};
use glam::Vec3;
use lightkiln::options::{
    AtlasOptions, Exposure, Forced, FormFactors, LampUnits, LampsOut, LightPart, Quality, Relaxation,
    SkyOption, Solver, Store, Tone,
};
use lightkiln::units::Radiance;
use std::fmt;
use std::path::{Path, PathBuf};

/// An enum of the library, chosen by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick<T>(pub T);

/// The names of an enum's values.
pub trait Named: Copy + Send + Sync + 'static {
    /// All values, in the order help shows them.
    const ALL: &'static [Pick<Self>];
    /// Name and a line of help.
    fn describe(self) -> (&'static str, &'static str);
}

impl<T: Named> ValueEnum for Pick<T> {
    fn value_variants<'a>() -> &'a [Self] {
        T::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (name, help) = self.0.describe();
        Some(PossibleValue::new(name).help(help))
    }
}

impl Named for Quality {
    const ALL: &'static [Pick<Self>] =
        &[Pick(Self::Draft), Pick(Self::Preview), Pick(Self::Good), Pick(Self::High), Pick(Self::Reference)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::Draft => ("draft", "where the light goes; blotches"),
            Self::Preview => ("preview", "good enough to place lamps by"),
            Self::Good => ("good", "for use"),
            Self::High => ("high", "for close looks"),
            Self::Reference => ("reference", "gathers at every texel; slow, to compare with"),
        }
    }
}

/// Which effects are simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effects {
    /// Those the scene calls for.
    Auto,
    /// All.
    All,
}

impl Effects {
    /// As the library knows it.
    pub fn forced(self) -> Forced {
        match self {
            Self::Auto => Forced::none(),
            Self::All => Forced::all(),
        }
    }
}

impl Named for Effects {
    const ALL: &'static [Pick<Self>] = &[Pick(Self::Auto), Pick(Self::All)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::Auto => ("auto", "those the scene calls for, see `lightkiln plan`"),
            Self::All => ("all", "all that can be, in vain too: slower, the same lightmap"),
        }
    }
}

impl Named for LampUnits {
    const ALL: &'static [Pick<Self>] =
        &[Pick(Self::Auto), Pick(Self::Blender), Pick(Self::Unitless), Pick(Self::Gltf)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::Auto => ("auto", "blender if Blender wrote the file, else gltf"),
            Self::Blender => {
                ("blender", "Blender's Standard export: divided by 683, as bright as in Blender")
            }
            Self::Unitless => ("unitless", "numbers as they are, W/sr and W/m²"),
            Self::Gltf => ("gltf", "candela, lux and nits taken literally"),
        }
    }
}

impl Named for Solver {
    const ALL: &'static [Pick<Self>] = &[Pick(Self::Progressive), Pick(Self::Matrix)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::Progressive => ("progressive", "shoots the largest unshot power first"),
            Self::Matrix => ("matrix", "iterates over all form factors, which it keeps; to compare with"),
        }
    }
}

impl Named for Relaxation {
    const ALL: &'static [Pick<Self>] = &[Pick(Self::GaussSeidel), Pick(Self::Sor), Pick(Self::Cg)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::GaussSeidel => ("gauss-seidel", "patch after patch from the newest values"),
            Self::Sor => ("sor", "the same with longer steps: successive over-relaxation"),
            Self::Cg => ("cg", "conjugate gradients on the symmetric system"),
        }
    }
}

impl Named for FormFactors {
    const ALL: &'static [Pick<Self>] =
        &[Pick(Self::Ray), Pick(Self::Hemicube), Pick(Self::Analytic), Pick(Self::Auto)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::Ray => ("ray", "by cosine-distributed rays"),
            Self::Hemicube => ("hemicube", "by the pixels of half cubes over the patch; slower"),
            Self::Analytic => {
                ("analytic", "by Lambert's formula for every pair, times visibility; slow, to compare with")
            }
            Self::Auto => ("auto", "closed forms for near pairs that see each other whole, rays elsewhere"),
        }
    }
}

impl Named for LightPart {
    const ALL: &'static [Pick<Self>] = &[Pick(Self::Full), Pick(Self::Indirect), Pick(Self::Direct)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::Full => ("full", "all light"),
            Self::Indirect => {
                ("indirect", "what bounced at least once, for viewers that light lamps themselves")
            }
            Self::Direct => ("direct", "what came straight from lamps, sky and emissive surfaces"),
        }
    }
}

impl Named for Store {
    const ALL: &'static [Pick<Self>] =
        &[Pick(Self::IrradianceOverPi), Pick(Self::Irradiance), Pick(Self::Radiosity)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::IrradianceOverPi => ("irradiance-over-pi", "E/π, as Blender's diffuse bake without colour"),
            Self::Irradiance => ("irradiance", "E, arriving power per area"),
            Self::Radiosity => ("radiosity", "ρE + e, leaving power per area, for unlit use"),
        }
    }
}

impl Named for LampsOut {
    const ALL: &'static [Pick<Self>] = &[Pick(Self::Keep), Pick(Self::Tag), Pick(Self::Remove)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::Keep => ("keep", "they stay as they are"),
            Self::Tag => ("tag", "they stay and are marked as baked"),
            Self::Remove => ("remove", "they are taken out, against double lighting"),
        }
    }
}

impl Named for Tone {
    const ALL: &'static [Pick<Self>] = &[Pick(Self::Filmic), Pick(Self::Clip)];

    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::Filmic => ("filmic", "like film: highlights roll off"),
            Self::Clip => ("clip", "as it is, cut at white; Blender's Standard view"),
        }
    }
}

/// `--sky`, as typed.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky(pub SkyOption);

/// `R,G,B[,STRENGTH]` or `FILE[,STRENGTH]`.
pub fn sky(text: &str) -> Result<Sky, String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|part| part.trim().parse::<f32>()).collect();
    match numbers.as_deref() {
        Ok([r, g, b]) => constant(Vec3::new(*r, *g, *b), 1.0),
        Ok([r, g, b, strength]) => constant(Vec3::new(*r, *g, *b), *strength),
        Ok(_) => Err("a colour has three numbers and perhaps a strength, such as 0.35,0.55,1.0".to_owned()),
        Err(_) => image(text),
    }
}

fn constant(color: Vec3, strength: f32) -> Result<Sky, String> {
    let radiance = color * strength;
    if color.min_element() < 0.0 || strength < 0.0 || !radiance.is_finite() {
        return Err("the numbers of a sky must be finite and not negative".to_owned());
    }
    Ok(Sky(SkyOption::Constant(Radiance(radiance))))
}

fn image(text: &str) -> Result<Sky, String> {
    let is_image = |path: &str| has_extension(Path::new(path), &["exr", "hdr"]);
    let (path, strength) = match text.rsplit_once(',') {
        Some((path, strength)) if is_image(path) => {
            (path, strength.trim().parse().map_err(|_| format!("the strength {strength:?} is not a number"))?)
        }
        _ => (text, 1.0_f32),
    };
    if !is_image(path) {
        return Err("expected a colour such as 0.35,0.55,1.0 or a .exr or .hdr file".to_owned());
    }
    if !(strength.is_finite() && strength >= 0.0) {
        return Err("the strength of a sky must be finite and not negative".to_owned());
    }
    Ok(Sky(SkyOption::Image { path: PathBuf::from(path), strength }))
}

/// Whether the name ends in one of the extensions, whatever the case.
pub fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|found| extensions.iter().any(|e| found.eq_ignore_ascii_case(e)))
}

/// `auto` or a power of two.
pub fn exposure(text: &str) -> Result<Exposure, String> {
    match (text, text.parse::<f32>()) {
        ("auto", _) => Ok(Exposure::Auto),
        (_, Ok(ev)) if (-60.0..=60.0).contains(&ev) => Ok(Exposure::Ev(ev)),
        _ => Err("expected auto, or a power of two such as -1.5; 0 shows radiance 1 as white".to_owned()),
    }
}

/// `1280x720`.
pub fn picture_size(text: &str) -> Result<[u32; 2], String> {
    let read = |side: &str| side.trim().parse::<u32>().ok().filter(|side| (1..=16_384).contains(side));
    let sides = text.split_once(['x', 'X', '×']).and_then(|(w, h)| Some([read(w)?, read(h)?]));
    sides.ok_or_else(|| "expected width x height in pixels, such as 1280x720".to_owned())
}

/// Degrees around the scene.
pub fn azimuth(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(degrees) if degrees.abs() <= 3600.0 => Ok(degrees),
        _ => Err("expected degrees around the scene, such as 35".to_owned()),
    }
}

/// Texels per metre.
pub fn density(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(density) if density.is_finite() && density > 0.0 => Ok(density),
        _ => Err("expected texels per metre, a number above 0".to_owned()),
    }
}

/// Degrees.
pub fn sun_angle(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(angle) if (0.0..=180.0).contains(&angle) => Ok(angle),
        _ => Err("expected degrees from 0 to 180; the sun seen from the earth has 0.53".to_owned()),
    }
}

/// Width of a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PageSize {
    /// So many texels.
    Texels(u32),
    /// As the error wants it.
    Auto,
}

/// Pages that follow from the error are not wider than this, texels: wider ones are for who asks for them.
pub const WIDEST_AUTO_PAGE: u32 = 4096;

impl Default for PageSize {
    fn default() -> Self {
        Self::Texels(AtlasOptions::default().page_size)
    }
}

impl fmt::Display for PageSize {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Texels(texels) => texels.fmt(f),
            Self::Auto => f.write_str("auto"),
        }
    }
}

/// Texels, or `auto`.
pub fn page_size(text: &str) -> Result<PageSize, String> {
    match text.parse::<u32>() {
        Ok(texels @ 16..=16384) => Ok(PageSize::Texels(texels)),
        _ if text == "auto" => Ok(PageSize::Auto),
        _ => Err("expected auto, or a number of texels from 16 to 16384".to_owned()),
    }
}

/// Number of pages.
pub fn pages() -> RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(1..)
}

/// Number of workers.
pub fn threads() -> RangedI64ValueParser<u16> {
    clap::value_parser!(u16).range(1..=1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_agree<T: Named + serde::Serialize>() {
        for Pick(value) in T::ALL {
            assert_eq!(serde_json::to_value(value).unwrap(), value.describe().0);
        }
    }

    #[test]
    fn the_command_line_and_the_report_name_things_alike() {
        names_agree::<Quality>();
        names_agree::<LampUnits>();
        names_agree::<LightPart>();
        names_agree::<Store>();
        names_agree::<LampsOut>();
        names_agree::<Solver>();
        names_agree::<Relaxation>();
        names_agree::<FormFactors>();
        names_agree::<Tone>();
    }

    #[test]
    fn a_sky_is_a_colour() {
        let sky_of = |rgb| Ok(Sky(SkyOption::Constant(Radiance(Vec3::from_array(rgb)))));
        assert_eq!(sky("0.35,0.55,1.0"), sky_of([0.35, 0.55, 1.0]));
        assert_eq!(sky("1, 2, 3, 0.5"), sky_of([0.5, 1.0, 1.5]));
        for wrong in
            ["1,2", "1,2,3,4,5", "-1,0,0", "1,1,1,-1", "nan,0,0", "inf,0,0", "3e38,1,1,10", "", "1,2,x"]
        {
            assert!(sky(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_sky_is_an_image() {
        let sky_of = |path: &str, strength| Ok(Sky(SkyOption::Image { path: PathBuf::from(path), strength }));
        assert_eq!(sky("noon.hdr"), sky_of("noon.hdr", 1.0));
        assert_eq!(sky("a,b/noon.EXR,0.25"), sky_of("a,b/noon.EXR", 0.25));
        assert_eq!(sky("1,2,3.exr"), sky_of("1,2,3.exr", 1.0));
        for wrong in ["noon.png", "noon.hdr,bright", "noon.hdr,-1", "noon.hdr,nan"] {
            assert!(sky(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_picture_has_a_size_and_an_exposure() {
        assert_eq!([picture_size("1280x720"), picture_size("64 × 32")], [Ok([1280, 720]), Ok([64, 32])]);
        assert_eq!([exposure("auto"), exposure("-1.5")], [Ok(Exposure::Auto), Ok(Exposure::Ev(-1.5))]);
        for wrong in ["", "0x5", "5", "99999x2", "axb"] {
            assert!(picture_size(wrong).is_err(), "{wrong}");
        }
        for wrong in ["", "bright", "nan", "inf", "1000"] {
            assert!(exposure(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        assert_eq!(density("12.5"), Ok(12.5));
        assert_eq!(sun_angle("0"), Ok(0.0));
        for wrong in ["0", "-1", "inf", "nan", "x"] {
            assert!(density(wrong).is_err(), "{wrong}");
        }
        for wrong in ["-1", "181", "nan", "x"] {
            assert!(sun_angle(wrong).is_err(), "{wrong}");
        }
    }
}
