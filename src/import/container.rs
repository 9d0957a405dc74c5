//! What wraps the JSON: nothing (`.gltf`) or a chunked file (`.glb`, glTF 2.0 section 4).

use super::document::Container;
use super::exponents::Exponents;
use crate::error::{Error, Result, Warning};
use serde_json::Value;

const MAGIC: &[u8; 4] = b"glTF";
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;

/// The JSON, and what its value does not keep.
pub(super) struct Text {
    pub value: Value,
    pub exponents: Exponents,
}

/// Takes the file apart. `at` names it in messages.
pub(super) fn open(bytes: &[u8], at: &str, warnings: &mut Vec<Warning>) -> Result<(Text, Container)> {
    if bytes.starts_with(MAGIC) {
        let (json, container) = split(bytes, at, warnings)?;
        return Ok((parse(json, at)?, container));
    }
    if let Some(what) = foreign(bytes) {
        return Err(Error::invalid(at, what));
    }
    Ok((parse(bytes, at)?, Container::Json))
}

/// Says what a file is that cannot be glTF.
fn foreign(bytes: &[u8]) -> Option<&'static str> {
    let first = bytes.iter().find(|b| !b.is_ascii_whitespace());
    match first {
        None => Some("the file is empty: export the scene again"),
        Some(_) if bytes.starts_with(b"version https://git-lfs") => {
            Some("this is a Git LFS pointer, not the file itself: run `git lfs pull`")
        }
        Some(_) if bytes.starts_with(b"BLENDER") || bytes.starts_with(&[0x28, 0xB5, 0x2F, 0xFD]) => {
            Some("this looks like a .blend file: export it from Blender as glTF 2.0 (.glb)")
        }
        Some(_) if bytes.starts_with(&[0xEF, 0xBB, 0xBF]) => {
            Some("the JSON begins with a byte order mark, which glTF forbids: save it as UTF-8 without one")
        }
        Some(b'{') => None,
        Some(_) => Some(
            "this is neither a .glb (it does not begin with 'glTF') nor the JSON of a .gltf: choose a file that is",
        ),
    }
}

fn parse(json: &[u8], at: &str) -> Result<Text> {
    let value: Value = serde_json::from_slice(json)
        .map_err(|error| Error::invalid(at, format!("its JSON is broken: {error}; export the file again")))?;
    if value.is_object() {
        Ok(Text { value, exponents: Exponents::of(json) })
    } else {
        Err(Error::invalid(at, "its JSON is not an object: export the scene again"))
    }
}

