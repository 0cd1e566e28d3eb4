"""tools/report: one self-contained page about a run, looked at in a browser."""
import shutil
import subprocess
import sys

import pytest

from conftest import ROOT, SCENE, edited

CHROMIUM = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"]


@pytest.fixture
def page(run, scene, tmp_path):
    done = run([scene(edited("steps: 2}", "steps: 4}\noutput: {every: 2}"))])
    assert done.status == 0, done
    made = subprocess.run([sys.executable, ROOT / "tools" / "report", tmp_path / "out" / "disc"], capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return tmp_path / "out" / "disc" / "report.html"


def test_page_holds_everything(page):
    text = page.read_text()
    for word in ("<h1>disc</h1>", "fall_speed_max", "-particle_disc_density", "trajectory.png", "field_4.png", "outer_iterations"):
        assert word in text, word
    assert text.count("data:image/png;base64,") >= 3
    assert 'src="http' not in text and "<link" not in text and "<script" not in text


def test_browser_shows_it(page, tmp_path):
    browser = shutil.which("chromium")
    if not browser:
        pytest.skip("chromium is not installed")
    words = [browser, *CHROMIUM, f"--user-data-dir={tmp_path / 'profile'}"]
    shot = tmp_path / "page.png"
    subprocess.run([*words, "--window-size=900,1500", f"--screenshot={shot}", page.as_uri()], capture_output=True, timeout=120, check=True)
    import matplotlib.image

    picture = matplotlib.image.imread(shot)
    assert picture.shape[:2] == (1500, 900)
    assert (picture[:, :, :3].min(2) < 0.5).mean() > 0.01  # ink
    dom = subprocess.run([*words, "--dump-dom", page.as_uri()], capture_output=True, text=True, timeout=120, check=True).stdout
    assert "<title>disc: tumble</title>" in dom and dom.count("<img") >= 3


def test_no_results(tmp_path):
    made = subprocess.run([sys.executable, ROOT / "tools" / "report", tmp_path], capture_output=True, text=True)
    assert made.returncode == 1 and "holds no results" in made.stderr
