#!/usr/bin/env python3
"""Builds the scenes in fixtures/ in Blender and exports each with Blender's own glTF exporter.

usage: make_fixtures.py [--out DIR] [NAME ...]
       (Python with the bpy 4.5 package; or: blender -b -P make_fixtures.py -- ...)

Every scene shows one thing; fixtures/README.md says what the bake must make of it. The same Blender, the same bytes.
"""

import argparse
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy
import numpy as np

import blender_kit as kit

FIXTURES = {}
WHITE = (0.73, 0.73, 0.73)


def fixture(build):
    FIXTURES[build.__name__] = build
    return build


# ---- rooms with a known answer ------------------------------------------------------------------------------------


@fixture
def cornell():
    """The Cornell box as measured: geometry in mm, reflectances and lamp spectrum as linear sRGB under D65."""

    def mm(x, y, z):  # the data is y up with z into the box; here z is up
        return (x / 1000, -z / 1000, y / 1000)

    def wall(name, corners, of_material):
        kit.add(name, kit.polygon(name, [mm(*corner) for corner in corners], of_material, facing=mm(278, 270, 280)))

    def block(name, top, height):
        """A block stands on the floor, so like the original it has no bottom face."""
        vertices = [mm(x, y, z) for y in (height, 0) for x, z in top]
        centre = np.mean(vertices, axis=0)
        faces = [(0, 1, 2, 3)] + [(i, i + 4, (i + 1) % 4 + 4, (i + 1) % 4) for i in range(4)]
        outward = []
        for face in faces:
            a, b, c = (np.array(vertices[corner]) for corner in face[:3])
            outward.append(face if np.dot(np.cross(b - a, c - a), a - centre) > 0 else tuple(reversed(face)))
        kit.add(name, kit.mesh(name, vertices, outward, white))

    white = kit.material("white", (0.7363, 0.7367, 0.7378))
    green = kit.material("green", (0.0679, 0.3987, 0.0863))
    red = kit.material("red", (0.4922, 0.0491, 0.0511))
    light = np.array((20.73, 10.86, 2.77))
    lamp = kit.material("lamp", (0.78, 0.78, 0.78), emission=light / light.max(), strength=light.max())

    wall("floor", [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)], white)
    wall("ceiling", [(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)], white)
    wall("back wall", [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)], white)
    wall("right wall", [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)], green)
    wall("left wall", [(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)], red)
    # The lamp lies in the ceiling's plane in the data; half a millimetre lower it has a side of its own.
    wall("light", [(343, 548.3, 227), (343, 548.3, 332), (213, 548.3, 332), (213, 548.3, 227)], lamp)
    block("short block", [(130, 65), (82, 225), (240, 272), (290, 114)], 165)
    block("tall block", [(423, 247), (265, 296), (314, 456), (472, 406)], 330)

    view = kit.camera(mm(278, 273, -800), mm(278, 273, 0), lens=35)
    view.data.sensor_width = view.data.sensor_height = 25
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 1024


@fixture
def closed_furnace():
    """Everything emits and reflects alike, also the block inside, so the light is the same everywhere."""
    glow = kit.material("glow", (0.5, 0.5, 0.5), emission=(1, 1, 1), strength=0.5)
    kit.add("room", kit.boxes("room", [((-1, -1.5, 0), (1, 1.5, 2.5))], glow, inward=True))
    kit.add("block", kit.boxes("block", [((-0.3, -0.4, 0.9), (0.4, 0.5, 1.5))], glow), turned=(0, 0, 0.5))
    kit.camera((0.8, -1.3, 2.2), (-0.2, 0.3, 1))


@fixture
def grey_lamp():
    """A cube room with a point lamp in the middle, all of one grey: the illuminance is known at every point."""
    grey = kit.material("grey", (2 / 3, 2 / 3, 2 / 3))
    kit.add("room", kit.boxes("room", [((-1.5, -1.5, 0), (1.5, 1.5, 3))], grey, inward=True))
    kit.point_lamp("lamp", (0, 0, 1.5), watts=4 * math.pi * 4.5)
    kit.camera((1.2, -1.2, 2.4), (-0.5, 0.5, 1.2), lens=20)


# ---- scenes that call for little ---------------------------------------------------------------------------------


