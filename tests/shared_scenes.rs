//! Import over scenes made by others. They lie beside the repository where it is developed; elsewhere the tests say
//! that they are skipped.

#![allow(clippy::print_stdout, clippy::print_stderr)] // They report what became of each file.

use lightkiln::import;
use lightkiln::options::ImportOptions;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// What the validator calls errors that change which triangles stand where: such files must be refused.
const GEOMETRY_ERRORS: [&str; 22] = [
    "ACCESSOR_INDEX_OOB",
    "ACCESSOR_INDEX_PRIMITIVE_RESTART",
    "ACCESSOR_INVALID_FLOAT",
    "ACCESSOR_SMALL_BYTESTRIDE",
    "ACCESSOR_SPARSE_INDEX_OOB",
    "ACCESSOR_SPARSE_INDICES_NON_INCREASING",
    "ACCESSOR_TOO_LONG",
    "BUFFER_VIEW_TOO_LONG",
    "GLB_CHUNK_TOO_BIG",
    "GLB_DUPLICATE_CHUNK",
    "GLB_LENGTH_MISMATCH",
    "GLB_UNEXPECTED_END_OF_CHUNK_DATA",
    "GLB_UNEXPECTED_END_OF_CHUNK_HEADER",
    "INVALID_JSON",
    "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT",
    "MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT",
    "MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT",
    "NODE_LOOP",
    "NODE_MATRIX_TRS",
    "NODE_PARENT_OVERRIDE",
    "SCENE_NON_ROOT_NODE",
    "UNKNOWN_ASSET_MAJOR_VERSION",
];

/// Broken where the triangles do not look: the views that are too long belong to no primitive.
const BROKEN_ELSEWHERE: [&str; 1] = ["assimp/IncorrectVertexArrays/Cube.gltf"];

fn shared() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let found = ["../shared/scenes", "../../shared/scenes"].iter().map(|p| root.join(p)).find(|p| p.is_dir());
    if found.is_none() {
        eprintln!("skipped: there is no ../shared/scenes beside the repository");
    }
    found
}

fn scenes(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut waiting = vec![folder.to_owned()];
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension().and_then(|e| e.to_str()) {
                _ if path.is_dir() => waiting.push(path),
                Some("gltf" | "glb") => found.push(path),
                _ => {}
            }
        }
    }
    found.sort();
    assert!(!found.is_empty(), "no scenes in {}", folder.display());
    found
}

/// What a scene turned into, or why not.
fn outcome(path: &Path) -> Result<String, String> {
    let loaded = catch_unwind(AssertUnwindSafe(|| import::load(path, &ImportOptions::default())));
    match loaded {
        Ok(Ok((document, scene))) => {
            check(&document, &scene, path);
            for warning in &scene.warnings {
                println!("  {}: {}", warning.at, warning.what);
            }
            Ok(format!(
                "{} surfaces, {} triangles, {} lamps, {} textures, {} warnings",
                scene.surfaces.len(),
                scene.surfaces.iter().map(|s| scene.geometry(s).triangles.len()).sum::<usize>(),
                scene.lamps.len(),
                scene.textures.len(),
                scene.warnings.len()
            ))
        }
        Ok(Err(error)) => Err(error.to_string()),
        Err(_) => panic!("{} panicked", path.display()),
    }
}

/// What every scene promises to the stages after it.
fn check(document: &import::Document, scene: &lightkiln::scene::Scene, path: &Path) {
    let at = path.display();
    for surface in &scene.surfaces {
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
        let raw = document.raw_primitive(surface.origin.mesh, surface.origin.primitive).unwrap();
        assert_eq!(raw.triangles, geometry.triangles, "{at}");
        let position = &raw.attributes.iter().find(|(name, _)| name == "POSITION").unwrap().1;
        assert_eq!(position.count, vertices, "{at}");
    }
}

#[test]
fn every_scene_that_others_made_loads() {
    let Some(shared) = shared() else { return };
    let mut refused = Vec::new();
    for folder in ["features", "real", "kits"] {
        for path in scenes(&shared.join(folder)) {
            match outcome(&path) {
                Ok(what) => println!("{}: {what}", path.display()),
                Err(what) => refused.push(format!("{}: {what}", path.display())),
            }
        }
    }
    // Features that are none of ours, and scenes of points and lines, are refused with these words; nothing else is.
    let reasons = ["which is not supported", "needs a reader of glTF 2.1", "no triangles to bake"];
    refused.retain(|line| !line.contains("features") || !reasons.iter().any(|reason| line.contains(reason)));
    assert!(refused.is_empty(), "refused:\n{}", refused.join("\n"));
}

#[test]
fn broken_files_are_refused_and_controls_do_not_crash() {
    let Some(shared) = shared() else { return };
    let folder = shared.join("invalid");
    let expected = std::fs::read_to_string(folder.join("EXPECTED.tsv")).unwrap();
    let mut wrong = Vec::new();
    let mut known: BTreeMap<PathBuf, ()> = BTreeMap::new();
    for row in expected.lines().skip(1) {
        let columns: Vec<&str> = row.split('\t').collect();
        let path = folder.join(columns[0]);
        if !path.is_file() {
            continue;
        }
        known.insert(path.clone(), ());
        let codes = columns.get(3).copied().unwrap_or_default();
        let outcome = outcome(&path);
        println!("{}\t{}\t{}\t{outcome:?}", columns[0], columns[1], codes);
        let must_be_refused = codes.split(',').any(|code| GEOMETRY_ERRORS.contains(&code));
        if must_be_refused && outcome.is_ok() && !BROKEN_ELSEWHERE.contains(&columns[0]) {
            wrong.push(format!("{}: {codes} but {outcome:?}", columns[0]));
        }
    }
    for path in scenes(&folder) {
        if !known.contains_key(&path) {
            println!("{}\tunlisted\t{:?}", path.display(), outcome(&path));
        }
    }
    assert!(wrong.is_empty(), "accepted:\n{}", wrong.join("\n"));
}
