#!/usr/bin/env python3
"""Reads the plan of every scene and looks in Blender whether it is true.

usage: check_plan.py [--lies] [--lightkiln PROGRAM] [--report FILE.json] SCENE.glb|SCENE.gltf|FOLDER ...
       (Python with the bpy package, 4.5; see requirements.txt)

`lightkiln plan SCENE --json` tells of 22 effects whether they are on, why, and of what. Blender opens the same file, and each effect is
judged by what Blender holds: objects, materials with their nodes and images, lamps, custom properties; closed skins by bmesh; and what
can be seen from where by rays and random walks of light.

What is off must be off by Blender's evidence: nothing that was left out may be there, no walk may find a way. What is on may be on for
caution, but counts and names in its reason must be those of Blender's objects. Scenes that lightkiln refuses or Blender cannot open are
told and skipped. `--lies` puts the check itself to the test: it falsifies each plan in every way that plan_lies.py knows, one at a
time, and tells the lies that were not found. A few happen to be true: what is on may be on for caution alone.

Exit code 0: all plans are true; 1: some are not; 2: wrong usage.
"""

import argparse
import json
import os
import subprocess
import sys
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy

import plan_scene
from plan_checks import Check, check_what_there_is
from plan_lies import lies
from plan_ways import check_where_light_gets

PROGRAM = Path(__file__).resolve().parent.parent / "target/release/lightkiln"


def plan_of(program, path):
    """The plan's findings, or why there is none. Texture space and effort do not matter to it, but what does not fit is refused."""
    for size in (64, 1024):
        command = [program, "plan", path, "--json", "--quality", "draft", "--page-size", size]
        ended = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        if ended.returncode == 0:
            return json.loads(ended.stdout)["forecast"]["effects"], None
        refused = (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[0]
        if "do not fit" not in refused:
            break
    return None, refused


def problems_of(findings, scene):
    """(what is not true, how many rays that took)"""
    check = Check(findings, scene)
    check_what_there_is(check)
    check_where_light_gets(check)
    return check.problems, check.rays.sent


def found(effect, problems, before):
    """Whether there is a new problem with an effect, and not only with what goes along with it."""
    return any(problem.startswith(f"{effect} ") and problem not in before for problem in problems)


def judge(program, path, lying):
    """(what came out, a line about it, problems) of one scene."""
    findings, refused = plan_of(program, path)
    if refused:
        return "skip", f"lightkiln refuses it: {refused}", []
    try:
        scene = plan_scene.open_scene(path)
        if scene.other_bytes:
            return "skip", "Blender reads other bytes: the fallback beside what meshopt compressed", []
    except Exception as error:
        return "skip", f"Blender cannot open it: {(str(error).strip().splitlines() or [type(error).__name__])[-1]}", []
    try:
        problems, rays = problems_of(findings, scene)
        if lying:
            told = list(lies(findings, scene))
            believed = [
                f'{effect}: "{words}" was believed'
                for effect, words, false in told
                if not found(effect, problems_of(false, scene)[0], problems)
            ]
            return "FAIL" if believed else "ok", f"{len(told)} lies, {len(told) - len(believed)} found", believed
    except Exception:
        return "FAIL", "the check itself failed", [traceback.format_exc()]
    if len(findings) != 22:
        problems.append(f"there are {len(findings)} effects, not 22")
    off = sum(not finding["on"] for finding in findings)
    triangles = sum(len(part.corners) for part in scene.parts)
    line = f"{len(findings)} effects, {off} off; {len(scene.things)} objects, {len(scene.lamps)} lamps, {triangles:,} triangles; {rays:,} rays"
    return "FAIL" if problems else "ok", line, problems


def scenes_of(arguments):
    for place in map(Path, arguments):
        if place.is_dir():
            yield from sorted(path for path in place.rglob("*") if path.suffix.lower() in (".glb", ".gltf"))
        else:
            yield place


def main():
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    ask = argparse.ArgumentParser(description="Reads the plan of every scene and looks in Blender whether it is true.")
    ask.add_argument("scenes", nargs="+", metavar="SCENE", help="glTF files, or folders of such")
    ask.add_argument("--lies", action="store_true", help="falsify the plans, and tell what is not found")
    ask.add_argument("--lightkiln", type=Path, default=PROGRAM, help="the program [default: target/release/lightkiln]")
    ask.add_argument("--report", type=Path, help="also write the findings as JSON")
    options = ask.parse_args(own)
    if missing := [name for name in options.scenes if not Path(name).exists()]:
        ask.error(f"there is no {missing[0]}")
    done = []
    for path in scenes_of(options.scenes):
        came, line, problems = judge(options.lightkiln, path.resolve(), options.lies)
        print(f"{came:<5} {path.name}: {line}")
        for problem in problems:
            print(f"      {problem}")
        sys.stdout.flush()
        done.append({"scene": str(path), "result": came, "what": line, "problems": problems})
    count = {came: sum(scene["result"] == came for scene in done) for came in ("ok", "FAIL", "skip")}
    print(f"plans in Blender {bpy.app.version_string}: {count['ok']} passed, {count['FAIL']} failed ({count['skip']} skipped)")
    if options.report:
        options.report.write_text(json.dumps(done, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    sys.stdout.flush()
    os._exit(1 if count["FAIL"] else 0)  # Blender's own threads may wait for each other for ever when it is taken down


if __name__ == "__main__":
    main()
