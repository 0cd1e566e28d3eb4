"""Random scenes: every one ends well, or with one clear message.

  tools/fuzz                                   seeds 1 to 330; writes runs/fuzz/outcomes.csv and README.md (make fuzz)
  tools/fuzz --seeds 3,17,40-49                these; what the table holds of others stays
  tools/fuzz --seeds 17 --point                one of them, with its scene and everything the program prints
  tools/fuzz --seeds 300-999 --output out/fuzz others than those of the tree; beyond 200 also with local refinement, packed suspensions, hinges and
                                               surfaces from files in space, initial flows, held mean velocities, boxes that travel
  tools/fuzz --seeds 1001-1030 --output out/fuzz from 1001 on five kinds in turn, each with a check of its own (kinds/fuzzkinds.py): round meshes with bodies,
                                               the law spring, bodies without a flow on pivots and slides, restarts of refined meshes on other ranks,
                                               mesh files with one name for all walls
  tools/fuzz --seeds 2001-2200 --output out/fuzz from 2001 on the scenes of below with scalars in the flow and on bodies (kinds/fuzzscalars.py)
  tools/fuzz --seeds 3001-3200 --output out/fuzz from 3001 on drops, from 3501 on in space (kinds/fuzzdrops.py)
  tools/fuzz --seeds 4001-4200 --output out/fuzz from 4001 on elastic particles (kinds/fuzzsolids.py)
  tools/fuzz --seeds 5001-5200 --output out/fuzz from 5001 on membranes, from 5501 on with areas held, and beside elastic solids (kinds/fuzzsolids.py)

A seed is a scene: sizes, densities, steps, viscosities, units, shapes, groups, conditions at the walls, methods, presets, ranks are drawn from it.
A run ends as
  ok            finite, divergence and momentum within bounds, bodies in the domain, none faster than gravity, forces and the stream can have made it
  warned        ended, out of these bounds, with a remark that says so
  stopped       refused, or stopped: exit status not 0 and one line of error
  BUG           crashed, hung, two errors, or no word where the numbers are out of bounds: the exit status is then 1
"""

import concurrent.futures
import json
import math
import random
import tempfile
from pathlib import Path

from kinds import fuzzscalars
from kinds.extremes import judge_run
from kinds.fuzzdraws import MOMENTUM, MOMENTUM_FAST, power, some
from kinds.fuzzkinds import FIRST, compare_runs, draw_kind
from toolbox import ROOT, default_jobs, make_parser, read_rows, run_scene, write_rows

FOLDER = ROOT / "runs" / "fuzz"
COLUMNS = "seed,ranks,verdict,divergence,momentum,speed,seconds,scene,message".split(",")
LAST = 330  # seeds of the tree: 1 to this
VERDICTS = ["ok", "warned", "stopped", "BUG"]
DIVERGENCE = 0.1  # as the program itself judges: velocities a cell
SPEED = 3  # times what gravity, forces and the stream can have made
SHAPES = {2: ["circle", "circle", "ellipse", "airfoil", "leaflet", "ring", "polygon"], 3: ["circle", "circle", "ellipse", "leaflet"]}
NEWER = 200  # seeds beyond have what the program has learnt since: draw_newer
CORNERS, FACES = [(0, 0, 0), (2, 0, 0), (0, 2, 0), (0, 0, 2)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]  # a tetrahedron
OUTLINE = "0 0\n3 0\n3 1\n1 1\n1 2\n0 2\n"  # an L


def parse_arguments():
    parser = make_parser(__doc__, limit=120)
    parser.add_argument("--seeds", default=f"1-{LAST}", metavar="LIST", help="such as 3,17,40-49 (default: %(default)s)")
    parser.add_argument("--point", action="store_true", help="show the scene and what the program prints")
    parser.add_argument("--jobs", type=int, default=default_jobs(), metavar="N", help="runs at the same time (default: cores that are free)")
    parser.add_argument("--output", default=str(FOLDER), metavar="FOLDER", help="where outcomes.csv and README.md go (default: runs/fuzz)")
    return parser, parser.parse_args()


