"""Random scenes with elastic particles, of tools/fuzz for its seeds from 4001 on: shapes, both laws, stiffness from liquid to nearly rigid, ratios
of density, held or free, several a group, beside walls, rigid discs and one another, in streams and periodic boxes, in the plane and in space.
From 5001 on membranes likewise: both laws, resistance to area and bending, a fluid inside of another viscosity; from 5501 on membranes whose
area is held as a whole, half of them beside elastic solids, or with one inside.

A run that ends must keep what elastic particles promise: areas and volumes of incompressible ones, places in the domain, speeds that stream and
gravity can have made, balance of momentum and books of energy; a restart on other ranks ends at the same places.
"""

import math
import random

from kinds.fuzzdraws import MOMENTUM, power, some

FIRST, MEMBRANES, MIXED = 4001, 5001, 5501
WHOLE, HALVES = (0.25, 0.75), [(0.2, 0.4), (0.6, 0.8)]  # of the box along x, for one group, for two
VOLUME = 0.03  # of an incompressible one, after the first steps of a scene that was drawn without regard to its step
SPEED = 20  # times what stream and gravity can have made
BOOKS = 0.05  # of what was lost
AT_REST = 1e-5  # likewise, of what is stored, where nothing happens
DOUBT = ("ends in doubt", "as far as a step stands", "comes closer than a cell")  # remarks by which a user is warned


class Scales:
    """Cells, solids of some cells, a Reynolds number, stiffness of a step, gravity, a step, in units of their own"""

    def __init__(self, draw):
        self.dim, self.stream, self.thick = 3 if some(draw, 0.1) else 2, 0, False
        self.h, self.density = power(draw, -3, 1), power(draw, -2, 3)
        self.cells = [draw.randint(5, 7) if self.dim == 3 else draw.randint(8, 18) for _ in range(self.dim)]
        self.upper = [n * self.h for n in self.cells]
        self.radius = self.h * draw.uniform(1.5, max(1.8, 0.3 * min(self.cells)))
        self.size, self.ratio = 2 * self.radius, draw.choice([1, 1.2, power(draw, -2, 2)])
        self.speed = power(draw, -1, 2) * self.h
        self.viscosity = self.density * self.speed * self.size / power(draw, -2, 2.3)
        self.dt = power(draw, -1.5, 0) * self.h / self.speed
        self.modulus = power(draw, -2, 6) * self.viscosity / self.dt
        drag = 1 + 24 * self.viscosity / (self.density * self.speed * self.size)
        self.gravity = drag * self.speed**2 / self.size / max(abs(self.ratio - 1), 0.1) / max(1, self.ratio) ** 0.5


def draw_shape(draw, s):
    kind = draw.choice(["circle", "circle", "ellipse", "box", "polygon", "leaflet"] if s.dim == 2 else ["circle", "ellipse", "box"])
    b = s.radius * draw.uniform(0.5, 1)
    sizes = {
        "circle": {"radius": s.radius},
        "ellipse": {"a": s.radius, "b": b, **({"c": b} if s.dim == 3 else {})},
        "box": {"size": [1.6 * s.radius] + [s.radius * draw.uniform(0.8, 1.6)] * (s.dim - 1)},
        "polygon": {"file": "outline.txt", "scale": s.size / 3},
        "leaflet": {"length": 2 * s.radius, "thickness": s.radius * draw.uniform(0.4, 1)},
    }
    return {"shape": kind, **sizes[kind]}


def put(draw, s, slot, body):
    body["position"] = [s.upper[0] * draw.uniform(*slot)] + [x * draw.uniform(0.25, 0.75) for x in s.upper[1:]]
    if s.dim == 2:
        body["angle"] = draw.uniform(-2, 2)


def put_several(draw, slot, body):
    """Now and then several, where the group has the box for itself"""
    if slot == WHOLE and some(draw, 0.2):
        body.pop("position"), body.pop("angle", None)
        body.update(place=draw.choice(["lattice", "random"]), count=draw.randint(2, 4))


