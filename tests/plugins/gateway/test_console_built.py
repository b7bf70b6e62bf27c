"""The console that is served is the one of these sources, which fit together, and weighs what a page may."""

from __future__ import annotations

import json
import shutil
import subprocess
from hashlib import sha256
from pathlib import Path

import pytest

from lupin_gateway.server import PAGES
from tests.npm import installed, run_node

CONSOLE = Path(__file__).parents[3] / "console"
#: Bytes of all that a browser loads, packed.
MOST = 200_000


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the console with the packages that it names, beside a gateway without pages."""
    folder = tmp_path_factory.mktemp("checkout")
    shutil.copytree(CONSOLE, folder / "console", ignore=shutil.ignore_patterns("node_modules"))
    named = json.loads((CONSOLE / "package.json").read_text(encoding="utf-8"))
    versions = {**named["dependencies"], **named["devDependencies"]}
    packages = installed(*(f"{name}@{version}" for name, version in versions.items()))
    (folder / "console" / "node_modules").symlink_to(packages / "node_modules")
    return folder


def test_it_was_built_of_these_sources() -> None:
    """Else: `npm install && npm run build` in `console`."""
    files = [file for file in (CONSOLE / "src").rglob("*") if file.is_file()]
    digest = sha256()
    for file in sorted([*files, CONSOLE / "package.json", CONSOLE / "build.mjs"], key=str):
        digest.update(str(file.relative_to(CONSOLE)).encode() + b"\0" + file.read_bytes() + b"\0")
    assert (PAGES / "sources.sha256").read_text(encoding="ascii").strip() == digest.hexdigest()


@pytest.mark.node
@pytest.mark.timeout(400)
def test_building_it_makes_what_is_served(checkout: Path) -> None:
    """To the byte; package.json names the exact versions of what goes into it."""
    run_node(checkout / "console" / "build.mjs")
    built = list((checkout / "plugins" / "lupin_gateway" / "pages").iterdir())
    assert {"console.js", "console.css", "stop.js", "sources.sha256"} <= {file.name for file in built}
    other = [file.name for file in built if file.read_bytes() != (PAGES / file.name).read_bytes()]
    assert other == [], "`npm install && npm run build` in `console`"


@pytest.mark.node
@pytest.mark.timeout(400)
@pytest.mark.parametrize("folder", [".", "test"])
def test_its_types_fit_together(checkout: Path, folder: str) -> None:
    """With the types of messages and records, which are made from their definitions."""
    compiler = checkout / "console" / "node_modules" / "typescript" / "bin" / "tsc"
    run_node(compiler, "--noEmit", "-p", checkout / "console" / folder)


@pytest.mark.node
@pytest.mark.timeout(400)
def test_its_model_passes_its_own_tests(checkout: Path) -> None:
    """`npm test` in `console`."""
    run_node(checkout / "console" / "test" / "run.mjs")


def test_it_says_whose_code_is_in_it() -> None:
    told = (PAGES / "LICENSES.txt").read_text(encoding="utf-8")
    assert [name for name in ("preact", "@preact/signals", "uplot") if f"{name}\n" not in told] == []


@pytest.mark.node
def test_a_page_is_small() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node.js is not installed")
    pack = "zlib.brotliCompressSync(require('fs').readFileSync(0)).length"
    command = [node, "-p", f"const zlib = require('zlib'); {pack}"]
    packed = 0
    for file in PAGES.glob("*.*"):
        if file.suffix in (".js", ".css", ".html", ".svg"):
            ran = subprocess.run(command, input=file.read_bytes(), capture_output=True, check=True)
            packed += int(ran.stdout)
    assert 10_000 < packed < MOST