def read_seeds(parser, text):
    seeds = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        if not first.isdigit() or not (last or first).isdigit():
            parser.error(f"--seeds: '{part}' is no seed and no range such as 40-49")
        seeds += range(int(first), int(last or first) + 1)
    return seeds


# ---- a scene from a seed ----


class Scales:
    """Sizes that belong together: cells, a body of some cells, its speed from a Reynolds number, a step from a CFL number, all in units of their own."""

    def __init__(self, draw, chance_of_space):
        self.dim = 3 if some(draw, chance_of_space) else 2
        self.cells = [draw.randint(4, 7) if self.dim == 3 else draw.randint(5, 24) for _ in range(self.dim)]
        self.h = power(draw, -5, 2)
        self.size = self.h * power(draw, 0, 1)  # of a body
        self.density, self.ratio = power(draw, -3, 4), power(draw, -3.5, 3.5)
        reynolds, self.speed = power(draw, -2, 3.5), power(draw, -3, 3) * self.h
        self.viscosity = self.density * self.speed * self.size / reynolds
        self.dt = power(draw, -1.5, 0.3) * self.h / self.speed
        if some(draw, 0.1):
            self.dt *= power(draw, 1, 4)
        drag = 1 + 24 / reynolds  # of a falling disc, about
        self.gravity = drag * self.speed**2 / self.size / max(abs(self.ratio - 1), 0.01)
        self.upper = [n * self.h for n in self.cells]


def draw_mesh(draw, s):
    mesh = {"dimension": s.dim, "cells": s.cells, "upper": s.upper}
    if s.dim == 2 and some(draw, 0.1):
        s.upper = [10 * s.h, 10 * s.h]
        return {"kind": "disc", "centre": [5 * s.h, 5 * s.h], "radius": 5 * s.h, "resolution": draw.randint(2, 5)}
    if s.dim == 2 and some(draw, 0.1):
        corner = [draw.uniform(0.1, 0.4) * x for x in s.upper] + [draw.uniform(0.6, 0.9) * x for x in s.upper]
        mesh = {"upper": s.upper, "focus": corner, "focus_h": s.h * draw.uniform(0.5, 1), "growth": [0.3, 0.3]}
    if some(draw, 0.3):
        mesh["periodic"] = draw.choice([["x"], ["y"], ["x", "y"]])
    if s.dim == 2 and some(draw, 0.08):
        mesh["deform"] = True
    return mesh


def draw_flow(draw, s, mesh):
    flow = {"density": s.density, "viscosity": s.viscosity}
    if some(draw, 0.85):
        flow["gravity"] = [0] * (s.dim - 1) + [-s.gravity]
    if some(draw, 0.1):
        flow["force"] = [draw.uniform(-1, 1) * s.viscosity * s.speed / min(s.upper) ** 2 for _ in range(s.dim)]
    if mesh.get("kind") != "disc" and "periodic" not in mesh and some(draw, 0.25):
        stream = [s.speed * draw.uniform(0.2, 2)] + [0] * (s.dim - 1)
        flow["bc"] = {"left": {"type": "inflow", "velocity": stream, "profile": draw.choice(["uniform", "parabolic"])}, "right": {"type": "outflow"}}
        s.stream = stream[0]
    elif mesh.get("kind") != "disc" and "periodic" not in mesh and some(draw, 0.3):
        s.stream = s.speed * draw.uniform(-2, 2)
        flow["bc"] = {"top": {"type": "moving_wall", "velocity": [s.stream] + [0] * (s.dim - 1)}, "bottom": {"type": draw.choice(["no_slip", "slip"])}}
    for name, chance, values in [("time", 0.3, ["be", "cn", "bdf2", "fstheta"]), ("convection_form", 0.3, ["skew"]), ("convection", 0.1, [False]), ("solver", 0.15, ["fast", "accurate", "direct"])]:
        if some(draw, chance):
            flow[name] = draw.choice(values)
    return flow


