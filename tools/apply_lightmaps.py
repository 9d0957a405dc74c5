#!/usr/bin/env python3
"""Shows a baked glTF lit by its lightmaps in Blender: no lamps, no light transport, in Cycles and in EEVEE.

usage: apply_lightmaps.py BAKED.glb OUT.blend
       (Python with the bpy package; or: blender -b -P tools/apply_lightmaps.py -- BAKED.glb OUT.blend)

Every lightmapped surface becomes an emission of base colour × lightmap, plus its own emission; what was transparent
stays so. Lamps are switched off, not removed. As a module: `apply(folder)` does it to the objects that are open.
"""

import argparse
import json
import math
import struct
import sys
import tempfile
import urllib.parse
from pathlib import Path

import bpy
import numpy as np

# What turns a stored value into the radiance of a white surface.
SCALE = {"irradiance-over-pi": 1.0, "irradiance": 1.0 / math.pi, "radiosity": 1.0 / math.pi}


def load(path):
    """Imports a baked file into an empty Blender and applies its lightmaps; returns how many objects have one."""
    path = Path(path).resolve()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.app.debug_value = 1  # the importer then reports warnings only
    bpy.ops.import_scene.gltf(filepath=str(path))
    return apply(path.parent, embedded_pages(path))


def apply(folder, embedded=None):
    """Lights every object that has a `lightmap` property; pages lie in `folder`, or in `embedded` by name. What has none,
    a character for one, is lit by the mean of all light."""
    images, materials, lit, light = {}, {}, 0, MeanLight()
    bare = []
    for thing in bpy.data.objects:
        entry = thing.get("lightmap")
        if thing.type != "MESH":
            continue
        if not hasattr(entry, "to_dict"):
            bare.append(thing)
            continue
        entry = entry.to_dict()
        file, layer = entry["file"], thing.data.uv_layers[entry["texCoord"]].name
        if file not in images:
            images[file] = load_page((embedded or {}).get(file) or Path(folder) / file)
        light.add(thing, images[file], layer, entry["store"])
        for slot in thing.material_slots:
            key = (slot.material, file, layer)
            if key not in materials:
                materials[key] = lit_material(slot.material, page_light(images[file], layer, entry["store"]))
            # On the object: meshes may be shared with objects of another page.
            slot.link = "OBJECT"
            slot.material = materials[key]
        lit += 1
    everywhere = light.mean()
    for slot in [slot for thing in bare for slot in thing.material_slots]:
        key = slot.material
        if key not in materials:
            materials[key] = lit_material(slot.material, even_light(everywhere))
        slot.link = "OBJECT"
        slot.material = materials[key]
    for thing in bpy.data.objects:
        if thing.type == "LIGHT":
            thing.hide_render = thing.hide_viewport = True
    return lit


def load_page(path):
    image = bpy.data.images.load(str(path), check_existing=True)
    image.colorspace_settings.name = "Linear Rec.709"
    return image


class MeanLight:
    """The mean light of all lightmapped surfaces, weighted by area."""

    # Points along each side of a triangle.
    STEPS = 8

    def __init__(self):
        self.sum, self.area, self.pages = np.zeros(3), 0.0, {}

    def add(self, thing, image, layer, store):
        if store == "radiosity":
            return  # the surface's own colour is in it
        if image not in self.pages:
            pixels = np.empty(len(image.pixels), np.float32)
            image.pixels.foreach_get(pixels)
            self.pages[image] = pixels.reshape(image.size[1], image.size[0], -1)[:, :, :3] * SCALE[store]
        mesh = thing.data
        mesh.calc_loop_triangles()
        count = len(mesh.loop_triangles)
        loops, corners = np.empty(3 * count, np.int32), np.empty(3 * count, np.int32)
        mesh.loop_triangles.foreach_get("loops", loops)
        mesh.loop_triangles.foreach_get("vertices", corners)
        places, uv = np.empty(3 * len(mesh.vertices), np.float32), np.empty(2 * len(mesh.loops), np.float32)
        mesh.vertices.foreach_get("co", places)
        mesh.uv_layers[layer].data.foreach_get("uv", uv)
        turn = np.array(thing.matrix_world)[:3, :3]
        a, b, c = np.moveaxis((places.reshape(-1, 3) @ turn.T)[corners.reshape(-1, 3)], 1, 0)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        u, v, w = np.moveaxis(uv.reshape(-1, 2)[loops.reshape(-1, 3)], 1, 0)
        # The middles of equal small triangles.
        n = self.STEPS
        grid = [(i + k / 3, j + k / 3) for i in range(n) for j in range(n - i) for k in ((1, 2) if i + j + 1 < n else (1,))]
        for s, t in np.array(grid) / n:
            self.sum += areas @ self.read(image, u + (v - u) * s + (w - u) * t) / len(grid)
        self.area += areas.sum()

    def read(self, image, uv):
        """Bilinear, as the texture is shown."""
        page = self.pages[image]
        size = np.array(page.shape[1::-1])
        at = uv * size - 0.5
        low = np.floor(at).astype(int)
        fx, fy = (at - low).T[..., None]
        (x0, y0), (x1, y1) = (np.clip(low + step, 0, size - 1).T for step in (0, 1))
        return (page[y0, x0] * (1 - fx) + page[y0, x1] * fx) * (1 - fy) + (page[y1, x0] * (1 - fx) + page[y1, x1] * fx) * fy

    def mean(self):
        return list(self.sum / self.area) if self.area else [0.0] * 3


