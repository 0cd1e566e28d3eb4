"""Draw the stability map: run the points of runs/extremes/points.toml and say how each one ends.

  tools/extremes                               all points; writes map.csv and map.png into runs/extremes (make extremes)
  tools/extremes --quick                       without the points that take more than some seconds
  tools/extremes --only gap,density            these axes; what map.csv holds of others stays
  tools/extremes --point density/0.001/explicit/nodal     one point, with everything the program prints

A point ends as
  ok            finite, balanced, and within the tolerance of its reference
  inaccurate    finite, but off by the figure given (relative error), or out of balance, or bodies overlap
  stopped       refused, or stopped with a message of one line
  BUG           crashed, hung, or gave a silent NaN: the exit status is then 1
Every line of map.csv holds the command that repeats the run.
"""

import concurrent.futures
import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from quantities import compute
from toolbox import ROOT, choose, default_jobs, launcher, make_parser, option_words, printable, pyplot, read_numbers, read_rows, read_toml, run_scene, save_figure, split_words, write_rows

FOLDER = ROOT / "runs" / "extremes"
COLUMNS = "axis,value,coupling,method,ranks,verdict,error,tolerance,message,command".split(",")
OVERLAP, BALANCE = 0.02, 0.05  # largest overlap in diameters, largest relative error of the momentum balance
WORST = ["BUG", "stopped", "inaccurate", "ok"]
COLOUR = {"ok": "#4c9f70", "inaccurate": "#e9c46a", "stopped": "#8d99ae", "BUG": "#c1121f"}


def parse_arguments():
    parser = make_parser(__doc__, limit=300)
    parser.add_argument("--quick", action="store_true", help="leave out the large points")
    parser.add_argument("--only", metavar="AXIS[,AXIS]", help="these axes")
    parser.add_argument("--method", metavar="METHOD[,METHOD]", help="these methods (default: all that the program knows)")
    parser.add_argument("--point", metavar="AXIS/VALUE/COUPLING/METHOD", help="one point; '-' where an axis has no bodies")
    parser.add_argument("--jobs", type=int, default=default_jobs(), metavar="N", help="runs at the same time (default: cores that are free)")
    parser.add_argument("--points", default=str(FOLDER / "points.toml"), metavar="FILE", help="list of points (default: runs/extremes/points.toml)")
    parser.add_argument("--output", default=str(FOLDER), metavar="FOLDER", help="where map.csv and map.png go (default: runs/extremes)")
    return parser, parser.parse_args()


# ---- points ----


def fill(options, value):
    """Options with expressions ('=...') replaced by their values for a value of the axis."""
    return {name: compute(text[1:], a=value) if isinstance(text, str) and text.startswith("=") else text for name, text in options.items()}


class Point:
    def __init__(self, axis, entry, value, coupling, method):
        self.axis, self.entry, self.value, self.coupling, self.method = axis, entry, value, coupling, method
        self.options = {name: str(option) for name, option in fill(entry.get("options", {}), value).items()}
        if coupling:
            self.options.update(couple_type=coupling, couple_method=method)
        self.ranks = int(fill({"": entry.get("ranks", 1)}, value)[""])

    def name(self):
        return f"{self.axis}/{self.value:g}/{self.coupling or '-'}/{self.method or '-'}"


def known_methods(build):
    """Boundary methods that this build knows, from its help."""
    words = [*launcher(1), str((ROOT / build / "tumble").resolve()), str(FOLDER / "disc.yaml"), "-help"]
    text = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False).stdout  # PETSc 3.18 prints a string that it never set
    found = re.search(r"^-couple_method.*\(one of: ([^)]*)\)", text, re.M)
    if not found:
        sys.exit("extremes: the help of the program does not list -couple_method")
    return found[1].split(", ")


