//! `lightkiln check` on good files, and on files with one planted fault each.

use exr::prelude::write_rgb_file;
use lightkiln::bake::{Run, bake};
use lightkiln::baked;
use lightkiln::check::{Findings, Kind, check};
use lightkiln::options::{BakeOptions, ImportOptions, Quality};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const PAGE: u32 = 128;

/// A baked fixture as a `.gltf`, whose parts can be tampered with.
struct Baked {
    folder: TempDir,
}

impl Baked {
    fn new(fixture: &str) -> Self {
        Self::of(&Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(fixture))
    }

    fn of(input: &Path) -> Self {
        Self::with_page(input, PAGE)
    }

    fn with_page(input: &Path, page_size: u32) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut options = BakeOptions { light: Quality::Draft.light(), ..BakeOptions::default() };
        (options.atlas.page_size, options.atlas.max_pages) = (page_size, 1);
        options.export.output = Some(folder.path().join("room.gltf"));
        bake(input, &options, &Run::default()).expect("the fixture can be baked");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn edit(&self, change: impl FnOnce(&mut Value)) -> &Self {
        let mut json: Value = serde_json::from_slice(&fs::read(self.path("room.gltf")).unwrap()).unwrap();
        change(&mut json);
        fs::write(self.path("room.gltf"), serde_json::to_vec(&json).unwrap()).unwrap();
        self
    }

    /// Replaces the page by values of the texel's column and row.
    fn paint(&self, value: impl Fn(usize, usize) -> f32 + Sync) -> &Self {
        let size = PAGE as usize;
        write_rgb_file(self.path("room.lightmap0.exr"), size, size, |x, y| [value(x, y); 3].into()).unwrap();
        self
    }

    fn check(&self) -> Findings {
        check(&baked::read(&self.path("room.gltf"), &ImportOptions::default()).expect("it can be read"))
    }

    /// The problems, grave or not, of a kind: where and what.
    fn told(&self, kind: Kind) -> Vec<(String, String)> {
        let problems = self.check().problems.into_iter().filter(|problem| problem.kind == kind);
        problems.map(|problem| (problem.at, problem.what)).collect()
    }
}

/// The attributes of the first primitive that the named node wears.
fn attributes<'a>(json: &'a mut Value, node: &str) -> &'a mut Value {
    let nodes = json["nodes"].as_array().unwrap();
    let mesh = nodes.iter().find(|n| n["name"] == node).unwrap()["mesh"].as_u64().unwrap() as usize;
    &mut json["meshes"][mesh]["primitives"][0]["attributes"]
}

#[test]
fn a_good_bake_passes_and_its_numbers_are_right() {
    for fixture in ["cornell.glb", "corridor.glb", "instances.glb", "leaves.glb", "unlit_and_names.glb"] {
        let findings = Baked::new(fixture).check();
        assert!(findings.passes(), "{fixture}: {:?}", findings.problems);
        assert_eq!(findings.pages.len(), 1);
        let page = &findings.pages[0];
        // The atlas keeps two texels free.
        assert!(page.gap_texels >= Some(2), "{fixture}: {:?}", page.gap_texels);
        assert!(page.filled > 0.3 && page.filled <= 1.0 && page.store == "irradiance-over-pi");
        let texels: usize = findings.objects.iter().map(|object| object.texels).sum();
        assert_eq!(texels, (page.filled * f64::from(PAGE * PAGE)).round() as usize);
        for object in &findings.objects {
            let density = object.density;
            // Texels of an object cover its area, up to half a texel around every chart.
            let covered = density.area_m2 * density.texels_per_m.powi(2);
            let slack = 2.0 * covered.sqrt() * (object.charts as f64).sqrt() * 2.0 + object.charts as f64;
            assert!((covered - object.texels as f64).abs() <= slack, "{fixture}: {object:?}");
            assert!(
                density.low <= density.texels_per_m * 1.001 && density.high >= density.texels_per_m * 0.999
            );
            assert!(density.stretch >= 1.0 - 1e-9);
        }
    }
    let furnace = Baked::new("closed_furnace.glb").check();
    for object in &furnace.objects {
        // E/π is 1 everywhere, but for the noise of a draft.
        assert!(object.light.iter().all(|light| (light - 1.0).abs() < 0.01), "{object:?}");
    }
    // The room is 2 × 3 × 2.5 m.
    assert!((furnace.objects[0].density.area_m2 - 37.0).abs() < 1e-3);
}