@fixture
def grey_hall():
    """A grey empty hall under 24 soft lamps: nothing stands in the way of any light, and one colour channel does."""
    grey = kit.material("plaster", (0.5, 0.5, 0.5))
    kit.add("hall", kit.boxes("hall", [((0, 0, 0), (12, 8, 4))], grey, inward=True))
    for i in range(6):
        for j in range(4):
            kit.soft(kit.point_lamp(f"lamp {i + 1}.{j + 1}", (2 * i + 1, 2 * j + 1, 3.4), watts=30), radius=0.08)
    kit.camera((0.6, 0.6, 2.6), (9, 6, 1), lens=18)


@fixture
def lone_pedestal():
    """A convex block on show under 16 coloured soft lamps: no surface sees another, so no light bounces."""
    marble = kit.material("marble", (0.7, 0.66, 0.6))
    kit.add("pedestal", kit.boxes("pedestal", [((-0.6, -0.6, 0), (0.6, 0.6, 1.8))], marble))
    for i in range(16):
        turn = 2 * math.pi * i / 16
        colour = [0.6 + 0.4 * math.cos(turn + shift) for shift in (0, 2.1, 4.2)]
        at = (3 * math.cos(turn), 3 * math.sin(turn), 2.5)
        kit.soft(kit.point_lamp(f"lamp {i + 1}", at, watts=60, colour=colour), radius=0.1)
    kit.camera((3.2, -3.4, 2.6), (0, 0, 0.9))


@fixture
def sealed_hall():
    """A closed hall, double-sided as Blender's materials are by default; sun, sky and street lamps never get in."""
    walls = kit.material("walls", (0.7, 0.62, 0.5), double_sided=True)
    wood = kit.material("wood", (0.4, 0.25, 0.15), double_sided=True)
    kit.add("hall", kit.boxes("hall", [((0, 0, 0), (6, 4, 3))], walls, inward=True))
    tables = [((1 + 2 * i, 1.2, 0.4), (1.8 + 2 * i, 2.6, 0.8)) for i in range(2)]
    for number, table in enumerate(tables):
        kit.add(f"table {number + 1}", kit.boxes(f"table {number + 1}", [table], wood))
    for number, at in enumerate([(1.5, 2, 2.6), (4.5, 2, 2.6)]):
        kit.point_lamp(f"lamp {number + 1}", at, watts=80, colour=(1, 0.85, 0.6))
    for i in range(6):
        for side, y in (("south", -2), ("north", 6)):
            kit.soft(kit.point_lamp(f"street lamp {side} {i + 1}", (2.4 * i - 3, y, 4), watts=200), radius=0.15)
    kit.sun_lamp("sun", shining=(0.3, 0.5, -1), strength=4.0, angle=math.radians(0.53))
    bpy.context.scene["lightkiln"] = {"sky": [0.4, 0.6, 1.0], "sky_strength": 2.0}
    kit.camera((0.4, 0.4, 2.3), (4.5, 2.8, 0.6), lens=18)


# ---- rooms as artists make them -----------------------------------------------------------------------------------


