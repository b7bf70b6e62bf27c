"""Signed bundles grow old: which versions a robot has run is remembered for each key."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import pytest

from lupin_engine.errors import LupinError, UsageError
from lupin_engine.missions.bundle import Bundle, make_bundle, read_bundle, version_key
from lupin_engine.missions.seen import SeenBundles

ORDER = ["1", "2", "10", "10.0.1", "10.1.0-1", "10.1.0-2", "10.1.0-10", "10.1.0-rc", "10.1.0-rc.1", "10.1.0"]


def signed(name: str = "", version: str = "", key: str = "k") -> Bundle:
    """Return a bundle whose signature was looked at."""
    about = json.dumps({"key": key, "signature": ""}).encode()
    return Bundle(Path("b.lupin"), "m.yaml", "", {}, b"", about, name, version)


def test_versions_are_in_order() -> None:
    """Integers and those of semver.org."""
    assert all(version_key(one) < version_key(next_) for one, next_ in pairwise(ORDER))


@pytest.mark.parametrize("version", ["", "1.2", "v1", "-1", "1.2.3.4", "1" * 19, "latest"])
def test_what_is_no_version_is_refused(version: str) -> None:
    """With what is expected."""
    with pytest.raises(UsageError) as refused:
        version_key(version)
    assert str(refused.value) == f"version: {version!r} is none; expected an integer, or one like 1.2.3"


def test_a_name_and_a_version_stand_in_the_bundle(tmp_path: Path) -> None:
    """Both or neither."""
    file = tmp_path / "b.lupin"
    file.write_bytes(make_bundle("m.yaml", "h", {"m.yaml": b"mission: M"}, None, "set", "1.2.3"))
    found = read_bundle(file)
    assert (found.name, found.version) == ("set", "1.2.3")
    with pytest.raises(UsageError, match=r"^name: 'a b' is none; expected letters, digits, '_', '\.' and"):
        make_bundle("m.yaml", "h", {}, None, "a b", "1")
    with pytest.raises(UsageError, match=r"^a bundle has a name and a version, or neither$"):
        make_bundle("m.yaml", "h", {}, None, "", "1")


def test_only_newer_ones_of_the_same_name_are_taken(tmp_path: Path) -> None:
    """Each key has its own; what is allowed is taken, and does not make the next one older."""
    seen = SeenBundles(tmp_path / "state" / "bundles.json")
    assert seen.check(signed()).endswith("'lupin bundle MISSION --sign KEY --version N'")
    seen.remember(signed())
    for version in ("1", "2"):
        assert seen.check(signed("a", version)) == ""
        seen.remember(signed("a", version))
    assert seen.check(signed("a", "2")) == ""
    assert seen.check(signed("b", "1", key="another")) == ""
    for wrong in (signed("a", "1"), signed("b", "1"), signed()):
        with pytest.raises(LupinError):
            seen.check(wrong)
    allowing = SeenBundles(seen.file, ["a@1", "b", "unnamed"])
    for wrong in (signed("a", "1"), signed("b", "1"), signed()):
        allowing.check(wrong)
        allowing.remember(wrong)
    with pytest.raises(LupinError, match="it is a 1, but 2 was run here already"):
        seen.check(signed("a", "1"))
    assert seen.check(signed("b", "1")) == ""


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"k": 1}', b'{"k": {"a": "x"}}', b'{"k": {"a": 7}}'])
def test_what_cannot_be_read_allows_nothing(tmp_path: Path, content: bytes) -> None:
    """It says what the file is for."""
    file = tmp_path / "bundles.json"
    file.write_bytes(content)
    with pytest.raises(LupinError) as refused:
        SeenBundles(file).check(signed("a", "1"))
    wanted = "it remembers which signed bundles were run; repair it, or remove it to begin anew"
    assert str(refused.value) == f"{file} cannot be read: {wanted}"
