//! EXR pages: the only file that writes them. RGB scanlines, ZIP in blocks of 16 rows, linear Rec.709, top row first.

use crate::error::{Error, Result};
use crate::options::{LightPart, Store};
use ::exr::prelude as e;
use ::exr::prelude::{ReadChannels, ReadLayers, WritableImage};
use glam::Vec3;
use half::f16;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

/// The largest finite half float.
pub const HALF_MAX: f32 = 65504.0;

/// Widest page that [`read_exr`] accepts, texels.
const WIDEST: usize = 1 << 16;

/// A ZIP stream cannot expand by more than this, so a larger claim is a lie (RFC 1951: 258 bytes for two bits).
const MOST_EXPANSION: u64 = 1032;

/// What the header says about a page, beside its pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct Header {
    /// `(name, value)`; names stay below 32 bytes, which old readers insist on.
    pub attributes: Vec<(String, Attribute)>,
    /// Program that wrote it.
    pub software: String,
}

/// A value in the header.
#[derive(Clone, Debug)]
pub(super) enum Attribute {
    Text(String),
    Float(f32),
    Double(f64),
    Integer(i32),
}

/// Values that a page cannot hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Mended {
    /// Texels above the largest number, written as that.
    pub clipped: usize,
    /// Texels that were NaN or negative, written as 0.
    pub unlawful: usize,
}

/// A page as bytes.
pub(super) struct Encoded {
    /// The whole file.
    pub bytes: Vec<u8>,
    /// What had to be changed.
    pub mended: Mended,
}

/// The unit of a stored value, in ASCII.
pub(super) fn unit(store: Store, photometric: bool) -> &'static str {
    match (store, photometric) {
        (Store::IrradianceOverPi, false) => "W/(m^2 sr)",
        (Store::IrradianceOverPi, true) => "cd/m^2",
        (Store::Irradiance | Store::Radiosity, false) => "W/m^2",
        (Store::Irradiance, true) => "lx",
        (Store::Radiosity, true) => "lm/m^2",
    }
}

/// The name of a stored quantity, as the command line spells it.
pub(super) fn store_name(store: Store) -> &'static str {
    match store {
        Store::IrradianceOverPi => "irradiance-over-pi",
        Store::Irradiance => "irradiance",
        Store::Radiosity => "radiosity",
    }
}

/// The name of a part of the light, as the command line spells it.
pub(super) fn light_name(light: LightPart) -> &'static str {
    match light {
        LightPart::Full => "full",
        LightPart::Indirect => "indirect",
        LightPart::Direct => "direct",
    }
}

/// Encodes a square page. Same input, same bytes. `at` names the page in errors.
pub(super) fn encode(
    at: &str,
    size: u32,
    value: &[Vec3],
    header: &Header,
    full_float: bool,
) -> Result<Encoded> {
    let size = size as usize;
    if size == 0 || size.checked_mul(size) != Some(value.len()) {
        return Err(Error::invalid(
            at,
            format!("{} texels do not make a square page of {size}", value.len()),
        ));
    }
    let limit = if full_float { f32::MAX } else { HALF_MAX };
    let mended = value.iter().fold(Mended::default(), |mended, &texel| mended.with(texel, limit));
    let channel = |name: &str, axis: usize| {
        let lawful = value.iter().map(|texel| lawful(texel[axis], limit));
        let samples = if full_float {
            e::FlatSamples::F32(lawful.collect())
        } else {
            e::FlatSamples::F16(lawful.map(f16::from_f32).collect())
        };
        e::AnyChannel::new(name, samples)
    };
    let channels =
        e::AnyChannels::sort(["R", "G", "B"].iter().zip(0..).map(|(n, i)| channel(n, i)).collect());
    let mut bytes = file(at, size, header, channels)?;
    sort_attributes(&mut bytes);
    Ok(Encoded { bytes, mended })
}

impl Mended {
    fn with(self, texel: Vec3, limit: f32) -> Self {
        let any = |test: fn(f32, f32) -> bool| usize::from(texel.to_array().iter().any(|&c| test(c, limit)));
        Self {
            clipped: self.clipped + any(|c, limit| c > limit),
            unlawful: self.unlawful + any(|c, _| c.is_nan() || c < 0.0),
        }
    }
}

/// The value that is written for a channel: not negative, not NaN, at most `limit`.
pub(super) fn lawful(channel: f32, limit: f32) -> f32 {
    if channel > 0.0 { channel.min(limit) } else { 0.0 }
}

