"""Numbers that stand in headers of scenes and in README: do they still hold?

runs/validate/said.toml has the sentences, with holes for the numbers:

  [[said]]
  file = "runs/cylinder-2d1.yaml"
  text = "Ours: {cylinder-2d1: cd}, {cylinder-2d1: cl}"

A hole is {case: quantity}, or {case: quantity | expression of x}, x what the case measured, as runs/validate/results.csv has it, which
'tools/validate --store' fills. A number may be one unit of its last digit off: machines differ in the digits after.
"""

import csv
import math
import re

from toolbox import ROOT, check_keys, read_toml

STORE = ["case", "quantity", "ours", "commit"]
HOLE = re.compile(r"\{([^:{}]+): ([^|{}]+?)(?: \| ([^{}]+))?\}")
NUMBER = r"[-+]?(?:\d{1,3}(?:,\d{3})+|\d+(?:\.\d+)?|\.\d+)(?:e[-+]?\d+)?"


def read_store(path):
    """{(case, quantity): row}"""
    if not path.is_file():
        return {}
    with open(path, newline="") as file:
        return {(row["case"], row["quantity"]): row for row in csv.DictReader(file)}


def store(path, rows, commit):
    """Keep what cases measured, rows as validate's table has them; others stay."""
    kept = read_store(path)
    for case, quantity, ours, *_ in rows:
        if ours != "-":
            kept[case, quantity] = dict(zip(STORE, (case, quantity, ours, commit)))
    with open(path, "w", newline="") as file:
        out = csv.DictWriter(file, STORE, lineterminator="\n")
        out.writeheader()
        out.writerows(kept[key] for key in sorted(kept))


def read_said(parser, path):
    said = read_toml(parser, path).get("said", [])
    for entry in said:
        check_keys(parser, f"{path}: said", entry, {"file", "text"})
        if not HOLE.search(entry["text"]):
            parser.error(f"{path}: '{entry['text']}' has no hole for a number")
    return said


def pattern_of(text):
    """The sentence as it may stand in a file: broken over lines, which begin with # in a scene."""
    words = lambda part: r"(?:\s|\n#)+".join(map(re.escape, re.split(r"\s+", part)))
    parts, begin = [], 0
    for hole in HOLE.finditer(text):
        parts += [words(text[begin : hole.start()]), f"({NUMBER})"]
        begin = hole.end()
    return re.compile("".join([*parts, words(text[begin:])]))


def last_digit(number):
    """What one unit of the last digit of a printed number is: 0.01 of "3.14", 1e-7 of "8e-7"."""
    mantissa, _, exponent = number.lower().partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def like(number, value):
    """value with as many digits as the printed number has."""
    mantissa, _, exponent = number.lower().partition("e")
    digits = len(mantissa.partition(".")[2])
    text = f"{value / 10 ** int(exponent):.{digits}f}e{exponent}" if exponent else f"{value:{',' if ',' in number else ''}.{digits}f}"
    text = "+" + text if number[0] == "+" and value > 0 else text
    return re.sub(r"^([-+]?)0\.", r"\1.", text) if re.match(r"[-+]?\.", number) else text


def value_of(hole, kept):
    """The number for a hole; None: its case has not been stored."""
    case, quantity, expression = hole
    row = kept.get((case, quantity))
    if row is None:
        return None
    x = float(row["ours"])
    return float(eval(expression, {"__builtins__": {}, "abs": abs, "pi": math.pi}, {"x": x})) if expression else x  # noqa: S307


def check(entry, kept, write=False):
    """Lines about a sentence: [] if it holds. With write the numbers of the file are replaced."""
    path = ROOT / entry["file"]
    text = path.read_text()
    match = pattern_of(entry["text"]).search(text)
    if not match:
        return [f"{entry['file']}: no longer says '{entry['text']}': correct it, or runs/validate/said.toml"]
    wrong, pieces, begin = [], [], match.start()
    for k, hole in enumerate(HOLE.findall(entry["text"]), 1):
        value, said = value_of(hole, kept), match[k]
        if value is None:
            wrong.append(f"{entry['file']}: {said} for {hole[0]}: {hole[1]}, which is not in runs/validate/results.csv: tools/validate --store {hole[0]}")
            continue
        if abs(value - float(said.replace(",", ""))) > 1.01 * last_digit(said):
            wrong.append(f"{entry['file']}: {said} for {hole[0]}: {hole[1]}, measured {like(said, value)}")
            pieces += [text[begin : match.start(k)], like(said, value)]
            begin = match.end(k)
    if write and pieces:
        path.write_text(text[: match.start()] + "".join(pieces) + text[begin:])
    return wrong


def check_all(parser, folder, write):
    """Lines about all sentences that do not hold."""
    kept = read_store(folder / "results.csv")
    return [line for entry in read_said(parser, folder / "said.toml") for line in check(entry, kept, write)]
