"""The ledger of claims: one page of what the program promises, the reference, its source, what was measured, how far it may be off, and the verdict.

Called by 'tools/validate --ledger'. Claims are the declarations of runs/validate/*.toml; what was measured stands in results.csv (cases) and
presets.csv (scenes with each preset) beside them. A claim that was never measured is a hole and says so; the exit status is 1 if one is not kept.
"""

from pathlib import Path

from kinds.presets import HOLE, PROMISE, describe, fill, read_declarations, read_table
from kinds.said import read_store

HEADS = ["claim", "reference", "source", "measured", "tolerance", "verdict"]
INTRO = """# Ledger of claims

Written by `tools/validate --ledger` from `results.csv` (`tools/validate --store`: cases) and
[presets.csv](presets.md) (`tools/validate --presets --table runs/validate/presets.csv`). References, sources and tolerances are declared in the
`.toml` files here before a run; scenes and their tables: [scenes](scenes.md).
"""


def case_rows(cases, known, judge, deviation):
    rows = []
    for name, case in cases.items():
        for quantity in case["quantities"]:
            what = quantity.get("name", quantity["value"])
            ours = known.get((name, what), {}).get("ours")
            reference, tolerance, within = judge(quantity, ours and float(ours))
            verdict = ("within" if within else "NOT within") + deviation(quantity, float(ours)) if ours else HOLE
            rows.append([f"{name}: {what}", reference, quantity.get("source", case.get("source", "")), ours or "", tolerance, verdict])
    return rows


def preset_rows(entries, known):
    sources = {(name, describe(q)): q["source"] for name, entry in entries.items() for q in entry.get("quantities", [])}
    rows = []
    for scene, preset, what, value, converged, off, promise, _, verdict in fill(entries, known):
        if preset not in PROMISE:
            continue
        if off:
            verdict = f"{verdict} ({float(off):+.2g} %)"
        rows.append([f"{scene}, preset {preset}: {what}", converged, sources[scene, what], value, f"{promise} %", verdict])
    return rows


def is_kept(row):
    return row[-1].startswith(("within", "refused"))


def write(folder, cases, verdicts, parser):
    """verdicts: validate's judge and deviation. Writes README.md into the folder; returns the claims that are not kept, and the number of holes."""
    folder = Path(folder)
    groups = {
        "Cases": case_rows(cases, read_store(folder / "results.csv"), *verdicts),
        "Presets": preset_rows(read_declarations(parser, folder), read_table(folder / "presets.csv")),
    }
    rows = [row for group in groups.values() for row in group]
    holes = [row for row in rows if row[-1] == HOLE]
    broken = [row for row in rows if not is_kept(row) and row[-1] != HOLE]
    refused = sum(row[-1].startswith("refused") for row in rows)
    text = [INTRO, f"{len(rows)} claims: {len(rows) - len(holes) - len(broken) - refused} within, {refused} refused by the preset, {len(broken)} NOT within, {len(holes)} not run."]
    for row in broken:
        text.append(f"* NOT kept: {row[0]}: {row[3] or '-'} for {row[1]}, tolerance {row[4]}")
    for title, group in groups.items():
        lines = ["| " + " | ".join(str(word).replace("|", "/") for word in row) + " |" for row in [HEADS, ["---"] * len(HEADS), *group]]
        text += ["", f"## {title}", "", *lines]
    (folder / "README.md").write_text("\n".join(text) + "\n")
    return broken, len(holes)
