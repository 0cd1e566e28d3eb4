"""Random scenes of kinds that each have something to check: the generators of tools/fuzz for its seeds from 1001 on.

The kind goes by the seed. `draw_kind(seed)` gives the scene, its ranks, its scales, the files that it reads, and what a run of it must not do:
  round     bodies in disc, annulus, tube, ball, shell: their centres stay inside, spheres and discs keep out of the walls
  spring    contact law spring with a random coefficient of restitution: alone and without gravity a body never gains speed, and rebounds with e at most
  alone     no flow: a body on a pivot (stops, hinge) keeps its energy, one on a slide has the acceleration of gravity along it
  restart   a refined mesh goes on from a checkpoint on other ranks, and its bodies go where they go without a stop
  file      mesh files, turned boxes with one name for all walls: as round
"""

import math
import random

from kinds import fuzzdrops, fuzzsolids
from kinds.fuzzdraws import power, some

KINDS = ["round", "spring", "alone", "restart", "file"]
FIRST = 1001
OVERLAP = 0.02  # of a radius, in a wall
ENERGY = 0.02  # of a pendulum's, gained or lost
REBOUND = 1.05  # times e: what the steps and the fluid may leave
APART = 0.05  # cells, between a run that was continued and one that was not


class Scales:
    """Cells, a body of some cells, a speed from a Reynolds number, a step from a CFL number, in units of their own."""

    def __init__(self, draw, dim):
        self.dim, self.h, self.stream, self.thick = dim, power(draw, -3, 1), 0, False
        self.radius = self.h * draw.uniform(1.5, 3) / (1 if dim == 2 else 1.5)
        self.density, self.ratio = power(draw, -1, 3), draw.choice([0.3, 1.2, 2, 8])
        reynolds, self.speed = power(draw, -1, 2), power(draw, -1, 2) * self.h
        self.size = 2 * self.radius
        self.viscosity = self.density * self.speed * self.size / reynolds
        self.dt = draw.uniform(0.1, 0.6) * self.h / self.speed
        self.gravity = (1 + 24 / reynolds) * self.speed**2 / self.size / max(abs(self.ratio - 1), 0.1)


def draw_flow(draw, s):
    flow = {"density": s.density, "viscosity": s.viscosity, "gravity": [0] * (s.dim - 1) + [-s.gravity]}
    if some(draw, 0.3):
        flow["time"] = draw.choice(["be", "cn"])
    return flow


def draw_common(draw, scene):
    if some(draw, 0.6):
        scene["couple"] = {"method": draw.choice(["nodal", "penalty", "aligned"])}
    if some(draw, 0.4):
        scene["contact"] = {"law": draw.choice(["repulsive", "spring"])}
    scene["output"] = {"every": 0}


def turn(draw, dim):
    """A direction"""
    v = [draw.gauss(0, 1) for _ in range(dim)]
    return [x / math.hypot(*v) for x in v]


# ---- inside of which walls ----


def check_walls(depth):
    """depth(x): distance of a place to the nearest wall, negative outside. The check of a run."""

    def check(run, scene, s):
        rows = run.bodies()
        last = max((row["step"] for row in rows), default=0)
        for row in rows:
            x = [row[name] for name in "xyz"[: s.dim]]
            inside = depth(x)
            if inside < 0:
                return f"body {row['body']:g} is outside the domain by {-inside:.3g} in step {row['step']:g}"
            if scene["particle"][row["group"]]["shape"] == "circle" and row["step"] == last and row["radius"] - inside > OVERLAP * row["radius"]:
                return f"body {row['body']:g} is {(row['radius'] - inside) / row['radius']:.2g} of its radius in a wall at the end"
        return ""

    return check


def draw_inside(draw, s, places, room):
    """One to three bodies at places of the domain, each with its own room to the walls"""
    names = ["one", "two", "three"][: min(len(places), draw.choice([1, 1, 2, 3]))]
    particle = {"groups": names}
    for name, place in zip(names, places):
        radius = min(s.radius, 0.8 * room)
        body = {"shape": "circle", "radius": radius} if some(draw, 0.7) else {"shape": "ellipse", "a": radius, "b": radius * draw.uniform(0.5, 1), **({"c": radius} if s.dim == 3 else {})}
        body.update(density=s.density * draw.choice([s.ratio, s.ratio, 1.1, 1 / s.ratio]), position=place)
        if some(draw, 0.3):
            body["velocity"] = [s.speed * x for x in turn(draw, s.dim)]
        particle[name] = body
    return particle


