//! Which texture coordinate set the lightmap gets.
//!
//! TEXCOORD_1, where engines look for it. A set that is there already is never moved or replaced, used or not: a
//! shader the file does not know of may read it. The one exception is the set of an earlier lightmap, which the new
//! one replaces.

use super::append::{extension, index, index_at, items};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// The extension that carries lightmaps.
pub(in super::super) const LIGHTMAP: &str = "MOZ_lightmap";
pub(super) const VARIANTS: &str = "KHR_materials_variants";

/// The materials a primitive can wear: its own, and those of its variants.
pub(super) fn materials_of(primitive: &Value) -> Vec<Option<usize>> {
    let mappings = extension(primitive, VARIANTS).and_then(|v| v.get("mappings")).and_then(Value::as_array);
    let variants = mappings.into_iter().flatten().filter_map(|mapping| index_at(mapping, "material"));
    std::iter::once(index_at(primitive, "material")).chain(variants.map(Some)).collect()
}

/// Gives a primitive, and its variants, other materials, where there is another.
pub(super) fn replace_materials(primitive: &mut Value, new: &BTreeMap<Option<usize>, usize>) {
    if let Some(&new) = new.get(&index_at(primitive, "material")) {
        primitive["material"] = new.into();
    }
    let mappings = primitive.get_mut("extensions").and_then(|all| all.get_mut(VARIANTS));
    let mappings = mappings.and_then(|v| v.get_mut("mappings")).and_then(Value::as_array_mut);
    for mapping in mappings.into_iter().flatten() {
        if let Some(&new) = index_at(mapping, "material").and_then(|old| new.get(&Some(old))) {
            mapping["material"] = new.into();
        }
    }
}

/// The sets that a primitive's materials and extensions read, an earlier lightmap aside.
pub(super) fn sets_read(json: &Value, primitive: &Value) -> BTreeSet<usize> {
    let mut sets = BTreeSet::new();
    for material in materials_of(primitive).into_iter().flatten() {
        if let Some(material) = items(json, "materials").get(material) {
            collect(material, &mut sets);
        }
    }
    if let Some(extensions) = primitive.get("extensions") {
        collect(extensions, &mut sets);
    }
    sets
}

fn collect(value: &Value, sets: &mut BTreeSet<usize>) {
    match value {
        Value::Object(map) => {
            match map.get("texCoord").and_then(index) {
                Some(set) => drop(sets.insert(set)),
                // A texture that names no set reads the first.
                None if map.get("index").is_some_and(Value::is_number) => drop(sets.insert(0)),
                None => {}
            }
            for (key, inner) in map {
                if key != "extras" && key != LIGHTMAP {
                    collect(inner, sets);
                }
            }
        }
        Value::Array(list) => list.iter().for_each(|inner| collect(inner, sets)),
        _ => {}
    }
}

/// The set for all of a mesh's lightmapped primitives, and why it is not the usual one.
pub(super) fn choose(json: &Value, primitives: &[&Value]) -> (usize, Option<String>) {
    let mut why = None;
    let mut set = 1;
    while let Some(reason) = primitives.iter().find_map(|primitive| taken(json, primitive, set)) {
        why.get_or_insert(reason);
        set += 1;
    }
    let warning = why.map(|why| {
        format!(
            "{why}, so the lightmap uses TEXCOORD_{set}; many engines read a lightmap from TEXCOORD_1 only: free the \
             second UV map before the bake to get it there"
        )
    });
    (set, warning)
}

fn taken(json: &Value, primitive: &Value, set: usize) -> Option<String> {
    let name = format!("TEXCOORD_{set}");
    if sets_read(json, primitive).contains(&set) {
        return Some(format!("{name} is in use by a material"));
    }
    let morphs = primitive.get("targets").and_then(Value::as_array);
    let there = primitive.get("attributes").is_some_and(|all| all.get(&name).is_some())
        || morphs.into_iter().flatten().any(|target| target.get(&name).is_some());
    (there && !was_lightmap(json, primitive, set)).then(|| format!("{name} holds other coordinates"))
}

/// Whether a set carried an earlier lightmap of this primitive.
pub(super) fn was_lightmap(json: &Value, primitive: &Value, set: usize) -> bool {
    materials_of(primitive).into_iter().flatten().any(|material| {
        let lightmap = items(json, "materials").get(material).and_then(|m| extension(m, LIGHTMAP));
        lightmap.is_some_and(|lightmap| index_at(lightmap, "texCoord").unwrap_or(0) == set)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn file() -> Value {
        json!({"materials": [
            {"name": "plain"},
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
            {"occlusionTexture": {"index": 0, "texCoord": 1}},
            {"emissiveTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": 2}}}},
            {"extensions": {"MOZ_lightmap": {"index": 0, "texCoord": 1, "intensity": 1}},
             "extras": {"texCoord": 3}},
        ]})
    }

    fn primitive(material: usize, sets: &[usize]) -> Value {
        let attributes: serde_json::Map<_, _> =
            sets.iter().map(|set| (format!("TEXCOORD_{set}"), json!(0))).collect();
        json!({"attributes": attributes, "material": material})
    }

    #[test]
    fn finds_every_set_a_material_reads() {
        let read = |material| sets_read(&file(), &primitive(material, &[])).into_iter().collect::<Vec<_>>();
        assert_eq!(read(0), [0usize; 0]);
        assert_eq!(read(1), [0]);
        assert_eq!(read(2), [1]);
        assert_eq!(read(3), [0, 2]);
        assert_eq!(read(4), [0usize; 0]);
        let variants = json!({"attributes": {}, "material": 0, "extensions": {
            "KHR_materials_variants": {"mappings": [{"material": 2, "variants": [0]}]},
            "EXT_mesh_features": {"featureIds": [{"texture": {"index": 0, "texCoord": 4}}]}}});
        assert_eq!(sets_read(&file(), &variants), BTreeSet::from([1, 4]));
        assert_eq!(materials_of(&variants), [Some(0), Some(2)]);
    }

    #[test]
    fn takes_the_second_set_unless_something_is_there() {
        let set = |material, sets: &[usize]| {
            let (set, warning) = choose(&file(), &[&primitive(material, sets)]);
            assert_eq!(set != 1, warning.is_some());
            set
        };
        assert_eq!(set(0, &[]), 1);
        assert_eq!(set(1, &[0]), 1);
        assert_eq!(set(0, &[0, 1]), 2, "coordinates that nothing in the file reads are kept all the same");
        assert_eq!(set(2, &[0]), 2, "a set a material reads is in use even where it is missing");
        assert_eq!(set(3, &[0, 1, 2]), 3);
        assert_eq!(set(4, &[0, 1]), 1, "an earlier lightmap is replaced");
        let (both, _) = choose(&file(), &[&primitive(0, &[0]), &primitive(0, &[0, 1, 2])]);
        assert_eq!(both, 3, "one set for the whole mesh");
    }
}
