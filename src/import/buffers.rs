//! The bytes behind `buffers`, wherever they stand, and the windows on them that `bufferViews` open.

use super::compression;
use super::container;
use super::document::{Buffer, Container, Document};
use super::json::{BUFFER_VIEWS, BUFFERS, Part, items};
use super::uri::{self, Target};
use crate::error::{Error, Result, Warning};
use crate::options::ImportOptions;
use std::path::Path;
use std::sync::OnceLock;

/// Part of a buffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct View<'a> {
    /// The bytes, compression undone.
    pub bytes: &'a [u8],
    /// Bytes from one element to the next, when not tightly packed.
    pub stride: Option<usize>,
}

impl Document {
    /// Takes a file apart and reads the buffers it names. `path` is where `bytes` came from: relative uris start in
    /// its folder.
    pub(super) fn open(
        path: &Path,
        bytes: &[u8],
        options: &ImportOptions,
        warnings: &mut Vec<Warning>,
    ) -> Result<Self> {
        let at = path.display().to_string();
        let (container::Text { value: json, exponents }, container) = container::open(bytes, &at, warnings)?;
        let mut document = Self { path: path.to_owned(), json, exponents, container, buffers: Vec::new() };
        super::extensions::check(&document.json, &at)?;
        let count = items(&document.json, BUFFERS)?.len();
        document.buffers =
            (0..count).map(|index| document.read_buffer(index, options)).collect::<Result<_>>()?;
        document.find_packed_views()?;
        Ok(document)
    }

    fn read_buffer(&self, index: usize, options: &ImportOptions) -> Result<Buffer> {
        let part = Part::item(&self.json, BUFFERS, index)?;
        let at = part.at();
        let length = part.required_index("byteLength")?;
        let (bytes, path) = match (part.text("uri")?, &self.container) {
            (Some(uri), _) => match uri::resolve(self.folder(), uri, options.allow_outside, &at)? {
                Target::Data(bytes) => (bytes, None),
                Target::File(path) => {
                    (uri::read_file(self.folder(), &path, options.allow_outside, &at)?, Some(path))
                }
            },
            (None, Container::Binary { bin: Some(bin), .. }) if index == 0 && !is_fallback(&part)? => {
                (bin.clone(), None)
            }
            // A placeholder: whoever needs its bytes says so.
            (None, _) => return Ok(Buffer { bytes: Vec::new(), path: None, packed_views: Vec::new() }),
        };
        let mut bytes = bytes;
        if bytes.len() < length {
            let source = path.as_deref().map_or_else(|| at.clone(), |path| path.display().to_string());
            let what = if bytes.starts_with(b"version https://git-lfs") {
                "this is a Git LFS pointer, not the file itself: run `git lfs pull`".to_owned()
            } else {
                let has = bytes.len();
                format!(
                    "it holds {has} bytes but {at} promises {length}: it was cut off, export the scene again"
                )
            };
            return Err(Error::invalid(source, what));
        }
        bytes.truncate(length);
        Ok(Buffer { bytes, path, packed_views: Vec::new() })
    }

    /// Notes which buffers hold compressed views. Nothing is decoded yet.
    fn find_packed_views(&mut self) -> Result<()> {
        for view in 0..items(&self.json, BUFFER_VIEWS)?.len() {
            let part = Part::item(&self.json, BUFFER_VIEWS, view)?;
            let Some(extension) = compression::meshopt_extension(&part)? else { continue };
            let source = extension.required_index("buffer")?;
            if let Some(buffer) = self.buffers.get_mut(source) {
                buffer.packed_views.push((view, OnceLock::new()));
            }
        }
        Ok(())
    }

    /// The bytes of a buffer view; `by` is what asks for it.
    pub(super) fn view(&self, index: usize, by: &Part) -> Result<View<'_>> {
        let part = Part::item(&self.json, BUFFER_VIEWS, index)
            .map_err(|_| by.dangling("bufferView", BUFFER_VIEWS, index))?;
        let stride = part.index("byteStride")?;
        if let Some(extension) = compression::meshopt_extension(&part)? {
            let source = self.buffers.get(extension.required_index("buffer")?);
            let packed = source.map_or(&[] as &[_], |buffer| &buffer.packed_views);
            let Ok(found) = packed.binary_search_by_key(&index, |(view, _)| *view) else {
                return Err(extension.wrong("buffer", "does not exist"));
            };
            let decoded = packed[found].1.get_or_init(|| self.decode_view(&part, &extension));
            return match decoded {
                DecodedView::Bytes(bytes) => Ok(View { bytes, stride }),
                DecodedView::Broken(what) => Err(Error::invalid(part.at(), what.clone())),
            };
        }
        Ok(View { bytes: self.window(&part)?, stride })
    }

    /// The bytes that `buffer`, `byteOffset` and `byteLength` of `part` point to.
    pub(super) fn window(&self, part: &Part) -> Result<&[u8]> {
        let buffer = part.required_index("buffer")?;
        let offset = part.index("byteOffset")?.unwrap_or(0);
        let length = part.required_index("byteLength")?;
        let bytes = match self.buffers.get(buffer) {
            Some(buffer) => &buffer.bytes,
            None => return Err(part.dangling("buffer", BUFFERS, buffer)),
        };
        offset.checked_add(length).and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
            let has = bytes.len();
            let what = format!(
                "it wants bytes {offset} to {offset}+{length} of buffer {buffer}, which has {has}: export again"
            );
            Error::invalid(part.at(), what)
        })
    }

    fn decode_view(&self, part: &Part, extension: &Part) -> DecodedView {
        let decoded = self.window(extension).and_then(|source| compression::meshopt(source, part, extension));
        match decoded {
            Ok(bytes) => DecodedView::Bytes(bytes),
            Err(Error::Invalid { what, .. } | Error::Unsupported { what, .. }) => DecodedView::Broken(what),
            Err(other) => DecodedView::Broken(other.to_string()),
        }
    }

    /// Bytes in all buffers together.
    pub(super) fn total_bytes(&self) -> usize {
        self.buffers.iter().map(|buffer| buffer.bytes.len()).sum()
    }
}

use compression::DecodedView;

/// Whether a buffer only stands in for readers that cannot undo the compression.
fn is_fallback(part: &Part) -> Result<bool> {
    for name in compression::MESHOPT_NAMES {
        if let Some(extension) = part.extension(name)? {
            return Ok(extension.flag("fallback")?.unwrap_or(false));
        }
    }
    Ok(false)
}