def page_light(image, layer, store):
    """Nodes that give the radiance of a white surface, or with its own colour in it."""

    def build(nodes, links):
        uv = nodes.new("ShaderNodeUVMap")
        uv.uv_map = layer
        texture = nodes.new("ShaderNodeTexImage")
        texture.image, texture.interpolation, texture.extension = image, "Linear", "EXTEND"
        links.new(uv.outputs["UV"], texture.inputs["Vector"])
        light = texture.outputs["Color"]
        if SCALE[store] != 1.0:
            light = vector(nodes, links, "MULTIPLY", light, [SCALE[store]] * 3)
        # Radiosity has colour and emission in it already.
        return light, store == "radiosity"

    return build


def even_light(radiance):
    """Nodes that give the same light everywhere."""

    def build(nodes, links):
        return vector(nodes, links, "ADD", radiance, [0.0] * 3), False

    return build


def vector(nodes, links, operation, *inputs):
    node = nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    for socket, value in zip(node.inputs, inputs):
        feed(links, socket, value)
    return node.outputs["Vector"]


def lit_material(original, light_from):
    """A copy of a material that shines with the light that `light_from` builds."""
    made = original.copy() if original else bpy.data.materials.new("lit")
    made.name = f"{original.name if original else 'none'} lit"
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    output = next((node for node in nodes if node.type == "OUTPUT_MATERIAL" and node.is_active_output), None)
    output = output or nodes.new("ShaderNodeOutputMaterial")
    bsdf = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
    if bsdf is None:
        return made  # an unlit material shines by itself

    light, coloured = light_from(nodes, links)
    if not coloured:
        not_metal = nodes.new("ShaderNodeMath")
        not_metal.operation = "SUBTRACT"
        not_metal.inputs[0].default_value = 1.0
        feed(links, not_metal.inputs[1], value_of(bsdf.inputs["Metallic"]))
        reflectance = vector(nodes, links, "MULTIPLY", value_of(bsdf.inputs["Base Color"]), not_metal.outputs[0])
        own = vector(nodes, links, "MULTIPLY", value_of(bsdf.inputs["Emission Color"]), value_of(bsdf.inputs["Emission Strength"]))
        light = vector(nodes, links, "ADD", vector(nodes, links, "MULTIPLY", reflectance, light), own)
    emission = nodes.new("ShaderNodeEmission")
    links.new(light, emission.inputs["Color"])

    shader, alpha = emission.outputs[0], bsdf.inputs["Alpha"]
    if alpha.is_linked or alpha.default_value < 1:
        clear, mix = nodes.new("ShaderNodeBsdfTransparent"), nodes.new("ShaderNodeMixShader")
        feed(links, mix.inputs[0], value_of(alpha))
        links.new(clear.outputs[0], mix.inputs[1])
        links.new(shader, mix.inputs[2])
        shader = mix.outputs[0]
    links.new(shader, output.inputs["Surface"])
    return made


def value_of(socket):
    """What feeds a socket: another node's output, or the numbers in it."""
    if socket.is_linked:
        return socket.links[0].from_socket
    value = socket.default_value
    return list(value)[:3] if hasattr(value, "__len__") else value


def feed(links, socket, value):
    if hasattr(value, "is_output"):
        links.new(value, socket)
    elif hasattr(socket.default_value, "__len__"):
        socket.default_value = value if hasattr(value, "__len__") else [value] * len(socket.default_value)
    else:
        socket.default_value = value


def embedded_pages(path):
    """EXRs inside a GLB, written to temporary files: name -> file. Blender would read them as sRGB."""
    raw = path.read_bytes()
    if raw[:4] != b"glTF":
        return {}
    (length,) = struct.unpack_from("<I", raw, 12)
    document, start = json.loads(raw[20 : 20 + length]), 20 + length + 8
    pages = {}
    for image in document.get("images", []):
        if image.get("mimeType") != "image/x-exr" or "bufferView" not in image:
            continue
        view = document["bufferViews"][image["bufferView"]]
        first = start + view.get("byteOffset", 0)
        name = urllib.parse.unquote(image["name"]) + ".exr"
        file = Path(tempfile.mkdtemp(prefix="lightmaps-")) / name
        file.write_bytes(raw[first : first + view["byteLength"]])
        pages[name] = file
    return pages


def main():
    if bpy.app.version < (4, 0):
        sys.exit(f"this needs Blender 4.0 or newer, not {bpy.app.version_string}")
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    ask = argparse.ArgumentParser(description="Shows a baked glTF lit by its lightmaps in Blender.")
    ask.add_argument("baked", type=Path, metavar="BAKED.glb")
    ask.add_argument("out", type=Path, metavar="OUT.blend")
    options = ask.parse_args(given)
    lit = load(options.baked)
    if not lit:
        sys.exit(f"{options.baked}: no object has a lightmap")
    bpy.ops.file.pack_all()
    bpy.ops.wm.save_as_mainfile(filepath=str(options.out.resolve()))
    print(f"{lit} objects lit")


if __name__ == "__main__":
    main()
