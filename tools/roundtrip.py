#!/usr/bin/env python3
"""Imports a scene and its baked copy into Blender and checks that the bake lost nothing and added what it should.

usage: roundtrip.py ORIGINAL BAKED [ORIGINAL BAKED ...] [--report FILE.json]
       (Python with the bpy 4.5 package; or: blender -b -P roundtrip.py -- ORIGINAL BAKED ...)

Exit code 0: all checks passed; 1: some failed; 2: wrong usage.
"""

import argparse
import json
import struct
import sys
import urllib.parse
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy
import numpy as np

import blender_snapshot as snapshot

# What a bake adds: where its light is, to every node, and the list of its pages, to the scene.
ADDED_PROPERTY = "lightmap"
ADDED_TO_SCENE = "lightmaps"
# Blender packs an imported normal into 16-bit cosines, in a frame that depends on the neighbours; near 1 a cosine that
# coarse is off by sqrt(2 / 32767) in the angle. A split vertex has other neighbours: its normal comes back different.
NORMAL_TOLERANCE = 1e-2


# ---- what must not have changed -----------------------------------------------------------------------------------


def differences(before, after, at="", tolerance=1e-6):
    """Readable lines, one for each place where two nests of plain data differ."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in before.keys() | after.keys():
            place = f"{at} > {key}" if at else str(key)
            if key not in after:
                yield f"{place}: lost"
            elif key not in before:
                yield f"{place}: new"
            else:
                yield from differences(before[key], after[key], place, tolerance)
    elif isinstance(before, np.ndarray) and isinstance(after, np.ndarray):
        if before.shape != after.shape:
            yield f"{at}: shape {before.shape}, now {after.shape}"
        elif not np.allclose(before, after, rtol=tolerance, atol=tolerance, equal_nan=True):
            yield f"{at}: differs by up to {np.abs(before - after).max():.3g}"
    elif isinstance(before, (list, tuple)) and isinstance(after, (list, tuple)) and len(before) == len(after):
        for number, pair in enumerate(zip(before, after)):
            yield from differences(*pair, f"{at}[{number}]", tolerance)
    elif isinstance(before, float) and isinstance(after, float):
        if not np.isclose(before, after, rtol=tolerance, atol=tolerance, equal_nan=True):
            yield f"{at}: {before}, now {after}"
    elif before != after:
        yield f"{at}: {before!r}, now {after!r}"


def block_differences(before, after):
    """Like `differences` for named blocks, but meshes and materials may have become several equal ones."""
    yield from differences(
        *({name: block for name, block in side.items() if not may_be_copied(name)} for side in (before, after))
    )
    for one, other, what in ((before, after, "lost or changed"), (after, before, "new or changed")):
        for name, block in one.items():
            if not may_be_copied(name):
                continue
            twins = [twin for other_name, twin in other.items() if snapshot.stem(other_name) == snapshot.stem(name)]
            reasons = [list(differences(twin, block)) for twin in twins]
            if not twins:
                yield f"{name}: {what}"
            elif all(reasons):
                yield f"{name}: {what}, {min(reasons, key=len)[0]}"


def may_be_copied(name):
    return name.startswith(("meshes ", "materials "))


def without_added(properties):
    """Custom properties minus the entries that a bake adds."""

    def added(owner):
        return ADDED_TO_SCENE if owner.startswith("scenes ") else ADDED_PROPERTY

    return {
        owner: {key: value for key, value in held.items() if key != added(owner)}
        for owner, held in properties.items()
    }


def mesh_differences(before, after):
    for name in before.keys() & after.keys():
        yield from (f"{name}: {line}" for line in corner_differences(before[name], after[name]))


def corner_differences(a, b):
    if len(a.triangles) != len(b.triangles):
        yield f"{len(a.triangles)} triangles, now {len(b.triangles)}"
        return
    if not np.array_equal(np.unique(a.vertices, axis=0), np.unique(b.vertices, axis=0)):
        yield "vertices stand elsewhere"
    if a.loose_edges != b.loose_edges:
        yield f"{a.loose_edges} loose edges, now {b.loose_edges}"
    if a.columns.keys() != b.columns.keys():
        yield f"vertex data {sorted(a.columns)}, now {sorted(b.columns)}"
        return
    # The original's UV sets come first and in order; what comes after them is the bake's.
    shared = list(a.uv_sets)
    if list(b.uv_sets)[: len(shared)] != shared:
        yield f"UV sets {shared}, now {list(b.uv_sets)}"
        return
    yield from differences(a.shape_keys, b.shape_keys, "shape keys")

    rows = [np.hstack([*side.columns.values(), *(side.uv_sets[name] for name in shared)]) + 0.0 for side in (a, b)]
    split = len(rows[0])
    identity = np.unique(np.vstack(rows), axis=0, return_inverse=True)[1].reshape(-1)
    materials = {name: number for number, name in enumerate(sorted({*a.material_of, *b.material_of}, key=str))}
    sorted_a, order_a = in_order(identity[:split][a.triangles], [materials[name] for name in a.material_of])
    sorted_b, order_b = in_order(identity[split:][b.triangles], [materials[name] for name in b.material_of])
    if changed := int((sorted_a != sorted_b).any(axis=1).sum()):
        yield f"{changed} of {len(sorted_a)} triangles differ in position, UV, colour, weight, shape key or material"
        return
    normals_a, normals_b = (
        a.normals[a.triangles].reshape(-1, 3)[order_a],
        b.normals[b.triangles].reshape(-1, 3)[order_b],
    )
    if len(normals_a) and (off := np.abs(normals_a - normals_b).max()) > NORMAL_TOLERANCE:
        yield f"normals differ by up to {off:.3g}"


def in_order(triangles, materials):
    """Triangles as sorted rows (three corner identities from the smallest on, material), and their corners' order."""
    first = triangles.argmin(axis=1)
    turn = (first[:, None] + np.arange(3)) % 3
    rows = np.hstack([np.take_along_axis(triangles, turn, axis=1), np.array(materials, int).reshape(-1, 1)])
    order = np.lexsort(rows.T[::-1])
    return rows[order], (3 * order[:, None] + turn[order]).reshape(-1)


