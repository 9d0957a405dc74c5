//! Which material a lightmapped primitive wears: the file's own where every user of it shares one page, else a copy.

use super::super::carrier::Carrier;
use super::append::{Edit, index_at, items, remove_extension};
use super::texcoord::VARIANTS;
use crate::scene::Surface;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Materials in their lit forms.
pub(super) struct Wardrobe<'c> {
    carrier: &'c Carrier,
    /// Materials that primitives without lightmap wear too.
    shared_outside: BTreeSet<usize>,
    /// Materials that animations name by index.
    animated: BTreeSet<usize>,
    /// Lit forms by material, page and texture coordinate set.
    made: BTreeMap<(Option<usize>, u32, usize), usize>,
    /// Materials that were changed in place.
    taken: BTreeSet<usize>,
}

impl<'c> Wardrobe<'c> {
    /// Empty; `shared_outside` are the materials that primitives without lightmap wear.
    pub fn new(carrier: &'c Carrier, shared_outside: BTreeSet<usize>, json: &Value) -> Self {
        let animated = animated(json);
        Self { carrier, shared_outside, animated, made: BTreeMap::new(), taken: BTreeSet::new() }
    }

    /// The material to wear on a page; `None` when the old one stays.
    pub fn lit(&mut self, edit: &mut Edit, material: Option<usize>, page: u32, set: usize) -> Option<usize> {
        if let Some(&known) = self.made.get(&(material, page, set)) {
            return Some(known);
        }
        let original = material.and_then(|index| items(&edit.document.json, "materials").get(index));
        let lit = match original.and_then(Value::as_object) {
            Some(fields) => self.carrier.lit(fields, material, page, set)?,
            // A primitive without material: all of glTF's defaults, under a name.
            None => self.carrier.lit(&default(), None, page, set)?,
        };
        let in_place = material.zip(original).filter(|(index, original)| {
            self.carrier.keeps(original)
                && !self.shared_outside.contains(index)
                && !self.taken.contains(index)
        });
        let index = match in_place {
            Some((index, _)) => {
                edit.json["materials"][index] = Value::Object(lit);
                self.taken.insert(index);
                index
            }
            None => {
                if let Some(index) = material.filter(|index| self.animated.contains(index)) {
                    let name = original.and_then(|m| m.get("name")?.as_str());
                    let at = name.map_or_else(|| format!("material {index}"), str::to_owned);
                    let what = "it is animated, but was copied for another page; the animation changes the original only";
                    edit.warn(at, what);
                }
                edit.push("materials", Value::Object(lit))
            }
        };
        self.made.insert((material, page, set), index);
        Some(index)
    }
}

/// What primitives without material get: glTF's default under a name, but not metallic, as the bake takes it. A metal would
/// not show its lightmap.
fn default() -> Map<String, Value> {
    let matte = json!({"metallicFactor": 0});
    Map::from_iter([("name".to_owned(), json!("default")), ("pbrMetallicRoughness".to_owned(), matte)])
}

/// Gives surfaces other materials, made from the file's own; each material is made once.
pub(in super::super) fn repaint<'s>(
    edit: &mut Edit,
    surfaces: impl Iterator<Item = &'s Surface>,
    make: impl Fn(&Map<String, Value>, &Surface) -> Map<String, Value>,
) {
    let mut made = BTreeMap::new();
    for surface in surfaces {
        let origin = &surface.origin;
        let primitive = |json: &Value, mesh: usize| {
            items(json, "meshes").get(mesh)?.get("primitives")?.get(origin.primitive).cloned()
        };
        let Some(before) = primitive(&edit.document.json, origin.mesh) else { continue };
        let mesh = items(&edit.json, "nodes").get(origin.node).and_then(|node| index_at(node, "mesh"));
        let mesh = mesh.unwrap_or(origin.mesh);
        if primitive(&edit.json, mesh).is_none() {
            continue;
        }
        let old = index_at(&before, "material");
        let new = *made.entry(old).or_insert_with(|| {
            let original = old.and_then(|old| items(&edit.document.json, "materials").get(old)?.as_object());
            let material = make(original.unwrap_or(&default()), surface);
            edit.push("materials", Value::Object(material))
        });
        edit.json["meshes"][mesh]["primitives"][origin.primitive]["material"] = json!(new);
    }
}

/// Takes away all other materials that primitives could wear.
pub(in super::super) fn settle_variants(edit: &mut Edit) {
    let meshes = edit.json.get_mut("meshes").and_then(Value::as_array_mut);
    for mesh in meshes.into_iter().flatten() {
        let primitives = mesh.get_mut("primitives").and_then(Value::as_array_mut);
        for primitive in primitives.into_iter().flatten() {
            remove_extension(primitive, VARIANTS);
        }
    }
}

/// Materials that KHR_animation_pointer animates.
fn animated(json: &Value) -> BTreeSet<usize> {
    let channels = items(json, "animations").iter().filter_map(|a| a.get("channels")?.as_array()).flatten();
    channels
        .filter_map(|channel| {
            let pointer = super::append::extension(channel.get("target")?, "KHR_animation_pointer")?;
            pointer.get("pointer")?.as_str()?.strip_prefix("/materials/")?.split('/').next()?.parse().ok()
        })
        .collect()
}
