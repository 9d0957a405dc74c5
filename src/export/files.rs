//! All files of a bake, or none: each is written under a temporary name in its own folder, then all are renamed.
//!
//! What is guaranteed, whenever the process or the machine stops: the input is as it was; a file that stands under its
//! name is whole; and a glTF belongs to the pages beside it, both new or both as they were. No system renames several
//! files at once, so what several files of an older bake stand in the way of is first taken aside, the glTF before its
//! pages, and comes back when a rename fails. Who is killed between two of these renames leaves the older files, as the
//! new ones, under temporary names. Those vanish with the next bake into the folder (`temporary.rs`).

use super::temporary;
use crate::error::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};

/// Files under temporary names; dropped, they vanish.
pub(super) struct Batch {
    staged: Vec<(NamedTempFile, PathBuf)>,
    /// Files of the input, canonical: never to be replaced.
    protected: BTreeSet<PathBuf>,
    /// Names that files of this bake will have.
    reserved: BTreeSet<PathBuf>,
    /// Staged copies, with what they are copies of.
    copies: BTreeMap<PathBuf, PathBuf>,
    /// Folders without leftovers of killed runs.
    swept: BTreeSet<PathBuf>,
}

impl Batch {
    /// Nothing staged yet; `protected` files are never replaced.
    pub fn new(protected: impl IntoIterator<Item = PathBuf>) -> Self {
        let protected = protected.into_iter().filter_map(|path| path.canonicalize().ok()).collect();
        Self {
            staged: Vec::new(),
            protected,
            reserved: BTreeSet::new(),
            copies: BTreeMap::new(),
            swept: BTreeSet::new(),
        }
    }

    /// Keeps names for files that will be added later.
    pub fn reserve(&mut self, paths: impl IntoIterator<Item = PathBuf>) {
        self.reserved.extend(paths);
    }

    /// Whether a file of this bake has, or will have, this name.
    pub fn has(&self, path: &Path) -> bool {
        self.reserved.contains(path) || self.staged.iter().any(|(_, staged)| staged == path)
    }

    /// Whether `path` will be a copy of `source`.
    pub fn copies(&self, path: &Path, source: &Path) -> bool {
        self.copies.get(path).is_some_and(|known| known == source)
    }

    /// Adds a copy of a file, making the folder it goes to.
    pub fn add_copy(&mut self, path: &Path, source: PathBuf, bytes: &[u8]) -> Result<()> {
        let folder = folder_of(path);
        std::fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
        self.add(path, &[bytes])?;
        self.copies.insert(path.to_owned(), source);
        Ok(())
    }

    /// Writes the parts, one after the other, as what will be `path`.
    pub fn add(&mut self, path: &Path, parts: &[&[u8]]) -> Result<()> {
        self.refuse_input(path)?;
        let folder = folder_of(path);
        let told = |error| Error::io(path, error);
        if self.swept.insert(folder.to_owned()) {
            temporary::sweep(folder);
        }
        let mut file = temporary::file_in(folder).map_err(told)?;
        for part in parts {
            file.write_all(part).map_err(told)?;
        }
        // Renamed before its bytes are on the disk, a file would be empty after a power cut.
        file.as_file().sync_all().map_err(told)?;
        self.staged.push((file, path.to_owned()));
        Ok(())
    }

    /// Gives every file its name, in the order they were added, and returns the names. On an error every name has what
    /// it had before.
    pub fn commit(self) -> Result<Vec<PathBuf>> {
        self.commit_by(&mut |from, to| std::fs::rename(from, to))
    }

    fn commit_by(self, rename: &mut Rename) -> Result<Vec<PathBuf>> {
        let mut older = Older::default();
        let mut written = Vec::with_capacity(self.staged.len());
        // A single file is replaced at once.
        let mut done = if self.staged.len() > 1 {
            self.staged.iter().rev().try_for_each(|(_, path)| older.take_aside(path, rename))
        } else {
            Ok(())
        };
        for (file, path) in self.staged {
            done = done.and_then(|()| {
                let told = |error| Error::io(&path, error);
                // The lock is held until the file has its name.
                let (_file, temporary) = file.keep().map_err(|failed| told(failed.error))?;
                rename(&temporary, &path).map_err(|error| {
                    let _ = std::fs::remove_file(&temporary);
                    told(error)
                })?;
                written.push(path);
                Ok(())
            });
        }
        if let Err(error) = done {
            written.iter().rev().for_each(|path| drop(std::fs::remove_file(path)));
            older.bring_back(rename);
            return Err(error);
        }
        drop(older);
        let folders: BTreeSet<&Path> = written.iter().map(|path| folder_of(path)).collect();
        for folder in folders {
            // The names themselves; not every system lets a folder be opened for this, and nothing is lost where not.
            let _ = File::open(folder).and_then(|folder| folder.sync_all());
        }
        Ok(written)
    }

