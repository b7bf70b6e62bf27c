"""Serializes the running chart to JSON, for displays on computers without its files."""

from __future__ import annotations

from typing import TypedDict

from lupin_engine.diagram import ElementTexts, folded_svg
from lupin_engine.errors import LupinError, Place, reason, shortened
from lupin_engine.missions import LoadedMissions


class PlaceRecord(TypedDict):
    """A line of a file, which is named as in the folder of the missions."""

    file: str
    line: int


class StateRecord(PlaceRecord):
    """A state; `id` is its name in the picture (`data-state`)."""

    id: str
    summary: str


class TransitionRecord(PlaceRecord):
    """A transition; its id is in the picture as well (`data-transition`).

    One that refuses is not drawn: `refuse` is the code that it refuses a request with.
    """

    state: str
    target: str
    label: str
    refuse: str


class PictureRecord(TypedDict):
    """The picture of a chart; "" while it is drawn, and where it cannot be: then `problem` says why."""

    svg: str
    problem: str


class ChartContent(PictureRecord):
    """A chart: its states by full name, its transitions by id, and the text of its files."""

    hash: str
    missions: list[str]
    states: dict[str, StateRecord]
    transitions: dict[str, TransitionRecord]
    files: dict[str, str]


class ChartRecord(ChartContent):
    """A chart as an orchestrator publishes it; `boot` names its start."""

    boot: str


def chart_record(loaded: LoadedMissions) -> ChartContent:
    """Return a chart with the place of every state and transition in its files; no picture yet."""
    chart, names = loaded.chart, loaded.short_names
    words = ElementTexts(chart)

    def where(place: Place) -> PlaceRecord:
        return {"file": names[place.file], "line": place.line}

    states = [state for name, state in chart.states.items() if name]
    rules = [rule for state in chart.states.values() for rule in (*state.transitions, *state.resume_at)]
    return {
        "hash": loaded.hash,
        "missions": list(loaded.names),
        "svg": "",
        "problem": "",
        "states": {
            state.name: {"id": state.name, "summary": state.summary, **where(state.place)} for state in states
        },
        "transitions": {
            rule.id: {
                "state": rule.source,
                "target": rule.target or "",
                "label": f"{words.label(rule)}",
                "refuse": rule.refuse or "",
                **where(rule.place),
            }
            for rule in rules
        },
        "files": {names[name]: raw.decode(errors="replace") for name, raw in loaded.sources.items()},
    }


def chart_picture(loaded: LoadedMissions) -> PictureRecord:
    """Return the picture's part of the record; for a large chart that may take a minute.

    If the chart cannot be drawn, `svg` is empty and `problem` says why: the other data is of use without it.
    """
    try:
        return {"svg": folded_svg(loaded.chart, frozenset()), "problem": ""}
    except Exception as raised:
        return {"svg": "", "problem": f"the chart cannot be drawn: {reason(raised)}"}


def check_chart(asked: str, loaded: LoadedMissions) -> None:
    """Check that a request's chart, by its hash, is the one that runs; '' is whichever runs.

    Raises:
        LupinError: it is another one.
    """
    if asked not in ("", loaded.hash):
        raise LupinError(f"another chart runs: {loaded.hash}, not {shortened(asked)!r}; read ~/chart again")
