"""A glTF scene as Blender holds it, for `check_plan.py`: what shines, reflects and lets light through.

Everything comes from Blender's objects, materials and lamps after an import. The file itself is asked only for what the importer
leaves out: which node an object was made from, hidden nodes, and the range of lamps.
"""

import os
import re
import sys
from contextlib import contextmanager

import bpy
import numpy as np

from scene_light import own

FULL, CLEAR, HOLES, PARTIAL = "full", "clear", "holes", "partial"


class Recorder:
    """Hooks that Blender's importer offers to add-ons: they tell which node each object is made from, and keep the rest pose."""

    gltf, nodes, pixels = None, {}, {}

    def gather_import_node_after_hook(self, vnode, _node, thing, gltf):
        Recorder.gltf = gltf
        made_from = [vnode.mesh_node_idx, vnode.light_node_idx, vnode.parent if vnode.type == vnode.Inst else None]
        made_from += [index for index, other in gltf.vnodes.items() if other is vnode and isinstance(index, int)]
        Recorder.nodes[thing.name] = next((index for index in made_from if isinstance(index, int)), None)

    def gather_import_animations(self, animations, _options, _gltf):
        if animations:
            animations.clear()


def open_scene(path):
    """Imports a file into an empty Blender. What Blender cannot import is an exception."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sys.modules["io_scene_gltf2"].glTF2ImportUserExtension = Recorder
    Recorder.gltf, Recorder.nodes, Recorder.pixels = None, {}, {}
    bpy.app.debug_value = 1  # the importer then reports warnings only
    with silence():
        bpy.ops.import_scene.gltf(filepath=str(path))
    bpy.context.view_layer.update()
    return Scene()


@contextmanager
def silence():
    """What the importer and its libraries print comes again as an exception, or does not matter."""
    sys.stdout.flush()
    kept = os.dup(1), os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        for number, stream in enumerate(kept, 1):
            os.dup2(stream, number)
            os.close(stream)
        os.close(nowhere)


# ---- materials ----------------------------------------------------------------------------------------------------


class Product:
    """What a socket is fed with: constants, images and vertex colours that are multiplied."""

    def __init__(self, socket):
        self.constants, self.images, self.painted, self.cutoff = [], [], False, None
        if socket:
            self.collect(socket)

    def collect(self, socket, channel=None):
        if not socket.is_linked:
            value = socket.default_value
            self.constants.append(np.array(value[:3] if hasattr(value, "__len__") else [value] * 3, dtype=np.float64))
            return
        link = socket.links[0]
        node = link.from_node
        if node.type == "TEX_IMAGE":
            self.images.append((node.image, "alpha" if link.from_socket.name == "Alpha" else channel))
        elif node.type == "VERTEX_COLOR":
            self.painted = True
        elif node.type == "MIX" and node.blend_type == "MULTIPLY":
            self.collect(node.inputs[6])
            self.collect(node.inputs[7])
        elif node.type == "MATH" and node.operation == "MULTIPLY":
            self.collect(node.inputs[0])
            self.collect(node.inputs[1])
        elif node.type == "MATH" and node.operation == "SUBTRACT":  # 1 − (alpha < cutoff): how MASK is imported
            self.collect(node.inputs[1])
        elif node.type == "MATH" and node.operation == "LESS_THAN":
            self.cutoff = node.inputs[1].default_value
            self.collect(node.inputs[0])
        elif node.type == "SEPARATE_COLOR":
            self.collect(node.inputs[0], link.from_socket.name)
        else:
            raise ValueError(f"a node of type {node.type} feeds '{socket.name}': this check does not know it")

    def constant(self):
        return np.prod(self.constants, axis=0) if self.constants else np.ones(3)

    def is_black(self):
        """Whether it is 0 everywhere; of an image all counts."""
        return self.constant().max() <= 0 or any(pixels(image)[..., :3].max() <= 0 for image, _ in self.images if image)

    def is_grey(self):
        def grey(rows):
            return bool((rows[..., 0] == rows[..., 1]).all() and (rows[..., 1] == rows[..., 2]).all())

        return all(map(grey, self.constants)) and all(grey(pixels(image)) for image, _ in self.images if image)


def pixels(image):
    """[pixels, 4] as stored."""
    key = (image.name, image.filepath, *image.size)
    if key not in Recorder.pixels:
        flat = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(flat)
        Recorder.pixels[key] = flat.reshape(-1, image.channels) if len(flat) else np.ones((1, 4), np.float32)
    return Recorder.pixels[key]


class Look:
    """A material as light meets it."""

    def __init__(self, material):
        """Of a slot that may be empty: what has no material in the file is white, opaque and single-sided, as glTF has it."""
        self.name = material.name if material else "none"
        self.unlit, self.two_sided, self.blends, self.mode = False, False, False, "OPAQUE"
        self.base, self.alpha, self.emission = Product(None), None, Product(None)
        self.strength, self.metal, self.glass, self.may_be_glass = 0.0, 0.0, 0.0, False
        if material:
            self.read(material)

    def read(self, material):
        nodes = material.node_tree.nodes
        shader = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
        self.unlit = shader is None
        # The importer's own, for vertex colours without a material; Blender draws it from both sides.
        self.two_sided = not material.use_backface_culling and re.sub(r"\.\d+$", "", material.name) != "DefaultMaterial"
        self.blends = material.surface_render_method == "BLENDED"
        if shader is None:
            mixes = [
                node
                for node in nodes
                if node.type == "MIX_SHADER" and not any(link.from_node.type == "LIGHT_PATH" for link in node.inputs[0].links)
            ]
            self.alpha = Product(mixes[0].inputs[0]) if mixes else None
            self.base = Product(next(node for node in nodes if node.type == "EMISSION").inputs["Color"])
        else:
            self.alpha = Product(shader.inputs["Alpha"])
            self.base = Product(shader.inputs["Base Color"])
            self.emission = Product(shader.inputs["Emission Color"])
            self.strength = shader.inputs["Emission Strength"].default_value
            metal, glass = shader.inputs["Metallic"], shader.inputs["Transmission Weight"]
            self.metal = 0.0 if metal.is_linked else metal.default_value
            self.glass = 0.0 if glass.is_linked else glass.default_value
            self.may_be_glass = glass.is_linked or glass.default_value > 0
        masked = self.alpha and (self.alpha.cutoff is not None or not self.blends and self.alpha.constant().min() < 1)
        self.mode = "BLEND" if self.blends else "MASK" if masked else "OPAQUE"

    def opacity(self, painted):
        """How much it stops; None where that hangs on vertex colours."""
        if self.alpha is None or self.mode == "OPAQUE":
            return FULL
        ranges = [[float(pixels(image)[:, 3].min()), float(pixels(image)[:, 3].max())] for image, _ in self.alpha.images if image]
        low, high = np.prod([[1.0, 1.0], *ranges], axis=0) * self.alpha.constant()[0]
        if painted and self.alpha.painted:
            return None
        if self.mode == "MASK":
            cutoff = 0.5 if self.alpha.cutoff is None else self.alpha.cutoff
            return FULL if low >= cutoff else CLEAR if high < cutoff else HOLES
        return FULL if low >= 1 else PARTIAL


# ---- objects ------------------------------------------------------------------------------------------------------


class Part:
    """The triangles of an object that have one material."""

    def __init__(self, thing, look, corners, normals, smooth, colours):
        self.thing, self.look, self.corners, self.smooth, self.colours = thing, look, corners, smooth, colours
        self.normals = normals
        self.areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        self.opacity = look.opacity(colours is not None)

    def takes_light(self):
        return not self.look.unlit and self.thing.area > 0

    def emits(self):
        look = self.look
        return not look.unlit and self.thing.area > 0 and look.strength > 0 and not look.emission.is_black()

    def reflects(self):
        look = self.look
        painted_black = look.base.painted and self.colours is not None and self.colours.max() <= 0
        return self.takes_light() and not look.base.is_black() and look.metal < 1 and look.glass < 1 and not painted_black

    def is_coloured(self):
        look = self.look
        grey = self.colours is None or bool((self.colours[:, :1] == self.colours[:, 1:]).all())
        shines = not look.unlit and look.strength > 0 and not look.emission.is_grey()
        return not grey or not look.base.is_grey() or shines


class Thing:
    """An object with a mesh, in the pose it has."""

    def __init__(self, made, label, mesh, graph):
        """`mesh` is the number of the glTF mesh: Blender copies one for each skin and morph."""
        self.mesh_number = mesh
        self.name, self.label = made.name, label
        moves = any(m.type == "ARMATURE" for m in made.modifiers) or made.data.shape_keys is not None
        wanted = own([made, made.data], "bake", plain=False)
        self.lightmapped = not moves and wanted not in (False, 0)
        held = made.evaluated_get(graph)
        mesh = held.to_mesh()
        mesh.calc_loop_triangles()
        count = len(mesh.loop_triangles)
        vertices, corners = np.empty(3 * count, np.int32), np.empty(3 * count, np.int32)
        slots, at = np.empty(count, np.int32), np.empty(3 * len(mesh.vertices), np.float32)
        normals = np.empty(3 * len(mesh.loops), np.float32)
        mesh.loop_triangles.foreach_get("vertices", vertices)
        mesh.loop_triangles.foreach_get("loops", corners)
        mesh.loop_triangles.foreach_get("material_index", slots)
        mesh.vertices.foreach_get("co", at)
        mesh.corner_normals.foreach_get("vector", normals)
        local = at.reshape(-1, 3)[vertices].reshape(-1, 3, 3).astype(np.float64)
        shading = normals.reshape(-1, 3)[corners].reshape(-1, 3, 3).astype(np.float64)
        flat = np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0])
        length = np.linalg.norm(flat, axis=1)
        flat[length > 0] /= length[length > 0, None]
        # Degrees by which corners leave the plane.
        bent = np.degrees(np.arccos(np.clip(np.einsum("tcx,tx->tc", shading, flat), -1, 1)).max(axis=1, initial=0)) * (length > 0)
        turn = np.array(made.matrix_world, dtype=np.float64)
        world = local @ turn[:3, :3].T + turn[:3, 3]
        if np.linalg.det(turn[:3, :3]) < 0:
            world = world[:, ::-1]
        self.area = (
            float(np.linalg.norm(np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0]), axis=1).sum()) if count else 0.0
        )
        colours = painted(mesh)
        normals = np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        self.local, self.world, self.skins = local, world, None
        self.parts, self.part_of = [], np.empty(count, object)
        for slot in np.unique(slots):
            material = made.material_slots[slot].material if slot < len(made.material_slots) else None
            mine, look = slots == slot, Look(material)
            self.parts.append(Part(self, look, world[mine], normals[mine], float(bent[mine].max(initial=0)), colours))
            self.part_of[mine] = self.parts[-1]
        held.to_mesh_clear()


def painted(mesh):
    attribute = mesh.color_attributes.active_color if mesh.color_attributes else None
    if attribute is None or not len(attribute.data):
        return None
    flat = np.empty(4 * len(attribute.data), np.float32)
    attribute.data.foreach_get("color", flat)
    return flat.reshape(-1, 4)[:, :3]


def triangles_of(gltf, mesh):
    """How many the file has."""
    count = 0
    for primitive in gltf.data.meshes[mesh].primitives:
        number = primitive.indices if primitive.indices is not None else primitive.attributes.get("POSITION")
        mode, corners = (
            4 if primitive.mode is None else primitive.mode,
            gltf.data.accessors[number].count if number is not None else 0,
        )
        count += corners // 3 if mode == 4 else max(corners - 2, 0) if mode in (5, 6) else 0
    return count


class Lamp:
    """A lamp of Blender's."""

    def __init__(self, made, label, reach):
        data = made.data
        self.name, self.label, self.kind, self.reach = made.name, label, data.type, reach
        turn = np.array(made.matrix_world, dtype=np.float64)
        self.at, self.along = turn[:3, 3], -turn[:3, 2] / max(np.linalg.norm(turn[:3, 2]), 1e-300)
        self.colour = np.array(data.color, dtype=np.float64) * data.energy
        size = own([made, data], "angle" if self.kind == "SUN" else "radius")
        self.size = float(size or 0)
        self.half_cone = data.spot_size / 2 if self.kind == "SPOT" else np.pi

    def shines(self):
        return self.colour.max() > 0

    def towards(self, point):
        """Direction and distance from a point to the lamp; None outside of its cone and range."""
        if self.kind == "SUN":
            return -self.along, np.inf
        way = self.at - point
        distance = np.linalg.norm(way)
        if distance == 0 or distance >= self.reach or -way @ self.along < np.cos(self.half_cone) * distance:
            return None
        return way / distance, distance


