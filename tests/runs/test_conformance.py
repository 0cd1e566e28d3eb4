"""The conformance suite itself: it passes every shape we ship, and finds each fault that tests/shape/badshapes/faulty.c commits.

Run from the top folder after 'make tests': /usr/bin/python3 -m pytest tests/runs/test_conformance.py
TUMBLE_BUILD names another build folder."""
import os
import re
import subprocess

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.join(ROOT, os.environ.get("TUMBLE_BUILD", "build"))

PARTS = ["-shape_parts", "disc,beam", "-shape_disc_shape", "circle", "-shape_disc_radius", "0.05", "-shape_beam_shape", "box"]
SHAPES = [
    ["circle"],
    ["circle", "-shape_radius", "0.0625"],
    ["template"],
    ["template", "-shape_corner", "0"],
    ["ellipse"],
    ["ellipse", "-shape_a", "1", "-shape_b", "0.01"],
    ["ellipse", "-shape_a", "0.001", "-shape_b", "0.02", "-shape_c", "0.003"],
    ["airfoil"],
    ["airfoil", "-shape_thickness", "0.02", "-shape_camber", "0.06", "-shape_camber_position", "0.3"],
    ["airfoil", "-shape_chord", "0.01", "-shape_thickness", "0.4", "-shape_camber", "0.09", "-shape_origin", "0"],
    ["leaflet"],
    ["leaflet", "-shape_thickness", "0.01", "-shape_origin", "0.5"],
    ["box"],
    ["box", "-conformance_dim", "3", "-shape_size", "1,0.2,0.4", "-shape_rounding", "0.1"],
    ["cylinder", "-shape_length", "0.5", "-shape_rounding", "0.1"],
    ["superellipsoid", "-shape_b", "0.2", "-shape_exponent", "10", "-conformance_dim", "2"],
    ["superellipsoid", "-conformance_dim", "3"],
    ["torus"],
    ["composite", "-conformance_dim", "2", *PARTS, "-shape_beam_size", "0.4,0.02", "-shape_beam_offset", "0.2,0"],
    ["composite", "-conformance_dim", "2", *PARTS, "-shape_beam_size", "0.12,0.03", "-shape_beam_operation", "difference",
     "-shape_beam_angle", "0.5", "-shape_beam_offset", "0.03,0", "-shape_blend", "0.01"],
    ["composite", "-conformance_dim", "3", *PARTS, "-shape_beam_size", "0.3,0.02,0.03", "-shape_beam_axis", "1,1,0", "-shape_beam_angle", "1",
     "-conformance_points", "300"],
]

FAULTS = [  # number of the fault in faulty.c, what the suite must say
    (1, "not finite"),
    (2, "FAIL 2D 1-Lipschitz"),
    (3, "FAIL 2D Euclidean near the surface"),
    (4, "FAIL 2D Euclidean near the surface"),
    (5, "FAIL 2D normals"),
    (6, "FAIL 2D normals"),
    (7, "outside its bounding radius"),
    (8, "FAIL 2D mass properties"),
    (9, "run clockwise"),
    (10, "FAIL 2D surface points"),
    (11, "FAIL 2D determinism"),
    (12, "FAIL 2D sign"),
    (13, "FAIL 2D leaks"),
    (14, "FAIL 2D options at and out of range"),
    (15, "FAIL 2D empty batch"),
    (16, "FAIL 2D leaks: error 56: Another one is alive"),
]


def run(plugin, *options):
    """Exit status, and what was printed after the command that repeats it."""
    command = [os.path.join(BUILD, "tests", "shape", "conformance"), os.path.join(BUILD, plugin + ".so"), *options]
    done = subprocess.run(command, capture_output=True, text=True)
    return done.returncode, " ".join(command) + "\n" + done.stderr + done.stdout


@pytest.mark.parametrize("case", SHAPES, ids=" ".join)
def test_shape_passes(case):
    code, out = run("shapes/" + case[0], *case[1:])
    assert code == 0, out
    assert out.rstrip().endswith(" 0 failed"), out


def test_polygon_passes(tmp_path):
    outline = tmp_path / "outline.txt"
    outline.write_text("# not convex, clockwise\n-0.5 0.6\n0.2 1.5\n1 0.4\n2 1\n2 0\n0 0\n")
    code, out = run("shapes/polygon", "-shape_file", str(outline))
    assert code == 0, out


def test_faulty_without_fault_passes():
    code, out = run("tests/shape/badshapes/faulty", "-shape_fault", "0")
    assert code == 0, out


@pytest.mark.parametrize("fault,said", FAULTS)
def test_fault_is_found(fault, said):
    code, out = run("tests/shape/badshapes/faulty", "-shape_fault", str(fault), "-conformance_dim", "2")
    assert code == 1, out
    assert said in out
    assert re.search(r" [1-9][0-9]* failed$", out.rstrip()), f"the count is not the last line\n{out}"
    assert "PETSC ERROR" not in out, out


@pytest.mark.parametrize("words,said", [
    (["shapes/circle", "-shape_radus", "1"], "did you mean -shape_radius?"),
    (["shapes/circle", "-shape_radius", "1", "word"], "'word' on the command line belongs to no option"),
    (["shapes/nowhere"], "There is no file '"),
])
def test_mistakes_on_the_command_line(words, said):
    """One line, with neither a trace nor a word of make, which who has an installed program cannot call."""
    code, out = run(*words)
    lines = out.splitlines()[1:]
    assert code == 1 and len(lines) == 1 and said in lines[0] and "make" not in lines[0], out


def test_polygon_of_a_spreadsheet(tmp_path):
    """A heading in quotes, a mark of the encoding, Windows ends of lines; elsewhere words are refused."""
    outline = tmp_path / "outline.csv"
    outline.write_bytes(b'\xef\xbb\xbf"X","Y"\r\n0,0\r\n2,0\r\n2,1\r\n0,1\r\n')
    code, out = run("shapes/polygon", "-shape_file", str(outline), "-conformance_points", "200")
    assert code == 0 and "4 corners" in out, out
    for text in ("x,y,z\n0,0\n2,0\n2,1\n", "0,0\nx,y\n2,0\n2,1\n", "y,x\n0,0\n2,0\n2,1\n"):
        outline.write_text(text)
        code, out = run("shapes/polygon", "-shape_file", str(outline))
        assert code == 1 and "expected two finite numbers" in out, out
