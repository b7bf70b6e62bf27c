"""`--hmi` and `--open`: what is wrong is told before anything starts."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from lupin_cli.main import lupin
from lupin_engine.errors import UsageError

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
trustme = pytest.importorskip("trustme")

NEEDED = """\
an open gateway needs tls_certificate: the certificate of this machine (PEM)
an open gateway needs tls_key: its key (PEM)
an open gateway needs tokens: who may come in: lines of NAME ROLE EXPIRES TOKEN, mode 600
"""


def told(*arguments: str) -> str:
    """What `lupin up` says that cannot be started with these arguments."""
    result = CliRunner().invoke(lupin, ["up", *arguments])
    assert isinstance(result.exception, UsageError), result.output
    return f"{result.exception}\n"


def of_gateway(**settings: object) -> list[str]:
    """Settings of the gateway as options."""
    return [part for name, value in settings.items() for part in ("--set", f"lupin_gateway.{name}={value}")]


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """A certificate with its key, and a token."""
    issued = trustme.CA().issue_cert("robot")
    found = {name: tmp_path / name for name in ("tls_certificate", "tls_key", "tokens")}
    issued.cert_chain_pems[0].write_to_path(str(found["tls_certificate"]))
    issued.private_key_pem.write_to_path(str(found["tls_key"]))
    found["tokens"].write_text(f"anna operator 2099-12-31 {'a' * 40}\n")
    found["tokens"].chmod(0o600)
    return found


def test_an_open_gateway_says_what_it_needs() -> None:
    """All of it, beside what else is wrong; without pages there is nothing to open."""
    assert told("--hmi", "--open") == NEEDED
    wrong = told("--hmi", "--open", *of_gateway(on_link_lost="halt"))
    assert wrong == (
        "--set lupin_gateway: parameter 'on_link_lost': expected one of continue, pause, stop, got 'halt'\n"
        + NEEDED
    )
    assert told("--open") == "--open: nothing is served that could be opened; add --hmi\n"
    assert told(*of_gateway(port=8081)) == "--set is for lupin_gateway, which only --hmi starts\n"


def test_who_wants_no_pages_needs_none_of_their_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without them `lupin up` finds nothing missing; with `--hmi` it says what to install."""
    monkeypatch.setitem(sys.modules, "lupin_gateway.node", None)
    told_first = (
        "--sim: parameter 'fault': expected one of none, reject, abort, stall, refuse_cancel, "
        "lose_localization, got 'x'"
    )
    assert told("--sim", "fault=x") == f"{told_first}\n"
    text = (
        "node 'lupin_gateway' of plugin 'gateway' cannot be loaded from lupin_gateway.node:main: "
        "import of lupin_gateway.node halted; None in sys.modules; "
        "pages need `pip install 'lupin-engine[hmi]'`\n"
    )
    assert told("--hmi", "--sim", "fault=x") == told(*of_gateway(port=8081)) == text


def test_no_other_address_without_doors() -> None:
    """An address that others reach is an open gateway."""
    text = "host 0.0.0.0: others can reach it there: write open: true, or leave host out\n"
    assert told("--hmi", *of_gateway(host="0.0.0.0")) == text


def test_files_that_open_nothing(files: dict[str, Path], tmp_path: Path) -> None:
    """A key of another certificate, tokens that others can read, a file that is not there."""
    files["tokens"].chmod(0o640)
    text = f"others can read or change these tokens (mode 640); write: chmod 600 {files['tokens']}"
    assert told("--hmi", "--open", *of_gateway(**files)) == f"{files['tokens']}: {text}\n"
    files["tokens"].chmod(0o600)
    trustme.CA().issue_cert("robot").private_key_pem.write_to_path(str(files["tls_key"]))
    found = told("--hmi", "--open", *of_gateway(**files))
    assert found.startswith(
        f"{files['tls_certificate']} and {files['tls_key']} are no certificate with its key: "
    )
    missing = {**files, "tls_key": tmp_path / "none"}
    text = f"tls_key: there is no file {tmp_path / 'none'}; it is its key (PEM)\n"
    assert told("--hmi", "--open", *of_gateway(**missing)) == text