#[test]
fn a_page_that_is_missing_or_broken_is_told() {
    let baked = Baked::new("cornell.glb");
    let page = baked.path("room.lightmap0.exr");
    let whole = fs::read(&page).unwrap();
    fs::write(&page, &whole[..whole.len() / 2]).unwrap();
    let told = baked.told(Kind::Missing);
    assert!(told.len() == 1 && told[0].0 == "room.lightmap0.exr" && told[0].1.contains("EXR"), "{told:?}");
    fs::remove_file(&page).unwrap();
    let findings = baked.check();
    assert!(!findings.passes() && findings.problems[0].what.contains("missing"), "{:?}", findings.problems);
}

#[test]
fn two_objects_on_the_same_texels_are_told_by_name() {
    let baked = Baked::new("cornell.glb");
    baked.edit(|json| {
        let floor = attributes(json, "floor")["TEXCOORD_1"].clone();
        attributes(json, "ceiling")["TEXCOORD_1"] = floor;
    });
    for kind in [Kind::Overlap, Kind::Gutter] {
        let told = baked.told(kind);
        assert!(told.len() == 1 && told[0].0 == "floor" && told[0].1.contains("ceiling"), "{told:?}");
    }
}

#[test]
fn coordinates_that_are_missing_or_outside_are_told() {
    let baked = Baked::new("cornell.glb");
    baked.edit(|json| drop(attributes(json, "floor").as_object_mut().unwrap().remove("TEXCOORD_1")));
    let told = baked.told(Kind::Range);
    assert!(told.len() == 1 && told[0].0 == "floor" && told[0].1.contains("TEXCOORD_1"), "{told:?}");

    // Positions reach beyond 1; read as two floats each they are coordinates from nowhere.
    let baked = Baked::new("grey_lamp.glb");
    baked.edit(|json| {
        let position = attributes(json, "room")["POSITION"].as_u64().unwrap() as usize;
        let mut accessor = json["accessors"][position].clone();
        accessor["type"] = json!("VEC2");
        accessor.as_object_mut().unwrap().retain(|key, _| key != "min" && key != "max");
        json["accessors"].as_array_mut().unwrap().push(accessor);
        let new = json["accessors"].as_array().unwrap().len() - 1;
        attributes(json, "room")["TEXCOORD_1"] = json!(new);
    });
    let told = baked.told(Kind::Range);
    assert!(told.len() == 1 && told[0].1.contains("outside"), "{told:?}");
}

#[test]
fn disagreement_about_the_unit_is_told() {
    let baked = Baked::new("grey_lamp.glb");
    let node = |json: &mut Value| {
        let nodes = json["nodes"].as_array_mut().unwrap();
        let room = nodes.iter_mut().find(|node| node["name"] == "room").unwrap();
        room["extras"]["lightmap"]["store"] = json!("irradiance");
    };
    assert_eq!(baked.told(Kind::Unit), []);
    assert!(baked.edit(node).told(Kind::Unit)[0].1.contains("irradiance-over-pi"));

    let baked = Baked::new("grey_lamp.glb");
    baked.edit(|json| json["materials"][0]["extensions"]["MOZ_lightmap"]["intensity"] = json!(1.0));
    let told = baked.told(Kind::Unit);
    assert!(told.len() == 1 && told[0].0 == "room" && told[0].1.contains("intensity is 1"), "{told:?}");

    let baked = Baked::new("grey_lamp.glb");
    baked.edit(|json| json["scenes"][0]["extras"]["lightmaps"][0]["store"] = json!("radiosity"));
    assert_eq!(baked.told(Kind::Unit)[0].0, "room.lightmap0.exr");
}

#[test]
fn node_and_material_that_lead_elsewhere_are_told() {
    let link = |json: &mut Value| json["materials"][0]["extensions"]["MOZ_lightmap"].clone();
    let baked = Baked::new("grey_lamp.glb");
    baked.edit(|json| {
        let exr = json["images"].as_array().unwrap().iter().position(|i| i["mimeType"] == "image/x-exr");
        json["images"][exr.unwrap()]["uri"] = json!("other.exr");
    });
    assert!(baked.told(Kind::Links)[0].1.contains("other.exr"));

    let baked = Baked::new("grey_lamp.glb");
    baked.edit(|json| {
        let texture = link(json)["index"].as_u64().unwrap() as usize;
        json["textures"][texture].as_object_mut().unwrap().remove("source");
    });
    assert!(baked.told(Kind::Links)[0].1.contains("Bevy"));

    // Blender drops the extension and keeps the extras: worth a word, no more.
    let baked = Baked::new("grey_lamp.glb");
    baked.edit(|json| drop(json["materials"][0].as_object_mut().unwrap().remove("extensions")));
    let findings = baked.check();
    assert!(findings.passes() && findings.problems.iter().any(|p| p.what.contains("extras")));
}

