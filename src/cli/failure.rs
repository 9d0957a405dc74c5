//! How a run that fails ends: what is said, and with which exit code.

use super::values::has_extension;
use lightkiln::Error;
use lightkiln::text::printable;
use std::backtrace::Backtrace;
use std::io::{ErrorKind, Write as _};
use std::panic::{AssertUnwindSafe, PanicHookInfo};
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

/// Exit code of a run that could not do what it was asked to.
pub const COULD_NOT: u8 = 1;
/// Exit code of a run that was asked for something that makes no sense.
pub const USAGE: u8 = 2;

/// Writes a line to standard error. A closed stream is no reason to fail.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Help, version, or what is wrong with the arguments, as clap tells it.
pub fn usage(error: &clap::Error) -> ExitCode {
    let _ = error.print();
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(USAGE))
}

/// Arguments that are fine one by one but contradict each other.
pub fn misuse(what: &str) -> ExitCode {
    say(&format!("error: {}\n\nFor more information, try '--help'.", printable(what)));
    ExitCode::from(USAGE)
}

/// Tells what went wrong with `input` and, where it helps, what to do.
pub fn error(error: &Error, input: &Path) -> ExitCode {
    say(&format!("error: {}", printable(&error.to_string())));
    if let Some(hint) = hint(error, input) {
        say(&format!("hint: {hint}"));
    }
    ExitCode::from(COULD_NOT)
}

fn hint(error: &Error, input: &Path) -> Option<&'static str> {
    const FOREIGN: [&str; 9] = ["blend", "fbx", "obj", "dae", "usd", "usda", "usdc", "usdz", "stl"];
    if has_extension(input, &FOREIGN) && input.exists() {
        return Some("lightkiln reads glTF; in Blender, choose File > Export > glTF 2.0");
    }
    let Error::Io { path, source } = error else { return None };
    match source.kind() {
        ErrorKind::NotFound if path == input => Some("check the spelling and the folder"),
        ErrorKind::NotFound => Some("the file or its folder does not exist; restore or create it"),
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            Some("check the permissions, or choose another place with -o")
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            Some("free some space, or choose another place with -o")
        }
        ErrorKind::FileTooLarge => Some("the system limits the size of files here (ulimit -f): raise it"),
        ErrorKind::IsADirectory => Some("name a file, not a folder"),
        ErrorKind::NotADirectory => Some("a part of the path is a file, not a folder"),
        _ => None,
    }
}

/// The first panic of the process.
struct Panic {
    what: String,
    backtrace: Backtrace,
}

/// Runs a command so that a panic, on this thread or in a worker it waits for, ends as an error message that asks
/// for a report. `verbose` shows the backtrace.
pub fn guarded(verbose: bool, command: impl FnOnce() -> ExitCode) -> ExitCode {
    let first: Arc<Mutex<Option<Panic>>> = Arc::default();
    let seen = Arc::clone(&first);
    std::panic::set_hook(Box::new(move |info| {
        let mut seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.get_or_insert_with(|| Panic { what: describe(info), backtrace: Backtrace::force_capture() });
    }));
    let outcome = std::panic::catch_unwind(AssertUnwindSafe(command));
    let _ = std::panic::take_hook();
    outcome.unwrap_or_else(|_| {
        let panic = first.lock().unwrap_or_else(PoisonError::into_inner).take();
        let what = panic.as_ref().map_or("unknown", |panic| panic.what.as_str());
        say(&format!("error: internal: {}", printable(what)));
        say(&format!("This is a bug. Please report it with this command line: {}", command_line()));
        if let Some(panic) = panic.filter(|_| verbose) {
            say(&panic.backtrace.to_string());
        }
        ExitCode::from(COULD_NOT)
    })
}

fn describe(info: &PanicHookInfo) -> String {
    let payload = info.payload();
    let what = payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("panic");
    match info.location() {
        Some(location) => format!("{what} ({}:{})", location.file(), location.line()),
        None => what.to_owned(),
    }
}

/// The command line as it can be pasted into a shell.
fn command_line() -> String {
    let quoted = |argument: std::ffi::OsString| {
        let text = argument.to_string_lossy().into_owned();
        let plain = |c: char| c.is_alphanumeric() || "-_./,:=+@%".contains(c);
        if !text.is_empty() && text.chars().all(plain) {
            text
        } else {
            format!("'{}'", text.replace('\'', r"'\''"))
        }
    };
    std::env::args_os().map(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn a_panic_in_a_worker_ends_as_exit_code_one() {
        let code = guarded(false, || {
            let worker = std::thread::spawn(|| panic!("a planted panic"));
            match worker.join() {
                Ok(()) => ExitCode::SUCCESS,
                Err(payload) => std::panic::resume_unwind(payload),
            }
        });
        assert_eq!(format!("{code:?}"), format!("{:?}", ExitCode::from(COULD_NOT)));
    }

    #[test]
    fn a_hint_says_what_to_do_next() {
        let input = Path::new("no-such-room.glb");
        let io = |path: &str, kind| Error::io(path, io::Error::from(kind));
        let told = |e: &Error| hint(e, input).unwrap_or_default();
        assert!(told(&io("no-such-room.glb", ErrorKind::NotFound)).contains("spelling"));
        assert!(told(&io("room.bin", ErrorKind::NotFound)).contains("restore"));
        assert!(told(&io("room.glb", ErrorKind::StorageFull)).contains("space"));
        assert_eq!(told(&Error::invalid("room.glb", "the message already says it")), "");
    }
}