fn file(at: &str, size: usize, header: &Header, channels: e::AnyChannels<e::FlatSamples>) -> Result<Vec<u8>> {
    let text = |s: &str| e::Text::from_bytes_unchecked(s.as_bytes().into());
    let mut own = e::LayerAttributes::default();
    if !header.software.is_empty() {
        own.software_name = Some(text(&header.software));
    }
    own.other.extend(header.attributes.iter().map(|(name, value)| {
        let value = match value {
            Attribute::Text(s) => e::AttributeValue::Text(text(s)),
            Attribute::Float(x) => e::AttributeValue::F32(*x),
            Attribute::Double(x) => e::AttributeValue::F64(*x),
            Attribute::Integer(x) => e::AttributeValue::I32(*x),
        };
        (text(name), value)
    }));
    let encoding = e::Encoding {
        compression: e::Compression::ZIP16,
        blocks: e::Blocks::ScanLines,
        line_order: e::LineOrder::Increasing,
    };
    let mut image = e::Image::from_layer(e::Layer::new((size, size), own, encoding, channels));
    image.attributes.chromaticities = Some(REC_709);
    let mut out = Cursor::new(Vec::new());
    let write = image.write();
    // The crate would start a thread for every core, however many the caller allows.
    let done = if rayon::current_num_threads() == 1 {
        write.non_parallel().to_buffered(&mut out)
    } else {
        write.to_buffered(&mut out)
    };
    done.map_err(|error| Error::invalid(at, format!("the EXR could not be encoded: {error}")))?;
    Ok(out.into_inner())
}

/// ITU-R BT.709 primaries, D65.
const REC_709: e::attribute::Chromaticities = e::attribute::Chromaticities {
    red: e::Vec2(0.64, 0.33),
    green: e::Vec2(0.30, 0.60),
    blue: e::Vec2(0.15, 0.06),
    white: e::Vec2(0.3127, 0.3290),
};

/// Puts the header's attributes in the order of their names. The crate writes custom ones in the order of a hash map,
/// which differs from run to run. The length stays, so the offsets behind the header hold.
fn sort_attributes(file: &mut [u8]) {
    let mut found: Vec<&[u8]> = Vec::new();
    let start = 8; // magic number and version
    let mut at = start;
    while file.get(at).is_some_and(|&byte| byte != 0) {
        let Some(length) = attribute_length(&file[at..]) else { return };
        found.push(&file[at..at + length]);
        at += length;
    }
    found.sort_unstable();
    let sorted = found.concat();
    file[start..start + sorted.len()].copy_from_slice(&sorted);
}

/// Bytes of the attribute at the start: name, 0, type, 0, length of the value, value.
fn attribute_length(bytes: &[u8]) -> Option<usize> {
    let name = bytes.iter().position(|&b| b == 0)? + 1;
    let kind = bytes[name..].iter().position(|&b| b == 0)? + 1;
    let size = bytes.get(name + kind..name + kind + 4)?;
    let length = name + kind + 4 + u32::from_le_bytes(size.try_into().ok()?) as usize;
    (length <= bytes.len()).then_some(length)
}

/// A page that was read back.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrImage {
    /// Width and height, texels.
    pub size: [usize; 2],
    /// Linear RGB, row by row from the top.
    pub value: Vec<Vec3>,
    /// The header's own attributes as text, by name.
    pub attributes: BTreeMap<String, String>,
}

/// Reads an RGB EXR, of this program or another. A header that claims more than its file can hold is refused before
/// memory is taken.
pub fn read_exr(path: &Path) -> Result<ExrImage> {
    let bytes = std::fs::read(path).map_err(|error| Error::io(path, error))?;
    decode_exr(&path.display().to_string(), &bytes)
}

