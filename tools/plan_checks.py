"""What `check_plan.py` asks of effects that hang on what there is: lamps, materials, images, meshes."""

import re

import numpy as np

from plan_rays import BACK, FRONT, Rays, skins
from plan_scene import CLEAR, FULL, HOLES, PARTIAL

# Names that the plan keeps of each kind.
MOST_NAMES = 16
# Random walks a claim, and how often each is turned.
WALKS, BOUNCES = 600, 6
# Degrees a corner's normal leaves its plane: lightkiln's border is half a degree, Blender packs normals into 16 bits.
SURELY_FLAT, SURELY_SMOOTH = 0.2, 1.5


class Check:
    """One plan beside one scene."""

    def __init__(self, findings, scene):
        self.findings = {finding["effect"]: finding for finding in findings}
        self.scene, self.rays, self.problems = scene, Rays(scene), []
        self.idle_names = set(self.names("far-lamps")) if self.reason("far-lamps")[:1].isdigit() else set()
        self.backs = set(self.names("back-faces")) if self.is_on("back-faces") else set()
        self.all_backs = len(self.backs) == MOST_NAMES
        closing = set(self.names("light-between-rooms"))
        named = (skin for thing in scene.things if thing.label in closing for skin in skins(thing))
        self.shells = [skin for skin in named if skin.closed and skin.opaque]

    def is_on(self, effect):
        return self.findings[effect]["on"]

    def reason(self, effect):
        return self.findings[effect]["reason"]

    def names(self, effect):
        return self.findings[effect]["evidence"]["names"]

    def must(self, effect, true, truth):
        if not true:
            state = "on" if self.is_on(effect) else "off"
            self.problems.append(f'{effect} {state}: "{self.reason(effect)}": {truth}')

    def told(self, effect):
        """The number that the reason begins with."""
        number = re.match(r"[\d,]+", self.reason(effect))
        return int(number[0].replace(",", "")) if number else None

    def counted(self, effect, labels, what, most=None):
        """The reason's number and names are those of Blender's objects; with `most` the labels are the fewest."""
        known, least = set(labels), len(labels)
        most = labels if most is None else most
        self.must(
            effect,
            self.told(effect) is not None and least <= self.told(effect) <= len(most),
            f"Blender has {least} {what}: {sorted(map(str, known))[:4]}",
        )
        told = set(self.names(effect))
        self.must(effect, told <= set(most), f"not so in Blender: {sorted(told - set(most))[:4]}")
        if len(told) < MOST_NAMES:
            self.must(effect, known <= told, f"so too in Blender: {sorted(map(str, known - told))[:4]}")

    def things(self, test):
        return [thing.label for thing in self.scene.things if any(test(part) for part in thing.parts)]

    def is_lit(self, part, side):
        """Whether the plan says that a side takes light, as far as it names them."""
        if not part.takes_light():
            return False
        return side == FRONT or part.look.two_sided and (self.all_backs or part.thing.label in self.backs)

    def lit_sides(self):
        return [(part, side) for part in self.scene.parts for side in (FRONT, BACK) if self.is_lit(part, side)]

    def lamps(self):
        return [lamp for lamp in self.scene.lamps if lamp.shines() and lamp.label not in self.idle_names]

    def room_of(self, at):
        """The sealed shells that hold a point; none that is far away."""
        return [] if at is None else [number for number, skin in enumerate(self.shells) if skin.holds(at[None])]

    def points(self, sides, count):
        """Random points of sides, some of each."""
        for part, side in sides:
            yield from ((part, side, *sample) for sample in self.rays.samples(part, side, max(2, count // len(sides))))


def check_emission(check):
    glow = check.things(lambda part: part.emits())
    glow += [label for label, _, lamp in check.scene.area_lamps if lamp.get("power", 0) > 0 and max(lamp.get("color", [1])) > 0]
    images = check.things(lambda part: part.emits() and any(image for image, _ in part.look.emission.images))
    for effect, labels in (("area-lights", glow), ("textured-emission", images)):
        if check.is_on(effect):
            check.counted(effect, labels, "such objects")
        else:
            check.must(effect, not labels, f"{labels[:4]} do in Blender")


def check_lamps(check):
    kinds = {"point-lamps": "POINT", "spot-lamps": "SPOT", "suns": "SUN", "soft-suns": "SUN", "soft-lamps": "POINT SPOT"}
    for effect, kind in kinds.items():
        soft = effect.startswith("soft")
        all_of_kind = [lamp for lamp in check.scene.lamps if lamp.kind in kind.split() and (lamp.size > 0 or not soft)]
        shining = [lamp.label for lamp in all_of_kind if lamp in check.lamps()]
        if check.is_on(effect):
            check.counted(effect, shining, "that shine")
        elif check.told(effect) is not None:
            check.must(effect, not shining, f"{shining[:4]} are not said to be without effect elsewhere")
            check.counted(effect, [lamp.label for lamp in all_of_kind], "in all")
        else:
            check.must(effect, not all_of_kind, f"Blender has {len(all_of_kind)}")


IDLE = r"([\d,]+) lamps? (without power|sealed off|whose light ends|behind everything)[^:]*: (.*?)(?=; \d+ lamps? |$)"


def check_idle_lamps(check):
    effect, scene = "far-lamps", check.scene
    said = check.reason(effect)
    if said.startswith("the scene has no lamps"):
        but_area_lamps = said.endswith("but area lamps")
        check.must(
            effect,
            not scene.lamps and bool(scene.area_lamps) == but_area_lamps,
            f"Blender has {len(scene.lamps)}, and {len(scene.area_lamps)} area lamps",
        )
        return
    sides = check.lit_sides()
    for lamp in check.lamps():
        check.must(effect, not sides or lights_something(check, lamp, sides), f"'{lamp.name}' lights nothing in Blender")
    for count, why, names in re.findall(IDLE, check.reason(effect)):
        named = re.findall(r"'(.*?)'(?:, |$)", names)
        mine = [lamp for lamp in scene.lamps if lamp.label in named]
        check.must(effect, "..." in names or len(mine) >= int(count), f"{len(mine)} lamps are called {named}")
        for lamp in mine:
            if why == "without power":
                check.must(effect, not lamp.shines(), f"'{lamp.name}' has power in Blender")
            elif why == "sealed off":
                check.must(effect, not meets_lightmap(check, lamp), f"light of '{lamp.name}' finds a lightmapped side")
            elif why == "whose light ends":
                reached = any(lamp.towards(at) for _, _, at, _ in check.points(sides, WALKS))
                check.must(effect, not reached, f"'{lamp.name}' reaches lit sides")
            else:
                ways = ((normal, lamp.towards(at)) for _, _, at, normal in check.points(sides, WALKS))
                check.must(
                    effect,
                    not any(way and way[0] @ normal > 1e-3 for normal, way in ways),
                    f"'{lamp.name}' is in front of lit sides",
                )


def lights_something(check, lamp, sides):
    """Whether light of a lamp meets a lit side: by rays from the lamp, for it may be near or narrow, and towards it."""
    for _ in range(WALKS if lamp.kind != "SUN" else 0):
        cosine = 1 - check.rays.numbers.random() * (1 - np.cos(lamp.half_cone))
        turn = check.rays.numbers.normal(size=3)
        across = np.cross(lamp.along, turn) / np.linalg.norm(np.cross(lamp.along, turn))
        way = cosine * lamp.along + np.sqrt(max(1 - cosine**2, 0)) * across
        hit = check.rays.cast(lamp.at, way, lamp.reach)
        while hit and not check.is_lit(hit[0], hit[1]) and hit[0].opacity != FULL:
            hit = check.rays.cast(hit[2] + check.rays.near * way, way)
        if hit and check.is_lit(hit[0], hit[1]):
            return True
    return any(check.rays.sees_lamp(at, normal, lamp) for _ in range(4) for _, _, at, normal in check.points(sides, WALKS))


def meets_lightmap(check, lamp):
    for _ in range(WALKS):
        start = check.rays.numbers.normal(size=3)
        start /= np.linalg.norm(start)
        at = lamp.at - (0 if lamp.kind != "SUN" else 4 * check.rays.size) * lamp.along
        if any(hit and is_lightmapped_front(hit) for hit in check.rays.walk(at, start, BOUNCES)):
            return True
    return False


def is_lightmapped_front(hit):
    return hit[0].thing.lightmapped and hit[1] == FRONT and hit[0].takes_light()


def check_alpha(check):
    for effect, mode, kept in (("alpha-test", "MASK", HOLES), ("tinted-shadows", "BLEND", PARTIAL)):
        holding = [part for part in check.scene.parts if part.look.mode == mode]
        labels = check.things(lambda part: part.look.mode == mode and part.opacity in (kept, None))
        if check.is_on(effect):
            check.counted(effect, labels, "such objects")
            continue
        check.must(effect, not labels, f"{labels[:4]} let light through in Blender")
        if check.reason(effect).startswith("no material uses"):
            check.must(effect, not holding, f"'{holding[0].look.name if holding else ''}' does in Blender")
        else:
            check.must(effect, bool(holding), "no material does in Blender")
            clear = [part.look.name for part in holding if part.opacity == CLEAR]
            whole = check.reason(effect).startswith("what uses alphaMode MASK is a hole as a whole")
            check.must(effect, bool(clear) == whole or mode == "BLEND", f"{clear[:4]} are one hole")


def check_colours(check):
    scene, effect = check.scene, "colour-channels"
    coloured = [lamp.name for lamp in scene.lamps if np.ptp(lamp.colour) > 0]
    coloured += [part.look.name for part in scene.parts if part.is_coloured()]
    coloured += [label for label, _, lamp in scene.area_lamps if np.ptp(lamp.get("color", [1])) > 0]
    coloured += ["the sky"] if isinstance(scene.sky, str) or scene.sky and np.ptp(scene.sky[:3]) > 0 else []
    if check.is_on(effect):
        check.must(effect, coloured, "everything is grey in Blender")
    else:
        really = [
            name
            for name in coloured
            if name
            not in {part.look.name for part in scene.parts if not part.reflects() and not part.emits() and not part.look.blends}
        ]
        check.must(effect, not really, f"{really[:4]} are coloured in Blender")


def check_surfaces(check):
    effect = "albedo-textures"
    labels = check.things(lambda part: part.takes_light() and any(image and image.size[0] for image, _ in part.look.base.images))
    if check.is_on(effect):
        check.counted(effect, labels, "lit objects with a colour image")
    else:
        check.must(effect, not labels or set(labels) <= set(check.names("unseen-surfaces")), f"{labels[:4]} have one in Blender")
    effect = "smooth-normals"
    surely = check.things(lambda part: part.takes_light() and part.smooth > SURELY_SMOOTH)
    maybe = check.things(lambda part: part.takes_light() and part.smooth > SURELY_FLAT)
    if check.is_on(effect):
        check.counted(effect, surely, "smooth objects", maybe)
    else:
        check.must(
            effect, not surely or set(surely) <= set(check.names("unseen-surfaces")), f"{surely[:4]} are smooth in Blender"
        )
    effect = "instancing"
    uses = [thing.mesh_number for thing in check.scene.things]
    shared = {mesh for mesh in uses if uses.count(mesh) > 1}
    if check.is_on(effect):
        check.must(
            effect, check.told(effect) == len(shared), f"several of Blender's objects are made of each of {len(shared)} meshes"
        )
    else:
        check.must(effect, not shared, f"several of Blender's objects are made of each of {len(shared)} meshes")


def check_what_there_is(check):
    for part in (check_emission, check_lamps, check_idle_lamps, check_alpha, check_colours, check_surfaces):
        part(check)