# ---- what must have been added ------------------------------------------------------------------------------------


class Lightmapped:
    """A baked object: the entry in its custom properties and its lightmap UVs, one row a triangle, v downwards."""

    def __init__(self, name, entry, corners):
        self.name, self.entry = name, entry
        self.file, self.rect = entry.get("file"), entry.get("rect", [])
        sets = list(corners.uv_sets.values())
        number = entry.get("texCoord", -1)
        self.uv = sets[number][corners.triangles].astype(np.float64) if 0 <= number < len(sets) else None
        if self.uv is not None:
            self.uv[..., 1] = 1 - self.uv[..., 1]  # Blender counts v upwards, glTF and the rectangle downwards


def lightmapped_objects(properties, meshes):
    found = []
    for name, corners in meshes.items():
        entry = properties.get(f"objects {name}", {}).get(ADDED_PROPERTY)
        if isinstance(entry, dict):
            found.append(Lightmapped(name, entry, corners))
    return found


def entry_problems(baked):
    if not baked:
        yield "no object carries a lightmap"
    for thing in baked:
        entry, rect = thing.entry, thing.rect
        if missing := [key for key in ("file", "texCoord", "rect", "store") if key not in entry]:
            yield f"{thing.name}: entry lacks {', '.join(missing)}"
        elif len(rect) != 4 or not (0 <= rect[0] < rect[2] <= 1 and 0 <= rect[1] < rect[3] <= 1):
            yield f"{thing.name}: rectangle {rect} is not inside the page"


def uv_problems(before, after, baked):
    """The lightmap set is there, inside the page and inside its rectangle; others got no new set."""
    lit = {thing.name: thing for thing in baked}
    for name in before.keys() & after.keys():
        had, has = len(before[name].uv_sets), len(after[name].uv_sets)
        if name not in lit:
            if has != had:
                yield f"{name}: not lightmapped, but {had} UV sets became {has}"
            continue
        uv = lit[name].uv
        if uv is None:
            yield f"{name}: no UV set {lit[name].entry.get('texCoord')}"
            continue
        if len(uv) and (uv.min() < 0 or uv.max() > 1 or not np.isfinite(uv).all()):
            yield f"{name}: lightmap UVs reach from {uv.min():.6g} to {uv.max():.6g}"
        low, high = np.array(lit[name].rect[:2]), np.array(lit[name].rect[2:])
        if len(uv) and low.size == high.size == 2 and (outside := np.maximum(low - uv, uv - high).max()) > 1e-5:
            yield f"{name}: lightmap UVs leave the rectangle by {outside:.3g}"