/// Reads an RGB EXR from memory; `at` names it in errors. See [`read_exr`].
pub fn decode_exr(at: &str, bytes: &[u8]) -> Result<ExrImage> {
    let broken = |error: e::Error| Error::invalid(at, format!("not a readable EXR: {error}"));
    let meta = e::MetaData::read_from_buffered(bytes, false).map_err(broken)?;
    for header in &meta.headers {
        let (w, h) = (header.layer_size.width(), header.layer_size.height());
        let depth: usize = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample()).sum();
        let claim = (w as u64).saturating_mul(h as u64).saturating_mul(depth as u64);
        if w > WIDEST || h > WIDEST || claim > MOST_EXPANSION * bytes.len() as u64 {
            return Err(Error::invalid(
                at,
                format!("its header claims {w} × {h} pixels, more than the file holds"),
            ));
        }
    }
    let image = e::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.width(), vec![Vec3::ZERO; size.area()]),
            |(width, value): &mut (usize, Vec<Vec3>), p, (r, g, b): (f32, f32, f32)| {
                value[p.y() * *width + p.x()] = Vec3::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let layer = image.layer_data;
    let attributes = layer
        .attributes
        .other
        .iter()
        .chain(&image.attributes.other)
        .map(|(name, value)| {
            let value = match value {
                e::AttributeValue::Text(text) => String::from_utf8_lossy(text.as_slice()).into_owned(),
                e::AttributeValue::F32(x) => x.to_string(),
                e::AttributeValue::F64(x) => x.to_string(),
                e::AttributeValue::I32(x) => x.to_string(),
                other => format!("{other:?}"),
            };
            (String::from_utf8_lossy(name.as_slice()).into_owned(), value)
        })
        .collect();
    let size = [layer.size.width(), layer.size.height()];
    Ok(ExrImage { size, value: layer.channel_data.pixels.1, attributes })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        let many = (0..12).map(|i| (format!("lightkiln.{i}"), Attribute::Integer(i))).chain([
            ("lightkiln.store".to_owned(), Attribute::Text("irradiance-over-pi".to_owned())),
            ("lightkiln.texelsPerMetre".to_owned(), Attribute::Float(31.25)),
            ("lightkiln.convergence.unshot".to_owned(), Attribute::Double(1.5e-5)),
            ("lightkiln.settings".to_owned(), Attribute::Text(r#"{"name":"Küche"}"#.to_owned())),
        ]);
        Header { attributes: many.collect(), software: "lightkiln 0.1.0".to_owned() }
    }

    fn gradient(size: u32) -> Vec<Vec3> {
        (0..size * size).map(|i| Vec3::new(i as f32, 0.5, 1.0 / (1.0 + i as f32))).collect()
    }

    #[test]
    fn comes_back_with_its_attributes_top_row_first() {
        let value = gradient(8);
        let half = encode("page", 8, &value, &header(), false).unwrap();
        let float = encode("page", 8, &value, &header(), true).unwrap();
        assert_eq!((half.mended, float.mended), (Mended::default(), Mended::default()));
        let half = decode_exr("page", &half.bytes).unwrap();
        let float = decode_exr("page", &float.bytes).unwrap();
        assert_eq!(float.size, [8, 8]);
        assert_eq!(float.value, value);
        for (stored, wanted) in half.value.iter().zip(&value) {
            // A half has 11 significant bits.
            assert!((*stored - *wanted).abs().cmple(*wanted * 2f32.powi(-11)).all(), "{stored} {wanted}");
        }
        assert_eq!(half.attributes["lightkiln.store"], "irradiance-over-pi");
        assert_eq!(half.attributes["lightkiln.texelsPerMetre"], "31.25");
        assert_eq!(half.attributes["lightkiln.convergence.unshot"], "0.000015");
        assert_eq!(half.attributes["lightkiln.settings"], r#"{"name":"Küche"}"#);
    }

    #[test]
    fn same_bytes_every_time_and_for_any_thread_count() {
        let value = gradient(64);
        let wanted = encode("page", 64, &value, &header(), false).unwrap().bytes;
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let again = pool.install(|| encode("page", 64, &value, &header(), false).unwrap().bytes);
            assert!(again == wanted, "{threads} threads give other bytes");
        }
    }

    #[test]
    fn attributes_are_sorted() {
        let bytes = encode("page", 4, &gradient(4), &header(), false).unwrap().bytes;
        let mut names: Vec<Vec<u8>> = Vec::new();
        let mut at = 8;
        while bytes[at] != 0 {
            names.push(bytes[at..].split(|&b| b == 0).next().unwrap().to_vec());
            at += attribute_length(&bytes[at..]).unwrap();
        }
        assert!(names.len() > 20 && names.is_sorted(), "{names:?}");
    }

    #[test]
    fn what_a_page_cannot_hold_is_mended_and_counted() {
        let mut value = vec![Vec3::ONE; 9];
        value[0] = Vec3::new(1e6, 1.0, f32::INFINITY);
        value[1] = Vec3::new(f32::NAN, -1.0, 2.0);
        value[2] = Vec3::new(-0.0, 65504.0, 65505.0);
        let page = encode("page", 3, &value, &Header::default(), false).unwrap();
        assert_eq!(page.mended, Mended { clipped: 2, unlawful: 1 });
        let read = decode_exr("page", &page.bytes).unwrap();
        assert_eq!(read.value[0], Vec3::new(HALF_MAX, 1.0, HALF_MAX));
        assert_eq!(read.value[1], Vec3::new(0.0, 0.0, 2.0));
        assert_eq!(read.value[2].to_array().map(f32::to_bits), [0f32, HALF_MAX, HALF_MAX].map(f32::to_bits));
    }

    #[test]
    fn refuses_a_page_of_the_wrong_size() {
        assert!(encode("page", 3, &[Vec3::ZERO; 8], &Header::default(), false).is_err());
        assert!(encode("page", 0, &[], &Header::default(), false).is_err());
    }

    #[test]
    fn damaged_files_are_errors() {
        let good = encode("page", 16, &gradient(16), &header(), false).unwrap().bytes;
        assert!(decode_exr("page", b"").is_err());
        assert!(decode_exr("page", &good[..good.len() / 2]).is_err());
        // Every byte of the header in turn: whatever comes of it, no panic and no giant allocation.
        for at in 0..good.len().min(900) {
            for with in [0x00, 0x7f, 0xff] {
                let mut bad = good.clone();
                bad[at] = with;
                let _ = decode_exr("page", &bad);
            }
        }
        let window =
            good.windows(10).position(|w| w == b"dataWindow").unwrap() + b"dataWindow\0box2i\0".len() + 4;
        let mut huge = good.clone();
        huge[window + 8..window + 12].copy_from_slice(&60_000i32.to_le_bytes());
        huge[window + 12..window + 16].copy_from_slice(&60_000i32.to_le_bytes());
        assert!(decode_exr("page", &huge).unwrap_err().to_string().contains("60001"));
    }
}
