"""What a bake must not change, as Blender sees it: differences between two snapshots, as readable lines."""

import numpy as np

import blender_snapshot as snapshot

# What a bake adds: where its light is, to every node, and the list of its pages, to the scene.
ADDED_PROPERTY = "lightmap"
ADDED_TO_SCENE = "lightmaps"
DEFAULT = "default"
# Blender packs an imported normal into 16-bit cosines, in a frame that depends on the neighbours; near 1 a cosine that
# coarse is off by sqrt(2 / 32767) in the angle. A split vertex has other neighbours: its normal comes back different.
NORMAL_TOLERANCE = 1e-2


def unchanged(before, meshes_before, after, meshes_after):
    """All sections of two snapshots: section -> problems."""
    checks = {}
    accept_default(before, after, meshes_after)
    for section in before:
        clean = without_added if section == "custom properties" else dict
        checks[section] = list(block_differences(clean(before[section]), clean(after[section])))
    checks["meshes"] = list(mesh_differences(meshes_before, meshes_after))
    return checks


def accept_default(before, after, meshes_after):
    """A lightmap needs a material to hang on: primitives without one get glTF's default, written out under this name."""
    name = f"materials {DEFAULT}"
    if name in before["materials"]:
        return
    after["materials"].pop(name, None)
    after["custom properties"].pop(name, None)
    for corners in meshes_after.values():
        corners.material_of = [None if made == DEFAULT else made for made in corners.material_of]


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