def overlap_problems(baked, page_sizes):
    for file, (width, height) in page_sizes.items():
        covered = np.zeros((height, width), np.uint16)
        owner = np.full((height, width), -1, np.int32)
        clashes = {}
        for number, thing in enumerate(baked):
            if thing.file != file or thing.uv is None:
                continue
            for corners in thing.uv * (width, height):
                rows, columns, inside = texels_inside(corners, width, height)
                if inside is None:
                    continue
                hit = covered[rows, columns][inside] > 0
                if hit.any():
                    pair = (thing.name, baked[owner[rows, columns][inside][hit][0]].name)
                    clashes[pair] = clashes.get(pair, 0) + int(hit.sum())
                covered[rows, columns] += inside
                owner[rows, columns][inside] = number
        for (one, other), count in clashes.items():
            yield f"{file}: {count} texels are claimed twice, by {one} and {other}"


def texels_inside(corners, width, height):
    """The texels whose centre lies inside a triangle (by more than a thousandth of a texel), within its bounds."""
    low = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, (width, height))
    high = np.clip(np.ceil(corners.max(axis=0)).astype(int), 0, (width, height))
    edges = np.roll(corners, -1, axis=0) - corners
    area = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    if (high <= low).any() or area == 0 or lengths.min() == 0:
        return slice(0), slice(0), None
    x, y = np.arange(low[0], high[0]) + 0.5, (np.arange(low[1], high[1]) + 0.5)[:, None]
    inside = np.ones((high[1] - low[1], high[0] - low[0]), bool)
    for corner, edge, length in zip(corners, edges * np.sign(area), lengths):
        inside &= (edge[0] * (y - corner[1]) - edge[1] * (x - corner[0])) / length > 1e-3
    return slice(low[1], high[1]), slice(low[0], high[0]), inside


def open_pages(baked, folder):
    """Every EXR that an entry names, read by Blender: pixels [rows from the top, columns, RGB], or why it cannot."""
    pages = {}
    for file in sorted({thing.file for thing in baked if thing.file}):
        path = folder / urllib.parse.unquote(file)
        try:
            image = bpy.data.images.load(str(path), check_existing=False)
            pixels = np.empty(len(image.pixels), np.float32)
            image.pixels.foreach_get(pixels)
            width, height = image.size
            pages[file] = (
                pixels.reshape(height, width, -1)[::-1, :, :3] if width and height else "Blender finds no pixels in it"
            )
        except RuntimeError as problem:
            pages[file] = str(problem).strip()
    return pages


def page_problems(pages, folder):
    for file, pixels in pages.items():
        if isinstance(pixels, str):
            yield f"{file}: {pixels}"
            continue
        if not np.isfinite(pixels).all():
            yield f"{file}: {int((~np.isfinite(pixels)).sum())} values are not finite"
        elif pixels.min() < 0:
            yield f"{file}: the smallest value is {pixels.min():.3g}"
        stored = read_exr(folder / urllib.parse.unquote(file))
        if stored is not None and not np.array_equal(stored, pixels, equal_nan=True):
            yield f"{file}: Blender does not see the stored numbers"


def read_exr(path):
    """The numbers as the OpenEXR library reads them; None where its Python module is not installed."""
    try:
        import OpenEXR
    except ImportError:
        return None
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[name].pixels.astype(np.float32) for name in "RGB"], axis=-1)


