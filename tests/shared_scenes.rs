//! Scenes made by others: the importer over all of them, and the command. They lie beside the repository where it is developed; elsewhere the tests say
//! that they are skipped.

#![allow(clippy::print_stdout, clippy::print_stderr)] // They report what became of each file.

#[path = "bad_input/sound.rs"]
#[allow(dead_code)] // The fuzz targets ask for single stages.
mod sound;

use lightkiln::import;
use lightkiln::options::ImportOptions;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

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
            sound::whole(&document, &scene);
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

/// What no file here may take, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(300);

/// One run of the command in a folder of its own: what is wrong with how it ended, if anything. It must end with
/// `code`; where it could not, it must say so in words that name the file, or one it is made of, and what to do.
fn run(path: &Path, arguments: &str, code: i32) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let said = folder.path().join("said");
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightkiln"));
    command.args(arguments.split(' ')).arg(path).current_dir(folder.path());
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(std::fs::File::create(&said).unwrap());
    let (begin, mut child) = (Instant::now(), command.spawn().unwrap());
    let ended = loop {
        match child.try_wait().unwrap() {
            Some(ended) => break ended,
            None if begin.elapsed() > PATIENCE => {
                child.kill().unwrap();
                child.wait().unwrap();
                return Some(format!("{}: lightkiln {arguments} did not end", path.display()));
            }
            None => std::thread::sleep(Duration::from_millis(2)),
        }
    };
    let said = std::fs::read_to_string(&said).unwrap();
    let wrong =
        |what: &str| Some(format!("{}: lightkiln {arguments} {what}: {ended}\n{said}", path.display()));
    match ended.code() {
        Some(found) if found != code => wrong("ends with another code"),
        None => wrong("was ended"),
        Some(1) => {
            let told = said.lines().find_map(|line| line.strip_prefix("error: "));
            let Some(told) = told else { return wrong("says nothing") };
            let hint = said.lines().find_map(|line| line.strip_prefix("hint: ")).unwrap_or_default();
            let about = path.parent().unwrap().to_str().unwrap();
            if !told.contains(about) {
                return wrong("names no file");
            }
            let told = told.replace(about, "");
            let remedy = REMEDIES.iter().any(|verb| told.contains(verb) || hint.contains(verb));
            if remedy && !told.contains("internal") { None } else { wrong("says no remedy") }
        }
        Some(_) => None,
    }
}

/// Words of which one is in every message that says what to do.
const REMEDIES: [&str; 11] = [
    "export",
    "choose",
    "check",
    "restore",
    "repair",
    "save it",
    "put the file",
    "Put the file",
    "compress the",
    "run `",
    "give the",
];

/// Runs every file through the command, some at a time.
fn run_all(paths: &[PathBuf], runs: &[(&str, i32)]) {
    let wrong = Mutex::new(Vec::new());
    paths.par_iter().for_each(|path| {
        let found = runs.iter().filter_map(|&(arguments, code)| run(path, arguments, code));
        wrong.lock().unwrap().extend(found);
    });
    let mut wrong = wrong.into_inner().unwrap();
    wrong.sort();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), paths.len(), wrong.join("\n"));
}

/// As little as makes a bake.
const BAKE: &str = "bake -o out.glb --quality draft --page-size 64 --threads 1 -q";

#[test]
fn the_command_refuses_broken_files_with_words_and_exit_code_1() {
    let Some(shared) = shared() else { return };
    let paths = scenes(&shared.join("invalid"));
    let broken = |path: &&PathBuf| import::load(path, &ImportOptions::default()).is_err();
    let (refused, read): (Vec<&PathBuf>, Vec<&PathBuf>) = paths.iter().partition(broken);
    assert!(refused.len() > 300, "{}", refused.len());
    let own = |paths: Vec<&PathBuf>| paths.into_iter().cloned().collect::<Vec<_>>();
    // No file of others is a bake of ours.
    let check = ("check", 1);
    run_all(&own(refused), &[(BAKE, 1), ("plan", 1), check]);
    run_all(&own(read), &[(BAKE, 0), ("plan --quality draft --page-size 32", 0), check]);
}

#[test]
fn the_command_bakes_what_can_be_read() {
    let Some(shared) = shared() else { return };
    let paths: Vec<PathBuf> =
        ["features", "kits"].iter().flat_map(|folder| scenes(&shared.join(folder))).collect();
    let readable = |path: &PathBuf| import::load(path, &ImportOptions::default()).is_ok();
    let (read, refused): (Vec<PathBuf>, Vec<PathBuf>) = paths.into_par_iter().partition(readable);
    assert!(read.len() > 200, "{}", read.len());
    run_all(&read, &[(BAKE, 0)]);
    run_all(&refused, &[(BAKE, 1)]);
}
