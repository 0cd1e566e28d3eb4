"""A step on ranks that nobody has: processor seconds of one rank, and what is counted on a few.

  tools/scaling --model --ranks 1,4,16 runs/sedimentation-10000.yaml
  tools/scaling --model --ranks 1,2,4,8 runs/studies/scaling/crowd.yaml -mesh_cells '{20 * n},20' -mesh_upper '{n},1' -particle_grain_count '{50 * n}'
  tools/scaling --model --read --wait 2e-5 runs/sedimentation-10000.yaml                         from the rows that are there

A step on p ranks takes T1/p balance + points wait + bytes/rate: T1 are the processor seconds of a step on one rank (user and system, so that other guests of the machine
do not count), balance the cells of the fullest rank over the mean; points at which ranks wait for each other and bytes that the busiest rank sends are counted by
tools/mpicount.c. Measured from 2 to 16 ranks of one machine, time is T1/p + c with the same c within 8 %; two scenes with many points and with many bytes give --wait and
--rate: what a point costs there, with ranks that come late and not the network alone, and what a rank packs, sends and unpacks. Beyond the counted ranks: reductions take
log2(p)/4 of their time on 16; the bytes of a part go with its surface; iterations are those of one rank, with which points and bytes go; points but for those that grow from row to row with the unknowns stay.
On another machine half as many points took no less time (runs/bench/README.md): a prediction holds where --wait and --rate were measured.
A strong series keeps the scene, a weak one ({n} in the options) the work of a rank. Writes <scene>-model.csv and .md into --output.
"""

import math
import resource
import sys
import tempfile
from pathlib import Path

from kinds import counts
from toolbox import ROOT, launcher, option_text, print_table, run_scene

WAIT = 46e-6  # s; 2,156 and 527 points, 4.1 and 22.2 MB of the busiest rank, against the 110 and 81 ms that two scenes lose on 2 to 16 ranks (runs/bench/README.md)
RATE = 0.39e9  # bytes/s
COLUMNS = ["ranks", "cells", "unknowns", "bodies", "outer_mean", "balance_cells", "points", "collectives", "kbytes_most", "processor_s"]
SMALL = 100000  # unknowns
RANKS = [1, 2, 4, 8, 16, 64, 256, 1000, 4000, 10000, 30000, 100000]


def run_alone(args, scene, options):
    """The row of one rank, with user and system time of a step: 2 n steps less n steps, as the others are counted; 6 n where steps are short"""
    spent, times = [], 2
    for steps in (args.steps, None):
        steps = steps or times * args.steps
        with tempfile.TemporaryDirectory(prefix="tumble-model-") as folder:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            run = run_scene(scene, {**options, "sim_steps": str(steps), "output_every": "0"}, 1, Path(folder), args.build, args.limit, launcher(1))
            if not run.summary:
                sys.exit(f"scaling: 1 rank {run.ended}: {run.message}")
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times = 2 if run.summary["unknowns"] > SMALL else 6
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    summary = run.summary
    return {
        "ranks": 1, "cells": summary["cells"], "unknowns": summary["unknowns"], "bodies": summary["bodies"], "outer_mean": f"{summary['outer_iterations']['mean']:.2f}",
        "balance_cells": 1, "points": 0, "collectives": 0, "kbytes_most": 0, "processor_s": f"{(spent[1] - spent[0]) / ((times - 1) * args.steps):.5g}",
    }  # fmt: skip