fn word(bytes: &[u8], offset: usize) -> Option<u32> {
    let four = bytes.get(offset..offset.checked_add(4)?)?;
    Some(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
}

fn split<'a>(bytes: &'a [u8], at: &str, warnings: &mut Vec<Warning>) -> Result<(&'a [u8], Container)> {
    let cut = || Error::invalid(at, "the .glb ends too early: it was cut off, copy or export it again");
    let (version, length) = (word(bytes, 4).ok_or_else(cut)?, word(bytes, 8).ok_or_else(cut)? as usize);
    if version != 2 {
        let what = format!("it is GLB version {version}; only version 2 (glTF 2.0) is read, export it again");
        return Err(Error::unsupported(at, what));
    }
    if length > bytes.len() || length < 20 {
        return Err(cut());
    }
    if length < bytes.len() {
        let extra = bytes.len() - length;
        warnings.push(Warning::new(at, format!("{extra} bytes after the end of the .glb are ignored")));
    }
    let bytes = &bytes[..length];

    let (mut json, mut bin, mut other_chunks) = (None, None, Vec::new());
    let mut offset = 12;
    let mut number = 0;
    while offset < length {
        let size = word(bytes, offset).ok_or_else(cut)? as usize;
        let kind = word(bytes, offset + 4).ok_or_else(cut)?;
        let start = offset + 8;
        let chunk = start.checked_add(size).and_then(|end| bytes.get(start..end)).ok_or_else(cut)?;
        match (number, kind) {
            (0, CHUNK_JSON) => json = Some(chunk),
            (0, _) => {
                return Err(Error::invalid(
                    at,
                    "the first chunk of the .glb is not its JSON: export it again",
                ));
            }
            (1, CHUNK_BIN) => bin = Some(chunk.to_vec()),
            (_, CHUNK_JSON | CHUNK_BIN) => {
                return Err(Error::invalid(
                    at,
                    "the .glb has a JSON or BIN chunk out of place or twice: export it again",
                ));
            }
            _ => other_chunks.push((kind, chunk.to_vec())),
        }
        offset = start + size;
        number += 1;
    }
    let json = json.ok_or_else(cut)?;
    // Some writers fill the JSON chunk with zeros where the rules say spaces.
    let end = json.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
    Ok((&json[..end], Container::Binary { bin, other_chunks }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(chunks: &[(u32, &[u8])]) -> Vec<u8> {
        let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        for (kind, chunk) in chunks {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind.to_le_bytes());
            bytes.extend(*chunk);
        }
        let length = bytes.len() as u32;
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        bytes
    }

    fn read(bytes: &[u8]) -> Result<(Value, Container)> {
        open(bytes, "a.glb", &mut Vec::new()).map(|(text, container)| (text.value, container))
    }

    #[test]
    fn keeps_every_chunk() {
        let bytes = glb(&[(CHUNK_JSON, b"{} \0"), (CHUNK_BIN, b"12345"), (7, b"seven"), (8, b"")]);
        let (json, container) = read(&bytes).unwrap();
        assert_eq!(json, serde_json::json!({}));
        let Container::Binary { bin, other_chunks } = container else { panic!("not binary") };
        assert_eq!(bin.as_deref(), Some(b"12345".as_slice()));
        assert_eq!(other_chunks, [(7, b"seven".to_vec()), (8, Vec::new())]);
    }

    #[test]
    fn refuses_broken_containers_and_never_panics() {
        let bytes = glb(&[(CHUNK_JSON, b"{}  "), (CHUNK_BIN, b"1234")]);
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end]).is_err(), "cut at {end}");
        }
        let mut huge = bytes.clone();
        huge[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(read(&huge).is_err());
        assert!(read(&glb(&[(CHUNK_BIN, b"1234")])).is_err());
        assert!(read(&glb(&[(CHUNK_JSON, b"{}  "), (CHUNK_JSON, b"{}  ")])).is_err());
        assert!(read(&glb(&[(CHUNK_JSON, b"{}  "), (9, b""), (CHUNK_BIN, b"1234")])).is_err());
        assert!(read(&glb(&[(CHUNK_JSON, b"[]  ")])).is_err());
        let mut old = bytes;
        old[4] = 1;
        assert!(matches!(read(&old), Err(Error::Unsupported { .. })));
    }

    #[test]
    fn names_files_of_another_kind() {
        let said = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
        assert!(said(b"").contains("empty"));
        assert!(said(b"version https://git-lfs.github.com/spec/v1\n").contains("git lfs pull"));
        assert!(said(b"BLENDER-v405").contains(".blend"));
        assert!(said(b"\xEF\xBB\xBF{}").contains("byte order mark"));
        assert!(said(b"solid cube").contains("neither"));
        assert!(said(b"{\"a\":").contains("broken"));
        let deep = [b"{\"a\":".repeat(100_000), b"1".to_vec()].concat();
        assert!(said(&deep).contains("recursion"));
    }

    #[test]
    fn says_when_bytes_follow_the_end() {
        let mut bytes = glb(&[(CHUNK_JSON, b"{}  ")]);
        bytes.extend(b"more");
        let mut warnings = Vec::new();
        open(&bytes, "a.glb", &mut warnings).unwrap();
        assert_eq!(warnings.len(), 1);
    }
}
