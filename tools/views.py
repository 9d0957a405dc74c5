"""One baked scene looked at in several ways: `lightkiln render`, the preview in stock Blender and in three.js, the lightmaps
applied in Blender."""

import re
import subprocess
from pathlib import Path

import bpy
import numpy as np

import apply_lightmaps
import pictures

WIDTH = 320
# How well two pictures of the same light must agree, in steps of 255: rounding, texture filters at magnified texels, and
# pixels on edges, which the two sample at other places.
MEDIAN_STEPS = 1.0
P95_STEPS = 4.0
# A browser reads 8 of the preview's 16 bits, so what is darker than the material's white by a factor f is off by up to
# f^(1/2.4) / 2 steps: 6 at f = 400, which is shade against sun (20) and the blue of wood against its red (20).
P95_STEPS_IN_A_BROWSER = 8.0


def compare(lightkiln, baked, preview, folder, engines=("CYCLES",), three=False):
    """Takes the pictures, in three.js too where that is wanted, and writes them side by side to `folder`; returns facts with
    their `problems`."""
    ours = folder / f"{baked.stem}.render.png"
    size, ev = frame(lightkiln, baked, ours)
    ways = []
    for engine in engines:
        ways.append((f"preview in {engine}", lambda e=engine: (load_preview(preview), e)))
        ways.append((f"lightmaps applied in {engine}", lambda e=engine: (apply_lightmaps.load(baked), e)))
    shown, facts = [pictures.load(ours)], {"exposure": ev, "size": size, "problems": []}
    if not shown[0].any():
        facts["note"] = "the camera sees nothing but black"

    def judge(name, picture, limit):
        steps = np.rint(np.abs(shown[0] - picture).max(axis=-1) * 255)
        median, p95 = float(np.median(steps)), float(np.percentile(steps, 95))
        facts[name] = {"median steps": median, "95th percentile": p95}
        if median > MEDIAN_STEPS or p95 > limit:
            facts["problems"].append(f"{name}: differs from lightkiln render by {median:.1f} of 255, in 5 % of the pixels by {p95:.1f}")
        shown.append(picture)

    for number, (name, load) in enumerate(ways):
        _, engine = load()
        path = folder / f"{baked.stem}.blender{number}.png"
        take(path, size, ev, engine)
        judge(name, pictures.load(path), P95_STEPS)
    if three:
        judge("preview in three.js", in_three(preview, folder / f"{baked.stem}.three.rgb", size, ev), P95_STEPS_IN_A_BROWSER)
    gap = np.ones((size[1], 4, 3))
    pictures.save(folder / f"{baked.stem}.views.png", np.hstack([part for one in shown for part in (one, gap)][:-1]))
    return facts


def frame(lightkiln, baked, path):
    """The exposure that lightkiln chooses, and a small picture of the camera's shape, taken at that exposure."""
    said = run(lightkiln, "render", baked, "-o", path, "--tone", "clip")
    width, height, ev = re.search(r": (\d+) × (\d+), camera .*, exposure (\S+)", said).groups()
    size = [WIDTH, max(1, round(WIDTH * int(height) / int(width)))]
    # What is behind the scene is not in a preview.
    run(lightkiln, "render", baked, "-o", path, "--tone", "clip", f"--exposure={ev}", "--size", f"{size[0]}x{size[1]}", "--sky", "0,0,0")
    return size, float(ev)


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{done.stderr}")
    return done.stderr


def in_three(preview, path, size, ev):
    run("node", Path(__file__).with_name("three_view.mjs"), preview, path, *size, ev)
    return np.fromfile(path, np.uint8).reshape(size[1], size[0], 3) / 255


def load_preview(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.app.debug_value = 1
    bpy.ops.import_scene.gltf(filepath=str(path))


def take(path, size, ev, engine="CYCLES", samples=16):
    """Renders the open scene through its first camera; surfaces shine by themselves, so few samples are no noise."""
    scene = bpy.context.scene
    scene.camera = next(thing for thing in scene.objects if thing.type == "CAMERA")
    scene.render.engine = engine
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = samples, False, False
    if engine != "CYCLES":
        scene.eevee.taa_render_samples = samples
    scene.cycles.max_bounces = 0
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage, scene.render.dither_intensity = 100, 0
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
    scene.view_settings.exposure, scene.view_settings.gamma = ev, 1
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGB"
    scene.render.image_settings.color_depth = "8"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
