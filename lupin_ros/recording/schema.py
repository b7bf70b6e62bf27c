"""The definition of a message as one text, with those of all messages inside of it (`ros2msg`).

That is how MCAP and rosbag2 keep it, so that whoever reads a recording needs no package of ours.
"""

from __future__ import annotations

from collections.abc import Iterator

from lupin_ros.interfaces.type_hashes import local_fields, local_source

#: Stands between the definitions of two messages.
_SEPARATOR = "=" * 80


def message_text(type_name: str) -> str:
    """Return the definition of a message and, below it, of each message that is inside of it.

    Raises:
        UsageError: one of them is not installed.
    """
    inside = dict.fromkeys(_inside(type_name))
    parts = [local_source(type_name), *(f"MSG: {_short(name)}\n{local_source(name)}" for name in inside)]
    return f"\n{_SEPARATOR}\n".join(part.rstrip("\n") for part in parts)


def _inside(type_name: str) -> Iterator[str]:
    """Yield the messages inside of one, each before what is inside of it."""
    for _, kind in local_fields(type_name):
        nested = str(kind.get("nested_type_name") or "")
        if nested:
            yield nested
            yield from _inside(nested)


def _short(type_name: str) -> str:
    package, _, name = type_name.split("/")
    return f"{package}/{name}"
