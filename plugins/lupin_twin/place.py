"""Where the store is when nobody says otherwise."""

from __future__ import annotations

import os

from lupin_engine.plugin.files import user_folder


def store_path(given: str = "") -> str:
    """Return the path of the store: the given one, else a file in the user's state folder.

    One for each ROS domain, because a domain is a greenhouse with one twin: `twin.sqlite` in domain 0 and
    `twin-42.sqlite` in domain 42.
    """
    if given:
        return os.path.expanduser(given)
    domain = os.environ.get("ROS_DOMAIN_ID", "").strip()
    suffix = f"-{int(domain)}" if domain.isdecimal() and int(domain) else ""
    return str(user_folder("XDG_STATE_HOME", ".local/state") / f"twin{suffix}.sqlite")
