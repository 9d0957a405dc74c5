"""What `check_plan.py` asks of effects that hang on where light gets: sky, shadows, backs, rooms, bounces."""

import re

import numpy as np

from plan_checks import BOUNCES, MOST_NAMES, WALKS, is_lightmapped_front
from plan_rays import BACK, FRONT, inside, skins

# Sides of triangles that are asked one by one, and skins in which something is looked for.
MOST_SIDES, MOST_SKINS = 3000, 40


def check_sky(check):
    effect, scene = "sky", check.scene
    if check.reason(effect) == "the sky is black":
        check.must(effect, scene.sky is None, f"the scene's property says {scene.sky}")
        return
    check.must(effect, scene.sky is not None, "the scene has none")
    if not check.is_on(effect):
        fronts = [(part, FRONT) for part in scene.parts if part.thing.lightmapped and part.takes_light()]
        for part, _, at, normal in check.points(fronts, WALKS):
            if None in check.rays.walk(at, normal, BOUNCES):
                check.must(effect, False, f"a walk from '{part.thing.name}' gets out")
                return


def check_shadows(check):
    effect, reason, rays = "shadows", check.reason("shadows"), check.rays
    check.must("penumbras", check.is_on("penumbras") == check.is_on("shadows"), "shadows and their borders go together")
    sides = check.lit_sides()
    emitters = [part for part in check.scene.parts if part.emits()]
    glow = check.is_on("area-lights")
    if reason == "no lamp and no surface sends light":
        check.must(effect, not check.lamps() and not emitters and not glow, "something does in Blender")
        return
    if reason == "nothing takes light":
        check.must(effect, not sides, f"'{sides[0][0].thing.name if sides else ''}' does")
        return
    triangles = [(part, side, triangle) for part, side in sides for triangle in range(len(part.corners))]
    told = re.match(r"([\d,]+) of ([\d,]+) sides", reason)
    most = int(told[1].replace(",", "")) if told else 0 if not check.is_on(effect) else len(triangles)
    if told and not check.names("unseen-surfaces"):
        every, fronts = int(told[2].replace(",", "")), sum(side == FRONT for _, side, _ in triangles)
        check.must(
            effect,
            fronts <= every <= len(triangles) + 2 * check.scene.dropped,
            f"Blender has {fronts} fronts and {len(triangles) - fronts} backs that may take light",
        )
    if most >= len(triangles):
        return
    count = min(len(triangles), MOST_SIDES)
    some = [triangles[k] for k in rays.numbers.choice(len(triangles), count, replace=False)]
    shaded = [row for row in some if row[0].areas[row[2]] > 0 and is_shaded(check, emitters, row, reason)]
    names = sorted({part.thing.name for part, _, _ in shaded})
    check.must(effect, len(shaded) <= most, f"of {len(shaded)} sides rays find something in the way, in {names[:4]}")


def is_shaded(check, emitters, row, reason):
    """Whether rays from a side of a triangle to the lights meet something; or any rays, where nothing is said to be in front."""
    for _ in range(4):
        at, normal = check.rays.sample(*row)
        if check.rays.is_touched(at - check.rays.near * normal, row[0]):
            continue
        if reason == "nothing stands in front of any surface":
            ways = [(check.rays.around(normal), np.inf)]
        else:
            ways = ways_to_lights(check, emitters, at)
        if any(is_blocked(check.rays, at, normal, *way) for way in ways):
            return True
    return False


def ways_to_lights(check, emitters, at):
    """Ways to the lights of the sealed room that a point is in: no others count there."""
    here = check.room_of(at)
    for lamp in check.lamps():
        way = lamp.towards(at)
        if way and check.room_of(lamp.at if lamp.kind != "SUN" else None) == here:
            yield way
    for part in emitters:
        for target, front in check.rays.samples(part, FRONT, 1):
            distance = np.linalg.norm(target - at)
            faces = (at - target) @ front > 0 or part.look.two_sided
            if distance > 10 * check.rays.near and faces and check.room_of(target) == here:
                yield (target - at) / distance, distance


