//! Damages a glTF file the way broken exporters, careless scripts and attackers do: one change at a time, in the JSON,
//! in the binary chunk or in the wrapping. `fuzz/` uses it too.

use serde_json::{Map, Number, Value, json};

/// A sequence of choices that repeats (SplitMix64).
pub struct Dice(pub u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Below `n`; 0 where there is nothing to choose from.
    pub fn below(&mut self, n: usize) -> usize {
        if n == 0 { 0 } else { (self.roll() % n as u64) as usize }
    }

    fn of<T: Clone>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())].clone()
    }
}

/// A file taken apart.
#[derive(Clone, Debug)]
pub struct Parts {
    /// The JSON.
    pub json: Value,
    /// The BIN chunk; `None` in a `.gltf`.
    pub bin: Option<Vec<u8>>,
}

/// Takes a GLB or the JSON of a `.gltf` apart, where it is whole enough.
pub fn split(bytes: &[u8]) -> Option<Parts> {
    if !bytes.starts_with(b"glTF") {
        let json: Value = serde_json::from_slice(bytes).ok()?;
        return json.is_object().then_some(Parts { json, bin: None });
    }
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let end = 20 + word(12)?;
    let text = bytes.get(20..end)?;
    let text = &text[..text.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1)];
    let json: Value = serde_json::from_slice(text).ok()?;
    let bin = word(end).and_then(|size| bytes.get(end + 8..(end + 8).checked_add(size)?));
    json.is_object().then(|| Parts { json, bin: Some(bin.unwrap_or_default().to_vec()) })
}

