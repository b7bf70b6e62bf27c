"""Bundles: a mission as one file, with its chart, parts and bindings, and perhaps a signature.

A bundle is a ZIP file with `bundle.json` (name, version, the hash of the whole, the digest of each file), the
files of the folder of missions, and `bundle.sig`: a signature of `bundle.json`, by Ed25519. The robot's
permissions (`lupin.yaml`) are not in it. Opening a bundle executes nothing, and writes only below a folder of
the user's own.

Keys are PEM files as `openssl genpkey -algorithm ed25519` makes them. They are read by the package
`cryptography`, which is needed for signing and verifying only: `lupin-engine[sign]`.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import stat
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

from lupin_engine.bindings.catalog import LUPIN_FILE, lupin_file
from lupin_engine.errors import UsageError, shortened
from lupin_engine.plugin.files import user_folder, write_atomically

MANIFEST, SIGNATURE = "bundle.json", "bundle.sig"
#: The form of what is written; another one is refused.
FORMAT = 1
#: How many files a bundle may have, and how many bytes they.
MAX_FILES, MAX_BYTES = 200, 1_000_000
#: What a file may be called: nothing that leads out of the folder, or hides in it.
_NAME = re.compile(r"([a-z]+/)?\w[\w -]*\.yaml")
#: What a set of missions may be called, and its version: an integer, or one of semver.org.
_SET = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,79}")
_VERSION = re.compile(r"(\d{1,18})(?:\.(\d{1,18})\.(\d{1,18})(?:-([0-9A-Za-z.-]{1,40}))?)?")
_OWN = (MANIFEST, SIGNATURE)
_KEYS = "openssl genpkey -algorithm ed25519 makes a key, openssl pkey -pubout its public one"
_HOW = "a mission is signed with: lupin bundle MISSION --sign KEY"
#: What a damaged or hostile archive makes the reader raise.
_BROKEN = (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, ValueError, OSError)


@dataclass(frozen=True)
class Bundle:
    """The content of a bundle, which fits its digests. `mission` is the name of the mission's file.

    `name` is that of the set of missions, and `version` its own; older bundles have neither.
    """

    path: Path
    mission: str
    hash: str
    files: Mapping[str, bytes] = field(repr=False)
    manifest: bytes = field(repr=False)
    signature: bytes = field(repr=False, default=b"")
    name: str = ""
    version: str = ""


# -- writing ------------------------------------------------------------------------------------------------


def make_bundle(
    mission: str,
    chart_hash: str,
    files: Mapping[str, bytes],
    key: Path | None,
    name: str = "",
    version: str = "",
) -> bytes:
    """Return the bytes of a bundle; the same arguments make the same bundle.

    `files` are by their names in a folder of missions, and `mission` is one of them.

    Raises:
        UsageError: `read_bundle` would refuse it, or the key cannot be used.
    """
    wrong = [name for name in files if not _is_good(name)]
    if wrong:
        raise UsageError(
            f"a bundle cannot have a file {wrong[0]!r}: names are letters, digits, blanks, '_' and '-'"
        )
    digests = {name: hashlib.sha256(raw).hexdigest() for name, raw in sorted(files.items())}
    named = {"name": name, "version": version} if version else {}
    _check_named(named)
    if mission not in files:
        raise UsageError(f"no bundle can be made of {mission!r}: its file must stand beside the lifecycle")
    fields = {"bundle": FORMAT, "mission": mission, "hash": chart_hash, "files": digests, **named}
    manifest = json.dumps(fields, indent=1).encode()
    inside = {MANIFEST: manifest, **dict(sorted(files.items()))}
    if key is not None:
        inside[SIGNATURE] = _sign(manifest, key)
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, raw in inside.items():
            archive.writestr(zipfile.ZipInfo(name), raw, zipfile.ZIP_DEFLATED)
    try:
        _content(content)
    except ValueError as problem:
        raise UsageError(f"no bundle can be made of {mission!r}: {problem}") from None
    return content.getvalue()


def _check_named(fields: Mapping[str, Any]) -> None:
    """Raise UsageError where a bundle has a name or a version that it cannot have."""
    name, version = fields.get("name", ""), fields.get("version", "")
    if not (isinstance(name, str) and isinstance(version, str)) or bool(name) != bool(version):
        raise UsageError("a bundle has a name and a version, or neither")
    if name and not _SET.fullmatch(name):
        raise UsageError(f"name: {shortened(name)!r} is none; expected letters, digits, '_', '.' and '-'")
    if version:
        version_key(version)


def version_key(version: str) -> tuple[Any, ...]:
    """Return the sort key of a version: 7 is before 8, 1.2.0-rc.1 before 1.2.0.

    Raises:
        UsageError: it is no version.
    """
    found = _VERSION.fullmatch(version)
    if found is None:
        raise UsageError(f"version: {shortened(version)!r} is none; expected an integer, or one like 1.2.3")
    before = found[4]
    parts = [(not p.isdecimal(), int(p) if p.isdecimal() else 0, p) for p in (before or "").split(".")]
    return *(int(number or 0) for number in found.groups()[:3]), before is None, parts


# -- reading ------------------------------------------------------------------------------------------------


def read_bundle(path: Path) -> Bundle:
    """Read a bundle, and verify its digests.

    Raises:
        UsageError: it cannot be read, or has a wrong content.
    """
    try:
        with path.open("rb") as file:
            inside = _content(file)
        manifest = inside.pop(MANIFEST, b"null")
        fields = json.loads(manifest)
    except _BROKEN as problem:
        reason = problem.strerror if isinstance(problem, OSError) else str(problem)
        raise UsageError(f"{path}: this is no bundle: {reason or type(problem).__name__}") from None
    signature = inside.pop(SIGNATURE, b"")
    if not isinstance(fields, dict) or fields.get("bundle") != FORMAT:
        raise UsageError(f"{path}: this is no bundle of form {FORMAT}, as 'lupin bundle' writes it")
    digests, mission = fields.get("files"), fields.get("mission")
    if not isinstance(digests, dict) or mission not in digests:
        raise UsageError(f"{path}: its {MANIFEST} does not name a mission and its files")
    found = {name: hashlib.sha256(raw).hexdigest() for name, raw in inside.items()}
    altered = sorted(name for name in {*digests, *found} if digests.get(name) != found.get(name))
    if altered:
        raise UsageError(f"{path}: altered since it was made: {', '.join(altered)}")
    try:
        _check_named(fields)
    except UsageError as problem:
        raise UsageError(f"{path}: {problem}") from None
    named = fields.get("name", ""), fields.get("version", "")
    return Bundle(path, str(mission), str(fields.get("hash")), inside, manifest, signature, *named)


def _content(file: BinaryIO) -> dict[str, bytes]:
    """Return the files of an archive; ValueError for a forbidden content, before it is unpacked."""
    size = file.seek(0, io.SEEK_END)
    if size > MAX_BYTES:
        raise ValueError(f"it has {size} bytes; at most {MAX_BYTES} are read")
    with zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        if len(entries) > MAX_FILES:
            raise ValueError(f"it has {len(entries)} files; at most {MAX_FILES} are read")
        found: dict[str, bytes] = {}
        left = MAX_BYTES
        for entry in entries:
            if entry.filename in found or not (_is_good(entry.filename) or entry.filename in _OWN):
                raise ValueError(f"it has a file {shortened(entry.filename)!r}, which does not belong there")
            if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise ValueError(f"{entry.filename} is packed in an unusual way")
            with archive.open(entry) as packed:
                raw = packed.read(left + 1)  # whatever the entry says of its size
            left -= len(raw)
            if left < 0:
                raise ValueError(f"its files have more than {MAX_BYTES} bytes")
            found[entry.filename] = raw
    return found


def _is_good(name: str) -> bool:
    return _NAME.fullmatch(name) is not None and Path(name).name != LUPIN_FILE


def unpack(bundle: Bundle) -> Path:
    """Write the files of a bundle into a folder of the user's own, and return that of its mission.

    The `lupin.yaml` that counts is that of the bundle's place.

    Raises:
        UsageError: they cannot be written.
    """
    place = bundle.path.resolve()
    name = hashlib.sha256(bundle.manifest + str(place).encode()).hexdigest()[:16]
    above = user_folder("XDG_CACHE_HOME", ".cache") / "bundles" / name
    folder = above / "missions"
    try:
        above.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        link, allowed = above / LUPIN_FILE, lupin_file(place.parent)
        if not link.is_symlink() or link.readlink() != allowed:
            link.unlink(missing_ok=True)
            link.symlink_to(allowed)
        for file, raw in bundle.files.items():
            target = folder / file
            if not target.is_file() or target.read_bytes() != raw:
                target.parent.mkdir(mode=0o700, exist_ok=True)
                write_atomically(target, raw)
    except OSError as problem:
        raise UsageError(f"{bundle.path}: cannot be unpacked into {above}: {problem.strerror}") from None
    return folder / bundle.mission


# -- signatures ---------------------------------------------------------------------------------------------


def check_signed(bundle: Bundle, keys: Path) -> str:
    """Return the name of the file whose key has signed a bundle; `keys` is a public key or a folder of some.

    Raises:
        UsageError: it has no signature, or of another key, was altered, or the keys cannot be read.
    """
    if not bundle.signature:
        raise UsageError(f"{bundle.path}: not signed; {_HOW}")
    known = {_fingerprint(key): (file, key) for file, key in _public_keys(keys).items()}
    try:
        fields = json.loads(bundle.signature)
        signer, signature = str(fields["key"]), bytes.fromhex(fields["signature"])
    except (ValueError, TypeError, LookupError):
        raise UsageError(f"{bundle.path}: its {SIGNATURE} is no signature; {_HOW}") from None
    if signer not in known:
        raise UsageError(f"{bundle.path}: signed by a key that is none of those in {keys}; {_HOW}")
    file, key = known[signer]
    if not _fits(key, signature, bundle.manifest):
        raise UsageError(f"{bundle.path}: altered after it was signed with {file.name}; {_HOW}")
    return file.name


def signer_of(bundle: Bundle) -> str:
    """Return the fingerprint of a bundle's key; its signature must be good."""
    return str(json.loads(bundle.signature)["key"])


