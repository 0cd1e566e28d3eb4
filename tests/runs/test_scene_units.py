"""Scenes of all materials in other units: the same iterations and numbers, converted by the units that runs/reference tells of each option and column.

Units are powers of two, so that a run in them differs by nothing but what compares numbers of the scene with constants of the program.
"""
import csv
import json
import re
from pathlib import Path

import pytest
import yaml

from conftest import ROOT
from test_units import Unit

# a length, time, mass and value of a scalar in these units: large ones, small ones
SYSTEMS = {name: [2.0**n for n in powers] for name, powers in {"large": (12, -12, 24, 12), "small": (-24, 12, -36, -12)}.items()}
AS_IN_SPACE = ("surface_tension", "surface_modulus", "area_modulus", "shear_modulus", "bending")  # not those of unit depth
NOISE = 1e-11  # numbers without a unit that are no more than this are round-off
# options that have a default with a unit, by what they need
DEFAULTS = {"flow_density": "1", "flow_viscosity": "0.01", "sim_dt": "0.01"}


LENGTH, TIME, SCALAR = Unit(1), Unit(0, 1), Unit(0, 0, 0, 1)
FORCE = Unit(1, -2, 1)
VARIABLES = {"x": LENGTH, "y": LENGTH, "z": LENGTH, "t": TIME, "u": LENGTH / TIME, "v": LENGTH / TIME, "w": LENGTH / TIME, "omega": 1 / TIME}
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


def read_unit(text, dim, space=False):
    """Of a text of the reference; in the plane forces are those of unit depth, which stays so."""
    text = text.split(";")[0].strip()
    other = re.fullmatch(r"(.*) \(2D: (.*)\)", text)
    text = (other[2] if dim == 2 else other[1]) if other else text
    if not text or text in ("s", "cells", "radii", "steps", "min", "chord", "rad"):
        return Unit()
    depth = LENGTH if dim == 2 and not space else Unit()
    force, energy = FORCE / depth, FORCE * LENGTH / depth
    fixed = {"mass/length^3": Unit(-3, 0, 1), "mass/length^dim": Unit(-3, 0, 1), "density": Unit(-3, 0, 1), "force/length^2": FORCE / LENGTH**2,
             "force/volume": FORCE / LENGTH**3, "scalar's conductivity": FORCE / TIME / SCALAR}
    if text in fixed:
        return fixed[text]
    if text.startswith("mass/(length time)"):
        return Unit(-1, -1, 1)
    by_volume = text.startswith(("energy/(length^dim", "energy/(length^(dim-1)", "energy/(length time"))  # as in space
    names = {"length": LENGTH, "time": TIME, "mass": Unit(0, 0, 1), "scalar": SCALAR, "rad": Unit(), "angle": Unit(), "half": Unit(), "force": force, "torque": force * LENGTH,
             "power": energy / TIME, "energy": FORCE * LENGTH if by_volume else energy, "amount": energy, "stress": FORCE / LENGTH**2, "pressure": FORCE / LENGTH**2,
             "dim": 3 if by_volume else dim}
    formula = re.sub(r"(?<=[a-z0-9)]) (?=[a-z(])", "*", text.replace("scalar's energy", "energy").replace("^", "**"))
    unit = eval(formula, {"__builtins__": {}}, names)
    return unit if isinstance(unit, Unit) else Unit()


