"""Run the scenes of runs/validate/*.toml at the resolution that their references need, and compare.

  tools/validate                       all cases (make validate); what will run, and how long, is told first
  tools/validate cylinder-2d1 dkt      these cases; a name stands for all cases that begin with it
  tools/validate --longest 2           cases of at most two minutes
  tools/validate --list                cases and commands, nothing is run
  tools/validate --show                the table from the results that are there, nothing is run
  tools/validate --store ...           keep what is measured in runs/validate/results.csv (also with --show)
  tools/validate --said                do the numbers in headers of scenes and README agree with it? (runs/validate/said.toml); --write corrects them
  tools/validate --presets             what the presets promise: every declared scene with each preset (names, --longest, --list, --show as above);
                                       rows of earlier runs stay in the table: --table runs/validate/presets.csv is the one of the tree
  tools/validate --ledger              the page of all claims, runs/validate/README.md, from results.csv and presets.csv there, nothing is run

Prints one table (quantity, ours, reference, tolerance, source, verdict) and writes it to table.csv in the folder of the results.
The exit status is 1 if a quantity is not within its tolerance. How a case is declared stands in runs/validate/scenes.md.
"""

import concurrent.futures
import csv
import json
import shlex
import sys
from pathlib import Path

from kinds import ledger
from kinds.presets import run_presets
from kinds.said import check_all, store
from quantities import measure, names_of_run
from toolbox import ROOT, check_keys, launcher, make_parser, print_table, printable, read_options, read_toml, run_scene

CASES = ROOT / "runs" / "validate"
COLUMNS = ["case", "quantity", "ours", "reference", "tolerance", "source", "verdict"]
CASE_KEYS = {"scene", "options", "each", "ranks", "minutes", "source", "quantities"}
QUANTITY_KEYS = {"name", "value", "spread", "source", "reference", "tolerance", "relative", "at_most", "at_least"}
SLACK = 10  # a run is ended after so many times its declared minutes


def parse_arguments():
    parser = make_parser(__doc__)
    parser.add_argument("names", nargs="*", metavar="CASE", help="beginnings of the names of cases (default: all)")
    parser.add_argument("--longest", type=float, metavar="MIN", help="only cases of at most so many minutes")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="cases at a time (default: %(default)s)")
    parser.add_argument("--list", action="store_true", help="print the cases and their commands only")
    parser.add_argument("--show", action="store_true", help="compare what is in the folder of the results, without running")
    parser.add_argument("--store", action="store_true", help="keep the values in results.csv beside the declarations")
    parser.add_argument("--said", action="store_true", help="check the numbers of headers and README, without running")
    parser.add_argument("--write", action="store_true", help="with --said: correct them")
    parser.add_argument("--presets", action="store_true", help="the table scene x preset in place of the cases")
    parser.add_argument("--choose", default="fast,balanced,accurate", metavar="LIST", help="with --presets: these alone (default: %(default)s)")
    parser.add_argument("--table", metavar="FILE", help="with --presets: the table to fill (default: presets.csv in the folder of the results)")
    parser.add_argument("--ledger", action="store_true", help="write the page of all claims; the exit status is 1 if one is not kept")
    parser.add_argument("--cases", default=str(CASES), metavar="FOLDER", help="folder of the declarations (default: runs/validate)")
    parser.add_argument("--results", default="out/validate", metavar="FOLDER", help="a folder for each case, and the table (default: %(default)s)")
    return parser, parser.parse_args()


# ---- declarations ----


def check_quantity(parser, where, quantity):
    check_keys(parser, f"{where}: quantity", quantity, QUANTITY_KEYS)
    kinds = [key for key in ("reference", "at_most", "at_least") if key in quantity]
    if "value" not in quantity or len(kinds) != 1:
        parser.error(f"{where}: a quantity needs value and one of reference, at_most, at_least")
    if kinds == ["reference"] and ("tolerance" in quantity) == ("relative" in quantity):
        parser.error(f"{where}: '{quantity['value']}' needs tolerance (absolute) or relative")