    /// Fails where `path` is a file of the input, or one of this batch.
    pub fn refuse_input(&self, path: &Path) -> Result<()> {
        let target = path.canonicalize();
        if target.is_ok_and(|target| self.protected.contains(&target)) {
            return Err(Error::invalid(
                path.display().to_string(),
                "the input is made of this file, and the input is never changed: choose another output name",
            ));
        }
        if self.staged.iter().any(|(_, staged)| staged == path) {
            return Err(Error::invalid(
                path.display().to_string(),
                "two files of this bake would have this name: choose another output name",
            ));
        }
        Ok(())
    }
}

/// Moves a file from one name to another in the same folder, in place of what has that name.
type Rename<'a> = dyn FnMut(&Path, &Path) -> std::io::Result<()> + 'a;

/// Files under temporary names that stand under their own no more; dropped, they vanish.
#[derive(Default)]
struct Older(Vec<Aside>);

struct Aside {
    path: PathBuf,
    temporary: TempPath,
    /// Locked, so that no other process takes the file for a leftover.
    _held: Option<File>,
}

impl Older {
    /// Takes the file of this name aside, if there is one.
    fn take_aside(&mut self, path: &Path, rename: &mut Rename) -> Result<()> {
        // What is no file is in the way, and the rename will say so.
        if !path.symlink_metadata().is_ok_and(|there| !there.is_dir()) {
            return Ok(());
        }
        let told = |error| Error::io(path, error);
        let (_placeholder, temporary) = temporary::file_in(folder_of(path)).map_err(told)?.into_parts();
        let held = File::open(path).ok().filter(|file| file.try_lock().is_ok());
        rename(path, &temporary).map_err(told)?;
        self.0.push(Aside { path: path.to_owned(), temporary, _held: held });
        Ok(())
    }

    /// Gives every file its name again, the last one that went first.
    fn bring_back(self, rename: &mut Rename) {
        for aside in self.0.into_iter().rev() {
            match rename(&aside.temporary, &aside.path) {
                Ok(()) => drop(aside.temporary.keep()),
                // Not deleted, at least not now.
                Err(_) => std::mem::forget(aside.temporary),
            }
        }
    }
}

/// Fails where no file can be made in the folder; leaves nothing behind, of killed runs neither.
pub(super) fn check_folder(folder: &Path) -> Result<()> {
    temporary::sweep(folder);
    temporary::file_in(folder).map(drop).map_err(|error| Error::io(folder, error))
}