def draw_shape(draw, s):
    """A shape and its size; presets refuse what is thin, and are given what is not."""
    shape, size = draw.choice(SHAPES[s.dim] if not s.thick else ["circle", "ring", "ellipse"][: 3 if s.dim == 2 else 1]), s.size * draw.uniform(0.5, 1.5)
    size = max(size, 6 * s.h) if s.thick else size
    sizes = {
        "circle": {"radius": size / 2},
        "ellipse": {"a": size / 2, "b": size / 2 * power(draw, -0.1 if s.thick else -1, 0), **({"c": size / 3} if s.dim == 3 else {})},
        "airfoil": {"chord": size, "thickness": draw.uniform(0.06, 0.3), "camber": draw.uniform(0, 0.05)},
        "leaflet": {"length": size, "thickness": size * power(draw, -1.5, 0)},
        "ring": {"outer": size / 2, "inner": size / 2 * draw.uniform(0.3, 0.5 if s.thick else 0.9)},
        "polygon": {"file": "outline.txt", "scale": size / 4},
    }
    return {"shape": shape, **sizes[shape]}


def draw_place(draw, s, slot):
    """One body, or several in a part of the box; slot: share of the box's length that the group has, from and to."""
    axis = s.upper.index(max(s.upper))
    if some(draw, 0.3):
        place = {"place": draw.choice(["lattice", "random"]), "count": draw.randint(1, s.room)}
        if slot != (0, 1):
            for name, share in zip(("lower", "upper"), slot):
                place[name] = [x if name == "upper" else 0 for x in s.upper]
                place[name][axis] = share * s.upper[axis]
        return {**place, "seed": draw.randint(0, 99)} if place["place"] == "random" else place
    position = [x * draw.uniform(0.25, 0.75) for x in s.upper]
    position[axis] = s.upper[axis] * (slot[0] + (slot[1] - slot[0]) * draw.uniform(0.25, 0.75))
    return {"position": position, "angle": draw.uniform(-4, 4)}


def draw_motion(draw, s, body):
    """How the bodies of a group move: freely, held, about a pivot, or as prescribed."""
    kind = draw.choices(["free", "some", "none", "pivot", "motion"], [60, 10, 12, 8, 10])[0]
    if kind == "pivot" and "position" not in body:
        kind = "free"
    if kind == "some":
        body["free"] = draw.choice(["x", "y", "x, rotation", "rotation"])
    elif kind == "none":
        body["free"] = "none"
    elif kind == "pivot":
        body["pivot"] = [0] * s.dim
        if s.dim == 2 and "angle" in body and some(draw, 0.5):
            body["stops"] = [body["angle"] - 0.5, body["angle"] + 0.5]
    elif kind == "motion":
        body["motion"] = draw.choice(["constant", "oscillate"])
        if body["motion"] == "oscillate":
            body["motion_amplitude"] = [s.h * draw.uniform(-1, 1) for _ in range(s.dim)]
            body["motion_period"] = [10 * s.dt * power(draw, 0, 1)] * s.dim
    if kind in ("free", "motion") and some(draw, 0.2):
        body["velocity"] = [s.speed * draw.uniform(-1, 1) for _ in range(s.dim)]
    if kind in ("free", "motion") and s.dim == 2 and some(draw, 0.2):
        body["angular_velocity"] = s.speed / s.size * draw.uniform(-2, 2)


def draw_bodies(draw, s):
    names = ["one", "two", "three"][: draw.choice([1, 1, 1, 2, 2, 3])]
    particle = {"groups": names}
    s.size = min(s.size, 0.5 * min(s.upper))
    s.room = max(1, min(8, int(0.2 * math.prod(s.upper) / len(names) / (1.5 * s.size) ** s.dim)))  # bodies of a group
    for k, name in enumerate(names):
        density = s.density * draw.choice([s.ratio, s.ratio, 1, 1 / s.ratio if s.ratio > 1 else 2 - s.ratio])
        body = {**draw_shape(draw, s), "density": density, **draw_place(draw, s, (k / len(names), (k + 1) / len(names)))}
        draw_motion(draw, s, body)
        if some(draw, 0.1):
            body["force"] = [s.density * s.speed**2 * s.size ** (s.dim - 1) * draw.uniform(-1, 1) for _ in range(s.dim)]
        particle[name] = body
    if some(draw, 0.3):
        particle["remove"] = draw.choice(["left", "right", "bottom", "top"])
    return particle


