//! Ctrl-C and SIGTERM: the first asks the bake to stop and write what it has, the second quits at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of an interrupted run.
pub const INTERRUPTED: u8 = 130;

/// Sets `cancel` on the first signal and calls `first`; ends the process on the second.
pub fn listen(cancel: Arc<AtomicBool>, first: impl Fn() + Send + 'static) {
    // Without a handler a signal ends the process, as it does anywhere: nothing to tell.
    let _ = ctrlc::set_handler(move || {
        if cancel.swap(true, Ordering::SeqCst) {
            remove_temporaries();
            std::process::exit(INTERRUPTED.into());
        }
        first();
    });
}

/// Removes the half-written files that this process has open; another bake in the same folder keeps its own.
#[cfg(target_os = "linux")]
fn remove_temporaries() {
    let Ok(open) = std::fs::read_dir("/proc/self/fd") else { return };
    for path in open.flatten().filter_map(|entry| std::fs::read_link(entry.path()).ok()) {
        let name = path.file_name().and_then(|name| name.to_str());
        if name.is_some_and(|name| name.starts_with(TEMPORARY_PREFIX) && name.ends_with(".tmp")) {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Elsewhere the system does not tell which files are open: they stay, under names that say what they are.
#[cfg(not(target_os = "linux"))]
fn remove_temporaries() {}

/// What the names of the library's temporary files begin with.
#[cfg(target_os = "linux")]
const TEMPORARY_PREFIX: &str = ".lightkiln-";

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::fs::File;

    #[test]
    fn only_what_this_process_writes_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let ours = File::create(path(".lightkiln-ours.tmp")).unwrap();
        let scene = File::create(path("room.glb")).unwrap();
        drop(File::create(path(".lightkiln-theirs.tmp")).unwrap());
        remove_temporaries();
        assert!(!path(".lightkiln-ours.tmp").exists());
        assert!(path(".lightkiln-theirs.tmp").exists() && path("room.glb").exists());
        drop((ours, scene));
    }
}
