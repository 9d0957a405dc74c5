"""What a glTF file holds once Blender has imported it, as plain data that can be compared.

Everything is keyed by name. A baked file gives each instance its own mesh, and may need a material for each page:
Blender numbers such copies ("Wall.001"), so objects name their data by the stem alone.
"""

import re

import bpy
import numpy as np

# Mesh attributes that are the mesh itself, and so compared in their own way, or that Blender derives.
BUILT_IN = {"position", "material_index", "custom_normal", "sharp_face", "sharp_edge"}
COMPONENTS = {
    "FLOAT": ("value", 1),
    "INT": ("value", 1),
    "INT8": ("value", 1),
    "BOOLEAN": ("value", 1),
    "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3),
    "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4),
    "QUATERNION": ("value", 4),
}


def load(path):
    """Imports a file into an empty Blender and describes it; mesh data are still to be had from `mesh_corners`."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.app.debug_value = 1  # the importer then reports warnings only
    bpy.ops.import_scene.gltf(filepath=str(path))
    bpy.context.view_layer.update()
    return describe()


def describe():
    return {
        "objects and hierarchy": {thing.name: hierarchy(thing) for thing in bpy.data.objects},
        "transforms": {thing.name: transforms(thing) for thing in bpy.data.objects},
        "materials": {f"materials {made.name}": material(made) for made in bpy.data.materials},
        "cameras": {made.name: settings(made) for made in bpy.data.cameras},
        "lamps": {made.name: settings(made) for made in bpy.data.lights},
        "armatures": {made.name: armature(made) for made in bpy.data.armatures},
        "actions": {made.name: action(made) for made in bpy.data.actions},
        "what is animated": {f"{kind} {owner.name}": animation(owner) for kind, owner in animatable()},
        "custom properties": {f"{kind} {owner.name}": properties(owner) for kind, owner in owners()},
        "scene": {scene.name: scene_facts(scene) for scene in bpy.data.scenes},
    }


def stem(name):
    return re.sub(r"\.\d{3,}$", "", name)


# ---- objects ------------------------------------------------------------------------------------------------------


def hierarchy(thing):
    return {
        "type": thing.type,
        "parent": thing.parent.name if thing.parent else None,
        "parent bone": (thing.parent_type, thing.parent_bone),
        "data": stem(thing.data.name) if thing.data else None,
        "modifiers": [
            (made.type, made.object.name if getattr(made, "object", None) else None) for made in thing.modifiers
        ],
        "constraints": [made.type for made in thing.constraints],
        "vertex groups": [group.name for group in thing.vertex_groups],
        "hidden": (thing.hide_get(), thing.hide_render),
        "collections": sorted(group.name for group in thing.users_collection),
    }


def transforms(thing):
    pose = {bone.name: matrix(bone.matrix) for bone in thing.pose.bones} if thing.pose else {}
    return {
        "local": matrix(thing.matrix_local),
        "world": matrix(thing.matrix_world),
        "rotation mode": thing.rotation_mode,
        "pose": pose,
    }


def matrix(of):
    return np.array(of, dtype=np.float64)


def scene_facts(scene):
    return {
        "camera": scene.camera.name if scene.camera else None,
        "frames": (scene.frame_start, scene.frame_end, scene.render.fps),
    }


# ---- data blocks --------------------------------------------------------------------------------------------------


def settings(block):
    """All the plain values that Blender's interface could set on a block; its name is the key it is found by."""
    found = {}
    for entry in block.bl_rna.properties:
        plain = entry.type in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}
        if plain and not entry.is_readonly and entry.identifier != "name":
            value = getattr(block, entry.identifier)
            found[entry.identifier] = list(value) if getattr(entry, "is_array", False) else value
    return found


def material(made):
    found = {"settings": settings(made), "nodes": {}, "links": []}
    if made.node_tree:
        for node in made.node_tree.nodes:
            values = {
                socket.identifier: plain(socket.default_value)
                for socket in node.inputs
                if hasattr(socket, "default_value")
            }
            image = getattr(node, "image", None)
            found["nodes"][node.name] = {
                "kind": node.bl_idname,
                "settings": settings(node),
                "inputs": values,
                "outputs": [plain(socket.default_value) for socket in node.outputs if hasattr(socket, "default_value")],
                "image": picture(image) if image else None,
            }
        found["links"] = sorted(
            f"{x.from_node.name}.{x.from_socket.identifier} -> {x.to_node.name}.{x.to_socket.identifier}"
            for x in made.node_tree.links
        )
    return found


def picture(image):
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return {
        "size": tuple(image.size),
        "colour space": image.colorspace_settings.name,
        "alpha": image.alpha_mode,
        "pixels": pixels,
    }


def armature(made):
    return {
        bone.name: {
            "parent": bone.parent.name if bone.parent else None,
            "rest": matrix(bone.matrix_local),
            "head and tail": np.array((bone.head_local, bone.tail_local)),
            "settings": settings(bone),
        }
        for bone in made.bones
    }


