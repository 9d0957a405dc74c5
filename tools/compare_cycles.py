"""Puts Cycles, and Cycles with OpenImageDenoise, into lightkiln's study of accuracy: same scene, same texture space, same reference.

    python tools/compare_cycles.py SCENE.glb --out DIR [--page-size 512] [--samples 4,16,64] [--sky R,G,B] [--points FILE.npz]

Runs `lightkiln study accuracy`, which leaves its reference in DIR as reference.glb; bakes the same lightmap coordinates with Cycles;
compares both at the same random points of the surfaces; writes cycles.csv, with the columns of accuracy.csv; and runs the study again with
`--beside cycles.csv`, so that everything stands in one table and one plot, DIR/accuracy.html. `--no-study` does the middle alone, in a
folder that has a reference.

The light is the scene's own, custom properties included: sizes of lamps and suns, area lamps, the sky, unless `--sky` says another.

Cycles bakes without a margin, which would run over the neighbours in lightkiln's gutters of two texels; what it leaves is then filled from
the chart beside. Points inside of other objects, and those whose lookup takes in a texel that is partly inside of one, are left out: there
Cycles bakes the dark of the inside, lightkiln what is around, and neither is wrong. "contacts too" tells of all points that can be seen.

With `--points FILE.npz` (arrays p: positions, E: irradiance, and g: normals; metres and W/m² in glTF's axes), an independent reference
such as Mitsuba's judges as well: rows for the study's own reference and for Cycles say "by FILE". Lightmaps of finite texels err at contacts
and shadow borders, whatever their effort: the row of the reference shows how much.

Seconds are those of all stages from plan to gather for lightkiln, of the bake operator alone for Cycles: neither reads nor writes files.

Needs bpy (tools/requirements.txt).
"""

import argparse
import csv
import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

sys.path.insert(0, str(Path(__file__).resolve().parent))

import scene_light

POINTS = 20_000
# Places of a texel, along each side, that are asked whether they are inside of something.
SUBTEXELS = 3
# No light: what stays in texels that are not baked.
UNTOUCHED = -1.0
RAW, DENOISED = "Cycles", "Cycles + OpenImageDenoise"
COLUMNS = ["sweep", "setting", "seconds", "rms", "median", "95th percentile", "largest", "bias"]


def main():
    wanted = arguments()
    beside = wanted.out / "cycles.csv"
    if wanted.study:
        study(wanted)
    reference = wanted.out / "reference.glb"
    scene = Imported(reference, wanted.scene.parent, wanted.sky)
    truth_map = lightmap_of(reference) * np.pi
    inside = scene.inside_map(truth_map.shape[0])
    judges, rows = [], []
    for seen, name in parts_of(scene, scene.random_points(POINTS), inside):
        judges.append((name, seen, scene.ask(truth_map, seen)))
    if wanted.points:
        for others, name in parts_of(scene, scene.points_at(*load_points(wanted.points)), inside):
            name = f", by {wanted.points.stem}{name}"
            judges.append((name, others, others["irradiance"]))
            rows.append(result(f"lightkiln's reference{name}", "", None, scene.ask(truth_map, others), others["irradiance"]))
    for samples in wanted.samples:
        pixels, seconds = scene.bake(samples, truth_map.shape[0])
        clean, more = denoise(pixels)
        for who, took, found in [(RAW, seconds, pixels), (DENOISED, seconds + more, clean)]:
            for name, at, truth in judges:
                rows.append(result(who + name, f"{samples} samples", took, scene.ask(found * np.pi, at), truth))
    report(rows, beside)
    if wanted.study:
        study(wanted, "--beside", beside)


def parts_of(scene, points, inside):
    """The points whose lookups take in nothing that is inside of another object, and all that can be seen."""
    outside = ~scene.are_inside(points)
    seen = {key: held[outside] for key, held in points.items()}
    alone = scene.ask(inside, seen)[:, 0] == 0
    clear = {key: held[alone] for key, held in seen.items()}
    count = len(points["uv"])
    print(f"of {count:,} points {count - len(seen['uv']):,} are inside of something, {len(seen['uv']) - len(clear['uv']):,} at contacts")
    return [(clear, ""), (seen, ", contacts too")] if len(clear["uv"]) < len(seen["uv"]) else [(clear, "")]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--page-size", type=int, default=512)
    parser.add_argument("--samples", type=lambda s: [int(n) for n in s.split(",")], default=[4, 16, 64])
    parser.add_argument("--sky", help="R,G,B[,STRENGTH] or FILE[,STRENGTH], given to both [default: the scene's own]")
    parser.add_argument("--points", type=Path)
    parser.add_argument("--no-study", dest="study", action="store_false")
    parser.add_argument("--lightkiln", default="target/release/lightkiln")
    return parser.parse_args()


