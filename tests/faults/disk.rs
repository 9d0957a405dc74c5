//! Disks that are full, and folders that cannot be written.

use super::{Place, files};
use std::path::Path;
use std::process::Command;

/// A small disk of its own, where the system lets us mount one.
struct Disk {
    folder: tempfile::TempDir,
}

impl Disk {
    #[allow(clippy::print_stderr)] // A test that did not test says so.
    fn new(options: &str) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", options, "lightkiln-test"]).arg(folder.path());
        let mounted = mount.output().is_ok_and(|output| output.status.success());
        if !mounted {
            eprintln!("skipped: no disk can be mounted here, only root can");
        }
        mounted.then_some(Self { folder })
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.folder.path()).status();
    }
}

/// Bakes onto `folder`; the exit code and what was said.
fn bake_to(place: &Place, folder: &Path, more: &[&str]) -> (Option<i32>, String) {
    let output = place.bake_to(folder).args(more).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn a_full_disk_gets_all_files_or_none() {
    let place = Place::new();
    let before = place.files();
    let (mut full, mut enough) = (0, 0);
    for kilobytes in [4, 12, 24, 40, 56, 80, 4096] {
        let Some(disk) = Disk::new(&format!("size={kilobytes}k")) else { return };
        let (code, said) = bake_to(&place, disk.path(), &[]);
        let names: Vec<String> = files(disk.path()).into_keys().collect();
        if code == Some(0) {
            enough += 1;
            assert_eq!(names, ["lit.glb", "out.glb", "out.lightmap0.exr"]);
        } else {
            full += 1;
            assert_eq!(code, Some(1), "{said}");
            assert!(said.contains("error: ") && said.contains("hint: free some space"), "{said}");
            assert!(names.is_empty(), "{kilobytes} KiB: {names:?}");
        }
        assert_eq!(place.files(), before);
    }
    assert!(full >= 3 && enough >= 1, "{full} disks were full, {enough} were not");
}

#[test]
fn a_full_disk_keeps_what_was_there() {
    let place = Place::new();
    let Some(disk) = Disk::new("size=16k") else { return };
    std::fs::write(disk.path().join("out.glb"), "an older bake").unwrap();
    let (code, said) = bake_to(&place, disk.path(), &[]);
    assert_eq!(code, Some(1), "{said}");
    let left = files(disk.path());
    assert_eq!(left.len(), 1, "{:?}", left.keys());
    assert_eq!(left["out.glb"], b"an older bake");
}

/// The system's limit on the size of a file: a full disk that needs no mounting.
#[test]
fn a_file_that_may_not_grow_is_an_error() {
    let place = Place::new();
    let before = place.files();
    for blocks in [1, 8, 20] {
        // Ignored, the signal that comes with the limit leaves the error of the write.
        let limits = format!("trap '' XFSZ; ulimit -f {blocks}");
        let output = place.bake_within(&limits, &["--page-size", "64"]).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.starts_with("error: ") && said.contains("hint: "), "{said}");
        assert_eq!(place.files(), before, "{blocks} blocks");
    }
}

#[test]
fn a_folder_that_cannot_be_written_is_told_before_the_bake() {
    let place = Place::new();
    let before = place.files();
    if let Some(disk) = Disk::new("ro") {
        let (code, said) = bake_to(&place, disk.path(), &["-v"]);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("hint: check the permissions") && !said.contains("s  import"), "{said}");
    }
    // Nobody, root neither, makes files there.
    if Path::new("/proc/self").exists() {
        let (code, said) = bake_to(&place, Path::new("/proc/self"), &["-v"]);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("/proc/self") && !said.contains("s  import"), "{said}");
    }
    std::fs::create_dir(place.path("out.glb")).unwrap();
    let (code, said) = bake_to(&place, Path::new(""), &["-v"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("folder") && !said.contains("s  import"), "{said}");
    std::fs::remove_dir(place.path("out.glb")).unwrap();
    assert_eq!(place.files(), before);
}

/// Memory that is not there: told before the light stages where it can be foreseen.
#[cfg(target_os = "linux")]
#[test]
fn memory_that_is_not_there_is_told_in_time() {
    let place = Place::new();
    let before = place.files();
    let mut bake = place.bake_within("ulimit -v 1500000", &["--page-size", "8192", "--threads", "1"]);
    let output = bake.env("MALLOC_ARENA_MAX", "1").output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("error: memory: ") && said.contains("are left"), "{said}");
    assert_eq!(place.files(), before);
}
