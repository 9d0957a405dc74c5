#!/usr/bin/env python3
"""Shows that an effect a scene does not call for costs nothing: counts instructions with and without its code.

usage: absent_effects.py [NAME ...]

For every fixture below the code of effects that its plan leaves out is taken from a copy of the sources, a second
program is built from them, and both bake the fixture under Valgrind's callgrind. The counts must agree within 1 %.
Needs cargo and valgrind; two minutes a fixture on two cores.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ALLOWED = 0.01

# What is taken out: (file, code, what stands there instead).
AREA = ("src/direct/block.rs", "AnyEmitter::Area(e) => work.add(e, &mut scratch, &mut sum, rays),")
POINT = ("src/direct/block.rs", "AnyEmitter::Point(e) => work.add(e, &mut scratch, &mut sum, rays),")
SUN = ("src/direct/block.rs", "AnyEmitter::Sun(e) => work.add(e, &mut scratch, &mut sum, rays),")
CUTOUT = ("src/transport/tracer.rs", "$crate::transport::AnyTracer::Cutout($tracer) => $body,")
TINTED = ("src/transport/tracer.rs", "$crate::transport::AnyTracer::Tinted($tracer) => $body,")
GREY = ("src/bake/reflect.rs", "if self.plan.work.grey {")

WITHOUT = {
    "grey_lamp": {"area lights": AREA, "suns": SUN, "alpha test": CUTOUT, "tinted shadows": TINTED},
    "cornell": {
        "point lamps": POINT,
        "suns": SUN,
        "alpha test": CUTOUT,
        "tinted shadows": TINTED,
        "one channel": GREY,
    },
    "leaves": {"area lights": AREA, "point lamps": POINT, "tinted shadows": TINTED, "one channel": GREY},
}


def removed(code):
    """The same arm or condition, with nothing behind it."""
    if code.startswith("if "):
        return "if false && " + code.removeprefix("if ")
    return re.sub(r"\(\$?\w+\) => .*,$", "(_) => unreachable!(),", code)


def build_without(effects, tree):
    """Copies the sources without the code of `effects`, builds them, and returns the program."""
    for part in ("src", "benches"):
        shutil.copytree(ROOT / part, tree / part)
    for part in ("build.rs", "Cargo.lock", "README.md"):
        shutil.copy(ROOT / part, tree / part)
    manifest = (ROOT / "Cargo.toml").read_text()
    # Another name for package and program, so that neither build takes the other's place.
    manifest, renamed = re.subn(r'^(name|default-run) = "lightkiln"$', r'\1 = "lightkiln-without"', manifest, flags=re.M)
    manifest = manifest.replace('[lib]\nname = "lightkiln-without"', '[lib]\nname = "lightkiln"')
    assert renamed == 4, "Cargo.toml names the package, its program and its library in other ways now"
    (tree / "Cargo.toml").write_text(manifest)
    lock = (tree / "Cargo.lock").read_text()
    (tree / "Cargo.lock").write_text(lock.replace('name = "lightkiln"\n', 'name = "lightkiln-without"\n'))
    for effect, (file, code) in effects.items():
        path = tree / file
        text = path.read_text()
        if text.count(code) != 1:
            sys.exit(f"{file}: the code of '{effect}' is not where this script looks for it: {code}")
        path.write_text(text.replace(code, removed(code)))
    build = ["cargo", "build", "--release", "--quiet", "--manifest-path", tree / "Cargo.toml"]
    subprocess.run([*build, "--bin", "lightkiln-without", "--target-dir", ROOT / "target"], check=True)
    return ROOT / "target/release/lightkiln-without"


def instructions(program, fixture, folder):
    """Instructions of a bake on one thread."""
    bake = [program, "bake", ROOT / f"fixtures/{fixture}.glb", "-o", folder / "baked.glb"]
    bake += ["--quality", "draft", "--page-size", "128", "--max-pages", "1", "--threads", "1", "-q"]
    counter = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder / 'counts'}"]
    run = subprocess.run([*counter, *bake], check=True, capture_output=True, text=True)
    return int(re.search(r"Collected : (\d+)", run.stderr)[1])


def main():
    ask = argparse.ArgumentParser(description="Counts instructions of bakes with and without the code of absent effects.")
    ask.add_argument("names", nargs="*", metavar="NAME", help=f"fixtures (default: {', '.join(WITHOUT)})")
    names = ask.parse_args().names or list(WITHOUT)
    if unknown := [name for name in names if name not in WITHOUT]:
        ask.error(f"nothing is known to be absent in {', '.join(unknown)}")
    if not shutil.which("valgrind"):
        sys.exit("valgrind is missing: install it, for example with apt-get install valgrind")
    subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=ROOT, check=True)

    failed = 0
    for name in names:
        with tempfile.TemporaryDirectory(dir=ROOT / "target") as folder:
            folder = Path(folder)
            without = build_without(WITHOUT[name], folder / "tree")
            counts = [instructions(program, name, folder) for program in (ROOT / "target/release/lightkiln", without)]
        difference = counts[0] / counts[1] - 1
        passed = abs(difference) <= ALLOWED
        failed += not passed
        print(
            f"{'ok  ' if passed else 'FAIL'}  {name}: {counts[0]:,} instructions, {counts[1]:,} without the code of "
            f"{', '.join(WITHOUT[name])}: {difference:+.3%}",
            flush=True,
        )
    print(f"{len(names) - failed} passed, {failed} failed")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
