#!/usr/bin/env python3
"""Study of the boundary methods: runs what is missing in --work and writes ladder.csv, couette.csv, stream.csv, free.csv, oscillating.csv, inline.csv, inline-small.csv, settling.csv, approach.csv, plate.csv,
plate-moving.csv, plate-falling.csv, valve.csv, flaps.csv,
boundary.png and motion.png.

  runs/studies/boundary/study.py --work out/boundary [ladder couette stream free oscillating inline settling approach plate flaps figure motion]
"""

import argparse
import cmath
import csv
import json
import math
import random
import shlex
import statistics
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
sys.path.insert(0, str(ROOT / "tools"))
from toolbox import environment, launcher, machine_name, read_numbers, run_scene  # noqa: E402

METHODS = ["nodal", "penalty", "aligned"]
COLOURS = {"nodal": "tab:red", "penalty": "tab:orange", "aligned": "tab:blue"}
TORQUE = 16 * math.pi * 0.1 / 3  # of the Couette disc
REFERENCE = {"cd": 5.57953523384, "cl": 0.010618948146, "dp": 0.11752016697}  # 2D-1


def scene(work, name, yaml, options):
    """Summary of a run, which is made unless it is there."""
    folder = work / name
    if not (folder / "summary.json").exists():
        run = run_scene(ROOT / "runs" / yaml, {"output_every": 0, **options}, 1, folder, launch=[])
        if run.ended != "ok":
            print(f"{name}: {run.message}")
            return None
    return json.loads((folder / "summary.json").read_text())