def draw_solid(draw, s, slot):
    """One solid, or some of a group; slot: part of the box along x"""
    body = {**draw_shape(draw, s), "density": s.density * s.ratio, "material": draw.choice(["neo_hookean", "neo_hookean", "st_venant_kirchhoff"]), "shear_modulus": s.modulus * power(draw, -1, 1)}
    put(draw, s, slot, body)
    if some(draw, 0.2):
        body["poisson"] = draw.uniform(0, 0.49)
    if some(draw, 0.2):
        body["solid_viscosity"] = s.viscosity * power(draw, -1, 1)
    if some(draw, 0.25):
        body["clamp"] = f"{body['position'][1]:.6g} - {0.3 * s.radius:.6g} - y"
    else:
        put_several(draw, slot, body)
    return body


def draw_membrane(draw, s, slot):
    modulus = s.modulus * s.radius * power(draw, -1, 1)
    body = {**draw_shape(draw, s), "material": "membrane", "surface_modulus": modulus}
    put(draw, s, slot, body)
    if some(draw, 0.5):
        body["membrane_law"] = "skalak"
    if some(draw, 0.4):
        body["area_modulus"] = modulus * power(draw, -1, 2)
    if some(draw, 0.5):
        body["bending"] = modulus * s.radius**2 * power(draw, -4, 0)
    if some(draw, 0.4):
        body["viscosity"] = s.viscosity * power(draw, -1.5, 1.5)
    put_several(draw, slot, body)
    return body


def draw_held(draw, s, slot):
    """A membrane whose area is held as a whole, or, in the first slot of two, a solid"""
    if slot == HALVES[0] and some(draw, 0.6):
        return draw_solid(draw, s, slot)
    body = draw_membrane(draw, s, slot)
    if some(draw, 0.7):
        body["global_area_modulus"] = body["surface_modulus"] * power(draw, -1, 4)
    return body


def put_inside(draw, s, particle, flow):
    """Now and then a nucleus in a round membrane"""
    around = particle["one"]
    if around["material"] != "membrane" or around["shape"] != "circle" or "position" not in around or not some(draw, 0.4):
        return
    particle["groups"].append("nucleus")
    particle["nucleus"] = {"shape": "circle", "radius": 0.4 * s.radius, "density": s.density * s.ratio, "material": "neo_hookean", "shear_modulus": s.modulus, "position": around["position"]}
    flow["solver"] = "direct"


def draw_walls(draw, s, scene):
    mesh, flow = scene["mesh"], scene["flow"]
    along = [0] * (s.dim - 1)
    if some(draw, 0.2):
        mesh["periodic"] = draw.choice([["x"], ["x", "y"]])
    elif some(draw, 0.3):
        s.stream = s.speed * draw.uniform(0.2, 2)
        flow["bc"] = {"left": {"type": "inflow", "velocity": [s.stream, *along]}, "right": {"type": "outflow"}}
    elif some(draw, 0.3):
        s.stream = s.speed * draw.uniform(-2, 2)
        flow["bc"] = {"top": {"type": "moving_wall", "velocity": [s.stream, *along]}, "bottom": {"type": draw.choice(["no_slip", "slip"])}}


