"""Values of a run: what an expression such as "largest('cd', 4, 8)" or "body(0).at('y', 2)" may use, and its analysis of signals.

Names: the quantities and numbers of summary.json; columns of series.csv through at, first, last, largest, smallest, mean, period; the same of one
body of bodies.csv through body(k), of a drop of drops.csv through drop(k); sample(field, time, x, y) in its fields; kiss_time, distance, tilt, momentum_drift; published, rms; the functions of math with abs, min, max, int, str, zip.
"""

import bisect
import csv
import json
import math
import statistics

from toolbox import ROOT, read_numbers
from tumble.reader import tell_renamed

PLAIN = {**{name: value for name, value in vars(math).items() if name[0] != "_"}, "abs": abs, "min": min, "max": max, "int": int, "str": str, "zip": zip}


def compute(expression, **names):
    """Value of an expression of a list of this tree (nothing foreign is evaluated)."""
    return eval(expression, {"__builtins__": {}, **PLAIN, **names})


class Table:
    """Columns over time of series.csv or of one body of bodies.csv; linear between the rows."""

    def __init__(self, rows):
        self.rows = rows
        self.time = [row["time"] for row in rows]

    def column(self, name, since=-math.inf, until=math.inf):
        if self.rows and name not in self.rows[0]:
            raise ValueError(f"no column '{name}' (there are: {', '.join(self.rows[0])}){tell_renamed(name)}")
        values = [row[name] for row in self.rows if since <= row["time"] <= until]
        if not values:
            raise ValueError(f"no row of '{name}' in the range of time")
        return values

    def at(self, name, time):
        values = self.column(name)
        i = bisect.bisect_left(self.time, time)
        if i < len(values) and self.time[i] == time:
            return values[i]
        if not 0 < i < len(values):
            raise ValueError(f"time {time:g} is outside the run ({self.time[0]:g} to {self.time[-1]:g})")
        share = (time - self.time[i - 1]) / (self.time[i] - self.time[i - 1])
        return values[i - 1] + share * (values[i] - values[i - 1])

    def crossing(self, name, value):
        """First time at which a column passes a value, linear between the rows."""
        values = self.column(name)
        for t, s, a, b in zip(self.time, self.time[1:], values, values[1:]):
            if min(a, b) <= value <= max(a, b):
                return t + (s - t) * (value - a) / (b - a) if a != b else t
        raise ValueError(f"'{name}' does not pass {value:g}")

    def period(self, name, since=-math.inf, until=math.inf):
        """Mean time between upward crossings of the mean of the largest and the smallest value."""
        values, times = self.column(name, since, until), [time for time in self.time if since <= time <= until]
        middle = (max(values) + min(values)) / 2
        pairs = zip(zip(times, values), zip(times[1:], values[1:]))
        up = [t + (s - t) * (middle - a) / (b - a) for (t, a), (s, b) in pairs if a < middle <= b]
        if len(up) < 2:
            raise ValueError(f"no period of '{name}' in the range of time")
        return (up[-1] - up[0]) / (len(up) - 1)

    def names(self):
        return {
            "at": self.at,
            "column": self.column,
            "crossing": self.crossing,
            "period": self.period,
            "first": lambda name: self.column(name)[0],
            "last": lambda name: self.column(name)[-1],
            "largest": lambda name, since=-math.inf, until=math.inf: max(self.column(name, since, until)),
            "smallest": lambda name, since=-math.inf, until=math.inf: min(self.column(name, since, until)),
            "mean": lambda name, since=-math.inf, until=math.inf: statistics.fmean(self.column(name, since, until)),
        }


class Body:
    """body(k).at("y", 2): the functions of a table on the rows of one body."""

    def __init__(self, rows):
        self.__dict__.update(Table(rows).names())


