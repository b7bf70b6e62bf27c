"""Files that are there as a whole or not at all."""

from __future__ import annotations

import os
import pwd
from contextlib import nullcontext
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.errors import UsageError
from lupin_engine.plugin.domain import DOMAIN, domain_number
from lupin_engine.plugin.files import read_domain, ros_domain, user_folder, write_atomically


def test_a_file_is_written_and_replaced(tmp_path: Path) -> None:
    file = tmp_path / "file"
    for content in (b"first", b"second"):
        write_atomically(file, content)
        assert file.read_bytes() == content
    assert os.listdir(tmp_path) == ["file"]


def test_a_new_file_has_usual_permissions_and_an_old_one_its_own(tmp_path: Path) -> None:
    file, usual = tmp_path / "file", tmp_path / "usual"
    usual.write_bytes(b"")
    write_atomically(file, b"")
    assert file.stat().st_mode == usual.stat().st_mode
    file.chmod(0o600)
    write_atomically(file, b"")
    assert file.stat().st_mode & 0o777 == 0o600


def test_a_link_leads_to_the_file_that_is_written(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    file.write_bytes(b"old")
    link.symlink_to(file)
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert file.read_bytes() == b"new"


def test_when_it_cannot_be_written_nothing_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left on device"):
        write_atomically(file, b"new")
    assert file.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["file"]


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_atomically(tmp_path / "no" / "file", b"")


def test_the_users_folder_is_the_one_that_is_set_or_below_the_home(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    set_by_hand = {"XDG_STATE_HOME": "/var/state"}
    assert user_folder("XDG_STATE_HOME", ".local/state", set_by_hand) == Path("/var/state/lupin")
    for environment in ({}, {"XDG_STATE_HOME": ""}, {"XDG_STATE_HOME": "relative"}):
        assert user_folder("XDG_STATE_HOME", ".local/state", environment) == tmp_path / ".local/state/lupin"


def test_who_has_no_home_is_told_what_to_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """An unknown user id in a container has none."""

    def unknown(_: int) -> None:
        raise KeyError

    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    with pytest.raises(UsageError) as refused:
        user_folder("XDG_STATE_HOME", ".local/state", {})
    assert str(refused.value) == "this user has no home folder; set XDG_STATE_HOME to an absolute path"


@pytest.mark.parametrize(("said", "domain"), [("42", 42), (" 7 ", 7), ("", 0), (" ", 0)])
def test_the_domain_is_a_number_or_0(said: str, domain: int) -> None:
    assert ros_domain({"ROS_DOMAIN_ID": said}) == domain


WRONG = ["lab", "-1", "5 6", "٣", "²", "1.0", "010", "0x10", "102", "214", "233", "1" * 5000]


@pytest.mark.parametrize("said", WRONG)
def test_what_is_no_domain_is_refused(said: str) -> None:
    """By one rule for the variable and the option; only the latter may not be empty."""
    told = f"is {said!r}: use a number from 0 to 101 or from 215 to 232"
    for read, name in ((lambda: ros_domain({DOMAIN: said}), DOMAIN), (lambda: read_domain(said), "--domain")):
        with pytest.raises(UsageError) as refused:
            read()
        assert str(refused.value) == f"{name} {told}"
    with pytest.raises(UsageError):
        read_domain("")


def test_a_domain_has_ports_that_nobody_else_gets() -> None:
    """Those of its first fifty participants are ports, and Linux hands none of them out to anybody."""
    handed_out = range(32768, 61000)
    for number in range(300):
        ports = [7400 + 250 * number + offset for offset in range(110)]
        alone = ports[-1] < 65536 and not any(port in handed_out for port in ports)
        with nullcontext() if alone else pytest.raises(ValueError, match="use a number"):
            assert domain_number(str(number)) == number


@pytest.mark.parametrize("words", [["graph"], ["record"], ["state"], ["twin", "show"], ["invite", "anna"]])
def test_every_verb_has_the_same_domains(
    words: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """102 and 214 are none, for nobody, however they are given."""
    for number in ("102", "214"):
        for said, options in (("--domain", ["--domain", number]), (DOMAIN, [])):
            monkeypatch.setenv(DOMAIN, "0" if options else number)
            assert main([*words, *options]) == 2
            told = f"lupin: {said} is '{number}': use a number from 0 to 101 or from 215 to 232\n"
            assert capsys.readouterr().err == told
