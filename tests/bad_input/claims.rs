//! Tiny files that promise a great deal. The command runs in little address space: taking the memory first would end it.

use super::command::{Place, square, view};
use serde_json::{Value, json};

/// Bakes the changed square.
fn bake(change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> super::command::Ended {
    let place = Place::new();
    let bytes = square(change);
    assert!(bytes.len() < 100_000, "{} bytes are not tiny", bytes.len());
    place.write("scene.glb", &bytes);
    let ended = place.bake("-o out.glb");
    if ended.code != Some(0) {
        assert_eq!(place.names(), ["scene.glb"]);
    }
    ended
}

/// Where nothing takes light there is no density to foretell anything from.
#[test]
fn a_scene_that_takes_no_lightmap_is_planned_and_baked() {
    let place = Place::new();
    let left_out =
        |json: &mut Value, _: &mut Vec<u8>| json["nodes"][0]["extras"] = json!({"lightkiln.bake": 0});
    place.write("scene.glb", &square(left_out));
    place.run("plan scene.glb --quality draft --threads 1").warned(&[]);
    place.bake("").warned(&["no object took a lightmap"]);
}

#[test]
fn the_square_itself_bakes() {
    bake(|_, _| ()).warned(&["wrote out.glb"]);
}

#[test]
fn counts_of_elements() {
    bake(|json, _| json["accessors"][0]["count"] = json!(5)).refused(&["accessor 0"]);
    for count in [4_000_000_000, u64::MAX - 2] {
        bake(|json, _| json["accessors"][0]["count"] = json!(count)).refused(&["Square", "100 million"]);
        bake(|json, _| json["accessors"][1]["count"] = json!(count + 2)).refused(&[]);
    }
    for count in [10_000_000_u64, 20_000_000] {
        let zeros = |part: &mut Value| {
            part["count"] = json!(count);
            part.as_object_mut().unwrap().remove("bufferView");
        };
        bake(|json, _| zeros(&mut json["accessors"][0]))
            .refused(&["accessor 0", "far more than the file holds"]);
        bake(|json, _| zeros(&mut json["accessors"][1]))
            .refused(&["accessor 1", "far more than the file holds"]);
    }
    bake(|json, _| {
        json["accessors"][0]["sparse"] = json!({"count": 4_000_000_000_u64,
            "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}});
    })
    .refused(&["accessor 0", "larger than the accessor's"]);
}

#[test]
fn lengths_of_buffers_and_views() {
    for length in [61_u64, 1 << 40, u64::MAX] {
        bake(|json, _| json["buffers"][0]["byteLength"] = json!(length)).refused(&["promises"]);
        bake(|json, _| json["bufferViews"][0]["byteLength"] = json!(length)).refused(&["buffer view 0"]);
        bake(|json, _| json["bufferViews"][1]["byteOffset"] = json!(length)).refused(&["buffer view 1"]);
    }
    let place = Place::new();
    let mut bytes = square(|_, _| ());
    bytes[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    place.write("scene.glb", &bytes);
    place.bake("").refused(&["scene.glb", "ends too early"]);
}

#[test]
fn many_names_for_the_same_bytes() {
    // A primitive of 200,000 vertices in 1.2 MB is no claim; a thousand primitives that each read them all are.
    let place = Place::new();
    let bytes = square(|json, bin| {
        let zeros = vec![0; 1_200_000];
        let shared = view(json, bin, &zeros);
        json["bufferViews"][shared]["byteStride"] = json!(4);
        json["accessors"] =
            json!([{"bufferView": shared, "componentType": 5123, "type": "VEC2", "count": 300_000}]);
        let part: Value = json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 0, "TEXCOORD_1": 0}});
        json["meshes"][0]["primitives"] = vec![part; 1000].into();
    });
    place.write("scene.glb", &bytes);
    place.bake("-o out.glb").refused(&["Square", "split the scene"]);
}

#[test]
fn instances() {
    // A million zeros stand for a million places.
    let many = |json: &mut Value, bin: &mut Vec<u8>| {
        let corners: Vec<u8> = (0..600_u32).flat_map(|i| (i as f32).to_le_bytes()).collect();
        let positions = view(json, bin, &corners);
        json["accessors"] = json!([
            {"bufferView": positions, "componentType": 5126, "type": "VEC3", "count": 200},
            {"componentType": 5126, "type": "VEC3", "count": 400_000}
        ]);
        json["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0}});
        json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
        json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = json!({"attributes": {"TRANSLATION": 1}});
    };
    bake(many).refused(&["Wall", "instances"]);
    bake(|json, bin| {
        many(json, bin);
        json["accessors"][1]["count"] = json!(u64::MAX);
    })
    .refused(&["accessor 1", "far more than the file holds"]);
}

/// A picture on the square's material.
fn with_picture(bytes: &'static [u8]) -> super::command::Ended {
    bake(move |json, bin| {
        let picture = view(json, bin, bytes);
        json["images"] = json!([{"name": "Wood", "bufferView": picture}]);
        json["textures"] = json!([{"source": 0}]);
        json["materials"] = json!([{"name": "Paint",
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
        json["meshes"][0]["primitives"][0]["material"] = json!(0);
    })
}

fn leaked(bytes: Vec<u8>) -> &'static [u8] {
    bytes.leak()
}

/// A PNG that ends after its header.
fn png(side: u32) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    bytes.extend([side.to_be_bytes(), side.to_be_bytes()].concat());
    bytes.extend([8, 6, 0, 0, 0]);
    let sum = crc(&bytes[12..]);
    bytes.extend(sum.to_be_bytes());
    bytes.extend(b"\0\0\0\x01IDAT\x78");
    bytes.extend(crc(b"IDAT\x78").to_be_bytes());
    bytes
}

/// The checksum of PNG's chunks (ISO 3309).
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| (sum >> 1) ^ (0xEDB8_8320 & (sum & 1).wrapping_neg()))
    })
}

