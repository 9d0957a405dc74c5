//! Accessors: typed windows on buffers, checked before anything is read (glTF 2.0 section 3.6.2).

use super::buffers::View;
use super::claims;
use super::document::{Document, RawAccessor};
use super::json::{ACCESSORS, Part};
use crate::error::{Error, Result};

/// How one element lies in memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    columns: usize,
    column_bytes: usize,
    component_bytes: usize,
}

impl Layout {
    /// Bytes of one element without padding.
    pub fn element_bytes(self) -> usize {
        self.columns * self.column_bytes
    }

    /// Columns of matrices start at multiples of four bytes.
    fn column_step(self) -> usize {
        if self.columns == 1 { self.column_bytes } else { self.column_bytes.next_multiple_of(4) }
    }

    /// Bytes of one element as it is stored.
    fn stored_bytes(self) -> usize {
        (self.columns - 1) * self.column_step() + self.column_bytes
    }
}

/// The layout of a component type and a type, when both exist.
pub(super) fn layout_of(component_type: u32, kind: &str) -> Option<Layout> {
    let component_bytes = match component_type {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        5125 | 5126 => 4,
        _ => return None,
    };
    let (columns, rows) = match kind {
        "SCALAR" => (1, 1),
        "VEC2" => (1, 2),
        "VEC3" => (1, 3),
        "VEC4" => (1, 4),
        "MAT2" => (2, 2),
        "MAT3" => (3, 3),
        "MAT4" => (4, 4),
        _ => return None,
    };
    Some(Layout { columns, column_bytes: rows * component_bytes, component_bytes })
}

impl Document {
    /// The elements of an accessor: tightly packed, sparse values applied, EXT_meshopt_compression undone. Nothing is
    /// read or reserved before the file is known to hold it.
    pub fn raw_accessor(&self, index: usize) -> Result<RawAccessor> {
        let part = Part::item(&self.json, ACCESSORS, index)?;
        let component_type = u32::try_from(part.required_index("componentType")?).unwrap_or(0);
        let kind = part.text("type")?.unwrap_or_default();
        let layout = layout_of(component_type, kind)
            .ok_or_else(|| part.wrong("componentType", "and \"type\" are not of glTF 2.0"))?;
        let normalized = part.flag("normalized")?.unwrap_or(false);
        if normalized && !matches!(component_type, 5120..=5123) {
            return Err(part.wrong("normalized", "is only for 8 and 16 bit integers"));
        }
        let count = part.required_index("count")?;
        let offset = part.index("byteOffset")?.unwrap_or(0);
        let element_bytes = layout.element_bytes();

        let mut bytes = match part.index("bufferView")? {
            Some(view) => gather(&self.view(view, &part)?, offset, count, layout, &part)?,
            None if part.object.contains_key("byteOffset") => {
                return Err(part.wrong("byteOffset", "needs a bufferView"));
            }
            None => vec![0; self.affordable(count, element_bytes, &part)?],
        };
        if let Some(sparse) = part.object("sparse")? {
            self.apply_sparse(&sparse, &mut bytes, count, component_type, kind)?;
        }
        Ok(RawAccessor { component_type, kind: kind.to_owned(), normalized, count, element_bytes, bytes })
    }

    /// Bytes of an accessor that nothing backs.
    fn affordable(&self, count: usize, element_bytes: usize, part: &Part) -> Result<usize> {
        match count.checked_mul(element_bytes) {
            Some(bytes)
                if claims::ZERO_BYTES.holds(bytes as u64, self.total_bytes())
                    && count <= super::MAX_VERTICES =>
            {
                Ok(bytes)
            }
            _ => {
                let what = format!(
                    "it claims {count} elements of zeros without data behind them, far more than the file holds: \
                     export the scene again"
                );
                Err(Error::TooLarge { what, at: part.at() })
            }
        }
    }

    fn apply_sparse(
        &self,
        sparse: &Part,
        bytes: &mut [u8],
        count: usize,
        component_type: u32,
        kind: &str,
    ) -> Result<()> {
        let sparse_count = sparse.required_index("count")?;
        if sparse_count > count {
            return Err(sparse.wrong("count", "is larger than the accessor's"));
        }
        let missing = |key| sparse.wrong(key, "is missing");
        let indices = sparse.object("indices")?.ok_or_else(|| missing("indices"))?;
        let values = sparse.object("values")?.ok_or_else(|| missing("values"))?;
        let read = |part: &Part, layout: Layout| {
            let view = self.view(part.required_index("bufferView")?, part)?;
            gather(&view, part.index("byteOffset")?.unwrap_or(0), sparse_count, layout, part)
        };
        let index_type = u32::try_from(indices.required_index("componentType")?).unwrap_or(0);
        let index_layout = layout_of(index_type, "SCALAR")
            .filter(|_| matches!(index_type, 5121 | 5123 | 5125))
            .ok_or_else(|| indices.wrong("componentType", "must be an unsigned integer"))?;
        let value_layout =
            layout_of(component_type, kind).ok_or_else(|| sparse.wrong("values", "have no layout"))?;
        let positions = unsigned(index_type, &read(&indices, index_layout)?);
        let values = read(&values, value_layout)?;

        let element_bytes = value_layout.element_bytes();
        let mut last = None;
        for (position, value) in positions.iter().map(|&i| i as usize).zip(values.chunks_exact(element_bytes))
        {
            if position >= count || last.is_some_and(|last| position <= last) {
                return Err(indices.wrong("sparse", "indices must rise and stay below the accessor's count"));
            }
            bytes[position * element_bytes..][..element_bytes].copy_from_slice(value);
            last = Some(position);
        }
        Ok(())
    }
}