def read_cases(parser, folder):
    """{name: case}; every case checked."""
    cases = {}
    for path in sorted(Path(folder).glob("*.toml")):
        for name, case in read_toml(parser, path).items():
            if name in ("presets", "said"):  # kinds/presets.py, kinds/said.py
                continue
            where = f"{path}: [{name}]"
            check_keys(parser, where, case, CASE_KEYS)
            if missing := {"scene", "minutes", "quantities"} - set(case):
                parser.error(f"{where}: key '{min(missing)}' is missing")
            if name in cases:
                parser.error(f"{where}: there is another case of this name")
            for quantity in case["quantities"]:
                check_quantity(parser, where, quantity)
                if quantity.get("spread") and len(case.get("each", [])) < 2:
                    parser.error(f"{where}: '{quantity['value']}' asks for a spread: the case needs two options or more in each")
            cases[name] = case
    return cases


def choose(parser, cases, args):
    for name in args.names:
        if not any(case.startswith(name) for case in cases):
            parser.error(f"no case '{name}' (there are: {', '.join(cases)})")
    chosen = {name: case for name, case in cases.items() if not args.names or any(name.startswith(word) for word in args.names)}
    chosen = {name: case for name, case in chosen.items() if args.longest is None or case["minutes"] <= args.longest}
    if not chosen:
        parser.error(f"no case is left (there are: {', '.join(cases)})")
    return chosen


def runs_of(name, case):
    """{folder: options} of the runs of a case: one, or one for each of its options `each`."""
    options = case.get("options", "")
    return {f"{name}/{k}": f"{options} {more}" for k, more in enumerate(case["each"], 1)} if "each" in case else {name: options}


# ---- verdicts ----


def judge(quantity, ours):
    """Reference and tolerance as text, and whether ours is within."""
    if "at_most" in quantity:
        return f"<= {quantity['at_most']:.10g}", "", ours is not None and ours <= quantity["at_most"]
    if "at_least" in quantity:
        return f">= {quantity['at_least']:.10g}", "", ours is not None and ours >= quantity["at_least"]
    reference = quantity["reference"]
    allowed = quantity["tolerance"] if "tolerance" in quantity else quantity["relative"] * abs(reference)
    text = f"{quantity['tolerance']:g}" if "tolerance" in quantity else f"{100 * quantity['relative']:g} %"
    return f"{reference:.12g}", text, ours is not None and abs(ours - reference) <= allowed


def deviation(quantity, ours):
    """How far ours is from the reference, as a share of it where it has a size."""
    if ours is None or "reference" not in quantity:
        return ""
    difference = ours - quantity["reference"]
    return f" ({100 * difference / abs(quantity['reference']):+.2g} %)" if quantity["reference"] else f" ({difference:+.2g})"


def worst(quantity, values):
    """What a quantity is over the runs of a case: its spread, or the value that is worst off."""
    if quantity.get("spread"):
        return (max(values) - min(values)) / abs(sum(values) / len(values))
    if "reference" in quantity:
        return max(values, key=lambda value: abs(value - quantity["reference"]))
    return max(values) if "at_most" in quantity else min(values)


def measure_runs(quantity, runs):
    """(value, None) or (None, what is wrong)."""
    found = [measure(quantity["value"], names) for names in runs]
    problem = next((problem for _, problem in found if problem), None)
    return (None, problem) if problem else (worst(quantity, [value for value, _ in found]), None)


def rows_of(name, case, results, failure):
    """One row a quantity."""
    runs = [] if failure else [names_of_run(results / folder) for folder in runs_of(name, case)]
    rows = []
    for quantity in case["quantities"]:
        ours, problem = (None, failure) if failure else measure_runs(quantity, runs)
        reference, tolerance, within = judge(quantity, ours)
        verdict = f"not: {problem}" if problem else ("within" if within else "NOT within") + deviation(quantity, ours)
        source = quantity.get("source", case.get("source", ""))
        rows.append([name, quantity.get("name", quantity["value"]), "-" if ours is None else f"{ours:.8g}", reference, tolerance, source, verdict])
    return rows


