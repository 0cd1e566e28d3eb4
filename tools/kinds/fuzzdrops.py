"""Random scenes with drops, of tools/fuzz for its seeds from 3001 on: drops of several shapes, ratios of density and viscosity and tensions, on
walls that they wet or not, layers, in periodic boxes, streams and beside rigid discs. From 3501 on in space, on coarse boxes and for a few steps:
balls and turned ellipsoids, layers, columns, caps and threads by a region, rigid balls that they wet or not.

A run that ends must keep what drops promise: volumes but for the steps after an event, places in the domain, speeds that stream, gravity and
tension can have made, balance of momentum.
"""

import math
import random

from kinds.fuzzdraws import MOMENTUM, power, some
from toolbox import read_rows

FIRST, SPACE = 3001, 3501
VOLUME = {2: 1e-3, 3: 1e-4}  # of a drop's, when no event was within AFTER steps
AFTER = 10
SIDES = [("left", "right"), ("bottom", "top"), ("back", "front")]
CLOSED = 1e-3  # as MOMENTUM, in space
SPEED = 20  # times what stream, gravity and tension can have made


class Scales:
    """Cells, drops of some cells, tension from a Laplace number, gravity from an Eoetvoes number, a step from both, in units of their own"""

    def __init__(self, draw, dim):
        self.dim, self.stream, self.thick = dim, 0, False
        self.h, self.density = power(draw, -3, 1), power(draw, -2, 3)
        self.cells = [draw.randint(8, 20) if dim == 2 else draw.randint(5, 8) for _ in range(dim)]
        self.upper = [n * self.h for n in self.cells]
        self.radius = self.h * (draw.uniform(2, 0.3 * min(self.cells)) if dim == 2 else draw.uniform(1.3, 0.33 * min(self.cells)))
        self.size = 2 * self.radius
        self.ratio, self.thin = draw.choice([1, power(draw, -3, 3)]), draw.choice([1, power(draw, -2, 2)])
        rate = power(draw, -1, 2)  # of the drop's own swinging
        self.tension = 0 if some(draw, 0.05) else self.density * (1 + self.ratio) * self.radius**3 * rate**2
        tension = max(self.tension, 1e-3 * self.density * self.radius**3 * rate**2)  # that numbers go by
        self.viscosity = math.sqrt(self.density * tension * self.size / power(draw, 0, 5))
        self.gravity = power(draw, -2, 1.5) * tension / (self.density * max(1, self.ratio) * self.size**2)
        fall = math.sqrt(self.gravity * self.size)
        self.speed = max(fall, 1e-3 * self.h * rate)
        capillary = math.sqrt(self.density * (1 + self.ratio) * self.h**3 / (4 * math.pi * self.tension)) if self.tension else math.inf
        self.dt = min(draw.uniform(0.05, 0.7) * self.h / self.speed, power(draw, -0.5, 1.3) * capillary)


def draw_material(draw, s):
    material = {"material": "fluid", "density": s.density * s.ratio, "surface_tension": s.tension}
    if s.thin != 1:
        material["viscosity"] = s.viscosity * s.thin
    return material


def draw_shape(draw, s):
    kind = draw.choice(["circle", "circle", "ellipse", "box"])
    sizes = {"circle": {"radius": s.radius}, "ellipse": {"a": s.radius, "b": s.radius * draw.uniform(0.4, 1)}, "box": {"size": [1.6 * s.radius, s.radius * draw.uniform(0.8, 1.6)]}}
    return {"shape": kind, **sizes[kind], "position": [x * draw.uniform(0.2, 0.8) for x in s.upper], "angle": draw.uniform(-2, 2)}


def draw_turned(draw, s, slot):
    """A ball or an ellipsoid in a part of the box along x"""
    shape = {"shape": "circle", "radius": s.radius, "position": [s.upper[0] * draw.uniform(*slot)] + [x * draw.uniform(0.4, 0.6) for x in s.upper[1:]]}
    if some(draw, 0.4):
        del shape["radius"]
        shape.update(shape="ellipse", a=s.radius, b=s.radius * draw.uniform(0.6, 1), c=s.radius * draw.uniform(0.6, 1))
        shape.update(angle=draw.uniform(-2, 2), axis=[draw.gauss(0, 1) for _ in range(3)])
    return shape