def read_points(parser, args):
    axes = read_toml(parser, args.points)
    methods = args.method.split(",") if args.method else known_methods(args.build)
    points = []
    for name, entry in choose(parser, "axis", axes, split_words(args.only)).items():
        values = entry["values"][: entry.get("quick")] if args.quick else entry["values"]
        for coupling in entry.get("coupling", [None]):
            for method in (methods if entry["method"] == "all" else entry["method"]) if coupling else [None]:
                points += [Point(name, entry, value, coupling, method) for value in values]
    if args.point:
        points = [point for point in points if point.name() == args.point]
        if not points:
            parser.error(f"no point '{args.point}'; the first columns of map.csv name the points")
    return axes, points


# ---- verdicts ----


def find_nonfinite(run):
    """Name of the first number that is no number, or None; a gap may be infinite."""
    for file in ("series.csv", "bodies.csv"):
        for row in read_numbers(run.folder / file):
            for name, value in row.items():
                if isinstance(value, float) and not math.isfinite(value) and name != "gap":
                    return f"{name} = {value} in step {row['step']:g} of {file}"
    return None


def collect(run):
    """Numbers of a run by name: last rows of series.csv and of body 0, quantities."""
    series, bodies = run.series(), [row for row in run.bodies() if row["body"] == 0]
    return {**run.summary["quantities"], **(series[-1] if series else {}), **(bodies[-1] if bodies else {})}


def execute(point, args, folder, changed=None):
    options = {**point.options, **{name: str(value) for name, value in (changed or {}).items() if name != "ranks"}}
    ranks = (changed or {}).get("ranks", point.ranks)
    return run_scene(point.entry["scene"], options, ranks, folder, args.build, args.limit, cwd=ROOT)


def judge_run(run):
    """Verdict and message of a run alone; None: it is finished and sound."""
    if run.ended == "hung":
        return "BUG", "no end within the time limit"
    if run.ended == "crashed" or "PETSC ERROR" in run.err:
        return "BUG", "crashed: " + run.message
    if run.ended == "stopped":
        return "stopped", run.message.replace(str(run.folder), "(output folder)")
    broken = find_nonfinite(run)
    if broken:
        return "BUG", "silent: " + broken
    return None


def measure_error(point, args, run, folder):
    """Relative error against the reference of the point, or None without one."""
    entry = point.entry
    if "check" not in entry:
        return None
    value = compute(entry["check"], a=point.value, **collect(run))
    if "compare" in entry:
        other = execute(point, args, folder, fill(entry["compare"], point.value))
        if judge_run(other):
            raise RuntimeError(f"the run that gives the reference failed: {judge_run(other)[1]}")
        right = compute(entry["check"], a=point.value, **collect(other))
    else:
        right = compute(entry["exact"], a=point.value)
    return abs(value - right) / abs(compute(entry["scale"], a=point.value) if "scale" in entry else right)


def judge(point, args, folder):
    """The row of map.csv, and the run."""
    run = execute(point, args, folder / "run")
    row = {"axis": point.axis, "value": f"{point.value:g}", "coupling": point.coupling or "-", "method": point.method or "-", "ranks": point.ranks}
    words = [*launcher(point.ranks), "build/tumble", point.entry["scene"], *option_words(point.options), "-output_overwrite"]
    row.update(command=printable(words), error="", tolerance="", message="")
    verdict = judge_run(run)
    if verdict:
        row["verdict"], row["message"] = verdict
        return row, run
    row["verdict"] = "ok"
    last = collect(run)
    balance = abs(last["momentum_error"]) if point.entry.get("balance", True) else 0
    for figure, limit, text in [(balance, BALANCE, "momentum balance"), (last.get("overlap_max", 0), OVERLAP, "overlap")]:
        if figure > limit:
            row.update(verdict="inaccurate", error=f"{figure:.3g}", tolerance=f"{limit:g}", message=f"{text} {figure:.2g}")
    try:
        error = measure_error(point, args, run, folder / "reference")
    except RuntimeError as failure:
        row.update(verdict="inaccurate", message=str(failure))
        return row, run
    if error is not None:
        row.update(error=f"{error:.3g}", tolerance=f"{point.entry['tolerance']:g}")
        if not error <= point.entry["tolerance"]:
            row.update(verdict="inaccurate", message=f"relative error {error:.2g}")
    return row, run


# ---- the figure ----


