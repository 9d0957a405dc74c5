//! The binary container (glTF 2.0 section 4).

use super::append::Piece;
use crate::error::{Error, Result};

const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;

/// A GLB in pieces: header, JSON padded with spaces, BIN padded with zeros, the other chunks as they were.
pub(super) fn pieces<'a>(
    at: &str,
    mut json: Vec<u8>,
    bin: Option<Vec<Piece<'a>>>,
    other_chunks: &'a [(u32, Vec<u8>)],
) -> Result<Vec<Piece<'a>>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let bin = bin.map(|mut bin| {
        let length = size(&bin);
        bin.push(Piece::New(vec![0; length.next_multiple_of(4) - length]));
        bin
    });
    let chunks = std::iter::once((CHUNK_JSON, vec![Piece::New(json)]))
        .chain(bin.map(|bin| (CHUNK_BIN, bin)))
        .chain(other_chunks.iter().map(|(kind, bytes)| (*kind, vec![Piece::Old(bytes)])));

    let mut out = vec![Piece::New(Vec::new())];
    for (kind, chunk) in chunks {
        let mut head = length(at, size(&chunk))?.to_vec();
        head.extend(kind.to_le_bytes());
        out.push(Piece::New(head));
        out.extend(chunk);
    }
    let mut head = b"glTF\x02\0\0\0".to_vec();
    head.extend(length(at, 12 + size(&out))?);
    out[0] = Piece::New(head);
    Ok(out)
}

fn size(pieces: &[Piece]) -> usize {
    pieces.iter().map(|piece| piece.as_ref().len()).sum()
}

fn length(at: &str, bytes: usize) -> Result<[u8; 4]> {
    match u32::try_from(bytes) {
        Ok(bytes) => Ok(bytes.to_le_bytes()),
        Err(_) => Err(Error::TooLarge {
            what: format!("{bytes} bytes do not fit into a .glb, which ends at 4 GiB: write a .gltf instead"),
            at: at.to_owned(),
        }),
    }
}
