"""`lupin lsp`, driven over its protocol as editors do."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import lupin_lsp
from lupin_cli.verbs.lsp import lsp
from lupin_engine.errors import UsageError
from tests.workbench.lupin_lsp.client import Client, ServerError, at

INSPECTION, LIFECYCLE, PART = "inspection.yaml", "lifecycle.yaml", "parts/visit_targets.yaml"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """One server for all tests; each has a folder of its own."""
    root = tmp_path_factory.mktemp("workspace")
    client = Client([sys.executable, "-m", "lupin_cli.main", "lsp"], root)
    yield client
    assert client.close() == 0


@pytest.fixture
def opened(server: Client, missions: Path) -> Iterator[Client]:
    """The server with the inspection open."""
    path = missions / INSPECTION
    server.open(path)
    assert server.diagnostics(path, 1) == []
    yield server
    server.notify("textDocument/didClose", {"textDocument": {"uri": path.as_uri()}})
    shutil.rmtree(missions)


def edited(client: Client, path: Path, old: str, new: str) -> tuple[str, list[dict[str, Any]]]:
    """Replace a piece of a file in the editor; return the text and what is found in it."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    text = text.replace(old, new, 1)
    return text, client.diagnostics(path, client.change(path, text))


@pytest.mark.slow
def test_offers_what_it_can() -> None:
    """What an editor reads to know which menus to show."""
    client = Client([sys.executable, "-m", "lupin_cli.main", "lsp"], Path.cwd())
    offered = {key for key, value in client.capabilities.items() if value}
    assert client.close() == 0
    assert offered >= {
        "completionProvider",
        "hoverProvider",
        "definitionProvider",
        "referencesProvider",
        "documentSymbolProvider",
        "codeActionProvider",
        "renameProvider",
    }


def test_tells_findings_as_one_types(opened: Client, missions: Path) -> None:
    """Of the text in the editor, with rule, severity and the end of the word; mended they are gone."""
    path = missions / INSPECTION
    _, found = edited(opened, path, "on_error: FAULT", "on_error: FUALT")
    assert found == [
        {
            "range": {"start": {"line": 28, "character": 18}, "end": {"line": 28, "character": 23}},
            "severity": 1,
            "code": "unknown-state",
            "source": "lupin",
            "message": "no state is called 'FUALT' here; did you mean 'FAULT'?",
        }
    ]
    assert edited(opened, path, "FAULT", "FAULT")[1] == []
    assert "FUALT" not in path.read_text(encoding="utf-8")


def test_takes_changes_of_pieces(opened: Client, missions: Path) -> None:
    """Keystrokes, not whole files; columns as the client counts them."""
    path = missions / INSPECTION
    text = path.read_text(encoding="utf-8")
    line, column = at(text, "summary: |Visit")
    where = {"line": line, "character": column}
    opened.edit(path, [{"range": {"start": where, "end": where}, "text": "𝄞 "}])
    end = {"line": 28, "character": 23}
    version = opened.edit(
        path, [{"range": {"start": {"line": 28, "character": 18}, "end": end}, "text": "X"}]
    )
    (found,) = opened.diagnostics(path, version)
    assert found["range"] == {
        "start": {"line": 28, "character": 18},
        "end": {"line": 28, "character": 19},
    }
    label = "label: no tags to visit"
    changed = text.replace(label, "label: 𝄞 tags, oops: 1", 1)
    (found, *_) = opened.diagnostics(path, opened.change(path, changed))
    assert found["range"]["start"] == {"line": 8, "character": 28}


def test_tells_findings_of_the_other_files(opened: Client, missions: Path) -> None:
    """The lifecycle is not open, but the mission makes it wrong."""
    edited(opened, missions / INSPECTION, "  PREPARE:", "  PREPARED:")
    found = opened.diagnostics(missions / LIFECYCLE)
    assert [each["code"] for each in found] == ["unknown-state"]


def test_completes_in_broken_text(opened: Client, missions: Path) -> None:
    """The bracket is not closed yet: names come from what could be read before."""
    path = missions / INSPECTION
    text, found = edited(opened, path, "on_error: FAULT", "on_error: {target: IN")
    assert [each["code"] for each in found] == ["wrong-yaml"]
    answer = opened.ask("completion", path, *at(text, "{target: IN|"))
    offers = [item["label"] for item in answer["items"]]
    assert offers[:4] == ["LOCALIZING", "PREPARE", "INSPECTING", "done"]
    assert answer["items"][2]["textEdit"] == {
        "range": {"start": {"line": 28, "character": 27}, "end": {"line": 28, "character": 29}},
        "newText": "INSPECTING",
    }
    assert "state MISSION.InspectionMission.INSPECTING" in answer["items"][2]["documentation"]["value"]


