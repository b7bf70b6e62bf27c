"""Records in a file: whatever is cut off or changed, nothing is read that was not written."""

from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from lupin_engine.runtime.journal.frames import MAGIC, frame, read_frames

CONTENTS = [json.dumps(["event", number, "x" * number]).encode() for number in range(12)]
FILE = MAGIC + b"".join(map(frame, CONTENTS))
ENDS = [len(MAGIC + b"".join(map(frame, CONTENTS[: number + 1]))) for number in range(len(CONTENTS))]


def test_what_was_written_is_read() -> None:
    """All of it, and where each record ends."""
    found = read_frames(FILE)
    assert (found.contents, found.ends) == (CONTENTS, ENDS)
    assert (found.good, found.torn, found.damaged) == (len(FILE), 0, False)


def test_a_file_that_ends_anywhere_has_a_torn_tail() -> None:
    """At every byte: the whole records before it are good, the rest is told, and is no damage."""
    for size in range(len(FILE)):
        found = read_frames(FILE[:size])
        whole = [end for end in ENDS if end <= size]
        assert found.contents == CONTENTS[: len(whole)]
        assert found.good + found.torn == size
        assert not found.damaged


@given(st.integers(0, len(FILE) - 1), st.integers(1, 255))
def test_a_changed_byte_is_never_read_as_good(place: int, change: int) -> None:
    """What comes before it is; what comes after it counts as damaged, unless it was the last record."""
    data = bytearray(FILE)
    data[place] ^= change
    found = read_frames(bytes(data))
    intact = len([end for end in ENDS if end <= place]) if place >= len(MAGIC) else 0
    assert found.contents == CONTENTS[:intact]
    assert found.damaged == (intact < len(CONTENTS) - 1)


def test_zeros_at_the_end_are_torn() -> None:
    """What a power cut leaves where a file had grown and its content had not been written."""
    found = read_frames(FILE + bytes(4096))
    assert (found.contents, found.torn, found.damaged) == (CONTENTS, 4096, False)
