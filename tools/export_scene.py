#!/usr/bin/env python3
"""Exports a Blender scene as the GLB that lightkiln wants, with the light that glTF has no words for.

usage: export_scene.py SCENE.blend OUT.glb
       (Python with the bpy package; or: blender -b SCENE.blend -P tools/export_scene.py -- OUT.glb)

Beside what Blender's exporter writes, custom properties (extras) carry: area lamps (`lightkiln.area_lamp` on their
objects), the radius of point and spot lamps (`radius`) and their Soft Falloff (`lightkiln.soft_falloff`), the angle of
suns (`angle`), the world's colour or image (`lightkiln.sky`, `sky_strength`, `sky_rotation` on the scene; an image is copied
beside the GLB). The scene itself stays as it is.
As a module: `export(path)` exports the scene that is open and returns what could not be carried over.
"""

import argparse
import math
import shutil
import sys
from pathlib import Path

import bpy

# What a bake needs of Blender's exporter, and what is lost without it.
NEEDED = {
    "export_lights": (True, "lamps"),
    "export_cameras": (True, "cameras"),
    "export_extras": (True, "custom properties"),
    "export_apply": (True, "modifiers"),
    "export_import_convert_lighting_mode": ("SPEC", "how the numbers of lamps are meant"),
}
# Width of the sky image that stands for a world of nodes.
SKY_WIDTH = 1024


def lossy_defaults():
    """Sentences about the exporter's own defaults that would have lost something."""
    known = bpy.ops.export_scene.gltf.get_rna_type().properties
    for name, (wanted, what) in NEEDED.items():
        if name in known and known[name].default != wanted:
            yield f"{name} is {known[name].default!r} by default, which loses {what}; it is {wanted!r} here"


def export(path, **settings):
    """Exports the open scene to `path`; returns sentences about what could not be carried over."""
    path = Path(path)
    told = []
    undo = []
    try:
        describe_lamps(undo, told)
        describe_world(path, undo, told)
        wanted = {"export_format": "GLB", "use_renderable": True, **{name: value for name, (value, _) in NEEDED.items()}}
        wanted.update(settings)
        bpy.app.debug_value = 1  # the exporter then reports warnings only
        bpy.ops.export_scene.gltf(filepath=str(path), **wanted)
    finally:
        for put_back in reversed(undo):
            put_back()
    return told


# ---- lamps --------------------------------------------------------------------------------------------------------


def describe_lamps(undo, told):
    for thing in bpy.context.scene.objects:
        if thing.type != "LIGHT" or thing.hide_render:
            continue
        lamp = thing.data
        if lamp.use_nodes and any(not plain_emission(node) for node in lamp.node_tree.nodes):
            told.append(f"{thing.name}: its nodes are not read, only its colour and power")
        if lamp.type == "AREA":
            describe(thing, "area_lamp", area_lamp(thing, told), undo)
        elif lamp.type == "SUN":
            give(lamp, "angle", lamp.angle, undo)
        else:
            give(lamp, "radius", lamp.shadow_soft_size, undo)
            if lamp.shadow_soft_size > 0 and getattr(lamp, "use_soft_falloff", False):
                describe(lamp, "soft_falloff", True, undo)


def plain_emission(node):
    if node.type == "EMISSION":
        return all(not socket.is_linked for socket in node.inputs) and node.inputs["Strength"].default_value == 1
    return node.type == "OUTPUT_LIGHT"


def area_lamp(thing, told):
    lamp = thing.data
    height = lamp.size_y if lamp.shape in {"RECTANGLE", "ELLIPSE"} else lamp.size
    if lamp.spread < math.pi - 1e-3:
        told.append(f"{thing.name}: its beam's spread is not carried over, it will shine in all directions")
    power = lamp.energy * 2 ** getattr(lamp, "exposure", 0.0)
    if not getattr(lamp, "normalize", True):
        # Without normalisation the power is that of a lamp of 1 m².
        shape = math.pi / 4 if lamp.shape in {"DISK", "ELLIPSE"} else 1.0
        scale = thing.matrix_world.to_scale()
        power *= lamp.size * scale.x * height * scale.y * shape
    colour = list(lamp.color)
    if getattr(lamp, "use_temperature", False):
        colour = [a * b for a, b in zip(colour, lamp.temperature_color)]
    return {
        "shape": "ellipse" if lamp.shape in {"DISK", "ELLIPSE"} else "rectangle",
        "size": [lamp.size, height],
        "power": power,
        "color": colour,
    }


# ---- the world ----------------------------------------------------------------------------------------------------


def describe_world(path, undo, told):
    scene = bpy.context.scene
    world = scene.world
    own = scene.get("lightkiln")
    if world is None or (own is not None and "sky" in own):
        return  # nothing to say, or the artist has said it
    sky = constant_sky(world) or image_sky(world, path, told)
    if sky is None:
        name = path.with_suffix(".sky.exr").name
        render_sky(path.with_name(name))
        told.append(f"{world.name}: its nodes were rendered to {name}, {SKY_WIDTH} pixels wide")
        sky = {"sky": name}
    if sky["sky"] != [0.0, 0.0, 0.0]:
        for key, value in sky.items():
            describe(scene, key, value, undo)


