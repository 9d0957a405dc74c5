//! Textures: images decoded once each, whatever number of materials use them. The only file of this stage that decodes
//! pictures of surfaces.

use super::claims;
use super::document::Document;
use super::json::{IMAGES, Part, SAMPLERS, TEXTURES};
use super::uri::{self, Target};
use crate::error::{Error, Result};
use crate::options::ImportOptions;
use crate::scene::{Filter, Pixels, Texture, TextureId, Wrap};
use image::{ImageError, ImageReader, Limits, RgbaImage};
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Widest and tallest picture that is read, texels.
const MAX_SIDE: u32 = 16_384;
/// The most texels all pictures of a scene may have together: 4 GiB.
const MAX_TEXELS: u64 = 1 << 30;

/// How stored values become light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Space {
    Srgb,
    Linear,
}

/// A picture with everything that decides how it is read; equal ones become one texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Key {
    image: usize,
    wrap: [Wrap; 2],
    filter: Filter,
    space: Space,
}

/// A promise of a texture, redeemed with [`Decoded::get`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Ticket(usize);

/// Collects which textures are wanted, so that each is decoded once and all at the same time.
pub(super) struct Wanted<'a> {
    document: &'a Document,
    keys: Vec<Key>,
}

/// Decoded textures.
pub(super) struct Decoded {
    pub textures: Vec<Texture>,
    /// By ticket: the texture, or why there is none.
    outcomes: Vec<std::result::Result<TextureId, String>>,
}

impl Decoded {
    /// The texture of a ticket, or why there is none.
    pub fn get(&self, ticket: Ticket) -> std::result::Result<TextureId, &str> {
        self.outcomes[ticket.0].as_ref().copied().map_err(String::as_str)
    }
}

impl<'a> Wanted<'a> {
    pub fn new(document: &'a Document) -> Self {
        Self { document, keys: Vec::new() }
    }

    /// Asks for a texture. The inner error says why it can never be read.
    pub fn ask(
        &mut self,
        texture: usize,
        space: Space,
        by: &Part,
    ) -> Result<std::result::Result<Ticket, String>> {
        let json = &self.document.json;
        let part = Part::item(json, TEXTURES, texture)
            .map_err(|_| by.dangling("texture index", TEXTURES, texture))?;
        let webp = match part.extension("EXT_texture_webp")? {
            Some(extension) => extension.index("source")?,
            None => None,
        };
        let Some(image) = part.index("source")?.or(webp) else {
            let carriers: Vec<&str> = part
                .object
                .get("extensions")
                .and_then(|extensions| extensions.as_object())
                .map(|extensions| extensions.keys().map(String::as_str).collect())
                .unwrap_or_default();
            return Ok(Err(match carriers.as_slice() {
                [] => "it names no image".to_owned(),
                names => format!(
                    "it is stored only as {}, which is not decoded: export PNG, JPEG or WebP beside it",
                    names.join(", ")
                ),
            }));
        };
        Part::item(json, IMAGES, image).map_err(|_| part.dangling("source", IMAGES, image))?;
        let (wrap, filter) = match part.follow(json, "sampler", SAMPLERS)? {
            None => ([Wrap::Repeat; 2], Filter::Linear),
            Some(sampler) => {
                // 9728, 9984 and 9986 read the nearest texel of a level.
                let nearest =
                    |key| Ok::<_, Error>(sampler.index(key)?.map(|f| matches!(f, 9728 | 9984 | 9986)));
                let near = nearest("magFilter")?.or(nearest("minFilter")?).unwrap_or(false);
                let filter = if near { Filter::Nearest } else { Filter::Linear };
                ([wrap(&sampler, "wrapS")?, wrap(&sampler, "wrapT")?], filter)
            }
        };
        let key = Key { image, wrap, filter, space };
        let known = self.keys.iter().position(|other| *other == key);
        Ok(Ok(Ticket(known.unwrap_or_else(|| {
            self.keys.push(key);
            self.keys.len() - 1
        }))))
    }

    /// Reads and decodes everything that was asked for.
    pub fn decode(self, options: &ImportOptions) -> Result<Decoded> {
        let mut images: Vec<usize> = self.keys.iter().map(|key| key.image).collect();
        images.sort_unstable();
        images.dedup();
        let mut encoded = Vec::with_capacity(images.len());
        let (mut texels, mut held) = (0_u64, 0_usize);
        for &image in &images {
            let part = Part::item(&self.document.json, IMAGES, image)?;
            let read = read_bytes(self.document, &part, options)?.and_then(|bytes| {
                let [w, h] = size_of(&bytes)?;
                texels += u64::from(w) * u64::from(h);
                held += bytes.len();
                Ok(bytes)
            });
            encoded.push(read);
        }
        if texels > MAX_TEXELS {
            let what = format!(
                "its pictures have {} million texels together, more than the {} million that are read: shrink some",
                texels >> 20,
                MAX_TEXELS >> 20
            );
            return Err(Error::TooLarge { what, at: self.document.path.display().to_string() });
        }
        if !claims::TEXELS.holds(texels, held) {
            let what = format!(
                "its pictures claim {} million texels, far more than their {held} bytes can hold: they are broken, or \
                 plain colours that should be smaller",
                texels >> 20
            );
            return Err(Error::TooLarge { what, at: self.document.path.display().to_string() });
        }
        let pictures: Vec<std::result::Result<RgbaImage, String>> =
            encoded.into_par_iter().map(|bytes| decode(&bytes?)).collect();

        let mut decoded = Decoded { textures: Vec::new(), outcomes: Vec::new() };
        for key in &self.keys {
            let name = Part::item(&self.document.json, IMAGES, key.image)?.label();
            let picture = images.binary_search(&key.image).ok().map(|i| &pictures[i]);
            let outcome = match picture {
                Some(Ok(picture)) => {
                    let id = TextureId(decoded.textures.len() as u32);
                    texture(&name, picture, key).map(|texture| {
                        decoded.textures.push(texture);
                        id
                    })
                }
                Some(Err(what)) => Err(format!("image '{name}' {what}")),
                None => Err(format!("image '{name}' was not read")),
            };
            decoded.outcomes.push(outcome);
        }
        Ok(decoded)
    }
}

