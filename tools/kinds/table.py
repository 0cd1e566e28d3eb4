"""Run a scene for every combination of option values and print a markdown table of what came out.

Values of a program option that are to be tried one after the other are separated by '/'; everything with one dash goes to
the program, everything with two is for this tool. A run that fails leaves 'stopped' in the table and its message below it.

  tools/table runs/sedimentation.yaml -mesh_cells 32,96/48,144/64,192 -sim_dt 0.01/0.005/0.0025 -couple_type explicit/implicit
  tools/table runs/sedimentation.yaml -mesh_cells 32,96/64,192 -sim_dt 0.01/0.005 --across sim_dt --show fall_speed_max
  tools/table study.toml                the same from a file: scene, options = { mesh_cells = ["32,96", "64,192"], sim_steps = 10 },
                                        and if wanted show = ["fall_speed_max", "largest('cd', 4)"], across, ranks; the command line wins

What --show names are quantities, other entries of summary.json with dots, or expressions as in runs/validate (quantities.py).
"""

import itertools
import json
import re
import sys
import tempfile
from pathlib import Path

from quantities import measure, names_of_run
from toolbox import Run, check_keys, make_parser, print_table, read_options, read_toml, run_scene

LONGEST = 300  # characters of a failed run's message
SHOW = "fall_speed_max,outer_iterations.mean,seconds.total"
KEYS = ["scene", "options", "show", "across", "ranks"]


def parse_arguments():
    parser = make_parser(__doc__, usage="tools/table SCENE [-option value[/value...]] ...", add_help=False)
    parser.add_argument("scene", metavar="SCENE")
    parser.add_argument("--help", action="help", help="show this text")
    parser.add_argument("--show", metavar="A,B", help=f"what is shown (default: {SHOW})")
    parser.add_argument("--across", metavar="OPTION", help="the values of this option become columns")
    parser.add_argument("--ranks", type=int, metavar="N", help="MPI ranks (default: 2)")
    parser.add_argument("--keep", metavar="FOLDER", help="keep the results there; runs that are there already, with the same options, are not repeated")
    args, rest = parser.parse_known_args()
    study = {}
    if args.scene.endswith(".toml"):
        study = read_toml(parser, args.scene)
        check_keys(parser, args.scene, study, KEYS)
        args.scene = study.get("scene") or parser.error(f"{args.scene}: key 'scene' is missing")
    args.show = args.show.split(",") if args.show else study.get("show", SHOW.split(","))
    args.across = (args.across or study.get("across", "")).lstrip("-")
    args.ranks = args.ranks or study.get("ranks", 2)
    declared = {name: values if isinstance(values, list) else [values] for name, values in study.get("options", {}).items()}
    return parser, args, {**declared, **split_values(parser, rest)}


def split_values(parser, words):
    """['-a', '1/2', '-b'] -> {'a': ['1', '2'], 'b': [None]}"""
    options = {name: [None] if text is None else text.split("/") for name, text in read_options(words, parser.error).items()}
    for name in ("output_dir", "output_overwrite", "scene_dry_run"):
        if name in options:
            parser.error(f"-{name} is the business of this tool; --keep FOLDER keeps the results")
    return options


def run_one(args, choice, folder):
    """The run, perhaps an earlier one that was kept."""
    record, wanted = folder / "command.json", [args.build, args.scene, args.ranks, choice]
    if (folder / "summary.json").is_file() and record.is_file() and json.loads(record.read_text()) == wanted:
        return Run([], folder, 0, "", "", 0)
    run = run_scene(args.scene, choice, args.ranks, folder, args.build)
    record.write_text(json.dumps(wanted))
    return run


def describe_failure(run):
    series = run.series()
    text = f"stopped {'at t = %g' % series[-1]['time'] if series else 'before the first step'}: {run.message}"
    return text if len(text) <= LONGEST else text[:LONGEST] + " ..."


def look_up(run, names, expression):
    value = names.get(expression)
    if value is None and re.fullmatch(r"[\w.]+", expression):
        value = run.summary
        for part in expression.split("."):
            value = value.get(part) if isinstance(value, dict) else None
    elif value is None:
        value = measure(expression, names)[0]
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def lay_out(varied, show, across, results):
    """Heading and rows; results maps a tuple of values (in the order of varied) to a list of cells."""
    down = [name for name in varied if name != across]
    columns = varied[across] if across else [None]
    heading = down + [f"{quantity}, {across} {value}" if across else quantity for quantity in show for value in columns]
    rows = []
    for values in itertools.product(*(varied[name] for name in down)):
        choice = dict(zip(down, values))
        cells = [results[tuple({**choice, across: column}[name] for name in varied)] for column in columns]
        rows.append([*values, *(cell[i] for i in range(len(show)) for cell in cells)])
    return heading, rows


def main():
    parser, args, options = parse_arguments()
    varied = {name: values for name, values in options.items() if len(values) > 1}
    if args.across and args.across not in varied:
        parser.error(f"--across {args.across}: that option has not several values (varied: {', '.join(varied) or 'none'})")
    results, failures = {}, []
    with tempfile.TemporaryDirectory() as scratch:
        base = Path(args.keep or scratch).resolve()
        for values in itertools.product(*options.values()):
            choice = dict(zip(options, values))
            key = tuple(choice[name] for name in varied)
            folder = base / ("_".join(re.sub(r"[^\w.,+-]", "-", f"{name}-{choice[name]}") for name in varied) or "run")
            print("running " + " ".join(f"-{name} {choice[name]}" for name in varied), file=sys.stderr, flush=True)
            run = run_one(args, choice, folder)
            names = names_of_run(folder) if run.summary else {}
            results[key] = [look_up(run, names, word) for word in args.show] if run.summary else ["stopped"] * len(args.show)
            if not run.summary:
                failures.append((key, describe_failure(run)))
    print_table(*lay_out(varied, args.show, args.across, results))
    if failures:
        print()
    for key, failure in failures:
        print(f"* {', '.join(map(str, key)) or args.scene}: {failure}")
    return 1 if len(failures) == len(results) else 0
