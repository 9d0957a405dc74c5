//! The same scene as different exporters write it: vertices far from their own origin, no indices, no texture coordinates,
//! nonsense where nothing looks; and texture space without room.

use super::Check;
use super::baked::{farthest, mean};
use super::bakes::{ROUNDING, lawful};
use super::hard::differing;
use super::limits::{furnished, furnished_as};
use super::model::{Model, Place, Written, effort};
use crate::error::Result;
use crate::options::Quality;
use glam::{Vec3, vec3};
use std::f64::consts::PI;

/// All of them.
pub fn writings() -> Result<Vec<Check>> {
    let mut checks = far_vertices()?;
    checks.extend(without_indices()?);
    checks.extend(attributes()?);
    checks.extend(no_room()?);
    checks.extend(less_than_black()?);
    Ok(checks)
}

/// Vertices that are a million metres from their own origin: floats are 1/16 m apart there.
const OUT_THERE: Vec3 = vec3(1e6, -1e6, 1e6);

fn far_vertices() -> Result<Vec<Check>> {
    let options = effort(Quality::Draft, 64);
    let far = Written { by: OUT_THERE, ..Written::default() };
    let place = Place { by: OUT_THERE.as_dvec3(), ..Place::HERE };
    // All its corners are multiples of 1/4 m.
    let by_node = furnished(2.0).bake(&place, &options)?;
    let by_vertex = furnished_as(far, 2.0).bake(&Place::HERE, &options)?;
    let told = by_vertex.scene.warnings.iter().any(|w| w.at.contains("shape 0") && w.what.contains("origin"));
    // A wall at 0.3 m is written at 0.3125 m, and the room is that much smaller.
    let mut model = Model::written(far);
    let glowing = model.material(0.5, 1.0);
    model.room(vec3(0.3, 0.3, 0.3), vec3(3.0, 2.0, 4.0), [glowing; 6]);
    let furnace = model.bake(&Place::HERE, &options)?;
    let (expected, found) = farthest(&furnace.all(), |_| 2.0 * PI);
    Ok(vec![
        Check::new(
            "f32 vertices 1e6 m from their origin: texels that differ from a node's 1e6 m",
            0.0,
            differing(&by_node, &by_vertex, 1.0),
            0.0,
            "multiples of 1/16 m are exact there, and so is the new origin in f64",
        ),
        Check::fact("the same: a warning names the mesh", told, "what is no multiple is rounded by 3 cm"),
        Check::new(
            "furnace of f32 vertices 1e6 m from their origin, worst texel",
            expected,
            found,
            2.0 * ROUNDING + 2.0 * options.light.solve.tolerance,
            "walls are moved by up to 3 cm, all corners of one alike: a furnace knows no size; f32, 64 ulp; the unshot share",
        ),
    ])
}

