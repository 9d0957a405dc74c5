//! What the artist told lightkiln through custom properties: `extras.lightkiln.NAME`, or flat `lightkiln.NAME` or
//! `lightkiln_NAME`, because Blender's interface makes flat properties more easily than nested ones.

use super::json::Part;
use crate::error::{Error, Result};
use serde_json::Value;

/// The value of a lightkiln property of `part`.
pub(super) fn own<'a>(part: &Part<'a>, name: &str) -> Option<&'a Value> {
    let extras = part.object.get("extras")?.as_object()?;
    let nested = extras.get("lightkiln").and_then(|own| own.get(name));
    nested
        .or_else(|| extras.get(&format!("lightkiln.{name}")))
        .or_else(|| extras.get(&format!("lightkiln_{name}")))
}

/// The value of a property that exporters also write without lightkiln's name.
pub(super) fn own_or_plain<'a>(part: &Part<'a>, name: &str) -> Option<&'a Value> {
    own(part, name).or_else(|| part.object.get("extras")?.get(name))
}

/// An answer of the first part that gives one.
fn first<'a>(parts: &[&Part<'a>], name: &str) -> Option<(&'a Value, String)> {
    parts.iter().find_map(|part| Some((own(part, name)?, part.at())))
}

/// True or false; Blender also exports switches as 0 and 1.
pub(super) fn flag(parts: &[&Part], name: &str) -> Result<Option<bool>> {
    let Some((value, at)) = first(parts, name) else { return Ok(None) };
    match (value, value.as_f64()) {
        (Value::Bool(flag), _) => Ok(Some(*flag)),
        (_, Some(number)) if number == 0.0 || number == 1.0 => Ok(Some(number == 1.0)),
        _ => Err(Error::invalid(at, format!("its custom property lightkiln.{name} must be true or false"))),
    }
}

/// A finite number above zero.
pub(super) fn positive(parts: &[&Part], name: &str) -> Result<Option<f32>> {
    let Some((value, at)) = first(parts, name) else { return Ok(None) };
    match value.as_f64().map(|number| number as f32) {
        Some(number) if number > 0.0 && number.is_finite() => Ok(Some(number)),
        _ => {
            Err(Error::invalid(at, format!("its custom property lightkiln.{name} must be a number above 0")))
        }
    }
}

/// A number in `0..=most`, by lightkiln's name or the plain one, of the first part that has it.
pub(super) fn bounded(parts: &[&Part], name: &str, most: f32) -> Result<Option<f32>> {
    let found = parts.iter().find_map(|part| Some((own_or_plain(part, name)?, part.at())));
    let Some((value, at)) = found else { return Ok(None) };
    match value.as_f64().map(|number| number as f32) {
        Some(number) if (0.0..=most).contains(&number) => Ok(Some(number)),
        _ => {
            Err(Error::invalid(at, format!("its custom property '{name}' must be a number from 0 to {most}")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::json::{NODES, Part};
    use super::*;
    use serde_json::json;

    #[test]
    fn reads_nested_and_flat_properties() {
        let json = json!({"nodes": [
            {"extras": {"lightkiln": {"bake": false, "density": 2}, "radius": 0.5}},
            {"extras": {"lightkiln.bake": 0, "lightkiln_density": 0.5}},
            {"extras": "text"},
            {"extras": {"lightkiln": {"bake": "no", "density": -1}, "radius": -1}}
        ]});
        let node = |i| Part::item(&json, NODES, i).unwrap();
        assert_eq!(flag(&[&node(0)], "bake").unwrap(), Some(false));
        assert_eq!(flag(&[&node(1)], "bake").unwrap(), Some(false));
        assert_eq!(flag(&[&node(2)], "bake").unwrap(), None);
        assert_eq!(positive(&[&node(2), &node(0)], "density").unwrap(), Some(2.0));
        assert_eq!(positive(&[&node(1), &node(0)], "density").unwrap(), Some(0.5));
        assert_eq!(bounded(&[&node(0)], "radius", 10.0).unwrap(), Some(0.5));
        assert!(flag(&[&node(3)], "bake").is_err());
        assert!(positive(&[&node(3)], "density").is_err());
        assert!(bounded(&[&node(3)], "radius", 10.0).is_err());
        assert!(bounded(&[&node(0)], "radius", 0.1).unwrap_err().to_string().contains("node 0"));
    }
}
