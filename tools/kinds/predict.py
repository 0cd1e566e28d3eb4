"""A step on ranks that nobody has: processor seconds of one rank, and what is counted on a few.

  tools/scaling --model --ranks 1,4,16 runs/sedimentation-10000.yaml
  tools/scaling --model --ranks 1,2,4,8 runs/studies/scaling/crowd.yaml -mesh_cells '{20 * n},20' -mesh_upper '{n},1' -particle_grain_count '{50 * n}'
  tools/scaling --model --read --wait 2e-5 --beyond runs/sedimentation-10000.yaml                from the rows that are there, to 100,000 ranks

A step on p ranks takes T1/p balance slow + points wait + bytes/rate: T1 are the processor seconds of a step on one rank (user and system, so that other guests of the machine
do not count), balance the cells of the fullest rank over the mean; points at which ranks wait for each other and bytes that the busiest rank sends are counted by
tools/mpicount.c. slow (cores that all work at once against one alone), wait (a point, with ranks that come late) and rate (what a rank packs, sends and unpacks) are those of a
machine, fitted to what was measured there (runs/bench/machines.csv; least squares of relative errors, none below 1, 0, 0). The report shows that fit row by row with its
misfit. Which machine is asked with --machine, or --slow, --wait and --rate are given. Nothing is said of more ranks than counted, unless --beyond asks for it: reductions then
take log2(p)/4 of their time on 16, the bytes of a part go with its surface, iterations are those of one rank, and points stay but for those that grow with the unknowns.
A strong series keeps the scene, a weak one ({n} in the options) the work of a rank. Writes <scene>-model.csv and .md into --output.
"""

import itertools
import math
import resource
import sys
import tempfile
from pathlib import Path

from kinds import counts
from toolbox import ROOT, launcher, option_text, print_table, read_rows, run_scene

MACHINES = ROOT / "runs" / "bench" / "machines.csv"  # measured steps on many cores, with what was counted
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


class Machine:
    """slow, wait [s], rate [bytes/s], from measured rows or as given"""

    def __init__(self, name, rows=(), slow=1, wait=0, rate=math.inf):
        self.name, self.rows, self.most = name, [{key: float(row[key]) for key in ("ranks", "balance", "points", "mbytes", "alone_s", "step_s")} | {"scene": f"{row['scene']}, {row['commit']}"} for row in rows], 0
        self.slow, self.wait, self.rate = slow, wait, rate
        if self.rows:
            self.most = max(row["ranks"] for row in self.rows)
            self.fit()

    def parts(self, row):
        return row["alone_s"] / row["ranks"] * row["balance"] * self.slow, row["points"] * self.wait, 1e6 * row["mbytes"] / self.rate

    def misfit(self, row):
        return sum(self.parts(row)) / row["step_s"] - 1

    def fit(self):
        """The best of all ways to hold some of the three at their bounds"""
        found = []
        for held in itertools.product((True, False), repeat=3):
            columns = [[row["alone_s"] / row["ranks"] * row["balance"], row["points"], 1e6 * row["mbytes"]] for row in self.rows]
            free = [k for k in range(3) if not held[k]]
            if len(free) > len(self.rows):
                continue
            value = [1.0, 0.0, 0.0]
            if free:
                matrix = [[column[k] / row["step_s"] for k in free] for column, row in zip(columns, self.rows)]
                right = [1 - (column[0] / row["step_s"] if held[0] else 0) for column, row in zip(columns, self.rows)]
                solved = solve_least_squares(matrix, right)
                for k, x in zip(free, solved or ()):
                    value[k] = x
                if not solved or value[0] < 1 or min(value[1:]) < 0:
                    continue
            self.slow, self.wait, self.rate = value[0], value[1], 1 / value[2] if value[2] > 0 else math.inf
            found.append((sum(self.misfit(row) ** 2 for row in self.rows), self.slow, self.wait, self.rate))
        self.slow, self.wait, self.rate = min(found)[1:]

    def describe(self):
        rate = f"{self.rate / 1e9:.2g} GB/s a rank" if self.rate < math.inf else "bytes cost nothing"
        return f"{self.name}: cores {self.slow:.2f} times as slow when all work, {1e6 * self.wait:.3g} us a point, {rate}"


def solve_least_squares(matrix, right):
    """Normal equations by elimination; None: they are singular"""
    n = len(matrix[0])
    scale = [math.sqrt(sum(row[k] ** 2 for row in matrix)) or 1 for k in range(n)]
    system = [[sum(row[i] * row[j] for row in matrix) / scale[i] / scale[j] for j in range(n)] + [sum(row[i] * b for row, b in zip(matrix, right)) / scale[i]] for i in range(n)]
    for i in range(n):
        pivot = max(range(i, n), key=lambda k: abs(system[k][i]))
        if abs(system[pivot][i]) < 1e-12:
            return None
        system[i], system[pivot] = system[pivot], system[i]
        for k in range(n):
            if k != i:
                factor = system[k][i] / system[i][i]
                system[k] = [a - factor * b for a, b in zip(system[k], system[i])]
    return [system[i][n] / system[i][i] / scale[i] for i in range(n)]


