"""Trade accuracy for time: run a scene over a ladder of settings, draw error against CPU time, and say what to use.

  tools/tradeoff runs/cylinder-2d1.yaml                   all points of the ladder; writes cylinder-2d1.csv, .md and .png into runs/studies/tradeoff
  tools/tradeoff runs/cylinder-2d1.yaml --target 0.1%     and prints the cheapest options with at most this error
  tools/tradeoff runs/cylinder-2d1.yaml --read --target 1%    the same from the table that is there, without running
  tools/tradeoff runs/cylinder-2d1.yaml --shift 7         another random shift of the mesh; results get the ending -shift7
  tools/tradeoff my.yaml --quantity cd                    a scene of your own: solver x method x mesh x time step, against the finest run

A ladder is a list of axes (solver, boundary method, mesh, time step, tolerance, ...), each with named options; every combination is one point. Ladders stand in
runs/studies/tradeoff/ladders.toml. The error is that of one quantity, relative to its reference or to the finest run. The cost is the CPU time of a run on one rank
that is bound to one core, set-up included: unlike the clock it does not count the time that other programs had the core; what they do to caches and memory is in it.
A point on the front (Pareto) is one that no other point beats in both. An error can be small by accident: run with --shift 1, --shift 2, ...; then front and recommendations
go by the worst error over the tables that are there, and every point that a shift cannot reach (a mesh that follows the body) keeps its own.
"""

import itertools
import os
import shutil
import sys
import tempfile
from pathlib import Path

from quantities import measure, names_of_run
from toolbox import (
    ROOT, check_columns, check_keys, children_seconds, launcher, machine_name, make_parser, option_text, print_table, pyplot, read_options, read_rows, read_toml, run_scene, save_figure, write_rows,
)  # fmt: skip

FOLDER = ROOT / "runs" / "studies" / "tradeoff"
COLUMNS = "point,value,error,worst,cpu_s,unknowns,steps,front,ended,commit,options".split(",")
KEYS = {"scene", "options", "quantity", "name", "reference", "finest", "shift", "presets", "axes"}
PLAIN = {
    "solver": {"fast": "-flow_solver fast", "balanced": "-flow_solver balanced", "accurate": "-flow_solver accurate"},
    "method": {method: f"-couple_method {method}" for method in ("nodal", "penalty", "aligned")},
    "mesh": {"h": "", "h/2": "-dm_refine 1"},
    "step": {"dt": "", "dt/2": "-sim_dt {dt/2}"},
}  # ladder of a scene that has none of its own


def parse_share(text):
    return float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)


def parse_arguments():
    parser = make_parser(__doc__, limit=1800)
    parser.add_argument("scene", help="scene file")
    parser.add_argument("--target", type=parse_share, metavar="ERROR", help="print the cheapest options with at most this relative error, such as 0.1%% or 1e-3")
    parser.add_argument("--quantity", metavar="EXPRESSION", help="what is judged (default: that of the ladder): as in runs/validate, such as cd or \"largest('kinetic_energy')\"")
    parser.add_argument("--reference", type=float, metavar="X", help="its right value (default: that of the ladder, or the finest run)")
    parser.add_argument("--shift", type=int, metavar="N", help="random shift number N of the mesh against the body")
    parser.add_argument("--only", metavar="WORD[,WORD]", help="only points with one of these words in their names")
    parser.add_argument("--read", action="store_true", help="do not run: from the table that is there")
    parser.add_argument("--ladders", default=str(FOLDER / "ladders.toml"), metavar="FILE", help="list of ladders (default: runs/studies/tradeoff/ladders.toml)")
    parser.add_argument("--output", default=str(FOLDER), metavar="FOLDER", help="where results go (default: runs/studies/tradeoff)")
    return parser, parser.parse_args()


# ---- ladder ----


def read_ladder(parser, args):
    found = read_toml(parser, args.ladders)
    name = Path(args.scene).stem
    presets = found.pop("presets", {})
    ladder = dict(found.get(name) or {"axes": PLAIN})
    check_keys(parser, f"{args.ladders}: [{name}]", ladder, KEYS)
    if args.quantity:
        ladder.update(quantity=args.quantity, reference=args.reference)
    elif args.reference is not None:
        ladder["reference"] = args.reference
    if "quantity" not in ladder:
        parser.error(f"{args.ladders} has no ladder '{name}' (there are: {', '.join(found)}): give --quantity, such as --quantity cd")
    if args.shift and "shift" not in ladder:
        parser.error(f"the ladder of {name} has no key 'shift' (options with {{n}} that move the mesh against the body)")
    return ladder, ladder.get("presets", presets)


class Point:
    def __init__(self, labels, texts):
        self.labels, self.name, self.text = labels, " ".join(labels.values()), " ".join(text for text in texts if text)