@fixture
def window_room():
    """Walls have thickness and meet as separate objects; sun and sky come through one window."""
    plaster = kit.material("plaster", (0.8, 0.78, 0.74))
    boards = kit.material("floor boards", double_sided=True)
    kit.texture(boards, "Base Color", "boards", board_texture())
    wood = kit.material("wood", (0.38, 0.23, 0.12), double_sided=True)
    blue = kit.material("blue", (0.1, 0.2, 0.5), double_sided=True)

    # The room inside is x 0..5, y 0..4, z 0..2.7; the window is in the wall at x = 5.
    parts = {
        "floor": ([((-0.2, -0.2, -0.2), (5.2, 4.2, 0))], boards),
        "ceiling": ([((-0.2, -0.2, 2.7), (5.2, 4.2, 2.9))], plaster),
        "wall west": ([((-0.2, 0, 0), (0, 4, 2.7))], plaster),
        "wall south": ([((-0.2, -0.2, 0), (5.2, 0, 2.7))], plaster),
        "wall north": ([((-0.2, 4, 0), (5.2, 4.2, 2.7))], plaster),
        "table": (
            [((2.2, 0.8, 0.71), (3.8, 1.8, 0.75))]
            + [((x, y, 0), (x + 0.06, y + 0.06, 0.71)) for x in (2.25, 3.69) for y in (0.85, 1.69)],
            wood,
        ),
        "shelf": (
            [((0, y, 0), (0.35, y + 0.03, 1.9)) for y in (1.0, 2.37)]
            + [((0, 1.03, z), (0.35, 2.37, z + 0.03)) for z in (0.05, 0.5, 0.95, 1.4, 1.87)],
            wood,
        ),
        "books": (
            [((0.05, 1.1 + 0.07 * k, 0.98), (0.27, 1.15 + 0.07 * k, 1.2 + 0.03 * (k % 3))) for k in range(8)],
            blue,
        ),
        "crate": ([((1.0, 3.2, 0), (1.6, 3.8, 0.6))], wood),
        "small crate": ([((1.15, 3.3, 0.6), (1.5, 3.65, 0.95))], blue),
    }
    for name, (spans, of_material) in parts.items():
        kit.add(name, kit.boxes(name, spans, of_material, textured=of_material is boards))
    kit.add("wall east", kit.wall_with_hole("wall east", (5, 0, 0), (5.2, 4, 2.7), (1.2, 0.9), (2.8, 2.2), plaster))

    kit.sun_lamp("sun", shining=(-1, 0.25, -0.5), strength=4.0, colour=(1, 0.93, 0.82), angle=math.radians(0.53))
    bpy.context.scene["lightkiln"] = {"sky": [0.35, 0.55, 1.0], "sky_strength": 3.0}
    kit.camera((4.7, 0.4, 1.8), (0.9, 2.6, 0.6), lens=22)


def board_texture():
    """Eight boards of different browns with dark joints, 64 x 64."""
    rng = np.random.default_rng(1)
    rgba = np.ones((64, 64, 4))
    for board in range(8):
        rows = slice(board * 8, board * 8 + 8)
        rgba[rows, :, :3] = np.array((0.62, 0.47, 0.33)) * rng.uniform(0.8, 1.15)
        rgba[rows, rng.integers(64), :3] = 0.2
        rgba[board * 8, :, :3] = 0.2
    return rgba


@fixture
def corridor():
    """One smooth statue mesh shared by six nodes, under point and spot lamps."""
    plaster = kit.material("plaster", (0.75, 0.75, 0.72))
    stone = kit.material("stone", (0.35, 0.34, 0.33))
    marble = kit.material("marble", (0.8, 0.78, 0.75), double_sided=True)
    kit.add("corridor", kit.boxes("corridor", [((-1.2, 0, 0), (1.2, 9, 2.6))], plaster, inward=True))

    statue = kit.mesh("statue", *smooth_monkey(), marble, smooth=True)
    plinth = kit.boxes("plinth", [((-0.22, -0.22, 0), (0.22, 0.22, 0.9))], stone)
    for k in range(6):
        side = -1 if k % 2 else 1
        foot = kit.add(f"plinth {k + 1}", plinth, at=(side * 0.85, 1.2 + 1.3 * k, 0))
        kit.add(
            f"statue {k + 1}",
            statue,
            parent=foot,
            at=(0, 0, 1.17),
            turned=(0, 0, -side * math.pi / 2),
            scaled=(0.28 + 0.02 * k,) * 3,
        )

    for y in (2.2, 6.8):
        kit.point_lamp(f"ceiling lamp {y:.0f}", (0, y, 2.45), watts=20, colour=(1, 0.85, 0.65))
    for k in (1, 4):
        side = -1 if k % 2 else 1
        kit.spot_lamp(
            f"spot {k + 1}",
            (0, 1.2 + 1.3 * k, 2.5),
            (side * 0.85, 1.2 + 1.3 * k, 1.1),
            watts=35,
            cone=math.radians(50),
            blend=0.4,
        )
    kit.camera((0, 0.3, 1.6), (0, 6, 1.2), lens=24)


