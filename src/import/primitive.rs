//! Primitives as the file stores them: raw attributes and triangles, whatever hides them.

use super::accessor::layout_of;
use super::compression::{self, DRACO_NAME};
use super::document::{Document, RawAccessor, RawPrimitive};
use super::json::{ACCESSORS, MESHES, Part};
use crate::error::{Error, Result};

/// The most bytes of attributes and morph targets that one primitive may have.
const MAX_PRIMITIVE_BYTES: usize = 1 << 30;

/// How vertices make triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topology {
    Triangles,
    Strip,
    Fan,
    /// Points or lines: nothing light could fall on.
    Thin,
}

impl Topology {
    /// The `mode` of a primitive.
    pub fn of(primitive: &Part) -> Result<Self> {
        match primitive.index("mode")? {
            None | Some(4) => Ok(Self::Triangles),
            Some(5) => Ok(Self::Strip),
            Some(6) => Ok(Self::Fan),
            Some(0..=3) => Ok(Self::Thin),
            Some(_) => Err(primitive.wrong("mode", "must be 0 to 6")),
        }
    }

    /// Triangles of a run of vertices, in the order and winding of glTF 2.0 section 3.7.2.1. Vertices left over at the
    /// end make none.
    fn triangles(self, vertices: &[u32]) -> Vec<[u32; 3]> {
        match self {
            Self::Triangles => vertices.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect(),
            Self::Strip => vertices
                .windows(3)
                .enumerate()
                .map(|(i, v)| if i % 2 == 0 { [v[0], v[1], v[2]] } else { [v[0], v[2], v[1]] })
                .collect(),
            Self::Fan => match vertices.split_first() {
                Some((&first, rest)) => rest.windows(2).map(|v| [v[0], v[1], first]).collect(),
                None => Vec::new(),
            },
            Self::Thin => Vec::new(),
        }
    }
}

impl Document {
    /// The vertex data and triangles of a primitive: Draco undone, strips and fans expanded in order, every attribute as
    /// long as POSITION, every index below it. The scene's geometry of this primitive has the same vertex order and
    /// triangle order. Points, lines and primitives without POSITION are [`Error::Unsupported`].
    pub fn raw_primitive(&self, mesh: usize, primitive: usize) -> Result<RawPrimitive> {
        let part = Part::item(&self.json, MESHES, mesh)?.nth("primitives", "primitive", primitive)?;
        let topology = Topology::of(&part)?;
        if topology == Topology::Thin {
            return Err(Error::unsupported(part.at(), "it holds points or lines, which take no light"));
        }
        if self.claimed_bytes(&part)? > MAX_PRIMITIVE_BYTES {
            let what = "its attributes and morph targets claim more than 1 GiB: split the mesh";
            return Err(Error::TooLarge { what: what.to_owned(), at: part.at() });
        }
        let named = self.semantics(&part, "attributes")?;
        let Some(&(_, position)) = named.iter().find(|(name, _)| *name == "POSITION") else {
            return Err(Error::unsupported(part.at(), "it has no POSITION, so there is nothing to light"));
        };
        let raw = match part.extension(DRACO_NAME)? {
            Some(extension) => self.draco_primitive(&part, &extension, &named)?,
            None => {
                let read =
                    |&(name, accessor): &(&str, usize)| Ok((name.to_owned(), self.raw_accessor(accessor)?));
                let attributes = named.iter().map(read).collect::<Result<Vec<_>>>()?;
                let count = Part::item(&self.json, ACCESSORS, position)?.required_index("count")?;
                let triangles = topology.triangles(&self.corners(&part, count)?);
                RawPrimitive { attributes, targets: Vec::new(), triangles }
            }
        };
        let mut raw = raw;
        raw.targets = self.targets(&part)?;
        check_counts(&raw, &part)?;
        Ok(raw)
    }

    /// Bytes that reading a primitive takes, by what its accessors say. Many attributes may point to one accessor, so
    /// this can be far more than the file.
    pub(super) fn claimed_bytes(&self, part: &Part) -> Result<usize> {
        let targets = part.array("targets")?.unwrap_or(&[]);
        let maps = part.object.get("attributes").into_iter().chain(targets).filter_map(|map| map.as_object());
        let accessors = maps.flat_map(|map| map.values()).chain(part.object.get("indices"));
        let bytes = accessors.filter_map(|accessor| {
            let accessor =
                Part::item(&self.json, ACCESSORS, usize::try_from(accessor.as_u64()?).ok()?).ok()?;
            let component_type = u32::try_from(accessor.index("componentType").ok()??).ok()?;
            let layout = layout_of(component_type, accessor.text("type").ok()??)?;
            Some(accessor.index("count").ok()??.saturating_mul(layout.element_bytes()))
        });
        Ok(bytes.fold(0, usize::saturating_add))
    }

