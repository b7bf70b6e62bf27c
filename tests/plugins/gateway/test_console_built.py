"""The console that is served is the one of these sources, and is no more than a page may weigh."""

from __future__ import annotations

import shutil
import subprocess
from hashlib import sha256
from pathlib import Path

import pytest

from lupin_gateway.server import PAGES

CONSOLE = Path(__file__).parents[3] / "console"
#: Bytes of all that a browser loads, packed.
MOST = 200_000


def test_it_was_built_of_these_sources() -> None:
    """Else: `npm install && npm run build` in `console`."""
    files = [file for file in (CONSOLE / "src").rglob("*") if file.is_file()]
    digest = sha256()
    for file in sorted([*files, CONSOLE / "package.json", CONSOLE / "build.mjs"], key=str):
        digest.update(str(file.relative_to(CONSOLE)).encode() + b"\0" + file.read_bytes() + b"\0")
    assert (PAGES / "sources.sha256").read_text(encoding="ascii").strip() == digest.hexdigest()


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
