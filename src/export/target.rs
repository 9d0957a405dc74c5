//! Where a bake goes: the names of its files, and what must lie beside them.

use super::files::{Batch, check_folder, folder_of};
use super::uri;
use crate::error::{Error, Result, Warning};
use crate::import::Document;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// How the output is wrapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// `.glb`
    Binary,
    /// `.gltf`
    Json,
}

/// The names of the files that one output glTF consists of.
#[derive(Clone, Debug)]
pub(super) struct Target {
    /// The glTF itself.
    pub path: PathBuf,
    /// Its name without the extension: what the names of its companions begin with.
    pub stem: String,
    /// How it is wrapped.
    pub form: Form,
}

impl Target {
    /// The output for `input`: `path`, or beside the input with `.baked` in its name.
    pub fn new(input: &Path, path: Option<&Path>) -> Result<Self> {
        let extension = |path: &Path| path.extension().map(|e| e.to_ascii_lowercase());
        let path = match path {
            Some(path) => path.to_owned(),
            None if extension(input).is_some_and(|e| e == "gltf") => input.with_extension("baked.gltf"),
            None => input.with_extension("baked.glb"),
        };
        let at = || path.display().to_string();
        let form = match extension(&path) {
            Some(e) if e == "gltf" => Form::Json,
            // Other programs' names for the binary container, such as .vrm, may stay.
            Some(e) if e == "glb" || Some(&e) == extension(input).as_ref() => Form::Binary,
            _ => return Err(Error::invalid(at(), "the output's name must end in .glb or .gltf")),
        };
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let Some(stem) = stem.filter(|stem| !stem.is_empty()) else {
            return Err(Error::invalid(at(), "the output needs a file name"));
        };
        if same_file(&path, input) {
            return Err(Error::invalid(
                at(),
                "this is the input, which is never changed: choose another output",
            ));
        }
        Ok(Self { path, stem, form })
    }

    /// A companion's path.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.path.with_file_name(name)
    }

    /// The folder it all goes to.
    pub fn folder(&self) -> &Path {
        folder_of(&self.path)
    }

    /// Fails where nothing can be written, before hours are spent on what should be.
    pub fn check(&self) -> Result<()> {
        super::check_place(&self.path)
    }
}

/// Fails where no PNG of this name can be written.
pub(super) fn check_picture(path: &Path) -> Result<()> {
    if path.is_dir() || path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("png")) {
        return Err(Error::invalid(path.display().to_string(), "a picture's name must end in .png"));
    }
    check_folder(folder_of(path))
}

/// Every file the input consists of.
pub(super) fn input_files(document: &Document) -> Vec<PathBuf> {
    let folder = folder_of(&document.path);
    let mut files = vec![document.path.clone()];
    files.extend(document.buffers.iter().filter_map(|buffer| buffer.path.clone()));
    each_uri(&mut document.json.clone(), &mut |uri| {
        files.extend(find(folder, uri));
        None
    });
    files
}

/// Keeps the references to other files true when the output lies in another folder than the input.
///
/// A file inside the input's folder is copied to the same place beside the output: the reference stays letter by
/// letter, and the output's folder is whole and can be moved. Where a copy would leave the output's folder or
/// replace another file, the reference is changed to lead back to the input's file, with a warning.
pub(super) fn bring_resources(
    json: &mut Value,
    document: &Document,
    target: &Target,
    batch: &mut Batch,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    let changed = changed_buffers(document);
    for buffer in &changed {
        let what =
            "it was changed or removed while the bake ran; the light is that of what was read: bake again";
        warnings.push(Warning::new(buffer.0.display().to_string(), what));
    }
    let (from, to) = (folder_of(&document.path), target.folder());
    if same_file(from, to) {
        return Ok(());
    }
    let mut copies: BTreeMap<PathBuf, (PathBuf, Vec<u8>)> = BTreeMap::new();
    let mut failed = None;
    each_uri(json, &mut |uri| {
        let gone =
            || changed.iter().map(|(path, _)| *path).find(|path| **path == from.join(uri::to_path(uri)));
        let Some(source) = find(from, uri).or_else(|| gone().cloned()) else {
            let what = "this file is missing; the reference to it was kept as it is";
            warnings.push(Warning::new(uri, what));
            return None;
        };
        let way = uri::to_path(uri);
        let copy = to.join(&way);
        if same_file(&copy, &source) || copies.contains_key(&copy) || batch.copies(&copy, &source) {
            return None;
        }
        let read = || std::fs::read(&source);
        let as_read = changed.iter().find(|(path, _)| same_file(path, &source));
        let bytes = match as_read.map_or_else(read, |(_, bytes)| Ok(bytes.to_vec())) {
            Ok(bytes) => bytes,
            Err(error) => {
                failed.get_or_insert(Error::io(source, error));
                return None;
            }
        };
        let free = !copy.exists() && !batch.has(&copy);
        if uri::stays_inside(&way) && free {
            copies.insert(copy, (source, bytes));
            return None;
        }
        if uri::stays_inside(&way)
            && !batch.has(&copy)
            && std::fs::read(&copy).is_ok_and(|there| there == bytes)
        {
            return None;
        }
        let (folder, file) = (to.canonicalize().ok()?, source.canonicalize().ok()?);
        let back = uri::relative(&folder, &file).and_then(|way| uri::from_path(&way));
        let why = if free { "it lies outside the scene's folder" } else { "another file has its name there" };
        warnings.push(Warning::new(
            uri,
            match &back {
                Some(back) => format!("not copied beside the output, as {why}; the output refers to {back}"),
                None => format!("not copied beside the output, as {why}; put it there by hand"),
            },
        ));
        back
    });
    if let Some(error) = failed {
        return Err(error);
    }
    copies.into_iter().try_for_each(|(path, (source, bytes))| batch.add_copy(&path, source, &bytes))
}

/// Buffers whose files no longer begin with what was read of them: path, and what was read.
fn changed_buffers(document: &Document) -> Vec<(&PathBuf, &[u8])> {
    let files = document.buffers.iter().filter_map(|buffer| Some((buffer.path.as_ref()?, &buffer.bytes[..])));
    files.filter(|(path, bytes)| !begins_with(path, bytes).unwrap_or(false)).collect()
}

/// Whether a file begins with `bytes`.
fn begins_with(path: &Path, bytes: &[u8]) -> std::io::Result<bool> {
    let (mut file, mut block) = (File::open(path)?, vec![0; 1 << 16]);
    for expected in bytes.chunks(1 << 16) {
        let found = &mut block[..expected.len()];
        file.read_exact(found)?;
        if found != expected {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Calls `edit` with every reference to a file, in buffers, images and extensions alike; what it returns replaces the
/// reference. Extras belong to the artist and are not read.
fn each_uri(value: &mut Value, edit: &mut dyn FnMut(&str) -> Option<String>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                match value {
                    Value::String(uri) if key == "uri" && uri::is_relative(uri) => {
                        if let Some(new) = edit(uri) {
                            *uri = new;
                        }
                    }
                    _ if key == "extras" => {}
                    _ => each_uri(value, edit),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| each_uri(item, edit)),
        _ => {}
    }
}

/// The file a relative URI means, encoded or not.
fn find(folder: &Path, uri: &str) -> Option<PathBuf> {
    [uri::to_path(uri), PathBuf::from(uri)].iter().map(|way| folder.join(way)).find(|path| path.is_file())
}

fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    }
}
