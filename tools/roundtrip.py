#!/usr/bin/env python3
"""The round trip through Blender: export, bake, import, compare; what came back, and whether its light is Blender's.

usage: roundtrip.py [--cycles SAMPLES] [--views] [--report FILE.json] SCENE.blend|SCENE.glb ...
       roundtrip.py --own [NAME ...]                     scenes of its own, one for each light that glTF drops
       roundtrip.py --pairs ORIGINAL BAKED [ORIGINAL BAKED ...]     files that are baked already
       (Python with the bpy package, 4.5 or 5; or: blender -b -P tools/roundtrip.py -- ...)

A .blend is exported with the settings a bake needs. Then it is baked and imported again: objects, transforms, hierarchy,
meshes, materials, UV sets, cameras, lamps, animations, skins, shape keys and custom properties must be as they were, and the
lightmap must be there, in range, without overlap, with gutters, its EXR as it was written. `--cycles` bakes the same UVs in
Cycles and compares; `--views` compares pictures of preview, applied lightmaps and `lightkiln render`.

Exit code 0: all checks passed; 1: some failed; 2: wrong usage.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy

import blender_snapshot as snapshot
import cycles_compare
import export_scene
import lightmap_checks
import roundtrip_checks
import scene_light
import test_scenes
import views

PROGRAM = Path(__file__).resolve().parent.parent / "target/release/lightkiln"


class Trip:
    """One scene on its way: where it came from, its files, what was found."""

    def __init__(self, name, open_scene, original, baked):
        self.name, self.open_scene, self.original, self.baked = name, open_scene, original, baked
        self.checks, self.facts, self.told = {}, {}, []

    def failed(self):
        return any(self.checks.values())


def lossless(trip):
    """What must be as it was, and what must have been added. Returns pages and the object at each of their texels."""
    before = snapshot.load(trip.original)
    meshes_before = snapshot.mesh_corners()
    after = snapshot.load(trip.baked)
    meshes_after = snapshot.mesh_corners()
    trip.checks.update(roundtrip_checks.unchanged(before, meshes_before, after, meshes_after))

    folder = trip.baked.parent
    document = lightmap_checks.read_document(trip.baked)
    baked = lightmap_checks.lightmapped_objects(after["custom properties"], meshes_after)
    pages = lightmap_checks.open_pages(baked, folder)
    sizes = {file: pixels.shape[1::-1] for file, pixels in pages.items() if not isinstance(pixels, str)}
    trip.checks["lightmap entries"] = list(lightmap_checks.entry_problems(baked))
    trip.checks["lightmap UVs"] = list(lightmap_checks.uv_problems(meshes_before, meshes_after, baked))
    trip.checks["no texel twice"] = list(lightmap_checks.overlap_problems(baked, sizes))
    trip.checks["gutters"] = list(lightmap_checks.gutter_problems(baked, sizes))
    trip.checks["lightmap materials"] = list(lightmap_checks.material_problems(document))
    trip.checks["EXR pages"] = list(lightmap_checks.page_problems(pages, folder))
    trip.facts |= {
        "objects": len(before["transforms"]),
        "meshes": len(meshes_before),
        "lightmapped": len(baked),
        "pages": len(pages),
    }
    return {file: pages[file] for file in sizes}, lightmap_checks.owners_of(baked, sizes)


def against_cycles(trip, pages, owners, samples):
    trip.open_scene()
    problems, trip.facts["Cycles"] = [], {}
    theirs, taken = cycles_compare.bake(trip.baked, pages, owners, samples)
    for file, halves in theirs.items():
        found, where = cycles_compare.compare(pages[file], halves, owners[file])
        picture = trip.baked.parent / f"{Path(file).stem}.compared.png"
        cycles_compare.save_picture(picture, pages[file], halves, where)
        problems += [f"{file}: {problem}" for problem in found.pop("problems")]
        trip.facts["Cycles"][file] = {"samples": taken, "picture": picture.name, **found}
    trip.checks["as in Cycles"] = problems


# ---- where scenes come from ---------------------------------------------------------------------------------------


def trips(options, folder):
    if options.pairs:
        for original, baked in zip(options.files[::2], options.files[1::2], strict=True):
            original, baked = Path(original).resolve(), Path(baked).resolve()
            yield Trip(baked.name, lambda path=original: open_file(path), original, baked)
    elif options.own:
        for name in options.files or test_scenes.SCENES:
            place = made(folder / name)
            yield Trip(name, lambda n=name, p=place: test_scenes.build(n, p), place / f"{name}.glb", place / f"{name}.baked.glb")
    else:
        for file in map(Path, options.files):
            file = file.resolve()
            place = made(folder / file.stem)
            exported = file if file.suffix != ".blend" else place / f"{file.stem}.glb"
            yield Trip(file.name, lambda path=file: open_file(path), exported, place / f"{file.stem}.baked.glb")


def made(folder):
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def open_file(path):
    if path.suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(path))
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.app.debug_value = 1
        bpy.ops.import_scene.gltf(filepath=str(path))
        scene_light.light_from_properties(path.parent)


def travel(trip, options):
    preview = trip.baked.with_name(f"{trip.original.stem}.preview.glb")
    if not options.pairs:
        if not trip.original.exists():
            trip.open_scene()
            trip.told = export_scene.export(trip.original)
        command = [options.lightkiln, "bake", trip.original, "-o", trip.baked, "--preview", preview, "-q"]
        command += ["--page-size", options.page_size, "--quality", options.quality]
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
        trip.checks["bake"] = [] if done.returncode == 0 else [done.stderr.strip()]
        if done.returncode:
            return
    pages, owners = lossless(trip)
    if options.cycles and pages:
        against_cycles(trip, pages, owners, options.cycles)
    document = lightmap_checks.read_document(trip.baked)
    if options.views and preview.exists() and document.get("cameras"):
        engines = ["CYCLES"]
        if options.eevee:
            engines.append("BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE")
        trip.facts["views"] = views.compare(options.lightkiln, trip.baked, preview, trip.baked.parent, engines, options.three)
        trip.checks["views agree"] = trip.facts["views"].pop("problems")


# ---- the command --------------------------------------------------------------------------------------------------


def print_trip(trip):
    counts = [f"{count} {what}" for what, count in trip.facts.items() if isinstance(count, int)]
    print(f"{'FAIL' if trip.failed() else 'ok':<5} {trip.name}: " + ", ".join(counts))
    for sentence in trip.told:
        print(f"      export: {sentence}")
    for file, found in trip.facts.get("Cycles", {}).items():
        if found["texels"]:
            over = f" over blocks of {found['block']} by {found['block']} texels" if found["block"] > 1 else ""
            print(
                f"      {file}: mean {found['mean ratio']:.4f} of Cycles', median error {found['median error']:.2%}{over} at "
                f"{found['samples']} samples (noise {found['median noise of Cycles']:.2%})"
            )
    if note := trip.facts.get("views", {}).get("note"):
        print(f"      views: {note}")
    for way, found in trip.facts.get("views", {}).items():
        if isinstance(found, dict):
            print(f"      {way}: differs from render by a median of {found['median steps']:.1f} steps, 95 % within {found['95th percentile']:.1f} of 255")
    for check, problems in trip.checks.items():
        if problems:
            print(f"      {check}: {len(problems)} problems")
            for line in sorted(problems)[:8]:
                print(f"        {line}")
    sys.stdout.flush()


def arguments():
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    ask = argparse.ArgumentParser(description="Takes scenes through Blender and lightkiln and compares what comes back.")
    ask.add_argument("files", nargs="*", metavar="FILE", help=".blend or glTF files; with --pairs ORIGINAL BAKED ...; with --own names")
    ask.add_argument("--pairs", action="store_true", help="the files are baked already")
    ask.add_argument("--own", action="store_true", help=f"scenes built here: {', '.join(test_scenes.SCENES)}")
    ask.add_argument("--cycles", type=int, default=0, metavar="SAMPLES", help="bake the same UVs in Cycles with at least so many and compare")
    ask.add_argument("--views", action="store_true", help="compare pictures of preview, applied lightmaps and render")
    ask.add_argument("--eevee", action="store_true", help="the views in EEVEE too; needs OpenGL")
    ask.add_argument("--three", action="store_true", help="the views in three.js too; see three_view.mjs for what it needs")
    ask.add_argument("--lightkiln", type=Path, default=PROGRAM, help="the program [default: target/release/lightkiln]")
    ask.add_argument("--quality", default="good")
    ask.add_argument("--page-size", type=int, default=128)
    ask.add_argument("--keep", type=Path, metavar="DIR", help="keep all files here")
    ask.add_argument("--report", type=Path, help="also write the findings as JSON")
    options = ask.parse_args(own)
    if options.pairs and (len(options.files) % 2 or not options.files):
        ask.error("files come in pairs: ORIGINAL BAKED")
    if options.own and (unknown := set(options.files) - set(test_scenes.SCENES)):
        ask.error(f"there is no scene {', '.join(sorted(unknown))}")
    if not (options.files or options.own):
        ask.error("name scenes, or --own")
    for file in [] if options.own else options.files:
        if not Path(file).is_file():
            ask.error(f"there is no file {file}")
    return options


def main():
    if bpy.app.version < (4, 1):
        sys.exit(f"this needs Blender 4.1 or newer, not {bpy.app.version_string}")
    options = arguments()
    done = []
    with tempfile.TemporaryDirectory(prefix="roundtrip-") as temporary:
        folder = made(options.keep.resolve()) if options.keep else Path(temporary)
        if any(str(file).endswith(".blend") for file in options.files):
            print("\n".join(export_scene.lossy_defaults()))
        for trip in trips(options, folder):
            try:
                travel(trip, options)
            except Exception:
                trip.checks["fault"] = [traceback.format_exc()]
            print_trip(trip)
            done.append(trip)
    failed = sum(trip.failed() for trip in done)
    print(f"\n{'check':<24}scenes without a problem")
    for check in dict.fromkeys(check for trip in done for check in trip.checks):
        having = [trip for trip in done if check in trip.checks]
        print(f"{check:<24}{sum(not trip.checks[check] for trip in having)} of {len(having)}")
    print(f"round trip: {len(done) - failed} passed, {failed} failed (Blender {bpy.app.version_string})", flush=True)
    if options.report:
        scenes = [
            {"original": trip.original.name, "baked": trip.baked.name, "export": trip.told, **trip.facts, "problems": trip.checks}
            for trip in done
        ]
        report = {"blender": bpy.app.version_string, "passed": len(done) - failed, "failed": failed, "scenes": scenes}
        options.report.write_text(json.dumps(report, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
