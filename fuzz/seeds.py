#!/usr/bin/env python3
"""Makes the inputs that fuzzing starts from: small glTF files, packed into single GLBs, and small pictures.

usage: fuzz/seeds.py OUT FOLDER...    OUT/scenes for the targets that read glTF, OUT/pictures for `sky`
"""

import base64
import hashlib
import json
import struct
import sys
from pathlib import Path

MOST_BYTES = 32 << 10
"""Larger files make a fuzzer slow."""
PICTURES = {".png", ".jpg", ".jpeg", ".webp", ".hdr", ".exr"}


def split(data: bytes) -> tuple[dict, bytes] | None:
    """JSON and BIN chunk of a GLB or glTF; nothing where it is broken."""
    try:
        if not data.startswith(b"glTF"):
            return json.loads(data), b""
        size = struct.unpack_from("<I", data, 12)[0]
        text, rest = data[20 : 20 + size], data[20 + size :]
        return json.loads(text.rstrip(b"\0")), rest[8:]
    except (ValueError, struct.error):
        return None


def join(document: dict, binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def behind(item: dict, folder: Path) -> bytes | None:
    """What a buffer's or an image's uri leads to."""
    uri = item.get("uri")
    try:
        if not isinstance(uri, str):
            return None
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (folder / uri).read_bytes()
    except (OSError, ValueError, IndexError):
        return None


def pack(path: Path) -> bytes | None:
    """One GLB: the first buffer becomes its BIN chunk, all other files data URIs."""
    if path.stat().st_size > MOST_BYTES:
        return None
    data = path.read_bytes()
    parts = split(data)
    if parts is None or not isinstance(parts[0], dict):
        return data
    document, binary = parts
    lists = [document.get(key) for key in ("buffers", "images")]
    items = [item for found in lists if isinstance(found, list) for item in found if isinstance(item, dict)]
    for item in items:
        content = behind(item, path.parent)
        if content is None:
            continue
        if not binary and item is items[0] and item in (document.get("buffers") or []):
            binary = content
            del item["uri"]
        else:
            item["uri"] = "data:;base64," + base64.b64encode(content).decode()
    if isinstance(document.get("asset"), dict):
        # The options of a bake, see tests/bad_input/sound.rs.
        document["asset"]["extras"] = {"choices": [0] * 16}
    packed = join(document, binary)
    return packed if len(packed) <= MOST_BYTES else None


def main() -> None:
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    out, counts = Path(sys.argv[1]), {"scenes": 0, "pictures": 0}
    for name in counts:
        (out / name).mkdir(parents=True, exist_ok=True)
    for folder in map(Path, sys.argv[2:]):
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            kind, data = None, None
            if path.suffix.lower() in {".glb", ".gltf"}:
                kind, data = "scenes", pack(path)
            elif path.suffix.lower() in PICTURES and path.stat().st_size <= MOST_BYTES:
                kind, data = "pictures", path.read_bytes()
            if data:
                (out / kind / hashlib.sha1(data).hexdigest()).write_bytes(data)
                counts[kind] += 1
    print(", ".join(f"{count} {name}" for name, count in counts.items()), "in", out)


if __name__ == "__main__":
    main()
