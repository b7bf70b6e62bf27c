"""How large a message may be: reading one holds the thread on which a stop waits for its turn.

rclpy makes Python objects of a whole message before anybody can look at it. That takes about 20 us for each
message or text in a list, and 0.6 ms for a megabyte of numbers or of one text. Lists and texts have no bound
on the wire, so the bytes are counted before they are read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

#: Of messages with a list of messages or texts, in bytes: 550 discovered tags, 10 ms.
OBJECT_BYTES = 49_152
#: Of messages with one text or with lists of numbers, in bytes: a map of 8 million cells, 5 ms.
FLAT_BYTES = 8_388_608

_NUMBER = re.compile(r"u?int\d+|float|double|boolean|octet|byte|char")


@cache
def most_bytes(kind: Any) -> int | None:
    """Return how many bytes a message of a kind may have; None for one that has no list and no text."""
    elements = list(_unbounded(kind()))
    if not elements:
        return None
    return FLAT_BYTES if all(map(_NUMBER.fullmatch, filter(None, elements))) else OBJECT_BYTES


def _unbounded(message: Any) -> Iterator[str]:
    """Yield the type of the elements of each list in a message, and '' for each text."""
    for name, declared in message.get_fields_and_field_types().items():
        if declared.startswith("sequence<"):
            yield declared.removeprefix("sequence<").partition(">")[0].partition(",")[0]
        elif declared in ("string", "wstring"):
            yield ""
        elif hasattr(value := getattr(message, name), "get_fields_and_field_types"):
            yield from _unbounded(value)
