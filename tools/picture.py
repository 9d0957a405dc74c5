"""Shows a preview file (lightkiln bake --preview) in Blender: renders it through its own camera to a PNG.

usage: picture.py PREVIEW.glb PICTURE.png [--width 960]

Runs with bpy from PyPI or as `blender -b -P tools/picture.py -- PREVIEW.glb PICTURE.png`. The preview shines by itself,
so a few samples give a clean picture: no light is computed here.
"""

import argparse
import sys

import bpy


def main():
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("preview")
    parser.add_argument("picture")
    parser.add_argument("--width", type=int, default=960)
    arguments = parser.parse_args(given)

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=arguments.preview)
    scene = bpy.context.scene
    scene.camera = next((item for item in scene.objects if item.type == "CAMERA"), None)
    if scene.camera is None:
        sys.exit(f"{arguments.preview}: no camera to look through: export the scene with Include > Cameras")
    for item in [item for item in scene.objects if item.type == "LIGHT"]:
        bpy.data.objects.remove(item)

    scene.render.engine = "CYCLES"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    scene.render.resolution_x = arguments.width
    scene.render.resolution_y = arguments.width * 3 // 4
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "AgX"
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = arguments.picture
    bpy.ops.render.render(write_still=True)


main()