def study(wanted, *more):
    """The study; a reference that does not agree with itself is told by it, and is no reason to stop."""
    command = [wanted.lightkiln, "study", "accuracy", wanted.scene, "--out", wanted.out, "--page-size", wanted.page_size, "--max-pages", 1, *more]
    if wanted.sky:
        command += ["--sky", wanted.sky]
    ended = subprocess.run([str(word) for word in command])
    if ended.returncode not in (0, 1) or not (wanted.out / "reference.glb").exists():
        raise SystemExit(f"the study ended with code {ended.returncode}")


def read_exr(path):
    """[rows from the top, columns, 3]"""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.parts[0].channels
        return np.stack([channels[name].pixels.astype(np.float64) for name in "RGB"], axis=-1)


def lightmap_of(baked):
    """E/π"""
    maps = sorted(baked.parent.glob(f"{baked.stem}.lightmap*.exr"))
    if len(maps) != 1:
        raise SystemExit(f"{baked} has {len(maps)} lightmaps, one is needed: raise --page-size")
    return read_exr(maps[0])


def load_points(path):
    file = np.load(path)
    return file["p"], file["E"], file["g"] if "g" in file else None


class Imported:
    """The baked scene in Blender: its own light, no specular lobes."""

    def __init__(self, baked, folder, sky):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.import_scene.gltf(filepath=str(baked))
        self.lit = [thing for thing in bpy.data.objects if thing.type == "MESH" and "lightmap" in thing]
        if not self.lit:
            raise SystemExit(f"{baked} has no object with a lightmap")
        scene_light.light_from_properties(folder, sky)
        for thing in self.lit:
            if thing.data.users > 1:
                thing.data = thing.data.copy()
            thing.data.uv_layers.active_index = self.set_of(thing)
        for material in bpy.data.materials:
            make_matte(material)
        self.triangles()

    @staticmethod
    def set_of(thing):
        return thing["lightmap"].to_dict()["texCoord"]

    def triangles(self):
        corners, uvs = [], []
        for thing in self.lit:
            mesh, turn = thing.data, thing.matrix_world
            mesh.calc_loop_triangles()
            layer = mesh.uv_layers[self.set_of(thing)].uv
            for triangle in mesh.loop_triangles:
                corners.append([turn @ mesh.vertices[v].co for v in triangle.vertices])
                uvs.append([layer[loop].vector[:] for loop in triangle.loops])
        self.corners = np.array(corners, dtype=np.float64)
        self.uv = np.array(uvs, dtype=np.float64)
        a, b, c = self.corners.transpose(1, 0, 2)
        self.normals = np.cross(b - a, c - a)
        self.areas = np.linalg.norm(self.normals, axis=1) / 2
        self.normals /= np.maximum(2 * self.areas, 1e-300)[:, None]
        flat = self.corners.reshape(-1, 3)
        self.size = np.ptp(flat, axis=0).max()
        self.tree = BVHTree.FromPolygons(flat.tolist(), np.arange(len(flat)).reshape(-1, 3).tolist(), all_triangles=True)
        self.numbers = np.random.default_rng(1)

    def random_points(self, count):
        which = self.numbers.choice(len(self.areas), size=count, p=self.areas / self.areas.sum())
        s, t = np.sqrt(self.numbers.random(count)), self.numbers.random(count)
        weights = np.stack([1 - s, s * (1 - t), s * t], axis=1)
        return {key: np.einsum("nk,nkd->nd", weights, held[which]) for key, held in (("uv", self.uv), ("at", self.corners))} | {"triangle": which}

    def points_at(self, positions, irradiance, normals):
        """Points of glTF's axes on the surfaces under them."""
        reach = 1e-3 * self.size
        found, kept = {"uv": [], "at": [], "triangle": []}, []
        for k, (x, y, z) in enumerate(positions):
            at = Vector((x, -z, y))
            if normals is not None:
                out = Vector((normals[k][0], -normals[k][2], normals[k][1]))
                _, _, index, _ = self.tree.ray_cast(at + out * reach, -out, 2 * reach)
            else:
                _, _, index, _ = self.tree.find_nearest(at, reach)
            if index is None:
                continue
            a, b, c = self.corners[index]
            weights, *_ = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), np.array(at) - a, rcond=None)
            found["uv"].append(self.uv[index][0] + weights @ (self.uv[index][1:] - self.uv[index][0]))
            found["at"].append(np.array(at))
            found["triangle"].append(index)
            kept.append(k)
        if not kept:
            raise SystemExit("none of the points lies on the scene's surfaces: they are of another scene, or in other axes")
        return {key: np.array(held) for key, held in found.items()} | {"irradiance": irradiance[kept]}

    def is_inside(self, at, triangle):
        """Whether a point on a front is inside of something: what it sees shows its back."""
        normal = self.normals[triangle]
        start = Vector(at + 1e-5 * self.size * normal)

        def back(way):
            _, _, index, _ = self.tree.ray_cast(start, Vector(way))
            return index is not None and self.normals[index] @ way > 0

        if not back(normal):
            return False
        ways = self.numbers.normal(size=(8, 3))
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True) + normal
        return sum(map(back, ways)) > len(ways) / 2

    def are_inside(self, points):
        return np.array([self.is_inside(at, triangle) for at, triangle in zip(points["at"], points["triangle"])])

    def inside_map(self, size):
        """1 in texels that are inside of other objects somewhere, by SUBTEXELS² places of each."""
        inside = np.zeros((size, size, 1))
        for triangle, (corners, uv) in enumerate(zip(self.corners, self.uv)):
            outline = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1) * size
            frame = (outline[1:] - outline[0]).T
            if abs(np.linalg.det(frame)) < 1e-9:
                continue
            low, high = (np.floor(outline.min(axis=0)) * SUBTEXELS, np.ceil(outline.max(axis=0)) * SUBTEXELS)
            grid = np.stack(np.meshgrid(*(np.arange(low[k], high[k]) for k in (0, 1))), axis=-1).reshape(-1, 2)
            places = (grid + 0.5) / SUBTEXELS
            weights = np.linalg.solve(frame, (places - outline[0]).T).T
            on = (weights >= 0).all(axis=1) & (weights.sum(axis=1) <= 1)
            columns, rows = np.clip(places[on].astype(int), 0, size - 1).T
            for row, column, at in zip(rows, columns, corners[0] + weights[on] @ (corners[1:] - corners[0])):
                if not inside[row, column] and self.is_inside(at, triangle):
                    inside[row, column] = 1
        return inside

    @staticmethod
    def ask(pixels, points):
        """Bilinear values; Blender's v runs up, rows run down."""
        height, width = pixels.shape[:2]
        x, y = points["uv"][:, 0] * width - 0.5, (1 - points["uv"][:, 1]) * height - 0.5
        left, top = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = (x - left)[:, None], (y - top)[:, None]
        at = lambda row, column: pixels[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
        upper = at(top, left) * (1 - fx) + at(top, left + 1) * fx
        lower = at(top + 1, left) * (1 - fx) + at(top + 1, left + 1) * fx
        return upper * (1 - fy) + lower * fy

    def bake(self, samples, size):
        """E/π after so many samples a texel, and the seconds that took."""
        image = bpy.data.images.new("bake", size, size, float_buffer=True, is_data=True)
        image.pixels.foreach_set(np.full(len(image.pixels), UNTOUCHED, np.float32))
        for material in {slot.material for thing in self.lit for slot in thing.material_slots if slot.material}:
            nodes = material.node_tree.nodes
            target = nodes.get("bake target") or nodes.new("ShaderNodeTexImage")
            target.name, target.image = "bake target", image
            nodes.active = target
            for node in nodes:
                node.select = node == target
        scene = bpy.context.scene
        scene.render.engine = "CYCLES"
        settings = scene.cycles
        settings.samples, settings.use_adaptive_sampling, settings.use_denoising = samples, False, False
        settings.max_bounces = settings.diffuse_bounces = 32
        settings.sample_clamp_direct = settings.sample_clamp_indirect = 0
        for thing in bpy.data.objects:
            thing.select_set(thing in self.lit)
        bpy.context.view_layer.objects.active = self.lit[0]
        started = time.perf_counter()
        bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, margin=0, use_clear=False)
        seconds = time.perf_counter() - started
        pixels = filled(pixels_of(image))
        bpy.data.images.remove(image)
        return pixels, seconds


