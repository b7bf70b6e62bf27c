"""Invitations: one-time login codes for `lupin invite`, as files in the user's state folder.

Only a process that can write into that folder can invite: no topic, service or page leads there. Files hold
the hash of a code, never the code. Loads without ROS.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import secrets
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from lupin_engine.plugin import state_key, user_folder, write_atomically

#: Seconds that a code is good for.
GOOD_FOR_S = 600


def state_folder(domain: int | None = None, robot: str | None = None) -> Path:
    """Return the state folder of the gateway of a ROS domain and namespace, created if need be.

    None: this process's.

    Raises:
        UsageError: there is no such domain, or the user has no home folder.
        OSError: it cannot be created.
    """
    key = state_key(domain, robot)
    folder = user_folder("XDG_STATE_HOME", ".local/state") / (f"gateway-{key}" if key != "0" else "gateway")
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder


@dataclass(frozen=True)
class GatewayAddress:
    """Where the gateway of a robot listens, and its files of tokens and certificate ('': none).

    `base` stands before its paths, where it serves several robots.
    """

    host: str
    port: int
    tokens: str
    certificate: str
    base: str = ""

    @staticmethod
    def _file(folder: Path) -> Path:
        return folder / "doors.json"

    def keep(self, folder: Path) -> None:
        """Write it for `lupin invite`."""
        write_atomically(self._file(folder), json.dumps(asdict(self)).encode())

    @classmethod
    def read(cls, folder: Path) -> GatewayAddress | None:
        """Return the address that the folder's last gateway wrote; None where none can be read."""
        try:
            return cls(**json.loads(cls._file(folder).read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return None


class Invitations:
    """The codes of one gateway, each a file, good for `GOOD_FOR_S`; using one removes it, so once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "invitations"

    def invite(self, name: str, wall: float) -> str:
        """Return a new code for a person; `wall` is UNIX time in seconds."""
        self._folder.mkdir(mode=0o700, exist_ok=True)
        for old in self._old(wall):
            old.unlink(missing_ok=True)
        code = secrets.token_urlsafe(16)
        descriptor = os.open(self._of(code), os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            json.dump({"name": name, "until": wall + GOOD_FOR_S}, file)
        return code

    def use(self, code: str, wall: float) -> str:
        """Return the name of a code, and remove the code; '' where it is unknown, used or expired."""
        file = self._of(code)
        try:
            invited = json.loads(file.read_text(encoding="utf-8"))
            file.unlink()
            return str(invited["name"]) if wall < invited["until"] else ""
        except (OSError, ValueError, TypeError, KeyError):
            return ""

    def _of(self, code: str) -> Path:
        return self._folder / hashlib.sha256(code.encode()).hexdigest()

    def _old(self, wall: float) -> Iterator[Path]:
        for file in self._folder.iterdir():
            with contextlib.suppress(OSError):
                if file.stat().st_mtime < wall - GOOD_FOR_S:
                    yield file
