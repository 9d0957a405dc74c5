//! What must hold whatever the file: an error that says something, or a sound result. `fuzz/` asks the same.

use lightkiln::atlas::{self, Atlas};
use lightkiln::bake::{self, Run};
use lightkiln::error::{Error, Result};
use lightkiln::import::{self, Document};
use lightkiln::options::{
    BakeOptions, Effect, Forced, FormFactors, ImportOptions, LampUnits, LampsOut, LightPart, Quality,
    Relaxation, RenderOptions, Solver, Store,
};
use lightkiln::plan::{self, Plan};
use lightkiln::progress::{Progress, Silent, Stage};
use lightkiln::scene::Scene;
use lightkiln::{baked, check, export, render};
use serde_json::Value;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// The most triangles a scene may have here: larger ones take long, and that is no fault.
const MOST_TRIANGLES: usize = 3000;
/// The most lamps.
const MOST_LAMPS: usize = 16;
/// The most texels of all textures.
const MOST_TEXELS: u64 = 1 << 20;
/// What a bake may plan to take, bytes.
const MEMORY_BYTES: u64 = 256 << 20;

/// Options that a file chooses for itself, by the numbers in `asset.extras.choices`: so a fuzzer finds them too.
pub fn options(json: &Value) -> BakeOptions {
    let choices = &json["asset"]["extras"]["choices"];
    let choice = |i: usize, of: usize| choices[i].as_u64().unwrap_or(0) as usize % of;
    let mut options = BakeOptions { light: Quality::Draft.light(), ..BakeOptions::default() };
    options.import.lamp_units =
        [LampUnits::Auto, LampUnits::Blender, LampUnits::Unitless, LampUnits::Gltf][choice(0, 4)];
    options.atlas.page_size = [16, 17, 32, 64][choice(1, 4)];
    options.atlas.max_pages = [1, 2, 16][choice(2, 3)];
    options.atlas.gutter = [2, 0, 1, 5][choice(3, 4)];
    options.atlas.density = [None, Some(4.0), Some(1e-6), Some(1e6), Some(f32::MIN_POSITIVE)][choice(4, 5)];
    let solve = &mut options.light.solve;
    solve.patches = [64, 1, 300][choice(5, 3)];
    solve.solver = [Solver::Progressive, Solver::Matrix][choice(6, 2)];
    solve.relaxation = [Relaxation::GaussSeidel, Relaxation::Sor, Relaxation::Cg][choice(7, 3)];
    solve.form_factors =
        [FormFactors::Auto, FormFactors::Ray, FormFactors::Hemicube, FormFactors::Analytic][choice(8, 4)];
    options.light.gather.rays = 32;
    options.light.gather.tolerance = [0.12, 0.0][choice(9, 2)];
    options.export.store = [Store::IrradianceOverPi, Store::Irradiance, Store::Radiosity][choice(10, 3)];
    options.export.light = [LightPart::Full, LightPart::Indirect, LightPart::Direct][choice(11, 3)];
    options.export.lamps = [LampsOut::Keep, LampsOut::Tag, LampsOut::Remove][choice(12, 3)];
    options.export.embed = choice(13, 2) == 1;
    options.export.full_float = choice(14, 2) == 1;
    options.effects = [Forced::none(), Forced::all(), Forced::one(Effect::BackFaces)][choice(15, 3)].clone();
    options
}

/// Reads the file; what came of it is whole, or the error says something.
pub fn import(bytes: &[u8], options: &ImportOptions) -> Result<(Document, Scene)> {
    let loaded = said(import::load_bytes(Path::new("no-such-folder/scene.glb"), bytes, options))?;
    whole(&loaded.0, &loaded.1);
    Ok(loaded)
}

/// An error names a place and says something about it.
fn said<T>(result: Result<T>) -> Result<T> {
    if let Err(error) = &result {
        let message = error.to_string();
        assert!(message.trim().len() > 10, "says nothing: {message:?}");
        assert!(!message.contains("fault of the program"), "{message}");
    }
    result
}

/// What every scene promises to the stages after it.
pub fn whole(document: &Document, scene: &Scene) {
    for surface in &scene.surfaces {
        let at = &surface.origin.name;
        let geometry = scene.geometry(surface);
        let vertices = geometry.position_local.len();
        assert_eq!(surface.position_world.len(), vertices, "{at}");
        assert_eq!(surface.normal_world.len(), vertices, "{at}");
        assert_eq!(geometry.normal_local.len(), vertices, "{at}");
        assert!(geometry.texcoords.iter().all(|set| set.len() == vertices), "{at}");
        assert!(geometry.color.is_empty() || geometry.color.len() == vertices, "{at}");
        assert!(geometry.triangles.as_flattened().iter().all(|&v| (v as usize) < vertices), "{at}");
        assert!(surface.position_world.iter().all(|p| p.is_finite()), "{at}");
        assert!(surface.normal_world.iter().all(|n| (n.length() - 1.0).abs() < 1e-4), "{at}");
        let material = scene.material(surface);
        assert!(material.emission.0.is_finite() && material.emission.0.min_element() >= 0.0, "{at}");
        assert!(material.base_color.is_finite(), "{at}");
        if surface.origin.mesh < document.json["meshes"].as_array().map_or(0, Vec::len) {
            let raw = document.raw_primitive(surface.origin.mesh, surface.origin.primitive).unwrap();
            assert_eq!(raw.triangles, geometry.triangles, "{at}");
            let position = &raw.attributes.iter().find(|(name, _)| name == "POSITION").unwrap().1;
            assert_eq!(position.count, vertices, "{at}");
        }
    }
}