def rows(name):
    """[name, unit] of the tables of a file of runs/reference; a <word> in a name stands for any text."""
    result = []
    for line in (ROOT / "runs/reference" / name).read_text().splitlines():
        if not line.startswith("| `"):
            continue
        cells = [cell.strip().replace("\\_", "_").replace("\\<", "<") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        for word in re.findall("`([^`]+)`", cells[0]):
            pattern = re.sub("<scalar_bc_boundary>", "[a-z0-9_]+_bc_[a-z0-9_]+", word.lstrip("-"))
            result.append((re.compile(re.sub("<[^>]*>", "[A-Za-z0-9_]+", pattern)), word.count("<"), cells[2 if name == "OPTIONS.md" else 1]))
    return result


def look_up(table, name):
    found = [(places, unit) for pattern, places, unit in table if pattern.fullmatch(name)]
    return min(found)[1] if found else None


def flatten(mapping, before=""):
    result = {}
    for key, value in mapping.items():
        if str(key).startswith("$$") or not before and key == "units":
            continue
        name = f"{before}_{key}" if before else str(key)
        if isinstance(value, str):
            value = [value] if "(" in value else re.split(", *", value)
        result.update(flatten(value, name) if isinstance(value, dict) else {name: value})
    return result


class Texts(yaml.SafeLoader):
    """Leaves all values as they are written."""


Texts.yaml_implicit_resolvers = {}


def read_scene(path, options):
    """{option: list of texts}; with the defaults that have a unit."""
    scene = flatten(yaml.load(path.read_text(), Texts))
    for name, value in zip(options[::2], options[1::2]):
        scene[name.lstrip("-")] = value.split(",")
    dim = len(scene.get("mesh_cells", scene.get("mesh_upper")))
    scene.setdefault("mesh_upper", ["1"] * dim)
    for name, value in DEFAULTS.items():
        if name != "sim_dt" or scene.get("sim_steady") != ["true"]:
            scene.setdefault(name, [value])
    scalars = scene.get("scalars", [])
    for name in scalars:
        scene.setdefault(f"scalar_{name}_capacity", ["1"])
        if f"scalar_{name}_reference_difference" in scene:
            scene.setdefault(f"scalar_{name}_reference_length", ["1"])
    for name in scene.get("particle_groups", []):
        if scene.get(f"particle_{name}_material", ["rigid"]) == ["rigid"]:
            scene.setdefault(f"particle_{name}_density", ["1"])
    if scene.get("flow_rheology", [""])[0] in ("power_law", "carreau", "oldroyd_b", "giesekus"):
        scene.setdefault("flow_rheology_time", ["1"])
    return scene, dim, scalars


def convert_value(text, unit, factor, system, scalars):
    """A number, an expression; a lone word is one where there is a unit."""
    if NUMBER.fullmatch(text):
        return repr(float(text) * factor) if factor != 1 else text
    if not re.search(r"[-+*/()?<>]", text) and not (unit and (text in VARIABLES or text in scalars)):
        return text
    units = {**VARIABLES, **{scalar: SCALAR for scalar in scalars}}

    def divide(match):
        word = match.group(0)
        return f"({word}*{1 / units[word].factor(SYSTEMS[system])!r})" if word in units else word

    formula = re.sub(r"\b[a-z_]\w*\b(?!\()", divide, text)
    return f"{factor!r}*({formula})"


def convert(scene, dim, scalars, system, folder):
    options, result = rows("OPTIONS.md"), {}
    for name, values in scene.items():
        unit = look_up(options, name)
        assert unit is not None or "ksp" in name, f"no row for option {name}"
        factor = read_unit(unit or "", dim, name.endswith(AS_IN_SPACE)).factor(SYSTEMS[system])
        if name.endswith("_table"):
            values = [convert_table(ROOT / "runs" / values[0], system, folder)]
        result[name] = [convert_value(value, unit, factor, system, scalars) for value in values]
    return result


def convert_table(path, system, folder):
    """Of bodies; returns the new file's name."""
    units = {"x": LENGTH, "y": LENGTH, "z": LENGTH, "radius": LENGTH, "u": LENGTH / TIME, "v": LENGTH / TIME, "w": LENGTH / TIME}
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    heading = [name.strip() for name in lines[0].split(",")]
    text = [",".join(heading)]
    for line in lines[1:]:
        text.append(",".join(repr(float(value) * units.get(name, Unit()).factor(SYSTEMS[system])) for name, value in zip(heading, line.split(","))))
    (folder / f"{system}.csv").write_text("\n".join(text) + "\n")
    return f"{system}.csv"


def write(scene, path):
    path.write_text("".join(f"{name}: [{', '.join(json.dumps(value) for value in values)}]\n" for name, values in scene.items()))
    return path.name


def read_table(path):
    """{column: numbers}; those of text and seconds are left out."""
    with open(path) as file:
        lines = list(csv.DictReader(file))
    result = {}
    for name in lines[0]:
        try:
            result[name] = [float(line[name] or 0) for line in lines]
        except ValueError:
            continue
    return {name: values for name, values in result.items() if not name.startswith("seconds")}


def deviations(here, there, dim, system):
    """Largest difference of each column, relative to the largest number with its unit. What has no size but round-off's does not count."""
    columns, size, worst, units = rows("OUTPUT.md"), {}, {}, {}
    for name, values in here.items():
        unit = look_up(columns, name)
        assert unit is not None, f"no row for column {name}"
        units[name] = read_unit(unit, dim)
        size[units[name].exponents] = max(size.get(units[name].exponents, 0), *map(abs, values))
    for name, values in here.items():
        unit = units[name]
        others = [value / unit.factor(SYSTEMS[system]) for value in there[name]]
        assert len(values) == len(others), name
        largest = size[unit.exponents] if unit.exponents != (0, 0, 0, 0) else max(map(abs, values))
        far = max(abs(a - b) for a, b in zip(values, others))
        if far and (unit.exponents != (0, 0, 0, 0) or max(map(abs, [*values, *others])) > NOISE):
            worst[name] = far / largest
    return worst


# with what makes them smaller; columns that hold the solver's error or a motion that symmetry forbids, and have no size of their own
SCENES = {
    "bubble-rising": ([], ["divergence"]),
    "hot-drop-rises": (["-mesh_cells", "16,40"], ["divergence"]),
    "disc-at-interface": ([], ["divergence", "omega_z", "torque_z", "angle", "mean_velocity_x", "mean_velocity_y"]),
    "soft-disc-shear": ([], []),
    "bubble-dissolves": ([], ["angle", "omega_z", "torque_z"]),
    "heated-cavity": (["-mesh_cells", "12,12"], []),
    "catalyst": ([], []),
    "janus": ([], []),
    "floc-settles": ([], []),
    "rheology-disc": ([], []),
    "viscoelastic-pair": ([], []),
    "rheology-bingham": ([], ["divergence", "momentum_error", "driving_error", "wall_force_bottom_y", "wall_force_top_y", "mean_velocity_y"]),
    "cavity-re1000": (["-mesh_cells", "16,16", "-flow_viscosity", "0.01"], ["divergence", "mean_velocity_x", "mean_velocity_y"]),
}


@pytest.mark.parametrize("name", SCENES)
def test_scenes_in_other_units(name, run, tmp_path):
    more, noise = SCENES[name]
    scene, dim, scalars = read_scene(ROOT / f"runs/{name}.yaml", more)
    for key in scene:
        if key.endswith("_table"):
            assert Path(ROOT / "runs" / scene[key][0]).exists()
    steps = [] if scene.get("sim_steady") == ["true"] else ["-sim_steps", "2"]
    own = {**scene, **{key: [str(ROOT / "runs" / value[0])] for key, value in scene.items() if key.endswith("_table")}}
    result = run([write(own, tmp_path / "own.yaml"), *steps, "-output_every", "0", "-output_dir", "own"])
    assert result.status == 0, str(result)
    for system in SYSTEMS:
        result = run([write(convert(scene, dim, scalars, system, tmp_path), tmp_path / f"{system}.yaml"), *steps, "-output_every", "0", "-output_dir", system])
        assert result.status == 0, str(result)
        for file in ("series.csv", "bodies.csv", "drops.csv"):
            if not (tmp_path / "own" / file).exists() or len((tmp_path / "own" / file).read_text().splitlines()) < 2:
                continue
            worst = deviations(read_table(tmp_path / "own" / file), read_table(tmp_path / system / file), dim, system)
            for column in noise:
                worst.pop(column, None)
            assert max(worst.values(), default=0) < 5e-6, (system, file, sorted(worst.items(), key=lambda pair: -pair[1])[:5])