#[test]
fn pictures() {
    with_picture(leaked(png(16_384))).refused(&["pictures claim 256 million texels"]);
    with_picture(leaked(png(60_000))).warned(&["Wood", "exceeds"]);
    with_picture(leaked(png(u32::MAX))).warned(&["Wood"]);
    let jpeg = |side: u16| {
        let [high, low] = side.to_be_bytes();
        leaked(
            [
                &[0xFF, 0xD8, 0xFF, 0xC0, 0, 11, 8, high, low, high, low, 1, 1, 0x11, 0],
                &[0xFF, 0xDA, 0, 8, 1, 1, 0, 0, 63, 0, 0][..],
            ]
            .concat(),
        )
    };
    // Lossless WebP: 14 bits each of width − 1 and height − 1.
    let webp =
        [&b"RIFF\x1a\0\0\0WEBPVP8L\x0d\0\0\0\x2f"[..], &0x0FFF_FFFF_u32.to_le_bytes(), &[0; 9]].concat();
    // Refused, or left out with a word where the decoder sees through the header by itself.
    for picture in [jpeg(16_384), jpeg(65_535), leaked(webp)] {
        let ended = with_picture(picture);
        assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.said);
        assert!(ended.said.contains("Wood") || ended.said.contains("pictures claim"), "{}", ended.said);
    }
}

/// A sky in the scene's custom properties.
fn with_sky(name: &str, bytes: &[u8]) -> super::command::Ended {
    let place = Place::new();
    place.write(name, bytes);
    let named = name.to_owned();
    place.write("scene.glb", &square(|json, _| json["scenes"][0]["extras"]["lightkiln.sky"] = json!(named)));
    let ended = place.bake("-o out.glb");
    assert_eq!(place.names().len(), 2, "{:?}", place.names());
    ended
}

