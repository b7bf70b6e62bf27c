"""Bundles: a mission in one file, which is whole, harmless to open, and signed by somebody who is known."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.errors import UsageError
from lupin_engine.missions.bundle import (
    MANIFEST,
    MAX_BYTES,
    MAX_FILES,
    check_signed,
    make_bundle,
    read_bundle,
)
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog

TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorial"
HOW = "a mission is signed with: lupin bundle MISSION --sign KEY"

Change = Callable[[dict[str, bytes]], None]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a mission that has a binding, and two pairs of keys."""
    missions = tmp_path / "missions"
    shutil.copytree(TUTORIAL / "bindings", missions / "bindings")
    shutil.copy(TUTORIAL / "patrol.yaml", missions)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", missions)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name in ("ours", "theirs"):
        openssl("genpkey", "-algorithm", "ed25519", "-out", f"{name}.key")
        Path(name).mkdir()
        openssl("pkey", "-in", f"{name}.key", "-pubout", "-out", f"{name}/{name}.pem")
    return tmp_path


def openssl(*arguments: str) -> None:
    """Make keys as the documentation says."""
    subprocess.run(["openssl", *arguments], check=True, capture_output=True, umask=0o077)


def bundled(*options: str) -> Path:
    """Make a bundle of the patrol."""
    assert main(["bundle", "patrol", *options]) == 0
    return Path("patrol.lupin")


def altered(file: Path, change: Change) -> Path:
    """Write a bundle again, changed."""
    with zipfile.ZipFile(file) as archive:
        inside = {name: archive.read(name) for name in archive.namelist()}
    change(inside)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, raw in inside.items():
            archive.writestr(zipfile.ZipInfo(name), raw, zipfile.ZIP_DEFLATED)
    return file


def refused(file: Path) -> str:
    """Return why a bundle cannot be read."""
    with pytest.raises(UsageError) as problem:
        read_bundle(file)
    return str(problem.value)