fn without_indices() -> Result<Vec<Check>> {
    let options = effort(Quality::Draft, 64);
    let loose = Written { loose: true, ..Written::default() };
    let mut model = Model::written(loose);
    let grey = model.material(0.5, 0.0);
    let floor = model.grid(vec3(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 3, grey);
    model.sun(vec3(0.3, 1.0, 0.2), 2.0, 0.0);
    let baked = model.bake(&Place::HERE, &options)?;
    let lit = 2.0 / (1.0_f64 + 0.09 + 0.04).sqrt();
    let (expected, found) = farthest(&baked.texels(floor), |_| lit);
    let mut checks = vec![Check::new(
        "no indices: a floor of 18 loose triangles in the sun, worst texel",
        expected,
        found,
        ROUNDING,
        "f32 of positions and of the stored value: 32 ulp",
    )];
    let mut model = Model::written(loose);
    let glowing = model.material(0.5, 1.0);
    model.room(Vec3::ZERO, vec3(3.0, 2.0, 4.0), [glowing; 6]);
    let furnace = model.bake(&Place::HERE, &options)?;
    let (expected, found) = farthest(&furnace.all(), |_| 2.0 * PI);
    let why = "f32, 64 ulp; the unshot share";
    let bound = 2.0 * ROUNDING + 2.0 * options.light.solve.tolerance;
    checks.push(Check::new("no indices: furnace, worst texel", expected, found, bound, why));
    Ok(checks)
}

/// What is not used must not matter, whatever it holds; what is nonsense must not get through.
fn attributes() -> Result<Vec<Check>> {
    let options = effort(Quality::Draft, 64);
    let none = furnished(2.0).bake(&Place::HERE, &options)?;
    let mut checks = Vec::new();
    for (value, name) in [(1.0, "1"), (f32::NAN, "NaN"), (f32::INFINITY, "infinity")] {
        let written = Written { texcoord: Some(value), ..Written::default() };
        let baked = furnished_as(written, 2.0).bake(&Place::HERE, &options)?;
        checks.push(Check::new(
            format!("texture coordinates of {name} that nothing uses: texels that differ from none"),
            0.0,
            differing(&none, &baked, 1.0),
            0.0,
            "what no texture is read by is not looked at",
        ));
        let written = Written { colour: Some(value), ..Written::default() };
        let baked = furnished_as(written, 2.0).bake(&Place::HERE, &options)?;
        let (expected, found) = (mean(&none.all()), mean(&baked.all()));
        let why =
            "taken as 1; interpolated by weights that add up to 1 within 3 × 2⁻²⁴, reflected 1/(1 − ρ) times";
        let bound = 3.0 * 6e-8 / (1.0 - 0.7);
        checks.push(Check::new(format!("vertex colours of {name}: mean"), expected, found, bound, why));
        checks.push(Check::fact(
            format!("vertex colours of {name}: finite, nowhere negative"),
            lawful(&baked),
            "law",
        ));
    }
    Ok(checks)
}

/// Charts of one texel with none in between.
fn no_room() -> Result<Vec<Check>> {
    let mut options = effort(Quality::Draft, 16);
    (options.atlas.gutter, options.atlas.max_pages) = (0, 1);
    let mut model = Model::default();
    let glowing = model.material(0.5, 1.0);
    model.room(Vec3::ZERO, vec3(8.0, 8.0, 8.0), [glowing; 6]);
    for i in 0..8 {
        let at = vec3(i as f32, 3.0, 3.0) + 0.25;
        model.block(at, at + 0.125, glowing);
    }
    let baked = model.bake(&Place::HERE, &options)?;
    let few = baked.lit.elements.len() <= 256;
    let noise = 4.0 * 0.5 * f64::from(options.light.direct.penumbra_rays.max(1)).powf(-0.75);
    let why = "emitters half hidden by the blocks: 4 × ½ N^(−3/4) each; all glow alike";
    Ok(vec![
        Check::fact("charts of a texel, no gutter: finite, nowhere negative", lawful(&baked) && few, "law"),
        Check::new("the same: mean of a furnace", 2.0 * PI, mean(&baked.all()), noise, why),
    ])
}

/// A reflectance below nothing is nothing, with a warning.
fn less_than_black() -> Result<Vec<Check>> {
    let mut model = Model::default();
    let odd = model.material(-0.5, 1.0);
    model.room(Vec3::ZERO, vec3(3.0, 2.0, 4.0), [odd; 6]);
    let scene = match model.scene(&Place::HERE) {
        Ok(scene) => scene,
        Err(error) => {
            let named = error.to_string().contains("material 0");
            return Ok(vec![Check::fact("ρ = −0.5 is refused, by name", named, "no surface has it")]);
        }
    };
    let told = scene.warnings.iter().any(|warning| warning.at.contains("material 0"));
    let baked = model.bake(&Place::HERE, &effort(Quality::Draft, 64))?;
    let (expected, found) = farthest(&baked.all(), |_| PI);
    Ok(vec![
        Check::fact("ρ = −0.5: a warning names the material", told, "no surface has it"),
        Check::new(
            "ρ = −0.5 taken as 0: furnace, worst texel",
            expected,
            found,
            2.0 * ROUNDING,
            "f32, 64 ulp",
        ),
    ])
}
