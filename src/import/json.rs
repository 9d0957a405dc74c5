//! Reading JSON with the place of every value at hand, so that a message can say where.

use crate::error::{Error, Result};
use serde_json::{Map, Value};

/// A list at the top of the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct List {
    /// The key.
    pub key: &'static str,
    /// One item of it, for messages.
    pub kind: &'static str,
}

pub(super) const ACCESSORS: List = List { key: "accessors", kind: "accessor" };
pub(super) const BUFFERS: List = List { key: "buffers", kind: "buffer" };
pub(super) const BUFFER_VIEWS: List = List { key: "bufferViews", kind: "buffer view" };
pub(super) const CAMERAS: List = List { key: "cameras", kind: "camera" };
pub(super) const IMAGES: List = List { key: "images", kind: "image" };
pub(super) const MATERIALS: List = List { key: "materials", kind: "material" };
pub(super) const MESHES: List = List { key: "meshes", kind: "mesh" };
pub(super) const NODES: List = List { key: "nodes", kind: "node" };
pub(super) const SAMPLERS: List = List { key: "samplers", kind: "sampler" };
pub(super) const SCENES: List = List { key: "scenes", kind: "scene" };
pub(super) const SKINS: List = List { key: "skins", kind: "skin" };
pub(super) const TEXTURES: List = List { key: "textures", kind: "texture" };

/// What to do about a file that breaks the rules of glTF: what wrote it is at fault, or the way it came.
pub(super) const AGAIN: &str = ": export the scene again";

/// One JSON object and where it stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part<'a> {
    pub object: &'a Map<String, Value>,
    kind: &'static str,
    index: Option<usize>,
    inner: Option<(&'static str, Option<usize>)>,
    name: Option<&'a str>,
}

/// The items of a list; empty when the file has none.
pub(super) fn items(json: &Value, list: List) -> Result<&[Value]> {
    match json.get(list.key) {
        None => Ok(&[]),
        Some(Value::Array(items)) => Ok(items),
        Some(_) => Err(Error::invalid("the file", format!("\"{}\" is not a list{AGAIN}", list.key))),
    }
}

impl<'a> Part<'a> {
    /// The whole file.
    pub fn root(json: &'a Value) -> Result<Self> {
        let object = json
            .as_object()
            .ok_or_else(|| Error::invalid("the file", format!("its JSON is not an object{AGAIN}")))?;
        Ok(Self { object, kind: "the file", index: None, inner: None, name: None })
    }

    /// Item `index` of a list of the file.
    pub fn item(json: &'a Value, list: List, index: usize) -> Result<Self> {
        let items = items(json, list)?;
        let Some(item) = items.get(index) else {
            let what = match items.len() {
                0 => format!("it is named but does not exist{AGAIN}"),
                n => format!("it is named but the last one is {} {}{AGAIN}", list.kind, n - 1),
            };
            return Err(Error::invalid(format!("{} {index}", list.kind), what));
        };
        let Some(object) = item.as_object() else {
            return Err(Error::invalid(
                format!("{} {index}", list.kind),
                format!("it is not a JSON object{AGAIN}"),
            ));
        };
        let name = object.get("name").and_then(Value::as_str).filter(|name| !name.is_empty());
        Ok(Self { object, kind: list.kind, index: Some(index), inner: None, name })
    }

    /// The item of `list` that `key` points to.
    pub fn follow(&self, json: &'a Value, key: &str, list: List) -> Result<Option<Part<'a>>> {
        let Some(index) = self.index(key)? else { return Ok(None) };
        match Self::item(json, list, index) {
            Ok(part) => Ok(Some(part)),
            Err(_) => Err(self.dangling(key, list, index)),
        }
    }

    /// The error of a reference that leads nowhere.
    pub fn dangling(&self, key: &str, list: List, index: usize) -> Error {
        Error::invalid(
            self.at(),
            format!("\"{key}\" names {} {index}, which does not exist or is broken{AGAIN}", list.kind),
        )
    }

    /// An object inside this one.
    pub fn object(&self, key: &'static str) -> Result<Option<Part<'a>>> {
        match self.object.get(key) {
            None => Ok(None),
            Some(Value::Object(object)) => Ok(Some(Part { object, inner: Some((key, None)), ..*self })),
            Some(_) => Err(self.wrong(key, "must be an object")),
        }
    }

    /// Object `index` of a list inside this one.
    pub fn nth(&self, key: &'static str, kind: &'static str, index: usize) -> Result<Part<'a>> {
        match self.array(key)?.and_then(|items| items.get(index)) {
            Some(Value::Object(object)) => Ok(Part { object, inner: Some((kind, Some(index))), ..*self }),
            Some(_) => Err(self.wrong(key, "holds something that is not an object")),
            None => Err(Error::invalid(self.at(), format!("it has no {kind} {index}{AGAIN}"))),
        }
    }

    /// An extension of this object.
    pub fn extension(&self, name: &'static str) -> Result<Option<Part<'a>>> {
        match self.object.get("extensions").and_then(|extensions| extensions.get(name)) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::Object(object)) => Ok(Some(Part { object, inner: Some((name, None)), ..*self })),
            Some(_) => Err(self.wrong(name, "must be an object")),
        }
    }

    /// Position in its list.
    pub fn position(&self) -> usize {
        self.index.unwrap_or(0)
    }

