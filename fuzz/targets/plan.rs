//! Scene -> plan.
#![no_main]

use lightkiln_fuzz::{begin, mutator, run, sound};

libfuzzer_sys::fuzz_target!(init: begin(), |data: &[u8]| {
    run(|| {
        let Ok((document, scene)) = sound::import(data, &Default::default()) else { return };
        if sound::small(&scene) {
            sound::plan(&scene, &sound::options(&document.json));
        }
    });
});
libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    mutator(data, size, max_size, seed)
});
