//! File names as glTF writes them: relative URIs (RFC 3986), percent-encoded UTF-8, forward slashes.

use std::path::{Component, Path, PathBuf};

/// A relative path as a URI. `None` when it is absolute or not Unicode.
pub(super) fn from_path(path: &Path) -> Option<String> {
    let mut out = String::new();
    for part in path.components() {
        if !out.is_empty() {
            out.push('/');
        }
        match part {
            Component::Normal(name) => encode(name.to_str()?, &mut out),
            Component::ParentDir => out.push_str(".."),
            Component::CurDir => out.push('.'),
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(out)
}

/// A file name as a URI.
pub(super) fn from_name(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    encode(name, &mut out);
    out
}

fn encode(name: &str, out: &mut String) {
    for byte in name.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => out.push(byte as char),
            _ => out.push_str(&format!("%{byte:02X}")),
        }
    }
}

/// Whether a URI names a file relative to the glTF: no scheme, no authority, no data.
pub(super) fn is_relative(uri: &str) -> bool {
    let scheme = uri.split(['/', '?', '#']).next().unwrap_or_default().contains(':');
    !uri.is_empty() && !scheme && !uri.starts_with(['/', '\\'])
}

/// The path a relative URI means; a `%` that encodes nothing stands for itself.
pub(super) fn to_path(uri: &str) -> PathBuf {
    let raw = uri.as_bytes();
    let mut bytes = Vec::with_capacity(raw.len());
    let mut at = 0;
    while at < raw.len() {
        let code = (raw[at] == b'%')
            .then(|| raw.get(at + 1..at + 3))
            .flatten()
            .and_then(|hex| std::str::from_utf8(hex).ok())
            .filter(|hex| hex.bytes().all(|b| b.is_ascii_hexdigit()))
            .and_then(|hex| u8::from_str_radix(hex, 16).ok());
        bytes.push(code.unwrap_or(raw[at]));
        at += if code.is_some() { 3 } else { 1 };
    }
    PathBuf::from(String::from_utf8(bytes).unwrap_or_else(|_| uri.to_owned()))
}

/// Whether a relative path stays inside the folder it starts from.
pub(super) fn stays_inside(path: &Path) -> bool {
    let mut depth = 0i32;
    path.components().all(|part| {
        match part {
            Component::Normal(_) => depth += 1,
            Component::ParentDir => depth -= 1,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return false,
        }
        depth >= 0
    })
}

/// The way from one canonical folder to a canonical file; `None` where none exists (two drives).
pub(super) fn relative(folder: &Path, file: &Path) -> Option<PathBuf> {
    let (from, to): (Vec<_>, Vec<_>) = (folder.components().collect(), file.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    (shared > 0).then(|| {
        let up = from[shared..].iter().map(|_| Component::ParentDir);
        up.chain(to[shared..].iter().copied()).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_the_way_there_and_back() {
        for name in ["scene.lightmap0.exr", "Küche 50% #1?.exr", "部屋.bin", "a+b&c=d;e.png"] {
            let uri = from_name(name);
            assert!(uri.bytes().all(|b| b.is_ascii_graphic() && !b"#? \"".contains(&b)), "{uri}");
            assert!(is_relative(&uri), "{uri}");
            assert_eq!(to_path(&uri), Path::new(name));
        }
        assert_eq!(from_name("a b.exr"), "a%20b.exr");
        assert_eq!(to_path("100%.png"), Path::new("100%.png"));
        assert_eq!(to_path("%+1.png"), Path::new("%+1.png"));
        assert_eq!(from_path(Path::new("../in/a b.png")).unwrap(), "../in/a%20b.png");
        assert_eq!(from_path(Path::new("/in/a.png")), None);
    }

    #[test]
    fn tells_relative_from_the_rest() {
        for uri in ["a.bin", "../a.bin", "./x/y.png", "a/b:c.png"] {
            assert!(is_relative(uri), "{uri}");
        }
        for uri in ["", "data:;base64,AA", "http://x/y", "file:///x", "C:\\x", "/x", "//x/y", "\\x"] {
            assert!(!is_relative(uri), "{uri}");
        }
        assert!(stays_inside(Path::new("a/../b")) && stays_inside(Path::new("./a/b")));
        assert!(!stays_inside(Path::new("../b")) && !stays_inside(Path::new("a/../../b/c")));
    }

    #[test]
    fn finds_the_way_between_folders() {
        let way = |a: &str, b: &str| relative(Path::new(a), Path::new(b)).unwrap();
        assert_eq!(way("/p/out", "/p/in/t/a.png"), Path::new("../in/t/a.png"));
        assert_eq!(way("/p", "/p/a.png"), Path::new("a.png"));
    }
}