def smooth_monkey():
    """Blender's own test head, subdivided once: eyes stand free in open sockets, as in real models."""
    bpy.ops.mesh.primitive_monkey_add()
    head = bpy.context.object
    head.modifiers.new("smooth", "SUBSURF").levels = 1
    shape = head.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    vertices = [tuple(v.co) for v in shape.vertices]
    faces = [tuple(f.vertices) for f in shape.polygons]
    bpy.data.objects.remove(head)
    return vertices, faces


@fixture
def leaves():
    """Sun through leaves: cards whose texture is transparent outside the leaf (alphaMode MASK)."""
    stone = kit.material("stone", (0.6, 0.56, 0.5))
    wood = kit.material("wood", (0.3, 0.2, 0.12), double_sided=True)
    leaf = kit.material("leaf", double_sided=True)
    kit.alpha_mask(leaf, kit.texture(leaf, "Base Color", "leaf", leaf_texture()), cutoff=0.5)

    shell = [((-3, -3, -0.2), (3, 3, 0))]
    shell += [((-3, y, 0), (3, y + 0.2, 1.8)) for y in (-3, 2.8)] + [
        ((x, -2.8, 0), (x + 0.2, 2.8, 1.8)) for x in (-3, 2.8)
    ]
    kit.add("courtyard", kit.boxes("courtyard", shell, stone))
    frame = [((x, y, 0), (x + 0.1, y + 0.1, 2.3)) for x in (-1.5, 1.4) for y in (-1.5, 1.4)]
    frame += [((-1.7, y, 2.3), (1.7, y + 0.08, 2.42)) for y in (-1.5, -0.5, 0.5, 1.42)]
    kit.add("pergola", kit.boxes("pergola", frame, wood))

    rng = np.random.default_rng(2)
    vertices, faces, uvs = [], [], []
    for _ in range(72):
        middle = np.array((*rng.uniform(-1.6, 1.6, 2), 2.5 + rng.uniform(-0.12, 0.12)))
        turn, tilt = rng.uniform(0, 2 * math.pi), rng.uniform(-0.5, 0.5)
        along = 0.3 * np.array((math.cos(turn), math.sin(turn), tilt))
        across = 0.3 * np.array((-math.sin(turn), math.cos(turn), rng.uniform(-0.5, 0.5)))
        faces.append(range(len(vertices), len(vertices) + 4))
        vertices += [middle - along - across, middle + along - across, middle + along + across, middle - along + across]
        uvs += [(0, 0), (1, 0), (1, 1), (0, 1)]
    kit.add("leaves", kit.mesh("leaves", vertices, [tuple(face) for face in faces], leaf, uvs))

    kit.sun_lamp("sun", shining=(0.5, 0.35, -1), strength=3.5, colour=(1, 0.95, 0.86))
    kit.camera((-2.7, -0.9, 1.7), (1, 0.4, 0.9), lens=20)


def leaf_texture():
    """Five leaves around a stem, 64 x 64; green goes on under the transparent part, so that no dark rim shows."""
    y, x = np.mgrid[0:64, 0:64]
    px, py = (x - 31.5) / 32, (31.5 - y) / 32
    rgba = np.zeros((64, 64, 4))
    rgba[..., :3] = (0.24, 0.45, 0.13)
    for k, turn in enumerate(np.linspace(-1.9, 1.9, 5)):
        along = px * math.sin(turn) + (py + 0.25) * math.cos(turn)
        across = px * math.cos(turn) - (py + 0.25) * math.sin(turn)
        inside = np.abs(across) < 0.55 * along * (1 - along / 0.95)
        rgba[inside, :3] = np.array((0.22, 0.5, 0.12)) * (0.8 + 0.1 * k)
        rgba[inside, 3] = 1
    return rgba


# ---- what glTF files hold besides boxes ---------------------------------------------------------------------------


