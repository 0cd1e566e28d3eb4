"""Recipes in tools/packages: what can be said of them without Spack, conda and containers."""
import re
import subprocess
import types

from conftest import ROOT

FOLDER = ROOT / "tools" / "packages"
VERSION = re.search(r"^VERSION := (\S+)", (ROOT / "Makefile").read_text(), re.M)[1]
LIBRARIES = ("hdf5", "metis", "yaml", "muparser")  # of the link line


def test_spack_recipe_builds_what_the_makefile_installs():
    calls, needs = [], []
    api = {"MakefilePackage": object, "license": lambda *a: None, "version": lambda *a, **k: None, "variant": lambda *a, **k: None,
           "depends_on": lambda spec, **k: needs.append(spec), "make": lambda *words: calls.append(words)}  # fmt: skip
    source = re.sub(r"^from spack.*$", "", (FOLDER / "package.py").read_text(), flags=re.M)
    exec(compile(source, "package.py", "exec"), api)
    spec = {"mpi": types.SimpleNamespace(mpicc="mpicc"), "petsc": types.SimpleNamespace(prefix="/petsc")}
    recipe = api["Tumble"]()
    recipe.build(spec, "/prefix")
    recipe.install(spec, "/prefix")
    assert calls[0][:3] == ("SETUP=true", "CC=mpicc", "PETSC_DIR=/petsc") and calls[1][0] == "install" and calls[1][-1] == "PREFIX=/prefix"
    assert all(any(name in need for need in needs) for name in (*LIBRARIES, "petsc", "mpi", "py-numpy", "py-h5py", "py-matplotlib"))
    for words in calls:  # the Makefile takes them
        plan = subprocess.run(["make", "-n", "-C", ROOT, *[word for word in words if not word.startswith(("CC=", "PETSC"))]], capture_output=True, text=True)
        assert plan.returncode == 0, plan.stderr


def test_conda_recipe_names_version_and_libraries():
    text = (FOLDER / "conda" / "meta.yaml").read_text()
    assert f'version: "{VERSION}"' in text and all(f"- {name}" in text for name in (*LIBRARIES, "petsc", "numpy", "h5py"))
    assert subprocess.run(["sh", "-n", FOLDER / "conda" / "build.sh"]).returncode == 0


def test_containers_take_the_steps_that_were_tried():
    assert subprocess.run(["sh", "-n", FOLDER / "container.sh"]).returncode == 0
    for name in ("Containerfile", "tumble.def"):
        assert "/src/tools/packages/container.sh" in (FOLDER / name).read_text(), name
    table = (FOLDER / "README.md").read_text()
    assert all(f"]({path.name})" in table or f"]({path.name}/" in table for path in FOLDER.iterdir() if path.name not in ("README.md", "__pycache__"))
