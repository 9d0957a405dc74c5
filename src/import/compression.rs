//! Undoes EXT_meshopt_compression and KHR_draco_mesh_compression. The only file that names `draco_gltf`.

use super::accessor::layout_of;
use super::claims;
use super::document::RawAccessor;
use super::json::Part;
use crate::error::{Error, Result};
use draco_gltf::meshopt::decode_buffer_view;
use draco_gltf::{
    ComponentType, DecodeLimits, DracoPrimitiveContract, DracoPrimitiveExtension, JsonValue, MeshoptFilter,
    MeshoptMode, PackedAttribute,
};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The extension's name when it was a vendor's, and since.
pub(super) const MESHOPT_NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
/// The name of the Draco extension.
pub(super) const DRACO_NAME: &str = "KHR_draco_mesh_compression";

/// The most bytes one view or primitive may decode to.
const MAX_DECODED_BYTES: usize = 1 << 30;
/// The vertex codec stores a block of 8192 bytes in no less than a few bytes of control data; nothing lawful expands
/// more than this, so larger claims are refused before memory is taken for them.
const MAX_EXPANSION: usize = 4096;

/// A buffer view after decompression.
#[derive(Clone, Debug)]
pub(super) enum DecodedView {
    /// Its bytes.
    Bytes(Vec<u8>),
    /// Why it cannot be decoded.
    Broken(String),
}

/// The compression of a buffer view, if it has one.
pub(super) fn meshopt_extension<'a>(part: &Part<'a>) -> Result<Option<Part<'a>>> {
    for name in MESHOPT_NAMES {
        if let Some(extension) = part.extension(name)? {
            return Ok(Some(extension));
        }
    }
    Ok(None)
}

/// Decodes a buffer view that meshoptimizer compressed into `source`.
pub(super) fn meshopt(source: &[u8], view: &Part, extension: &Part) -> Result<Vec<u8>> {
    let broken = |what: String| {
        Error::invalid(
            view.at(),
            format!("its meshopt compression is broken ({what}): compress the scene again"),
        )
    };
    let count = extension.required_index("count")?;
    let stride = extension.required_index("byteStride")?;
    let mode = extension.text("mode")?.unwrap_or_default();
    let filter = extension.text("filter")?;
    let mode = MeshoptMode::from_name(mode).map_err(|error| broken(error.to_string()))?;
    let filter =
        MeshoptFilter::from_name(filter.unwrap_or("NONE")).map_err(|error| broken(error.to_string()))?;
    let size =
        count.checked_mul(stride).filter(|&size| Some(size) == view.index("byteLength").ok().flatten());
    let Some(size) = size else {
        return Err(broken("count × byteStride is not the view's byteLength".to_owned()));
    };
    if size > MAX_DECODED_BYTES || size / MAX_EXPANSION > source.len() {
        return Err(broken(format!("{} bytes cannot hold {size}", source.len())));
    }
    let mut bytes = vec![0; size];
    let decode = || decode_buffer_view(&mut bytes, source, mode, filter, count, stride);
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(Ok(())) => Ok(bytes),
        Ok(Err(error)) => Err(broken(error.to_string())),
        Err(_) => Err(broken("the decoder gave up on it".to_owned())),
    }
}

/// What a Draco stream holds.
pub(super) struct DracoMesh {
    /// By semantic.
    pub attributes: Vec<(String, RawAccessor)>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// Decodes a Draco stream. `ids` gives the stream's number of each semantic, `normalized` what the accessor of a
/// semantic says.
pub(super) fn draco(
    source: &[u8],
    ids: &[(&str, usize)],
    normalized: &dyn Fn(&str) -> bool,
    primitive: &Part,
) -> Result<DracoMesh> {
    let broken = |what: String| {
        Error::invalid(
            primitive.at(),
            format!("its Draco compression is broken ({what}): compress the scene again"),
        )
    };
    let ids: Vec<(&str, JsonValue)> = ids.iter().map(|&(name, id)| (name, JsonValue::from(id))).collect();
    let json = JsonValue::object([
        ("bufferView", JsonValue::from(0_usize)),
        ("attributes", JsonValue::object(ids.iter().cloned())),
    ]);
    let extension = DracoPrimitiveExtension::from_json(&json).map_err(|error| broken(error.to_string()))?;
    let most = claims::DRACO_POINTS.most(source.len()).min(super::MAX_VERTICES as u64);
    let mut contract = DracoPrimitiveContract::new().with_limits(
        DecodeLimits::default()
            .with_max_points(most)
            .with_max_faces(2 * most)
            .with_max_decoded_bytes(MAX_DECODED_BYTES as u64),
    );
    for (name, _) in &ids {
        contract = contract.with_attribute(*name, 0, normalized(name));
    }
    let geometry = match catch_unwind(AssertUnwindSafe(|| extension.decode(source, &contract))) {
        Ok(Ok(geometry)) => geometry,
        Ok(Err(error)) => return Err(broken(error.to_string())),
        Err(_) => return Err(broken("the decoder gave up on it".to_owned())),
    };
    let attributes = geometry
        .attributes()
        .iter()
        .map(|attribute| {
            Ok((attribute.semantic().to_owned(), raw(attribute).ok_or_else(|| broken("odd layout".into()))?))
        })
        .collect::<Result<Vec<_>>>()?;
    let indices = geometry.indices().map(|indices| indices.bytes()).unwrap_or_default();
    let triangles = indices
        .chunks_exact(12)
        .map(|three| std::array::from_fn(|i| u32::from_le_bytes([0, 1, 2, 3].map(|b| three[4 * i + b]))))
        .collect();
    Ok(DracoMesh { attributes, triangles })
}

fn raw(attribute: &PackedAttribute) -> Option<RawAccessor> {
    let component_type = match attribute.component_type() {
        ComponentType::I8 => 5120,
        ComponentType::U8 => 5121,
        ComponentType::I16 => 5122,
        ComponentType::U16 => 5123,
        ComponentType::U32 => 5125,
        ComponentType::F32 => 5126,
        _ => return None,
    };
    let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"].get(usize::from(attribute.components()).checked_sub(1)?)?;
    let element_bytes = layout_of(component_type, kind)?.element_bytes();
    let bytes = attribute.bytes().to_vec();
    (bytes.len() == element_bytes.checked_mul(attribute.count())?).then(|| RawAccessor {
        component_type,
        kind: (*kind).to_owned(),
        normalized: attribute.normalized(),
        count: attribute.count(),
        element_bytes,
        bytes,
    })
}