@fixture
def instances():
    """One mesh, many nodes: stretched, mirrored, and under parents that turn and squeeze it."""
    floor = kit.material("floor", (0.6, 0.6, 0.6))
    paint = kit.material("paint", (0.7, 0.35, 0.2), double_sided=True)
    kit.add("floor", kit.grid("floor", 1, 1, (8, 6), floor))
    # An angle piece: no mirror symmetry, so a mirrored copy that is treated as a plain one shows.
    angle = kit.boxes(
        "angle piece", [((0, 0, 0), (1, 0.4, 0.4)), ((0, 0, 0.4), (0.4, 0.4, 1)), ((0, 0.4, 0), (0.4, 0.7, 0.2))], paint
    )

    kit.add("plain", angle, at=(-3.2, -2, 0))
    kit.add("stretched", angle, at=(-1.5, -2, 0), scaled=(1.6, 0.5, 1.3))
    kit.add("mirrored", angle, at=(2.2, -2, 0), scaled=(-1, 1, 1))
    kit.add("mirrored thrice", angle, at=(3.4, -1.2, 1.2), scaled=(-0.8, -1.1, -1.2))
    turntable = kit.add("turntable", None, at=(0, 1, 0), turned=(0, 0, 0.6))
    squeezed = kit.add("squeezed", None, parent=turntable, at=(-1.5, 0, 0), scaled=(1, 0.6, 1.4))
    kit.add("nested", angle, parent=squeezed, turned=(0, 0, 0.8))
    child = kit.add(
        "nested mirrored", angle, parent=squeezed, at=(2.5, 0.4, 0), turned=(0.2, 0, -0.5), scaled=(1, -1, 0.7)
    )
    kit.add("grandchild", angle, parent=child, at=(0, 0, 1.1), turned=(0, 0.3, 0), scaled=(0.5, 0.5, 0.5))
    kit.sun_lamp("sun", shining=(0.4, 0.6, -1), strength=2.0)
    kit.point_lamp("lamp", (0, -0.5, 2.6), watts=120, colour=(0.8, 0.9, 1))
    kit.camera((-4.5, -7, 5.5), (0, -0.3, 0.3), lens=32)


@fixture
def emissive_texture():
    """The only light is a picture on a panel: red and blue fields around a dark cross."""
    walls = kit.material("walls", WHITE)
    screen = kit.material("screen", (0, 0, 0), emission=(1, 1, 1), strength=6.0)
    y, x = np.mgrid[0:64, 0:64]
    picture = np.zeros((64, 64, 4))
    picture[..., 3] = 1
    picture[..., 0] = x < 26
    picture[..., 2] = x >= 38
    picture[(y >= 28) & (y < 36), :3] = 0
    picture[:8, :, :3] = 1
    kit.texture(screen, "Emission Color", "picture", picture)

    kit.add("room", kit.boxes("room", [((-2, 0, 0), (2, 3, 2.5))], walls, inward=True))
    panel = [(-1, 2.98, 0.7), (1, 2.98, 0.7), (1, 2.98, 1.9), (-1, 2.98, 1.9)]
    kit.add("panel", kit.polygon("panel", panel, screen, facing=(0, 0, 1.3), uvs=[(0, 0), (1, 0), (1, 1), (0, 1)]))
    kit.camera((0, 0.2, 1.4), (0, 3, 1.2), lens=20)


@fixture
def double_sided():
    """Thin walls, double-sided: a room with the lamp, one sealed off, one behind a doorway, and a free sheet."""
    shell = kit.material("shell", (0.7, 0.7, 0.7))
    sheet = kit.material("sheet", (0.75, 0.3, 0.25), double_sided=True)
    kit.add("shell", kit.boxes("shell", [((0, 0, 0), (6, 3, 2.5))], shell, inward=True))
    sealed = [(2, 0, 0), (2, 3, 0), (2, 3, 2.5), (2, 0, 2.5)]
    kit.add("sealed divider", kit.polygon("sealed divider", sealed, sheet, facing=(0, 1.5, 1.2)))
    doorway = [(4, 0, 0), (4, 1, 0), (4, 1, 2), (4, 2, 2), (4, 2, 0), (4, 3, 0), (4, 3, 2.5), (4, 1, 2.5), (4, 0, 2.5)]
    pieces = [(0, 1, 7, 8), (2, 3, 6, 7), (3, 4, 5, 6)]
    kit.add("divider with doorway", kit.mesh("divider with doorway", doorway, pieces, sheet))
    kit.add("free sheet", kit.grid("free sheet", 4, 4, (0.8, 1.0), sheet), at=(2.7, 2.2, 0.9), turned=(1.1, 0.2, 0.4))
    kit.point_lamp("lamp", (3, 1.2, 2.1), watts=80)
    kit.camera((5.8, 0.3, 1.8), (3, 1.7, 0.9), lens=20)


