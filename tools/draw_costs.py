"""Draws what accuracy costs, scene by scene, out of `lightkiln study accuracy`: README's picture.

    python tools/draw_costs.py SCENE.glb... --out DIR --picture FILE.png [--page-size 256] [--again]

Studies every scene into DIR/NAME, unless there is a study already (--again makes it afresh), draws rms error against seconds with the front
that no setting gets past, and prints the least seconds that reach 5, 2, 1 and 0.5 %. Where tools/compare_cycles.py has been in the folder,
Cycles is drawn too.

Needs matplotlib (tools/requirements-plots.txt).
"""

import argparse
import csv
import subprocess
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.ticker import FuncFormatter, NullFormatter

ASKED = [0.05, 0.02, 0.01, 0.005]
OTHERS = {"Cycles": ("^", "tab:gray"), "Cycles + OpenImageDenoise": ("s", "tab:olive")}


def main():
    wanted = arguments()
    figure, plots = pyplot.subplots(1, len(wanted.scenes), figsize=(3.6 * len(wanted.scenes), 3.4), sharey=True, squeeze=False)
    for plot, scene in zip(plots[0], wanted.scenes):
        rows = study(scene, wanted)
        draw(plot, scene.stem, rows)
        tell(scene.stem, rows)
    plots[0][0].set_ylabel("rms error, % of the mean")
    plots[0][-1].legend(fontsize=7, frameon=False)
    figure.tight_layout()
    figure.savefig(wanted.picture, dpi=90)
    shrink(wanted.picture)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--picture", type=Path, required=True)
    parser.add_argument("--page-size", type=int, default=256)
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--lightkiln", default="target/release/lightkiln")
    return parser.parse_args()


def study(scene, wanted):
    """Rows of accuracy.csv that are judged texel by texel, numbers where they are."""
    folder = wanted.out / scene.stem
    if wanted.again or not (folder / "accuracy.csv").exists():
        command = [wanted.lightkiln, "study", "accuracy", scene, "--out", folder, "--page-size", wanted.page_size, "--max-pages", 1]
        subprocess.run([str(word) for word in command], stdout=subprocess.DEVNULL)
    rows = []
    for table in (folder / "accuracy.csv", folder / "cycles.csv"):
        if table.exists():
            with open(table, newline="") as file:
                rows += [row for row in csv.DictReader(file) if row["sweep"] != "density" and row["seconds"] and row["rms"]]
    return [{**row, "seconds": float(row["seconds"]), "rms": float(row["rms"])} for row in rows]


def own(rows):
    return [row for row in rows if not row["sweep"].startswith("Cycles")]


def draw(plot, name, rows):
    ours = own(rows)
    levels = [row for row in ours if row["sweep"] == "quality"]
    at = lambda rows: ([row["seconds"] for row in rows], [100 * row["rms"] for row in rows])
    plot.loglog(*at(ours), ".", color="tab:blue", alpha=0.4, label="lightkiln, single settings")
    plot.loglog(*at(front(ours)), "-", color="tab:blue", alpha=0.6, lw=1, label="no better one")
    plot.loglog(*at(levels), "o", color="tab:blue", label="--quality")
    for row in levels:
        plot.annotate(row["setting"], (row["seconds"], 100 * row["rms"]), xytext=(4, 4), textcoords="offset points", fontsize=7)
    for who, (mark, colour) in OTHERS.items():
        theirs = [row for row in rows if row["sweep"] == who]
        if theirs:
            plot.loglog(*at(theirs), mark + ":", color=colour, label=who)
    plot.set(xlabel="seconds", title=name)
    for axis in (plot.xaxis, plot.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    plot.grid(True, which="both", alpha=0.25)


def front(rows):
    best = []
    for row in sorted(rows, key=lambda row: (row["seconds"], row["rms"])):
        if not best or row["rms"] < best[-1]["rms"]:
            best.append(row)
    return best


def tell(name, rows):
    for asked in ASKED:
        enough = [row for row in own(rows) if row["rms"] <= asked]
        best = min(enough, key=lambda row: row["seconds"], default=None)
        words = f"{best['seconds']:.2f} s ({best['sweep']} {best['setting']})" if best else "not reached"
        print(f"{name}: {100 * asked:g} %: {words}")


def shrink(path):
    """Few colours: a fifth of the bytes."""
    from PIL import Image

    Image.open(path).convert("RGB").quantize(64).save(path, optimize=True)


if __name__ == "__main__":
    main()