class Scene:
    """All that light can meet or come from."""

    def __init__(self):
        gltf = Recorder.gltf
        graph = bpy.context.evaluated_depsgraph_get()
        self.nodes = (gltf.data.nodes or []) if gltf else []
        self.things, self.lamps, self.area_lamps, self.left_out = [], [], [], []
        for made in self.shown(gltf):
            node = Recorder.nodes.get(made.name)
            label = self.label(node)
            if made.type == "MESH" and len(made.data.polygons):
                self.things.append(Thing(made, label, self.nodes[node].mesh, graph))
            elif made.type == "LIGHT":
                light = gltf.data.extensions["KHR_lights_punctual"]["lights"][
                    self.nodes[node].extensions["KHR_lights_punctual"]["light"]
                ]
                self.lamps.append(Lamp(made, label, light.get("range") or np.inf))
            if lamp := own([made], "area_lamp", plain=False):
                self.area_lamps.append((label, made, lamp))
        scene = bpy.context.scene
        self.sky = own([scene], "sky")
        strength = own([scene], "sky_strength")
        if isinstance(self.sky, (list, tuple)) and max(self.sky[:3]) * (1 if strength is None else strength) <= 0:
            self.sky = None
        self.other_bytes = any("meshopt" in name for name in gltf.data.extensions_used or []) if gltf else False
        # Triangles that Blender would not keep: corners that are one vertex.
        held = sum(triangles_of(gltf, thing.mesh_number) for thing in self.things)
        self.dropped = max(held - sum(len(thing.local) for thing in self.things), 0)
        self.parts = [part for thing in self.things for part in thing.parts]

    def label(self, node):
        if node is None:
            return None
        return self.nodes[node].name or f"node {node}"

    def shown(self, gltf):
        """Objects of the scene that is baked: the file's default one or its first, without hidden nodes."""
        things = list(bpy.context.view_layer.objects)
        if gltf and len(gltf.data.scenes or []) > 1 and gltf.data.scene is None:
            first = gltf.blender_collections[0]
            things = [thing for thing in things if thing.name in first.objects]
        orphans = bpy.data.collections.get("Orphan Nodes")
        if gltf and gltf.data.scenes and orphans:
            things = [thing for thing in things if thing.name not in orphans.objects]
        hidden = {
            index
            for index, node in enumerate(self.nodes)
            if ((node.extensions or {}).get("KHR_node_visibility") or {}).get("visible") is False
        }

        def is_hidden(thing):
            while thing:
                if Recorder.nodes.get(thing.name) in hidden:
                    return True
                thing = thing.parent
            return False

        # Shapes that the importer makes to draw bones are of no node.
        return [thing for thing in things if thing.name in Recorder.nodes and not is_hidden(thing)]