def draw_region_in_space(draw, s):
    """A layer with a wave, under or above, a column beside a wall, a cap, a thread, something alone"""
    x, y, z = s.upper
    level = y * draw.uniform(0.35, 0.65)
    wave = f"{draw.uniform(0, 0.5) * s.h:g}*cos({math.pi / x:g}*x)*cos({math.pi / z:g}*z)"
    ball = f"{s.radius * draw.uniform(1, 1.3):g}"
    layers = [f"y - {level:g} - {wave}", f"{level:g} - y + {wave}", f"max(x - {0.4 * x:g}, y - {0.6 * y:g})"]
    return draw.choice([*layers, *layers, f"sqrt((x - {0.5 * x:g})^2 + y^2 + (z - {0.5 * z:g})^2) - {ball}", f"sqrt(y^2 + z^2) - {ball} + {wave}", f"sqrt((x - {0.5 * x:g})^2 + (y - {0.5 * y:g})^2 + (z - {0.5 * z:g})^2) - {ball}"])


def draw_region(draw, s):
    """A layer with a wave, or a column beside a wall"""
    if s.dim == 3:
        return draw_region_in_space(draw, s)
    x, y = s.upper
    return draw.choice([f"y - {y * draw.uniform(0.3, 0.7):g} - {0.5 * s.h:g}*cos({2 * math.pi / x:g}*x)", f"max(x - {0.4 * x:g}, y - {0.6 * y:g})", f"{y * draw.uniform(0.3, 0.7):g} - y"])


def draw_walls(draw, s, scene):
    """Stream, slip, contact angles"""
    mesh, flow = scene["mesh"], scene["flow"]
    particle = scene["particle"]
    drops = [particle[name] for name in particle["groups"] if "material" in particle[name]]
    wets, along = some(draw, 0.35 if s.dim == 2 else 0.5), [0] * (s.dim - 1)
    if some(draw, 0.2):
        mesh["periodic"] = draw.choice([["x"], ["x", "y"]] if s.dim == 2 else [["x"], ["x", "z"], ["x", "y", "z"]])
    elif some(draw, 0.25):
        s.stream = s.speed * draw.uniform(0.2, 2)
        flow["bc"] = {"left": {"type": "inflow", "velocity": [s.stream, *along]}, "right": {"type": "outflow"}}
    elif some(draw, 0.2):
        s.stream = s.speed * draw.uniform(-2, 2)
        flow["bc"] = {"top": {"type": "moving_wall", "velocity": [s.stream, *along]}}
    if wets:
        sides = [side for axis, pair in zip("xyz", SIDES[: s.dim]) for side in pair if axis not in mesh.get("periodic", []) and side not in flow.get("bc", {})]
        for side in sides if some(draw, 0.6 if s.dim == 2 else 0.85) else sides[:1]:
            flow.setdefault("bc", {})[side] = {"type": "slip"}
            if some(draw, 0.5):
                flow["bc"][side]["navier"] = s.h * power(draw, -1, 1)
        angle = draw.uniform(0.5, 2.6)
        for drop in drops:
            drop["contact_angle"] = angle
        if s.dim == 3 and "disc" in particle and some(draw, 0.5):
            particle["disc"]["contact_angle"] = angle
    if wets and some(draw, 0.6):
        name = next(name for name in particle["groups"] if "material" in particle[name])
        particle[name] = {key: value for key, value in particle[name].items() if key in ("material", "density", "viscosity", "surface_tension", "contact_angle")}
        particle[name]["region"] = draw_region(draw, s)


def draw_drops_in_space(draw, s):
    """One, or two in a box that is longer"""
    if some(draw, 0.7):
        return {"one": {**draw_turned(draw, s, (0.4, 0.6)), **draw_material(draw, s)}}
    s.cells[0] += 4
    s.upper[0] = s.cells[0] * s.h
    drops = {name: {**draw_turned(draw, s, slot), **draw_material(draw, s)} for name, slot in [("one", (0.27, 0.33)), ("two", (0.67, 0.73))]}
    if some(draw, 0.3):
        for drop in drops.values():
            drop["coalescence"] = "never"
    return drops


