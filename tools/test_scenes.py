"""Small scenes, built in Blender, each lit by one thing that glTF has no words for."""

import math
from pathlib import Path

import bpy
import numpy as np

import blender_kit as kit

SCENES = {}
GREY = (0.6, 0.6, 0.6)


def scene(build):
    SCENES[build.__name__] = build
    return build


def room(*, open_top=False, shadow=True):
    """A box of 4 m with a block in it; without a lid where light is to come from above."""
    grey, red, blue = kit.material("grey", GREY), kit.material("red", (0.6, 0.1, 0.1)), kit.material("blue", (0.1, 0.15, 0.6))
    low, high = (-2, -2, 0), (2, 2, 3)
    corner = lambda x, y, z: tuple((low, high)[bit][axis] for axis, bit in enumerate((x, y, z)))
    sides = {
        "floor": ([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], grey),
        "ceiling": ([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], grey),
        "west": ([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], red),
        "east": ([(1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)], blue),
        "north": ([(0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)], grey),
        "south": ([(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)], grey),
    }
    for name, (corners, made) in sides.items():
        if not (open_top and name == "ceiling"):
            kit.add(name, kit.polygon(name, [corner(*bits) for bits in corners], made, facing=(0, 0, 1.5)))
    if shadow:
        kit.add("block", kit.boxes("block", [((-0.4, -0.4, 0.4), (0.4, 0.4, 1.0))], grey), turned=(0, 0, 0.4))
    kit.camera((1.8, -1.8, 2.2), (-0.4, 0.4, 0.8), lens=20)


def area_lamp(shape, size, size_y, watts, colour, at, towards, scale=(1, 1, 1)):
    data = bpy.data.lights.new("panel", "AREA")
    data.shape, data.size, data.size_y = shape, size, size_y
    data.energy, data.color = watts, colour
    thing = kit.aim(kit.add("panel", data, at=at), towards)
    thing.scale = scale
    return thing


def constant_world(colour, strength=1.0):
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    node = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    node.inputs["Color"].default_value = (*colour, 1)
    node.inputs["Strength"].default_value = strength
    bpy.context.scene.world = world
    return world, node


@scene
def area_rectangle(folder):
    room()
    area_lamp("RECTANGLE", 1.2, 0.5, 60, (1, 0.8, 0.6), (0.8, 0.3, 2.6), (0, 0, 0.5))


@scene
def area_ellipse(folder):
    """Scaled by its object, which widens the lamp but keeps its power."""
    room()
    area_lamp("ELLIPSE", 1.0, 0.6, 80, (0.7, 0.9, 1), (-0.6, -0.5, 2.7), (0.2, 0.1, 0.3), scale=(1.5, 1, 1))


@scene
def lamp_radius(folder):
    room()
    lamp = kit.point_lamp("bulb", (0.5, 0.4, 2.4), 100)
    lamp.data.shadow_soft_size, lamp.data.use_soft_falloff = 0.3, False


@scene
def lamp_soft_falloff(folder):
    """Blender's own setting for lamps with a radius, which dims what is near."""
    room()
    lamp = kit.point_lamp("bulb", (0.5, 0.4, 2.4), 100)
    lamp.data.shadow_soft_size, lamp.data.use_soft_falloff = 0.3, True
    # Small beside its distance: lightkiln cuts the cone from the lamp's middle, Cycles from every point of it.
    spot = kit.spot_lamp("spot", (-1.2, -1.0, 2.6), (-1.0, 0.8, 0.0), 60, math.radians(70), 0.5)
    spot.data.shadow_soft_size, spot.data.use_soft_falloff = 0.1, True


@scene
def sun_angle(folder):
    room(open_top=True)
    kit.sun_lamp("sun", (0.3, 0.2, -1), 4.0, (1, 0.95, 0.85))
    # Not through the kit, which writes the property itself.
    bpy.data.lights["sun"].angle = math.radians(12)


@scene
def world_colour(folder):
    room(open_top=True)
    constant_world((0.5, 0.7, 1.0), 1.5)


@scene
def world_image(folder):
    """An image whose quarters differ, turned by 50 degrees: a wrong direction would show as a wrong wall."""
    room(open_top=True)
    rows, columns = np.mgrid[0:32, 0:64]
    sky = np.ones((32, 64, 4), np.float32)
    sky[..., 0] = np.where((columns // 16) % 4 == 0, 3.0, 0.2)
    sky[..., 1] = np.where((columns // 16) % 4 == 1, 2.0, 0.2)
    sky[..., 2] = np.where(rows < 8, 1.5, 0.3)
    image = bpy.data.images.new("sky", 64, 32, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.ascontiguousarray(sky[::-1]).ravel())
    path = Path(folder) / "quarters.exr"
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    image.save_render(str(path))
    bpy.data.images.remove(image)

    world, node = constant_world((0, 0, 0), 1.0)
    nodes, links = world.node_tree.nodes, world.node_tree.links
    source, mapping, where = (nodes.new(kind) for kind in ("ShaderNodeTexEnvironment", "ShaderNodeMapping", "ShaderNodeTexCoord"))
    source.image = bpy.data.images.load(str(path))
    source.image.colorspace_settings.name = "Linear Rec.709"
    mapping.inputs["Rotation"].default_value[2] = math.radians(50)
    links.new(where.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], source.inputs["Vector"])
    links.new(source.outputs["Color"], node.inputs["Color"])


@scene
def world_nodes(folder):
    """Neither a colour nor an image: the export renders it."""
    room(open_top=True)
    world, node = constant_world((0, 0, 0), 1.0)
    nodes, links = world.node_tree.nodes, world.node_tree.links
    where, ramp = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeVectorMath")
    ramp.operation = "MULTIPLY_ADD"
    ramp.inputs[1].default_value, ramp.inputs[2].default_value = (1.0, 0.5, 0.2), (1.0, 0.6, 0.8)
    links.new(where.outputs["Generated"], ramp.inputs[0])
    links.new(ramp.outputs["Vector"], node.inputs["Color"])


def build(name, folder):
    """Opens a fresh Blender and builds the scene; files it needs go to `folder`."""
    kit.new_scene()
    SCENES[name](folder)
    bpy.context.view_layer.update()