    /// Accessors by semantic, in the file's order.
    fn semantics<'a>(&self, part: &Part<'a>, key: &'static str) -> Result<Vec<(&'a str, usize)>> {
        let attributes = part.object(key)?.ok_or_else(|| part.wrong(key, "is missing"))?;
        attributes.object.keys().map(|name| Ok((name.as_str(), attributes.required_index(name)?))).collect()
    }

    fn targets(&self, part: &Part) -> Result<Vec<Vec<(String, RawAccessor)>>> {
        let count = part.array("targets")?.map_or(0, <[_]>::len);
        (0..count)
            .map(|i| {
                let target = part.nth("targets", "target", i)?;
                let names = target.object.keys();
                names
                    .map(|name| Ok((name.clone(), self.raw_accessor(target.required_index(name)?)?)))
                    .collect()
            })
            .collect()
    }

    /// Vertex numbers in the order they are drawn.
    fn corners(&self, part: &Part, vertex_count: usize) -> Result<Vec<u32>> {
        let Some(accessor) = part.index("indices")? else {
            let count = u32::try_from(vertex_count).map_err(|_| too_many(part, vertex_count))?;
            return Ok((0..count).collect());
        };
        let raw = self.raw_accessor(accessor)?;
        let Some(indices) = raw.to_indices() else {
            return Err(part.wrong("indices", "must be unsigned integers, one by one"));
        };
        let restart = match raw.component_type {
            5121 => 0xFF,
            5123 => 0xFFFF,
            _ => u32::MAX,
        };
        if indices.contains(&restart) {
            let what = format!(
                "its indices hold {restart}, the primitive restart value, which glTF forbids: export it again"
            );
            return Err(Error::invalid(part.at(), what));
        }
        check_indices(&indices, vertex_count, part)?;
        Ok(indices)
    }

    fn draco_primitive(
        &self,
        part: &Part,
        extension: &Part,
        named: &[(&str, usize)],
    ) -> Result<RawPrimitive> {
        let source = self.view(extension.required_index("bufferView")?, extension)?.bytes;
        let ids = self.semantics(extension, "attributes")?;
        let normalized = |name: &str| {
            let accessor = named.iter().find(|(semantic, _)| *semantic == name);
            let accessor = accessor.and_then(|&(_, index)| Part::item(&self.json, ACCESSORS, index).ok());
            accessor.and_then(|accessor| accessor.flag("normalized").ok().flatten()).unwrap_or(false)
        };
        let mut mesh = compression::draco(source, &ids, &normalized, part)?;
        // The file's order of attributes; what the stream does not hold is stored plainly beside it.
        let mut attributes = Vec::with_capacity(named.len());
        for &(name, accessor) in named {
            let raw = match mesh.attributes.iter().position(|(semantic, _)| semantic == name) {
                Some(found) => mesh.attributes.swap_remove(found).1,
                None => self.raw_accessor(accessor)?,
            };
            attributes.push((name.to_owned(), raw));
        }
        let count = attributes.iter().find(|(name, _)| name == "POSITION").map_or(0, |(_, raw)| raw.count);
        check_indices(mesh.triangles.as_flattened(), count, part)?;
        Ok(RawPrimitive { attributes, targets: Vec::new(), triangles: mesh.triangles })
    }
}

fn check_indices(indices: &[u32], vertex_count: usize, part: &Part) -> Result<()> {
    match indices.iter().find(|&&index| index as usize >= vertex_count) {
        None => Ok(()),
        Some(index) => {
            let what =
                format!("its indices name vertex {index}, but there are {vertex_count}: export it again");
            Err(Error::invalid(part.at(), what))
        }
    }
}