/// The folder a file is in; `.` for a bare name.
pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut found: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        found.sort();
        found
    }

    #[test]
    fn nothing_stands_under_its_name_before_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.glb"));
        std::fs::write(&a, "old").unwrap();
        let mut batch = Batch::new([]);
        batch.add(&a, &[b"new", b"er"]).unwrap();
        batch.add(&b, &[b"second"]).unwrap();
        assert_eq!(std::fs::read(&a).unwrap(), b"old");
        assert!(!b.exists());
        assert_eq!(batch.commit().unwrap(), [a.clone(), b.clone()]);
        assert_eq!(std::fs::read(&a).unwrap(), b"newer");
        assert_eq!(names(folder.path()), ["a.exr", "b.glb"]);
    }

    #[test]
    fn an_error_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let mut batch = Batch::new([]);
        batch.add(&folder.path().join("a.exr"), &[b"x"]).unwrap();
        let missing = folder.path().join("missing").join("b.glb");
        let error = batch.add(&missing, &[b"y"]).unwrap_err();
        assert!(matches!(&error, Error::Io { path, .. } if *path == missing), "{error}");
        drop(batch);
        assert_eq!(names(folder.path()), [""; 0]);
    }

    #[test]
    fn input_files_are_never_replaced_whatever_their_spelling() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("in.glb");
        std::fs::write(&input, "precious").unwrap();
        let mut batch = Batch::new([input.clone(), folder.path().join("not there")]);
        let crooked = folder.path().join(".").join("in.glb");
        assert!(batch.add(&crooked, &[b"x"]).unwrap_err().to_string().contains("another output name"));
        assert!(batch.add(&folder.path().join("out.glb"), &[b"x"]).is_ok());
        assert!(batch.add(&folder.path().join("out.glb"), &[b"y"]).is_err());
        drop(batch);
        assert_eq!(std::fs::read(&input).unwrap(), b"precious");
    }

    /// A batch that replaces an older glTF and its page; what each name holds.
    fn rebake(folder: &Path) -> (Batch, [PathBuf; 3]) {
        let paths = ["a.exr", "b.exr", "c.glb"].map(|name| folder.join(name));
        std::fs::write(&paths[0], "old").unwrap();
        std::fs::write(&paths[2], "old").unwrap();
        let mut batch = Batch::new([]);
        paths.iter().for_each(|path| batch.add(path, &[b"new"]).unwrap());
        (batch, paths)
    }

    #[test]
    fn between_any_two_renames_a_gltf_has_the_pages_it_was_made_with() {
        let folder = tempfile::tempdir().unwrap();
        let (batch, paths) = rebake(folder.path());
        let mut seen = Vec::new();
        let mut look = || {
            let [a, b, gltf] = paths.each_ref().map(|path| std::fs::read_to_string(path).unwrap_or_default());
            match gltf.as_str() {
                "old" => assert_eq!([a.as_str(), b.as_str()], ["old", ""]),
                "new" => assert_eq!([a.as_str(), b.as_str()], ["new", "new"]),
                _ => assert_eq!(gltf, ""),
            }
            // What has no name is not lost.
            let kept = std::fs::read_dir(folder.path()).unwrap().flatten();
            let kept = kept.filter(|entry| std::fs::read(entry.path()).unwrap() == b"old").count();
            assert_eq!(kept, 2);
            seen.push(gltf);
        };
        // What stands in the folder before a rename is what a kill at that moment leaves.
        let renamed = batch.commit_by(&mut |from, to| {
            look();
            std::fs::rename(from, to)
        });
        assert_eq!(renamed.unwrap(), paths);
        assert_eq!(seen, ["old", "", "", "", ""]);
        assert!(paths.iter().all(|path| std::fs::read(path).unwrap() == b"new"));
        assert_eq!(names(folder.path()), ["a.exr", "b.exr", "c.glb"]);
    }

    #[test]
    fn a_rename_that_fails_leaves_what_was_there() {
        for fails in 0..5 {
            let folder = tempfile::tempdir().unwrap();
            let (batch, paths) = rebake(folder.path());
            let mut count = 0;
            let failed = batch.commit_by(&mut |from, to| {
                count += 1;
                let refused = || std::io::Error::from(std::io::ErrorKind::PermissionDenied);
                if count == fails + 1 { Err(refused()) } else { std::fs::rename(from, to) }
            });
            assert!(matches!(failed, Err(Error::Io { .. })), "{fails}");
            assert_eq!(names(folder.path()), ["a.exr", "c.glb"], "{fails}");
            assert!(
                [&paths[0], &paths[2]].iter().all(|path| std::fs::read(path).unwrap() == b"old"),
                "{fails}"
            );
        }
    }

    #[test]
    fn a_folder_in_the_way_is_told_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (batch, paths) = rebake(folder.path());
        std::fs::create_dir(&paths[1]).unwrap();
        assert!(matches!(batch.commit().unwrap_err(), Error::Io { path, .. } if path == paths[1]));
        assert!([&paths[0], &paths[2]].iter().all(|path| std::fs::read(path).unwrap() == b"old"));
        assert_eq!(names(folder.path()), ["a.exr", "b.exr", "c.glb"]);
    }

    #[cfg(unix)]
    #[test]
    fn files_are_readable_like_any_other() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("a"), folder.path().join("b"));
        let mut batch = Batch::new([]);
        batch.add(&ours, &[b"x"]).unwrap();
        batch.commit().unwrap();
        std::fs::write(&plain, "x").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