/// Packs the elements of a view.
fn gather(view: &View, offset: usize, count: usize, layout: Layout, part: &Part) -> Result<Vec<u8>> {
    let stored = layout.stored_bytes();
    // A matrix of bytes is padded to whole words between elements too.
    let packed_stride = if layout.columns == 1 { stored } else { layout.columns * layout.column_step() };
    let stride = view.stride.unwrap_or(packed_stride);
    if stride < stored {
        return Err(part.wrong("bufferView", "has a byteStride smaller than one element"));
    }
    let Some(last) = count.checked_sub(1) else { return Ok(Vec::new()) };
    let needed = last.checked_mul(stride).and_then(|bytes| bytes.checked_add(stored));
    let window = needed.and_then(|needed| {
        let end = offset.checked_add(needed)?;
        view.bytes.get(offset..end)
    });
    let Some(window) = window else {
        let has = view.bytes.len();
        let what = format!(
            "its {count} elements do not fit into its buffer view of {has} bytes: the file is cut off or broken, \
             export it again"
        );
        return Err(Error::invalid(part.at(), what));
    };
    if stride == layout.element_bytes() {
        return Ok(window.to_vec());
    }
    let mut bytes = Vec::with_capacity(count * layout.element_bytes());
    for element in window.chunks(stride) {
        for column in 0..layout.columns {
            bytes.extend_from_slice(&element[column * layout.column_step()..][..layout.column_bytes]);
        }
    }
    Ok(bytes)
}

fn unsigned(component_type: u32, bytes: &[u8]) -> Vec<u32> {
    match component_type {
        5121 => bytes.iter().map(|&b| u32::from(b)).collect(),
        5123 => bytes.chunks_exact(2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]]))).collect(),
        _ => bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
    }
}

impl RawAccessor {
    /// Numbers in one element.
    pub fn components(&self) -> usize {
        layout_of(self.component_type, &self.kind)
            .map_or(0, |layout| layout.element_bytes() / layout.component_bytes)
    }

    /// The elements as unsigned integers; `None` unless the accessor holds scalar, unsigned, whole numbers.
    pub fn to_indices(&self) -> Option<Vec<u32>> {
        let lawful =
            self.kind == "SCALAR" && !self.normalized && matches!(self.component_type, 5121 | 5123 | 5125);
        lawful.then(|| unsigned(self.component_type, &self.bytes))
    }