/// Puts it together again: a GLB where there is a BIN chunk.
pub fn join(parts: &Parts) -> Vec<u8> {
    let mut text = parts.json.to_string().into_bytes();
    let Some(bin) = &parts.bin else { return text };
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bin = bin.clone();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((12 + 8 + text.len() + 8 + bin.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bin)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// One change somewhere.
pub fn change(parts: &mut Parts, dice: &mut Dice) {
    match &mut parts.bin {
        Some(bin) if !bin.is_empty() && dice.below(5) < 2 => change_bytes(bin, dice),
        _ => change_json(&mut parts.json, dice),
    }
}

/// Floats, and bit patterns of them, at which arithmetic ends.
const FLOATS: [f32; 20] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    2.0,
    1e-45,
    f32::MIN_POSITIVE,
    1e-20,
    1e-6,
    1e6,
    16_777_217.0,
    1e18,
    1e20,
    f32::MAX,
    f32::MIN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    std::f32::consts::PI,
];

fn change_bytes(bin: &mut Vec<u8>, dice: &mut Dice) {
    let at = dice.below(bin.len());
    let word = at & !3;
    let mut put = |at: usize, bytes: &[u8]| {
        for (i, &byte) in bytes.iter().enumerate() {
            if let Some(place) = bin.get_mut(at + i) {
                *place = byte;
            }
        }
    };
    match dice.below(10) {
        0..=3 => put(word, &dice.of(&FLOATS).to_le_bytes()),
        4 => {
            let short = dice.of(&[0_u16, 1, 2, 255, 256, 0x7FFF, 0x8000, 0xFFFF]);
            put(at & !1, &short.to_le_bytes());
        }
        5 => {
            let long = dice.of(&[0_u32, 1, 3, 0xFFFF, 0x1_0000, 0x7FFF_FFFF, 0xFFFF_FFFF]);
            put(word, &long.to_le_bytes());
        }
        6 => put(at, &[1 << dice.below(8)]),
        7 => {
            // One vertex onto another, a triangle onto its neighbour.
            let (from, length) = (dice.below(bin.len()) & !3, dice.of(&[4, 8, 12, 24, 36]));
            let copy: Vec<u8> = bin.iter().skip(from).take(length).copied().collect();
            for (i, byte) in copy.into_iter().enumerate() {
                if let Some(place) = bin.get_mut(word + i) {
                    *place = byte;
                }
            }
        }
        8 => {
            let float = f32::from_le_bytes(std::array::from_fn(|i| bin.get(word + i).copied().unwrap_or(0)));
            let factor = dice.of(&[-1.0, 1e-3, 0.999_999_9, 1.000_000_1, 1e3, 1e9]);
            let changed = (float * factor).to_le_bytes();
            for (i, byte) in changed.into_iter().enumerate() {
                if let Some(place) = bin.get_mut(word + i) {
                    *place = byte;
                }
            }
        }
        _ => bin.truncate(at),
    }
}

/// Words that mean something in a glTF.
const WORDS: [&str; 74] = [
    "accessors",
    "alphaCutoff",
    "alphaMode",
    "asset",
    "attributes",
    "BLEND",
    "MASK",
    "OPAQUE",
    "baseColorFactor",
    "baseColorTexture",
    "bufferView",
    "bufferViews",
    "buffers",
    "byteLength",
    "byteOffset",
    "byteStride",
    "cameras",
    "children",
    "COLOR_0",
    "componentType",
    "count",
    "doubleSided",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "emissiveFactor",
    "emissiveStrength",
    "emissiveTexture",
    "extensions",
    "extensionsRequired",
    "extensionsUsed",
    "extras",
    "images",
    "indices",
    "innerConeAngle",
    "outerConeAngle",
    "intensity",
    "inverseBindMatrices",
    "joints",
    "JOINTS_0",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_texture_transform",
    "lightkiln.area_lamp",
    "lightkiln.bake",
    "lightkiln.density",
    "lightkiln.sky",
    "light",
    "lights",
    "materials",
    "matrix",
    "meshes",
    "metallicFactor",
    "mode",
    "name",
    "nodes",
    "NORMAL",
    "normalized",
    "pbrMetallicRoughness",
    "POSITION",
    "primitives",
    "range",
    "rotation",
    "scale",
    "skin",
    "source",
    "sparse",
    "targets",
    "TEXCOORD_0",
    "TEXCOORD_1",
    "translation",
    "uri",
    "weights",
];

/// Values that a file has no reason to hold, and some that it has.
fn strange(dice: &mut Dice) -> Value {
    const NUMBERS: [&str; 24] = [
        "0",
        "1",
        "2",
        "3",
        "4",
        "5",
        "6",
        "7",
        "-1",
        "0.5",
        "255",
        "65535",
        "65536",
        "2147483648",
        "4294967295",
        "9007199254740993",
        "18446744073709551615",
        "18446744073709551616",
        "1e-45",
        "1e-20",
        "1e20",
        "3.5e38",
        "1e308",
        "1e999",
    ];
    match dice.below(12) {
        0..=5 => number(dice.of(&NUMBERS)),
        6 => json!(dice.of(&WORDS)),
        7 => dice.of(&[Value::Null, json!([]), json!({}), json!(true), json!(false), json!("")]),
        8 => json!([0, 1, 2, 0]),
        9 => json!(dice.of(&[
            "../x.bin",
            "%2e%2e%2fx.bin",
            "data:application/octet-stream;base64,AAAAAAAAgD8AAIA/AAAAAA==",
            "data:,",
            "/etc/passwd",
            "\u{202E}x\u{0}\u{7}",
        ])),
        10 => json!({"source": 0, "index": 0, "count": 3, "texCoord": 1}),
        _ => extension(dice),
    }
}

fn extension(dice: &mut Dice) -> Value {
    dice.of(&[
        json!({"KHR_lights_punctual": {"light": 0}}),
        json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 10}, {"type": "directional"},
            {"type": "spot", "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}}]}}),
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0, "SCALE": 1}}}),
        json!({"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1, "scale": [1e9, -1]}}),
        json!({"KHR_materials_emissive_strength": {"emissiveStrength": 1e6}}),
        json!({"KHR_materials_unlit": {}}),
        json!({"lightkiln.area_lamp": {"shape": "ellipse", "size": [1, 0.5], "power": 10, "color": [1, 1, 1]}}),
        json!({"lightkiln.sky": [1, 1, 1], "lightkiln.density": 3, "lightkiln.bake": 1}),
        json!({"EXT_meshopt_compression": {"buffer": 0, "byteLength": 32, "byteStride": 12, "count": 8,
            "mode": "ATTRIBUTES"}}),
        json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}),
        json!({"KHR_node_visibility": {"visible": false}}),
    ])
}

