"""The default path of the store."""

from __future__ import annotations

import os

from lupin_engine.plugin import ros_domain, user_folder


def store_path(given: str = "", domain: int | None = None) -> str:
    """Return the path of the store: the given one, else a file in the user's state folder.

    One for each ROS domain, because a domain is a greenhouse with one twin: `twin.sqlite` in domain 0 and
    `twin-42.sqlite` in domain 42. Without `domain` it is that of this process.

    Raises:
        UsageError: none is given, and there is no such domain or no home folder.
    """
    if given:
        return os.path.expanduser(given)
    domain = ros_domain() if domain is None else domain
    suffix = f"-{domain}" if domain else ""
    return str(user_folder("XDG_STATE_HOME", ".local/state") / f"twin{suffix}.sqlite")
