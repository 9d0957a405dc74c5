use super::*;
use crate::import::{Document, RawPrimitive};
use serde_json::json;

/// A stream of meshoptimizer's vertex codec, version 0, in which every element equals the last four bytes: all deltas
/// are zero, one control byte per byte of an element.
fn vertex_stream(element: [u8; 4]) -> Vec<u8> {
    let mut bytes = vec![0xA0, 0, 0, 0, 0];
    bytes.extend([0; 28]);
    bytes.extend(element);
    bytes
}

fn meshopt(extension: &str, change: Value) -> Result<Vec<u8>> {
    let mut builder = Builder::default();
    let stream = vertex_stream([1, 2, 3, 4]);
    builder.view(&stream);
    let mut compression = json!({
        "buffer": 0, "byteOffset": 0, "byteLength": stream.len(), "byteStride": 4, "count": 16, "mode": "ATTRIBUTES"
    });
    if let (Some(to), Value::Object(from)) = (compression.as_object_mut(), change) {
        to.extend(from);
    }
    let view =
        json!({"buffer": 1, "byteLength": 64, "byteStride": 4, "extensions": {extension: compression}});
    builder.views.push(view);
    for offset in [0, 2] {
        builder.accessors.push(
            json!({"bufferView": 1, "byteOffset": offset, "componentType": 5121, "type": "VEC2", "count": 16}),
        );
    }
    let buffers = json!([{"byteLength": builder.bin.len()}, {"byteLength": 64, "extensions": {extension: {"fallback": true}}}]);
    let document = builder.document(json!({ "buffers": buffers }))?;
    assert!(document.buffers[1].bytes.is_empty());
    Ok([document.raw_accessor(0)?.bytes, document.raw_accessor(1)?.bytes].concat())
}

#[test]
fn meshopt_is_undone_under_both_names() {
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        assert_eq!(meshopt(name, json!({})).unwrap(), [[1, 2].repeat(16), [3, 4].repeat(16)].concat());
    }
}

#[test]
fn broken_meshopt_is_refused_by_view() {
    for change in [
        json!({"mode": "NONE"}),
        json!({"filter": "SEPIA"}),
        json!({"count": 17}),
        json!({"count": 4_000_000_000_000_u64}),
        json!({"byteStride": 0}),
        json!({"byteLength": 9}),
        json!({"byteLength": 1000}),
        json!({"mode": "TRIANGLES"}),
        json!({"buffer": 7}),
    ] {
        let said = meshopt("EXT_meshopt_compression", change.clone()).unwrap_err().to_string();
        assert!(said.contains("buffer view 1"), "{change}: {said}");
    }
}

/// A Draco stream, sequential, without entropy coding: three points, one triangle, positions of floats.
fn draco_stream(corners: [u8; 3]) -> Vec<u8> {
    let mut bytes = b"DRACO\x02\x02\x01\0\0\0".to_vec();
    bytes.extend([1, 3, 1]); // faces, points, plain indices
    bytes.extend(corners);
    bytes.extend([1, 1]); // one decoder of one attribute
    bytes.extend([0, 9, 3, 0, 5]); // positions, floats, three of them, not normalised, number 5
    bytes.push(0); // stored as they are
    for value in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        bytes.extend(value.to_le_bytes());
    }
    bytes
}

fn draco(stream: &[u8], number: usize) -> Result<(Document, RawPrimitive)> {
    let mut builder = Builder::default();
    let view = builder.view(stream);
    builder.accessors.push(json!({"componentType": 5126, "type": "VEC3", "count": 3}));
    builder.accessors.push(json!({"componentType": 5123, "type": "SCALAR", "count": 3}));
    let beside = builder.floats(&[0., 0., 1., 0., 0., 1.], "VEC2");
    let extension = json!({"bufferView": view, "attributes": {"POSITION": number}});
    let primitive = json!({"attributes": {"TEXCOORD_0": beside, "POSITION": 0}, "indices": 1,
        "extensions": {"KHR_draco_mesh_compression": extension}});
    let document = builder.document(json!({"meshes": [{"name": "Squeezed", "primitives": [primitive]}]}))?;
    let raw = document.raw_primitive(0, 0)?;
    Ok((document, raw))
}

#[test]
fn draco_is_undone_and_plain_attributes_stand_beside_it() {
    let (_, raw) = draco(&draco_stream([2, 0, 1]), 5).unwrap();
    assert_eq!(raw.triangles, [[2, 0, 1]]);
    let names: Vec<&str> = raw.attributes.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["TEXCOORD_0", "POSITION"]);
    assert_eq!(raw.attributes[1].1.to_floats()[3..6], [1.0, 0.0, 0.0]);
}

#[test]
fn broken_draco_is_refused_by_mesh() {
    let good = draco_stream([0, 1, 2]);
    for (stream, number) in
        [(good.clone(), 4), (draco_stream([0, 1, 3]), 5), (good[..20].to_vec(), 5), (vec![], 5)]
    {
        let said = draco(&stream, number).unwrap_err().to_string();
        assert!(said.contains("'Squeezed'"), "{said}");
    }
    for at in 0..good.len() {
        for value in [0, 1, 0x7F, 0x80, 0xFF] {
            let mut stream = good.clone();
            stream[at] = value;
            let _ = draco(&stream, 5);
        }
    }
}
