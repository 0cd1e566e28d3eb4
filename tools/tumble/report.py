"""One page about a run: tools/report out/sedimentation

Writes report.html into an output directory: summary, remarks of the program, quantities, pictures, ranges of the columns, the bodies' last
state, options. One file without links to others, that can be mailed. Pictures that tools/plot draws are drawn anew, unless --keep.
"""
import argparse
import base64
import html
import subprocess
import sys
from pathlib import Path

import numpy as np

from .reader import Run

PACKAGES = Path(__file__).resolve().parents[1]
MANY_BODIES = 20
STYLE = """
body {font: 15px/1.45 system-ui, sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #222}
h1 {margin-bottom: 0} h2 {margin-top: 2em; border-bottom: 1px solid #ddd} p.sub {color: #666; margin-top: 0}
table {border-collapse: collapse; margin: .6em 0} th {text-align: left; color: #555; font-weight: 600}
td, th {padding: .15em .9em .15em 0; border-bottom: 1px solid #eee; vertical-align: top} td.n {text-align: right; font-variant-numeric: tabular-nums}
img {max-width: 100%; margin: .5em 0; border: 1px solid #eee} .remark {background: #fff6dd; padding: .4em .8em; margin: .4em 0}
code {background: #f5f5f5; padding: 0 .2em}
"""


def text(value):
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return f"{value:,}".replace(",", " ")
    return f"{value:.6g}" if isinstance(value, (float, np.floating)) else html.escape(str(value))


def table(rows, heading=None):
    """Rows of cells; numbers are aligned."""
    out = ["<table>"]
    if heading:
        out.append("<tr>" + "".join(f"<th>{html.escape(word)}</th>" for word in heading) + "</tr>")
    for row in rows:
        out.append("<tr>" + "".join(f'<td class="n">{text(c)}</td>' if isinstance(c, (int, float, np.number)) else f"<td>{text(c)}</td>" for c in row) + "</tr>")
    return "\n".join([*out, "</table>"])


def overview(run):
    s = run.summary
    seconds = s.get("seconds", {})
    rows = [(name.replace("_", " "), s[name]) for name in ("ranks", "cells", "unknowns", "bodies", "steps", "time_end", "memory_mb") if name in s]
    rows += [(f"seconds, {name}", value) for name, value in seconds.items()]
    rows += [(f"outer iterations, {name}", value) for name, value in s.get("outer_iterations", {}).items()]
    return table(rows) if rows else "<p>The run has not ended: there is no summary.json yet.</p>"


def remarks(run):
    """Sentences that the program printed during the run."""
    found = run.summary.get("remarks", [])
    return "\n".join(f'<p class="remark">{html.escape(line)}</p>' for line in found) or "<p>None.</p>"


def pictures(run):
    out = []
    for path in sorted(run.directory.glob("*.png"), key=lambda path: (path.name.startswith("field"), path.name)):
        data = base64.b64encode(path.read_bytes()).decode()
        out.append(f'<h3>{html.escape(path.stem)}</h3>\n<img alt="{html.escape(path.name)}" src="data:image/png;base64,{data}">')
    return "\n".join(out) or "<p>None.</p>"


def columns(run):
    rows = [(name, v[0], v[-1], np.nanmin(v), np.nanmax(v)) for name, v in run.series.items() if len(v) and v.dtype.kind == "f"]
    return table(rows, ["column of series.csv", "first", "last", "smallest", "largest"]) if rows else "<p>No steps.</p>"


def bodies(run):
    b = run.bodies
    if not len(b):
        return "<p>None.</p>"
    last = b.where(b["time"] == b["time"][-1])
    names = [name for name in ("body", "group", "x", "y", "z", "angle", "u", "v", "w", "omega_z", "force_x", "force_y", "force_z", "gap") if name in last]
    rows = [[int(last[name][i]) if name == "body" else last[name][i] for name in names] for i in range(min(len(last), MANY_BODIES))]
    more = f"<p>The first {MANY_BODIES} of {len(last)}.</p>" if len(last) > MANY_BODIES else ""
    return f"<p>At t = {last['time'][0]:.6g}.</p>" + table(rows, names) + more


def page(run):
    s = run.summary
    scene = s.get("scene", run.directory.resolve().name)
    versions = ", ".join(f"{name} {version}" for name, version in s.get("versions", {}).items())
    parts = [("Summary", overview(run)), ("Remarks", remarks(run)), ("Quantities", table(s.get("quantities", {}).items()) or "<p>None.</p>"), ("Pictures", pictures(run)),
             ("Columns", columns(run)), ("Bodies", bodies(run)), ("Options", table((f"-{name}", value) for name, value in run.options.items()))]
    body = "\n".join(f"<h2>{title}</h2>\n{content}" for title, content in parts)
    sub = html.escape(f"{versions}; commit {s.get('commit', 'unknown')}") if s else "the run has not ended"
    return f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(scene)}: tumble</title><style>{STYLE}</style></head>\n<body>\n<h1>{html.escape(scene)}</h1>\n<p class="sub">{sub}</p>\n{body}\n</body></html>\n'


def main():
    parser = argparse.ArgumentParser(prog="report", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", help="output directory of a run")
    parser.add_argument("--keep", action="store_true", help="show the pictures that are there, draw none")
    options = parser.parse_args()
    try:
        run = Run(options.directory)
    except FileNotFoundError as error:
        sys.exit(f"report: {error}")
    if not options.keep:
        done = subprocess.run([sys.executable, "-m", "tumble.plot", run.directory.resolve()], cwd=PACKAGES, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"report: without new pictures: {done.stderr.strip()}", file=sys.stderr)
    path = run.directory / "report.html"
    path.write_text(page(run))
    print(path)


if __name__ == "__main__":
    main()
