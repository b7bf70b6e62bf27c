"""Builds the definition of a message with those of all nested messages as one text (`ros2msg`).

MCAP and rosbag2 store it, so that a recording can be read without its message packages.
"""

from __future__ import annotations

from collections.abc import Iterator

from lupin_ros.interfaces.type_hashes import local_fields, local_source

#: Stands between the definitions of two messages.
_SEPARATOR = "=" * 80


def message_text(type_name: str) -> str:
    """Return the definition of a message and, below it, of each nested message.

    Raises:
        UsageError: one of them is not installed.
    """
    inside = dict.fromkeys(_inside(type_name))
    parts = [local_source(type_name), *(f"MSG: {_short(name)}\n{local_source(name)}" for name in inside)]
    return f"\n{_SEPARATOR}\n".join(part.rstrip("\n") for part in parts)


def _inside(type_name: str) -> Iterator[str]:
    """Yield the nested messages at every depth, each before those inside it; one may come several times."""
    for _, kind in local_fields(type_name):
        nested = str(kind.get("nested_type_name") or "")
        if nested:
            yield nested
            yield from _inside(nested)


def _short(type_name: str) -> str:
    package, _, name = type_name.split("/")
    return f"{package}/{name}"