def draw_round(draw):
    kind = draw.choice(["disc", "disc", "annulus", "annulus", "tube", "ball", "shell"])
    s = Scales(draw, 2 if kind in ("disc", "annulus") else 3)
    n = draw.randint(3, 5) if s.dim == 2 else 2
    outer = s.h * n * 2.5
    hole = outer * draw.uniform(0.25, 0.4) if kind in ("annulus", "shell") else 0
    room = 0.5 * (outer - hole) if hole else 0.5 * outer
    mesh = {"kind": kind, "resolution": n, "centre": [0] * (2 if kind == "tube" else s.dim)}
    mesh.update({"radii": [hole, outer]} if hole else {"radius": outer})
    length = 2 * outer
    if kind == "tube":
        mesh.update(length=length)
    middle = 0.5 * (hole + outer) if hole else 0.4 * outer
    along = 0 if kind in ("disc", "annulus") else 0.5 * length if kind == "tube" else 0

    def place(angle):
        return [middle * math.cos(angle), middle * math.sin(angle)] + ([along] if s.dim == 3 else [])

    def depth(x):
        r = math.hypot(*x[:2]) if kind == "tube" else math.hypot(*x)
        walls = [outer - r] + ([r - hole] if hole else []) + ([x[2], length - x[2]] if kind == "tube" else [])
        return min(walls)

    start = draw.uniform(0, 2 * math.pi)
    s.radius = min(s.radius, 0.45 * room)
    scene = {"mesh": mesh, "flow": draw_flow(draw, s), "particle": draw_inside(draw, s, [place(start + k * 2.1) for k in range(3)], room)}
    draw_common(draw, scene)
    scene["sim"] = {"dt": s.dt, "steps": draw.randint(15, 40) if s.dim == 2 else draw.randint(4, 8)}
    s.upper = [outer] * s.dim
    return scene, s, {}, check_walls(depth)


# ---- a mesh file ----


def write_mesh(draw, s, cells, angle, corner):
    """A box of quadrilaterals, turned about its lower corner, with one name for all walls (Gmsh format 2.2)"""
    nx, ny = cells
    c, d = math.cos(angle), math.sin(angle)
    nodes = [(corner[0] + c * i * s.h - d * j * s.h, corner[1] + d * i * s.h + c * j * s.h) for j in range(ny + 1) for i in range(nx + 1)]

    def at(i, j):
        return 1 + i + j * (nx + 1)

    edges = [(at(i, 0), at(i + 1, 0)) for i in range(nx)] + [(at(nx, j), at(nx, j + 1)) for j in range(ny)]
    edges += [(at(i + 1, ny), at(i, ny)) for i in reversed(range(nx))] + [(at(0, j + 1), at(0, j)) for j in reversed(range(ny))]
    quads = [(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)) for j in range(ny) for i in range(nx)]
    name = draw.choice(["walls", "wall", "outside", "left"])
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", f'1 1 "{name}"', '2 2 "fluid"', "$EndPhysicalNames", "$Nodes", str(len(nodes))]
    lines += [f"{k} {x:.15g} {y:.15g} 0" for k, (x, y) in enumerate(nodes, 1)] + ["$EndNodes", "$Elements", str(len(edges) + len(quads))]
    lines += [f"{k} 1 2 1 1 {a} {b}" for k, (a, b) in enumerate(edges, 1)]
    lines += [f"{k} 3 2 2 2 {' '.join(map(str, quad))}" for k, quad in enumerate(quads, len(edges) + 1)]
    return "\n".join(lines + ["$EndElements", ""])


def draw_file(draw):
    s = Scales(draw, 2)
    cells = [draw.randint(10, 18), draw.randint(10, 18)]
    size = [n * s.h for n in cells]
    angle, corner = draw.choice([0, draw.uniform(-0.6, 0.6)]), [draw.uniform(-3, 3) * s.h for _ in range(2)]
    c, d = math.cos(angle), math.sin(angle)

    def place(u, v):
        return [corner[0] + c * u - d * v, corner[1] + d * u + c * v]

    def depth(x):
        y = [x[0] - corner[0], x[1] - corner[1]]
        u = [c * y[0] + d * y[1], -d * y[0] + c * y[1]]
        return min(u[0], size[0] - u[0], u[1], size[1] - u[1])

    s.radius = min(s.radius, 0.12 * min(size))
    places = [place(size[0] * (0.22 + 0.28 * k), size[1] * draw.uniform(0.3, 0.7)) for k in range(3)]
    scene = {"mesh": {"kind": "file", "file": "mesh.msh"}, "flow": draw_flow(draw, s), "particle": draw_inside(draw, s, places, 0.14 * min(size))}
    draw_common(draw, scene)
    scene["sim"] = {"dt": s.dt, "steps": draw.randint(15, 60)}
    s.upper = size
    return scene, s, {"mesh.msh": write_mesh(draw, s, cells, angle, corner)}, check_walls(depth)


# ---- the law spring ----


