"""Building blocks for scenes made in Blender by script: meshes, materials, lamps, export.

Blender's axes hold here (metres, z up); its glTF exporter turns them into glTF's (y up).
"""

import bpy
import numpy as np
from mathutils import Vector

import export_scene


def new_scene():
    """An empty file: nothing of the start-up scene, nothing of the scene before."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


def export(path, **settings):
    """Writes the scene as a GLB with the settings a bake needs; Blender has most of them off by default."""
    wanted = {"export_format": "GLB", **{name: value for name, (value, _) in export_scene.NEEDED.items()}, **settings}
    bpy.app.debug_value = 1  # the exporter then reports warnings only
    bpy.ops.export_scene.gltf(filepath=str(path), **wanted)


# ---- materials ----------------------------------------------------------------------------------------------------


def material(name, colour=(0.8, 0.8, 0.8), *, double_sided=False, emission=None, strength=1.0, alpha=1.0, metallic=0.0):
    """A matte material. Without the specular lobe Blender's own renderer sees the same diffuse world that is baked.

    Blender writes doubleSided for every material whose Backface Culling is not ticked.
    """
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.use_backface_culling = not double_sided
    bsdf = principled(made)
    bsdf.inputs["Base Color"].default_value = (*colour, 1.0)
    bsdf.inputs["Roughness"].default_value = 1.0
    bsdf.inputs["Specular IOR Level"].default_value = 0.0
    bsdf.inputs["Metallic"].default_value = metallic
    bsdf.inputs["Alpha"].default_value = alpha
    if emission is not None:
        bsdf.inputs["Emission Color"].default_value = (*emission, 1.0)
        bsdf.inputs["Emission Strength"].default_value = strength
    return made


def principled(of_material):
    return of_material.node_tree.nodes["Principled BSDF"]


def unlit_material(name, colour):
    """A colour wired straight into the output is what the exporter turns into KHR_materials_unlit."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.remove(principled(made))
    rgb = nodes.new("ShaderNodeRGB")
    rgb.outputs[0].default_value = (*colour, 1.0)
    links.new(rgb.outputs[0], nodes["Material Output"].inputs["Surface"])
    return made


def texture(of_material, socket, name, rgba):
    """Feeds `socket` from a new image; `rgba` is [rows from the top, columns, 4], as stored (sRGB for colours)."""
    height, width = rgba.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=True)
    image.pixels.foreach_set(np.ascontiguousarray(rgba[::-1], dtype=np.float32).ravel())
    image.pack()
    node = of_material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    of_material.node_tree.links.new(node.outputs["Color"], principled(of_material).inputs[socket])
    return node


def alpha_mask(of_material, image_node, cutoff):
    """Alpha through a "greater than" node is the wiring that the exporter reads as alphaMode MASK."""
    nodes, links = of_material.node_tree.nodes, of_material.node_tree.links
    compare = nodes.new("ShaderNodeMath")
    compare.operation = "GREATER_THAN"
    compare.inputs[1].default_value = cutoff
    links.new(image_node.outputs["Alpha"], compare.inputs[0])
    links.new(compare.outputs[0], principled(of_material).inputs["Alpha"])


def vertex_colours(of_material, layer):
    """Multiplies nothing, just paints: the base colour is the mesh's colour layer, which becomes COLOR_0."""
    node = of_material.node_tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = layer
    of_material.node_tree.links.new(node.outputs["Color"], principled(of_material).inputs["Base Color"])


# ---- objects ------------------------------------------------------------------------------------------------------


def add(name, data, parent=None, at=(0, 0, 0), turned=(0, 0, 0), scaled=(1, 1, 1)):
    made = bpy.data.objects.new(name, data)
    made.location, made.rotation_euler, made.scale = at, turned, scaled
    made.parent = parent
    bpy.context.collection.objects.link(made)
    return made


def mesh(name, vertices, faces, of_material, uvs=None, smooth=False):
    """`uvs`, where given, holds one pair per face corner."""
    made = bpy.data.meshes.new(name)
    made.from_pydata([Vector(v) for v in vertices], [], faces)
    made.materials.append(of_material)
    if uvs is not None:
        made.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.asarray(uvs, np.float32).ravel())
    if smooth:
        made.shade_smooth()
    made.validate()
    return made


def polygon(name, corners, of_material, facing, uvs=None):
    """One flat face whose front looks towards the point `facing`."""
    a, b, c = (Vector(corner) for corner in corners[:3])
    if (b - a).cross(c - a).dot(Vector(facing) - a) < 0:
        corners = list(reversed(corners))
        uvs = None if uvs is None else list(reversed(uvs))
    return mesh(name, corners, [list(range(len(corners)))], of_material, uvs)


# The corners of a box are numbered by bits: 1 for the far x, 2 for the far y, 4 for the far z. Fronts look outwards.
BOX_FACES = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]


