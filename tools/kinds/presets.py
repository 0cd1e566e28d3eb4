"""The promise of the presets: every scene that runs/validate/*.toml declares under [presets], with each preset on the command line.

Called by 'tools/validate --presets'. Rows that were measured before and are not measured now stay in the table; what was never run is a hole and
says so. A preset that refuses a scene keeps its promise by that, and its message is the row. A preset costs more than the cheaper ones, or its run is
the same to the last digit of series.csv (where one direct solve is all there is to choose): then '= fast' stands in place of its seconds. A scene
without a value that is known well enough declares a reason in place of quantities, which is its row. Where a cheaper preset is known to take longer,
`unpriced` says why.
"""

import csv
import sys
from pathlib import Path

from quantities import measure, names_of_run
from toolbox import ROOT, check_keys, children_seconds, print_table, read_options, read_toml, run_scene

PROMISE = {"fast": 5, "balanced": 1, "accurate": 0.2}  # % of the converged value; README.md
COLUMNS = ["scene", "preset", "quantity", "value", "converged", "deviation_percent", "promise_percent", "cpu_seconds", "verdict"]
SCENE_KEYS = {"scene", "options", "ranks", "minutes", "quantities", "reason", "unpriced"}
QUANTITY_KEYS = {"name", "value", "converged", "scale", "source"}
HOLE = "not run"
CLOCK = 1.1  # seconds of one run on a busy machine are known to a tenth,
START = 0.3  # and the start of a process, with files read for the first time, to this
SLACK = 10  # a run is ended after so many times its declared minutes


def check_entry(parser, where, entry):
    check_keys(parser, where, entry, SCENE_KEYS)
    if "reason" in entry:
        if entry.keys() - {"scene", "reason"}:
            parser.error(f"{where}: a scene with a reason has nothing else")
        return
    if missing := {"scene", "minutes", "quantities"} - set(entry):
        parser.error(f"{where}: key '{min(missing)}' is missing")
    for quantity in entry["quantities"]:
        check_keys(parser, f"{where}: quantity", quantity, QUANTITY_KEYS)
        if missing := {"value", "converged", "source"} - set(quantity):
            parser.error(f"{where}: a quantity needs value, converged and source, '{min(missing)}' is missing")
        if not quantity.get("scale", quantity["converged"]):
            parser.error(f"{where}: '{quantity['value']}' converges to 0: give the size that deviations are measured by as scale")


def read_declarations(parser, folder):
    """{name: entry} of all [presets.NAME] of the folder."""
    entries = {}
    for path in sorted(Path(folder).glob("*.toml")):
        for name, entry in read_toml(parser, path).get("presets", {}).items():
            check_entry(parser, f"{path}: [presets.{name}]", entry)
            entries[name] = entry
    if not entries:
        parser.error(f"{folder}: no list of cases declares [presets.<scene>]")
    return entries


# ---- rows ----


def describe(quantity):
    return quantity.get("name", quantity["value"])


def without_clocks(folder):
    """series.csv but for the seconds that steps took."""
    with open(Path(folder) / "series.csv", newline="") as file:
        rows = list(csv.reader(file))
    kept = [i for i, name in enumerate(rows[0]) if not name.startswith("seconds")]
    return [[row[i] for i in kept] for row in rows]


def find_same(name, preset, results):
    """The cheapest preset whose run, in the folder of the results, was the same as this one to the last digit, or None."""
    order = list(PROMISE)
    for other in order[: order.index(preset)]:
        try:
            if without_clocks(Path(results) / f"{name}-{other}") == without_clocks(Path(results) / f"{name}-{preset}"):
                return other
        except FileNotFoundError:
            pass
    return None


def read_seconds(row):
    """Seconds of a row that kept its promise with a run of its own, or None."""
    return None if not row or row[7].startswith("=") or row[-1] != "within" else float(row[7])


def find_prices(rows):
    """Scenes and presets that are not dearer than a cheaper one, as sentences."""
    first = {(row[0], row[1]): row for row in reversed(rows)}
    wrong = []
    for name in dict.fromkeys(row[0] for row in rows):
        paid = [(preset, seconds) for preset in PROMISE if (seconds := read_seconds(first.get((name, preset)))) is not None]
        for (cheap, less), (dear, more) in zip(paid, paid[1:]):
            if CLOCK * more + START <= less:
                wrong.append(f"{name}: {dear} takes {more:g} s, {cheap} {less:g} s")
    return wrong


def row_of(name, preset, quantity, ours, seconds, verdict):
    """verdict None: by the value."""
    converged, size = quantity["converged"], abs(quantity.get("scale", quantity["converged"]))
    percent = None if ours is None else 100 * (ours - converged) / size
    verdict = verdict or ("within" if abs(percent) <= PROMISE[preset] else "NOT within")
    shown = ["" if ours is None else f"{ours:.6g}", f"{converged:.6g}", "" if ours is None else f"{percent:+.3g}"]
    return [name, preset, describe(quantity), *shown, f"{PROMISE[preset]:g}", seconds, verdict]