def make_points(ladder, args):
    axes = ladder["axes"]
    points = []
    for labels in itertools.product(*axes.values()):
        texts = [values[label] for values, label in zip(axes.values(), labels)]
        if "-" not in texts:  # a lone '-' leaves a combination of the axis out
            points.append(Point(dict(zip(axes, labels)), texts))
    if args.only:
        points = [point for point in points if any(word in point.name for word in args.only.split(","))]
    return points


def all_options(text, ladder, args, dt):
    text = f"{ladder.get('options', '')} {text}"
    if args.shift:
        text += " " + ladder["shift"].replace("{n}", str(args.shift))
    if "{dt/2}" in text:
        text = text.replace("{dt/2}", repr(dt / 2))
    return read_options(text)


# ---- runs ----


def run_point(text, ladder, args, dt=None):
    """Row of the table."""
    options = all_options(text, ladder, args, dt)
    pin = ["taskset", "-c", str(max(os.sched_getaffinity(0)))] if shutil.which("taskset") else []
    with tempfile.TemporaryDirectory(prefix="tumble-tradeoff-") as folder:
        before = children_seconds()
        run = run_scene(args.scene, {"output_every": "0", **options}, 1, folder, args.build, args.limit, [*pin, *launcher(1)], ROOT if (ROOT / args.scene).exists() else None)
        row = {"cpu_s": f"{children_seconds() - before:.3g}", "options": option_text(options)}
        row.update(value="", error="", worst="", unknowns="", steps="", front="", commit="", ended=f"{run.ended}: {run.message}"[:200] if run.ended != "ok" else "ok")
        if run.ended != "ok":
            return row
        run.refuse_slow("tradeoff")
        value, problem = measure(ladder["quantity"], names_of_run(Path(folder)))
        if problem:
            sys.exit(f"tradeoff: quantity {problem}; the scene has: {', '.join(run.summary['quantities'])}")
    row.update(value=repr(value), unknowns=run.summary["unknowns"], steps=run.summary["steps"], commit=run.summary["commit"])
    return row


def scene_step(args):
    """Time step that the scene file gives, or None."""
    import yaml

    with open(ROOT / args.scene if (ROOT / args.scene).exists() else args.scene) as file:
        found = (yaml.safe_load(file).get("sim") or {}).get("dt")
    return float(found) if found is not None else None


def run_ladder(parser, ladder, args, table):
    """Rows; what is in the table already is not run again."""
    points, old, rows = make_points(ladder, args), {row["point"]: row for row in read_rows(table)} if table.exists() else {}, []
    dt = scene_step(args) if any("{dt/2}" in point.text for point in points) else None
    if dt is None and any("{dt/2}" in point.text for point in points):
        parser.error(f"{args.scene} gives no sim: dt, which this ladder halves")
    jobs = [("finest", ladder["finest"])] if ladder.get("reference") is None and "finest" in ladder else []
    for name, text in jobs + [(point.name, point.text) for point in points]:
        if name in old:
            rows.append(old[name])
            continue
        row = {"point": name, **run_point(text, ladder, args, dt)}
        print(f"{name:<40} {row['value'][:12]:>12} {row['cpu_s']:>8} s  {row['ended']}", file=sys.stderr, flush=True)
        rows.append(row)
        write_rows(table, COLUMNS, rows)
    return rows


def judge_rows(ladder, rows, shifted):
    """Fill in errors, the worst of them with those of shifted meshes {point: [error]}, and the front; returns the reference."""
    good = [row for row in rows if row["ended"] == "ok"]
    if not good:
        sys.exit("tradeoff: no point of the ladder came to an end: " + rows[0]["ended"])
    reference = ladder.get("reference")
    if reference is None:
        finest = [row for row in good if row["point"] == "finest"] or [max(good, key=lambda row: float(row["unknowns"]) * max(1, float(row["steps"])))]
        reference = float(finest[0]["value"])
        finest[0]["front"] = "reference"
    for row in good:
        row["error"] = f"{abs(float(row['value']) - reference) / abs(reference):.3g}"
        row["worst"] = max([row["error"], *shifted.get(row["point"], [])], key=float)
    usable = [row for row in good if row["front"] != "reference"]
    for row in usable:
        mine = (float(row["worst"]), float(row["cpu_s"]))
        others = ((float(o["worst"]), float(o["cpu_s"])) for o in usable if o is not row)
        row["front"] = "" if any(e <= mine[0] and c <= mine[1] and (e, c) != mine for e, c in others) else "yes"
    return reference


# ---- reports ----


def read_shifted(output, stem):
    """{point: errors} of the tables of shifted meshes."""
    found = {}
    for path in sorted(output.glob(f"{stem}-shift*.csv")):
        for row in read_rows(path):
            if row["error"]:
                found.setdefault(row["point"], []).append(row["error"])
    return found


def preset_of(row, ladder, presets):
    """Name of the preset that a point is, on the mesh and step it has; or ''."""
    words = row["options"].split()
    pairs = {words[i].lstrip("-"): words[i + 1] for i in range(len(words) - 1)}
    return next((name for name, options in presets.items() if all(pairs.get(key) == value for key, value in options.items())), "")


