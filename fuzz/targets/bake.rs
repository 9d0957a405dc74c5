//! The whole way, from file to file.
#![no_main]

use lightkiln_fuzz::{begin, mutator, run, sound};

libfuzzer_sys::fuzz_target!(init: begin(), |data: &[u8]| {
    run(|| {
        let Ok((document, scene)) = sound::import(data, &Default::default()) else { return };
        if !sound::small(&scene) {
            return;
        }
        let options = sound::options(&document.json);
        let folder = tempfile::tempdir().expect("a folder");
        drop(sound::bake(data, &options, folder.path()));
    });
});
libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    mutator(data, size, max_size, seed)
});