def rows_of(name, preset, entry, run, cpu):
    """One row a quantity of a run that ended."""
    rows = []
    for quantity in entry["quantities"]:
        ours, problem = (None, None) if run.ended != "ok" else measure(quantity["value"], names_of_run(run.folder))
        verdict = None
        if run.ended == "stopped" and f"-preset {preset} " in run.message:
            verdict = f"refused: {run.message[:300]}"
        elif run.ended != "ok" or problem:
            verdict = f"NOT: {problem or run.message[:300] or run.ended}"
        rows.append(row_of(name, preset, quantity, ours, f"{cpu:.1f}", verdict))
    return rows


def key_of(row):
    return tuple(row[:3])


def read_table(path):
    """{(scene, preset, quantity): row} of an earlier table."""
    if not path.is_file():
        return {}
    with open(path, newline="") as file:
        return {key_of(row): row for row in list(csv.reader(file))[1:]}


def fill(entries, known):
    """All rows in the order of the declarations: known values judged by the converged ones of today, holes for what was never run."""
    rows = []
    for name, entry in entries.items():
        if "reason" in entry:
            rows.append([name, "-", "-", "", "", "", "", "", f"no promise: {entry['reason']}"])
            continue
        for preset in PROMISE:
            for quantity in entry["quantities"]:
                row = known.get((name, preset, describe(quantity)))
                if not row:
                    row = row_of(name, preset, quantity, None, "", HOLE)
                elif row[3]:
                    row = row_of(name, preset, quantity, float(row[3]), row[7], None)
                rows.append(row)
    return rows


def read_notes(path):
    """What a page says below its table, from its first heading of a section on: written by hand, and kept."""
    text = path.read_text() if path.is_file() else ""
    return text[text.index("\n## "):] if "\n## " in text else ""


def write_table(rows, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
    heads = ["scene", "preset", "quantity", "value", "converged", "off [%]", "promise [%]", "CPU [s]", "verdict"]
    lines = ["| " + " | ".join(str(word) for word in row) + " |" for row in [heads, ["---"] * len(heads), *rows]]
    page = path.with_suffix(".md")
    page.write_text("# Scenes and presets\n\nWritten by `tools/validate --presets`.\n\n" + "\n".join(lines) + "\n" + read_notes(page))


# ---- runs ----


def run_one(name, preset, entry, args):
    options = read_options(f"{entry.get('options', '')} -preset {preset} -output_every 0")
    print(f"running {name}, {preset}", file=sys.stderr, flush=True)
    folder = Path(args.results) / f"{name}-{preset}"
    before = children_seconds()
    run = run_scene(entry["scene"], options, entry.get("ranks", 1), folder, args.build, 60 * SLACK * entry["minutes"] + 60, cwd=ROOT)
    rows = rows_of(name, preset, entry, run, children_seconds() - before)
    if run.ended == "ok" and (same := find_same(name, preset, args.results)):
        for row in rows:
            row[7] = f"= {same}"
    return rows


def run_presets(parser, args):
    entries = read_declarations(parser, args.cases)
    for name in args.names:
        if name not in entries:
            parser.error(f"no scene '{name}' (there are: {', '.join(entries)})")
    if wrong := set(args.choose.split(",")) - set(PROMISE):
        parser.error(f"no preset '{min(wrong)}' (there are: {', '.join(PROMISE)})")
    measured = {name: entry for name, entry in entries.items() if "reason" not in entry}
    chosen = [name for name in measured if (not args.names or name in args.names) and (args.longest is None or entries[name]["minutes"] <= args.longest)]
    table = Path(args.table or Path(args.results) / "presets.csv")
    known = read_table(table)
    if args.list:
        print_table(["scene", "minutes", "quantities"], [[name, f"{entries[name]['minutes']:g}", ", ".join(map(describe, entries[name]["quantities"]))] for name in chosen])
        return 0
    for name in sorted(chosen, key=lambda name: entries[name]["minutes"]) if not args.show else []:
        for preset in args.choose.split(","):
            for row in run_one(name, preset, entries[name], args):
                known[key_of(row)] = row
            write_table(fill(entries, known), table)
    write_table(fill(entries, known), table)
    rows = [row for row in fill(entries, known) if row[0] in chosen]
    prices = find_prices([row for row in rows if "unpriced" not in entries[row[0]]])
    print_table(COLUMNS, rows)
    kept = sum(row[-1] == "within" or row[-1].startswith("refused") for row in rows)
    holes = sum(row[-1] == HOLE for row in rows)
    print(f"{kept} kept, {len(rows) - kept - holes} not, {holes} not run")
    for sentence in prices:
        print(f"not dearer: {sentence}")
    return 0 if kept == len(rows) and not prices else 1
