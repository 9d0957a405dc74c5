//! Which material a lightmapped primitive wears: the file's own where every user of it shares one page, else a copy.

use super::super::carrier::Carrier;
use super::append::{Edit, items};
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
            Some(fields) => self.carrier.lit(fields, page, set)?,
            // A primitive without material: all of glTF's defaults, under a name.
            None => self.carrier.lit(&Map::from_iter([("name".to_owned(), json!("default"))]), page, set)?,
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
