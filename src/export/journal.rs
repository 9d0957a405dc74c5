//! What a batch is about to rename, written down first, so that the next run ends what a killed one began.
//!
//! A journal stands in the folder of the files it names, from before the first of them is renamed until after the last;
//! it is whole or not there. As long as an older file still stands under its name, nothing new has its own, and what is
//! aside goes back. Once all older files are aside, all new ones, which were on the disk before the journal, get their
//! names. No name that is taken is given again: who has saved another file there since keeps it.

use super::temporary::{self, TEMPORARY_PREFIX};
use serde::{Deserialize, Serialize};
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{BufReader, Error, ErrorKind, Read as _, Result};
use std::path::{Component, Path, PathBuf};

/// What a journal's name ends with, in place of a temporary file's ending.
const SUFFIX: &str = ".journal";

/// More is no journal: ten thousand files of long names take less.
const MOST_BYTES: u64 = 1 << 24;

/// Moves a file from one name to another in the same folder.
pub(super) type Rename<'a> = dyn FnMut(&Path, &Path) -> Result<()> + 'a;

/// A file on its way from a temporary name to its own, in the same folder. Names without folders: the folder may be moved.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Move {
    staged: OsString,
    name: OsString,
    /// Whether an older file has the name, and is taken aside.
    older: bool,
}

/// Moves within one folder.
#[derive(Debug)]
pub(super) struct Moves {
    pub folder: PathBuf,
    pub list: Vec<Move>,
}

/// A journal on the disk.
pub(super) struct Journal {
    path: PathBuf,
    /// Open and so locked: nobody settles it while its writer lives.
    _held: File,
}

impl Move {
    /// From `staged` to `path`; `older` if what stands there is taken aside rather than replaced.
    pub fn new(staged: &Path, path: &Path, older: bool) -> Self {
        let name = |path: &Path| path.file_name().unwrap_or_default().to_owned();
        Self { staged: name(staged), name: name(path), older }
    }

    /// The temporary name of the older file.
    fn aside(&self) -> PathBuf {
        Path::new(&self.staged).with_extension("old.tmp")
    }

    /// Whether a batch may have written this: names in this folder, one of them temporary.
    fn is_lawful(&self) -> bool {
        let plain = |name: &OsStr| {
            let mut parts = Path::new(name).components();
            matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == name)
        };
        plain(&self.staged)
            && plain(&self.name)
            && self.staged.to_str().is_some_and(|name| name.starts_with(TEMPORARY_PREFIX))
    }
}

impl Moves {
    fn older(&self) -> impl DoubleEndedIterator<Item = (PathBuf, PathBuf)> {
        let older = self.list.iter().filter(|file| file.older);
        older.map(|file| (self.folder.join(&file.name), self.folder.join(file.aside())))
    }

    fn new_ones(&self) -> impl DoubleEndedIterator<Item = (PathBuf, PathBuf)> {
        self.list.iter().map(|file| (self.folder.join(&file.staged), self.folder.join(&file.name)))
    }

    /// Takes the older files aside, the last first; an error comes with the name that did not work.
    pub fn take_aside(&self, rename: &mut Rename) -> std::result::Result<(), (PathBuf, Error)> {
        self.older().rev().try_for_each(|(name, aside)| rename(&name, &aside).map_err(|error| (name, error)))
    }

    /// Gives the new files their names, the first first.
    pub fn place(&self, rename: &mut Rename) -> std::result::Result<(), (PathBuf, Error)> {
        self.new_ones().try_for_each(|(staged, name)| rename(&staged, &name).map_err(|error| (name, error)))
    }

    /// Gives the new files their temporary names again, where they had got their own.
    pub fn take_back(&self, rename: &mut Rename) -> Result<()> {
        let mut placed = self.new_ones().rev().filter(|(staged, name)| !exists(staged) && exists(name));
        placed.try_for_each(|(staged, name)| rename(&name, &staged))
    }

    /// Gives the older files that are aside their names again.
    pub fn bring_back(&self, rename: &mut Rename) -> Result<()> {
        let mut aside = self.older().filter(|(_, aside)| exists(aside));
        aside.try_for_each(|(name, aside)| rename(&aside, &name))
    }

    /// Removes what has a temporary name still. What cannot be removed is the next run's to sweep.
    pub fn clear(&self) {
        let staged = self.new_ones().map(|(staged, _)| staged);
        let leftovers = staged.chain(self.older().map(|(_, aside)| aside)).filter(|path| exists(path));
        leftovers.for_each(|path| drop(std::fs::remove_file(path)));
    }

    /// Makes sure that the names are on the disk. Not every system lets a folder be opened for this.
    pub fn sync(&self) {
        let _ = File::open(&self.folder).and_then(|folder| folder.sync_all());
    }
}

impl Journal {
    /// Writes the moves down; nothing may be renamed before.
    pub fn begin(moves: &Moves) -> Result<Self> {
        let mut file = temporary::file_in(&moves.folder)?;
        serde_json::to_writer(&mut file, &moves.list)?;
        file.as_file().sync_all()?;
        let path = file.path().with_extension(SUFFIX.trim_start_matches('.'));
        let held = file.persist(&path).map_err(|failed| failed.error)?;
        moves.sync();
        Ok(Self { path, _held: held })
    }

    /// Nothing is left to do.
    pub fn end(self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Ends what killed runs began in this folder. What cannot be ended stays, and nothing temporary is to be removed there.
pub(super) fn settle(folder: &Path) {
    for path in temporary::named(folder, SUFFIX) {
        let _ = settle_one(folder, &path);
    }
}

/// Whether moves in this folder are under way, or could not be ended.
pub(super) fn unsettled(folder: &Path) -> bool {
    temporary::named(folder, SUFFIX).next().is_some()
}

fn settle_one(folder: &Path, path: &Path) -> Result<()> {
    let file = File::open(path)?;
    file.try_lock()?;
    let list = serde_json::from_reader(BufReader::new((&file).take(MOST_BYTES)))?;
    let moves = Moves { folder: folder.to_owned(), list };
    if !moves.list.iter().all(Move::is_lawful) {
        return Err(ErrorKind::InvalidData.into());
    }
    let free = |from: &Path, to: &Path| exists(from) && !exists(to);
    let rename =
        &mut |from: &Path, to: &Path| if free(from, to) { std::fs::rename(from, to) } else { Ok(()) };
    if moves.older().all(|(_, aside)| exists(&aside)) {
        moves.place(rename).map_err(|(_, error)| error)?;
    } else {
        moves.bring_back(rename)?;
    }
    moves.sync();
    std::fs::remove_file(path)
}

/// Whether something has this name, were it a link to nothing.
fn exists(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}