def boxes(name, spans, of_material, inward=False, textured=False):
    """One mesh of axis-aligned boxes, each span being (low corner, high corner).

    `inward` turns the fronts to the inside: a room. `textured` adds UVs in metres.
    """
    vertices, faces, uvs = [], [], []
    for low, high in spans:
        first = len(vertices)
        vertices += [[(low, high)[bit >> axis & 1][axis] for axis in range(3)] for bit in range(8)]
        for number, face in enumerate(BOX_FACES):
            face = tuple(reversed(face)) if inward else face
            faces.append([first + corner for corner in face])
            flat = [axis for axis in range(3) if axis != number // 2]
            uvs += [[vertices[first + corner][axis] for axis in flat] for corner in face]
    return mesh(name, vertices, faces, of_material, uvs if textured else None)


def wall_with_hole(name, low, high, hole_low, hole_high, of_material):
    """A wall (thin along x) with a rectangular opening through it; hole corners are (y, z). Closed all round."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    (v0, w0), (v1, w1) = hole_low, hole_high
    ring = [(y0, z0), (y1, z0), (y1, z1), (y0, z1), (v0, w0), (v1, w0), (v1, w1), (v0, w1)]
    vertices = [(x, y, z) for x in (x0, x1) for y, z in ring]
    faces = []
    for i in range(4):
        j = (i + 1) % 4
        faces.append((i, i + 4, j + 4, j))  # the x0 side looks to -x
        faces.append((i + 8, j + 8, j + 12, i + 12))  # the x1 side to +x
        faces.append((i, j, j + 8, i + 8))  # outer rim
        faces.append((i + 4, i + 12, j + 12, j + 4))  # reveal of the opening
    return mesh(name, vertices, faces, of_material)


def grid(name, columns, rows, size, of_material, smooth=True):
    """A flat sheet in the xy plane, centred, of columns x rows quads, with UVs that span it once."""
    vertices = [
        ((i / columns - 0.5) * size[0], (j / rows - 0.5) * size[1], 0.0)
        for j in range(rows + 1)
        for i in range(columns + 1)
    ]
    faces, uvs = [], []
    for j in range(rows):
        for i in range(columns):
            corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            faces.append([v * (columns + 1) + u for u, v in corners])
            uvs += [(u / columns, v / rows) for u, v in corners]
    return mesh(name, vertices, faces, of_material, uvs, smooth)


def lathe(name, profile, segments, of_material):
    """A smooth solid of revolution about z; `profile` is (radius, height) from the foot up, radius 0 at both ends."""
    vertices = [(0, 0, profile[0][1])]
    for radius, height in profile[1:-1]:
        for k in range(segments):
            turn = 2 * np.pi * k / segments
            vertices.append((radius * np.cos(turn), radius * np.sin(turn), height))
    vertices.append((0, 0, profile[-1][1]))
    rings, top = len(profile) - 2, len(vertices) - 1

    def at(ring, k):
        return 1 + ring * segments + k % segments

    faces = [(0, at(0, k + 1), at(0, k)) for k in range(segments)]
    faces += [
        (at(r, k), at(r, k + 1), at(r + 1, k + 1), at(r + 1, k)) for r in range(rings - 1) for k in range(segments)
    ]
    faces += [(top, at(rings - 1, k), at(rings - 1, k + 1)) for k in range(segments)]
    return mesh(name, vertices, faces, of_material, smooth=True)


# ---- lamps and cameras --------------------------------------------------------------------------------------------


def point_lamp(name, at, watts, colour=(1, 1, 1)):
    data = bpy.data.lights.new(name, "POINT")
    data.energy, data.color, data.shadow_soft_size = watts, colour, 0.0
    return add(name, data, at=at)


def soft(lamp, radius):
    """Gives a point or spot lamp a size (m). glTF has no field for it, so it goes along as a property."""
    lamp.data.shadow_soft_size = radius
    lamp.data["radius"] = radius
    return lamp


def spot_lamp(name, at, towards, watts, cone, blend, colour=(1, 1, 1)):
    """`cone` is the full opening angle in radians, as in Blender."""
    data = bpy.data.lights.new(name, "SPOT")
    data.energy, data.color, data.shadow_soft_size = watts, colour, 0.0
    data.spot_size, data.spot_blend = cone, blend
    return aim(add(name, data, at=at), towards)


def sun_lamp(name, shining, strength, colour=(1, 1, 1), angle=0.0):
    """`shining` is the way the light travels. glTF has no field for the sun's size, so it goes along as a property."""
    data = bpy.data.lights.new(name, "SUN")
    data.energy, data.color, data.angle = strength, colour, angle
    if angle:
        data["angle"] = angle
    return aim(add(name, data, at=-4 * Vector(shining).normalized()), (0, 0, 0))


def camera(at, towards, lens=28.0):
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    made = aim(add("Camera", data, at=at), towards)
    bpy.context.scene.camera = made
    return made


def aim(thing, towards):
    """Turns a lamp or camera, which look down their own -z, at a point."""
    thing.rotation_euler = (Vector(towards) - thing.location).to_track_quat("-Z", "Y").to_euler()
    return thing
