//! What the fuzz targets share: the damage and the demands of `tests/bad_input`, and the way to libFuzzer.

#[path = "../../tests/bad_input/mutate.rs"]
pub mod mutate;
#[path = "../../tests/bad_input/sound.rs"]
pub mod sound;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// Before the first input: one thread; and panics that the library catches itself (it fences foreign decoders in) are
/// not reported. libFuzzer's own hook would end the process there.
pub fn begin() {
    // Work is done where it is asked for: no hand-overs between threads.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    std::panic::set_hook(Box::new(|info| {
        let said = format!("{info}\n{}", std::backtrace::Backtrace::force_capture());
        *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = said;
    }));
}

/// Runs one input; a panic that gets this far is a crash.
pub fn run(input: impl FnOnce()) {
    if catch_unwind(AssertUnwindSafe(input)).is_err() {
        eprintln!("{}", LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner));
        std::process::abort();
    }
}

/// libFuzzer's custom mutator: most often one to three changes that keep the file a file, else raw bytes.
pub fn mutator(data: &mut [u8], size: usize, max_size: usize, seed: u32) -> usize {
    let mut dice = mutate::Dice(seed.into());
    let parts = (dice.below(8) > 0).then(|| mutate::split(&data[..size])).flatten();
    if let Some(mut parts) = parts {
        for _ in 0..=dice.below(3) {
            mutate::change(&mut parts, &mut dice);
        }
        let bytes = mutate::join(&parts);
        if bytes.len() <= max_size {
            data[..bytes.len()].copy_from_slice(&bytes);
            return bytes.len();
        }
    }
    libfuzzer_sys::fuzzer_mutate(data, size, max_size)
}