def background(world):
    """The node that makes the world's light, when it is one Background and nothing else."""
    if not world.use_nodes:
        return None
    output = next((node for node in world.node_tree.nodes if node.type == "OUTPUT_WORLD" and node.is_active_output), None)
    links = output.inputs["Surface"].links if output else []
    node = links[0].from_node if links else None
    if node is None or node.type != "BACKGROUND" or node.inputs["Strength"].is_linked:
        return None
    return node


def constant_sky(world):
    if not world.use_nodes:
        return {"sky": list(world.color)}
    if not any(node.type == "OUTPUT_WORLD" and node.inputs["Surface"].is_linked for node in world.node_tree.nodes):
        return {"sky": [0.0, 0.0, 0.0]}
    node = background(world)
    if node is None or node.inputs["Color"].is_linked:
        return None
    strength = node.inputs["Strength"].default_value
    return {"sky": [channel * strength for channel in node.inputs["Color"].default_value[:3]]}


def image_sky(world, path, told):
    """An environment image that is at most turned about the vertical."""
    node = background(world)
    source = node.inputs["Color"].links[0].from_node if node else None
    if source is None or source.type != "TEX_ENVIRONMENT" or source.image is None:
        return None
    image, turned = source.image, turn_of(source)
    original = Path(bpy.path.abspath(image.filepath_from_user()))
    plain = source.projection == "EQUIRECTANGULAR" and image.source == "FILE" and image.packed_file is None
    linear = image.colorspace_settings.name in {"Linear Rec.709", "Linear", "Non-Color"}
    if turned is None or not plain or not linear or original.suffix.lower() not in {".exr", ".hdr"} or not original.is_file():
        return None
    beside = path.with_name(original.name)
    if not (beside.exists() and beside.samefile(original)):
        shutil.copyfile(original, beside)
    # Blender turns the direction that is looked up, so the image turns the other way.
    return {
        "sky": beside.name,
        "sky_strength": node.inputs["Strength"].default_value,
        "sky_rotation": -math.degrees(turned),
    }


def turn_of(source):
    """Turn of the looked-up direction about the vertical, radians; None for anything else."""
    if not source.inputs["Vector"].is_linked:
        return 0.0
    mapping = source.inputs["Vector"].links[0].from_node
    if mapping.type == "TEX_COORD":
        return 0.0 if source.inputs["Vector"].links[0].from_socket.name == "Generated" else None
    if mapping.type != "MAPPING" or mapping.vector_type != "POINT":
        return None
    sockets = [mapping.inputs[name] for name in ("Location", "Rotation", "Scale")]
    link = mapping.inputs["Vector"].links
    if any(socket.is_linked for socket in sockets) or not link or link[0].from_socket.name != "Generated":
        return None
    location, rotation, scale = (list(socket.default_value) for socket in sockets)
    plain = location == [0, 0, 0] and scale == [1, 1, 1] and rotation[0] == 0 and rotation[1] == 0
    return rotation[2] if plain else None


def render_sky(path):
    """The world as Cycles sees it in all directions, as an equirectangular EXR."""
    old = bpy.context.scene
    scene = bpy.data.scenes.new("sky")
    lens = bpy.data.cameras.new("sky")
    eye = bpy.data.objects.new("sky", lens)
    try:
        scene.world, scene.camera = old.world, eye
        scene.collection.objects.link(eye)
        # Looks along +x with z up: the middle of Blender's equirectangular images.
        eye.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
        lens.type = "PANO"
        panorama = lens if hasattr(lens, "panorama_type") else lens.cycles
        panorama.panorama_type = "EQUIRECTANGULAR"
        scene.render.engine = "CYCLES"
        scene.cycles.samples, scene.cycles.use_denoising = 16, False
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = SKY_WIDTH, SKY_WIDTH // 2, 100
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True, scene=scene.name)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(eye)
        bpy.data.cameras.remove(lens)


# ---- custom properties, for the time of the export ---------------------------------------------------------------


def give(owner, name, value, undo):
    """Sets a custom property and remembers how to undo it."""
    before = owner.get(name)
    kept = before.to_dict() if hasattr(before, "to_dict") else before

    def put_back():
        if before is None:
            del owner[name]
        else:
            owner[name] = kept

    owner[name] = value
    undo.append(put_back)


def describe(owner, key, value, undo):
    """Adds to the property group `lightkiln`."""
    held = owner.get("lightkiln")
    held = held.to_dict() if hasattr(held, "to_dict") else {}
    give(owner, "lightkiln", {**held, key: value}, undo)


def main():
    if bpy.app.version < (3, 6):
        sys.exit(f"this needs Blender 3.6 or newer, whose exporter says how it means lamps, not {bpy.app.version_string}")
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    ask = argparse.ArgumentParser(description="Exports a Blender scene for lightkiln, area lamps and world included.")
    ask.add_argument("files", nargs="+", type=Path, metavar="FILE", help="[SCENE.blend] OUT.glb")
    options = ask.parse_args(given)
    *scene, out = options.files
    if len(scene) > 1 or (scene and not scene[0].is_file()):
        ask.error("give one scene and one output")
    if scene:
        bpy.ops.wm.open_mainfile(filepath=str(scene[0]))
    for sentence in [*lossy_defaults(), *export(out.resolve())]:
        print(sentence)


if __name__ == "__main__":
    main()