    /// All numbers in order as floats, fractions where the accessor is normalised (glTF 2.0 section 3.6.2.2 and 3.11).
    pub fn to_floats(&self) -> Vec<f32> {
        let b = &self.bytes;
        match (self.component_type, self.normalized) {
            (5120, false) => b.iter().map(|&b| f32::from(b as i8)).collect(),
            (5120, true) => b.iter().map(|&b| (f32::from(b as i8) / 127.0).max(-1.0)).collect(),
            (5121, false) => b.iter().map(|&b| f32::from(b)).collect(),
            (5121, true) => b.iter().map(|&b| f32::from(b) / 255.0).collect(),
            (5122, normalized) => {
                let read = b.chunks_exact(2).map(|b| f32::from(i16::from_le_bytes([b[0], b[1]])));
                if normalized { read.map(|x| (x / 32767.0).max(-1.0)).collect() } else { read.collect() }
            }
            (5123, normalized) => {
                let read = b.chunks_exact(2).map(|b| f32::from(u16::from_le_bytes([b[0], b[1]])));
                if normalized { read.map(|x| x / 65535.0).collect() } else { read.collect() }
            }
            (5125, _) => {
                b.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32).collect()
            }
            _ => b.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::Builder;
    use super::*;
    use serde_json::{Value, json};

    /// Bytes 0, 1, 2, ... in one view, read by the accessor `json`.
    fn read(accessor: Value, view: Value) -> Result<RawAccessor> {
        let mut builder = Builder::default();
        builder.view(&(0..64).collect::<Vec<u8>>());
        if let (Some(to), Value::Object(from)) = (builder.views[0].as_object_mut(), view) {
            to.extend(from);
        }
        builder.accessors.push(accessor);
        builder.document(json!({}))?.raw_accessor(0)
    }

    fn bytes_of(count: usize, kind: &str, stride: usize, offset: usize) -> Result<RawAccessor> {
        let accessor = json!({"bufferView": 0, "byteOffset": offset, "componentType": 5121, "type": kind, "count": count});
        read(accessor, if stride == 0 { json!({}) } else { json!({ "byteStride": stride }) })
    }

    #[test]
    fn packs_interleaved_elements() {
        assert_eq!(bytes_of(2, "VEC3", 8, 4).unwrap().bytes, [4, 5, 6, 12, 13, 14]);
        assert_eq!(bytes_of(2, "VEC3", 0, 1).unwrap().bytes, [1, 2, 3, 4, 5, 6]);
        // The last element need not be followed by its padding.
        assert_eq!(bytes_of(8, "VEC3", 8, 5).unwrap().count, 8);
    }

    #[test]
    fn unpads_matrix_columns() {
        let raw = bytes_of(2, "MAT2", 0, 0).unwrap();
        assert_eq!(raw.bytes, [0, 1, 4, 5, 8, 9, 12, 13]);
        assert_eq!(raw.element_bytes, 4);
        let raw = bytes_of(1, "MAT3", 0, 0).unwrap();
        assert_eq!(raw.bytes, [0, 1, 2, 4, 5, 6, 8, 9, 10]);
    }

    #[test]
    fn refuses_what_does_not_fit_before_taking_memory() {
        for (count, kind, stride, offset) in [
            (65, "SCALAR", 0, 0),
            (1, "SCALAR", 0, 64),
            (9, "VEC3", 8, 0),
            (8, "VEC3", 8, 6),
            (2, "VEC3", 2, 0),
        ] {
            let result = bytes_of(count, kind, stride, offset);
            assert!(matches!(result, Err(Error::Invalid { .. })), "{count} {kind} {stride} {offset}");
        }
        assert!(bytes_of(usize::MAX >> 12, "VEC4", 0, 0).is_err());
        assert!(bytes_of(usize::MAX >> 12, "VEC4", 252, 0).is_err());
        let zeros = json!({"componentType": 5126, "type": "VEC3", "count": 4_000_000_000_u64});
        assert!(matches!(read(zeros, json!({})), Err(Error::TooLarge { .. })));
        let zeros = json!({"componentType": 5126, "type": "VEC3", "count": 2});
        assert_eq!(read(zeros, json!({})).unwrap().bytes, [0; 24]);
    }

    #[test]
    fn applies_sparse_values_in_rising_order_only() {
        let sparse = |indices: &[u8]| {
            let mut builder = Builder::default();
            let (at, values) = (builder.view(indices), builder.view(&[7, 8]));
            builder.accessors.push(json!({
                "componentType": 5121, "type": "SCALAR", "count": 4, "sparse": {"count": 2,
                "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}}
            }));
            builder.document(json!({}))?.raw_accessor(0)
        };
        assert_eq!(sparse(&[1, 3]).unwrap().bytes, [0, 7, 0, 8]);
        for bad in [[3, 1], [1, 1], [1, 4]] {
            assert!(sparse(&bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn integers_become_fractions() {
        let floats = |component_type, normalized, bytes: &[u8]| {
            let kind = "SCALAR".to_owned();
            let element_bytes = if component_type < 5122 { 1 } else { 2 };
            let count = bytes.len() / element_bytes;
            let raw =
                RawAccessor { component_type, kind, normalized, count, element_bytes, bytes: bytes.to_vec() };
            raw.to_floats()
        };
        assert_eq!(floats(5120, true, &[127, 0, 129, 128]), [1.0, 0.0, -1.0, -1.0]);
        assert_eq!(floats(5121, true, &[255, 0]), [1.0, 0.0]);
        assert_eq!(floats(5122, true, &[0xFF, 0x7F, 0x00, 0x80]), [1.0, -1.0]);
        assert_eq!(floats(5123, true, &[0xFF, 0xFF, 0, 0]), [1.0, 0.0]);
        assert_eq!(floats(5122, false, &[0xFE, 0xFF]), [-2.0]);
        assert_eq!(floats(5121, false, &[200]), [200.0]);
    }

    #[test]
    fn refuses_types_that_do_not_exist() {
        for accessor in [
            json!({"bufferView": 0, "componentType": 5124, "type": "VEC3", "count": 1}),
            json!({"bufferView": 0, "componentType": 5126, "type": "VEC5", "count": 1}),
            json!({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 1, "normalized": true}),
            json!({"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": 1}),
            json!({"byteOffset": 0, "componentType": 5126, "type": "VEC3", "count": 1}),
            json!({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 1.5}),
            json!([]),
        ] {
            assert!(read(accessor.clone(), json!({})).is_err(), "{accessor}");
        }
    }
}
