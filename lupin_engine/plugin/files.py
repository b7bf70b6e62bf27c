"""The user's folders (XDG), and atomic writes."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from lupin_engine.errors import UsageError
from lupin_engine.plugin.domain import DOMAIN, domain_number


def user_folder(variable: str, otherwise: str, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the engine's folder below one of the user's, by the XDG Base Directory Specification.

    `variable` names the folder, such as XDG_STATE_HOME; `otherwise` is its default, below the home. A
    relative one is ignored, as the specification says.

    Raises:
        UsageError: it is not set, and this user has no home.
    """
    base = environment.get(variable, "")
    return (Path(base) if Path(base).is_absolute() else _home(variable) / otherwise) / "lupin"


def ros_domain(environment: Mapping[str, str] = os.environ) -> int:
    """Return the ROS domain of this process, of which some files have one each; 0 where none is set.

    Raises:
        UsageError: there is no such domain.
    """
    return read_domain(environment.get(DOMAIN, "").strip() or "0", DOMAIN)


def read_domain(text: str, said: str = "--domain") -> int:
    """Read the number of a ROS domain, as an option has it, or what else `said` names.

    Raises:
        UsageError: there is no such domain.
    """
    try:
        return domain_number(text, said)
    except ValueError as problem:
        raise UsageError(str(problem)) from None


def _home(variable: str) -> Path:
    try:
        return Path.home()
    except RuntimeError:  # for example an unknown user id in a container
        raise UsageError(f"this user has no home folder; set {variable} to an absolute path") from None


def write_atomically(path: Path, content: bytes) -> None:
    """Replace a file atomically: readers, also after a power cut, find the old content or the new one.

    An existing file keeps its permissions; a link is followed.

    Raises:
        OSError: it could not be written; the old content is still there, and no other file is left.
    """
    target = path.resolve()
    descriptor, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".new", dir=target.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            os.fchmod(file.fileno(), _mode(target))
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(name, target)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise


def _mode(target: Path) -> int:
    """Return the permissions of a file that is there, else those that `open` would give it."""
    try:
        return target.stat().st_mode & 0o777
    except FileNotFoundError:
        mask = os.umask(0)
        os.umask(mask)
        return 0o666 & ~mask
