"""What a bake must have added, checked with Blender's eyes: entries, coordinates, gutters, pages, materials."""

import json
import struct
import urllib.parse

import bpy
import numpy as np

from roundtrip_checks import ADDED_PROPERTY


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


def texels_inside(corners, width, height, margin=1e-3):
    """The texels whose centre lies inside a triangle by more than the margin (texels), within its bounds."""
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
        inside &= (edge[0] * (y - corner[1]) - edge[1] * (x - corner[0])) / length > margin
    return slice(low[1], high[1]), slice(low[0], high[0]), inside


def gutter_problems(baked, page_sizes):
    """No texel is read by bilinear lookups of two charts: light would bleed from one into the other."""
    for file, (width, height) in page_sizes.items():
        reader = np.full((height, width), -1, np.int64)
        clashes, first = {}, 0
        owners = []
        for thing in baked:
            if thing.file != file or thing.uv is None:
                continue
            charts = charts_of(thing.uv)
            owners += [thing.name] * (int(charts.max(initial=-1)) + 1)
            for corners, chart in zip(thing.uv * (width, height), charts + first):
                rows, columns, near = texels_read(corners, width, height)
                if near is None:
                    continue
                there = reader[rows, columns]
                clash = near & (there >= 0) & (there != chart)
                if clash.any():
                    pair = (thing.name, owners[there[clash][0]])
                    clashes[pair] = clashes.get(pair, 0) + int(clash.sum())
                there[near] = chart
            first = len(owners)
        for (one, other), count in clashes.items():
            yield f"{file}: {count} texels are read by charts of {one} and {other}"


def charts_of(uv):
    """Which triangles hang together on the page: [triangles, corners, 2] -> a number each, from 0."""
    points = np.unique(uv.reshape(-1, 2), axis=0, return_inverse=True)[1].reshape(-1, 3)
    label = np.arange(points.max(initial=-1) + 1)
    while True:
        least = label[points].min(axis=1)
        new = label.copy()
        for corner in range(3):
            np.minimum.at(new, points[:, corner], least)
        new = new[new]
        if np.array_equal(new, label):
            return np.unique(label[points[:, 0]], return_inverse=True)[1].reshape(-1)
        label = new


def texels_read(corners, width, height):
    """Texels whose centre is less than a texel (less a hundredth, for rounding) from the triangle along both axes."""
    reach = 0.99
    edges = np.roll(corners, -1, axis=0) - corners
    if edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0] == 0:
        return slice(0), slice(0), None
    low = np.clip(np.floor(corners.min(axis=0)).astype(int) - 1, 0, (width, height))
    high = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, (width, height))
    x, y = np.arange(low[0], high[0]) + 0.5, (np.arange(low[1], high[1]) + 0.5)[:, None]
    near = (np.maximum(corners[:, 0].min() - x, x - corners[:, 0].max()) < reach) & (
        np.maximum(corners[:, 1].min() - y, y - corners[:, 1].max()) < reach
    )
    for axis in np.stack([-edges[:, 1], edges[:, 0]], axis=1):
        along, own = corners @ axis, reach * np.abs(axis).sum()
        centre = axis[0] * x + axis[1] * y
        near = near & (centre - own < along.max()) & (centre + own > along.min())
    return slice(low[1], high[1]), slice(low[0], high[0]), near


def owners_of(baked, page_sizes):
    """For each page the object at each texel centre, -1 where there is none."""
    owners = {}
    for file, (width, height) in page_sizes.items():
        owner = np.full((height, width), -1, np.int64)
        for number, thing in enumerate(baked):
            for corners in thing.uv * (width, height) if thing.file == file and thing.uv is not None else ():
                # A centre on the edge between two triangles belongs to both.
                rows, columns, inside = texels_inside(corners, width, height, -1e-3)
                if inside is not None:
                    owner[rows, columns][inside] = number
        owners[file] = owner
    return owners


def open_pages(baked, folder):
    """Every EXR that an entry names, read by Blender: pixels [rows from the top, columns, RGB], or why it cannot."""
    pages = {}
    for file in sorted({thing.file for thing in baked if thing.file}):
        path = folder / file
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
        stored = read_exr(folder / file)
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
            if "bufferView" not in image and urllib.parse.unquote(image.get("uri", "")) != entry.get("file"):
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