def draw_scene(draw, dim=2):
    s = Scales(draw, dim)
    if dim == 2:
        names = ["one", "two", "three"][: draw.choice([1, 1, 1, 2, 2, 3])]
        drops = {name: {**draw_shape(draw, s), **draw_material(draw, s)} for name in names}
    else:
        drops = draw_drops_in_space(draw, s)
    particle = {"groups": list(drops), **drops}
    if some(draw, 0.3):
        particle["groups"].append("disc")  # in space a ball
        particle["disc"] = {"shape": "circle", "radius": s.h * (draw.uniform(1, 2.5) if dim == 2 else draw.uniform(0.8, 1.5)), "density": s.density * draw.choice([0.5, 2, 10]), "position": [x * draw.uniform(0.25, 0.75) for x in s.upper]}
        if some(draw, 0.3):
            particle["disc"]["free"] = "none"
    flow = {"density": s.density, "viscosity": s.viscosity, "gravity": [0, -s.gravity, 0][:dim], "solver": draw.choice(["direct", "direct", "balanced", "accurate"])}
    if some(draw, 0.2):
        flow["time"] = "be"
    scene = {"mesh": {"cells": s.cells, "upper": s.upper} if dim == 2 else {"dimension": dim, "cells": s.cells, "upper": s.upper}, "flow": flow, "particle": particle, "output": {"every": draw.choice([0, 5])}}
    draw_walls(draw, s, scene)
    scene["sim"] = {"dt": s.dt, "steps": draw.randint(5, 20) if dim == 2 else draw.randint(2, 5)}
    return scene, s


# ---- what a run must not do ----


def read_drops(run):
    return [{key: value if key == "group" else float(value) for key, value in row.items()} for row in read_rows(run.folder / "drops.csv")]


def possible_speed(scene, s):
    heavy, light = s.density * max(1, s.ratio), s.density * min(1, s.ratio)
    time = s.dt * scene["sim"]["steps"]
    discs = 10 if "disc" in scene["particle"] else 1
    fall = min(discs * s.gravity * heavy / light * time, 10 * math.sqrt(discs * s.gravity * heavy / light * max(s.upper)))
    return abs(s.stream) + fall + math.sqrt(s.tension / (light * s.h)) + 0.05 * s.h / s.dt


def check_drops(run, scene, s):
    rows, series = read_drops(run), run.series()
    told = any("the volume of a drop is off" in remark for remark in run.summary["remarks"])
    events, last = [0], (0, 0)
    for line in series:
        if (line["drops_merged"], line["drops_broken"]) != last:
            last = (line["drops_merged"], line["drops_broken"])
            events.append(line["step"])
        quiet = line["step"] - events[-1] > AFTER or len(events) == 1
        if quiet and not told and line["drop_volume_error"] > VOLUME[s.dim]:
            return f"volume off by {line['drop_volume_error']:.2g} in step {line['step']:g}"
        limit = MOMENTUM if s.dim == 2 else CLOSED
        if line is series[-1] and line["momentum_error"] > limit and not any("ends in doubt" in remark for remark in run.summary["remarks"]):
            return f"momentum off by {line['momentum_error']:.2g} in step {line['step']:g}"
    fastest = possible_speed(scene, s)
    for row in rows:
        if not all(math.isfinite(value) for key, value in row.items() if key != "group"):
            return f"not finite at {row['time']:g}"
        speed = math.hypot(*(row[name] for name in "uvw"[: s.dim]))
        if speed > SPEED * fastest:
            return f"drop {row['drop']:g} has {speed / fastest:.3g} times the speed that it can have at {row['time']:g}"
        for axis, name in enumerate("xyz"[: s.dim]):
            if name not in scene["mesh"].get("periodic", []) and not 0 <= row[name] <= s.upper[axis]:
                return f"drop {row['drop']:g} has its centre at {name} = {row[name]:g}"
    return ""


def draw_drops(seed):
    """Kind, scene, ranks, scales, files, check, as fuzzkinds.draw_kind"""
    draw = random.Random(f"drops {seed}")
    scene, s = draw_scene(draw, 2 if seed < SPACE else 3)
    return "drops", scene, draw.choice([1, 1, 1, 2]), s, {}, check_drops