class Model:
    """rows: counted ones, the first on one rank with its processor seconds"""

    def __init__(self, rows, weak, dimension, wait, rate):
        self.rows = [{name: float(value) for name, value in row.items() if value != ""} for row in rows]
        self.weak, self.surface, self.wait, self.rate = weak, (dimension - 1) / dimension, wait, rate
        first, last = self.rows[0], self.rows[-1]
        self.unknowns, self.work, self.last = first["unknowns"], first["processor_s"] / first["unknowns"], last
        several = [row for row in self.rows if row["ranks"] > 1]
        grown = math.log2(several[-1]["unknowns"] / several[0]["unknowns"]) if weak and len(several) > 1 else 0
        self.growth = max(0, (several[-1]["points"] - several[0]["points"]) / grown) if grown else 0  # a doubling of the unknowns

    def counted(self, p):
        return next((row for row in self.rows if row["ranks"] == p), None)

    def parts(self, p):
        """Seconds of work, of waiting, of bytes"""
        unknowns, last = self.unknowns * (p if self.weak else 1), self.last
        row = self.counted(p)
        work = self.work * unknowns / p
        if p == 1:
            return work, 0, 0
        row, known = row or last, row
        more = self.rows[0]["outer_mean"] / row["outer_mean"] if row["outer_mean"] > 0 and self.rows[0]["outer_mean"] > 0 else 1
        points, reductions, kbytes, balance = more * row["points"], more * row["collectives"], more * row["kbytes_most"], row["balance_cells"]
        if not known:
            points += self.growth * math.log2(max(1, unknowns / last["unknowns"]))
            kbytes *= ((unknowns / p) / (last["unknowns"] / last["ranks"])) ** self.surface
        waiting = (points - reductions) * self.wait + reductions * self.wait * max(1, math.log2(p) / 4)
        return work * balance, waiting, 1e3 * kbytes / self.rate

    def seconds(self, p):
        return sum(self.parts(p))

    def efficiency(self, p):
        return self.seconds(1) / self.seconds(p) / (1 if self.weak else p)


def count_row(args, scene, options, n):
    if n == 1:
        return run_alone(args, scene, options)
    row = {**counts.count_one(args, scene, options, n), "processor_s": ""}
    row["collectives"] = row["together"]
    return {name: row[name] for name in COLUMNS}


def write_report(path, scene, options, rows, model, file):
    kind = "weak" if model.weak else "strong"
    print(f"# {path.stem}: {kind} scaling of `{scene} {option_text(options)}`\n\nCounted, a step:\n", file=file)
    print_table(["ranks", "unknowns", "iterations", "cells max/mean", "points at which ranks wait", "of them reductions", "kB of the busiest rank", "processor s"],
                [[row[name] for name in COLUMNS if name not in ("cells", "bodies")] for row in rows], file)  # fmt: skip
    print(f"\nPREDICTED: {1e6 * model.work:.3g} us a step and unknown on one rank, {1e6 * model.wait:.3g} us a point, {model.rate / 1e9:.3g} GB/s a rank. "
          "A rank with fewer than 5,000 unknowns is left out.\n", file=file)  # fmt: skip
    table = []
    for p in RANKS:
        unknowns = model.unknowns * (p if model.weak else 1)
        if model.counted(p) or (p > model.last["ranks"] and unknowns / p >= 5000):
            table.append([p, "counted" if model.counted(p) else "extrapolated", f"{unknowns:.3g}", *(f"{part:.3g}" for part in model.parts(p)), f"{model.seconds(p):.3g}", f"{model.efficiency(p):.2f}"])
    print_table(["ranks", "points", "unknowns", "work [s]", "waiting [s]", "bytes [s]", "step [s]", "efficiency"], table, file)


def main(args, scene, options_of):
    """options_of(n): those of the program on n ranks."""
    ranks = sorted({1, *(int(word) for word in (args.ranks or "1,2,4").split(","))})
    path, rows = counts.collect(args, scene, options_of, "model", ranks, COLUMNS, count_row)
    options = options_of("n")
    weak = any("{" in (value or "") for value in options.values())
    dimension = 3 if len((options.get("mesh_cells") or "").split(",")) == 3 or float(rows[0]["unknowns"]) > 20 * float(rows[0]["cells"]) else 2
    model = Model(rows, weak, dimension, args.wait, args.rate)
    with open(path.with_suffix(".md"), "w") as file:
        write_report(path, scene, options, rows, model, file)
    print(path.with_suffix(".md").read_text())
    return 0