def draw(path, axes, rows):
    plt = pyplot()
    from matplotlib.patches import Patch, Rectangle

    lines = []
    for axis in axes:
        here = [row for row in rows if row["axis"] == axis]
        for key in dict.fromkeys((row["coupling"], row["method"]) for row in here):
            lines.append((axis, key, [row for row in here if (row["coupling"], row["method"]) == key]))
    height = len(lines) + 1.2 * len({axis for axis, _, _ in lines})
    width = max(len(row) for _, _, row in lines)
    fig, ax = plt.subplots(figsize=(4.2 + 0.62 * width, 0.27 * height + 0.6), constrained_layout=True)
    y, last = 0.0, None
    for axis, key, cells in lines:
        if axis != last:
            y -= 1.2
            ax.text(0, y + 0.75, axes[axis]["title"], fontsize=8, fontweight="bold", va="center")
            for i, cell in enumerate(cells):
                ax.text(i + 0.5, y + 0.2, cell["value"], fontsize=6.5, ha="center", va="center", color="0.3")
            last = axis
        y -= 1
        ax.text(-0.1, y + 0.5, " ".join(part for part in key if part != "-") or "flow alone", fontsize=7, ha="right", va="center")
        for i, cell in enumerate(cells):
            ax.add_patch(Rectangle((i + 0.03, y + 0.06), 0.94, 0.88, color=COLOUR[cell["verdict"]]))
            text = f"{100 * float(cell['error']):.2g}%" if cell["error"] else ""
            ax.text(i + 0.5, y + 0.5, text, fontsize=5.5, ha="center", va="center", color="white" if cell["verdict"] in ("ok", "BUG") else "black")
    ax.set_xlim(-3.2, width)
    ax.set_ylim(y - 0.1, 1.2)
    ax.axis("off")
    names = {"ok": "ok", "inaccurate": "inaccurate (error)", "stopped": "refused or stopped with message", "BUG": "crash, hang, NaN"}
    ax.legend(handles=[Patch(color=COLOUR[verdict], label=names[verdict]) for verdict in ("ok", "inaccurate", "stopped", "BUG")], loc="upper left", ncols=4, fontsize=7, frameon=False)
    save_figure(fig, path)


# ---- main ----


def read_others(path, axes, rows):
    """Rows of an earlier map at points that were not run now, in the order of the axes with those that were."""
    done = {tuple(row[name] for name in COLUMNS[:4]) for row in rows}
    if path.exists():
        rows = rows + [row for row in read_rows(path) if row["axis"] in axes and tuple(row[name] for name in COLUMNS[:4]) not in done]
    order = list(axes)
    return sorted(rows, key=lambda row: order.index(row["axis"]))


def show_point(point, args):
    with tempfile.TemporaryDirectory(prefix="tumble-extremes-") as folder:
        row, run = judge(point, args, Path(folder))
        print(run.out + run.err)
    for name in COLUMNS:
        print(f"{name:>10}  {row[name]}")
    return 1 if row["verdict"] == "BUG" else 0


def main():
    parser, args = parse_arguments()
    axes, points = read_points(parser, args)
    if args.point:
        return show_point(points[0], args)

    def work(point):
        with tempfile.TemporaryDirectory(prefix="tumble-extremes-") as folder:
            row = judge(point, args, Path(folder))[0]
        print(f"{row['verdict']:>10}  {point.name():<42} {row['error']:>9}  {row['message'][:90]}", flush=True)
        return row

    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        rows = list(pool.map(work, points))
    output = Path(args.output)
    failed = any(row["verdict"] == "BUG" for row in rows)
    rows = read_others(output / "map.csv", axes, rows) if args.only or args.method or args.quick else rows
    write_rows(output / "map.csv", COLUMNS, rows)
    draw(output / "map.png", axes, rows)
    counts = {verdict: sum(row["verdict"] == verdict for row in rows) for verdict in WORST}
    print(f"\n{len(rows)} points: " + ", ".join(f"{count} {verdict}" for verdict, count in reversed(counts.items())) + f"; {output}/map.csv, map.png")
    return 1 if failed else 0