def recommend(rows, target):
    target *= 1 + 1e-9  # 19.4 / 100 < 0.194
    good = [row for row in rows if row["error"] and row["front"] != "reference" and float(row["worst"]) <= target]
    return min(good, key=lambda row: float(row["cpu_s"])) if good else None


def title_of(ladder):
    return ladder.get("name", f"`{ladder['quantity']}`")


def write_report(path, name, ladder, reference, presets, rows, file):
    print(f"# {name}: error of {title_of(ladder)} against CPU time\n", file=file)
    kind = f"reference {reference:.8g}" if ladder.get("reference") is not None else f"the finest run, {reference:.8g}"
    print(f"{machine_name()}, one rank; error relative to {kind}. Points on the front first, then the others; CPU seconds with set-up.\n", file=file)
    good = sorted((row for row in rows if row["error"] and row["front"] != "reference"), key=lambda row: (row["front"] != "yes", float(row["cpu_s"])))
    cells = [[row["point"], f"{100 * float(row['error']):.3g} %", f"{100 * float(row['worst']):.3g} %", row["cpu_s"], row["unknowns"], row["front"] or "-", preset_of(row, ladder, presets) or "-", f"`{row['options']}`"] for row in good]
    print_table(["point", "error", "worst over shifts", "CPU [s]", "unknowns", "front", "preset", "options"], cells, file)
    for row in rows:
        if row["ended"] != "ok":
            print(f"\n{row['point']}: {row['ended']}", file=file)
    print("\nCheapest options for an accuracy:\n", file=file)
    picks = [(target, recommend(rows, target)) for target in (0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4)]
    print_table(["error at most", "point", "CPU [s]", "options"], [[f"{100 * t:g} %", row["point"], row["cpu_s"], f"`{row['options']}`"] for t, row in picks if row], file)
    print(f"\n![{name}]({path.name})", file=file)


def draw(path, name, ladder, presets, rows):
    fig, ax = pyplot().subplots(figsize=(8.5, 5.5), constrained_layout=True)
    good = [row for row in rows if row["error"] and row["front"] != "reference"]
    floor = min((float(row["worst"]) for row in good if float(row["worst"]) > 0), default=1e-12) / 2
    place = lambda row: (float(row["cpu_s"]), 100 * max(float(row["worst"]), floor))
    beaten = [place(row) for row in good if row["front"] != "yes"]
    ax.loglog(*zip(*beaten), "o", color="0.78", ms=4, label="beaten by another point") if beaten else None
    front = sorted((row for row in good if row["front"] == "yes"), key=place)
    ax.loglog(*zip(*map(place, front)), "o-", color="#1d3557", ms=6, lw=1, label="front")
    for i, row in enumerate(front):
        ax.annotate(row["point"], place(row), xytext=(7, 5 if i % 2 == 0 else -9), textcoords="offset points", fontsize=6.5, color="#1d3557")
    for preset, colour in zip(presets, ("#e9c46a", "#4c9f70", "#c1121f")):
        here = [place(row) for row in good if preset_of(row, ladder, presets) == preset]
        if here:
            ax.loglog(*zip(*here), "s", ms=9, mfc="none", mec=colour, label=f"-preset {preset}")
    ax.set(xlabel="CPU time of a run on one core [s]", ylabel=f"error of {title_of(ladder).replace('`', '')} [%]", title=name)
    ax.set_xlim(right=1.8 * max(float(row["cpu_s"]) for row in good))
    ax.grid(True, which="major", color="0.92")
    save_figure(fig, path, [ax])


def main():
    parser, args = parse_arguments()
    ladder, presets = read_ladder(parser, args)
    output, name = Path(args.output), Path(args.scene).stem + (f"-shift{args.shift}" if args.shift else "")
    output.mkdir(parents=True, exist_ok=True)
    table = output / f"{name}.csv"
    if args.read and not table.exists():
        parser.error(f"{table} is not there: run without --read")
    if table.exists():
        check_columns(table, COLUMNS)
    rows = read_rows(table) if args.read else run_ladder(parser, ladder, args, table)
    reference = judge_rows(ladder, rows, {} if args.shift else read_shifted(output, name))
    write_rows(table, COLUMNS, rows)
    draw(output / f"{name}.png", name, ladder, presets, rows)
    with open(output / f"{name}.md", "w") as file:
        write_report(output / f"{name}.png", name, ladder, reference, presets, rows, file)
    if args.target is None:
        print((output / f"{name}.md").read_text())
        return 0
    best = recommend(rows, args.target)
    if not best:
        least = min((row for row in rows if row["error"] and row["front"] != "reference"), key=lambda row: float(row["worst"]))
        print(f"no point of the ladder reaches {100 * args.target:g} %; the best is '{least['point']}' with {100 * float(least['worst']):.2g} %")
        return 1
    print(f"{best['point']}: error {100 * float(best['worst']):.2g} %, {best['cpu_s']} s of CPU time\n  build/tumble {args.scene} {best['options']}")
    return 0
