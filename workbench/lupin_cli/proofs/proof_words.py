"""The words that the terminal, the report and the findings share about a proof."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from lupin_engine.chart import Chart
from lupin_engine.errors import Place
from lupin_engine.missions import LoadedMissions
from lupin_verify import Proof, Proven, Unreached, is_own


def exemptions(chart: Chart) -> Iterator[tuple[str, str, str]]:
    """Yield each property that is not meant of a mission, with the mission and the reason."""
    for rule in chart.properties.values():
        yield from ((rule.name, mission, why) for mission, why in rule.not_meant.items())


def name_of(loaded: LoadedMissions, varied: str) -> str:
    """Return the name of a proof: its mission, and `varied`, the parameter that is not as given, if any."""
    return f"{loaded.names[0]}{f' with {varied}' if varied else ''}"


def result(proof: Proof) -> str:
    """Return the verdict of a proof in a few words."""
    grows = f"; {proof.growth}" if proof.growth and str(proof.growth) != proof.stopped else ""
    unfinished = f", and not all was explored: {proof.stopped}{grows}" if proof.stopped else ""
    if proof.broken or proof.not_shown:
        verdicts = {"broken": len(proof.broken), "not shown": len(proof.not_shown)}
        first, *rest = [f"{number:,} {word}" for word, number in verdicts.items() if number]
        number, _, word = first.partition(" ")
        of = f"{number} of {counted(len(proof.properties), 'property')} {word}"
        return f"{', '.join((of, *rest))}{unfinished}"
    if not proof.complete:
        return f"not proven: {proof.stopped}{grows}"
    return f"proven for {', '.join(proof.cut)}" if proof.cut else "proven"


def summary(proof: Proof) -> str:
    """Return the verdict of a proof, with its warnings counted."""
    unused = len(proof.never_applied)
    parts = [
        result(proof),
        f"{unused:,} of your properties never applied" if unused else "",
        _never_reached(proof),
        "not all values were tried" if proof.untried and not result(proof).startswith("proven") else "",
    ]
    return "; ".join(filter(None, parts))


def last_line(proof: Proof) -> str:
    """Return the verdict of a proof, and the size of its exploration."""
    progress = proof.progress
    seen = f"{counted(progress.situations, 'situation')}, {counted(progress.transitions, 'transition')}"
    deep = (
        f", up to {counted(progress.depth, 'move')} deep"
        if proof.complete and not (proof.broken or proof.not_shown)
        else ""
    )
    left = deep if proof.complete else f", {progress.waiting:,} still to explore"
    return f"{summary(proof)}; {seen}{left}"


def tried_only(proof: Proof, one: Proven) -> str:
    """Return what limits an author's own property that holds: not all values were tried; else ''."""
    is_limited = proof.untried and one.verdict is one.verdict.HOLDS and is_own(proof.chart, one.name)
    return " (for the values that were tried)" if is_limited else ""


def _never_reached(proof: Proof) -> str:
    """Return how much of the missions was never reached, and of their lifecycle; '' if all was."""
    lifecycle: dict[str, list[Unreached]] = {}
    for part in proof.dead:
        if part.place.file in proof.chart.lifecycle_files:
            lifecycle.setdefault(proof.chart.file_of(part.place), []).append(part)
    own = [part for part in proof.dead if part.place.file not in proof.chart.lifecycle_files]
    parts = [_counted_dead(own), *(f"of {name} {_counted_dead(dead)}" for name, dead in lifecycle.items())]
    return "; ".join(filter(None, parts))


def _counted_dead(dead: Sequence[Unreached]) -> str:
    """Return how many states were never entered, and how many transitions never taken; '' for none."""
    states = sum(part.is_state for part in dead)
    more = "more transition" if states else "transition"
    parts = [
        f"{counted(states, 'state')} never entered" if states else "",
        f"{counted(len(dead) - states, more)} never taken" if len(dead) > states else "",
    ]
    return ", ".join(filter(None, parts))


def shown_place(loaded: LoadedMissions, place: Place) -> str:
    """Return a place in few characters: as it is below this folder, else below that of the missions.

    A file below neither keeps its full name.
    """
    near = Path(place.shown)
    file = loaded.short_names.get(place.file)
    return place.shown if file is None or not near.is_absolute() else f"{file}:{place.line}:{place.column}"


def counted(number: int, what: str) -> str:
    """Return `3,416 situations`, `1 situation`, `18 properties`; `what` is the singular."""
    several = f"{what[:-1]}ies" if what.endswith("y") else f"{what}s"
    return f"{number:,} {what if number == 1 else several}"
