"""What ranks send one another, counted on any number of ranks (more than cores, too), and a model for machines that nobody has run on.

  tools/scaling --counts --ranks 1,2,4,8,16,32 runs/studies/scaling/crowd.yaml -mesh_cells '{20 * n},20' -mesh_upper '{n},1' -particle_grain_count '{50 * n}'

Counts come from tools/mpicount.c through the profiling interface of MPI, hypre's included: what `--steps` steps take after as many others and the
set-up. They do not depend on how fast the machine is or on what else it does. Writes <scene>-counts.csv, .md and .png into runs/studies/scaling (--output).
"""

import math
import shlex
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from toolbox import ROOT, launcher, option_text, print_table, printable, pyplot, read_rows, run_scene, save_figure, write_rows

COLUMNS = ["ranks", "cells", "unknowns", "bodies", "outer_mean", "balance_cells", "messages", "messages_most", "kbytes", "kbytes_most", "collectives", "collective_bytes",
           "gathered_bytes", "memory_mb", "points", "together"]  # fmt: skip
SHOWN = ["ranks", "unknowns", "bodies", "iterations", "cells max/mean", "messages a step", "most of a rank", "kB a step", "most of a rank", "collectives a step", "bytes", "gathered, bytes", "MB a rank", "points at which ranks wait", "of all ranks"]
RANKS = [2**k for k in range(18)]
LINE = ("compute", "collectives", "messages", "what every rank knows of all")


def build_counter(folder, build):
    compiler = shlex.split((ROOT / build / "flags").read_text())[0]
    path = Path(folder) / "mpicount.so"
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", path, ROOT / "tools" / "mpicount.c"], check=True)
    return path


def run_counted(args, scene, options, n, steps, folder):
    """({(rank, kind): [calls, bytes]}, summary) of a whole run"""
    counter, counts = build_counter(folder, args.build), Path(folder) / f"counts-{steps}"
    launch = [*launcher(n), "env", f"LD_PRELOAD={counter}", f"MPICOUNT={counts}"]
    run = run_scene(scene, {**options, "sim_steps": str(steps), "output_every": "0"}, n, Path(folder) / f"run-{steps}", args.build, args.limit, launch)
    if not run.summary:
        sys.exit(f"scaling: {n} ranks {run.ended}: {run.message}\n  {printable(run.command)}")
    found = {}
    for line in counts.read_text().splitlines():
        rank, kind, calls, size, *_ = line.split()
        found[int(rank), kind] = [int(calls), int(size)]
    return found, run.summary


def count_one(args, scene, options, n):
    with tempfile.TemporaryDirectory(prefix="tumble-counts-") as folder:
        short, _ = run_counted(args, scene, options, n, args.steps, folder)
        long, summary = run_counted(args, scene, options, n, 2 * args.steps, folder)
    step = {key: [(b - a) / args.steps for a, b in zip(short[key], long[key])] for key in long}
    kinds = defaultdict(list)
    for (_, kind), values in step.items():
        kinds[kind].append(values)
    sent, points, together = kinds.pop("message"), kinds.pop("point"), kinds.pop("together")
    gathered = max(size for _, size in kinds["allgather"])
    balance = summary["balance"]["cells"]
    return {
        "ranks": n, "cells": summary["cells"], "unknowns": summary["unknowns"], "bodies": summary["bodies"], "outer_mean": f"{summary['outer_iterations']['mean']:.2f}",
        "balance_cells": f"{balance['max'] / balance['mean']:.3f}",
        "messages": f"{sum(calls for calls, _ in sent) / n:.1f}", "messages_most": f"{max(calls for calls, _ in sent):.1f}",
        "kbytes": f"{sum(size for _, size in sent) / n / 1e3:.1f}", "kbytes_most": f"{max(size for _, size in sent) / 1e3:.1f}",
        "collectives": f"{sum(max(calls for calls, _ in values) for values in kinds.values()):.1f}",
        "collective_bytes": f"{sum(max(size for _, size in values) for values in kinds.values()) - gathered:.0f}", "gathered_bytes": f"{gathered:.0f}",
        "memory_mb": f"{summary['memory_mb'] / n:.1f}", "points": f"{max(calls for calls, _ in points):.1f}",
        "together": f"{max(calls for calls, _ in together):.1f}",
    }  # fmt: skip