def write_surface(path):
    facets = ["facet normal 0 0 0\nouter loop\n" + "".join("vertex {} {} {}\n".format(*CORNERS[i]) for i in face) + "endloop\nendfacet\n" for face in FACES]
    path.write_text("solid tetrahedron\n" + "".join(facets) + "endsolid tetrahedron\n")


def draw_start(draw, s, scene):
    """Initial flow, a held mean velocity, a box that travels."""
    flow, periodic = scene["flow"], scene["mesh"].get("periodic", [])
    if some(draw, 0.4):
        flow["initial"] = draw.choice(["uniform", "shear" if "top" in flow.get("bc", {}) else "steady", "poiseuille", "expression"])
        if flow["initial"] not in ("shear", "steady"):
            s.stream = s.speed * draw.uniform(-1, 1)
            flow["velocity"] = [f"{s.stream:g} * cos(y / {s.upper[1]:g})" if flow["initial"] == "expression" else s.stream] + [0] * (s.dim - 1)
        body = scene["particle"][scene["particle"]["groups"][0]]
        if some(draw, 0.5) and "motion" not in body:
            body.pop("velocity", None), body.pop("angular_velocity", None)
            body["initial_velocity"] = "fluid"
    if periodic and some(draw, 0.6):
        s.stream = s.speed * draw.uniform(-1, 1)
        flow["rate"] = [s.stream if axis in periodic else 0 for axis in "xyz"[: s.dim]]
        flow["rate_axes"] = periodic
    if "track" not in scene["mesh"] and (periodic or "left" in flow.get("bc", {})) and some(draw, 0.5):
        scene["sim"]["frame"] = draw.choice(["body", "velocity"])
        if scene["sim"]["frame"] == "velocity":
            scene["sim"]["frame_velocity"] = [s.speed * draw.uniform(-1, 1) for _ in range(s.dim)]


def draw_newer(draw, s, scene):
    """Local refinement, packed suspensions, hinges and surfaces from files in space."""
    particle = scene.get("particle")
    if not particle:
        return
    body = particle[particle["groups"][0]]
    if some(draw, 0.35):
        scene["mesh"]["levels"] = 1 if s.dim == 3 else draw.randint(1, 2)
        if some(draw, 0.9):
            scene["mesh"]["track"] = True
            scene["sim"].pop("adapt", None)
    if some(draw, 0.25):
        for name in ("position", "angle", "count", "free", "pivot", "stops", "motion", "motion_amplitude", "motion_period"):
            body.pop(name, None)
        body.update(place="pack", fraction=draw.uniform(0.05, 0.35), seed=draw.randint(0, 99))
        if some(draw, 0.5):
            body.update(sizes="lognormal", sizes_deviation=draw.uniform(0.05, 0.3))
        scene["output"] = {"suspension": True}
    elif s.dim == 3 and some(draw, 0.4):
        for name in ("radius", "a", "b", "c", "length", "thickness"):
            body.pop(name, None)
        body.update(shape="stl", file="surface.stl", scale=s.size / 3)
    if s.dim == 3 and "position" in body and "motion" not in body and some(draw, 0.4):
        body.pop("free", None)
        body.update(pivot=[0.2 * s.size, 0, 0], hinge=[draw.uniform(-1, 1) for _ in range(3)])
    draw_start(draw, s, scene)


