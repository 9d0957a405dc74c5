//! Bytes -> scene.
#![no_main]

use lightkiln_fuzz::{begin, mutator, run, sound};

libfuzzer_sys::fuzz_target!(init: begin(), |data: &[u8]| {
    run(|| drop(sound::import(data, &Default::default())));
});
libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    mutator(data, size, max_size, seed)
});