def test_says_what_a_name_means(opened: Client, missions: Path) -> None:
    """Markdown, and what it is about."""
    path = missions / INSPECTION
    text = path.read_text(encoding="utf-8")
    found = opened.ask("hover", path, *at(text, "do: nav.|localize"))
    assert found["contents"]["kind"] == "markdown"
    assert found["contents"]["value"].startswith("```text\noperation nav.localize(max_variance)\n```")
    assert found["range"] == {"start": {"line": 24, "character": 14}, "end": {"line": 24, "character": 26}}
    assert opened.ask("hover", path, 1, 15) is None


def test_leads_to_files_and_plugins(opened: Client, missions: Path) -> None:
    """A state of the lifecycle, a part, an operation."""
    path = missions / INSPECTION
    text = path.read_text(encoding="utf-8")
    (found,) = opened.ask("definition", path, *at(text, "on_error: |FAULT"))
    assert found["uri"] == (missions / LIFECYCLE).as_uri()
    assert found["range"]["start"] == dict(zip(("line", "character"), (156, 2), strict=True))
    (found,) = opened.ask("definition", path, *at(text, "use: visit|_targets"))
    assert (found["uri"], found["range"]["start"]["line"]) == ((missions / PART).as_uri(), 0)
    (found,) = opened.ask("definition", path, *at(text, "do: nav.|localize"))
    assert found["uri"].endswith("lupin_nav/catalog.py")


def test_finds_mentions_in_all_files(opened: Client, missions: Path) -> None:
    """Of the hold `pause`: lifecycle and part."""
    path = missions / LIFECYCLE
    text = path.read_text(encoding="utf-8")
    here = at(text, "  |pause:\n    engage")
    found = opened.ask("references", path, *here, context={"includeDeclaration": True})
    places = [(Path(each["uri"]).name, each["range"]["start"]["line"] + 1) for each in found]
    part = (missions / PART).read_text(encoding="utf-8")
    assert places == [
        ("lifecycle.yaml", here[0] + 1),
        *(("lifecycle.yaml", n) for n, row in enumerate(text.splitlines(), 1) if "releases: pause" in row),
        *(("visit_targets.yaml", n) for n, row in enumerate(part.splitlines(), 1) if "during: pause" in row),
    ]
    less = opened.ask("references", path, *here, context={"includeDeclaration": False})
    assert len(less) == len(found) - 1


def test_renames_in_all_files(opened: Client, missions: Path) -> None:
    """What comes out is checked, by the server itself."""
    path = missions / INSPECTION
    text = path.read_text(encoding="utf-8")
    here = at(text, "  PREP|ARE:\n")
    assert opened.ask("prepareRename", path, *here)["placeholder"] == "PREPARE"
    changes = opened.ask("rename", path, *here, newName="GETTING_READY")["changes"]
    assert {Path(uri).name: len(edits) for uri, edits in changes.items()} == {
        "lifecycle.yaml": 1,
        "inspection.yaml": 2,
    }
    with pytest.raises(ServerError, match=r"there is a state \'MISSION\.InspectionMission\.done\' already"):
        opened.ask("rename", path, *here, newName="done")
    with pytest.raises(ServerError, match="only states can be renamed"):
        opened.ask("prepareRename", path, *at(text, "do: nav.|localize"))
    assert opened.errors == ""


def test_gives_the_outline(opened: Client, missions: Path) -> None:
    """Sections and states, as they are nested."""
    document = {"textDocument": {"uri": (missions / PART).as_uri()}}

    def tree(symbols: list[dict[str, Any]]) -> dict[str, Any]:
        return {each["name"]: tree(each["children"]) for each in symbols}

    found = opened.request("textDocument/documentSymbol", document)
    assert list(tree(found)["codes"]) == ["scan_timeout", "confirm_timeout", "skipped_by_operator"]
    assert tree(found)["SCANNING"] == {"CONFIRMING": {}, "READING": {}, "DWELLING": {}}
    scanning = next(each for each in found if each["name"] == "SCANNING")
    assert (scanning["range"]["start"]["line"], scanning["range"]["end"]["line"]) == (48, 87)


