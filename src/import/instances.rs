//! EXT_mesh_gpu_instancing: one node, many places.

use super::document::{Document, RawAccessor};
use super::json::Part;
use crate::error::{Error, Result};
use glam::{DAffine3, DQuat, DVec3};

/// Node from instance, for each instance of a node; `None` when the node is not instanced.
pub(super) fn expand(document: &Document, node: &Part) -> Result<Option<Vec<DAffine3>>> {
    let Some(extension) = node.extension("EXT_mesh_gpu_instancing")? else { return Ok(None) };
    let attributes =
        extension.object("attributes")?.ok_or_else(|| extension.wrong("attributes", "is missing"))?;
    let read = |name: &str, kind: &str| -> Result<Option<RawAccessor>> {
        let Some(index) = attributes.index(name)? else { return Ok(None) };
        let raw = document.raw_accessor(index)?;
        let lawful = raw.kind == kind && (raw.component_type == 5126 || raw.normalized);
        if lawful { Ok(Some(raw)) } else { Err(attributes.wrong(name, &format!("must be {kind} of floats"))) }
    };
    let translations = read("TRANSLATION", "VEC3")?;
    let rotations = read("ROTATION", "VEC4")?;
    let scales = read("SCALE", "VEC3")?;
    let counts: Vec<usize> =
        [&translations, &rotations, &scales].into_iter().flatten().map(|raw| raw.count).collect();
    let Some(&count) = counts.first() else { return Ok(None) };
    if counts.iter().any(|&other| other != count) {
        return Err(
            attributes.wrong("TRANSLATION", "ROTATION and SCALE must have as many elements as each other")
        );
    }
    let floats = |raw: Option<RawAccessor>| raw.map(|raw| raw.to_floats());
    let (translations, rotations, scales) = (floats(translations), floats(rotations), floats(scales));
    let three = |values: &Option<Vec<f32>>, i: usize, default| match values {
        Some(v) => DVec3::new(v[3 * i].into(), v[3 * i + 1].into(), v[3 * i + 2].into()),
        None => default,
    };
    let transform = |i: usize| {
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |v| {
            let q = DQuat::from_array(std::array::from_fn(|k| f64::from(v[4 * i + k])));
            // Unused instances are stored as zeros.
            if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
        });
        let (scale, translation) = (three(&scales, i, DVec3::ONE), three(&translations, i, DVec3::ZERO));
        let transform = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
        if transform.is_finite() {
            Ok(transform)
        } else {
            Err(Error::invalid(
                node.at(),
                format!("the place of its instance {i} is not a number: export the scene again"),
            ))
        }
    };
    (0..count).map(transform).collect::<Result<_>>().map(Some)
}

#[cfg(test)]
mod tests {
    use super::super::json::NODES;
    use super::super::testing::Builder;
    use super::*;
    use serde_json::{Value, json};

    fn expanded(builder: &Builder, attributes: Value) -> Result<Option<Vec<DAffine3>>> {
        let extensions = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
        let document = builder.document(json!({"nodes": [{"extensions": extensions}]}))?;
        expand(&document, &Part::item(&document.json, NODES, 0)?)
    }

    #[test]
    fn places_every_instance() {
        let mut builder = Builder::default();
        builder.floats(&[1., 2., 3., 4., 5., 6.], "VEC3");
        builder.accessor(&[0, 127, 0, 0, 0, 0, 0, 0], 5120, "VEC4", 2);
        builder.accessors[1]["normalized"] = json!(true);
        builder.floats(&[2., 2., 2.], "VEC3");
        builder.floats(&[2., 2., 2., f32::NAN, 1., 1.], "VEC3");
        let two = expanded(&builder, json!({"TRANSLATION": 0, "ROTATION": 1})).unwrap().unwrap();
        // A half turn about y, then the shift.
        assert!((two[0].transform_point3(DVec3::X) - DVec3::new(0.0, 2.0, 3.0)).length() < 1e-12);
        assert_eq!(two[1].transform_point3(DVec3::X), DVec3::new(5.0, 5.0, 6.0));
        assert!(expanded(&builder, json!({"TRANSLATION": 0, "SCALE": 2})).is_err());
        assert!(expanded(&builder, json!({"SCALE": 3})).is_err());
        assert!(expanded(&builder, json!({"TRANSLATION": 1})).is_err());
        assert!(expanded(&builder, json!({})).unwrap().is_none());
    }
}