def draw_scene(seed):
    """The scene of a seed, its ranks and its scales."""
    draw = random.Random(seed)
    s = Scales(draw, 0.1 if seed <= NEWER else 0.25)
    s.stream, s.thick = 0, some(draw, 0.4)
    if s.thick:
        s.cells = [n + 4 for n in s.cells]
        s.upper = [n * s.h for n in s.cells]
    mesh = draw_mesh(draw, s)
    scene = {"mesh": mesh, "flow": draw_flow(draw, s, mesh)}
    if some(draw, 0.95):
        scene["particle"] = draw_bodies(draw, s)
        for name, chance, values in [("type", 0.12, ["explicit"]), ("method", 0.5, ["nodal", "penalty", "aligned"]), ("force", 0.08, ["volume"])]:
            if some(draw, chance):
                scene.setdefault("couple", {})[name] = draw.choice(values)
        if some(draw, 0.4):
            scene["contact"] = {"law": draw.choice(["repulsive", "spring", "none"])}
    if some(draw, 0.8 if s.thick else 0.1):
        scene["preset"] = draw.choice(["fast", "balanced", "accurate"])
    scene["sim"] = {"dt": s.dt, "steps": draw.randint(3, 4 if s.dim == 3 else 10)}
    if some(draw, 0.15):
        scene["sim"]["adapt"] = True
    ranks = 2 if some(draw, 0.12) else 1
    if seed > NEWER:
        draw_newer(draw, s, scene)
    return scene, ranks, s


def in_a_word(scene):
    """What a reader of the table wants to know of a scene."""
    mesh, bodies = scene["mesh"], scene.get("particle", {"groups": []})
    words = ["3D" if mesh.get("dimension") == 3 or mesh.get("kind") in ("tube", "ball", "shell") else "2D", mesh.get("kind", "box") + (f" {''.join(mesh['periodic'])}-periodic" if "periodic" in mesh else "") + (" deformed" if "deform" in mesh else "")]
    around = scene["flow"].get("density", 1)  # what a membrane has inside, too
    words += [f"{bodies[name].get('shape', 'region')} {bodies[name].get('density', around) / around:.2g}" for name in bodies["groups"]] or ["no bodies"]
    mesh_words = [f"{mesh['levels']} levels" if "levels" in mesh else "", "following" if "track" in mesh else ""]
    words += [*mesh_words, *(name for name in ("initial", "rate") if name in scene["flow"]), scene["sim"].get("frame", ""), "packed" if "suspension" in scene.get("output", {}) else ""]
    words += [scene.get("preset", ""), scene["flow"].get("solver", ""), *scene.get("couple", {}).values(), "adaptive" if "adapt" in scene["sim"] else ""]
    return ", ".join(word for word in words if word)


# ---- verdicts ----


def find_lost(rows, scene, s):
    """A body whose centre is outside the domain, or None; a box that travels leaves places of the laboratory behind."""
    if "frame" in scene["sim"]:
        return None
    periodic = scene["mesh"].get("periodic", "")
    for row in rows:
        for axis, name in enumerate("xyz"[: s.dim]):
            if name not in periodic and not -1e-9 * s.upper[axis] <= row[name] <= (1 + 1e-9) * s.upper[axis]:
                return f"body {row['body']:g} at {name} = {row[name]:g} is outside the domain in step {row['step']:g}"
    return None


def possible_speed(row, body, scene, s, buoyancy, dt):
    """What gravity, forces and the stream can have made of a free body so far; the fluid's own inertia counts for a twentieth at least. A tenth of a cell a step is always possible: contact moves bodies apart that start too close."""
    density = body["density"] + 0.05 * s.density
    pull = abs(body["density"] - s.density) * math.hypot(*scene["flow"].get("gravity", [0]))
    size = min(value for name, value in body.items() if name in ("radius", "b", "thickness", "outer", "scale", "chord"))
    push = math.hypot(*body.get("force", [0])) / (math.pi * size**s.dim / 10)
    stream = abs(s.stream) + math.hypot(*body.get("velocity", [0])) + abs(body.get("angular_velocity", 0)) * s.size
    return stream + 0.1 * s.h / dt + ((pull + push + math.hypot(*scene["flow"].get("force", [0]))) / density + buoyancy) * row["time"]