def material_problems(document):
    """In the JSON: the materials of every lightmapped node lead to the same file and UV set as the node's own entry."""
    for node in document.get("nodes", []):
        entry = node["extras"].get(ADDED_PROPERTY) if isinstance(node.get("extras"), dict) else None
        if entry is None:
            continue
        for primitive in document["meshes"][node["mesh"]]["primitives"]:
            made = document["materials"][primitive["material"]] if "material" in primitive else {}
            where = f"{node.get('name', 'a node without name')}: material {made.get('name')}"
            link = made.get("extensions", {}).get("MOZ_lightmap")
            if f"TEXCOORD_{entry.get('texCoord')}" not in primitive["attributes"]:
                continue  # a primitive of the same mesh that takes no lightmap, such as lines
            if link is None:
                yield f"{where} has no MOZ_lightmap"
                continue
            texture = document["textures"][link["index"]]
            source = texture.get("extensions", {}).get("EXT_texture_exr", {}).get("source")
            image = document["images"][source] if source is not None else {}
            if link.get("texCoord") != entry.get("texCoord"):
                yield f"{where} uses UV set {link.get('texCoord')}, the node says {entry.get('texCoord')}"
            if "bufferView" not in image and image.get("uri") != entry.get("file"):
                yield f"{where} leads to {image.get('uri')}, the node says {entry.get('file')}"
            if "source" not in texture:
                yield f"{where} leads to a texture without a fallback image"
    if {"MOZ_lightmap", "EXT_texture_exr"} & set(document.get("extensionsRequired", [])):
        yield "the lightmap must not be a required extension"


def read_document(path):
    raw = path.read_bytes()
    if raw[:4] == b"glTF":
        (length,) = struct.unpack_from("<I", raw, 12)
        raw = raw[20 : 20 + length]
    return json.loads(raw)


# ---- the command --------------------------------------------------------------------------------------------------


def compare(original, baked_path):
    """All checks of one pair: name -> problems."""
    before = snapshot.load(original)
    meshes_before = snapshot.mesh_corners()
    after = snapshot.load(baked_path)
    meshes_after = snapshot.mesh_corners()

    checks = {}
    for section in before:
        clean = without_added if section == "custom properties" else dict
        checks[section] = list(block_differences(clean(before[section]), clean(after[section])))
    checks["meshes"] = list(mesh_differences(meshes_before, meshes_after))

    baked = lightmapped_objects(after["custom properties"], meshes_after)
    pages = open_pages(baked, baked_path.parent)
    sizes = {file: pixels.shape[1::-1] for file, pixels in pages.items() if not isinstance(pixels, str)}
    checks["lightmap entries"] = list(entry_problems(baked))
    checks["lightmap UVs"] = list(uv_problems(meshes_before, meshes_after, baked))
    checks["no texel twice"] = list(overlap_problems(baked, sizes))
    checks["lightmap materials"] = list(material_problems(read_document(baked_path)))
    checks["EXR pages"] = list(page_problems(pages, baked_path.parent))
    facts = {
        "objects": len(before["transforms"]),
        "meshes": len(meshes_before),
        "lightmapped": len(baked),
        "pages": len(pages),
    }
    return checks, facts


def print_scene(name, checks, facts):
    verdict = "FAIL" if any(checks.values()) else "ok"
    print(f"{verdict:<5} {name}: " + ", ".join(f"{count} {what}" for what, count in facts.items()))
    for check, problems in checks.items():
        if problems:
            print(f"      {check}: {len(problems)} problems")
            for line in sorted(problems)[:8]:
                print(f"        {line}")


def main():
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    ask = argparse.ArgumentParser(description="Checks in Blender that a bake lost nothing and added its lightmap.")
    ask.add_argument("files", nargs="+", type=Path, metavar="FILE", help="pairs: ORIGINAL BAKED [ORIGINAL BAKED ...]")
    ask.add_argument("--report", type=Path, help="also write the findings as JSON")
    options = ask.parse_args(own)
    if len(options.files) % 2:
        ask.error("files come in pairs: ORIGINAL BAKED")
    for file in options.files:
        if not file.is_file():
            ask.error(f"there is no file {file}")

    results, failed = [], 0
    for original, baked in zip(options.files[::2], options.files[1::2], strict=True):
        checks, facts = compare(original.resolve(), baked.resolve())
        print_scene(baked.name, checks, facts)
        failed += any(checks.values())
        results.append({"original": original.name, "baked": baked.name, **facts, "problems": checks})
    print(f"\n{'check':<24}scenes without a problem")
    for check in results[0]["problems"]:
        print(f"{check:<24}{sum(not scene['problems'][check] for scene in results)} of {len(results)}")
    print(f"round trip: {len(results) - failed} passed, {failed} failed", flush=True)
    if options.report:
        options.report.write_text(
            json.dumps(
                {"passed": len(results) - failed, "failed": failed, "scenes": results}, indent=2, ensure_ascii=False
            )
            + "\n",
            encoding="utf-8",
        )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