def draw_scene(draw, draw_particle):
    s = Scales(draw)
    names = ["one", "two"][: draw.choice([1, 1, 2])]
    slots = [WHOLE] if len(names) == 1 else HALVES
    particle = {"groups": list(names), **{name: draw_particle(draw, s, slot) for name, slot in zip(names, slots)}}
    if some(draw, 0.3):
        particle["groups"].append("disc")
        particle["disc"] = {"shape": "circle", "radius": s.h * draw.uniform(1, 2.5), "density": s.density * draw.choice([0.5, 2, 10]), "position": [x * draw.uniform(0.25, 0.75) for x in s.upper]}
        if some(draw, 0.4):
            particle["disc"]["free"] = "none"
    compressible = any("poisson" in particle[name] for name in names)
    flow = {"density": s.density, "viscosity": s.viscosity, "solver": draw.choice(["direct", "balanced", "accurate"] if not compressible or some(draw, 0.1) else ["direct"])}
    if some(draw, 0.8):
        flow["gravity"] = [0] * (s.dim - 1) + [-s.gravity]
    if some(draw, 0.3):
        flow["time"] = "be"
    scene = {"mesh": {"dimension": s.dim, "cells": s.cells, "upper": s.upper}, "flow": flow, "particle": particle, "output": {"every": draw.choice([0, 5])}}
    draw_walls(draw, s, scene)
    scene["couple"] = {"method": draw.choice(["aligned", "aligned", "penalty"])}
    scene["sim"] = {"dt": s.dt, "steps": draw.randint(2, 3) if s.dim == 3 else draw.randint(4, 12)}
    if some(draw, 0.15):
        scene["sim"]["adapt"] = True
    scene["monitor"] = {"energy": True}
    if some(draw, 0.15) and "adapt" not in scene["sim"]:
        scene["restart"] = {"at": scene["sim"]["steps"] // 2, "ranks": draw.choice([1, 2, 3])}
    return scene, s


# ---- what a run must not do ----


def possible_speed(scene, s, time):
    pull = math.hypot(*scene["flow"].get("gravity", [0])) * time * max(1, abs(s.ratio - 1) / (s.ratio + 0.3), 10 if "disc" in scene["particle"] else 0)
    return abs(s.stream) + pull + 0.2 * s.h / s.dt


def check_books(series):
    first, last = series[0], series[-1]
    change = {name: last[name] - first[name] for name in ("energy", "energy_supplied", "contact_work", "energy_dissipated", "energy_boundary", "energy_scheme")}
    gone = change["energy_dissipated"] + change["energy_boundary"] + change["energy_scheme"]
    size = sum(abs(value) for value in change.values()) - abs(change["energy"])
    missing = abs(change["energy"] - change["energy_supplied"] - change["contact_work"] + gone)
    return f"books of energy lack {missing / size:.2g} of what passed" if missing > BOOKS * size + AT_REST * abs(last["energy"]) else ""


def check_solids(run, scene, s):
    series = run.series()
    told = [remark for remark in run.summary["remarks"] if any(word in remark for word in DOUBT)]
    for line in series:
        if not all(math.isfinite(value) for value in line.values()):
            return f"not finite in step {line['step']:g}"
    last = series[-1]
    if last["momentum_error"] > MOMENTUM and not told:
        return f"momentum off by {last['momentum_error']:.2g}"
    fastest = possible_speed(scene, s, last["time"])
    for name in scene["particle"]["groups"]:
        body = scene["particle"][name]
        if "material" not in body:
            continue
        speed = math.hypot(*(last.get(f"solid_{axis}_{name}", 0) for axis in "uvw"))
        if speed > SPEED * fastest and not told:
            return f"group {name} has {speed / fastest:.3g} times the speed that it can have"
        if "poisson" not in body and abs(last[f"solid_volume_error_{name}"]) > VOLUME and not told:
            return f"the volume of group {name} is off by {last[f'solid_volume_error_{name}']:.2g}"
        for axis, edge in zip("xyz", s.upper):
            if axis not in scene["mesh"].get("periodic", []) and "count" not in body and not 0 <= last[f"solid_{axis}_{name}"] <= edge:
                return f"group {name} has its centre at {axis} = {last[f'solid_{axis}_{name}']:g}"
    return "" if told else check_books(series)


def draw_solids(seed):
    """Kind, scene, ranks, scales, files, check, as fuzzkinds.draw_kind"""
    draw = random.Random(f"solids {seed}")
    kind, draw_particle = ("mixed", draw_held) if seed >= MIXED else ("membranes", draw_membrane) if seed >= MEMBRANES else ("solids", draw_solid)
    scene, s = draw_scene(draw, draw_particle)
    if seed >= MIXED:
        put_inside(draw, s, scene["particle"], scene["flow"])
        scene["couple"]["method"] = draw.choice(["aligned", "penalty", "penalty", "penalty"])
    return kind, scene, draw.choice([1, 1, 1, 2]), s, {"outline.txt": "0 0\n3 0\n3 1.2\n1.2 1.2\n1.2 2\n0 2\n"}, check_solids
