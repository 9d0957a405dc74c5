//! Bytes -> a picture: of the sky (OpenEXR, Radiance HDR), and on a surface (PNG, JPEG, WebP).
#![no_main]

use base64::Engine;
use lightkiln_fuzz::{begin, run, sound};
use serde_json::json;

libfuzzer_sys::fuzz_target!(init: begin(), |data: &[u8]| {
    run(|| {
        let text = base64::engine::general_purpose::STANDARD.encode(data);
        let uri = format!("data:application/octet-stream;base64,{text}");
        let corners = "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
        let file = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": 36, "uri": corners}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
            "images": [{"uri": uri}],
            "textures": [{"source": 0}],
            "materials": [{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
            "nodes": [{"mesh": 0}],
            "scenes": [{"nodes": [0], "extras": {"lightkiln.sky": uri}}],
            "scene": 0
        });
        let text = serde_json::to_vec(&file).expect("text");
        drop(sound::import(&text, &Default::default()));
    });
});
