"""Names of options, choices and columns that an earlier version had: refused with the present one, or read under it."""
import re
import sys

import h5py
import numpy
import pytest

from conftest import ROOT, SCENE
from test_badinput import refused
from test_options import declared

sys.path.insert(0, str(ROOT / "tools"))
import tumble  # noqa: E402

DEMO = ROOT / "runs" / "sedimentation.yaml"


def well(run, args, ranks=1):
    result = run(args, ranks)
    assert result.status == 0, str(result)
    return result


def test_former_names(run, scene):
    """All in one message, before anything else is said of the scene; with what to write instead."""
    refused(run([DEMO, "-couple_boundary", "penalty"]), "-couple_boundary = penalty (command line) is now called -couple_method penalty")
    refused(run([DEMO, "-couple_method", "snap"]), "-couple_method = snap (command line) is now called -couple_method aligned")
    old = scene(SCENE.replace("flow: {", "couple: {boundary: snap}\nflow: {recipe: fast, ").replace("position:", "motion_swing: [1, 1, 0], position:"))
    result = run([old, "-sim_move_max", "2"], 2)
    refused(result, "(4)", "-couple_boundary = snap (scene or options file) is now called -couple_method aligned", "-flow_solver fast", "-sim_max_displacement 2", "-particle_disc_motion_rotation 1,1,0")
    assert not (result.folder / "out").exists()


def former():
    return [name for path in ROOT.glob("src/*/options.c") for name in re.findall(r"\.old\s*=\s*\"(-[^\"]+)\"(?! what)", path.read_text())]


def test_former_names_lead_to_rows_once():
    """No two options had one name, and no former name is one of today."""
    assert len(former()) == len(set(former())) > 20 and not set(former()) & set(declared())


def test_nobody_uses_former_names():
    """Sources, scenes, tests, tools and pages have the present ones."""
    names = "|".join(re.sub("<[a-z]+>", r"[\\w<>%]+", name[1:]) for name in former())
    pattern = re.compile(rf"(?<![\w/])(?:{names})(?![\w.])")
    allowed = {"options.c", "renamed.c", "opt.h", "test_opt.c", "same-bits", "test_renamed.py"}
    found = []
    for top in ("README.md", "src", "include", "shapes", "tests", "tools", "runs"):
        for path in [ROOT / top] if top.endswith(".md") else sorted((ROOT / top).rglob("*")):
            if path.is_file() and path.name not in allowed and path.suffix not in (".png", ".pyc", ".h5", ".so", ".gz") and "out" not in path.parts:
                found += [f"{path.relative_to(ROOT)}: {word}" for word in pattern.findall(path.read_text(errors="ignore").replace("\\_", "_"))]
    assert not found, "\n".join(found)


def checksum(text):
    """Of bytes in a checkpoint: see compute_checksum in src/base/state.c."""
    total, mask = 0, 2**64 - 1
    for i, byte in enumerate(text):
        word = byte * 0x9E3779B97F4A7C15 & mask
        total += (word ^ word >> 29) * (2 * i + 1)
    return numpy.uint64(total & mask)


def test_former_names_of_options(run, scene, tmp_path):
    """A checkpoint of a version that called options otherwise goes on without a remark; one that differs is told by its present name."""
    name = scene()
    well(run, [name, "-output_dir", "run", "-checkpoint_every", "5", "-sim_steps", "5", "-couple_method", "nodal", "-flow_solver", "fast"])
    with h5py.File(tmp_path / "run" / "checkpoint_5.h5", "r+") as file:
        text = bytes(file["options"][()].reshape(-1)).decode().replace("-couple_method nodal", "-couple_boundary snap").replace("-flow_solver fast", "-flow_recipe fast")
        assert "-couple_boundary snap" in text and "-flow_recipe fast" in text
        assert file["options"].attrs["checksum"] == checksum(bytes(file["options"][()].reshape(-1)))
        del file["options"]
        file["options"] = numpy.frombuffer(text.encode(), numpy.uint8).reshape(-1, 1)
        file["options"].attrs["checksum"] = checksum(text.encode())
    args = [name, "-sim_restart", "run/checkpoint_5.h5", "-sim_steps", "6", "-couple_method", "nodal", "-flow_solver", "fast"]
    result = well(run, [*args, "-output_dir", "other"], 2)
    assert re.findall("^remark: the run goes on with other physics than its checkpoint: (.*)$", result.out, re.M) == ["-couple_method nodal (was aligned)"], str(result)
    assert "-flow_recipe" not in result.out and "-flow_solver" not in result.out, str(result)


def test_former_columns(tmp_path):
    """Files of earlier versions are read under the present names; who asks for a former one is told the present one."""
    (tmp_path / "series.csv").write_text("step,time_s,dt_s,snap_fallback,momentum_volume_x\n1,0.5,0.5,2,3\n")
    (tmp_path / "bodies.csv").write_text("step,time_s,body,group,angle_rad\n1,0.5,0,a,0.25\n")
    old = tumble.open(tmp_path)
    assert list(old.series) == ["step", "time", "dt", "aligned_penalty_bodies", "momentum_body_force_x"] and old.body(0)["angle"].tolist() == [0.25]
    for name, present in ("time_s", "time"), ("snap_fallback", "aligned_penalty_bodies"), ("momentum_openings_y", "momentum_inout_y"):
        with pytest.raises(KeyError, match=f"no column '{name}'; '{name}' is now called '{present}'"):
            old.series[name]
