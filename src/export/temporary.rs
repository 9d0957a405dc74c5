//! Files under temporary names, and what killed runs left of them.
//!
//! Whoever writes a temporary file holds a lock on it, which the system takes away when the process ends, however it
//! ends. So a file that nobody holds is a leftover, and one of a bake that still runs is left alone, in this process or
//! any other.

use super::journal;
use std::fs::{DirEntry, File, TryLockError};
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// What every temporary name begins with, so that leftovers of a killed run can be told.
pub const TEMPORARY_PREFIX: &str = ".lightkiln-";
/// What it ends with.
const SUFFIX: &str = ".tmp";
/// How often a name is tried again that another process took for a leftover before it was locked.
const TRIES: usize = 16;

/// A new file in `folder`, locked; dropped, it vanishes.
pub(super) fn file_in(folder: &Path) -> Result<NamedTempFile> {
    for _ in 0..TRIES {
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMPORARY_PREFIX).suffix(SUFFIX);
        // Temporary files are private by default; these become ordinary files, and the umask still applies.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(folder)?;
        let taken = matches!(file.as_file().try_lock(), Err(TryLockError::WouldBlock));
        // Swept between its creation and its lock, it has no name any more. Where there are no locks nothing is swept.
        if !taken && file.path().exists() {
            return Ok(file);
        }
    }
    Err(Error::new(ErrorKind::ResourceBusy, "another process removes the temporary files of this folder"))
}

/// Ends what killed runs began to rename in `folder`, then removes the temporary files there that no process holds. What
/// cannot be removed stays: it is in nobody's way.
pub(super) fn sweep(folder: &Path) {
    journal::settle(folder);
    for path in named(folder, SUFFIX) {
        let Ok(file) = File::open(&path) else { continue };
        // A journal is looked for when the lock is had: who held it may have died over its renames just now.
        if file.try_lock().is_ok() && !journal::unsettled(folder) {
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// The files in `folder` whose names are ours and end so; not what a link or a pipe of such a name leads to.
pub(super) fn named(folder: &Path, suffix: &str) -> impl Iterator<Item = PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let ours = move |entry: &DirEntry| {
        let name = entry.file_name();
        name.to_str().is_some_and(|name| name.starts_with(TEMPORARY_PREFIX) && name.ends_with(suffix))
            && entry.file_type().is_ok_and(|kind| kind.is_file())
    };
    entries.filter(ours).map(|entry| entry.path())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leftovers_go_and_files_in_use_stay() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let held = file_in(folder.path()).unwrap();
        std::fs::write(at(".lightkiln-killed.tmp"), "half").unwrap();
        std::fs::write(at(".lightkiln-notes.txt"), "the artist's").unwrap();
        std::fs::write(at("room.glb"), "precious").unwrap();
        std::fs::create_dir(at(".lightkiln-folder.tmp")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("room.glb"), at(".lightkiln-link.tmp")).unwrap();
        sweep(folder.path());
        assert!(!at(".lightkiln-killed.tmp").exists());
        assert!(held.path().exists());
        for kept in [".lightkiln-notes.txt", ".lightkiln-folder.tmp", "room.glb"] {
            assert!(at(kept).exists(), "{kept}");
        }
        #[cfg(unix)]
        assert!(at(".lightkiln-link.tmp").exists());
        drop(held);
        sweep(&at("no such folder"));
    }

    #[test]
    fn many_that_sweep_and_write_at_once_lose_nothing() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let folder = folder.path();
                scope.spawn(move || {
                    for round in 0..50 {
                        sweep(folder);
                        let file = file_in(folder).unwrap();
                        sweep(folder);
                        file.persist(folder.join(format!("{thread}-{round}"))).unwrap();
                    }
                });
            }
        });
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 200);
    }
}