def kiss_time(bodies, a=0, b=1, factor=1.05):
    """First time at which the centres of two discs or spheres are `factor` mean diameters apart, linear between the rows."""
    rows = [sorted((row for row in bodies if row["body"] == k), key=lambda row: row["time"]) for k in (a, b)]
    before = None
    for one, two in zip(*rows):
        apart = math.hypot(*(one[axis] - two[axis] for axis in "xyz" if axis in one))
        now = (one["time"], apart - factor * (one["radius"] + two["radius"]))
        if now[1] <= 0:
            return now[0] if before is None else before[0] + (now[0] - before[0]) * before[1] / (before[1] - now[1])
        before = now
    raise ValueError(f"bodies {a} and {b} do not come within {factor} diameters")


def distance(bodies, time, a=0, b=1):
    """Distance of the centres of two bodies."""
    tables = [Table([row for row in bodies if row["body"] == k]) for k in (a, b)]
    return math.hypot(*(tables[0].at(axis, time) - tables[1].at(axis, time) for axis in "xyz" if axis in bodies[0]))


def tilt(bodies, time, a=0, b=1):
    """Angle of the line from the centre of body a to that of body b against the last axis, in degrees: 0 where b is straight above a."""
    axes = "xyz" if "z" in bodies[0] else "xy"
    tables = [Table([row for row in bodies if row["body"] == k]) for k in (a, b)]
    apart = [tables[1].at(axis, time) - tables[0].at(axis, time) for axis in axes]
    return math.degrees(math.acos(apart[-1] / math.hypot(*apart)))


def momentum_drift(bodies, count, dim=2):
    """Largest change of the momentum of `count` discs (3: spheres) from the first time on, over the sum of their |m u| then; every time must have each of them once."""
    times, change, start, size = {}, 0, None, 0
    for row in bodies:
        times.setdefault(row["time"], []).append(row)
    for time, rows in sorted(times.items()):
        if sorted(row["body"] for row in rows) != list(range(count)):
            raise ValueError(f"at time {time:g} there are {len(rows)} rows of {len({row['body'] for row in rows})} bodies in place of {count}")
        parts = [[row["density"] * row["radius"] ** dim * row[name] for name in "uvw"] for row in rows]
        momentum = [math.fsum(column) for column in zip(*parts)]
        if start is None:
            start, size = momentum, math.fsum(math.hypot(*part) for part in parts)
        change = max(change, math.dist(momentum, start) / size)
    return change


def published(scene, quantity):
    """(time, value) of the points of runs/reference/<scene>.csv."""
    with open(ROOT / "runs" / "reference" / f"{scene}.csv") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [(float(row["time"]), float(row["value"])) for row in rows if row["quantity"] == quantity]


def rms(values):
    """Root of the mean square."""
    if not values:
        raise ValueError("no values")
    return math.sqrt(sum(value * value for value in values) / len(values))


def sample(folder, field, time, *place):
    """First number of a field at a place, in the snapshot nearest to the time."""
    import tumble

    return tumble.open(str(folder)).snapshot(time=time).sample(field, [list(place)]).ravel()[0]


def names_of_run(folder):
    """What the expression of a quantity may use."""
    summary = json.loads((folder / "summary.json").read_text())
    bodies = read_numbers(folder / "bodies.csv")
    return {
        **{key: value for key, value in summary.items() if isinstance(value, (int, float))},
        **summary["quantities"],
        **Table(read_numbers(folder / "series.csv")).names(),
        "published": published,
        "rms": rms,
        "sample": lambda *what: sample(folder, *what),
        "kiss_time": lambda a=0, b=1, factor=1.05: kiss_time(bodies, a, b, factor),
        "distance": lambda time, a=0, b=1: distance(bodies, time, a, b),
        "tilt": lambda time, a=0, b=1: tilt(bodies, time, a, b),
        "momentum_drift": lambda count, dim=2: momentum_drift(bodies, count, dim),
        "drop": lambda k=0: Body([row for row in read_numbers(folder / "drops.csv") if row["drop"] == k]),
        "body": lambda k=0: Body([row for row in bodies if row["body"] == k]),
    }


def measure(expression, names):
    """(value, None) or (None, what is wrong)."""
    try:
        return float(compute(expression, **names)), None
    except (NameError, ValueError, TypeError, AttributeError, SyntaxError, ZeroDivisionError, FileNotFoundError) as error:
        return None, f"'{expression}': {error}"