class Model:
    """Seconds of a step on n ranks of which each has as many cells and bodies as in the last row.

    compute: unknowns of a rank times `work` times the balance of cells of the last row. Collectives: log2(n) latencies each, their bytes log2(n) times over the network; messages: a
    latency each and their bytes, as many as the busiest rank of the last row, which has neighbours on all sides. What every rank knows of all: PetscLayout, 4 bytes a rank and
    gathering call; velocities of all bodies, gathered once a step, and contact and motion of all bodies, `body` seconds each. Iterations, and with them all counts, stay as in the
    last row. Nothing overlaps; no contention in the network."""

    def __init__(self, row, args):
        self.row = {name: float(value) for name, value in row.items()}
        self.work, self.body, self.latency, self.bandwidth = args.work, args.body, args.latency, args.bandwidth

    def parts(self, n):
        r = self.row
        deep = math.log2(n) if n > 1 else 0
        known = r["gathered_bytes"] * n / r["ranks"] / self.bandwidth + self.body * r["bodies"] / r["ranks"] * n
        return (
            r["unknowns"] / r["ranks"] * self.work * (r["balance_cells"] if n > 1 else 1),
            deep * (r["collectives"] * self.latency + r["collective_bytes"] / self.bandwidth),
            (r["messages_most"] * self.latency + 1e3 * r["kbytes_most"] / self.bandwidth) if n > 1 else 0,
            known if n > 1 else self.body * r["bodies"] / r["ranks"],
        )


def write_report(path, scene, options, rows, model, args):
    with open(path.with_suffix(".md"), "w") as file:
        print(f"# {path.stem}: `{scene} {option_text(options)}`\n\nCounted, a step and rank (mean over ranks, and the busiest):\n", file=file)
        print_table(SHOWN, [[row[name] for name in COLUMNS if name != "cells"] for row in rows], file)
        print(f"\nPREDICTED from these counts, not measured. Assumed: {1e6 * args.work:.3g} us of work a step and unknown, {1e6 * args.body:.3g} us a body that every rank moves,"
              f" {1e6 * args.latency:.3g} us of latency, {args.bandwidth / 1e9:.3g} GB/s a rank; as much work and as many bodies a rank as on {rows[-1]['ranks']} ranks; iterations constant;"
              " nothing overlaps.\n", file=file)  # fmt: skip
        table = [[n, *(f"{part:.3g}" for part in model.parts(n)), f"{sum(model.parts(n)):.3g}", f"{sum(model.parts(1)) / sum(model.parts(n)):.2f}"] for n in RANKS]
        print_table(["ranks", *(f"{name} [s]" for name in LINE), "step [s]", "efficiency"], table, file)
        print(f"\n![{path.stem}]({path.stem}.png)", file=file)
    print(path.with_suffix(".md").read_text())


def draw(path, rows, model):
    fig, (left, right) = pyplot().subplots(1, 2, figsize=(9.5, 3.8), constrained_layout=True)
    ranks = [int(row["ranks"]) for row in rows]
    for name, label, mark in (("messages_most", "messages, busiest rank", "o-"), ("kbytes_most", "kB sent, busiest rank", "s-"), ("collectives", "collectives", "^-"),
                              ("collective_bytes", "their bytes", "v-"), ("gathered_bytes", "gathered bytes", "d-")):  # fmt: skip
        left.loglog(ranks, [max(float(row[name]), 0.1) for row in rows], mark, label=label)
    left.set(xlabel="ranks", ylabel="a step", title="counted")
    for i, name in enumerate(LINE):
        right.loglog(RANKS[1:], [model.parts(n)[i] for n in RANKS[1:]], "--", label=name)
    right.loglog(RANKS, [sum(model.parts(n)) for n in RANKS], "k-", label="all")
    right.set(xlabel="ranks", ylabel="s a step", title="predicted, as much work a rank")
    for ax in (left, right):
        ax.grid(True, color="0.9")
    save_figure(fig, path.with_suffix(".png"), (left, right))


def collect(args, scene, options_of, what, ranks, columns, count):
    """<scene>-<what>.csv and its rows: with --read those that are there, else count(args, scene, options, n) on every number n of ranks."""
    path = Path(args.output) / f"{Path(scene).stem}-{what}.csv"
    if args.read:
        return path, read_rows(path)
    rows = []
    for n in ranks:
        print(f"{path.stem}: {n} ranks", file=sys.stderr, flush=True)
        rows.append(count(args, ROOT / scene if (ROOT / scene).exists() else scene, options_of(n), n))
        write_rows(path, columns, rows)
    return path, rows


def main(args, scene, options_of):
    """options_of(n): those of the program on n ranks."""
    ranks = [int(word) for word in (args.ranks or "1,2,4,8").split(",")]
    path, rows = collect(args, scene, options_of, "counts", ranks, COLUMNS, count_one)
    model = Model(rows[-1], args)
    draw(path, rows, model)
    write_report(path, scene, options_of("n"), rows, model, args)
    return 0
