//! Where the bytes of a `uri` are: in the text itself, or in a file that must lie in the scene's folder.

use crate::error::{Error, Result};
use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;
use std::path::{Component, Path, PathBuf};

/// Decodes data URIs as browsers do: padding may be missing.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// What a `uri` leads to.
#[derive(Debug, PartialEq)]
pub(super) enum Target {
    /// The bytes stood in the uri.
    Data(Vec<u8>),
    /// The bytes stand in this file.
    File(PathBuf),
}

/// Resolves a uri against the folder of the scene. `at` names the buffer or image.
pub(super) fn resolve(folder: &Path, uri: &str, allow_outside: bool, at: &str) -> Result<Target> {
    if let Some(rest) = strip_scheme(uri, "data:") {
        return decode_data(rest, at).map(Target::Data);
    }
    if let Some(scheme) = scheme(uri) {
        let what = format!(
            "its uri '{}' is a {scheme}: address; only files beside the scene and data: are read. \
             Put the file into the scene's folder and name it relatively, or export a .glb",
            shorten(uri)
        );
        return Err(Error::unsupported(at, what));
    }
    let decoded = percent_decode_str(uri)
        .decode_utf8()
        .map_err(|_| Error::invalid(at, format!("its uri '{}' is not UTF-8 when decoded", shorten(uri))))?;
    let mut path = local_path(folder, &decoded, uri, allow_outside, at)?;
    if decoded != uri && !path.exists() {
        // Some exporters write file names as they are, with a percent sign that is part of the name.
        let plain = local_path(folder, uri, uri, allow_outside, at)?;
        if plain.exists() {
            path = plain;
        }
    }
    Ok(Target::File(path))
}

/// Reads a file that a uri led to. Devices and pipes are refused: they could block for ever.
pub(super) fn read_file(folder: &Path, path: &Path, allow_outside: bool, at: &str) -> Result<Vec<u8>> {
    let metadata = std::fs::metadata(path).map_err(|source| Error::io(path, source))?;
    if !metadata.is_file() {
        return Err(Error::invalid(at, format!("'{}' is not a regular file", path.display())));
    }
    if !allow_outside {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let inside = match (folder.canonicalize(), path.canonicalize()) {
            (Ok(folder), Ok(path)) => path.starts_with(folder),
            _ => false,
        };
        if !inside {
            return Err(outside(&path.display().to_string(), at));
        }
    }
    std::fs::read(path).map_err(|source| Error::io(path, source))
}

fn local_path(folder: &Path, name: &str, uri: &str, allow_outside: bool, at: &str) -> Result<PathBuf> {
    if name.is_empty() || name.contains('\0') {
        return Err(Error::invalid(at, format!("its uri '{}' names no file", shorten(uri))));
    }
    // Exporters on Windows write backslashes; a drive letter leads outside as a leading slash does.
    let name = name.replace('\\', "/");
    let absolute = name.starts_with('/') || name.as_bytes().get(1) == Some(&b':');
    let mut depth = 0_i64;
    let mut leaves = absolute;
    for component in Path::new(&name).components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::ParentDir => depth -= 1,
            _ => {}
        }
        leaves |= depth < 0;
    }
    if leaves && !allow_outside {
        return Err(outside(uri, at));
    }
    Ok(if absolute { PathBuf::from(name) } else { folder.join(name) })
}

fn outside(uri: &str, at: &str) -> Error {
    let what = format!(
        "its uri '{}' leads out of the scene's folder. Move the file beside the scene, or pass --allow-outside if \
         you trust this file",
        shorten(uri)
    );
    Error::invalid(at, what)
}

/// The scheme of an absolute URI; a single letter is a Windows drive, not a scheme.
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut letters = scheme.bytes();
    let lawful = scheme.len() > 1
        && letters.next().is_some_and(|b| b.is_ascii_alphabetic())
        && letters.all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b));
    lawful.then_some(scheme)
}

