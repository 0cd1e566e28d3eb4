"""Strong and weak scaling over numbers of ranks, communication, load balance, and a model that predicts larger machines.

  tools/scaling                                            the series of runs/bench/scaling.toml (make scaling)
  tools/scaling --ranks 1,2,4,8,16 --only cavity-strong
  tools/scaling runs/sedimentation.yaml --ranks 1,2 -mesh_cells 256,768                          one strong series
  tools/scaling runs/bench/cavity.yaml --ranks 1,2 -mesh_cells '332,{332 * n}' -mesh_upper '1,{n}'  one weak series
  tools/scaling --counts --ranks 1,2,4,8,16 SCENE ...      what is sent, counted on more ranks than cores, and a model to 131,072 ranks: tools/kinds/counts.py
  tools/scaling --model --ranks 1,2,4 SCENE ...            step on 10^3 to 10^5 ranks from counted waiting, bytes and processor seconds: tools/kinds/predict.py
  tools/scaling --read                                     tables, model and plots from the rows that are there

Options with one dash go to the program; {...} in their values is computed with n, the number of ranks. Writes <series>.csv, <series>.md
and <series>.png into runs/studies/scaling (--output). Times are medians over the steps but the first ones; the
table has the cores there are and the load of the machine before each run, and remarks below it say what spoils the times; messages, bytes and
reductions come from PETSc's log (-log_view); what hypre sends is not in it. Predictions are the model's and are marked so.
On a cluster: runs/bench/scaling.slurm.
"""

import csv
import math
import os
import re
import sys
import tempfile
from pathlib import Path

from cores import count_cores
from kinds import counts, predict as prediction
from quantities import compute
from toolbox import (
    ROOT, check_columns, choose, launcher, make_parser, option_text, print_table, printable, pyplot, read_options, read_rows, read_toml, run_scene, save_figure, split_words, write_rows,
)  # fmt: skip

LIST = ROOT / "runs" / "bench" / "scaling.toml"
OUTPUT = ROOT / "runs" / "studies" / "scaling"
COLUMNS = (
    "ranks,pinned,commit,machine,cells,unknowns,bodies,total_s,nse_s,force_s,particle_s,output_s,outer_mean,efficiency,balance_cells,balance_nodes,balance_body_cells,balance_bodies,"
    "wait_share,messages_per_step,kbytes_per_step,reductions_per_step,triad_all_gbs,memory_mb,cores,load"
).split(",")
STEPS, SKIP = 10, 3
MANY = 20000  # unknowns a rank: with fewer the exchanges between ranks weigh more than the work
BUSY = 0.3  # cores that others may take before it is told
LATENCY, BANDWIDTH = 2e-6, 10e9  # of the network that the model assumes: s, bytes/s a rank
PREDICTED = [2**k for k in range(13)]


def parse_arguments():
    parser = make_parser(__doc__, limit=3600, add_help=False)
    parser.add_argument("scene", nargs="?", metavar="SCENE")
    parser.add_argument("--help", action="help", help="show this text")
    parser.add_argument("--ranks", metavar="N[,N]", help="numbers of ranks instead of those of the list")
    parser.add_argument("--only", metavar="SERIES[,SERIES]", help="these series of the list")
    parser.add_argument("--steps", type=int, default=STEPS, metavar="N", help=f"steps a run; the first {SKIP} are not counted (default: %(default)s)")
    parser.add_argument("--counts", action="store_true", help="count messages and bytes in place of time; of one SCENE")
    parser.add_argument("--model", action="store_true", help="predict a step from what is counted; of one SCENE")
    parser.add_argument("--machine", metavar="NAME", help="a machine of runs/bench/machines.csv, for --model (default: all of them)")
    parser.add_argument("--wait", type=float, metavar="S", help="in its place, for --model: seconds that ranks lose at a point where they wait for each other")
    parser.add_argument("--rate", type=float, metavar="B/S", help="likewise: bytes that a rank packs, sends and unpacks in a second")
    parser.add_argument("--slow", type=float, default=1, metavar="X", help="likewise: how many times slower cores are when all work (default: %(default)g)")
    parser.add_argument("--beyond", action="store_true", help="for --model: also more ranks than counted")
    parser.add_argument("--work", type=float, default=2e-6, metavar="S", help="seconds a step and unknown, for the model of --counts (default: %(default)g)")
    parser.add_argument("--body", type=float, default=2e-7, metavar="S", help="seconds a step and body, for the model of --counts (default: %(default)g)")
    parser.add_argument("--read", action="store_true", help="run nothing")
    parser.add_argument("--node", type=int, metavar="N", help="cores of a node that share its memory bandwidth, for the model (default: the largest number of ranks run)")
    parser.add_argument("--latency", type=float, default=LATENCY, metavar="S", help="of the network, for the model (default: %(default)s)")
    parser.add_argument("--bandwidth", type=float, default=BANDWIDTH, metavar="B/S", help="of the network a rank, for the model (default: %(default)g)")
    parser.add_argument("--list", default=str(LIST), metavar="FILE", help="list of series (default: runs/bench/scaling.toml)")
    parser.add_argument("--output", default=str(OUTPUT), metavar="FOLDER", help="default: runs/studies/scaling")
    args, rest = parser.parse_known_args()
    return parser, args, rest