fn check_counts(raw: &RawPrimitive, part: &Part) -> Result<()> {
    let count = raw.attributes.iter().find(|(name, _)| name == "POSITION").map_or(0, |(_, raw)| raw.count);
    if count > super::MAX_VERTICES || raw.triangles.len() > super::MAX_VERTICES {
        return Err(too_many(part, count.max(raw.triangles.len())));
    }
    for (name, accessor) in raw.attributes.iter().chain(raw.targets.iter().flatten()) {
        if accessor.count != count {
            let what =
                format!("{name} has {} elements but POSITION has {count}: export it again", accessor.count);
            return Err(Error::invalid(part.at(), what));
        }
    }
    Ok(())
}

pub(super) fn too_many(part: &Part, count: usize) -> Error {
    let what = format!(
        "{count} vertices or triangles are more than the {} million a scene may have: split or decimate it",
        super::MAX_VERTICES / 1_000_000
    );
    Error::TooLarge { what, at: part.at() }
}

#[cfg(test)]
mod tests {
    use super::super::testing::Builder;
    use super::*;
    use serde_json::{Value, json};

    fn primitive(builder: &Builder, primitive: Value) -> Result<RawPrimitive> {
        builder
            .document(json!({"meshes": [{"name": "Chair", "primitives": [primitive]}]}))?
            .raw_primitive(0, 0)
    }

    fn positions(count: usize) -> Builder {
        let mut builder = Builder::default();
        builder.floats(&vec![0.5; 3 * count], "VEC3");
        builder
    }

    #[test]
    fn expands_strips_and_fans_with_their_winding() {
        let mode = |mode: u32| {
            let json = json!({"attributes": {"POSITION": 0}, "mode": mode});
            primitive(&positions(5), json).unwrap().triangles
        };
        assert_eq!(mode(4), [[0, 1, 2]]);
        assert_eq!(mode(5), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(mode(6), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        for thin in 0..4 {
            let result = primitive(&positions(5), json!({"attributes": {"POSITION": 0}, "mode": thin}));
            assert!(matches!(result, Err(Error::Unsupported { .. })));
        }
    }

    #[test]
    fn checks_indices() {
        let indexed = |indices: &[u16]| {
            let mut builder = positions(4);
            let indices = builder.indices(indices);
            primitive(&builder, json!({"attributes": {"POSITION": 0}, "indices": indices}))
        };
        assert_eq!(indexed(&[3, 2, 1, 0, 1, 2]).unwrap().triangles, [[3, 2, 1], [0, 1, 2]]);
        let message = indexed(&[0, 1, 4]).unwrap_err().to_string();
        assert!(message.contains("mesh 'Chair', primitive 0") && message.contains("vertex 4"), "{message}");
        assert!(indexed(&[0, 1, 0xFFFF]).unwrap_err().to_string().contains("restart"));
        let mut floats = positions(4);
        floats.floats(&[0.0, 1.0, 2.0], "SCALAR");
        assert!(primitive(&floats, json!({"attributes": {"POSITION": 0}, "indices": 1})).is_err());
    }

    #[test]
    fn every_attribute_has_as_many_elements() {
        let mut builder = positions(4);
        builder.floats(&[0.0; 9], "VEC3");
        assert!(primitive(&builder, json!({"attributes": {"POSITION": 0, "NORMAL": 1}})).is_err());
        let targets = json!({"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}]});
        assert!(primitive(&builder, targets).is_err());
        assert!(matches!(
            primitive(&builder, json!({"attributes": {"NORMAL": 1}})),
            Err(Error::Unsupported { .. })
        ));
    }

    #[test]
    fn many_names_for_one_accessor_take_no_memory() {
        let mut builder = positions(100_000);
        builder.indices(&[0, 1, 2]);
        let mut attributes = json!({"POSITION": 0});
        for name in 0..1000 {
            attributes[format!("_{name}")] = json!(0);
        }
        let result = primitive(&builder, json!({ "attributes": attributes, "indices": 1 }));
        assert!(matches!(result, Err(Error::TooLarge { .. })));
    }

    #[test]
    fn keeps_the_order_of_attributes() {
        let mut builder = positions(3);
        builder.floats(&[0.0; 6], "VEC2");
        let json = json!({"attributes": {"TEXCOORD_0": 1, "_CUSTOM": 1, "POSITION": 0}});
        let raw = primitive(&builder, json).unwrap();
        let names: Vec<&str> = raw.attributes.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["TEXCOORD_0", "_CUSTOM", "POSITION"]);
    }
}
