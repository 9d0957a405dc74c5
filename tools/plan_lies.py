"""False plans, for `check_plan.py --lies`: what is on is said to be off, each with the words that would say so, and counts are one more."""

import copy
import re

OFF = {
    "area-lights": ["no material emits light"],
    "textured-emission": ["no material emits through an image"],
    "point-lamps": ["the scene has no point lamp", "{n} without effect: {names}"],
    "spot-lamps": ["the scene has no spot lamp", "{n} without effect: {names}"],
    "suns": ["the scene has no sun", "{n} without effect: {names}"],
    "soft-suns": ["the scene has no sun with an angular size"],
    "soft-lamps": ["the scene has no lamp with a radius"],
    "sky": ["the sky is black", "everything lightmapped is sealed in: {thing}"],
    "shadows": [
        "no lamp and no surface sends light",
        "nothing takes light",
        "nothing stands in front of any surface",
        "nothing stands between the lights and any surface",
    ],
    "penumbras": ["no shadows: nothing stands in front of any surface"],
    "alpha-test": ["no material uses alphaMode MASK", "no image of a material with alphaMode MASK has a hole"],
    "tinted-shadows": ["no material uses alphaMode BLEND", "all that uses alphaMode BLEND is opaque"],
    "back-faces": [
        "no material is double-sided",
        "every double-sided object is closed and faces outward: {names}",
        "no back of a double-sided object is seen by anything lightmapped",
    ],
    "bounces": ["nothing sends light", "every surface is black", "no surface sees another"],
    "final-gather": ["no light but straight from lamps: every surface is black"],
    "colour-channels": ["everything is grey: one channel does"],
    "albedo-textures": ["no lit material has a colour image"],
    "smooth-normals": ["all objects are shaded flat"],
    "instancing": ["no mesh stands in several places"],
}
IDLE = [
    "without power",
    "sealed off from everything that is lightmapped",
    "whose light ends before it meets anything",
    "behind everything that takes light",
]


def lies(findings, scene):
    """(effect, false words, findings with them) for one plan, each about one thing."""
    first = f"'{scene.things[0].label}'" if scene.things else ""
    for number, finding in enumerate(findings):
        names = ", ".join(f"'{name}'" for name in finding["evidence"]["names"][:4])
        for words in OFF.get(finding["effect"], []) if finding["on"] else []:
            reason = words.format(names=names, thing=first, n=(re.match(r"\d+ [\w ]+", finding["reason"]) or [""])[0])
            yield told(findings, number, on=False, reason=reason)
        if finding["on"] and (count := re.match(r"\d+(?= )", finding["reason"])) and " of " not in finding["reason"]:
            yield told(findings, number, on=True, reason=f"{int(count[0]) + 1}{finding['reason'][count.end() :]}")
    number = next(k for k, finding in enumerate(findings) if finding["effect"] == "far-lamps")
    lamp = next((lamp for lamp in scene.lamps if lamp.shines() and lamp.label not in findings[number]["evidence"]["names"]), None)
    for why in IDLE if lamp else []:
        yield told(findings, number, on=False, reason=f"1 lamp {why}: '{lamp.label}'", names=[lamp.label])


def told(findings, number, on, reason, names=None):
    false = copy.deepcopy(findings)
    false[number] |= {"on": on, "reason": reason}
    if names:
        false[number]["evidence"] = {"count": len(names), "names": names}
    return false[number]["effect"], reason, false