def _sign(manifest: bytes, file: Path) -> bytes:
    """Return the content of `bundle.sig`."""
    key = _read_key(file, private=True)
    fields = {"key": _fingerprint(key.public_key()), "signature": key.sign(manifest).hex()}
    return json.dumps(fields).encode()


def _fits(key: Any, signature: bytes, manifest: bytes) -> bool:
    from cryptography.exceptions import InvalidSignature

    try:
        key.verify(signature, manifest)
    except InvalidSignature:
        return False
    return True


def _public_keys(keys: Path) -> dict[Path, Any]:
    files = sorted(keys.glob("*.pem")) if keys.is_dir() else [keys]
    if not files:
        raise UsageError(f"{keys}: no public key in this folder; they are files *.pem")
    return {file: _read_key(file, private=False) for file in files}


def _read_key(file: Path, *, private: bool) -> Any:
    """Read a PEM file with an Ed25519 key.

    Raises:
        UsageError: it cannot be used.
    """
    try:
        from cryptography.exceptions import UnsupportedAlgorithm
        from cryptography.hazmat.primitives import serialization
        from cryptography.hazmat.primitives.asymmetric import ed25519
    except ImportError:
        needed = "keys need the package cryptography: pip install 'lupin-engine[sign]'"
        raise UsageError(f"{file}: {needed}") from None
    kind: type[Any] = ed25519.Ed25519PrivateKey if private else ed25519.Ed25519PublicKey
    try:
        if private and file.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise UsageError(f"{file}: others can read this key; write: chmod 600 {file}")
        raw = file.read_bytes()
        key = (
            serialization.load_pem_private_key(raw, None)
            if private
            else serialization.load_pem_public_key(raw)
        )
    except OSError as problem:
        raise UsageError(f"{file}: the key cannot be read: {problem.strerror}") from None
    except (ValueError, TypeError, UnsupportedAlgorithm):  # TypeError: it has a password
        key = None
    if not isinstance(key, kind):
        what = "private key without a password" if private else "public key"
        raise UsageError(f"{file}: no Ed25519 {what} in PEM; {_KEYS}")
    return key


def _fingerprint(key: Any) -> str:
    """Return the fingerprint of a public key."""
    return hashlib.sha256(key.public_bytes_raw()).hexdigest()
