use super::*;
use crate::options::SkyOption;
use crate::scene::Sky;
use crate::units::Radiance;
use glam::Vec3;
use serde_json::json;
use std::path::Path;

fn with_extras(extras: Value) -> Result<Scene> {
    square(json!({"scenes": [{"name": "Room", "nodes": [0], "extras": extras}]}))
}

fn constant(scene: &Scene) -> Vec3 {
    match scene.sky {
        Sky::Constant(radiance) => radiance.0,
        ref other => panic!("{other:?}"),
    }
}

/// An EXR of 4 × 2 pixels with one odd value.
fn exr_bytes(odd: f32) -> Vec<u8> {
    use exr::prelude::*;
    let mut bytes = std::io::Cursor::new(Vec::new());
    let pixels = SpecificChannels::rgb(|at: Vec2<usize>| {
        if at == Vec2(1, 0) { (odd, 0.5, 0.25) } else { (at.x() as f32, at.y() as f32, 8.0) }
    });
    Image::from_channels((4, 2), pixels).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn constant_skies_come_from_the_caller_or_the_scene() {
    assert_eq!(
        constant(&with_extras(json!({"lightkiln": {"sky": [1, 2, 3], "sky_strength": 2}})).unwrap()),
        Vec3::new(2.0, 4.0, 6.0)
    );
    assert_eq!(constant(&with_extras(json!({"sky": [1, 2, 3, 1]})).unwrap()), Vec3::new(1.0, 2.0, 3.0));
    assert!(matches!(with_extras(json!({"sky": [0, 0, 0]})).unwrap().sky, Sky::None));
    assert!(matches!(with_extras(json!("text")).unwrap().sky, Sky::None));
    let options =
        ImportOptions { sky: Some(SkyOption::Constant(Radiance::grey(0.5))), ..ImportOptions::default() };
    let rest = json!({"scenes": [{"nodes": [0], "extras": {"sky": [1, 1, 1]}}]});
    let scene = Builder::square().load_square(rest, &options).unwrap().1;
    assert_eq!(constant(&scene), Vec3::splat(0.5));
    assert!(warnings(&scene, "gives light").is_empty());
    for wrong in [
        json!({"sky": [1, 2]}),
        json!({"sky": [1, 2, -3]}),
        json!({"sky": true}),
        json!({"sky": [1, 2, "x"]}),
        json!({"sky": [1, 1, 1], "sky_strength": "x"}),
        json!({"sky": "../x.exr"}),
        json!({"sky": [1e39, 1, 1]}),
    ] {
        assert!(with_extras(wrong.clone()).is_err(), "{wrong}");
    }
}

#[test]
fn pictures_of_the_sky_are_read_and_cleaned() {
    let folder = tempfile::tempdir().unwrap();
    let load = |bytes: &[u8], strength| {
        let path = folder.path().join("sky.exr");
        std::fs::write(&path, bytes).unwrap();
        let sky = Some(SkyOption::Image { path, strength });
        let options = ImportOptions { sky, ..ImportOptions::default() };
        Builder::square().load_square(json!({}), &options).map(|(_, scene)| scene)
    };
    let pixel = |scene: &Scene, x, y| match &scene.sky {
        Sky::Image(image) => image.pixel(x, y).0,
        other => panic!("{other:?}"),
    };
    let scene = load(&exr_bytes(0.75), 2.0).unwrap();
    assert_eq!(pixel(&scene, 1, 0), Vec3::new(1.5, 1.0, 0.5));
    assert_eq!(pixel(&scene, 3, 1), Vec3::new(6.0, 2.0, 16.0));
    assert!(warnings(&scene, "sky").is_empty(), "{:?}", scene.warnings);
    for (odd, clean, word) in
        [(-1.0, 0.0, "negative"), (f32::NAN, 0.0, "negative"), (f32::INFINITY, 8.0, "infinite")]
    {
        let scene = load(&exr_bytes(odd), 1.0).unwrap();
        assert_eq!(pixel(&scene, 1, 0).x, clean);
        assert_eq!(warnings(&scene, word).len(), 1);
    }
    assert!(load(&exr_bytes(1.0), f32::NAN).is_err());
    assert!(load(b"not a picture", 1.0).is_err());
    let missing = SkyOption::Image { path: folder.path().join("none.exr"), strength: 1.0 };
    let options = ImportOptions { sky: Some(missing), ..ImportOptions::default() };
    assert!(matches!(Builder::square().load_square(json!({}), &options), Err(Error::Io { .. })));
}

#[test]
fn radiance_hdr_is_read() {
    let mut bytes = Vec::new();
    let pixels = [image::Rgb([1.0_f32, 0.5, 0.25]), image::Rgb([4.0, 2.0, 1.0])];
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 2, 1).unwrap();
    let sky = super::super::sky_image::read(&bytes, "sky.hdr", 1.0, &mut Vec::new()).unwrap();
    assert_eq!(sky.pixel(1, 0).0, Vec3::new(4.0, 2.0, 1.0));
}

#[test]
fn a_scene_names_its_sky_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("dawn.exr"), exr_bytes(1.0)).unwrap();
    let mut json = json!({"asset": {"version": "2.0"}});
    let file = Builder::square().file(json!({
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 3}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0], "extras": {"lightkiln": {"sky": "dawn.exr"}}}]
    }));
    json["unused"] = Value::Null;
    let scene =
        super::super::load_bytes(&folder.path().join("a.glb"), &file, &ImportOptions::default()).unwrap().1;
    assert!(matches!(scene.sky, Sky::Image(_)));
    let elsewhere = super::super::load_bytes(Path::new("elsewhere/a.glb"), &file, &ImportOptions::default());
    assert!(matches!(elsewhere, Err(Error::Io { .. })));
}

#[test]
fn broken_headers_take_no_memory_and_never_panic() {
    let good = exr_bytes(1.0);
    // The data window follows its name, its type and its size.
    let name = b"dataWindow\0box2i\0";
    let window = good.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    let mut vast = good.clone();
    vast[window + 8..window + 12].copy_from_slice(&i32::MAX.to_le_bytes());
    vast[window + 12..window + 16].copy_from_slice(&i32::MAX.to_le_bytes());
    assert!(super::super::sky_image::read(&vast, "sky.exr", 1.0, &mut Vec::new()).is_err());
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000000000 +X 2000000000\n".as_slice();
    assert!(super::super::sky_image::read(hdr, "sky.hdr", 1.0, &mut Vec::new()).is_err());
    for at in 0..good.len() {
        for value in [0, 1, 0x7F, 0xFF] {
            let mut bytes = good.clone();
            bytes[at] = value;
            let _ = super::super::sky_image::read(&bytes, "sky.exr", 1.0, &mut Vec::new());
        }
        let _ = super::super::sky_image::read(&good[..at], "sky.exr", 1.0, &mut Vec::new());
    }
}