def measure_speed(rows, scene, s, series):
    """Largest speed of a free body over the possible one."""
    worst, buoyancy, dt = 0, max([fuzzscalars.find_buoyancy(row, scene) for row in series], default=0), min([row["dt"] for row in series], default=s.dt)
    for row in rows:
        body = scene["particle"][row["group"]] if row["time"] > 0 else {"free": ""}
        if body.keys() & {"free", "motion", "pivot"} or len(scene["particle"]["groups"]) > 1:
            continue
        worst = max(worst, math.hypot(row["u"], row["v"], row["w"]) / possible_speed(row, body, scene, s, buoyancy, dt))
    return worst


def measure_run(run, scene, s, row):
    """Fills in figures and verdict of a run that ended; returns the message."""
    series, bodies = run.series(), run.bodies()
    speed = max([math.sqrt(2 * line["kinetic_energy"] / s.density) for line in series], default=0)  # an L2 norm, as that of the divergence
    h = s.h / 2 ** scene["mesh"].get("levels", 0)  # the smallest cell, as the program judges
    row["divergence"] = series[-1]["divergence"] * h / speed if series and speed > 0 else 0
    row["momentum"] = series[-1]["momentum_error"] if series and scene.get("couple", {}).get("force") != "volume" else 0
    row["speed"] = measure_speed(bodies, scene, s, series)
    fast = "fast" in (scene.get("preset"), scene["flow"].get("solver"))
    remarks = run.summary["remarks"]
    if not series:
        row["verdict"] = "BUG"
        return "no line in series.csv"
    for name, limit in [("divergence", DIVERGENCE), ("momentum", MOMENTUM_FAST if fast else MOMENTUM), ("speed", SPEED)]:
        if row[name] > limit:
            told = [remark for remark in remarks if "ends in doubt" in remark]
            row["verdict"] = "warned" if told else "BUG"
            return told[0] if told else f"silent: {name} {row[name]:.3g} beyond {limit:g}"
    if lost := find_lost(bodies, scene, s):
        row["verdict"] = "BUG"
        return lost
    return f"{len(remarks)} remarks" if remarks else ""


def continue_run(run, scene, s, at, ranks, args, folder):
    """A run that stops in the middle and goes on, on other ranks: its run, and what is wrong with where it ends"""
    path = folder / "scene.yaml"
    first = run_scene(path, {"sim_steps": at, "checkpoint_every": at}, run.summary["ranks"], folder / "parts", args.build, args.limit, cwd=ROOT)
    if judge_run(first):
        return first, ""
    second = run_scene(path, {"sim_restart": "latest"}, ranks, folder / "parts", args.build, args.limit, cwd=ROOT)
    return second, "" if judge_run(second) else compare_runs(run, second, s)


def execute_kind(seed, args, folder):
    """The same of a seed that has a check of its own"""
    kind, scene, ranks, s, files, check = draw_kind(seed)
    for name, text in files.items():
        (folder / name).write_text(text)
    restart = scene.pop("restart", None)
    (folder / "scene.yaml").write_text(json.dumps(scene, indent=1))
    run = run_scene(folder / "scene.yaml", {}, ranks, folder / "run", args.build, args.limit, cwd=ROOT)
    row = {"seed": seed, "ranks": ranks, "verdict": "ok", "divergence": "", "momentum": "", "speed": "", "message": "", "scene": f"{kind}: {in_a_word(scene)}"}
    verdict = judge_run(run)
    if not verdict and restart:
        run, message = continue_run(run, scene, s, restart["at"], restart["ranks"], args, folder)
        row["scene"] += f", restarted on {restart['ranks']}"
        verdict = judge_run(run)
        if verdict and verdict[0] == "stopped":
            verdict = "BUG", "a restart: " + verdict[1]
        elif message:
            verdict = "BUG", message
    if verdict:
        row["verdict"], row["message"] = verdict[0], verdict[1].replace(str(folder), "(folder)")
        if verdict[0] == "stopped" and (run.err + run.out).count("tumble: error:") != 1:
            row.update(verdict="BUG", message="not one error: " + row["message"])
    elif check and (wrong := check(run, scene, s)):
        row.update(verdict="BUG", message="silent: " + wrong)
    row["seconds"] = f"{run.seconds:.1f}"
    return row, scene, run