def test_a_bundle_is_the_mission(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Wherever that is named: all that it is made of is in it, under the same hash, and no more."""
    file = bundled()
    assert capsys.readouterr().out == "wrote patrol.lupin: PatrolMission, 3 files, not signed\n"
    original = load_missions(["patrol"], load_catalog())
    moved = file.rename(folder / "cache.lupin")
    shutil.rmtree("missions")
    loaded = load_missions([str(moved)], load_catalog(), reaching=True)
    assert (loaded.hash, loaded.names) == (original.hash, ("PatrolMission",))
    assert loaded.parameters() == {"missions_path": str(moved)}
    assert [*read_bundle(moved).files] == ["bindings/photo_arm.yaml", "lifecycle.yaml", "patrol.yaml"]
    assert main(["check", "--strict", str(moved)]) == 0
    assert main(["simulate", str(moved), "--until", "1 s"]) == 0


def test_what_could_not_be_read_is_not_written() -> None:
    """Too many files, too many bytes, and a mission that is not where a reader looks for it."""
    files = {"lifecycle.yaml": b"", "patrol.yaml": b""}
    many = files | {f"parts/a{number}.yaml": b"" for number in range(MAX_FILES)}
    large = files | {"parts/a.yaml": b" " * MAX_BYTES}
    for given, reason in (
        (many, f"it has {MAX_FILES + 3} files; at most {MAX_FILES} are read"),
        (large, f"its files have more than {MAX_BYTES} bytes"),
        ({"parts/patrol.yaml": b""}, "its file must stand beside the lifecycle"),
    ):
        with pytest.raises(UsageError) as refusal:
            make_bundle("patrol.yaml", "h", given, None)
        assert str(refusal.value) == f"no bundle can be made of 'patrol.yaml': {reason}"


def test_the_same_files_make_the_same_bundle(folder: Path) -> None:
    """So it can be compared with one that was made elsewhere."""
    first = bundled("--sign", "ours.key").read_bytes()
    os.utime("missions/patrol.yaml", (0, 0))
    assert bundled("--sign", "ours.key").read_bytes() == first


def test_what_a_bundle_may_reach_is_said_where_it_lies(folder: Path) -> None:
    """By the robot's own file: nothing in the bundle allows anything."""
    binding = Path("missions/bindings/photo_arm.yaml")
    binding.write_text(binding.read_text().replace("/lupin/arm/preset", "/other/arm"))
    file = bundled()
    robot = folder / "robot" / "missions"
    robot.mkdir(parents=True)
    moved = file.rename(robot / "patrol.lupin")
    with pytest.raises(Exception, match="not-allowed") as problem:
        load_missions([str(moved)], load_catalog(), reaching=True)
    assert str(problem.value).endswith(
        "photo_arm.yaml:12:21: error: operations.move.service: it is not allowed to call the service "
        f"'/other/arm'; write /other/arm under 'allow: services' in {folder}/robot/lupin.yaml [not-allowed]"
    )
    (robot.parent / "lupin.yaml").write_text("allow: {services: /other/*}")
    assert load_missions([str(moved)], load_catalog(), reaching=True).names == ("PatrolMission",)


def _change(name: str, raw: bytes) -> Change:
    def change(inside: dict[str, bytes]) -> None:
        inside[name] = raw

    return change


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (_change("../patrol.yaml", b""), "it has a file '../patrol.yaml', which does not belong there"),
        (_change("/etc/passwd.yaml", b""), "it has a file '/etc/passwd.yaml', which does not belong there"),
        (
            _change("parts/../../a.yaml", b""),
            "it has a file 'parts/../../a.yaml', which does not belong there",
        ),
        (_change("lupin.yaml", b"allow: {}"), "it has a file 'lupin.yaml', which does not belong there"),
        (_change("bindings/run.py", b"1"), "it has a file 'bindings/run.py', which does not belong there"),
        (
            _change(MANIFEST, b"{"),
            "Expecting property name enclosed in double quotes: line 1 column 2 (char 1)",
        ),
        (_change("big.yaml", b" " * (MAX_BYTES + 1)), f"its files have more than {MAX_BYTES} bytes"),
        (
            lambda inside: inside.update({f"a{number}.yaml": b"" for number in range(MAX_FILES)}),
            f"it has {MAX_FILES + 4} files; at most {MAX_FILES} are read",
        ),
    ],
)
def test_an_archive_that_is_no_bundle_writes_nothing(folder: Path, change: Change, reason: str) -> None:
    """Names that lead elsewhere, too much of everything, and what is packed tightly to be large."""
    assert refused(altered(bundled(), change)) == f"patrol.lupin: this is no bundle: {reason}"
    assert main(["check", "patrol.lupin"]) == 2
    assert not (folder / "cache").exists()


def test_what_was_altered_is_named(folder: Path) -> None:
    """A file with other content, one more, and one less."""
    file = altered(bundled(), _change("patrol.yaml", b"mission: Other"))
    assert refused(file) == "patrol.lupin: altered since it was made: patrol.yaml"
    file = altered(bundled(), _change("bindings/other.yaml", b""))
    assert refused(file) == "patrol.lupin: altered since it was made: bindings/other.yaml"
    file = altered(bundled(), lambda inside: inside.__delitem__("lifecycle.yaml"))
    assert refused(file) == "patrol.lupin: altered since it was made: lifecycle.yaml"


def test_what_is_no_archive_is_told(folder: Path) -> None:
    """A text, one of another form, nothing at all, and a name with nothing behind it."""
    Path("text.lupin").write_text("mission: A")
    assert refused(Path("text.lupin")) == "text.lupin: this is no bundle: File is not a zip file"
    assert refused(Path("no.lupin")) == "no.lupin: this is no bundle: No such file or directory"
    file = altered(bundled(), lambda inside: inside.__delitem__(MANIFEST))
    assert refused(file) == "patrol.lupin: this is no bundle of form 1, as 'lupin bundle' writes it"
    file = altered(bundled(), _change(MANIFEST, b'{"bundle": 1}'))
    assert refused(file) == "patrol.lupin: its bundle.json does not name a mission and its files"


