"""PNG files from arrays and back, and what an artist would want to see of a lightmap."""

import struct
import zlib

import numpy as np


def save(path, rgb):
    """`rgb`: [rows from the top, columns, 3], 0 to 1 as the screen shows it."""
    pixels = (np.clip(rgb, 0, 1) * 255 + 0.5).astype(np.uint8)
    height, width = pixels.shape[:2]
    rows = np.hstack([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)])

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    body = zlib.compress(rows.tobytes(), 6)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b""))


def load(path):
    """A PNG of this module or of lightkiln: 8 bit RGB, read without Blender so that no colour transform touches it."""
    raw, at, data, size = path.read_bytes(), 8, b"", None
    while at < len(raw):
        (length,) = struct.unpack_from(">I", raw, at)
        kind, body = raw[at + 4 : at + 8], raw[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colours = struct.unpack_from(">2I2B", body)
            if (depth, colours) != (8, 2):
                raise ValueError(f"{path}: not 8 bit RGB")
            size = (height, width)
        elif kind == b"IDAT":
            data += body
        at += 12 + length
    height, width = size
    rows = np.frombuffer(zlib.decompress(data), np.uint8).reshape(height, 1 + 3 * width)
    out = np.zeros((height, width, 3), np.uint8)
    for y, row in enumerate(rows):
        out[y] = unfilter(row[0], row[1:].reshape(width, 3), out[y - 1] if y else np.zeros((width, 3), np.uint8))
    return out / 255


def unfilter(kind, line, above):
    """PNG's five filters (ISO/IEC 15948, 9.2)."""
    if kind == 0:
        return line
    if kind == 1:
        return np.cumsum(line, axis=0, dtype=np.uint8)
    if kind == 2:
        return line + above
    out, left, corner = np.zeros_like(line), np.zeros(3, int), np.zeros(3, int)
    for x in range(len(line)):
        up = above[x].astype(int)
        if kind == 3:
            guess = (left + up) // 2
        else:
            base = left + up - corner
            ways = np.abs(np.stack([base - left, base - up, base - corner]))
            guess = np.choose(ways.argmin(axis=0), [left, up, corner])
        left = (line[x].astype(int) + guess) & 255
        out[x], corner = left, up
    return out


def srgb(linear):
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


def side_by_side(ours, theirs, covered):
    """Two lightmaps at one exposure and their relative difference: red where ours is brighter, blue where darker."""
    white = max(np.percentile(theirs[covered].max(axis=-1), 98) if covered.any() else 1.0, 1e-9)
    off = (ours - theirs).mean(axis=-1) / np.maximum(theirs.mean(axis=-1), 0.02 * white)
    off = np.clip(off / 0.2, -1, 1) * covered
    colours = np.stack([1 + np.minimum(off, 0), 1 - np.abs(off), 1 - np.maximum(off, 0)], axis=-1)
    gap = np.ones((ours.shape[0], 4, 3))
    return np.hstack([srgb(ours / white), gap, srgb(theirs / white), gap, colours * np.where(covered, 1, 0.8)[..., None]])
