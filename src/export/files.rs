//! All files of a bake, or none: each is written under a temporary name in its own folder, then all are renamed.
//!
//! What is guaranteed, whenever the process or the machine stops: the input is as it was; a file that stands under its
//! name is whole; and a glTF belongs to the pages beside it, both new or both as they were. No system renames several
//! files at once, so what several files of an older bake stand in the way of is first taken aside, the glTF before its
//! pages, and comes back when a rename fails. After a kill between two of these renames some names are missing, until the
//! next run into the folder ends what was begun, by the journal (`journal.rs`): it finds all older files there, or all new.

use super::journal::{Journal, Move, Moves, Rename};
use super::temporary;
use crate::error::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

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
        // A single file is replaced at once.
        let single = self.staged.len() == 1;
        let names: Vec<PathBuf> = self.staged.iter().map(|(_, path)| path.clone()).collect();
        let (mut locks, mut folders) = (Vec::new(), Vec::<Moves>::new());
        for (file, path) in self.staged {
            let (file, temporary) = file.keep().map_err(|failed| Error::io(&path, failed.error))?;
            // What is no file is in the way, and the rename will say so.
            let older = !single && path.symlink_metadata().is_ok_and(|there| !there.is_dir());
            let (folder, file_move) = (folder_of(&path), Move::new(&temporary, &path, older));
            match folders.iter_mut().find(|moves| moves.folder == folder) {
                Some(moves) => moves.list.push(file_move),
                None => folders.push(Moves { folder: folder.to_owned(), list: vec![file_move] }),
            }
            // Held until the files have their names.
            locks.push(file);
        }
        let mut journals = Vec::new();
        let failed = |(path, error): (PathBuf, std::io::Error)| Error::io(path, error);
        let mut go = || {
            for moves in folders.iter().filter(|_| !single) {
                journals.push(Journal::begin(moves).map_err(|error| Error::io(&moves.folder, error))?);
            }
            folders.iter().try_for_each(|moves| moves.take_aside(rename)).map_err(failed)?;
            folders.iter().try_for_each(|moves| moves.place(rename)).map_err(failed)
        };
        let done = go();
        if done.is_err() {
            let back = folders.iter().rev().try_for_each(|moves| moves.take_back(rename));
            let back =
                back.and_then(|()| folders.iter().rev().try_for_each(|moves| moves.bring_back(rename)));
            if back.is_err() {
                // The journals stay, and with them what they name: the next run may do better.
                return done.map(|()| names);
            }
        }
        folders.iter().for_each(Moves::sync);
        journals.into_iter().for_each(Journal::end);
        folders.iter().for_each(Moves::clear);
        done.map(|()| names)
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

    /// What a kill at this moment leaves, after the next run looked into the folder.
    fn settled(folder: &Path) -> BTreeMap<String, Vec<u8>> {
        let left = tempfile::tempdir().unwrap();
        copy(folder, left.path());
        temporary::sweep(left.path());
        let read = |name: String| (name.clone(), std::fs::read(left.path().join(name)).unwrap());
        names(left.path()).into_iter().map(read).collect()
    }

    fn copy(from: &Path, to: &Path) {
        for name in names(from) {
            std::fs::copy(from.join(&name), to.join(&name)).unwrap();
        }
    }

    /// Which bake the files are of, whole and with nothing beside them.
    fn whole(files: &BTreeMap<String, Vec<u8>>) -> &'static str {
        let read: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (&name[..], &bytes[..])).collect();
        match read[..] {
            [("a.exr", b"old"), ("c.glb", b"old")] => "old",
            [("a.exr", b"new"), ("b.exr", b"new"), ("c.glb", b"new")] => "new",
            _ => panic!("neither bake is whole: {files:?}"),
        }
    }

    #[test]
    fn between_any_two_renames_a_gltf_has_the_pages_it_was_made_with() {
        let folder = tempfile::tempdir().unwrap();
        let (batch, paths) = rebake(folder.path());
        let (mut seen, mut found) = (Vec::new(), vec![whole(&settled(folder.path()))]);
        let mut look = || {
            let [a, b, gltf] = paths.each_ref().map(|path| std::fs::read_to_string(path).unwrap_or_default());
            match gltf.as_str() {
                "old" => assert_eq!([a.as_str(), b.as_str()], ["old", ""]),
                "new" => assert_eq!([a.as_str(), b.as_str()], ["new", "new"]),
                _ => assert_eq!(gltf, ""),
            }
            seen.push(gltf);
            found.push(whole(&settled(folder.path())));
        };
        // What stands in the folder around a rename is what a kill at that moment leaves.
        let renamed = batch.commit_by(&mut |from, to| {
            look();
            std::fs::rename(from, to)?;
            look();
            Ok(())
        });
        assert_eq!(renamed.unwrap(), paths);
        assert_eq!(seen, ["old", "", "", "", "", "", "", "", "", "new"]);
        assert_eq!(found, ["old", "old", "old", "old", "new", "new", "new", "new", "new", "new", "new"]);
        assert_eq!(whole(&settled(folder.path())), "new");
        assert_eq!(names(folder.path()), ["a.exr", "b.exr", "c.glb"]);
    }

    #[test]
    fn killed_on_the_way_back_from_an_error_one_bake_is_whole() {
        for fails in 0..5 {
            let folder = tempfile::tempdir().unwrap();
            let (batch, _) = rebake(folder.path());
            let (mut count, mut found) = (0, Vec::new());
            let failed = batch.commit_by(&mut |from, to| {
                found.push(whole(&settled(folder.path())));
                count += 1;
                if count == fails + 1 {
                    return Err(std::io::ErrorKind::PermissionDenied.into());
                }
                std::fs::rename(from, to)
            });
            assert!(failed.is_err());
            // Where all older files were aside already, a kill on the way back lets the new ones appear.
            assert_eq!(found.contains(&"new"), fails >= 2, "{found:?}");
            assert_eq!(whole(&settled(folder.path())), "old", "{fails}");
        }
    }

    #[test]
    fn what_was_saved_since_a_kill_is_not_replaced() {
        for killed_before in 1..5 {
            let (folder, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
            let mut count = 0;
            let batch = rebake(folder.path()).0;
            let renamed = batch.commit_by(&mut |from, to| {
                if count == killed_before {
                    copy(folder.path(), killed.path());
                }
                count += 1;
                std::fs::rename(from, to)
            });
            renamed.unwrap();
            let folder = killed;
            std::fs::write(folder.path().join("c.glb"), "the artist's").unwrap();
            temporary::sweep(folder.path());
            assert_eq!(std::fs::read(folder.path().join("c.glb")).unwrap(), b"the artist's");
            assert!(names(folder.path()).iter().all(|name| !name.starts_with('.')));
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_journal_that_leads_elsewhere_or_says_nothing_is_left_alone() {
        let outer = tempfile::tempdir().unwrap();
        let (folder, precious) = (outer.path().join("in"), outer.path().join("precious"));
        std::fs::create_dir(&folder).unwrap();
        for (staged, name) in
            [("../precious", "a.exr"), (".lightkiln-x/../../precious", "a.exr"), ("precious", "a.exr")]
        {
            std::fs::write(&precious, "kept").unwrap();
            std::fs::write(folder.join("precious"), "kept").unwrap();
            let unix = |name: &str| serde_json::json!({ "Unix": name.as_bytes() });
            let list = serde_json::json!([{ "staged": unix(staged), "name": unix(name), "older": false }]);
            std::fs::write(folder.join(".lightkiln-x.journal"), list.to_string()).unwrap();
            temporary::sweep(&folder);
            assert!(precious.exists() && !folder.join(name).exists(), "{staged}");
            assert_eq!(names(&folder), [".lightkiln-x.journal", "precious"]);
        }
        std::fs::write(folder.join(".lightkiln-x.journal"), "[{").unwrap();
        std::fs::write(folder.join(".lightkiln-y.tmp"), "whose?").unwrap();
        temporary::sweep(&folder);
        assert!(folder.join(".lightkiln-y.tmp").exists(), "nothing is removed that a journal may need");
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
