"""Gives a scene that Blender imported from glTF the light that came as custom properties, as lightkiln reads it."""

import math
from pathlib import Path

import bpy
from mathutils import Quaternion


def own(holders, name, plain=True):
    """A property of lightkiln's, nested or flat, or by its plain name: that of the first holder that has one."""
    for holder in holders:
        nested = holder.get("lightkiln")
        nested = nested.to_dict() if hasattr(nested, "to_dict") else {}
        keys = [(nested, name), (holder, f"lightkiln.{name}"), (holder, f"lightkiln_{name}"), (holder, name)]
        for held, key in keys if plain else keys[:3]:
            if key in held:
                value = held[key]
                return value.to_dict() if hasattr(value, "to_dict") else value.to_list() if hasattr(value, "to_list") else value
    return None


def light_from_properties(folder=Path(), sky=None):
    """Sizes of lamps and suns, soft falloff, area lamps, and the sky: `sky` where it is given (as for `--sky`), else the
    scene's own. Files are looked for in `folder`."""
    for thing in list(bpy.context.scene.objects):
        if thing.type == "LIGHT" and thing.data.type == "SUN":
            thing.data.angle = own([thing, thing.data], "angle") or 0
        elif thing.type == "LIGHT" and thing.data.type != "AREA":
            thing.data.shadow_soft_size = own([thing, thing.data], "radius") or 0
            thing.data.use_soft_falloff = bool(own([thing, thing.data], "soft_falloff", plain=False))
        if lamp := own([thing], "area_lamp", plain=False):
            add_area_lamp(thing, lamp)
    bpy.context.view_layer.update()
    if sky:
        give_sky(*parsed(sky), 0, Path())
        return
    scene = bpy.context.scene
    strength = own([scene], "sky_strength")
    give_sky(own([scene], "sky"), 1 if strength is None else strength, own([scene], "sky_rotation") or 0, folder)


def parsed(text):
    """`R,G,B[,STRENGTH]` or `FILE[,STRENGTH]` as (colour or file, strength)."""
    parts = text.split(",")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = None
    if numbers is not None and len(numbers) in (3, 4):
        return numbers[:3], numbers[3] if len(numbers) == 4 else 1
    try:
        return ",".join(parts[:-1]) or text, float(parts[-1])
    except ValueError:
        return text, 1


def give_sky(sky, strength, rotation, folder):
    """A world of one colour, or of an image turned by so many degrees, counter-clockwise seen from above."""
    if not sky:
        return
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    node = next(node for node in nodes if node.type == "BACKGROUND")
    node.inputs["Strength"].default_value = strength
    if not isinstance(sky, str):
        node.inputs["Color"].default_value = (*sky[:3], 1)
    else:
        kinds = ("ShaderNodeTexEnvironment", "ShaderNodeMapping", "ShaderNodeTexCoord")
        source, mapping, where = (nodes.new(kind) for kind in kinds)
        source.image = bpy.data.images.load(str((Path(folder) / sky).resolve()))
        source.image.colorspace_settings.name = "Linear Rec.709"
        # Blender turns the direction that is looked up, so the image turns the other way.
        mapping.inputs["Rotation"].default_value[2] = -math.radians(rotation)
        links.new(where.outputs["Generated"], mapping.inputs["Vector"])
        links.new(mapping.outputs["Vector"], source.inputs["Vector"])
        links.new(source.outputs["Color"], node.inputs["Color"])
    bpy.context.scene.world = world


def add_area_lamp(thing, lamp):
    """Shines along the object's −z of glTF's axes, its +y in Blender's; width and height are along x and glTF's y."""
    data = bpy.data.lights.new(thing.name, "AREA")
    data.shape = "RECTANGLE" if lamp["shape"] == "rectangle" else "ELLIPSE"
    data.size, data.size_y = lamp["size"]
    data.energy, data.color = lamp["power"], lamp.get("color", (1, 1, 1))
    made = bpy.data.objects.new(thing.name, data)
    made.rotation_mode = "QUATERNION"
    made.rotation_quaternion = Quaternion((math.sqrt(0.5), math.sqrt(0.5), 0, 0))
    made.parent = thing
    thing.users_collection[0].objects.link(made)