#[test]
fn values_that_are_no_light_are_counted() {
    let baked = Baked::new("grey_lamp.glb");
    baked.paint(|x, y| match (x, y) {
        (3, 5) => f32::NAN,
        (4, 5) => -1.0,
        (9, 9) => f32::INFINITY,
        _ => 1.0,
    });
    let findings = baked.check();
    assert_eq!(findings.pages[0].unlawful_texels, 3);
    assert!(!findings.passes());
}

#[test]
fn seams_are_steps_of_the_light_on_smooth_edges_only() {
    // Smooth statues: an even page has no steps; one of two colours has them wherever a seam's sides lie on both.
    let baked = Baked::new("corridor.glb");
    let even = baked.paint(|_, _| 2.0).check().seams;
    assert!(even.edges > 500 && even.largest == 0.0, "{even:?}");
    let halves = baked.paint(|x, _| if x < PAGE as usize / 2 { 1.0 } else { 3.0 }).check();
    // Between 1 and 3 the step is 2, the mean about 2.
    assert!((halves.seams.largest - 1.0).abs() < 0.5, "{:?}", halves.seams);
    let own = halves.objects.iter().map(|object| object.largest_seam).fold(0.0, f64::max);
    assert_eq!(own, halves.seams.largest);
    let noise = baked.paint(|x, y| ((x * 7919 + y * 104_729) % 97) as f32).check();
    assert!(noise.passes() && noise.problems.iter().any(|problem| problem.kind == Kind::Seams));
    // The walls of the Cornell box meet at creases: nothing to compare.
    assert_eq!(Baked::new("cornell.glb").check().seams.edges, 0);
}

#[test]
fn an_object_whose_normals_look_the_wrong_way_is_told() {
    // The floor of the Cornell box with its triangles turned round: it looks down into the dark.
    let folder = tempfile::tempdir().unwrap();
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cornell.glb");
    let bytes = fs::read(fixture).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    // Six 16 bit indices, 0 2 1 0 3 2: all quads of the box share theirs, so the floor gets its own.
    json["buffers"]
        .as_array_mut()
        .unwrap()
        .push(json!({"byteLength": 12, "uri": "data:application/octet-stream;base64,AAACAAEAAAADAAIA"}));
    json["bufferViews"].as_array_mut().unwrap().push(json!({"buffer": 1, "byteLength": 12}));
    let view = json["bufferViews"].as_array().unwrap().len() - 1;
    let accessor = json!({"bufferView": view, "componentType": 5123, "count": 6, "type": "SCALAR"});
    json["accessors"].as_array_mut().unwrap().push(accessor);
    let accessor = json["accessors"].as_array().unwrap().len() - 1;
    let node = json["nodes"].as_array().unwrap().iter().find(|node| node["name"] == "floor").unwrap();
    let mesh = node["mesh"].as_u64().unwrap() as usize;
    json["meshes"][mesh]["primitives"][0]["indices"] = json!(accessor);
    let mut text = serde_json::to_vec(&json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &bytes[20 + length..];
    let whole =
        [b"glTF".as_slice(), &2_u32.to_le_bytes(), &((20 + text.len() + rest.len()) as u32).to_le_bytes()];
    let chunk = [&(text.len() as u32).to_le_bytes(), b"JSON".as_slice(), &text, rest];
    let input = folder.path().join("turned.glb");
    fs::write(&input, [whole.concat(), chunk.concat()].concat()).unwrap();
    let told = Baked::of(&input).told(Kind::Flipped);
    assert!(told.len() == 1 && told[0].0 == "floor", "{told:?}");
    assert_eq!(Baked::new("cornell.glb").told(Kind::Flipped), []);
    assert_eq!(Baked::new("double_sided.glb").told(Kind::Flipped), []);
}

#[test]
fn too_few_texels_are_told_by_page_and_object() {
    let cornell = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cornell.glb");
    let told = |page_size| Baked::with_page(&cornell, page_size).told(Kind::Density);
    let few = told(24);
    assert!(few.iter().any(|(at, what)| at == "light" && what.contains("no texel")), "{few:?}");
    assert!(
        few.iter().any(|(at, what)| at == "room.lightmap0.exr" && what.contains("--page-size")),
        "{few:?}"
    );
    assert_eq!(told(PAGE), []);
}
