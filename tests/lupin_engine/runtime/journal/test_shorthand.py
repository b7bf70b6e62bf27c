"""Short records: whatever is left out is what the reader knows."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from lupin_engine.machine.event import CODE_REPORTED, Event, progress
from lupin_engine.runtime.journal.records import JournalRecord
from lupin_engine.runtime.journal.shorthand import SHORT_VALUE, Shorthand, progress_of

PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
DATA = PLAIN | st.lists(PLAIN) | st.dictionaries(st.text(), PLAIN)
TIMES = st.floats(0.0, 1e9) | st.integers(0, 10**15).map(lambda micros: round(micros * 1e-6, 6))
VALUES = st.builds(
    lambda name, value, stamp: Event("value", {"name": name, "value": value, "stamp": stamp}),
    st.sampled_from(["a.b", "c.d", "e"]),
    DATA,
    TIMES,
)
EVENTS = st.lists(st.tuples(TIMES, VALUES | st.builds(progress, st.text(), st.text())))


def value(number: Any, stamp: float = 1.0) -> Event:
    return Event("value", {"name": "robot.estop", "value": number, "stamp": stamp})


@given(EVENTS)
def test_what_is_read_is_what_was_written(events: list[tuple[float, Event]]) -> None:
    """To the last digit, and of the same type: 1 is not 1.0, and false is not 0."""
    writer, reader = Shorthand(), Shorthand()
    for now, event in events:
        written = writer.written(now, event)
        assert written is not None
        kind, time, *data = json.loads(json.dumps(written))
        assert repr(reader.read_time(time)) == repr(now)
        if kind == SHORT_VALUE:
            found = reader.read_value(now, data)
            read = Event("value", dict(zip(("name", "value", "stamp"), found, strict=True)))
        else:
            read = Event(*progress_of(data))
        assert repr((read.name, dict(read.data))) == repr((event.name, dict(event.data)))
        writer.time = reader.time = now


def test_what_is_the_same_as_before_is_left_out() -> None:
    """Of plain values only; the name is written once."""
    short = Shorthand()
    assert short.written(1.5, value(False)) == ("v", 1_500_000, "robot.estop", 500_000, False)
    short.time = 1.5
    assert short.written(1.6, value(False, 1.6)) == ("v", 100_000, 0, 0)
    assert short.written(1.6, value(0, 1.6)) == ("v", 100_000, 0, 0, 0)
    assert short.written(1.6, value([1], 1.6)) == ("v", 100_000, 0, 0, [1])
    assert short.written(1.6, value([1], 1.6)) == ("v", 100_000, 0, 0, [1])
    assert short.written(1.6, value([1], 1.0000001)) == ("v", 100_000, 0, None, [1], 1.0000001)
    assert short.written(1.50000001, value([1], 1.5)) == ("v", 1.50000001, 0, 0, [1])


def test_what_has_no_short_form() -> None:
    """Other events, and values with more or less than a value has."""
    short = Shorthand()
    assert short.written(1.0, Event("operator.pause")) is None
    assert short.written(1.0, Event("value", {"name": "a", "value": 1})) is None
    assert short.written(1.0, Event("attempt.progress", {"attempt": "a1"})) is None


def test_an_event_of_an_earlier_version_has_its_name_of_today() -> None:
    """What `engine.told` was is `engine.reported`."""
    record = JournalRecord(1, "event", 0.0, 0.0, ("engine.told", {"code": "late", "detail": ""}), 9)
    assert record.event == Event(CODE_REPORTED, {"code": "late", "detail": ""})