def check_rebound(axis, e):
    def check(run, scene, s):
        start = scene["particle"]["one"]["velocity"][axis]
        limit = abs(start)
        v = [start, *(row["uvw"[axis]] for row in run.bodies())]
        if max(map(abs, v)) > (1 + 1e-3) * limit:
            return f"a body gains speed by itself: {max(map(abs, v)):.4g} from {limit:.4g}"
        impact = 0
        for before, after in zip(v, v[1:]):
            impact = max(impact, -before)
            if after > REBOUND * e * impact + 1e-3 * limit:
                return f"a rebound of {after / impact:.3g} times the impact, restitution {e:.3g}" if impact else f"a rebound of {after:.3g} without an impact"
        return ""

    return check


def draw_spring(draw):
    s = Scales(draw, 3 if some(draw, 0.25) else 2)
    cells = [draw.randint(10, 16) if s.dim == 2 else 6 for _ in range(s.dim)]
    s.upper = [n * s.h for n in cells]
    s.radius = min(s.radius, 0.2 * min(s.upper))
    axis, e = draw.randrange(s.dim), draw.uniform(0.05, 1)
    position = [0.5 * x for x in s.upper]
    position[axis] = s.radius + draw.uniform(0.5, 1.5) * s.h
    velocity = [0] * s.dim
    velocity[axis] = -s.speed
    ratio = power(draw, 0, 3)
    body = {"shape": "circle", "radius": s.radius, "density": s.density * ratio, "position": position, "velocity": velocity}
    scene = {
        "mesh": {"dimension": s.dim, "cells": cells, "upper": s.upper},
        "flow": {"density": s.density, "viscosity": s.viscosity * draw.choice([1, 0.1])},
        "particle": {"groups": ["one"], "one": body},
        "contact": {"law": "spring", "restitution": e},
        "output": {"every": 0},
    }
    if some(draw, 0.5):
        scene["flow"]["time"] = draw.choice(["be", "cn", "bdf2"])
    if some(draw, 0.4):
        scene["couple"] = {"method": draw.choice(["nodal", "penalty", "aligned"])}
    if some(draw, 0.3):
        scene["contact"]["friction"] = draw.uniform(0, 0.5)
    s.dt = draw.choice([0.02, 0.1, 0.3]) * s.h / s.speed
    scene["sim"] = {"dt": s.dt, "steps": min(60 if s.dim == 2 else 12, int(4 * s.h / s.speed / s.dt) + 2)}
    return scene, s, {}, check_rebound(axis, e)


# ---- no flow ----


def check_pendulum(arm, radius, gravity, stops):
    """The centre is `arm` from the pivot, at the body's angle"""

    def energy(row):
        return 0.5 * (0.5 * radius**2 + arm**2) * row["omega_z"] ** 2 + gravity * arm * math.sin(row["angle"])

    def check(run, scene, s):
        rows = run.bodies()
        scale = gravity * arm + abs(energy(rows[0]))
        worst = max(energy(row) - energy(rows[0]) for row in rows) / scale
        least = min(energy(row) - energy(rows[0]) for row in rows) / scale
        moved = max(abs(row["angle"] - rows[0]["angle"]) for row in rows)
        if worst > ENERGY or (not stops and least < -ENERGY):
            return f"a pendulum's energy goes from {least:.3g} to {worst:.3g} of its scale"
        return "a pendulum hangs still" if moved < 1e-3 else ""

    return check


def check_slide(direction, gravity):
    def check(run, scene, s):
        pull = -gravity * direction[1]
        for row in run.bodies():
            along = row["u"] * direction[0] + row["v"] * direction[1]
            if abs(along - pull * row["time"]) > 0.02 * abs(pull) * row["time"] + 1e-9 * gravity * row["time"]:
                return f"on its slide a body has the speed {along:.4g} at t = {row['time']:.4g}, gravity makes {pull * row['time']:.4g}"
        return ""

    return check


