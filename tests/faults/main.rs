//! What can go wrong around a bake: the input stays as it was, no file stands half written under its name, and what was
//! left of a killed run is gone after the next.

#[cfg(unix)]
mod disk;
#[cfg(unix)]
mod kill;
mod within;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Quick, but every stage runs and several files are written.
const QUICK: [&str; 6] = ["bake", "cornell.glb", "--quality", "draft", "--max-pages", "1"];

/// Files by name.
type Files = BTreeMap<String, Vec<u8>>;

/// A folder of its own with `fixtures/cornell.glb` in it.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cornell.glb");
        std::fs::copy(fixture, folder.path().join("cornell.glb")).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A bake into a folder, not yet run.
    fn bake_to(&self, folder: &Path) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lightkiln"));
        command.current_dir(self.folder.path()).args(QUICK).args(["--page-size", "64", "-o"]);
        command.arg(folder.join("out.glb")).arg("--preview").arg(folder.join("lit.glb"));
        command
    }

    /// A bake in shell, after `limits` were set.
    fn bake_within(&self, limits: &str, more: &[&str]) -> Command {
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(format!("{limits}; exec \"$0\" \"$@\"")).arg(env!("CARGO_BIN_EXE_lightkiln"));
        shell.current_dir(self.folder.path()).args(QUICK).args(more);
        shell
    }

    fn files(&self) -> Files {
        files(self.folder.path())
    }
}

/// All files of a folder.
fn files(folder: &Path) -> Files {
    let entries =
        std::fs::read_dir(folder).unwrap().map(Result::unwrap).filter(|entry| entry.path().is_file());
    let named =
        entries.map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap()));
    named.collect()
}

/// Whether a name is a temporary one, or a journal's.
fn is_temporary(name: &str) -> bool {
    let ends = name.ends_with(".tmp") || name.ends_with(".journal");
    name.starts_with(lightkiln::export::TEMPORARY_PREFIX) && ends
}