def write(name, rows):
    if not rows:
        return
    with open(HERE / f"{name}.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def table(name):
    """Rows of a table that an earlier run wrote."""
    path = HERE / f"{name}.csv"
    return list(csv.DictReader(path.open())) if path.exists() else []


def error(value, exact):
    return f"{100 * (value / exact - 1):.5f}"


def ladder(work):
    """2D-1 on the mesh without hole, random shifts. Rows that the table has already are kept."""
    rows = table("ladder")
    known = {(row["method"], int(row["cells_per_diameter"]), int(row["seed"])) for row in rows}
    for resolution, seeds in (10, 10), (20, 10), (40, 10):
        for method in METHODS:
            for seed in range(1, seeds + 1):
                options = {"mesh_kind": "channel", "mesh_resolution": resolution, "couple_method": method, "mesh_shift_seed": seed}
                if (method, resolution, seed) in known:
                    continue
                s = scene(work, f"ladder/{resolution}-{method}-{seed}", "cylinder-2d1.yaml", options)
                if not s:
                    continue
                q = s["quantities"]
                row = {"method": method, "cells_per_diameter": resolution, "seed": seed, "unknowns": s["unknowns"]}
                row.update({f"{name}_error_percent": error(q[name], exact) for name, exact in REFERENCE.items()})
                row.update(force_difference=q["force_difference"], nonlinear=int(q["nonlinear_iterations"]), seconds=round(s["seconds"]["total"], 1))
                rows.append(row)
    write("ladder", sorted(rows, key=lambda row: (int(row["cells_per_diameter"]), METHODS.index(row["method"]), int(row["seed"]))))


def build_couette(work):
    program = work / "couette"
    if not program.exists():
        flags = subprocess.run(["pkg-config", "--cflags", "--libs", "PETSc"], capture_output=True, text=True, check=True).stdout.split()
        build = ROOT / "build"
        subprocess.run(["mpicc", "-O2", f"-I{ROOT / 'include'}", f"-I{build}", str(HERE / "couette.c"), "-o", str(program), f"-L{build}", "-ltumble", f"-Wl,-rpath,{build}", *flags, "-lm"], check=True)
    return program


def couette_rows(work, name, cells, method, options):
    path = work / "couette" / f"{name}.csv"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        words = f"""-mesh_lower -2,-2 -mesh_upper 2,2 -mesh_cells {cells},{cells} -flow_viscosity 0.1 -flow_ksp_rtol 1e-9 -flow_ksp_max_it 300
          -particle_groups disc -particle_disc_shape circle -particle_disc_radius 1 -particle_disc_angular_velocity 1 -couple_method {method} {options}"""
        run = subprocess.run([*launcher(1), str(build_couette(work)), *shlex.split(words)], capture_output=True, text=True, env=environment(), check=False)
        path.write_text(run.stdout)
    return read_numbers(path)


def couette(work):
    """The disc turns at rest, steady, at four random places of the mesh."""
    rows = []
    for method in METHODS:
        for cells, seeds in (24, 4), (48, 4), (96, 2):
            for seed in range(1, seeds + 1):
                r = random.Random(seed)
                place = ",".join(f"{(r.random() - 0.5) * 4 / cells:.5f}" for _ in range(2))
                steps = couette_rows(work, f"fixed-{method}-{cells}-{seed}", cells, method, f"-particle_disc_free none -particle_disc_position {place} -flow_time be -flow_solver direct -study_dt 1e4 -study_steps 6")
                if len(steps) < 6:
                    continue
                s = steps[-1]
                rows.append({"method": method, "cells_per_radius": cells // 4, "seed": seed, "velocity_error": s["error"], "torque_error_percent": error(-s["torque"], TORQUE),
                             "torque_volume_error_percent": error(-s["torque_volume"], TORQUE), "net_force": f"{math.hypot(s['fx'], s['fy']) / TORQUE:.3e}"})
    write("couette", rows)


def detrend(y):
    """Root mean square after a parabola is taken off (normal equations with orthogonal polynomials)."""
    n = len(y)
    x = [2 * i / (n - 1) - 1 for i in range(n)]
    rest, basis = list(y), []
    for power in range(3):
        p = [v**power for v in x]
        for b in basis:
            c = sum(u * v for u, v in zip(p, b)) / sum(v * v for v in b)
            p = [u - c * v for u, v in zip(p, b)]
        basis.append(p)
        c = sum(u * v for u, v in zip(rest, p)) / sum(v * v for v in p)
        rest = [u - c * v for u, v in zip(rest, p)]
    return math.sqrt(sum(v * v for v in rest) / n)


def stream(work):
    """The turning disc is carried along by the stream (0.5, 0.2): bias and noise of the torque, noise of the force in units of torque / radius."""
    rows = []
    for method in METHODS:
        for dt, steps in (0.02, 25), (0.005, 35):
            for scheme in "be", "bdf2":
                if method != "aligned" and (dt < 0.02 or scheme == "bdf2"):
                    continue
                options = f"-particle_disc_free none -particle_disc_position 0.013,-0.0047 -particle_disc_velocity 0.5,0.2 -study_stream 0.5,0.2 -flow_time {scheme} -study_dt {dt} -study_steps {steps}"
                s = couette_rows(work, f"move-{method}-48-{dt}-{scheme}", 48, method, options)[8:]
                if len(s) < 10:
                    continue
                torque = [100 * row["torque"] / -TORQUE for row in s]
                noise = math.hypot(*(detrend([100 * row[f] / TORQUE for row in s]) for f in ("fx", "fy")))
                rows.append({"method": method, "cells_per_radius": 12, "dt": dt, "scheme": scheme, "torque_bias_percent": f"{statistics.mean(torque) - 100:.4f}", "torque_noise_percent": f"{detrend(torque):.4f}",
                             "force_noise_percent": f"{noise:.4f}", "iterations": max(int(row["iterations"]) for row in s)})
    write("stream", rows)


def free(work):
    """The same with a free disc: errors of its velocities after 30 steps."""
    rows = []
    for method, densities in ("nodal", [1]), ("penalty", [1]), ("aligned", [0.01, 1, 10]):
        for density in densities:
            for scheme in ("bdf2",) if method != "aligned" else ("be", "bdf2"):
                options = f"-particle_disc_position 0.013,-0.0047 -particle_disc_density {density} -study_held -particle_disc_velocity 0.5,0.2 -study_stream 0.5,0.2 -flow_time {scheme} -study_dt 0.02 -study_steps 30"
                s = couette_rows(work, f"free-{method}-24-0.02-{scheme}-{density}", 24, method, options)
                if len(s) < 30:
                    continue
                s = s[-1]
                rows.append({"method": method, "cells_per_radius": 6, "density_ratio": density, "scheme": scheme, "du": f"{s['u'] - 0.5:.2e}", "dv": f"{s['v'] - 0.2:.2e}", "dw_percent": f"{100 * (s['w'] - 1):.5f}"})
    write("free", rows)


def interpolate(rows, time, column):
    for a, b in zip(rows, rows[1:]):
        if a["time"] - 1e-9 <= time <= b["time"] + 1e-9:
            w = (time - a["time"]) / (b["time"] - a["time"])
            return (1 - w) * a[column] + w * b[column]
    return None


def oscillating(work):
    """Drag of the oscillating cylinder at the times of the reference; noise: fourth difference of the series over sqrt(70), without the first ten steps. Rows without a run in --work are kept."""
    reference = [(r["time"], r["value"]) for r in csv_rows(ROOT / "runs/reference/oscillating-cylinder.csv")]
    rows = []
    for cells, h, methods, end in (10, 0.01, METHODS, 8), (20, 0.005, ["aligned"], 4.2):
        for method in methods:
            name = f"oscillating/{cells}-{method}"
            old = [row for row in table("oscillating") if (row["method"], int(row["cells_per_diameter"])) == (method, cells)]
            if old and not (work / name / "summary.json").exists():
                rows += old
                continue
            if not scene(work, name, "oscillating-cylinder.yaml", {"mesh_focus_h": h, "couple_method": method, "particle_cylinder_reference_speed": 0.3927, "sim_time": end}):
                continue
            series = read_numbers(work / name / "series.csv")
            for column in "cd_residual", "cd_volume":
                e = [v - r for v, r in ((interpolate(series, t, column), r) for t, r in reference) if v is not None]
                c = [row[column] for row in series[10:]]
                n = [(c[i - 2] - 4 * c[i - 1] + 6 * c[i] - 4 * c[i + 1] + c[i + 2]) / math.sqrt(70) for i in range(2, len(c) - 2)]
                rows.append({"method": method, "cells_per_diameter": cells, "form": column[3:], "points": len(e), "rms": f"{math.sqrt(sum(v * v for v in e) / len(e)):.4f}",
                             "noise": f"{math.sqrt(sum(v * v for v in n) / len(n)):.5f}"})
    write("oscillating", rows)


def stokes():
    """Added mass and drag, over rho pi a^2 (times acceleration, times angular frequency and velocity), of the cylinder of inline.yaml in small oscillations: Stokes 1851, 1 + 4 K1(z)/(z K0(z)) with
    z = a sqrt(i omega/nu); K_n(z) = int_0^oo exp(-z cosh t) cosh(n t) dt"""
    z = 0.5 * cmath.sqrt(2j * math.pi / 5 / 0.01)
    k = [sum(cmath.exp(-z * math.cosh(0.001 * i)) * math.cosh(n * 0.001 * i) * (0.5 if i == 0 else 1) for i in range(8000)) for n in (0, 1)]
    g = 1 + 4 * k[1] / (z * k[0])
    return g.real, -g.imag


def dot(x, y):
    return sum(a * b for a, b in zip(x, y))


def inline_parts(folder, speed):
    """Force on the cylinder over the fourth period, its velocity and acceleration"""
    rate = 2 * math.pi / 5
    rows = [row for row in read_numbers(folder / "bodies.csv") if row["time"] > 15 + 1e-9]
    return [row["force_x"] for row in rows], [-speed * math.cos(rate * row["time"]) for row in rows], [speed * rate * math.sin(rate * row["time"]) for row in rows]


def inline(work):
    """The cylinder that oscillates in a wide closed box. Small oscillations: added mass and drag against Stokes' solution. KC = 5: Morison's coefficients, F = -rho D cd |u| u/2 - rho pi D^2 ci a/4, from
    the parts of F along u and a (Fourier), cd also from the least squares of the whole."""
    rows, exact = [], stokes()
    for method in METHODS:
        for cells, dt in (5, 0.025), (10, 0.025), (10, 0.0125):
            name = f"inline/small-{cells}-{method}-{dt}"
            options = {"mesh_focus_h": 1 / cells, "mesh_lower": "-60,-60", "mesh_upper": "60,60", "particle_cylinder_motion_amplitude": "-0.02,0", "couple_method": method, "sim_dt": dt}
            if (method != "aligned" and dt < 0.025) or not scene(work, name, "studies/boundary/inline.yaml", options):
                continue
            f, u, a = inline_parts(work / name, 0.04 * math.pi / 5)
            mass, drag = -dot(f, a) / dot(a, a) / (math.pi / 4), -dot(f, u) / dot(u, u) / (math.pi / 4 * 2 * math.pi / 5)
            rows.append({"method": method, "cells_per_diameter": cells, "dt": dt, "added_mass": f"{mass:.5f}", "added_mass_error_percent": error(mass, exact[0]), "drag": f"{drag:.5f}",
                         "drag_error_percent": error(drag, exact[1])})
    write("inline-small", rows)
    rows = []
    for method in METHODS:
        for cells, dt in (10, 0.025), (10, 0.0125), (20, 0.0125):
            name = f"inline/{cells}-{method}-{dt}"
            if method != "aligned" and dt < 0.025:
                continue
            s = scene(work, name, "studies/boundary/inline.yaml", {"mesh_focus_h": 1 / cells, "couple_method": method, "sim_dt": dt})
            if not s:
                continue
            f, u, a = inline_parts(work / name, 1)
            drag, inertia = [-abs(x) * x / 2 for x in u], [-math.pi / 4 * x for x in a]
            rows.append({"method": method, "cells_per_diameter": cells, "dt": dt, "unknowns": s["unknowns"], "cd": f"{dot(f, u) / dot(drag, u):.4f}", "cd_least_squares": f"{dot(f, drag) / dot(drag, drag):.4f}",
                         "ci": f"{dot(f, a) / dot(inertia, a):.4f}", "cd_largest": f"{2 * max(map(abs, f)):.4f}", "noise": f"{2 * fourth_difference(f):.5f}"})
    write("inline", rows)


def csv_rows(path):
    with open(path) as file:
        return [{k: float(v) for k, v in row.items() if k in ("time", "value")} for row in csv.DictReader(line for line in file if not line.startswith("#"))]


def smooth(a):
    """Local cubic fit over 9 values (Savitzky, Golay 1964), without the first and last four."""
    return [(59 * a[i] + 54 * (a[i - 1] + a[i + 1]) + 39 * (a[i - 2] + a[i + 2]) + 14 * (a[i - 3] + a[i + 3]) - 21 * (a[i - 4] + a[i + 4])) / 231 for i in range(4, len(a) - 4)]


def accelerations(folder, dt):
    v = [0.0] + [-row["v"] for row in read_numbers(folder / "bodies.csv") if row["step"] > 0]
    return v, [(b - a) / dt for a, b in zip(v, v[1:])]


def settling(work):
    """The falling disc: fall speeds, and noise of the acceleration (rms after local cubic fits over 9 steps, without the first 8 steps) in % of the buoyant weight over the mass."""
    rows, weight = [], 981 * 0.25 / 1.25
    runs = [(8, method, 0.2, 0.005) for method in METHODS] + [(16, "aligned", 0.2, 0.005)]
    runs += [(cells, "aligned", 0.6, dt) for dt, sizes in ((0.005, (8, 16, 32)), (0.0025, (8, 16, 32)), (0.00125, (16,))) for cells in sizes]
    for cells, method, end, dt in runs:
        name = f"settling/{'long-' if end > 0.2 else ''}{cells}" + (f"-{method}" if end < 0.6 else "") + (f"-{dt}" if dt < 0.005 else "")
        focus = "0.8,1.0,1.2,4.2" if end > 0.2 else "0.8,3.1,1.2,4.2" if cells == 16 else "0.75,2.5,1.25,4.25"
        at = round(0.1 / dt)
        options = {"mesh_focus_h": 0.25 / cells, "mesh_focus": focus, "sim_dt": dt, "sim_time": end, "couple_method": method}
        s = scene(work, name, "studies/boundary/settling.yaml", options)
        if not s:
            continue
        v, a = accelerations(work / name, dt)
        noise = [x - y for x, y in zip(a[12:-4], smooth(a[8:]))]
        rows.append({"method": method, "cells_per_diameter": cells, "dt": dt, "until": end, "v_0.1": f"{v[at]:.4f}", "v_0.2": f"{v[2 * at]:.4f}", "v_largest": f"{max(v):.4f}",
                     "acceleration_noise_percent": f"{100 * math.sqrt(sum(x * x for x in noise) / len(noise)) / weight:.4f}",
                     "outer_iterations": f"{s['outer_iterations']['mean']:.1f}", "fallbacks": int(sum(row.get("aligned_penalty_bodies", 0) for row in read_numbers(work / name / "series.csv")))})
    write("settling", rows)


def approach_options(gap, cells, seed, force):
    """Two discs, the gap in cells of 1/32, on a line at 0.35 rad, anywhere within a cell."""
    r = random.Random(seed)
    centre = [1 + (r.random() - 0.5) / 32 for _ in range(2)] if seed else [1.003, 1.002]
    half, line = 0.125 + gap / 64, (math.cos(0.35), math.sin(0.35))
    options = {"mesh_focus_h": 0.25 / cells, **({} if force > 1 else {"flow_solver": "direct"})}
    for group, sign in ("one", -1), ("two", 1):
        options[f"particle_{group}_position"] = ",".join(f"{c + sign * half * e:.8f}" for c, e in zip(centre, line))
        options[f"particle_{group}_force"] = ",".join(f"{-sign * force * e}" for e in line)
    return options


def closing(folder):
    """(step, gap in cells of 1/32, speed of approach) of every step"""
    steps = {}
    for row in read_numbers(folder / "bodies.csv"):
        steps.setdefault(row["step"], []).append(row)
    for number, (a, b) in steps.items():
        dx, dy = b["x"] - a["x"], b["y"] - a["y"]
        distance = math.hypot(dx, dy)
        yield number, (distance - 0.25) * 32, ((a["u"] - b["u"]) * dx + (a["v"] - b["v"]) * dy) / distance


def approach(work):
    """Quasi-steady speed of approach at gaps of 2 to 0.2 cells, four places of the mesh, against the same on a mesh four times as fine; and one approach in time for each method."""
    rows = []
    for gap in 2, 1, 0.5, 0.3, 0.2:
        name = f"approach/fine-{gap}"
        if not scene(work, name, "studies/boundary/approach.yaml", approach_options(gap, 32, 0, 4e-8)):
            continue
        reference = list(closing(work / name))[-1][2]
        for method in METHODS:
            ratio, fallbacks = [], 0
            for seed in 1, 2, 3, 4:
                name = f"approach/{method}-{gap}-{seed}"
                if scene(work, name, "studies/boundary/approach.yaml", {"couple_method": method, **approach_options(gap, 8, seed, 4e-8)}):
                    ratio.append(list(closing(work / name))[-1][2] / reference)
                    fallbacks += int(read_numbers(work / name / "series.csv")[-1].get("aligned_penalty_bodies", 0))
            rows.append({"gap_in_cells": gap, "reference_speed_per_force": f"{reference / 4e-8:.5f}", "method": method, "places": len(ratio), "speed_ratio_lowest": f"{min(ratio):.4f}",
                         "speed_ratio_highest": f"{max(ratio):.4f}", "fallbacks": fallbacks})
    write("approach", rows)
    for method in METHODS:
        options = {"couple_method": method, "flow_convection": "true", "sim_dt": 0.0025, "sim_steps": 80, **approach_options(1.6, 8, 0, 4)}
        scene(work, f"approach/time-{method}", "studies/boundary/approach.yaml", options)


def plate(work):
    """Forces on a plate of a hundredth of its length, on shifted meshes (seed 0: not shifted), and on thicker ones, whose limit they are."""
    rows = []
    runs = [("aligned", 0.001, 10, range(1, 11)), ("aligned", 0.001, 20, range(1, 5)), ("aligned", 0.001, 40, [0]), ("penalty", 0.001, 10, range(1, 5)), ("penalty", 0.001, 20, range(1, 3))]
    runs += [("aligned", thickness, cells, [0]) for thickness, cells in ((0.02, 20), (0.015, 20), (0.01, 20), (0.0075, 40), (0.005, 40))]
    for method, thickness, cells, seeds in runs:
        for seed in seeds:
            options = {"mesh_resolution": cells, "couple_method": method, "particle_plate_thickness": thickness, **({"mesh_shift_seed": seed} if seed else {})}
            s = scene(work, f"plate/{cells}-{method}-{thickness}-{seed}", "studies/boundary/plate.yaml", options)
            if s:
                rows.append({"method": method, "thickness": thickness, "cells_per_length": cells, "seed": seed, "cd": f"{s['quantities']['cd']:.5f}", "cl": f"{s['quantities']['cl']:.5f}"})
    write("plate", rows)
    plate_moving(work)
    plate_falling(work)
    valve(work)


def fourth_difference(v):
    """Root mean square of the noise in a smooth series."""
    e = [(v[i - 2] - 4 * v[i - 1] + 6 * v[i] - 4 * v[i + 1] + v[i + 2]) / math.sqrt(70) for i in range(2, len(v) - 2)]
    return math.sqrt(sum(x * x for x in e) / len(e))


def plate_moving(work):
    """Means and noise, in % of them, of the force on a plate that is carried through fluid at rest, after t = 0.3."""
    rows = []
    for cells, dt, methods in ("64,48", 0.02, ["penalty", "aligned"]), ("64,48", 0.005, ["aligned"]), ("128,96", 0.01, ["penalty", "aligned"]):
        for method in methods:
            name = f"plate/moving-{cells.split(',')[0]}-{dt}-{method}"
            if not scene(work, name, "studies/boundary/plate-moving.yaml", {"mesh_cells": cells, "sim_dt": dt, "couple_method": method}):
                continue
            row = {"method": method, "cells_per_length": int(cells.split(",")[0]) // 4, "dt": dt}
            for column in "force_x", "force_y", "torque_z":
                v = [r[column] for r in read_numbers(work / name / "bodies.csv") if r["time"] > 0.3]
                row.update({column: f"{statistics.mean(v):.4f}", f"{column}_noise_percent": f"{100 * fourth_difference(v) / abs(statistics.mean(v)):.2f}"})
            rows.append(row)
    write("plate-moving", rows)


def plate_falling(work):
    """Where the falling plate is at the end, and noise of its acceleration in % of buoyant weight over mass."""
    rows = []
    for cells, dt in ("32,64", 0.01), ("64,128", 0.005):
        for method in "penalty", "aligned":
            name = f"plate/falling-{cells.split(',')[0]}-{method}"
            if not scene(work, name, "studies/boundary/plate-falling.yaml", {"mesh_cells": cells, "sim_dt": dt, "couple_method": method}):
                continue
            b = read_numbers(work / name / "bodies.csv")
            v = [r["v"] for r in b if r["time"] > 0.1]
            noise = fourth_difference([(after - before) / dt for before, after in zip(v, v[1:])])
            rows.append({"method": method, "cells": cells.replace(",", "x"), "dt": dt, **{c: f"{b[-1][c]:.4f}" for c in ("x", "y", "angle")}, "noise_percent": f"{100 * noise / (10 * 2 / 3):.2f}"})
    write("plate-falling", rows)


def valve(work):
    """Largest angle of a heart-valve flap of half a cell's thickness in the second period."""
    rows = []
    for inlet in 0.925, 1.25:
        for cells, dt in ("64,16", 0.01), ("64,16", 0.005), ("128,32", 0.005):
            for method in "penalty", "aligned":
                name = f"plate/valve-{inlet}-{cells.split(',')[0]}-{dt}-{method}"
                options = {"mesh_cells": cells, "sim_dt": dt, "couple_method": method, "particle_flap_thickness": 0.03, "flow_bc_left_factor": f"{inlet},1,1"}
                if (inlet == 1.25 and dt < 0.01) or not scene(work, name, "heart-valve.yaml", options):
                    continue
                angle, time = max((r["angle"], r["time"]) for r in read_numbers(work / name / "bodies.csv") if r["time"] > 1)
                series = read_numbers(work / name / "series.csv")
                rows.append({"method": method, "inlet": inlet, "cells": cells.replace(",", "x"), "dt": dt, "largest_angle": f"{angle:.4f}", "at": f"{time:.3f}",
                             "outer_iterations": f"{statistics.mean(r['outer_iterations'] for r in series):.1f}", "fallbacks": int(sum(r.get("aligned_penalty_bodies", 0) for r in series))})
    write("valve", rows)


def flaps(work):
    """Angle of two flaps hinged in the walls that a jet blows open."""
    rows = []
    for method, cells, dt in ("aligned", "64,32", 0.01), ("aligned", "128,64", 0.01), ("aligned", "256,128", 0.01), ("aligned", "128,64", 0.005), ("aligned", "128,64", 0.0025), ("penalty", "64,32", 0.01), ("penalty", "128,64", 0.01), ("penalty", "256,128", 0.01):
        name = f"flaps/{cells.split(',')[0]}-{method}-{dt}"
        s = scene(work, name, "studies/boundary/flaps.yaml", {"mesh_cells": cells, "sim_dt": dt, "sim_time": 0.2, "couple_method": method})
        if not s:
            continue
        b = read_numbers(work / name / "bodies.csv")
        lower, upper = ([r for r in b if r["body"] == body] for body in (0, 1))
        angle = {round(r["time"], 6): r["angle"] for r in lower}
        series = read_numbers(work / name / "series.csv")
        rows.append({"method": method, "cells": cells.replace(",", "x"), "dt": dt, "angle_0.1": f"{angle[0.1]:.4f}", "angle_0.15": f"{angle[0.15]:.4f}",
                     "asymmetry": f"{max(abs(x['angle'] + y['angle']) for x, y in zip(lower, upper)):.1e}", "outer_iterations": f"{statistics.mean(r['outer_iterations'] for r in series):.1f}",
                     "most": int(max(r["outer_iterations"] for r in series)), "fallbacks": int(sum(r.get("aligned_penalty_bodies", 0) for r in series))})
    write("flaps", rows)


def figure(work):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(1, 3, figsize=(14, 4.2))
    rows = read_numbers(HERE / "ladder.csv")
    for method in METHODS:
        worst = {}
        for row in rows:
            if row["method"] == method:
                worst[row["unknowns"]] = max(worst.get(row["unknowns"], 0), abs(row["cd_error_percent"]))
                axes[0].plot(row["unknowns"], abs(row["cd_error_percent"]), ".", color=COLOURS[method], alpha=0.4)
        axes[0].plot(list(worst), list(worst.values()), "o-", color=COLOURS[method], label=method)
    axes[0].set(xscale="log", yscale="log", xlabel="unknowns", ylabel="|error of Cd| [%]", title="2D-1, mesh without hole: shifts, worst")
    rows = read_numbers(HERE / "couette.csv")
    for method in METHODS:
        mean = {}
        for row in rows:
            if row["method"] == method:
                mean.setdefault(row["cells_per_radius"], []).append(row["velocity_error"] ** 2)
        axes[1].plot(list(mean), [math.sqrt(sum(v) / len(v)) for v in mean.values()], "o-", color=COLOURS[method], label=method)
    h = [6, 24]
    axes[1].plot(h, [4e-4 * (6 / n) ** 3 for n in h], "k:", label="third order")
    axes[1].set(xscale="log", yscale="log", xlabel="cells a radius", ylabel="velocity error, L2", title="Couette disc, rms over shifts")
    reference = csv_rows(ROOT / "runs/reference/oscillating-cylinder.csv")
    for method in METHODS:
        series = read_numbers(work / f"oscillating/10-{method}" / "series.csv")
        if series:
            axes[2].plot([r["time"] for r in series[10:]], [r["cd_residual"] for r in series[10:]], color=COLOURS[method], lw=0.8, label=method)
    axes[2].plot([r["time"] for r in reference], [r["value"] for r in reference], "k+", label="published")
    axes[2].set(xlabel="t [s]", ylabel="Cd", title="oscillating cylinder, 10 cells a diameter", ylim=(-4.2, 4.2))
    finish(fig, axes, "boundary.png")


def finish(fig, axes, name):
    import matplotlib.pyplot as plt

    for axis in axes:
        axis.legend()
        axis.grid(alpha=0.3)
    fig.tight_layout()
    fig.savefig(HERE / name, dpi=110)
    plt.close(fig)


def motion(work):
    """Figure of the falling disc and of the two discs."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(1, 3, figsize=(14, 4.2))
    for method, colour in COLOURS.items():
        _, a = accelerations(work / f"settling/8-{method}", 0.005)
        axes[0].plot([0.005 * (i + 0.5) for i in range(len(a))], a, color=colour, lw=1, label=method)
    axes[0].set(xlabel="t [s]", ylabel="acceleration [cm/s$^2$]", title="falling disc, 8 cells a diameter")
    for cells, style in (8, "-"), (16, "--"):
        _, a = accelerations(work / f"settling/long-{cells}", 0.005)
        axes[1].plot([0.005 * (i + 0.5) for i in range(40, len(a))], a[40:], style, lw=1, label=f"aligned, {cells} cells a diameter")
    axes[1].set(xlabel="t [s]", ylabel="acceleration [cm/s$^2$]", title="the same, later")
    for method, colour in COLOURS.items():
        path = list(closing(work / f"approach/time-{method}"))[1:]
        axes[2].plot([p[1] for p in path], [p[2] for p in path], ".-", ms=3, lw=0.8, color=colour, label=method)
    axes[2].set(xlabel="gap / cell size", ylabel="speed of approach", title="two discs pushed together, 8 cells a diameter", xlim=(1.7, -0.3))
    finish(fig, axes, "motion.png")


def main():
    parts = {f.__name__: f for f in (ladder, couette, stream, free, oscillating, inline, settling, approach, plate, flaps, figure, motion)}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, default=Path("out/boundary"))
    parser.add_argument("parts", nargs="*", choices=[*parts, []], default=list(parts))
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    print(machine_name())
    for name in args.parts:
        parts[name](args.work.resolve())


if __name__ == "__main__":
    main()