/// An OpenEXR file that ends after its header.
fn exr(width: i32, height: i32, channels: usize) -> Vec<u8> {
    let mut bytes = vec![0x76, 0x2F, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        bytes.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0"].concat());
        bytes.extend((value.len() as u32).to_le_bytes());
        bytes.extend(value);
    };
    let mut list = Vec::new();
    let rest = (0..channels).map(|i| format!("X{i:04}"));
    for name in ["B", "G", "R"].map(str::to_owned).into_iter().chain(rest) {
        list.extend(name.as_bytes());
        list.extend([0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    }
    list.push(0);
    let window: Vec<u8> = [0, 0, width - 1, height - 1].iter().flat_map(|x| x.to_le_bytes()).collect();
    attribute("channels", "chlist", &list);
    attribute("compression", "compression", &[3]);
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1.0_f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1.0_f32.to_le_bytes());
    bytes.push(0);
    bytes
}

#[test]
fn skies() {
    with_sky("sky.exr", &exr(16_384, 8192, 0)).refused(&["sky.exr", "far more than its"]);
    with_sky("sky.exr", &exr(4096, 2048, 50)).refused(&["sky.exr", "far more than its"]);
    with_sky("sky.exr", &exr(i32::MAX, i32::MAX, 0)).refused(&["sky.exr"]);
    for (size, words) in
        [("-Y 8192 +X 16384", "far more than its"), ("-Y 4294967295 +X 4294967295", "sky.hdr")]
    {
        let bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n");
        with_sky("sky.hdr", bytes.as_bytes()).refused(&["sky.hdr", words]);
    }
}

#[test]
fn compressed_meshes() {
    let varint = |mut n: u64| {
        let mut bytes = Vec::new();
        while n > 127 {
            bytes.push(n as u8 | 128);
            n >>= 7;
        }
        bytes.push(n as u8);
        bytes
    };
    for (faces, points) in [(90_000_000, 90_000_000), (1, 90_000_000), (u64::from(u32::MAX), 3)] {
        for method in [0, 1] {
            // Version 2.2, a triangle mesh, sequential or by edge breaker; then how many.
            let stream =
                [b"DRACO\x02\x02\x01", &[method, 0, 0][..], &varint(faces), &varint(points), &[0; 40]]
                    .concat();
            bake(|json, bin| {
                let packed = view(json, bin, &stream);
                json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
                json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] =
                    json!({"bufferView": packed, "attributes": {"POSITION": 0}});
            })
            .refused(&["Square", "Draco"]);
        }
    }
    for count in [1_u64 << 20, 1 << 26, u64::MAX / 16] {
        bake(|json, bin| {
            let packed = view(json, bin, &[0xA0; 64]);
            json["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
            json["bufferViews"][0] = json!({"buffer": 0, "byteLength": count.saturating_mul(16), "byteStride": 16,
                "extensions": {"EXT_meshopt_compression": {"buffer": 0, "byteLength": 64,
                    "byteOffset": json["bufferViews"][packed]["byteOffset"], "byteStride": 16, "count": count,
                    "mode": "ATTRIBUTES"}}});
        })
        .refused(&["buffer view 0", "meshopt"]);
    }
}

#[test]
fn depth() {
    // Text nested deeper than any file needs to be.
    let place = Place::new();
    let nested = |deep: usize| {
        format!("{{\"asset\":{{\"version\":\"2.0\"}},\"x\":{}{}}}", "[".repeat(deep), "]".repeat(deep))
    };
    place.write("scene.glb", nested(1_000_000).as_bytes());
    place.bake("").refused(&["scene.glb", "recursion"]);
    // A chain of nodes is walked, not called.
    let deep = 100_000;
    let chain = |json: &mut Value, last: Value| {
        let nodes = (0..deep).map(|i| if i + 1 < deep { json!({"children": [i + 1]}) } else { last.clone() });
        json["nodes"] = nodes.collect();
    };
    place.write("scene.glb", &square(|json, _| chain(json, json!({"name": "Wall", "mesh": 0}))));
    place.bake("-o out.glb").warned(&["wrote out.glb"]);
    place.write("scene.glb", &square(|json, _| chain(json, json!({"mesh": 0, "children": [7]}))));
    place.bake("").refused(&["node 7"]);
    place.write("scene.glb", &square(|json, _| json["nodes"][0]["children"] = json!([0])));
    place.bake("").refused(&["Wall", "its own ancestor"]);
}

#[test]
fn options_beyond_any_machine() {
    let place = Place::new();
    place.write("scene.glb", &square(|_, _| ()));
    // The density is lowered until it fits, with a word about it.
    place.bake("-o out.glb --density 1e30").warned(&["density"]);
    place.bake("-o out.glb --density 1e-30").warned(&["wrote out.glb"]);
    let large = "bake scene.glb -o large.glb --threads 1 --quality draft --density 1e30";
    place.run(&format!("{large} --page-size 16384 --max-pages 1")).refused(&["memory", "GiB", "--page-size"]);
    place.run(&format!("{large} --page-size 16384 --max-pages 4000000000")).refused(&["GiB"]);
    assert!(!place.names().iter().any(|name| name.contains("large")), "{:?}", place.names());
}