def is_blocked(rays, at, normal, way, distance):
    """Leaves out what grazes, and what begins or ends at a contact."""
    near = 10 * rays.near
    hit = rays.cast(at, way, distance - near) if way @ normal > 1e-2 else None
    return hit is not None and hit[4] > near


def check_backs(check):
    effect, reason, scene = "back-faces", check.reason("back-faces"), check.scene
    two_sided = check.things(lambda part: part.look.two_sided and part.takes_light())
    if check.is_on(effect):
        told = set(check.names(effect))
        check.must(effect, told <= set(two_sided), f"{sorted(told - set(two_sided))[:4]} are not double-sided in Blender")
        named = two_sided if len(told) == MOST_NAMES else [label for label in two_sided if label in told]
        check.must(effect, check.told(effect) <= len(named), f"Blender has {len(named)} double-sided objects of these names")
        check_why_back(check)
    elif reason == "no material is double-sided":
        check.must(effect, not two_sided, f"{two_sided[:4]} are in Blender")
    else:
        dropped = [thing for thing in scene.things if any(part.look.two_sided and part.takes_light() for part in thing.parts)]
        if reason.startswith("every double-sided object is closed"):
            for thing in dropped:
                broken = [skin for skin in skins(thing) if not skin.closed or skin.volume <= 0]
                check.must(effect, not broken, f"'{thing.name}' is not so in Blender")
        backs = [(part, BACK) for thing in dropped for part in thing.parts if part.look.two_sided and part.takes_light()]
        for part, _, at, normal in check.points(backs, WALKS):
            found = light_found(check, part.thing, at, normal)
            if found and (found[1] or reason.startswith("every")):
                check.must(effect, False, f"light finds a way behind '{part.thing.name}': {found[0]}")
                return


def light_found(check, thing, at, normal):
    """What a walk from a back comes upon that shines, other backs of the same thing aside, and whether it met something
    lightmapped on its way."""
    met = False
    for hit in check.rays.walk(at, normal, BOUNCES):
        if hit is None:
            return "it gets out", met
        met |= is_lightmapped_front(hit)
        if hit[0].emits() and (hit[1] == FRONT or hit[0].look.two_sided and hit[0].thing is not thing):
            return f"'{hit[0].thing.name}' shines", met
        for lamp in check.scene.lamps:
            if lamp.shines() and check.rays.sees_lamp(hit[2] + check.rays.near * hit[3], hit[3], lamp):
                return f"'{lamp.name}' is seen", met
    return None


def check_why_back(check):
    """The reason for the first object's back, in brackets, where Blender can tell."""
    why = re.search(r"\('(.*)': (.*)\)$", check.reason("back-faces"))
    things = [thing for thing in check.scene.things if why and thing.label == why[1]]
    all_skins = [skin for thing in things for skin in skins(thing)]
    tests = {
        "not closed": lambda skin: skin.open_edges > 0,
        "more than two faces meet at an edge, or neighbours face opposite ways": lambda skin: skin.tangled,
        "faces inward or encloses nothing": lambda skin: (
            skin.closed and skin.volume <= 1e-4 * np.ptp(skin.thing.local.reshape(-1, 3), axis=0).max() ** 3
        ),
        "lets light through": lambda skin: not skin.opaque,
    }
    if why and why[2] in tests:
        check.must("back-faces", any(map(tests[why[2]], all_skins)), "no part of it is so in Blender")


