"""Run tumble, a parallel solver for particulate flow, and read its results.

    import tumble
    run = tumble.run("runs/sedimentation.yaml", sim_time=0.1)     any option by its name; -sim_time 0.1. Errors are tumble.Failure
    run = tumble.run({"mesh": {"cells": [32, 96], ...}, ...}, ranks=2, out="out/mine")      a scene as a dictionary
    frame = tumble.sweep(scene, particle_disc_density=[1.1, 1.25, 1.5])   one row a run: varied options, quantities of summary.json
    for row in tumble.start(scene): print(row["time"], row["cells"])    rows of series.csv while it runs

    run = tumble.open("out/dkt")                       results of an earlier run; run.follow() gives the rows of one that goes on
    run.series["time"], run.group("disc"), run.body(1)["y"]         tables: columns are arrays, all else is pandas.DataFrame's
    run.plot()                                         the pictures of tumble-plot, shown by a notebook
    shot = run.snapshot(time=0.2)                      the nearest one; or step=...; run.steps, run.times list them
    shot["velocity"]                                   [points][3]; shot.points [points][3], shot.cells [cells][9 or 27] in VTK's order
    shot.sample("velocity", [[1.0, 3.5]])              its value at places, by the finite element polynomials; nan outside
    shot.pyvista().plot(scalars="velocity")            the same as a grid of pyvista; shot.pyvista("bodies")
    shot.bodies["position"]                            [bodies][3] at that moment
    run.summary["quantities"], run.options["sim_dt"]

Needs numpy; snapshots need h5py; pictures matplotlib; sweep() and tables as frames pandas; shot.pyvista() pyvista.
The program is $TUMBLE_PROGRAM, `tumble` in PATH, or build/tumble of the source tree.
"""

from __future__ import annotations

from pathlib import Path

from .launch import Failure, Job, find_program, run, start, sweep
from .reader import Pictures, Run, Snapshot, Table, read_table

__all__ = ["Failure", "Job", "Pictures", "Run", "Snapshot", "Table", "find_program", "open", "read_table", "run", "start", "sweep"]


def open(directory: str | Path) -> Run:
    """The run whose results lie in the directory."""
    return Run(directory)
