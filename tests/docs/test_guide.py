"""The pages for authors are true: each file is carried out, and each command prints what the page says."""

from __future__ import annotations

import difflib
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml

from lupin_cli.verbs.new import MISSION, SCENARIO
from lupin_engine.missions.folders import default_missions_folder
from tests.tools import load_tool

#: The first page of a book does what all of them say.
pytestmark = pytest.mark.timeout(300)

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
STEPS = DOCS / "guide" / "steps"


pages = load_tool("pages")
PAGES = [(book, file) for book, files in pages.BOOKS.items() for file in files]


@cache
def written(book: str) -> dict[Path, str]:
    """Do what a book says, from its first page to its last; return the pages as they should be."""
    return dict(pages.pages(book))


@pytest.mark.long
@pytest.mark.parametrize(("book", "file"), PAGES, ids=[file.stem for _, file in PAGES])
def test_a_page_shows_what_is(book: str, file: Path) -> None:
    """Files, highlighted lines, and what check, simulate and test print, word for word."""
    should, is_now = written(book)[file], file.read_text(encoding="utf-8")
    if should != is_now:
        lines = difflib.unified_diff(is_now.splitlines(), should.splitlines(), "page", "now", lineterm="")
        text = "\n".join(lines)
        pytest.fail(f"out of date; write it anew: .venv/bin/python tools/pages.py\n{text}", pytrace=False)


def blocks(file: Path, command: str) -> list[str]:
    """Return what a command prints on a page, each time."""
    text = file.read_text(encoding="utf-8")
    found = re.findall(rf"^\$ {re.escape(command)}$\n(.*?)(?=^\$|^```)", text, re.MULTILINE | re.DOTALL)
    return list(map(str, found))


*STEP_PAGES, PROOF_PAGE = pages.BOOKS["guide"][1:]


@pytest.mark.parametrize("file", STEP_PAGES, ids=lambda file: file.stem)
def test_a_step_is_right_and_its_mistake_is_told(file: Path) -> None:
    """The step's file has no finding and its scenarios hold; the mistake has one."""
    *good, mistaken = blocks(file, "lupin check missions")
    assert set(good) == {"1 mission, no errors, no warnings\n"}
    assert re.search(r"^1 mission, [1-9]\d* errors?, ", mistaken, re.MULTILINE)
    *_, last = blocks(file, "lupin test") or blocks(file, "lupin test --quiet")
    assert last.endswith("all hold\n")


def test_a_proof_finds_the_mistake_that_no_test_finds() -> None:
    """Check and scenarios are content with it; the written scenario fails, and holds when it is mended."""
    assert set(blocks(PROOF_PAGE, "lupin check missions")) == {"2 missions, no errors, no warnings\n"}
    assert all(said.endswith("all hold\n") for said in blocks(PROOF_PAGE, "lupin test --quiet"))
    mistaken, mended = blocks(PROOF_PAGE, "lupin prove twice --no-restarts --quiet")
    assert "✗ reads_there" in mistaken
    assert mended.startswith("Twice: proven; ")
    (fails,) = blocks(PROOF_PAGE, "lupin test missions/twice.reads_there.scenario.yaml | head -n 2")
    (holds,) = blocks(PROOF_PAGE, "lupin test missions/twice.reads_there.scenario.yaml")
    assert fails.startswith("FAIL")
    assert holds.startswith("ok ")


def test_every_recipe_has_scenarios_that_hold() -> None:
    """A recipe that nobody tries is a promise."""
    page = DOCS / "cookbook.md"
    recipes = {file.stem for file in (DOCS / "cookbook").glob("*.yaml") if ".scenario" not in file.name}
    for name in recipes:
        scenarios = sorted((DOCS / "cookbook").glob(f"{name}*.scenario.yaml"), key=lambda file: file.name)
        (said,) = blocks(page, " ".join(["lupin test", *(f"scenarios/{file.name}" for file in scenarios)]))
        assert said.endswith("all hold\n"), name
    assert len(recipes) == 31


