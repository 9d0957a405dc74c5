//! What `lightkiln check` and `lightkiln render` do with a file.
#![no_main]

use lightkiln_fuzz::{begin, mutator, run, sound};

libfuzzer_sys::fuzz_target!(init: begin(), |data: &[u8]| {
    run(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.glb");
        std::fs::write(&path, data).expect("written");
        let Ok(baked) = lightkiln::baked::read(&path, &Default::default()) else { return };
        if sound::small(&baked.scene) {
            sound::look(&baked);
        }
    });
});
libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    mutator(data, size, max_size, seed)
});