/// Whether it is small enough to be worked on here.
pub fn small(scene: &Scene) -> bool {
    let triangles: usize = scene.surfaces.iter().map(|s| scene.geometry(s).triangles.len()).sum();
    let texels: u64 = scene.textures.iter().map(|t| u64::from(t.size()[0]) * u64::from(t.size()[1])).sum();
    triangles <= MOST_TRIANGLES && scene.lamps.len() <= MOST_LAMPS && texels <= MOST_TEXELS
}

/// Plans.
pub fn plan(scene: &Scene, options: &BakeOptions) -> Plan {
    let plan = plan::plan(scene, &bake::wanted(options));
    assert_eq!(plan.sides.len(), scene.surfaces.len());
    assert!(plan.effects.iter().all(|finding| !finding.reason.is_empty()));
    plan
}

/// Unwraps.
pub fn atlas(scene: &Scene, plan: &Plan, options: &BakeOptions) -> Result<Atlas> {
    static NEVER: AtomicBool = AtomicBool::new(false);
    let progress = Progress::begin(&Silent, &NEVER, Stage::Atlas, 1);
    let atlas = said(atlas::unwrap(scene, &plan.sides, &options.atlas, &progress))?;
    assert!(atlas.density.is_finite() && atlas.density >= 0.0 && (0.0..=1.0).contains(&atlas.fill));
    for placement in atlas.fronts.iter().chain(&atlas.backs).flatten() {
        let size = atlas.pages[placement.page as usize].size_texels as f32;
        let vertices = placement.unwrap.source_vertex.len();
        assert_eq!(placement.uv_texels.len(), vertices);
        assert!(
            placement
                .uv_texels
                .iter()
                .all(|uv| uv.is_finite() && uv.min_element() >= 0.0 && uv.max_element() <= size)
        );
        assert!(placement.unwrap.triangles.as_flattened().iter().all(|&v| (v as usize) < vertices));
    }
    Ok(atlas)
}

/// Lights it in memory: no texel is negative or not a number.
pub fn light(scene: &Scene, options: &BakeOptions) -> Result<()> {
    let run = Run { threads: Some(1), memory_limit_bytes: Some(MEMORY_BYTES), ..Run::default() };
    let lit = said(bake::light(scene, options, &run))?;
    for (what, values) in [("direct", &lit.direct), ("indirect", &lit.indirect)] {
        for (element, value) in values.iter().enumerate() {
            assert!(value.0.is_finite() && value.0.min_element() >= 0.0, "{what} {element}: {value:?}");
        }
    }
    Ok(())
}

/// Bakes `bytes` as `scene.glb` in a folder, looks at what was written, and leaves it there.
pub fn bake(bytes: &[u8], options: &BakeOptions, folder: &Path) -> Result<()> {
    let input = folder.join("scene.glb");
    std::fs::write(&input, bytes).unwrap();
    let mut options = options.clone();
    options.export.output = Some(folder.join("out.glb"));
    options.export.preview = Some(folder.join("lit.glb"));
    let run = Run { threads: Some(1), memory_limit_bytes: Some(MEMORY_BYTES), ..Run::default() };
    let report = said(bake::bake(&input, &options, &run))?;
    assert_eq!(std::fs::read(&input).unwrap(), bytes, "the input was changed");
    for path in &report.outputs {
        let is = |extension: &str| path.extension().is_some_and(|e| e == extension);
        if is("exr") {
            let page = export::read_exr(path).unwrap();
            let lawful = page.value.iter().all(|value| value.is_finite() && value.min_element() >= 0.0);
            assert!(lawful, "{} holds what is no light", path.display());
        }
        if is("glb") {
            import::load(path, &options.import).unwrap();
        }
    }
    let faults = report.warnings.iter().find(|warning| warning.what.contains("fault of the program"));
    assert!(faults.is_none(), "{faults:?}");
    match baked::read(&folder.join("out.glb"), &options.import) {
        Ok(baked) => look(&baked),
        // Where nothing takes light there is no lightmap to be named.
        Err(Error::Invalid { .. }) => {}
        Err(other) => panic!("{other}"),
    }
    Ok(())
}

/// Examines a baked file and takes a picture of it.
pub fn look(baked: &baked::Baked) {
    let findings = check::check(baked);
    let _ = findings.passes();
    let options = RenderOptions { size: Some([24, 16]), ..RenderOptions::default() };
    if let Ok(picture) = said(render::picture(baked, &options)) {
        assert_eq!(picture.rgb.len(), 24 * 16 * 3);
    }
}
