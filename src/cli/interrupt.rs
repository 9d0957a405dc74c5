//! Ctrl-C and SIGTERM: the first asks the bake to stop and write what it has, the second quits at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of an interrupted run.
pub const INTERRUPTED: u8 = 130;

/// Sets `cancel` on the first signal and calls `first`; calls `second` on the second and ends the process.
pub fn listen(
    cancel: Arc<AtomicBool>,
    first: impl Fn() + Send + 'static,
    second: impl Fn() + Send + 'static,
) {
    // Without a handler a signal ends the process, as it does anywhere: nothing to tell.
    let _ = ctrlc::set_handler(move || {
        if cancel.swap(true, Ordering::SeqCst) {
            second();
            std::process::exit(INTERRUPTED.into());
        }
        first();
    });
}
