"""The schema in the server that editors use for YAML: redhat's yaml-language-server.

Its version is fixed here.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lupin_cli.verbs.schema import schemas
from lupin_lsp.schema import ANY_KIND, text_of
from tests.npm import installed
from tests.workbench.lupin_lsp.client import Client, at

VERSION = "2.0.0"
#: What a modern editor says that it can show.
CAPABILITIES = {
    "workspace": {"configuration": True},
    "textDocument": {
        "completion": {"completionItem": {"snippetSupport": True, "documentationFormat": ["markdown"]}},
        "hover": {"contentFormat": ["markdown"]},
    },
}

pytestmark = [pytest.mark.node, pytest.mark.timeout(400)]


@pytest.fixture(scope="session")
def program() -> Path:
    """The program of the server."""
    folder = installed(f"yaml-language-server@{VERSION}")
    return folder / "node_modules" / "yaml-language-server" / "bin" / "yaml-language-server"


@pytest.fixture(scope="module")
def server(program: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """One server that reads our schema for all YAML."""
    root = tmp_path_factory.mktemp("workspace")
    schema = root / "lupin.schema.json"
    schema.write_text(text_of(schemas()[ANY_KIND]), encoding="utf-8")
    node = shutil.which("node")
    assert node is not None
    client = Client([node, str(program), "--stdio"], root, CAPABILITIES)
    settings = {
        "schemas": {schema.as_uri(): "*.yaml"},
        "validate": True,
        "completion": True,
        "hover": True,
        "schemaStore": {"enable": False},
    }
    client.settings({"yaml": settings})
    until_it_knows_the_schema(client, root / "wrong.yaml")
    yield client
    client.close()


def until_it_knows_the_schema(client: Client, path: Path) -> None:
    """Wait until the server objects to a file: when it asks for its settings is up to it."""
    client.open(path, "mission: [a]\n")
    client.until_found(path)


def typed(client: Client, path: Path, old: str, new: str) -> tuple[int, int]:
    """Open a file in which a piece is replaced by one with a `|`; return where that is."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    changed = text.replace(old, new.replace("|", "", 1), 1)
    client.open(path, changed)
    offset = text.index(old) + new.index("|")
    line = changed.count("\n", 0, offset)
    return line, offset - (changed.rfind("\n", 0, offset) + 1)


def test_has_nothing_to_say_of_the_shipped_missions(server: Client, missions: Path) -> None:
    """Lifecycle, mission and part, by one schema."""
    for name in ("lifecycle.yaml", "inspection.yaml", "parts/visit_targets.yaml"):
        server.open(missions / name)
        assert server.diagnostics(missions / name) == []


OFFERS = {
    "keys of a state": (
        "inspection.yaml",
        "        on_error: FAULT",
        "        |",
        {"summary", "type", "on_error", "always", "for_each", "state that waits"},
    ),
    "keys of a transition": (
        "inspection.yaml",
        "        on_error: FAULT",
        "        on_error:\n          - |",
        {"target", "guard", "refuse", "transition with a guard"},
    ),
    "words": ("lifecycle.yaml", "severity: info", "severity: |", {"info", "warn", "error"}),
    "kinds of states": (
        "inspection.yaml",
        "{type: final}",
        "\n    type: |",
        {"parallel", "final", "history"},
    ),
    "actions": (
        "lifecycle.yaml",
        "    - report.summary",
        "    - |",
        {"itinerary.close", "report.summary", "set"},
    ),
    "a retry": (
        "inspection.yaml",
        "          timeout:",
        "          retry:\n            |\n          timeout:",
        {"attempts", "backoff", "retry with growing pauses"},
    ),
}


@pytest.mark.parametrize("case", OFFERS)
def test_completes(case: str, server: Client, missions: Path) -> None:
    """Keys, words and forms to fill in."""
    name, old, new, wanted = OFFERS[case]
    path = missions / name
    found = server.ask("completion", path, *typed(server, path, old, new))
    assert wanted - {item["label"] for item in found["items"]} == set()


def test_begins_a_new_file(server: Client, missions: Path) -> None:
    """With what it can be, and a form for a mission."""
    path = missions / "new.yaml"
    server.open(path, "")
    found = server.ask("completion", path, 0, 0)["items"]
    assert {"mission", "part", "lifecycle", "scenario"} <= {item["label"] for item in found}
    forms = [item["insertText"] for item in found if "states:" in item.get("insertText", "")]
    assert forms[0].startswith("mission: ${1:NameOfTheMission}\n")


def test_says_what_a_key_is_for(server: Client, missions: Path) -> None:
    """The description of the model."""
    path = missions / "inspection.yaml"
    server.open(path)
    text = path.read_text(encoding="utf-8")
    found = server.ask("hover", path, *at(text, "on_|done: INSPECTING"))["contents"]["value"]
    assert "when the operation has succeeded" in found


WRONG = {
    "an unknown key": ("on_error: FAULT", "on_eror: FAULT", (28, 8, 15), "Property on_eror is not allowed."),
    "a wrong shape": ("phase: LOCALIZING", "phase: [a]", (22, 15, 18), 'Incorrect type. Expected "string".'),
    "an unknown word": (
        "{type: final}",
        "{type: finl}",
        (34, 15, 19),
        'Value is not accepted. Valid values: "parallel", "final", "history".',
    ),
    "a key of a limit": ("timeout: {after", "timeout: {aftr", (26, 20, 24), "Property aftr is not allowed."),
    "a key of a transition": (
        "on_error: FAULT",
        "on_error: {target: FAULT, gaurd: x}",
        (28, 34, 39),
        "Property gaurd is not allowed.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_marks_what_is_wrong(case: str, server: Client, missions: Path) -> None:
    """At the key or value itself."""
    old, new, (line, start, end), message = WRONG[case]
    path = missions / "inspection.yaml"
    server.open(path, path.read_text(encoding="utf-8").replace(old, new, 1))
    found = server.diagnostics(path)
    places: list[tuple[Any, str]] = [(each["range"], each["message"]) for each in found]
    wanted = {"start": {"line": line, "character": start}, "end": {"line": line, "character": end}}
    assert (wanted, message) in places


def test_completes_names_of_plugins(
    program: Path, missions: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """With the schema that knows the catalog: operations, and what they say of themselves."""
    root = tmp_path_factory.mktemp("catalog")
    schema = root / "lupin.schema.json"
    schema.write_text(text_of(schemas(with_names=True)[ANY_KIND]), encoding="utf-8")
    node = shutil.which("node")
    assert node is not None
    client = Client([node, str(program), "--stdio"], root, CAPABILITIES)
    client.settings({"yaml": {"schemas": {schema.as_uri(): "*.yaml"}, "completion": True, "hover": True}})
    path = missions / "inspection.yaml"
    until_it_knows_the_schema(client, root / "wrong.yaml")
    here = typed(client, path, "do: nav.localize", "do: |")
    assert client.diagnostics(path)
    found = client.ask("completion", path, *here)["items"]
    assert {"nav.go_to", "nav.localize", "bridge.read_tag"} <= {item["label"] for item in found}
    client.change(path, path.read_text(encoding="utf-8"))
    text = path.read_text(encoding="utf-8")
    said = client.ask("hover", path, *at(text, "do: nav.|localize"))["contents"]["value"]
    assert "nav.localize" in said
    client.close()
