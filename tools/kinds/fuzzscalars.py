"""What the generators of tools/fuzz carry from seed 2001 to 3000: the scene of the seed with heat, and perhaps a solute that it makes.

`add_scalars(seed, scene, s)` gives a scene of tools/fuzz conditions at its walls, buoyancy, and bodies of every kind that the program knows.
`check_scalars(series)` says what is wrong with a run that ended: the books of each scalar, and numbers that are none.
"""

import math
import random

from kinds.fuzzdraws import power, some

FIRST, LAST = 2001, 3000
MORE = 2201  # from this seed on with bodies that dissolve or grow, that hold one value, that react inside, and fluxes by scalars
ERROR = 1e-7  # of the books of a step, over the sum of their sizes


def draw_wall(draw, diffusivity, length):
    kind = draw.choice(["value", "flux", "transfer"])
    if kind == "value":
        return {"value": draw.choice([0, 1, "1+x-x", "sin(t)"])}
    if kind == "flux":
        return {"flux": draw.uniform(-1, 1) * diffusivity / length}
    return {"transfer": power(draw, -1, 1) * diffusivity / length, "ambient": draw.choice([0, 1])}


def draw_material(draw, diffusivity, s):
    kind = draw.choice(["conjugate", "conjugate", "value", "flux", "transfer"])
    if kind == "conjugate":
        material = {"conductivity": diffusivity * power(draw, -3, 3), "capacity": power(draw, -1, 1)}
        if some(draw, 0.4):
            material["initial"] = draw.choice([0, 1, 3])
        if some(draw, 0.2):
            material["source"] = diffusivity / s.size**2
        return material
    if kind == "flux":
        return {"condition": kind, "flux": draw.choice([1, "x>0 ? 1 : 0"]) if some(draw, 0.3) else diffusivity / s.size}
    more = {"transfer": power(draw, -1, 2) * diffusivity / s.size} if kind == "transfer" else {}
    return {"condition": kind, "value": draw.choice([0, 1, 2]), **more}


def change_material(draw, name, material, diffusivity, s):
    """What bodies have learned since the seeds below were drawn"""
    kind = material.get("condition", "conjugate")
    if kind == "conjugate" and some(draw, 0.3):
        material.pop("source", None)
        material["decay"] = diffusivity / s.size**2 * power(draw, -1, 1)
    elif kind == "conjugate" and some(draw, 0.4):
        material.update(condition="lumped", initial=draw.choice([0, 1, 3]))
        material.pop("conductivity")
    if kind == "flux" and some(draw, 0.4):
        material["flux"] = f"{diffusivity / s.size}*(1-{name})" + draw.choice(["", "^2", "*(x>0 ? 1 : 0)"])
    if kind in ("value", "transfer", "flux") and some(draw, 0.4):
        material["dissolves"] = draw.choice([-1, 1]) * s.h * s.size / (s.dt * diffusivity) * power(draw, -3, -1)


def add_scalars(seed, scene, s):
    draw = random.Random(f"scalars {seed}")
    speed, viscosity, density = max(abs(getattr(s, "stream", 0)), s.h / s.dt * 0.1), scene["flow"].get("viscosity", 1), scene["flow"].get("density", 1)
    diffusivity = draw.choice([viscosity / density * power(draw, -1.5, 1.5), speed * s.h * power(draw, -2, 1)])
    heat = {"conductivity": diffusivity, "initial": draw.choice([0, 1, "x>0 ? 1 : 0", 0.5])}
    gravity = math.hypot(*scene["flow"].get("gravity", [0]))
    if gravity and some(draw, 0.6):
        heat["expansion"] = speed**2 / (gravity * s.size) * power(draw, -1, 0.5)
    if some(draw, 0.15):
        heat["source"] = draw.choice([diffusivity / s.size**2, "t", "-heat"])
    if some(draw, 0.1):
        heat["decay"] = 0.1 / s.dt
    walls = [side for axis, pair in zip("xyz"[: s.dim], [("left", "right"), ("bottom", "top"), ("front", "back")]) for side in pair if axis not in scene["mesh"].get("periodic", "")]
    if scene["mesh"].get("kind", "box") == "box":
        heat["bc"] = {side: draw_wall(draw, diffusivity, s.h) for side in walls if some(draw, 0.5)}
    if len(walls) < 2 * s.dim and some(draw, 0.2):
        heat["gradient"] = [1 / s.size] + [0] * (s.dim - 1)
    scene["scalars"], scene["scalar"] = ["heat"], {"heat": heat}
    if some(draw, 0.25):
        scene["scalars"] = ["heat", "solute"]
        scene["scalar"]["solute"] = {"conductivity": diffusivity * power(draw, -1, 1), "initial": 0, "reaction": [0.1 / s.dt, draw.choice([0, -0.1 / s.dt])]}
    if some(draw, 0.1):
        scene["flow"].update(viscosity_of_scalars=f"{viscosity}*exp(-0.5*heat)")
    for name in scene.get("particle", {}).get("groups", []):
        for scalar in scene["scalars"]:
            if some(draw, 0.8):
                scene["particle"][name][scalar] = draw_material(draw, diffusivity, s)
                if seed >= MORE:
                    change_material(draw, scalar, scene["particle"][name][scalar], diffusivity, s)


def find_buoyancy(row, scene):
    """Acceleration by the buoyancy of scalars in a row of the series, at most."""
    gravity = math.hypot(*scene["flow"].get("gravity", [0]))
    return sum(abs(scene["scalar"][name].get("expansion", 0)) * gravity * max(abs(row[f"scalar_min_{name}"]), abs(row[f"scalar_max_{name}"])) for name in scene.get("scalars", []))


def check_scalars(series):
    for row in series:
        for name, value in row.items():
            if name.startswith("scalar_") and isinstance(value, float) and not math.isfinite(value):
                return f"{name} is {value} in step {row['step']:g}"
            if name.startswith("scalar_error_") and value > ERROR:
                return f"{name} is {value:.2g} in step {row['step']:g}"
    return ""
