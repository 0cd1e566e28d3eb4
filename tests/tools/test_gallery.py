"""tools/gallery: one page of all scenes, read as a browser reads it and, where there is one, by a browser."""
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import pytest

from conftest import ROOT

SCENES = sorted(path.stem for path in (ROOT / "runs").glob("*.yaml"))
LOOK = """<script>addEventListener("load", () => {
  const cards = () => [...document.querySelectorAll(".card")].filter(card => card.offsetHeight > 0).map(card => card.id);
  const images = [...document.images], all = cards();
  const wide = document.documentElement.scrollWidth > innerWidth;
  const field = document.getElementById("filter");
  field.value = "ellipse shear"; field.dispatchEvent(new Event("input"));
  const told = {all, found: cards(), wide, images: images.length, broken: images.filter(i => !i.naturalWidth).map(i => i.src)};
  document.body.innerHTML = "<pre id=told>" + JSON.stringify(told) + "</pre>";
})</script>"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("gallery") / "out" / "gallery.html"
    done = subprocess.run([ROOT / "tools" / "gallery", "--output", path], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return path


class Reader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.cards, self.files = [], [], []

    def handle_starttag(self, tag, attributes):
        words = dict(attributes)
        if words.get("class") == "card":
            self.cards.append(words["id"])
        self.files += [words[key] for key in ("src", "href") if key in words]
        if tag not in ("meta", "img", "br", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, f"</{tag}> out of place"


def test_page_has_every_scene_and_every_file(page):
    reader = Reader()
    reader.feed(page.read_text())
    assert not reader.open, reader.open
    assert set(SCENES) <= set(reader.cards) and len(set(reader.cards)) == len(reader.cards)
    missing = [name for name in reader.files if not re.match(r"\w+:", name) and not (page.parent / name.partition("#")[0]).exists()]
    assert not missing, missing


def test_browser_shows_it(page):
    """Pictures load, cards stand side by side in the window, the filter leaves those that have all words."""
    browser = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
    if not browser:
        pytest.skip("no browser: install chromium")
    copy = page.with_name("look.html")
    copy.write_text(page.read_text().replace("</body>", LOOK + "</body>"))
    words = [browser, "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={page.parent / 'profile'}", "--window-size=1200,900", "--dump-dom", copy.as_uri()]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    found = re.search(r'<pre id="told">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found, done.stdout[-2000:] + done.stderr[-2000:]
    told = json.loads(found[1].replace("&amp;", "&"))
    assert set(SCENES) <= set(told["all"]) and not told["wide"] and told["images"] >= 50 and not told["broken"], told
    assert "ellipse-shear" in told["found"] and len(told["found"]) < 6 and "dkt" not in told["found"], told["found"]