def draw_alone(draw):
    """In the plane; a box so large that nothing meets its walls"""
    s = Scales(draw, 2)
    arm, gravity = s.radius * draw.uniform(0.3, 2), s.gravity
    period = 2 * math.pi * math.sqrt((0.5 * s.radius**2 + arm**2) / (gravity * arm))
    s.upper = [40 * s.radius] * 2
    middle = [0.5 * x for x in s.upper]
    body = {"shape": "circle", "radius": s.radius, "density": s.density, "position": middle}
    scene = {
        "mesh": {"cells": [4, 4], "upper": s.upper},
        "flow": {"active": False, "gravity": [0, -gravity]},
        "particle": {"groups": ["one"], "one": body},
        "output": {"every": 0, "progress": 1000},
        "sim": {"dt": period / 200, "steps": draw.choice([100, 400])},
    }
    if some(draw, 0.3):
        direction = turn(draw, 2)
        body.update(slide=direction, density=s.density)
        scene["sim"] = {"dt": 0.01 * math.sqrt(s.radius / gravity), "steps": draw.randint(20, 100)}
        check = check_slide(direction, gravity)
    else:
        start = draw.uniform(-math.pi, math.pi)
        if abs(math.cos(start)) < 0.2:
            start += 0.5
        body.update(pivot=[-arm, 0], angle=start)
        stops = some(draw, 0.3)
        if stops:
            body.update(stops=[start - draw.uniform(0.2, 2), start + draw.uniform(0.2, 2)], stops_restitution=draw.uniform(0, 1))
        if some(draw, 0.4):
            body.update(angular_velocity=draw.uniform(-2, 2) / period)
        check = check_pendulum(arm, s.radius, gravity, stops)
    if some(draw, 0.3):
        scene["contact"] = {"law": draw.choice(["spring", "repulsive", "none"]), "spring_stiffness": s.density * s.radius * gravity * 100}
        if scene["contact"]["law"] != "spring":
            scene["contact"].pop("spring_stiffness")
    return scene, s, {}, check


# ---- restarts ----


def draw_restart(draw):
    s = Scales(draw, 3 if some(draw, 0.2) else 2)
    cells = [draw.randint(6, 9) if s.dim == 2 else 4 for _ in range(s.dim)]
    levels = draw.randint(1, 3) if s.dim == 2 else 1
    s.h /= 2**levels
    s.dt = draw.uniform(0.1, 0.5) * s.h / s.speed
    base = s.h * 2**levels
    s.upper = [n * base for n in cells]
    s.radius = min(base * draw.uniform(0.6, 1), 0.18 * min(s.upper))
    mesh = {"dimension": s.dim, "cells": cells, "upper": s.upper, "levels": levels}
    names = ["one", "two"][: draw.choice([1, 2, 2])]
    particle = {"groups": names}
    for k, name in enumerate(names):
        share = 0.5 if len(names) == 1 else (0.25, 0.75)[k]
        body = {"shape": draw.choice(["circle", "circle", "ellipse"]), "density": s.density * draw.choice([0.5, 2, 5]), "position": [share * s.upper[0]] + [draw.uniform(0.35, 0.65) * x for x in s.upper[1:]]}
        body.update({"radius": s.radius} if body["shape"] == "circle" else {"a": s.radius, "b": 0.6 * s.radius, **({"c": s.radius} if s.dim == 3 else {})})
        particle[name] = body
    if some(draw, 0.7):
        mesh["track"] = True
    else:
        for name in names:
            particle[name].update(free="none")
    scene = {"mesh": mesh, "flow": draw_flow(draw, s), "particle": particle, "output": {"every": 0}}
    if "track" not in mesh:
        scene["flow"]["bc"] = {"left": {"type": "inflow", "velocity": [s.speed] + [0] * (s.dim - 1)}, "right": {"type": "outflow"}}
        s.stream = s.speed
    if some(draw, 0.5):
        scene["couple"] = {"method": draw.choice(["nodal", "penalty", "aligned"])}
    steps = draw.randint(3, 8)
    scene["sim"] = {"dt": s.dt, "steps": 2 * steps}
    scene["restart"] = {"at": steps, "ranks": draw.choice([1, 2, 2, 3, 4])}
    return scene, s, {}, None


def compare_runs(first, second, s):
    """Where bodies are at the end of two runs of one scene"""
    ends = [{(row["group"], row["body"]): row for row in run.bodies() if row["step"] == run.bodies()[-1]["step"]} for run in (first, second)]
    if ends[0].keys() != ends[1].keys():
        return "other bodies after a restart"
    for key, a in ends[0].items():
        b = ends[1][key]
        if a["step"] != b["step"]:
            return f"a restart ended in step {b['step']:g}, not {a['step']:g}"
        away = math.hypot(*(a[name] - b[name] for name in "xyz"))
        if away > APART * s.h:
            return f"body {key[1]:g} of group {key[0]} is {away / s.h:.3g} cells elsewhere after a restart"
    return ""


# ---- the door ----


def draw_kind(seed):
    """Kind, scene, ranks, scales, files {name: text}, check(run, scene, s) of a seed from FIRST on"""
    if seed >= fuzzsolids.FIRST:
        return fuzzsolids.draw_solids(seed)
    if seed >= fuzzdrops.FIRST:
        return fuzzdrops.draw_drops(seed)
    kind, draw = KINDS[(seed - FIRST) % len(KINDS)], random.Random(f"kind {seed}")
    scene, s, files, check = {"round": draw_round, "spring": draw_spring, "alone": draw_alone, "restart": draw_restart, "file": draw_file}[kind](draw)
    return kind, scene, draw.choice([1, 1, 2, 3]), s, files, check
