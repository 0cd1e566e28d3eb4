"""Paths in a scene are relative to the scene file, those of the command line to the working folder; the scene may stand anywhere."""
import pytest

from conftest import edited

SCENE = """\
mesh: {cells: [8, 24], lower: [0, 0], upper: [2, 6]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle:
  groups: wedge balls
  wedge: {shape: polygon, file: wedge.csv, density: 1.25, position: [1, 5]}
  balls: {shape: circle, radius: 0.3, density: 1.2, place: table, table: data/places.csv}
sim: {dt: 0.005, steps: 1}
"""


@pytest.fixture
def below(tmp_path):
    """The scene and its files in a folder below the working folder, which has others of these names."""
    folder = tmp_path / "scenes"
    (folder / "data").mkdir(parents=True)
    (folder / "s.yaml").write_text(SCENE)
    (folder / "wedge.csv").write_text("x,y\n-0.3,-0.3\n0.3,-0.3\n0,0.3\n")
    (folder / "data" / "places.csv").write_text("x,y\n0.5,3\n1.2,4\n")
    (tmp_path / "wedge.csv").write_text("no outline\n")
    (tmp_path / "mine.csv").write_text("x,y\n0.5,3\n")
    return folder


def bodies_of(result, name):
    return [line.split(",")[3] for line in (result.folder / "out" / name / "bodies.csv").read_text().splitlines()[1:]]


def bodies(result):
    return bodies_of(result, "s")


@pytest.mark.parametrize("ranks", [1, 2])
def test_paths_of_the_scene(run, below, ranks):
    done = run(["scenes/s.yaml"], ranks)
    assert done.status == 0, done
    assert bodies(done) == ["wedge", "balls", "balls"]
    options = (done.folder / "out" / "s" / "options.txt").read_text()
    assert f"-particle_wedge_file {below}/wedge.csv\n" in options and f"-particle_balls_table {below}/data/places.csv\n" in options


def test_paths_of_the_command_line(run, below):
    done = run(["scenes/s.yaml", "-particle_balls_table", "mine.csv"])
    assert done.status == 0 and bodies(done) == ["wedge", "balls"], done
    done = run(["scenes/s.yaml", "-particle_wedge_file", "wedge.csv", "-output_overwrite"])
    assert done.status and "wedge.csv:1: expected two finite numbers" in done.err, done
    done = run(["scenes/s.yaml", "-particle_balls_table", "data/places.csv", "-output_overwrite"])
    assert done.status and "'data/places.csv' cannot be read" in done.err, done


def test_missing_file_of_the_scene_is_named_as_seen_from_here(run, below):
    (below / "data" / "places.csv").unlink()
    done = run(["scenes/s.yaml"])
    assert done.status and "'scenes/data/places.csv' cannot be read" in done.err and "relative to the scene file" in done.err, done


def test_scene_anywhere(run, below):
    """Even after a switch, which would swallow it as its value."""
    for words in (["-sim_steps", "1", "scenes/s.yaml"], ["-output_overwrite", "scenes/s.yaml", "-sim_steps", "1"]):
        done = run(words)
        assert done.status == 0, done
    done = run(["scenes/s.yaml", "-sim_steps", "1", "scenes/s.yaml"])
    assert done.status and "'scenes/s.yaml' on the command line belongs to no option" in done.err, done


@pytest.mark.parametrize("groups", ["disc, ball", "disc ball", "[disc, ball]", "disc ,  ball"])
def test_groups_by_blanks_or_commas(run, scene, groups):
    text = edited("groups: disc", f"groups: {groups}").replace("position: [1, 4]}", "position: [1, 4]}\n  ball: {shape: circle, radius: 0.125, density: 1.25, position: [1, 2]}")
    done = run([scene(text), "-scene_dry_run"])
    assert done.status == 0 and "ball" in done.out, done


@pytest.mark.parametrize("ranks", [1, 2])
def test_included_scene(run, below, ranks):
    """The including scene lies elsewhere: each file's paths are relative to itself; the command line goes over both; options.txt repeats it."""
    (below.parent / "own.csv").write_text("x,y\n0.5,3\n1.2,4\n1.2,2\n")
    (below.parent / "more.yaml").write_text("include: scenes/s.yaml\nparticle:\n  balls: {table: own.csv, radius: 0.25}\nsim: {steps: 7}\n")
    done = run(["more.yaml", "-sim_steps", "1"], ranks)
    assert done.status == 0 and bodies_of(done, "more") == ["wedge", "balls", "balls", "balls"], done
    options = (done.folder / "out" / "more" / "options.txt").read_text()
    assert f"-particle_wedge_file {below}/wedge.csv\n" in options and f"-particle_balls_table {below.parent}/own.csv\n" in options
    assert "-sim_steps 1\n" in options and "-particle_balls_radius 0.25\n" in options and "-include" not in options
    again = run(["out/more/options.txt"], ranks)
    assert again.status == 0 and bodies_of(again, "more-again") == bodies_of(done, "more"), again


def test_included_group_is_taken_away(run, below):
    (below / "less.yaml").write_text("include: s.yaml\nparticle:\n  groups: wedge\n  balls: ~\n")
    done = run(["scenes/less.yaml"])
    assert done.status == 0 and bodies_of(done, "less") == ["wedge"], done
    (below / "less.yaml").write_text("include: s.yaml\nparticle:\n  groups: wedge\n  bals: ~\n")
    done = run(["scenes/less.yaml"])
    assert done.status and "scenes/less.yaml:4: " in done.err and "s.yaml says nothing of -particle_bals" in done.err, done