def test_mends_a_spelling(opened: Client, missions: Path) -> None:
    """One change, to the one that is meant."""
    path = missions / INSPECTION
    _, found = edited(opened, path, "on_error: FAULT", "on_error: FUALT")
    params = {
        "textDocument": {"uri": path.as_uri()},
        "range": found[0]["range"],
        "context": {"diagnostics": found},
    }
    (action,) = opened.request("textDocument/codeAction", params)
    assert action["title"] == "Change to 'FAULT'"
    assert action["edit"]["changes"][path.as_uri()] == [{"range": found[0]["range"], "newText": "FAULT"}]


def test_looks_again_at_files_that_others_changed(opened: Client, missions: Path) -> None:
    """After a checkout, say: the client watches the files."""
    path = missions / LIFECYCLE
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("target: BOOT", "target: BOTT"), encoding="utf-8")
    change = {"changes": [{"uri": path.as_uri(), "type": 2}]}
    opened.notify("workspace/didChangeWatchedFiles", change)
    assert [each["code"] for each in opened.diagnostics(path)] == ["unknown-state"]


COUNTEREXAMPLE = """\
scenario: as it was proven
mission: inspection
request: {tag_sequence: ["1"]}
expect: {}
"""


def test_shows_a_counterexample_at_its_transition(opened: Client, missions: Path) -> None:
    """One that a proof has written beside the mission, until what is typed mends it."""
    file = missions / "inspection.stands.scenario.yaml"
    file.write_text(COUNTEREXAMPLE, encoding="utf-8")
    path = missions / INSPECTION
    stands = "properties:\n  stands: {never: in_state('INSPECTING')}\n\nrequest:"
    text, found = edited(opened, path, "request:", stands)
    assert found == []
    (shown,) = opened.until_found(path)  # what was found last stays until typing pauses
    start = shown["range"]["start"]
    assert text.splitlines()[start["line"]][start["character"] - 9 :] == "on_done: INSPECTING"
    assert shown["code"] == "broken-property"
    where = text.splitlines().index("  stands: {never: in_state('INSPECTING')}") + 1
    assert shown["message"] == (
        f"property stands (line {where}): in_state('INSPECTING') became true; it must never be;"
        " lupin test inspection.stands.scenario.yaml shows it"
    )
    opened.change(path, text.replace("in_state('INSPECTING')", "in_state('FAULT')"))
    while opened.diagnostics(path) != []:
        continue
    opened.change(path, text)
    assert len(opened.until_found(path)) == 1
    file.unlink()
    opened.notify("workspace/didChangeWatchedFiles", {"changes": [{"uri": file.as_uri(), "type": 3}]})
    while opened.diagnostics(path) != []:
        continue


def test_a_file_that_is_closed_is_as_it_was_saved(server: Client, missions: Path) -> None:
    """Its findings go with what was not saved."""
    path = missions / INSPECTION
    server.open(path)
    _, found = edited(server, path, "on_error: FAULT", "on_error: FUALT")
    assert [each["code"] for each in found] == ["unknown-state"]
    server.notify("textDocument/didClose", {"textDocument": {"uri": path.as_uri()}})
    assert server.last_diagnostics(path) == []


@pytest.mark.slow
def test_without_pygls_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is an extra; the rest of the command line works without."""
    monkeypatch.delitem(sys.modules, "lupin_lsp.server", raising=False)
    monkeypatch.delitem(vars(lupin_lsp), "serve", raising=False)  # of an earlier test
    monkeypatch.setitem(sys.modules, "lsprotocol", None)
    found = CliRunner().invoke(lsp, [])
    assert isinstance(found.exception, UsageError)
    assert str(found.exception) == (
        "the language server needs lsprotocol, which is missing; "
        "run: python3 -m pip install 'lupin-engine[editor]'"
    )


@pytest.mark.slow
def test_its_messages_are_the_protocols_alone(tmp_path: Path) -> None:
    """A plugin that prints while it is imported must not break the stream."""
    program = """\
import lupin_cli.verbs.lsp as verb
load = verb.load_catalog
verb.load_catalog = lambda: (print("from a plugin"), load())[1]
verb.lsp.main([], standalone_mode=False)
"""
    client = Client([sys.executable, "-c", program], tmp_path)
    assert client.capabilities["hoverProvider"]
    assert client.close() == 0