@fixture
def blend_glass():
    """A lamp over a floor; a tinted pane (alphaMode BLEND) covers one half of the light's way."""
    floor = kit.material("floor", (0.5, 0.5, 0.5))
    glass = kit.material("glass", (0.2, 0.7, 0.9), double_sided=True, alpha=0.4)
    kit.add("floor", kit.grid("floor", 1, 1, (4, 4), floor))
    pane = [(0, -2, 1), (2, -2, 1), (2, 2, 1), (0, 2, 1)]
    kit.add("pane", kit.polygon("pane", pane, glass, facing=(1, 0, 2)))
    kit.point_lamp("lamp", (0, 0, 2), watts=4 * math.pi * 4)
    kit.camera((-3, -3, 2.5), (0.3, 0, 0.4))


@fixture
def skinned():
    """A bent arm (skin), a swelling pad (shape keys), moving things (actions), and a property on everything."""
    floor = kit.material("floor", (0.6, 0.6, 0.6))
    cloth = kit.material("cloth", (0.2, 0.45, 0.3), double_sided=True)
    rubber = kit.material("rubber", (0.5, 0.15, 0.1), double_sided=True)
    ground = kit.add("ground", kit.grid("ground", 2, 2, (5, 5), floor))

    bones = bpy.data.armatures.new("bones")
    arm = kit.add("arm", bones, at=(-1, 0, 0))
    bpy.context.view_layer.objects.active = arm
    bpy.ops.object.mode_set(mode="EDIT")
    lower = bones.edit_bones.new("lower")
    lower.head, lower.tail = (0, 0, 0), (0, 0, 1)
    upper = bones.edit_bones.new("upper")
    upper.head, upper.tail, upper.parent, upper.use_connect = (0, 0, 1), (0, 0, 2), lower, True
    bpy.ops.object.mode_set(mode="OBJECT")
    bones.bones["upper"]["joint"] = "elbow"

    profile = [(0, 0)] + [(0.22 - 0.05 * k / 12, 2 * k / 12) for k in range(13)] + [(0, 2)]
    sleeve = kit.add("sleeve", kit.lathe("sleeve", profile, 16, cloth), parent=arm)
    for name, sign in (("lower", -1), ("upper", 1)):
        group = sleeve.vertex_groups.new(name=name)
        for vertex in sleeve.data.vertices:
            weight = min(1, max(0, 0.5 + sign * (vertex.co.z - 1) / 0.6))
            if weight > 0:
                group.add([vertex.index], weight, "REPLACE")
    sleeve.modifiers.new("skin", "ARMATURE").object = arm
    bend = arm.pose.bones["upper"]
    bend.rotation_mode = "QUATERNION"
    for frame, turn in ((1, 0.0), (20, 1.2)):
        bend.rotation_quaternion = (math.cos(turn / 2), math.sin(turn / 2), 0, 0)
        bend.keyframe_insert("rotation_quaternion", frame=frame)
    arm.animation_data.action.name = "bend"

    pad = kit.add("pad", kit.grid("pad", 8, 8, (1.2, 1.2), rubber), at=(1, 0, 0.5))
    pad.shape_key_add(name="Basis")
    for name, shape in (
        ("dome", lambda x, y: math.exp(-6 * (x * x + y * y))),
        ("wave", lambda x, y: 0.2 * math.sin(6 * x)),
    ):
        key = pad.shape_key_add(name=name)
        for vertex, point in zip(pad.data.vertices, key.data):
            point.co.z = 0.6 * shape(vertex.co.x, vertex.co.y)
    swell = pad.data.shape_keys.key_blocks["dome"]
    for frame, value in ((1, 0.0), (20, 1.0)):
        swell.value = value
        swell.keyframe_insert("value", frame=frame)
    pad.data.shape_keys.animation_data.action.name = "swell"

    lift = kit.add("lift", kit.boxes("lift", [((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2))], rubber), at=(0, 1.5, 0.8))
    for frame, height in ((1, 0.8), (20, 1.6)):
        lift.location.z = height
        lift.keyframe_insert("location", frame=frame)
    lift.animation_data.action.name = "bounce"

    lamp = kit.point_lamp("lamp", (0, -1, 3), watts=150)
    view = kit.camera((3, -4, 2.5), (0, 0, 0.8))
    owners = [ground, arm, sleeve, pad, lift, lamp, view, floor, cloth, rubber]
    owners += [ground.data, sleeve.data, pad.data, lift.data, lamp.data, view.data, bones, bpy.context.scene]
    for number, owner in enumerate(owners):
        owner["note"] = f"kept {number}"
        owner["numbers"] = [number, 0.1, -2.5]
    lift["nested"] = {"flag": True, "deep": {"text": "grüße", "count": 3}}
    bpy.context.scene.frame_set(1)