fn strip_scheme<'a>(uri: &'a str, scheme: &str) -> Option<&'a str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme).then(|| &uri[scheme.len()..])
}

fn decode_data(rest: &str, at: &str) -> Result<Vec<u8>> {
    let Some((head, data)) = rest.split_once(',') else {
        return Err(Error::invalid(at, "its data: uri has no comma before the data: export the scene again"));
    };
    if !head.to_ascii_lowercase().ends_with(";base64") {
        return Ok(percent_decode_str(data).collect());
    }
    let decoded = if data.contains('%') {
        let plain: Vec<u8> = percent_decode_str(data).collect();
        BASE64.decode(plain)
    } else {
        BASE64.decode(data)
    };
    decoded.map_err(|error| Error::invalid(at, format!("its data: uri is not valid base64 ({error})")))
}

/// A uri that fits into a message.
pub(super) fn shorten(uri: &str) -> String {
    let mut short: String = uri.chars().filter(|c| !c.is_control()).take(120).collect();
    if short.len() < uri.len() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(uri: &str) -> Result<Target> {
        resolve(Path::new("scenes/house"), uri, false, "buffer 0")
    }

    #[test]
    fn decodes_data_uris() {
        let data = |uri| match file(uri) {
            Ok(Target::Data(bytes)) => bytes,
            other => panic!("{other:?}"),
        };
        assert_eq!(data("data:application/octet-stream;base64,AAEC"), [0, 1, 2]);
        assert_eq!(data("DATA:;base64,AAE"), [0, 1]);
        assert_eq!(data("data:;base64,AAE%3D"), [0, 1]);
        assert_eq!(data("data:text/plain,a%20b"), b"a b");
        assert!(file("data:;base64,A*EC").is_err());
        assert!(file("data:nothing").is_err());
    }

    #[test]
    fn stays_in_the_folder() {
        let inside = |uri| match file(uri) {
            Ok(Target::File(path)) => path,
            other => panic!("{other:?}"),
        };
        assert_eq!(inside("a%20b/wood.png"), Path::new("scenes/house/a b/wood.png"));
        assert_eq!(inside("a\\wood.png"), Path::new("scenes/house/a/wood.png"));
        assert_eq!(inside("a/../wood.png"), Path::new("scenes/house/a/../wood.png"));
        for uri in ["../x.bin", "a/../../x.bin", "/etc/passwd", "%2e%2e/x.bin", "C:\\x.bin", "..\\x.bin"] {
            let message = file(uri).unwrap_err().to_string();
            assert!(message.contains("--allow-outside") && message.contains("buffer 0"), "{message}");
        }
        assert!(matches!(
            resolve(Path::new("s"), "../x.bin", true, "b"),
            Ok(Target::File(path)) if path == Path::new("s/../x.bin")
        ));
    }

    #[test]
    fn refuses_other_schemes_and_empty_names() {
        for uri in ["http://x/y.bin", "file:///etc/passwd", "ftp:x", "", "a\0b"] {
            assert!(file(uri).is_err(), "{uri:?}");
        }
    }

    #[test]
    fn a_link_that_leads_out_is_refused() {
        let root = tempfile::tempdir().unwrap();
        let (folder, secret) = (root.path().join("scene"), root.path().join("secret.bin"));
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(&secret, b"1").unwrap();
        std::fs::write(folder.join("own.bin"), b"2").unwrap();
        assert_eq!(read_file(&folder, &folder.join("own.bin"), false, "b").unwrap(), b"2");
        assert!(read_file(&folder, &folder, false, "b").is_err());
        #[cfg(unix)]
        {
            let link = folder.join("link.bin");
            std::os::unix::fs::symlink(&secret, &link).unwrap();
            assert!(read_file(&folder, &link, false, "b").is_err());
            assert_eq!(read_file(&folder, &link, true, "b").unwrap(), b"1");
        }
    }
}