def read_series(parser, args, rest):
    if args.scene and not args.scene.endswith((".yaml", ".yml")):
        parser.error(f"'{args.scene}' is no scene file (.yaml): options of the program need a SCENE before them")
    options = read_options(rest, parser.error)
    if args.scene:
        kind = "weak" if any("{" in (value or "") for value in options.values()) else "strong"
        series = {f"{Path(args.scene).stem}-{kind}": {"scene": args.scene, "options": options, "ranks": [1, 2]}}
    else:
        if options:
            parser.error("options of the program need a SCENE before them")
        series = choose(parser, "series", read_toml(parser, args.list), split_words(args.only))
    for entry in series.values():
        entry["weak"] = any("{" in str(value) for value in entry["options"].values())
        if args.ranks:
            entry["ranks"] = [int(word) for word in args.ranks.split(",")]
    return series


def fill(value, n):
    return None if value is None else re.sub(r"\{([^}]*)\}", lambda found: str(compute(found[1], n=n)), str(value))


# ---- one run ----


def read_log(path, steps):
    """From PETSc's log of the steps: messages and kB that a rank sends in a step (mean over ranks), reductions in a step, and the share of the time in the ends of
    exchanges (data under way, or a rank that waits for others)."""
    counts, whole, waiting = {}, {}, {}  # by (stage, rank); a line that stands twice holds the same numbers
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            if row["Stage Name"] not in ("Flow", "Bodies", "Output"):
                continue
            key = (row["Stage Name"], row["Rank"])
            if row["Event Name"] == "summary":
                counts[key] = [float(row[name]) for name in ("Num Messages", "Message Length", "Num Reductions")]
                whole[key] = float(row["Time"])
            elif row["Event Name"] in ("SFBcastEnd", "SFReduceEnd", "VecScatterEnd"):
                waiting[key, row["Event Name"]] = float(row["Time"])
    ranks = len({rank for _, rank in counts})
    messages, length, reductions = (sum(values[i] for values in counts.values()) / ranks / steps for i in range(3))
    return messages, length / 1024, reductions, sum(waiting.values()) / sum(whole.values())


def share(summary, name):
    """Largest over mean of what the ranks have to do; 1 is perfect."""
    entry = summary["balance"].get(name, {"mean": 0})
    return f"{entry['max'] / entry['mean']:.3f}" if entry["mean"] else "-"


def run_one(args, entry, n, folder):
    options = {name: fill(value, n) for name, value in entry["options"].items()}
    load = os.getloadavg()[0]
    options.update(sim_steps=str(args.steps), output_every="0", output_bandwidth=None, log_view=f":{folder}/log.csv:ascii_csv")
    run = run_scene(ROOT / entry["scene"] if (ROOT / entry["scene"]).exists() else entry["scene"], options, n, folder, args.build, args.limit, launcher(n, pinned=True))
    if not run.summary:
        sys.exit(f"scaling: {n} ranks {run.ended}: {run.message}\n  {printable(run.command)}")
    run.refuse_slow("scaling")
    summary, measured = run.summary, run.measured(SKIP)
    messages, kbytes, reductions, waiting = read_log(folder / "log.csv", summary["steps"])
    return {
        **measured,
        **{name: f"{measured[name]:.{digits}g}" for name, digits in (("total_s", 5), ("nse_s", 5), ("force_s", 4), ("particle_s", 4))},
        "output_s": f"{summary['seconds']['output'] / summary['steps']:.4g}",
        **{f"balance_{name}": share(summary, name) for name in ("cells", "nodes", "body_cells", "bodies")},
        "wait_share": f"{waiting:.3f}",
        "messages_per_step": f"{messages:.4g}",
        "kbytes_per_step": f"{kbytes:.4g}",
        "reductions_per_step": f"{reductions:.4g}",
        "cores": count_cores(),
        "load": f"{load:.2f}",
    }


