"""Rollback protection: the signed bundles that a robot has run; older versions and other sets are refused.

A signature does not expire, so an old bundle could replace a newer one. The newest version of each name is
stored for each key, in the user's state folder, also over a restart.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from lupin_engine.errors import LupinError, UsageError
from lupin_engine.missions.bundle import Bundle, signer_of, version_key
from lupin_engine.plugin.files import user_folder, write_atomically

#: What `allow_bundles` says for bundles without a name.
UNNAMED = "unnamed"


def seen_file() -> Path:
    """Return the file of this user; UsageError where the user has no home folder."""
    return user_folder("XDG_STATE_HOME", ".local/state") / "bundles.json"


@dataclass(frozen=True)
class SeenBundles:
    """The versions stored in `file`.

    `allowed` admits a new NAME, an older NAME@VERSION, or `unnamed` bundles.
    """

    file: Path
    allowed: Collection[str] = ()

    def check(self, bundle: Bundle) -> str:
        """Return a warning about a bundle without a name, else ''. For bundles whose signature is good.

        Raises:
            LupinError: a newer one, or only other ones, of its key were run, or the file cannot be read.
        """
        known = self._read().get(signer_of(bundle), {})
        if not bundle.name:
            if known and UNNAMED not in self.allowed:
                seen = ", ".join(f"{name} {version}" for name, version in sorted(known.items()))
                raise LupinError(
                    f"{bundle.path}: without a version, but of its key {seen} was run here; make it with "
                    f"'lupin bundle MISSION --sign KEY --version N', or set allow_bundles:=['{UNNAMED}']"
                )
            return (
                f"{bundle.path}: without a version, so an older one in its place would not be noticed; "
                "make it with 'lupin bundle MISSION --sign KEY --version N'"
            )
        exact = f"{bundle.name}@{bundle.version}"
        newest = known.get(bundle.name)
        if newest is None:
            if known and not {bundle.name, exact} & {*self.allowed}:
                raise LupinError(
                    f"{bundle.path}: it is {bundle.name!r}, but of its key only {', '.join(sorted(known))} "
                    f"was run here; if that is meant, set allow_bundles:=['{bundle.name}']"
                )
        elif version_key(bundle.version) < version_key(newest) and exact not in self.allowed:
            raise LupinError(
                f"{bundle.path}: it is {bundle.name} {bundle.version}, but {newest} was run here already; "
                f"if that is meant, set allow_bundles:=['{exact}']"
            )
        return ""

    def remember(self, bundle: Bundle) -> None:
        """Store the version of a bundle that is run, where it has a name and is newer.

        Raises:
            LupinError: the file cannot be read or written.
        """
        if not bundle.name:
            return
        every = self._read()
        known = every.setdefault(signer_of(bundle), {})
        newest = known.get(bundle.name)
        if newest is not None and version_key(newest) >= version_key(bundle.version):
            return
        known[bundle.name] = bundle.version
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(self.file, json.dumps(every, indent=1, sort_keys=True).encode())
        except OSError as problem:
            raise LupinError(
                f"{self.file} cannot be written: {problem.strerror}; it remembers which bundles were run"
            ) from None

    def _read(self) -> dict[str, dict[str, str]]:
        try:
            found = json.loads(self.file.read_bytes())
            for versions in found.values():
                for version in versions.values():
                    version_key(version)
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, TypeError, AttributeError, RecursionError, UsageError):
            raise LupinError(
                f"{self.file} cannot be read: it remembers which signed bundles were run; repair it, or "
                "remove it to begin anew"
            ) from None
        return found  # type: ignore[no-any-return]