def action(made):
    curves = {}
    for layer in made.layers:
        for strip in layer.strips:
            for slot in made.slots:
                bag = strip.channelbag(slot)
                for curve in bag.fcurves if bag else []:
                    keys = [(*key.co, *key.handle_left, *key.handle_right) for key in curve.keyframe_points]
                    shapes = [key.interpolation for key in curve.keyframe_points]
                    curves[f"{slot.identifier} {curve.data_path}[{curve.array_index}]"] = {
                        "keys": np.array(keys),
                        "interpolation": shapes,
                    }
    return {"range": tuple(made.frame_range), "curves": curves}


def animatable():
    for kind in ("objects", "shape_keys", "materials", "lights", "cameras", "armatures"):
        for block in getattr(bpy.data, kind):
            if block.animation_data:
                yield kind, block


def animation(owner):
    data = owner.animation_data
    tracks = {
        track.name: [
            (strip.action.name if strip.action else None, strip.frame_start, strip.frame_end) for strip in track.strips
        ]
        for track in data.nla_tracks
    }
    return {
        "action": data.action.name if data.action else None,
        "slot": data.action_slot.identifier if data.action_slot else None,
        "tracks": tracks,
    }


def owners():
    for kind in (
        "objects",
        "meshes",
        "materials",
        "cameras",
        "lights",
        "armatures",
        "scenes",
        "actions",
        "collections",
    ):
        for block in getattr(bpy.data, kind):
            yield kind, block
    for made in bpy.data.armatures:
        for bone in made.bones:
            yield f"bone of {made.name}", bone


def properties(owner):
    return {key: plain(owner[key]) for key in owner.keys()}


def plain(value):
    """Blender's own containers as Python's."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "to_list"):
        return value.to_list()
    if hasattr(value, "name") and hasattr(value, "bl_rna"):
        return value.name
    if hasattr(value, "__len__") and not isinstance(value, (str, bytes)):
        return [plain(item) for item in value]
    return value


# ---- meshes -------------------------------------------------------------------------------------------------------


class Corners:
    """A mesh as triangles whose corners carry every value, so that split vertices compare equal to shared ones."""

    def __init__(self, thing):
        mesh = thing.data
        mesh.calc_loop_triangles()
        self.vertices = read(mesh.vertices, "co", 3)
        self.vertex_of = read(mesh.loops, "vertex_index", 1, np.int32)[:, 0]
        self.triangles = read(mesh.loop_triangles, "loops", 3, np.int32)
        polygon_of = read(mesh.loop_triangles, "polygon_index", 1, np.int32)[:, 0]
        self.normals = read(mesh.corner_normals, "vector", 3)
        self.loose_edges = sum(edge.is_loose for edge in mesh.edges)
        slots = [stem(slot.material.name) if slot.material else None for slot in thing.material_slots] or [None]
        index = read(mesh.polygons, "material_index", 1, np.int32)[:, 0]
        self.material_of = [slots[index[polygon]] for polygon in polygon_of]
        self.uv_sets = {layer.name: read(layer.uv, "vector", 2) for layer in mesh.uv_layers}
        self.columns = {"position": self.vertices[self.vertex_of]}
        self._add_attributes(mesh)
        self._add_weights(thing)
        if mesh.shape_keys:
            for key in mesh.shape_keys.key_blocks:
                self.columns[f"shape key {key.name}"] = read(key.data, "co", 3)[self.vertex_of]
            self.shape_keys = {
                key.name: (key.value, key.slider_min, key.slider_max, key.relative_key.name)
                for key in mesh.shape_keys.key_blocks
            }
        else:
            self.shape_keys = {}

    def _add_attributes(self, mesh):
        for attribute in mesh.attributes:
            if attribute.name in BUILT_IN or attribute.name.startswith(".") or attribute.name in self.uv_sets:
                continue
            if attribute.data_type not in COMPONENTS or attribute.domain not in {"POINT", "CORNER"}:
                continue
            field, width = COMPONENTS[attribute.data_type]
            values = read(attribute.data, field, width)
            self.columns[f"attribute {attribute.name}"] = (
                values if attribute.domain == "CORNER" else values[self.vertex_of]
            )

    def _add_weights(self, thing):
        weights = np.zeros((len(self.vertices), len(thing.vertex_groups)), np.float32)
        for vertex in thing.data.vertices if len(thing.vertex_groups) else []:
            for entry in vertex.groups:
                weights[vertex.index, entry.group] = entry.weight
        for group in thing.vertex_groups:
            self.columns[f"weight {group.name}"] = weights[self.vertex_of, group.index : group.index + 1]


def read(collection, field, width, kind=np.float32):
    flat = np.zeros(len(collection) * width, kind)
    collection.foreach_get(field, flat)
    return flat.reshape(-1, width)


def mesh_corners():
    return {thing.name: Corners(thing) for thing in bpy.data.objects if thing.type == "MESH"}