def read_machines():
    machines = {}
    for row in read_rows(MACHINES):
        machines.setdefault(row["machine"], []).append(row)
    return {name: Machine(name, rows) for name, rows in machines.items()}


def choose_machines(args):
    if args.wait is not None or args.rate is not None:
        return [Machine("as given", slow=args.slow, wait=args.wait or 0, rate=args.rate or math.inf)]
    machines = read_machines()
    if args.machine and args.machine not in machines:
        sys.exit(f"scaling: --machine {args.machine}: runs/bench/machines.csv has {', '.join(machines)}; or give --wait and --rate")
    return [machines[args.machine]] if args.machine else list(machines.values())


class Model:
    """rows: counted ones, the first on one rank with its processor seconds"""

    def __init__(self, rows, weak, dimension, machine):
        self.rows = [{name: float(value) for name, value in row.items() if value != ""} for row in rows]
        self.weak, self.surface, self.machine, self.wait, self.rate = weak, (dimension - 1) / dimension, machine, machine.wait, machine.rate
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
        return work * balance * self.machine.slow, waiting, 1e3 * kbytes / self.rate

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


def write_fit(machine, file):
    print(f"\n## {machine.describe()}\n", file=file)
    if not machine.rows:
        print("Not fitted: the numbers are those of the command line.\n", file=file)
        return
    print(f"Fitted to {len(machine.rows)} measured steps on at most {machine.most:.0f} ranks:\n", file=file)
    table = [[row["scene"], f"{row['ranks']:.0f}", f"{row['step_s']:.3g}", *(f"{part:.3g}" for part in machine.parts(row)), f"{sum(machine.parts(row)):.3g}", f"{100 * machine.misfit(row):+.0f} %"] for row in machine.rows]
    print_table(["scene", "ranks", "measured [s]", "work [s]", "waiting [s]", "bytes [s]", "model [s]", "misfit"], table, file)


def write_prediction(model, beyond, file):
    machine = model.machine
    print(f"\nPREDICTED: {1e6 * model.work:.3g} us a step and unknown on one rank of this machine. A rank with fewer than 5,000 unknowns is left out.\n", file=file)
    table = []
    for p in RANKS:
        unknowns = model.unknowns * (p if model.weak else 1)
        if not model.counted(p) and not (beyond and p > model.last["ranks"] and unknowns / p >= 5000):
            continue
        kind = "counted" if model.counted(p) else "extrapolated"
        kind += ", more ranks than measured" if machine.most and p > machine.most else ""
        table.append([p, kind, f"{unknowns:.3g}", *(f"{part:.3g}" for part in model.parts(p)), f"{model.seconds(p):.3g}", f"{model.efficiency(p):.2f}"])
    print_table(["ranks", "points", "unknowns", "work [s]", "waiting [s]", "bytes [s]", "step [s]", "efficiency"], table, file)
    if not beyond:
        print("\nNo row beyond the counted ranks: --beyond extrapolates, which nothing here has tested.", file=file)


def write_report(path, scene, options, rows, models, beyond, file):
    model = models[0]
    kind = "weak" if model.weak else "strong"
    print(f"# {path.stem}: {kind} scaling of `{scene} {option_text(options)}`\n\nCounted, a step:\n", file=file)
    print_table(["ranks", "unknowns", "iterations", "cells max/mean", "points at which ranks wait", "of them reductions", "kB of the busiest rank", "processor s"],
                [[row[name] for name in COLUMNS if name not in ("cells", "bodies")] for row in rows], file)  # fmt: skip
    for one in models:
        write_fit(one.machine, file)
        write_prediction(one, beyond, file)


def main(args, scene, options_of):
    """options_of(n): those of the program on n ranks."""
    ranks = sorted({1, *(int(word) for word in (args.ranks or "1,2,4").split(","))})
    path, rows = counts.collect(args, scene, options_of, "model", ranks, COLUMNS, count_row)
    options = options_of("n")
    weak = any("{" in (value or "") for value in options.values())
    dimension = 3 if len((options.get("mesh_cells") or "").split(",")) == 3 or float(rows[0]["unknowns"]) > 20 * float(rows[0]["cells"]) else 2
    models = [Model(rows, weak, dimension, machine) for machine in choose_machines(args)]
    with open(path.with_suffix(".md"), "w") as file:
        write_report(path, scene, options, rows, models, args.beyond, file)
    print(path.with_suffix(".md").read_text())
    return 0