# ---- runs ----


def command_of(case, options, args):
    return [*launcher(case.get("ranks", 1)), str((ROOT / args.build / "tumble").resolve()), case["scene"], *shlex.split(options)]


def run_case(name, case, args):
    """What went wrong, or None."""
    for folder, options in runs_of(name, case).items():
        print(f"running {folder}", file=sys.stderr, flush=True)
        run = run_scene(case["scene"], read_options(options), case.get("ranks", 1), Path(args.results) / folder, args.build, 60 * SLACK * case["minutes"] + 60, cwd=ROOT)
        if run.ended != "ok":
            return f"{run.ended}: {run.message[:300]}" if run.message else f"{run.ended} after {run.seconds:.0f} s"
    return None


def run_cases(cases, args):
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        futures = {name: pool.submit(run_case, name, case, args) for name, case in cases.items()}
        return {name: future.result() for name, future in futures.items()}


def missing_results(cases, args):
    there = lambda folder: (Path(args.results) / folder / "summary.json").is_file()
    return {name: None if all(map(there, runs_of(name, case))) else "not run" for name, case in cases.items()}


def print_plan(cases, args):
    for name, case in cases.items():
        print(f"  {name:<28} {case['minutes']:6.1f} min  {case['scene']}" + (f", {len(case['each'])} runs" if "each" in case else ""))
        for options in runs_of(name, case).values() if args.list else ():
            print(f"    {printable(command_of(case, options, args))}")
    total = sum(case["minutes"] * case.get("ranks", 1) for case in cases.values())
    print(f"{len(cases)} cases, about {total:.0f} minutes of one core", flush=True)


def commit_of(rows, cases, results):
    """Of the first run whose values are among the rows."""
    for name in dict.fromkeys(row[0] for row in rows if row[2] != "-"):
        for folder in runs_of(name, cases[name]):
            return json.loads((results / folder / "summary.json").read_text())["commit"]
    return ""


def tell_said(parser, args):
    lines = check_all(parser, Path(args.cases), args.write)
    print("\n".join(lines) or "all numbers hold")
    return 1 if lines and not args.write else 0


def write_ledger(parser, args):
    broken, holes = ledger.write(args.cases, read_cases(parser, args.cases), (judge, deviation), parser)
    for row in broken:
        print(f"NOT kept: {row[0]}: {row[3] or '-'} for {row[1]}, tolerance {row[4]}: {row[5]}")
    print(f"{Path(args.cases) / 'README.md'}: {len(broken)} not kept, {holes} not run")
    return 1 if broken else 0


def main():
    parser, args = parse_arguments()
    if args.said:
        return tell_said(parser, args)
    if args.presets:
        return run_presets(parser, args)
    if args.ledger:
        return write_ledger(parser, args)
    if args.table:
        parser.error("--table is read with --presets only")
    cases = choose(parser, read_cases(parser, args.cases), args)
    if not args.show:
        print_plan(cases, args)
    if args.list:
        return 0
    failures = missing_results(cases, args) if args.show else run_cases(cases, args)
    rows = [row for name, case in cases.items() for row in rows_of(name, case, Path(args.results), failures[name])]
    Path(args.results).mkdir(parents=True, exist_ok=True)
    with open(Path(args.results) / "table.csv", "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
    print_table(COLUMNS, rows)
    if args.store:
        store(Path(args.cases) / "results.csv", rows, commit_of(rows, cases, Path(args.results)))
    within = sum(row[-1].startswith("within") for row in rows)
    print(f"{within} within tolerance, {len(rows) - within} not")
    return 0 if within == len(rows) else 1