    /// The artist's name of the item, or its kind and number.
    pub fn label(&self) -> String {
        match (self.name, self.index) {
            (Some(name), _) => name.to_owned(),
            (None, Some(index)) => format!("{} {index}", self.kind),
            (None, None) => self.kind.to_owned(),
        }
    }

    /// Where this is, in words.
    pub fn at(&self) -> String {
        let mut at = match (self.name, self.index) {
            (Some(name), _) => format!("{} '{name}'", self.kind),
            _ => self.label(),
        };
        match self.inner {
            Some((kind, Some(index))) => at.push_str(&format!(", {kind} {index}")),
            Some((kind, None)) => at.push_str(&format!(", {kind}")),
            None => {}
        }
        at
    }

    /// The error that `key` is not what it must be.
    pub fn wrong(&self, key: &str, must: &str) -> Error {
        Error::invalid(self.at(), format!("\"{key}\" {must}{AGAIN}"))
    }

    /// A whole number that is not negative; `3.0` counts as 3, as the JSON of glTF allows.
    pub fn index(&self, key: &str) -> Result<Option<usize>> {
        match self.object.get(key) {
            None => Ok(None),
            Some(value) => whole(value)
                .map(Some)
                .ok_or_else(|| self.wrong(key, "must be a whole number that is not negative")),
        }
    }

    /// A whole number that must be there.
    pub fn required_index(&self, key: &str) -> Result<usize> {
        self.index(key)?.ok_or_else(|| self.wrong(key, "is missing"))
    }

    /// `N` finite numbers.
    pub fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>> {
        let Some(value) = self.object.get(key) else { return Ok(None) };
        let read = value.as_array().filter(|items| items.len() == N).and_then(|items| {
            let mut numbers = [0.0; N];
            for (to, from) in numbers.iter_mut().zip(items) {
                *to = from.as_f64()?;
            }
            Some(numbers)
        });
        read.map(Some).ok_or_else(|| self.wrong(key, &format!("must be {N} finite numbers")))
    }

    /// A string.
    pub fn text(&self, key: &str) -> Result<Option<&'a str>> {
        match self.object.get(key) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(_) => Err(self.wrong(key, "must be a string")),
        }
    }

    /// True or false.
    pub fn flag(&self, key: &str) -> Result<Option<bool>> {
        match self.object.get(key) {
            None => Ok(None),
            Some(Value::Bool(flag)) => Ok(Some(*flag)),
            Some(_) => Err(self.wrong(key, "must be true or false")),
        }
    }

    /// A list.
    pub fn array(&self, key: &str) -> Result<Option<&'a [Value]>> {
        match self.object.get(key) {
            None => Ok(None),
            Some(Value::Array(items)) => Ok(Some(items)),
            Some(_) => Err(self.wrong(key, "must be a list")),
        }
    }

    /// A list of indices.
    pub fn indices(&self, key: &str) -> Result<Vec<usize>> {
        let items = self.array(key)?.unwrap_or(&[]);
        let read: Option<Vec<usize>> = items.iter().map(whole).collect();
        read.ok_or_else(|| self.wrong(key, "must hold whole numbers that are not negative"))
    }
}

/// A whole number, however it is spelt.
fn whole(value: &Value) -> Option<usize> {
    if let Some(number) = value.as_u64() {
        return usize::try_from(number).ok();
    }
    let number = value.as_f64()?;
    let lawful = number >= 0.0 && number.fract() == 0.0 && number <= 9_007_199_254_740_992.0;
    lawful.then_some(number as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn parse(text: &str) -> Value {
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn reads_whole_numbers_however_they_are_spelt() {
        let json = parse(r#"{"a": 3, "b": 3.0, "c": 3.5, "d": -1, "e": 1e400, "f": "3"}"#);
        let part = Part::root(&json).unwrap();
        assert_eq!(part.index("a").unwrap(), Some(3));
        assert_eq!(part.index("b").unwrap(), Some(3));
        assert_eq!(part.index("none").unwrap(), None);
        for key in ["c", "d", "e", "f"] {
            assert!(part.index(key).is_err(), "{key}");
        }
    }

    #[test]
    fn reads_finite_numbers_in_the_right_number() {
        let json = parse(r#"{"a": [1, 2.5], "b": [1, 1e400], "c": [1, "2"], "d": 1}"#);
        let part = Part::root(&json).unwrap();
        assert_eq!(part.numbers::<2>("a").unwrap(), Some([1.0, 2.5]));
        assert_eq!(part.numbers::<2>("none").unwrap(), None);
        assert!(part.numbers::<3>("a").is_err());
        for key in ["b", "c", "d"] {
            assert!(part.numbers::<2>(key).is_err(), "{key}");
        }
    }

    #[test]
    fn says_where_in_the_artists_words() {
        let json = json!({"meshes": [{"name": "Chair", "primitives": [{"mode": "x"}]}, {}, 7]});
        let mesh = Part::item(&json, MESHES, 0).unwrap();
        let primitive = mesh.nth("primitives", "primitive", 0).unwrap();
        let message = primitive.index("mode").unwrap_err().to_string();
        assert!(message.starts_with("mesh 'Chair', primitive 0: \"mode\""), "{message}");
        assert_eq!(Part::item(&json, MESHES, 1).unwrap().at(), "mesh 1");
        assert!(Part::item(&json, MESHES, 2).is_err());
        assert!(Part::item(&json, MESHES, 3).unwrap_err().to_string().contains("mesh 2"));
    }
}