@fixture
def unlit_and_names():
    """Names and materials out of the ordinary, and objects that ask for their own treatment in the bake."""
    floor = kit.material("Fußboden", (0.6, 0.6, 0.6))
    metal = kit.material("metal", (0.9, 0.8, 0.5), double_sided=True, metallic=1.0)
    grey = kit.material("grey", (0.5, 0.5, 0.5), double_sided=True)
    painted = kit.material("painted", double_sided=True)
    kit.vertex_colours(painted, "paint")
    sign = kit.unlit_material("sign", (1.0, 0.6, 0.1))

    cube = [((-0.3, -0.3, 0), (0.3, 0.3, 0.6))]
    kit.add("Fußboden", kit.grid("Fußboden", 1, 1, (6, 4), floor))
    kit.add("金属の箱", kit.boxes("金属の箱", cube, metal), at=(-2.2, 0, 0))
    sheet = kit.grid("lampe à huile", 6, 6, (1, 1), painted)
    colours = sheet.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
    for vertex, colour in zip(sheet.vertices, colours.data):
        colour.color = (0.5 + vertex.co.x * 0.9, 0.5 + vertex.co.y * 0.9, 0.2, 1)
    kit.add("lampe à huile", sheet, at=(-1, 0, 0.4), turned=(0.4, 0, 0))
    kit.add("вывеска", kit.boxes("вывеска", cube, sign), at=(0, 0.6, 0))
    left_out = kit.add("not baked 🚫", kit.boxes("not baked", cube, grey), at=(1, 0, 0))
    left_out["lightkiln"] = {"bake": False}
    fine = kit.add("twice as fine", kit.boxes("twice as fine", cube, grey), at=(2.2, 0, 0))
    fine["lightkiln"] = {"density": 2.0}
    kit.sun_lamp("Sonne ☀", shining=(0.3, 0.5, -1), strength=2.5)
    kit.camera((0, -4.5, 2.6), (0, 0, 0.3))


# ---- the command --------------------------------------------------------------------------------------------------


def main():
    # Under "blender -b -P" our arguments follow a lone "--"; under plain Python they are all of argv.
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    ask = argparse.ArgumentParser(description="Builds the fixture scenes in Blender and exports them as GLB.")
    ask.add_argument("names", nargs="*", metavar="NAME", help=f"which to build (default: all of {', '.join(FIXTURES)})")
    ask.add_argument(
        "--out", type=Path, default=Path(__file__).resolve().parent.parent / "fixtures", help="folder to write to"
    )
    options = ask.parse_args(own)
    if unknown := [name for name in options.names if name not in FIXTURES]:
        ask.error(f"no fixture is called {', '.join(unknown)}; there are {', '.join(FIXTURES)}")

    options.out.mkdir(parents=True, exist_ok=True)
    print(f"{'fixture':<20}{'objects':>8}{'triangles':>11}{'bytes':>9}")
    for name in options.names or FIXTURES:
        scene = kit.new_scene()
        FIXTURES[name]()
        bpy.context.view_layer.update()
        path = options.out / f"{name}.glb"
        # Applying modifiers would also apply away shape keys, so the one scene that has them keeps them.
        kit.export(path, export_apply=not bpy.data.shape_keys)
        triangles = sum(
            len(face.vertices) - 2 for thing in scene.objects if thing.type == "MESH" for face in thing.data.polygons
        )
        print(f"{name:<20}{len(scene.objects):>8}{triangles:>11}{path.stat().st_size:>9}", flush=True)


if __name__ == "__main__":
    main()
