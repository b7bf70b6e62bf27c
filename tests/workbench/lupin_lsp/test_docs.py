"""What docs/editor.md tells to type is right."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from lupin_cli.verbs.lsp import lsp
from lupin_cli.verbs.schema import schema

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "docs" / "editor.md").read_text(encoding="utf-8")
EXTENSION = ROOT / "editors" / "vscode"


@pytest.mark.parametrize("block", re.findall(r"```json\n(.*?)```", TEXT, re.DOTALL))
def test_settings_are_json(block: str) -> None:
    """And the schema that they name is the one that a command of the page makes."""
    for path in json.loads(block).get("yaml.schemas", {}):
        assert f"lupin schema > {path}\n" in TEXT


def test_the_schema_is_found_from_a_mission() -> None:
    """The line that a mission can begin with."""
    (address,) = re.findall(r"\$schema=(\S+)", TEXT)
    assert (ROOT / "missions" / address).resolve().is_file()


def test_the_extension_is_what_the_text_says() -> None:
    """Its version, its setting, its program."""
    package = json.loads((EXTENSION / "package.json").read_text(encoding="utf-8"))
    assert f"{package['name']}-{package['version']}.vsix" in TEXT
    assert f'"{next(iter(package["contributes"]["configuration"]["properties"]))}"' in TEXT
    assert (EXTENSION / package["main"]).is_file()


def test_the_verbs_have_the_options_that_are_told() -> None:
    """`lupin lsp --help`, `lupin schema --help`."""
    assert CliRunner().invoke(lsp, ["--help"]).exit_code == 0
    said = CliRunner().invoke(schema, ["--help"]).output
    assert {"--write", "--catalog"} <= set(re.findall(r"--\w+", said))