def remarks(rows):
    """What spoils the table: ranks that share cores, other work, too little work a rank."""
    few = [row["ranks"] for row in rows if row["ranks"] > 1 and float(row["unknowns"]) / row["ranks"] < MANY]
    if few:
        yield f"With {join(few)} ranks a rank has fewer than {MANY:,} unknowns: exchanges between ranks weigh more than work. Take a finer mesh"
    if not all(row.get("cores") for row in rows):  # of an earlier version, which did not write them
        return
    shared = [row["ranks"] for row in rows if row["ranks"] > int(row["cores"])]
    if shared and len({row["ranks"] // int(row["cores"]) for row in rows}) > 1:
        yield f"{join(shared)} ranks share {rows[0]['cores']} cores: their times say nothing about scaling, their counts of messages do"
    # the load of the row before may still be in the mean over a minute
    busy = [row["ranks"] for k, row in enumerate(rows) if float(row["load"]) > BUSY + max([0, *(before["ranks"] for before in rows[:k])])]
    if busy:
        yield f"Other work took more than {BUSY} cores before the runs with {join(busy)} ranks: their times are too long. Repeat on an idle machine"


def join(numbers):
    return " and ".join(filter(None, [", ".join(map(str, numbers[:-1])), str(numbers[-1])]))


def add_efficiency(rows, weak):
    """Time per unknown and rank of the first row over that of each row."""
    first = rows[0]
    for row in rows:
        work = (float(row["unknowns"]) / row["ranks"]) / (float(first["unknowns"]) / first["ranks"])
        row["efficiency"] = f"{float(first['total_s']) * work / float(row['total_s']):.3f}"


# ---- the model ----


class Model:
    """t(n) = a U/n s(n) i(n) + latency (log2(n) reductions + messages) + bytes/bandwidth.

    a: seconds per unknown of the first run. s: how much slower a rank is when all cores of its node compute (they share the memory), fitted to the last run, which should fill a
    node; constant beyond. i: load balance of the last run. Reductions and messages a step as in the last run; the bytes go with the square root of the unknowns of a rank (the edge
    of its part in 2D). Iterations are taken as constant."""

    def __init__(self, rows, node, latency, bandwidth):
        first, last = rows[0], rows[-1]
        self.a = float(first["total_s"]) * first["ranks"] / float(first["unknowns"])
        self.node, self.latency, self.bandwidth = node, latency, bandwidth
        self.imbalance = float(last["balance_cells"])
        self.messages, self.kbytes, self.reductions = (float(last[name]) for name in ("messages_per_step", "kbytes_per_step", "reductions_per_step"))
        self.part = float(last["unknowns"]) / last["ranks"]
        self.slowdown = max(1.0, float(last["total_s"]) / (self.a * self.part * self.imbalance)) if last["ranks"] > first["ranks"] else 1.0

    def seconds(self, unknowns, n):
        part = unknowns / n
        compute = self.a * part * (self.slowdown if n >= self.node else 1 + (self.slowdown - 1) * math.log2(n) / math.log2(max(2, self.node))) * (self.imbalance if n > 1 else 1)
        if n == 1:
            return compute
        network = self.latency * (math.log2(n) * self.reductions + self.messages) + 1024 * self.kbytes * math.sqrt(part / self.part) / self.bandwidth
        return compute + network


def predict(model, rows, weak):
    """(ranks, unknowns, seconds, efficiency) for powers of two beyond what was measured, as long as a rank keeps 5,000 unknowns."""
    base, out = rows[0], []
    for n in PREDICTED:
        unknowns = float(base["unknowns"]) * (n / base["ranks"] if weak else 1)
        if n <= rows[-1]["ranks"] or unknowns / n < 5000:
            continue
        seconds = model.seconds(unknowns, n)
        out.append((n, unknowns, seconds, float(base["total_s"]) * (unknowns / n) / (float(base["unknowns"]) / base["ranks"]) / seconds))
    return out


# ---- reports ----

SHOWN = {
    "ranks": "ranks", "unknowns": "unknowns", "bodies": "bodies", "total_s": "step [s]", "efficiency": "efficiency", "outer_mean": "iterations", "balance_cells": "cells max/mean",
    "balance_body_cells": "body cells max/mean", "wait_share": "in exchanges", "messages_per_step": "messages a step", "kbytes_per_step": "kB a step", "reductions_per_step": "reductions a step",
    "cores": "cores", "load": "load before",
}  # fmt: skip


def write_report(path, name, entry, rows, model, predicted, file):
    kind = "weak" if entry["weak"] else "strong"
    print(f"# {name}: {kind} scaling of `{entry['scene']} {option_text(entry['options'])}`\n", file=file)
    print(f"Measured, {rows[0]['machine']}, commit {rows[0]['commit']}; messages and kB a rank sends (without hypre's):\n", file=file)
    print_table(list(SHOWN.values()), [[row.get(key) or "-" for key in SHOWN] for row in rows], file)
    for line in remarks(rows):
        print(f"\n* {line}.", file=file)
    print(
        f"\nPREDICTED by a model, not measured: {1e6 * model.a:.3g} us a step and unknown on one rank, {model.slowdown:.2f} times slower on a node with {model.node} ranks, balance {model.imbalance:.2f};"
        f" network assumed: {1e6 * model.latency:.3g} us, {model.bandwidth / 1e9:.3g} GB/s a rank; iterations constant.\n",
        file=file,
    )
    print_table(["ranks", "unknowns", "step [s]", "efficiency"], [[n, f"{unknowns:.3g}", f"{seconds:.3g}", f"{efficiency:.2f}"] for n, unknowns, seconds, efficiency in predicted], file)
    print(f"\n![{name}]({path.name})", file=file)


def draw(path, name, entry, rows, predicted):
    fig, (left, right) = pyplot().subplots(1, 2, figsize=(9.5, 3.8), constrained_layout=True)
    ranks = [row["ranks"] for row in rows]
    left.loglog(ranks, [float(row["total_s"]) for row in rows], "o-", color="#1d3557", label="measured")
    left.loglog([p[0] for p in predicted], [p[2] for p in predicted], "s--", color="#e07a5f", mfc="white", label="predicted by the model")
    reach = [ranks[0], predicted[-1][0] if predicted else ranks[-1]]
    ideal = [float(rows[0]["total_s"]) * (1 if entry["weak"] else reach[0] / n) for n in reach]
    left.loglog(reach, ideal, ":", color="0.5", label="ideal")
    left.set(xlabel="ranks", ylabel="wall clock a step [s]", title=f"{name}: time")
    right.semilogx(ranks, [float(row["efficiency"]) for row in rows], "o-", color="#1d3557", label="measured")
    right.semilogx([p[0] for p in predicted], [p[3] for p in predicted], "s--", color="#e07a5f", mfc="white", label="predicted by the model")
    right.axhline(1, ls=":", color="0.5")
    right.set(xlabel="ranks", ylabel="efficiency", ylim=(0, 1.15), title="efficiency")
    for ax in (left, right):
        ax.grid(True, color="0.9")
    save_figure(fig, path, (left, right))


def main():
    parser, args, rest = parse_arguments()
    if args.counts or args.model:
        if not args.scene:
            parser.error(f"--{'model' if args.model else 'counts'} needs a SCENE")
        options = read_options(rest, parser.error)
        return (prediction if args.model else counts).main(args, args.scene, lambda n: options if n == "n" else {name: fill(value, n) for name, value in options.items()})
    output = Path(args.output)
    output.mkdir(parents=True, exist_ok=True)
    for name, entry in read_series(parser, args, rest).items():
        table = output / f"{name}.csv"
        if args.read:
            if not table.exists():
                sys.exit(f"scaling: {table} is not there: run without --read")
            check_columns(table, COLUMNS)
            rows = [{**row, "ranks": int(row["ranks"])} for row in read_rows(table)]
        else:
            rows = []
            for n in entry["ranks"]:
                print(f"{name}: {n} ranks", file=sys.stderr, flush=True)
                with tempfile.TemporaryDirectory(prefix="tumble-scaling-") as folder:
                    rows.append(run_one(args, entry, n, Path(folder)))
            add_efficiency(rows, entry["weak"])
            write_rows(table, COLUMNS, rows)
        model = Model(rows, args.node or rows[-1]["ranks"], args.latency, args.bandwidth)
        predicted = predict(model, rows, entry["weak"])
        draw(output / f"{name}.png", name, entry, rows, predicted)
        with open(output / f"{name}.md", "w") as file:
            write_report(output / f"{name}.png", name, entry, rows, model, predicted, file)
        print((output / f"{name}.md").read_text())
    return 0
