"""The site: every link and anchor leads somewhere, every picture is drawn, nothing comes from elsewhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

pytestmark = [pytest.mark.long, pytest.mark.timeout(300)]

ROOT = Path(__file__).parents[2]
#: Tag -> the attribute by which a browser fetches something unasked.
FETCHES = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src", "audio": "src"}


#: The site with the smallest proofs that there are; how far those of `make docs` look, mkdocs.yml says.
CONFIG = f"""\
INHERIT: {ROOT / "mkdocs.yml"}
docs_dir: {ROOT / "docs"}
hooks: [{ROOT / "tools" / "site_hooks.py"}]
extra:
  proofs:
    inspection: inspection --targets 0 --no-restarts
    exploration: inspection --targets 0 --no-restarts
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as `make docs` does, with warnings as errors."""
    pytest.importorskip("material")
    folder, config = tmp_path_factory.mktemp("site"), tmp_path_factory.mktemp("config") / "mkdocs.yml"
    config.write_text(CONFIG, encoding="utf-8")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    command += ["--config-file", str(config)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "NO_COLOR": "1"}
    built = subprocess.run(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if built.returncode:
        pytest.fail(f"`make docs` says:\n{built.stdout}", pytrace=False)
    return folder


class Page(HTMLParser):
    """Collects what a page fetches, and the names of its classes."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.classes: set[str] = set()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note a tag."""
        given = dict(attrs)
        self.classes.update((given.get("class") or "").split())
        source = given.get(FETCHES.get(tag, ""))
        if source and given.get("rel") not in ("next", "prev", "canonical"):
            self.fetched.append(source)


def pages(site: Path) -> dict[Path, Page]:
    """Return the pages of the site."""
    return {file: Page(file) for file in sorted(site.rglob("*.html"))}


def test_nothing_comes_from_elsewhere(site: Path) -> None:
    """Whoever reads in the greenhouse has no network, and nobody is counted."""
    for file, page in pages(site).items():
        assert [source for source in page.fetched if re.match(r"(https?:)?//", source)] == [], file.name
        # The theme would fetch the drawing program for these; `lupin diagram` draws SVG.
        assert "mermaid" not in page.classes, file.name
    styles = "".join(file.read_text(encoding="utf-8") for file in site.rglob("*.css"))
    assert re.findall(r"url\([\"']?(?:https?:)?//[^)]*", styles) == []


def test_what_a_page_fetches_is_there(site: Path) -> None:
    """Pictures of missions are drawn while the site is built; a missing one is a hole in the page."""
    pictures = 0
    for file, page in pages(site).items():
        if file.name == "404.html":
            continue
        for source in page.fetched:
            assert (file.parent / source.partition("?")[0]).is_file(), f"{file.name}: {source}"
            pictures += source.endswith(".svg")
    assert pictures >= 13


def test_the_proofs_of_the_shipped_missions_are_there(site: Path) -> None:
    """Made with the site, and found from every page; what they say is tested with the report."""
    for name in ("inspection", "exploration"):
        page = (site / "proofs" / f"{name}.html").read_text(encoding="utf-8")
        assert "<title>Proof" in page
        assert str(ROOT) not in page
        assert f'href="../proofs/{name}.html"' in (site / "guide" / "index.html").read_text(encoding="utf-8")
    named = re.findall(r"^    (\w+): (\w+) ", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE)
    assert named == [("inspection", "inspection"), ("exploration", "exploration")]


def test_the_search_knows_the_pages(site: Path) -> None:
    """It works on files too: its index is a script."""
    index = (site / "search" / "search_index.js").read_text(encoding="utf-8")
    assert index.startswith("var __index = ")
    for word in ("Wait with a deadline", "unreachable-state", "resume_at"):
        assert word in index


def test_links_into_the_repository_are_text(site: Path) -> None:
    """The site does not hold scenarios and tests; that the files are there is asked when it is built."""
    page = (site / "war-stories.html").read_text(encoding="utf-8")
    assert "<code>A01_resume_after_dock</code>" in page
    assert 'href="../tests' not in page


def test_the_cheat_sheet_is_one_sheet(site: Path) -> None:
    """Printed while the site is built, where a browser is there."""
    if not any(map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))):
        pytest.skip("no Chromium is installed here")
    printed = (site / "cheat-sheet.pdf").read_bytes()
    assert len(re.findall(rb"/Type ?/Page\b", printed)) == 1