def execute(seed, args, folder):
    """The row of a seed, its scene and its run."""
    scalars = fuzzscalars.FIRST <= seed <= fuzzscalars.LAST
    if seed >= FIRST and not scalars:
        return execute_kind(seed, args, folder)
    scene, ranks, s = draw_scene(seed)
    if scalars:
        fuzzscalars.add_scalars(seed, scene, s)
    (folder / "outline.txt").write_text(OUTLINE)
    write_surface(folder / "surface.stl")
    (folder / "scene.yaml").write_text(json.dumps(scene, indent=1))
    run = run_scene(folder / "scene.yaml", {}, ranks, folder / "run", args.build, args.limit, cwd=ROOT)
    row = {"seed": seed, "ranks": ranks, "verdict": "ok", "divergence": "", "momentum": "", "speed": "", "message": "", "scene": in_a_word(scene)}
    row["seconds"] = f"{run.seconds:.1f}"
    verdict = judge_run(run)
    if verdict:
        row["verdict"], row["message"] = verdict
        row["message"] = row["message"].replace(str(folder), "(folder)")
        if row["verdict"] == "stopped" and (run.err + run.out).count("tumble: error:") != 1:
            row.update(verdict="BUG", message="not one error: " + row["message"])
    else:
        row["message"] = measure_run(run, scene, s, row)
        if wrong := fuzzscalars.check_scalars(run.series()):
            row.update(verdict="BUG", message="silent: " + wrong)
    for name in ("divergence", "momentum", "speed"):
        row[name] = f"{row[name]:.2g}" if row[name] != "" else ""
    return row, scene, run


# ---- main ----


def write_page(rows, path):
    """The table for people: how many ended how, and what those that stopped said."""
    counts = {verdict: sum(row["verdict"] == verdict for row in rows) for verdict in VERDICTS}
    lines = ["# Random scenes", "", "Written by `tools/fuzz` (`tools/fuzz --help` says what a verdict means; `tools/fuzz --seeds 17 --point` shows one).", ""]
    lines += [f"{len(rows)} seeds: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items()) + ". Figures of all: `outcomes.csv`.", ""]
    lines += ["| seed | scene | ended | message |", "| --- | --- | --- | --- |"]
    for row in rows:
        if row["verdict"] != "ok":
            lines.append(f"| {row['seed']} | {row['scene']} | {row['verdict']} | {row['message'].replace('|', ' ')} |")
    path.write_text("\n".join(lines) + "\n")


def show_point(seed, args):
    with tempfile.TemporaryDirectory(prefix="tumble-fuzz-") as folder:
        row, scene, run = execute(seed, args, Path(folder))
    print(json.dumps(scene, indent=1))
    print(run.out + run.err)
    for name in COLUMNS:
        print(f"{name:>10}  {row[name]}")
    return 1 if row["verdict"] == "BUG" else 0


def main():
    parser, args = parse_arguments()
    seeds = read_seeds(parser, args.seeds)
    if args.point:
        return show_point(seeds[0], args)

    def work(seed):
        with tempfile.TemporaryDirectory(prefix="tumble-fuzz-") as folder:
            row = execute(seed, args, Path(folder))[0]
        print(f"{row['verdict']:>8} {seed:>5} {row['seconds']:>6} s  {row['scene'][:70]:<70}  {row['message'][:110]}", flush=True)
        return row

    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        rows = list(pool.map(work, seeds))
    failed = any(row["verdict"] == "BUG" for row in rows)
    output = Path(args.output)
    known = {int(row["seed"]): row for row in (read_rows(output / "outcomes.csv") if (output / "outcomes.csv").exists() else []) + rows}
    rows = [known[seed] for seed in sorted(known)]
    write_rows(output / "outcomes.csv", COLUMNS, rows)
    write_page(rows, output / "README.md")
    counts = {verdict: sum(row["verdict"] == verdict for row in rows) for verdict in VERDICTS}
    print(f"\n{len(rows)} seeds: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items()) + f"; {output}/outcomes.csv")
    return 1 if failed else 0
