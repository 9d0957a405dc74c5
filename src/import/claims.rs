//! How much a file may claim. A few bytes can promise billions of vertices or pixels, and a decoder that believes them
//! takes the memory first and finds the bytes missing later. So what is claimed is measured by what is there.

/// A bound on what bytes can stand for.
pub(super) struct Claim {
    /// So much is believed of any file.
    free: u64,
    /// So much more for every byte.
    per_byte: u64,
}

/// Texels of pictures on surfaces. Deflate, the densest of their codes that is in use, makes a byte of at most 1032
/// (zlib's technical note), and a byte of a one-bit PNG is eight texels. 256 MiB of texels are free: lossless WebP
/// stores a plain colour of any size in a few bytes.
pub(super) const TEXELS: Claim = Claim { free: 1 << 26, per_byte: 8 * 1032 };
/// Pixels of a sky: deflate again, over pixels of three bytes or more in planes of one byte each; 96 MiB are free.
pub(super) const SKY_PIXELS: Claim = Claim { free: 1 << 23, per_byte: 1032 };
/// Vertices placed in the world. An instance is 12 bytes or more, and repeats meshes that take more bytes the more
/// vertices they have; a million vertices in 2 MB a hundred times are 50 a byte. About 200 MiB are free.
pub(super) const VERTICES: Claim = Claim { free: 1 << 22, per_byte: 256 };
/// Points of a Draco stream. A plain grid takes a twentieth of a bit each.
pub(super) const DRACO_POINTS: Claim = Claim { free: 1 << 20, per_byte: 1024 };
/// Bytes of attributes. Meshes that are split by material share their attributes: hundreds of parts may each claim all.
pub(super) const ATTRIBUTE_BYTES: Claim = Claim { free: 1 << 28, per_byte: 256 };
/// Bytes of an accessor that nothing backs: zero by the rules. Real ones are the deltas of morph targets, never more
/// than the mesh they change.
pub(super) const ZERO_BYTES: Claim = Claim { free: 1 << 24, per_byte: 64 };

impl Claim {
    /// The most that `bytes` can stand for.
    pub fn most(&self, bytes: usize) -> u64 {
        self.per_byte.saturating_mul(bytes as u64).saturating_add(self.free)
    }

    /// Whether `bytes` can stand for `claimed`.
    pub fn holds(&self, claimed: u64, bytes: usize) -> bool {
        claimed <= self.most(bytes)
    }
}