fn number(text: &str) -> Value {
    serde_json::from_str::<Number>(text).map_or(Value::Null, Value::Number)
}

fn change_json(json: &mut Value, dice: &mut Dice) {
    let size = count(json);
    let other = {
        let chosen = dice.below(size);
        nth(json, chosen).cloned().unwrap_or_default()
    };
    let chosen = dice.below(size);
    let Some(place) = nth_mut(json, chosen) else { return };
    match (place, dice.below(8)) {
        (Value::Object(map), 0..=5) => change_map(map, other, dice),
        (Value::Array(items), 0..=5) => change_list(items, other, dice),
        (Value::Bool(flag), 0..=5) => *flag = !*flag,
        (place @ Value::Number(_), 0..=3) => {
            let value = place.as_f64().unwrap_or(0.0);
            let changed = dice.of(&[
                value + 1.0,
                value - 1.0,
                -value,
                value * 2.0,
                value * 1e3,
                value * 1e-3,
                value / 3.0,
            ]);
            // Whole numbers stay whole, as indices must.
            *place = if changed.fract() == 0.0 && changed.abs() < 1e15 {
                json!(changed as i64)
            } else {
                Number::from_f64(changed).map_or(Value::Null, Value::Number)
            };
        }
        // The top of the file stays an object: little is behind the check for that.
        (place, 6) if chosen > 0 => *place = other,
        (place, _) if chosen > 0 => *place = strange(dice),
        _ => {}
    }
}

fn change_map(map: &mut Map<String, Value>, other: Value, dice: &mut Dice) {
    let key = map.keys().nth(dice.below(map.len())).cloned();
    match (key, dice.below(6)) {
        (Some(key), 0 | 1) => {
            map.shift_remove(&key);
        }
        (Some(key), 2) => {
            if let Some(value) = map.shift_remove(&key) {
                map.insert(dice.of(&WORDS).to_owned(), value);
            }
        }
        (_, 3) => {
            let extensions = map.entry("extensions").or_insert_with(|| json!({}));
            if let (Value::Object(extensions), Value::Object(new)) = (extensions, extension(dice)) {
                extensions.extend(new);
            }
        }
        (_, 4) => {
            map.insert(dice.of(&WORDS).to_owned(), strange(dice));
        }
        _ => {
            map.insert(dice.of(&WORDS).to_owned(), other);
        }
    }
}

fn change_list(items: &mut Vec<Value>, other: Value, dice: &mut Dice) {
    let (a, b) = (dice.below(items.len()), dice.below(items.len()));
    match dice.below(6) {
        0 if !items.is_empty() => drop(items.remove(a)),
        1 if !items.is_empty() => items.push(items[a].clone()),
        2 if !items.is_empty() => items.swap(a, b),
        3 if !items.is_empty() && items.len() < 64 => items.extend(vec![items[a].clone(); 40]),
        4 => items.push(strange(dice)),
        _ => items.push(other),
    }
}

/// Values in `json`, itself included.
fn count(json: &Value) -> usize {
    1 + match json {
        Value::Object(map) => map.values().map(count).sum(),
        Value::Array(items) => items.iter().map(count).sum(),
        _ => 0,
    }
}

/// Value number `n`, in the order they stand in the text.
fn nth(json: &Value, n: usize) -> Option<&Value> {
    if n == 0 {
        return Some(json);
    }
    let mut left = n - 1;
    let mut within = |child| {
        let size = count(child);
        if left < size {
            Some(nth(child, left))
        } else {
            left -= size;
            None
        }
    };
    match json {
        Value::Object(map) => map.values().find_map(&mut within).flatten(),
        Value::Array(items) => items.iter().find_map(&mut within).flatten(),
        _ => None,
    }
}

fn nth_mut(json: &mut Value, n: usize) -> Option<&mut Value> {
    if n == 0 {
        return Some(json);
    }
    let mut left = n - 1;
    let children: Vec<&mut Value> = match json {
        Value::Object(map) => map.values_mut().collect(),
        Value::Array(items) => items.iter_mut().collect(),
        _ => Vec::new(),
    };
    for child in children {
        let size = count(child);
        if left < size {
            return nth_mut(child, left);
        }
        left -= size;
    }
    None
}
