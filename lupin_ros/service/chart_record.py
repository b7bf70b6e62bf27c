"""Serializes the running chart to JSON, for displays on computers without its files."""

from __future__ import annotations

from typing import Any

from lupin_engine.diagram import ElementTexts, folded_svg
from lupin_engine.errors import LupinError, Place, reason, shortened
from lupin_engine.missions import LoadedMissions


def chart_record(loaded: LoadedMissions) -> dict[str, Any]:
    """Return a chart with its hash, and the source position of every state and transition; no picture yet.

    Files are named relative to the missions' folder. `id` is the picture's name of a state (`data-state`) or
    a transition (`data-transition`); refusals are not drawn.
    """
    chart, names = loaded.chart, loaded.short_names
    words = ElementTexts(chart)

    def where(place: Place) -> dict[str, Any]:
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


def chart_picture(loaded: LoadedMissions) -> dict[str, str]:
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