def test_no_flipped_byte_gets_through(folder: Path) -> None:
    """Whatever it is of: either the bundle says the same, or it is refused; never a traceback."""
    good = bundled("--sign", "ours.key").read_bytes()
    whole, file = read_bundle(Path("patrol.lupin")), Path("flipped.lupin")
    refusals = 0
    for at in range(0, len(good), 5):
        file.write_bytes(good[:at] + bytes([good[at] ^ (1 << at % 8)]) + good[at + 1 :])
        try:
            found = read_bundle(file)
            check_signed(found, Path("ours"))
        except UsageError:
            refusals += 1
        else:
            assert (found.files, found.hash) == (whole.files, whole.hash)
    assert refusals > len(good) / 10


# -- signatures ---------------------------------------------------------------------------------------------


def unsigned(file: Path, keys: str = "ours") -> str:
    """Return why a bundle does not count as signed."""
    with pytest.raises(UsageError) as problem:
        check_signed(read_bundle(file), Path(keys))
    return str(problem.value)


def test_who_has_signed_is_known(folder: Path) -> None:
    """By one of the public keys in a folder, or by the only one."""
    file = bundled("--sign", "ours.key")
    assert check_signed(read_bundle(file), Path("ours")) == "ours.pem"
    shutil.copy("theirs/theirs.pem", "ours")
    assert check_signed(read_bundle(file), Path("ours")) == "ours.pem"
    assert check_signed(read_bundle(file), Path("ours/ours.pem")) == "ours.pem"


def test_a_signature_that_does_not_count(folder: Path) -> None:
    """None, that of somebody else, one of other files, and one that is none."""
    assert unsigned(bundled()) == f"patrol.lupin: not signed; {HOW}"
    file = bundled("--sign", "theirs.key")
    assert unsigned(file) == f"patrol.lupin: signed by a key that is none of those in ours; {HOW}"
    file = bundled("--sign", "ours.key")
    told = json.loads(zipfile.ZipFile(file).read(MANIFEST))
    assert unsigned(altered(file, _change(MANIFEST, json.dumps({**told, "by": "me"}).encode()))) == (
        f"patrol.lupin: altered after it was signed with ours.pem; {HOW}"
    )
    for wrong in (b"ours", b"[]", b'{"key": 1}', b'{"key": "a", "signature": "xy"}'):
        file = altered(bundled("--sign", "ours.key"), _change("bundle.sig", wrong))
        assert unsigned(file) == f"patrol.lupin: its bundle.sig is no signature; {HOW}"


def test_keys_that_cannot_be_used(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With what to do about it; nothing is written."""
    openssl("genpkey", "-algorithm", "RSA", "-out", "rsa.key")
    openssl("genpkey", "-algorithm", "ed25519", "-aes256", "-pass", "pass:a", "-out", "locked.key")
    shutil.copy("ours.key", "open.key")
    Path("open.key").chmod(0o644)
    made = "openssl genpkey -algorithm ed25519 makes a key, openssl pkey -pubout its public one"
    for key, reason in (
        ("rsa.key", f"no Ed25519 private key without a password in PEM; {made}"),
        ("locked.key", f"no Ed25519 private key without a password in PEM; {made}"),
        ("open.key", "others can read this key; write: chmod 600 open.key"),
        ("no.key", "the key cannot be read: No such file or directory"),
    ):
        assert main(["bundle", "patrol", "--sign", key]) == 2
        assert capsys.readouterr().err == f"lupin: {key}: {reason}\n"
    assert not Path("patrol.lupin").exists()
    file = bundled("--sign", "ours.key")
    assert unsigned(file, "ours.key") == f"ours.key: no Ed25519 public key in PEM; {made}"
    assert unsigned(file, "missions") == "missions: no public key in this folder; they are files *.pem"


def test_a_bundle_is_used_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And is named as one."""
    file = bundled()
    assert main(["up", str(file), "inspection"]) == 2
    assert main(["bundle", "patrol", "-o", "patrol.zip"]) == 2
    assert capsys.readouterr().err == (
        "lupin: patrol.lupin: a bundle is used alone, without other missions\n"
        "lupin: --output: 'patrol.zip' must end in .lupin\n"
    )
