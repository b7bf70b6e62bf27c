"""The default path of the store."""

from __future__ import annotations

import os

from lupin_engine.plugin import state_key, user_folder


def store_path(given: str = "", domain: int | None = None, robot: str | None = None) -> str:
    """Return the path of the store: the given one, else a file in the user's state folder.

    One for each twin, which is the only one of its namespace: `twin.sqlite` in domain 0, `twin-42.sqlite` in
    domain 42, `twin-42-robot2.sqlite` in its namespace `/robot2`. Domain and namespace `robot` are by default
    this process's.

    Raises:
        UsageError: none is given, and there is no such domain or no home folder.
    """
    if given:
        return os.path.expanduser(given)
    key = state_key(domain, robot)
    suffix = f"-{key}" if key != "0" else ""
    return str(user_folder("XDG_STATE_HOME", ".local/state") / f"twin{suffix}.sqlite")