def filled(pixels):
    """What was not baked, from the texels beside, ring by ring; far from all charts it is black."""
    for _ in range(4):
        known = np.pad((pixels[..., 0] != UNTOUCHED).astype(float), 1)
        held = np.pad(np.where(pixels != UNTOUCHED, pixels, 0), ((1, 1), (1, 1), (0, 0)))
        height, width = pixels.shape[:2]
        around = [(dy, dx) for dy in (0, 1, 2) for dx in (0, 1, 2)]
        count = sum(known[dy : dy + height, dx : dx + width] for dy, dx in around)
        total = sum(held[dy : dy + height, dx : dx + width] for dy, dx in around)
        new = (pixels[..., 0] == UNTOUCHED) & (count > 0)
        pixels = np.where(new[..., None], total / np.maximum(count, 1)[..., None], pixels)
    return np.where(pixels == UNTOUCHED, 0, pixels)


def make_matte(material):
    """Diffuse only; single-sided surfaces emit to their front alone, as glTF has it."""
    if not material.node_tree:
        return
    tree = material.node_tree
    for node in [node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"]:
        for link in list(node.inputs["Roughness"].links):
            tree.links.remove(link)
        node.inputs["Specular IOR Level"].default_value = 0
        node.inputs["Roughness"].default_value = 1
        strength = node.inputs["Emission Strength"]
        if material.use_backface_culling and strength.default_value > 0 and not strength.is_linked:
            facing, front, gate = (tree.nodes.new(kind) for kind in ("ShaderNodeNewGeometry", "ShaderNodeMath", "ShaderNodeMath"))
            front.operation, front.inputs[0].default_value = "SUBTRACT", 1
            gate.operation, gate.inputs[0].default_value = "MULTIPLY", strength.default_value
            tree.links.new(facing.outputs["Backfacing"], front.inputs[1])
            tree.links.new(front.outputs[0], gate.inputs[1])
            tree.links.new(gate.outputs[0], strength)


def pixels_of(image):
    width, height = image.size
    flat = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(height, width, -1)[::-1, :, :3].astype(np.float64)


def denoise(pixels):
    """OpenImageDenoise as Blender's compositor has it; seconds of the second of two runs, the first one loads it."""
    height, width = pixels.shape[:2]
    scene = bpy.data.scenes.new("denoise")
    image = bpy.data.images.new("noisy", width, height, alpha=True, float_buffer=True, is_data=True)
    flat = np.ones((height, width, 4), np.float32)
    flat[:, :, :3] = pixels[::-1]
    image.pixels.foreach_set(flat.ravel())
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    source, filter_, sink = (tree.nodes.new(f"CompositorNode{kind}") for kind in ("Image", "Denoise", "OutputFile"))
    source.image, filter_.use_hdr = image, True
    folder = Path(bpy.app.tempdir)
    sink.base_path, sink.format.file_format = str(folder), "OPEN_EXR"
    sink.format.color_depth, sink.file_slots[0].path = "32", "clean"
    tree.links.new(source.outputs[0], filter_.inputs[0])
    tree.links.new(filter_.outputs[0], sink.inputs[0])
    scene.camera = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    scene.collection.objects.link(scene.camera)
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.view_settings.view_transform = "Raw"
    for _ in range(2):
        started = time.perf_counter()
        bpy.ops.render.render(scene=scene.name)
        seconds = time.perf_counter() - started
    clean = read_exr(next(folder.glob("clean*.exr")))
    bpy.data.scenes.remove(scene)
    bpy.data.images.remove(image)
    return clean, seconds


def result(who, effort, seconds, found, truth):
    """Errors as shares of the mean of the truth, as the study has them."""
    good = np.isfinite(found).all(axis=1) & np.isfinite(truth).all(axis=1)
    found, truth = found[good], truth[good]
    error = np.abs(found - truth).mean(axis=1) / truth.mean()
    bias = (found - truth).mean() / truth.mean()
    errors = [np.sqrt((error**2).mean()), np.median(error), np.quantile(error, 0.95), error.max(), bias]
    return dict(zip(COLUMNS, [who, effort, "" if seconds is None else round(seconds, 3), *map(float, errors)]))


def report(rows, path):
    width = max(len(row["sweep"]) for row in rows)
    for row in rows:
        errors = "  ".join(f"{key} {100 * row[key]:6.2f} %" for key in COLUMNS[3:])
        seconds = f"{row['seconds']:8.2f} s" if row["seconds"] != "" else " " * 10
        print(f"{row['sweep']:{width}}  {row['setting']:12} {seconds}  {errors}")
    with open(path, "w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main()
