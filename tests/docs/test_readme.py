"""README.md and the site's first page: what they say is there, and what they show is what is printed."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.plugin.registry import load_catalog
from lupin_ros.launch.nodes import nodes_of

ROOT = Path(__file__).parents[2]
README, HOME = (file.read_text(encoding="utf-8") for file in (ROOT / "README.md", ROOT / "docs" / "index.md"))

_LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


@pytest.mark.parametrize(("text", "folder"), [(README, ROOT), (HOME, ROOT / "docs")], ids=["README", "home"])
def test_links_lead_to_files(text: str, folder: Path) -> None:
    links = _LINK.findall(text)
    assert len(links) > 15
    assert [link for link in links if not (folder / link).exists()] == []


def test_every_page_can_be_found_from_the_first_ones() -> None:
    """Each page of the folder is named by the README and by the site's first page."""
    pages = {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"}
    linked = set(_LINK.findall(HOME))
    assert pages - {link for link in linked if "/" not in link} == set()
    assert {f"docs/{page}" for page in pages} - set(_LINK.findall(README)) == set()


def test_the_table_of_nodes_has_every_node_that_can_be_started() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ", README, re.MULTILINE)
    assert sorted(rows) == sorted(nodes_of(load_catalog()))


def test_the_missions_have_the_lines_that_are_told() -> None:
    told = re.findall(r"\[(\d+) lines\]\((missions/\w+\.yaml)\)", README)
    assert [(int(lines), file) for lines, file in told] == [
        (len((ROOT / file).read_text(encoding="utf-8").splitlines()), file)
        for file in ("missions/inspection.yaml", "missions/exploration.yaml")
    ]


def commands() -> list[str]:
    """Return the commands of the README's list, without what is said beside them."""
    blocks = re.findall(r"^```sh\n(lupin .*?)```", README, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 2
    return [line.partition("  #")[0].strip() for line in "".join(blocks).splitlines()]


@pytest.mark.parametrize("command", commands())
def test_a_command_of_the_list_has_its_options(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each word that begins with a dash is one that the verb explains."""
    _, verb, *words = shlex.split(command)
    assert main([verb, "--help"]) == 0
    explained = capsys.readouterr().out
    options = {word for word in words if word.startswith("-")}
    assert options <= set(re.findall(r"(?<![\w-])--?[a-z-]+", explained))


def test_the_mistake_is_told_as_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (shown,) = re.findall(r"\$ lupin check missions\n(.*?)```", README, re.DOTALL)
    shutil.copytree(ROOT / "missions", tmp_path / "missions")
    mission = tmp_path / "missions" / "inspection.yaml"
    sound = mission.read_text(encoding="utf-8")
    assert sound.count("on_error: FAULT") == 1
    mission.write_text(sound.replace("on_error: FAULT", "on_error: FALT"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert main(["check", "missions"]) == 1
    assert capsys.readouterr().out == shown


def test_the_excerpt_has_what_the_mission_has() -> None:
    """The README shortens the inspection mission; what is left stands there in this order."""
    _, _, rest = README.partition("```yaml\nmission: InspectionMission")
    excerpt = rest.partition("```")[0]
    keys = re.findall(r"^ *(\w+):", excerpt, re.MULTILINE)
    mission = (ROOT / "missions" / "inspection.yaml").read_text(encoding="utf-8")
    known = re.findall(r"[\w]+(?=:)", mission)
    places = iter(known)
    assert [key for key in keys if key not in places] == []


def test_the_mission_of_the_first_page_reads_three_tags(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (mission,) = re.findall(r"^```yaml\n(.*?)```", HOME, re.MULTILINE | re.DOTALL)
    shutil.copy(ROOT / "missions" / "lifecycle.yaml", tmp_path)
    file = tmp_path / "read_three.yaml"
    file.write_text(mission, encoding="utf-8")
    assert main(["check", "--strict", str(file)]) == 0
    assert capsys.readouterr().out == "1 mission, no errors, no warnings\n"
    assert main(["simulate", str(file)]) == 0
    assert re.search(r"^DONE: 3 visited of 3 targets in ", capsys.readouterr().out, re.MULTILINE)
