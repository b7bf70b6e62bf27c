"""The audit of what is installed: by the packages' own hashes, and by a service that may not be there."""

from __future__ import annotations

import base64
import hashlib
import json
import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from tests.tools import load_tool

pytestmark = pytest.mark.slow

audit = load_tool("audit")
pytest.importorskip("pip_audit")


class _Service(BaseHTTPRequestHandler):
    """Knows one thing, of click 8.0, in the words of OSV."""

    def do_POST(self) -> None:
        asked = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        package = {"name": "click", "ecosystem": "PyPI"}
        known = {
            "id": "PYSEC-0000-1",
            "summary": "it clicks",
            "published": "2026-01-01T00:00:00Z",
            "affected": [
                {
                    "package": package,
                    "versions": ["8.0"],
                    "ranges": [{"type": "ECOSYSTEM", "events": [{"introduced": "0"}, {"fixed": "8.1"}]}],
                }
            ],
        }
        found: dict[str, Any] = {"vulns": [known]} if asked["package"]["name"] == "click" else {}
        body = json.dumps(found).encode()
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        """Say nothing."""


@pytest.fixture
def service() -> Iterator[tuple[str, ...]]:
    """A service on this machine, as pip-audit is told of it."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _Service) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield _told(server.server_port)
        server.shutdown()


def _told(port: int) -> tuple[str, ...]:
    return ("--vulnerability-service", "osv", "--osv-url", f"http://127.0.0.1:{port}/v1/query")


def test_what_is_known_against_a_package_is_told(
    service: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    """By pip-audit itself."""
    assert audit.first_that_answers([service]) == service
    found = audit.vulnerabilities(["click==8.0", "rich==13.7"], service)
    assert found == ["click 8.0: PYSEC-0000-1, fixed in 8.1"]
    assert capsys.readouterr().out == "audit: 2 packages looked up; 0 not known: []\n"


def test_a_service_that_is_not_there_is_no_failure_and_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """The hashes are compared all the same."""
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))  # not listening
        code = audit.main([_told(nobody.getsockname()[1])])
    told = capsys.readouterr().out.splitlines()
    assert code == 0, told
    assert told[0].endswith(" packages compared with their hashes; 0 changed")
    assert "cannot be asked: " in told[1]
    assert "Connection refused" in told[1]
    assert told[2:] == [
        "audit: KNOWN VULNERABILITIES WERE NOT LOOKED UP: no service could be asked",
        "audit: 0 problems, vulnerabilities not looked up",
    ]


def test_a_file_that_was_changed_is_told(tmp_path: Path) -> None:
    """Whoever changed it: the package says what it was."""
    about = tmp_path / "seed-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: seed\nVersion: 1.0\n")
    file = tmp_path / "seed.py"
    file.write_text("grows = True\n")
    digest = base64.urlsafe_b64encode(hashlib.sha256(file.read_bytes()).digest()).rstrip(b"=").decode()
    (about / "RECORD").write_text(f"seed.py,sha256={digest},13\nseed-1.0.dist-info/RECORD,,\n")
    assert list(audit.changed(metadata.distributions(path=[str(tmp_path)]))) == []
    file.write_text("grows = False\n")
    assert list(audit.changed(metadata.distributions(path=[str(tmp_path)]))) == [
        "seed 1.0: seed.py was changed after it was installed"
    ]