def check_rooms(check):
    effect, scene = "unseen-surfaces", check.scene
    if check.told(effect) is not None:
        named = [thing for thing in scene.things if thing.label in check.names(effect)]
        check.must(
            effect,
            len(named) >= check.told(effect) or len(check.names(effect)) == MOST_NAMES,
            f"Blender has {len(named)} objects of these names",
        )
        for thing in named:
            check.must(
                effect,
                any(side_is_sealed(check, thing, side) for side in (FRONT, BACK)),
                f"walks from both sides of '{thing.name}' meet something lightmapped",
            )
    effect = "light-between-rooms"
    if check.told(effect) is not None:
        closed = check.shells
        check.must(
            effect,
            {skin.thing.label for skin in closed} == set(check.names(effect)),
            f"closed and opaque in Blender: {sorted({s.thing.name for s in closed})[:4]}",
        )
        for skin in closed[:MOST_SKINS]:
            check.must(effect, stays_inside(check, skin), f"walks get out of '{skin.thing.name}'")
        holding = [
            skin
            for skin in closed
            if skin.volume < 0 or inside(scene, skin) or any(p.look.two_sided and p.emits() for p in skin.thing.parts)
        ]
        check.must(
            effect,
            check.told(effect) <= len(holding) or len(check.names(effect)) == MOST_NAMES,
            f"of {len(closed)} closed things in Blender {len(holding)} have anything inside",
        )
    else:
        every = sorted(
            (skin for thing in scene.things for skin in skins(thing) if skin.closed and len(skin.triangles) > 3),
            key=lambda s: -abs(s.volume),
        )
        for skin in every[:MOST_SKINS]:
            held = "its own front" if skin.volume < 0 and skin.opaque else inside(scene, skin)
            check.must(
                effect,
                not held,
                f"'{held}' is inside of '{skin.thing.name}', which is closed"
                + ("" if skin.opaque else " and lets light through"),
            )


def side_is_sealed(check, thing, side):
    sides = [(part, side) for part in thing.parts if part.takes_light()]
    walks = (check.rays.walk(at, normal, BOUNCES) for _, _, at, normal in check.points(sides, WALKS // 4))
    return sides and not any(hit and is_lightmapped_front(hit) for walk in walks for hit in walk)


def stays_inside(check, skin):
    rays, thing = check.rays, skin.thing
    for triangle in rays.numbers.choice(skin.triangles, 60):
        a, b, c = thing.world[triangle]
        normal = np.cross(b - a, c - a) * (1 if skin.volume < 0 else -1)
        normal /= max(np.linalg.norm(normal), 1e-300)
        at = (a + b + c) / 3 + rays.near * normal
        for _ in range(BOUNCES):
            # A step off a face may lead through the next one, where they meet sharply: such a walk tells nothing.
            if not skin.holds(at[None]):
                break
            way = rays.around(normal)
            hit = rays.cast(at, way)
            if hit is None and rays.escapes(at, way):
                return False
            if hit is None:
                break
            at, normal = hit[2] + rays.near * hit[3], hit[3]
    return True


def check_bounces(check):
    effect, reason, scene = "bounces", check.reason("bounces"), check.scene
    labels = check.things(lambda part: part.reflects())
    sealed = set(check.names("unseen-surfaces"))
    if check.is_on(effect):
        check.counted(effect, [label for label in labels if label not in sealed], "reflecting objects", labels)
    elif reason == "every surface is black":
        check.must(effect, set(labels) <= sealed, f"{labels[:4]} reflect in Blender")
    elif reason == "nothing sends light":
        lights = [lamp.name for lamp in check.lamps()] + check.things(lambda part: part.emits())
        check.must(effect, not lights and not (scene.sky and check.is_on("sky")), f"{lights[:4]} do in Blender")
    elif reason == "no surface sees another":
        sides = [(part, side) for part, side in check.lit_sides() if part.reflects()]
        for part, _, at, normal in check.points(sides, WALKS):
            hit = check.rays.cast(at, check.rays.around(normal))
            check.must(
                effect,
                hit is None or hit[4] < 10 * check.rays.near,
                f"'{part.thing.name}' sees '{hit[0].thing.name if hit else ''}'",
            )
            if hit:
                break
    wanted = check.is_on("bounces") or check.is_on("sky")
    check.must("final-gather", check.is_on("final-gather") == wanted, "it goes with bounces and sky")


def check_where_light_gets(check):
    for part in (check_sky, check_shadows, check_backs, check_rooms, check_bounces):
        part(check)
