"""What people read: links lead somewhere, README is short, and its commands and scene run."""
import re
import shlex
import subprocess

import pytest

from conftest import ROOT, environment

PAGES = sorted(path for path in ROOT.rglob("*.md") if "out" not in path.relative_to(ROOT).parts and not path.relative_to(ROOT).parts[0].startswith(("build", ".")))
README = (ROOT / "README.md").read_text()


def anchors(path):
    """As GitHub makes them of headings, and those that are given"""
    headings = re.findall(r"^#+ +(.*)$", re.sub(r"```.*?```", "", path.read_text(), flags=re.DOTALL), re.MULTILINE)
    given = set(re.findall(r'<a id="([^"]+)">', path.read_text()))
    return given | {re.sub(r"[^\w\- ]", "", heading.lower().replace("`", "")).replace(" ", "-") for heading in headings}


def links(path):
    text = re.sub(r"`[^`\n]*`", "", re.sub(r"```.*?```", "", path.read_text(), flags=re.DOTALL))
    return re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'<img src="([^"]+)"', text)


def test_links_lead_somewhere():
    wrong = []
    for page in PAGES:
        for link in links(page):
            if re.match(r"\w+:", link):
                continue
            name, _, anchor = link.partition("#")
            target = (page.parent / name).resolve() if name else page
            if not target.exists():
                wrong.append(f"{page.relative_to(ROOT)}: {link} does not exist")
            elif anchor and anchor not in anchors(target):
                wrong.append(f"{page.relative_to(ROOT)}: {link} has no such heading")
    assert not wrong, "\n".join(wrong)


def test_readme_is_short():
    assert README.count("\n") <= 130 and len(README.split()) <= 1100, (README.count("\n"), len(README.split()))


def test_gallery_has_every_scene():
    text = (ROOT / "runs" / "README.md").read_text()
    assert text.count("\n") <= 150
    missing = [path.stem for path in (ROOT / "runs").glob("*.yaml") if not re.search(rf"`({re.escape(path.stem)}|-{re.escape(path.stem.rsplit('-', 1)[-1])})`", text)]
    assert not missing, missing
    assert f"[gallery](runs/README.md): {len(list((ROOT / 'runs').glob('*.yaml')))} scenes" in README


def test_studies_say_their_answer_first():
    """At most 120 lines, the answer first; notes behind may be long. flow-solver is the list of its six."""
    studies = [path for path in sorted((ROOT / "runs" / "studies").rglob("README.md")) if path.parent.name != "flow-solver"]
    assert len(studies) > 20
    wrong = [str(path) for path in studies if path.read_text().count("\n") > 120 or not re.match(r"# .*\n\n## Answer\n\n.{20}", path.read_text())]
    assert not wrong, wrong


PETSC = ("ksp_monitor", "ksp_type", "ksp_rtol", "ksp_max_it", "snes", "fieldsplit", "dm_refine", "log_view", "malloc", "options_left")  # its own, by their prefixes
FLAGS = {"-help", "-version", "-n", "--", "-scene_dry_run", "-preset"}


def test_pages_name_options_that_exist():
    """README, gallery and guide; <word> in the table of options stands for any."""
    known = [re.compile(re.sub(r"<\w+>", r"[\\w<>]+", name) + "$") for name in re.findall(r"^\| `(-[^`]+)`", (ROOT / "runs" / "reference" / "OPTIONS.md").read_text(), re.M)]
    assert len(known) > 150
    wrong = []
    for page in [ROOT / "README.md", ROOT / "runs" / "README.md", *(ROOT / "runs" / "guide").glob("*.md")]:
        said = " ".join(re.findall(r"```sh\n(.*?)```", page.read_text(), re.DOTALL) + re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)))
        for word in set(re.findall(r"(?<![\w-])-[a-z]\w*_[\w<>]+", said)):
            if word[-1] != "_" and word not in FLAGS and not any(name in word for name in PETSC) and not any(name.match(word) for name in known):
                wrong.append(f"{page.relative_to(ROOT)}: {word}")
    assert not wrong, wrong


def commands():
    lines = "\n".join(re.findall(r"```sh\n(.*?)```", README, re.DOTALL)).splitlines()
    return [line.split("#")[0].strip() for line in lines]


@pytest.mark.parametrize("command", [line for line in commands() if "build/tumble" in line])
def test_commands_of_readme(program, tmp_path, command):
    """Two steps of each; 'make demo' is run by the continuous integration."""
    (tmp_path / "two.yaml").write_text(re.search(r"```yaml\n(.*?)```", README, re.DOTALL)[1])
    for name in ("runs", "tools"):
        (tmp_path / name).symlink_to(ROOT / name)
    for part in command.split("&&"):
        words = shlex.split(part)
        if "build/tumble" in words:
            words[words.index("build/tumble")] = str(program)
            words += [] if "-scene_dry_run" in words else ["-sim_steps", "2", "-output_every", "1"]
        done = subprocess.run(words, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0 and "error" not in done.stderr, (part, done.stdout[-2000:], done.stderr[-2000:])
        assert "-scene_dry_run" not in part or "in SI units: fluid density 1000 kg/m^3, viscosity 0.01 Pa s" in done.stdout, done.stdout
        assert "preset balanced, the default, cannot" not in done.stdout + done.stderr, "the scene of README is too coarse"


DISC = """\
mesh: {cells: [32, 64], upper: [2, 4]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle: {groups: g, g: {shape: circle, radius: 0.15, density: 1.25PLACE}}
sim: {dt: 0.002, steps: 2}
"""


@pytest.mark.parametrize("rows, position", [((7, 9, 16, 27), True), ((10, 12, 13, 24), True), ((19, 15, 23, 29), True), ((14, 20), True), ((11,), False)])
def test_answers_are_taken(run, scene, rows, position):
    """Answers of how-do-I, several at a time: a dry run takes them."""
    text = (ROOT / "runs" / "guide" / "howdoi.md").read_text()
    said = {int(number): re.findall(r"`(-[^`]+)`", answer) for number, answer in re.findall(r"^\| (\d+)\. [^|]*\| (.*?) \| [^|]*\|$", text, re.M)}
    assert sorted(said) == list(range(1, 35))
    place = ", position: [0.9, 2]" if position else ""
    words = [word for row in rows for answer in said[row] if not re.search("flow_rate|restart", answer) for word in shlex.split(answer.replace("<group>", "g"))]
    words = words[: len(words) // 2] if not position else words  # lattice, pack: one of them
    result = run([scene(DISC.replace("PLACE", place)), "-scene_dry_run", *words])
    assert result.status == 0, str(result)
