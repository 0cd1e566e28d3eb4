"""tumble.run and start from Python, without pandas: scenes as dictionaries, options, rows while a run goes on, errors."""
import sys

import pytest
import yaml

from conftest import ROOT, SCENE, build_folder

sys.path.insert(0, str(ROOT / "tools"))
import tumble  # noqa: E402

DISC = yaml.safe_load(SCENE)


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch, program):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TUMBLE_PROGRAM", str(program))


def test_dictionary(tmp_path):
    """Nested, joined and listed options win over the scene; paths are relative to the working folder; results are those of the program."""
    (tmp_path / "places.csv").write_text("x,y\n1,2\n1,4\n")
    scene = {**DISC, "particle": {"groups": "disc", "disc": {"shape": "circle", "radius": 0.125, "density": 1.25, "place": "table", "table": "places.csv"}}}
    seen = []
    run = tumble.run(scene, ranks=2, out="out/a", progress=seen.append, sim={"steps": 3}, mesh_cells=(16, 48), output_every=3)
    assert [row["step"] for row in seen] == [1, 2, 3] and seen[-1]["kinetic_energy"] == run.series["kinetic_energy"][-1] > 0
    assert run.summary["ranks"] == 2 and run.summary["cells"] == 768 and run.summary["bodies"] == 2 and run.steps == [3]
    assert len(run.group("disc")) == 6 and sorted(run.group("disc")["y"][:2]) == pytest.approx([2, 4], abs=0.02)
    with pytest.raises(KeyError, match="no group 'ball'.*there are: disc"):
        run.group("ball")
    with pytest.raises(tumble.Failure, match="already holds the results of a run.*output_overwrite=True"):
        tumble.run(DISC, out="out/a")
    assert tumble.run(DISC, out="out/a", output_overwrite=True).summary["bodies"] == 1


def test_rows_of_this_run_alone(scene):
    """What an earlier run left in the table is not taken for rows of the one that goes on."""
    tumble.run(scene(), sim_steps=4)
    job = tumble.start("disc.yaml", sim_steps=2, output_overwrite=True)
    assert [row["step"] for row in job] == [1, 2] and not job.running
    assert [row["time"] for row in tumble.open("out/disc").follow()] == [0.005, 0.01]


def test_a_run_is_stopped(scene):
    job = tumble.start(scene(), sim_steps=100000, checkpoint_every=100000)
    assert next(iter(job))["step"] == 1 and job.running
    job.stop()
    assert job.wait().summary["steps"] < 100000 and list(job.directory.glob("checkpoint_*.h5"))


@pytest.mark.parametrize("ranks", [1, 2])
def test_errors_are_the_message(scene, ranks):
    with pytest.raises(tumble.Failure, match=r"^Unknown or unused option -flow_viscosty = 1 \(command line\): did you mean -flow_viscosity\?$") as caught:
        tumble.run(scene(), ranks, flow_viscosty=1)
    assert caught.value.status != 0 and "tumble: error" in caught.value.output


def test_programs(monkeypatch, tmp_path):
    assert tumble.find_program() == build_folder() / "tumble"
    monkeypatch.delenv("TUMBLE_PROGRAM")
    monkeypatch.setenv("PATH", str(build_folder()), prepend=":")
    assert tumble.find_program() == build_folder() / "tumble"
    monkeypatch.setenv("PATH", "/bin")
    assert tumble.find_program() == ROOT / "build" / "tumble"  # of the source tree
    monkeypatch.setenv("TUMBLE_PROGRAM", "/nowhere/tumble")
    with pytest.raises(tumble.Failure, match="TUMBLE_PROGRAM=/nowhere/tumble"):
        tumble.find_program()