fn texture(name: &str, picture: &RgbaImage, key: &Key) -> std::result::Result<Texture, String> {
    let size = [picture.width(), picture.height()];
    let texels: Vec<[u8; 4]> = picture.pixels().map(|pixel| pixel.0).collect();
    let pixels = match key.space {
        Space::Srgb => Pixels::Srgb8(texels),
        Space::Linear => Pixels::Linear8(texels),
    };
    Texture::new(name.to_owned(), size, pixels, key.wrap, key.filter)
        .ok_or_else(|| format!("image '{name}' is empty"))
}

fn wrap(sampler: &Part, key: &str) -> Result<Wrap> {
    match sampler.index(key)? {
        None | Some(10497) => Ok(Wrap::Repeat),
        Some(33071) => Ok(Wrap::Clamp),
        Some(33648) => Ok(Wrap::Mirror),
        Some(_) => Err(sampler.wrong(key, "must be 10497 (repeat), 33071 (clamp) or 33648 (mirror)")),
    }
}

/// The encoded bytes of an image. A missing file costs a texture, not the bake; a forbidden one stops it.
fn read_bytes<'a>(
    document: &'a Document,
    image: &Part,
    options: &ImportOptions,
) -> Result<std::result::Result<Cow<'a, [u8]>, String>> {
    if let Some(view) = image.index("bufferView")? {
        return Ok(Ok(Cow::Borrowed(document.view(view, image)?.bytes)));
    }
    let Some(uri) = image.text("uri")? else {
        return Ok(Err("names neither a file nor a buffer view".to_owned()));
    };
    match uri::resolve(document.folder(), uri, options.allow_outside, &image.at()) {
        Ok(Target::Data(bytes)) => Ok(Ok(Cow::Owned(bytes))),
        Ok(Target::File(path)) => {
            match uri::read_file(document.folder(), &path, options.allow_outside, &image.at()) {
                Ok(bytes) => Ok(Ok(Cow::Owned(bytes))),
                Err(Error::Io { path, source }) => {
                    Ok(Err(format!("is missing ({}: {source})", path.display())))
                }
                Err(other) => Err(other),
            }
        }
        Err(Error::Unsupported { what, .. }) => Ok(Err(format!("is not read: {what}"))),
        Err(other) => Err(other),
    }
}

impl Document {
    /// The bytes of an image as they are stored, of whatever format.
    pub fn image_bytes(&self, image: usize, options: &ImportOptions) -> Result<Cow<'_, [u8]>> {
        let part = Part::item(&self.json, IMAGES, image)?;
        read_bytes(self, &part, options)?.map_err(|what| Error::invalid(part.at(), what))
    }

    /// The bytes of a file that something in the scene names, as a uri or plainly; `at` is what names it.
    pub fn companion_bytes(&self, name: &str, options: &ImportOptions, at: &str) -> Result<Vec<u8>> {
        match uri::resolve(self.folder(), name, options.allow_outside, at)? {
            Target::Data(bytes) => Ok(bytes),
            Target::File(path) => uri::read_file(self.folder(), &path, options.allow_outside, at),
        }
    }
}

fn reader(bytes: &[u8]) -> std::result::Result<ImageReader<Cursor<&[u8]>>, String> {
    let Ok(format) = image::guess_format(bytes) else {
        return Err(match bytes {
            _ if bytes.starts_with(&[0xAB, b'K', b'T', b'X']) => {
                "is KTX2, which is not decoded: export PNG, JPEG or WebP".to_owned()
            }
            _ if bytes.starts_with(b"version https://git-lfs") => {
                "is a Git LFS pointer, not a picture: run `git lfs pull`".to_owned()
            }
            _ => "is neither PNG, JPEG nor WebP".to_owned(),
        });
    };
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(4 << 30);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    Ok(reader)
}

/// Runs a foreign decoder: whatever it does with a broken file, the bake goes on.
fn guarded<T>(run: impl FnOnce() -> std::result::Result<T, ImageError>) -> std::result::Result<T, String> {
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(format!("cannot be decoded ({error})")),
        Err(_) => Err("cannot be decoded (its decoder gave up)".to_owned()),
    }
}

fn size_of(bytes: &[u8]) -> std::result::Result<[u32; 2], String> {
    let reader = reader(bytes)?;
    let (w, h) = guarded(|| reader.into_dimensions())?;
    if w > MAX_SIDE || h > MAX_SIDE {
        return Err(format!("has {w} × {h} texels, more than {MAX_SIDE} a side: shrink it"));
    }
    Ok([w, h])
}

fn decode(bytes: &[u8]) -> std::result::Result<RgbaImage, String> {
    let reader = reader(bytes)?;
    guarded(|| reader.decode()).map(image::DynamicImage::into_rgba8)
}