@pytest.mark.parametrize(
    "folder",
    [
        STEPS,
        *(DOCS / name for name in ("cookbook", "ten", "coming", "tutorial", "sprayer", "wrist", "scale")),
    ],
    ids=["guide", "cookbook", "ten", "coming", "tutorial", "bindings", "units", "scale"],
)
def test_no_file_is_left_over(folder: Path) -> None:
    """A file that no page shows is never tried."""
    shown = {
        (page.parent / name).resolve()
        for _, page in PAGES
        for name in re.findall(r"<!-- file: (\S+) -->", page.read_text(encoding="utf-8"))
    }
    assert {file.resolve() for file in folder.rglob("*.*") if file.suffix in (".yaml", ".py")} <= shown


def test_the_guide_begins_with_what_lupin_new_writes() -> None:
    """The reader has it in front of them."""
    assert (STEPS / "01-first.yaml").read_text(encoding="utf-8") == MISSION.format(
        title="Inspection", name="inspection"
    )
    page = (DOCS / "guide" / "01-first-mission.md").read_text(encoding="utf-8")
    assert f"```\n{SCENARIO.format(name='inspection')}```" in re.sub(r"```yaml[^\n]*", "```", page)


def test_the_guide_ends_with_the_shipped_mission() -> None:
    """What it says of the differences at its end is all of them."""
    shipped = default_missions_folder()
    part = yaml.safe_load((STEPS / "14-visit_targets.yaml").read_bytes())
    assert part == without_advice(yaml.safe_load((shipped / "parts" / "visit_targets.yaml").read_bytes()))
    mission = yaml.safe_load((STEPS / "13-part.yaml").read_bytes())
    real = yaml.safe_load((shipped / "inspection.yaml").read_bytes())
    for own in (mission, real):
        del own["mission"], own["summary"], own["request"]["tag_sequence"]["default"]
    assert mission == without_advice(real)


def without_advice(file: dict[str, Any]) -> dict[str, Any]:
    """Return a file of the shipped missions, whose codes all say what to do about them, without that."""
    assert all(code["advice"] for code in file["codes"].values())
    codes = {name: {**code} for name, code in file["codes"].items()}
    for code in codes.values():
        del code["advice"]
    return {**file, "codes": codes}


def test_a_page_that_cannot_be_carried_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each mistake in a page is told with the page."""
    monkeypatch.setattr(pages, "ROOT", tmp_path)
    (tmp_path / "a.yaml").write_text("a: 1\n")
    (tmp_path / "folder").mkdir()
    page = tmp_path / "page.md"
    for text, problem in [
        ("```console\n$ rm x\n```", "only lupin"),
        ("```console\n$ lupin --version", "has no end"),
        ("```console\n$ lupin --version | sort\n```", "can pipe through"),
        ("<!-- file: a.yaml -->\n```yaml\n```", "no title"),
        ('```diff title="a.yaml"\n-a: 1\n```', "no a.yaml to change"),
        (
            '<!-- file: a.yaml -->\n```yaml title="a.yaml"\n```\n```diff title="a.yaml"\n-b\n```',
            "does not stand",
        ),
    ]:
        page.write_text(f"{text}\n")
        with pytest.raises(pages.PageError, match=rf"page\.md: .*{problem}"):
            pages.Reader(tmp_path / "folder").page(page)


def test_a_change_is_undone_at_the_next_heading(tmp_path: Path) -> None:
    """As the page tells its reader."""
    (tmp_path / "a.yaml").write_text("a: 1\nb: 2\n")
    (tmp_path / "a2.yaml").write_text("a: 1\nc: 3\nb: 2\n")
    change = '```diff title="x.yaml"\n a: 1\n-b: 2\n+b: 3\n```'
    first = '<!-- file: a.yaml -->\n```yaml title="x.yaml"\n```'
    page = tmp_path / "page.md"
    page.write_text(f"{first}\n{change}\n")
    reader = pages.Reader(tmp_path)
    assert reader.page(page).startswith('<!-- file: a.yaml -->\n```yaml title="x.yaml"\na: 1\nb: 2\n```\n')
    assert (tmp_path / "x.yaml").read_text() == "a: 1\nb: 3\n"
    page.write_text('# Next\n<!-- file: a2.yaml -->\n```yaml title="x.yaml"\n```\n')
    assert '```yaml title="x.yaml" hl_lines="2"\na: 1\nc: 3\n' in reader.page(page)
