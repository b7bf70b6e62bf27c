"""Compares expectations about the order of states and phases: sequences, each followed by another, never."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from lupin_engine.machine.step import Step
from lupin_engine.plugin.types import DURATION, convert
from lupin_engine.sim.failure import FailureMaker, ScenarioFailure
from lupin_engine.sim.scenario_file import ExpectNode, LeadsNode, NeverNode, PassNode
from lupin_engine.sim.simulation import Run, is_named

#: A state that was entered, with the step that did it.
Entry = tuple[Step, str]

#: So that 26.1 s of sums of tenths is 26.1 s.
ROUNDING = 1e-6


def seconds(duration: Any) -> float | None:
    """Return a duration as it was written in seconds; None when none was."""
    return None if duration is None else float(convert(duration, DURATION))


class OrderComparison:
    """Compares the order of entries in a run with the expectations."""

    def __init__(self, expect: ExpectNode, run: Run, maker: FailureMaker) -> None:
        self._expect, self._run, self._maker = expect, run, maker
        self._entered: list[Entry] = run.history.entered

    def failures(self) -> Iterator[ScenarioFailure]:
        """Yield the differences."""
        yield from self._phases()
        yield from self._passes()
        yield from self._leads()
        yield from self._never()

    def _phases(self) -> Iterator[ScenarioFailure]:
        wanted, reached, last = self._expect.phases, 0, None
        for step, phase in self._run.history.phases if wanted else ():
            if reached < len(wanted) and phase == wanted[reached]:
                reached, last = reached + 1, step
        if reached == len(wanted):
            return
        actual = [phase for _, phase in self._run.history.phases if phase]
        states = [state.name for state in self._run.chart.states.values() if state.phase == wanted[reached]]
        what = f"phases: {wanted[reached]} is not published{_after(wanted, reached)}"
        place = self._expect.at("phases", reached)
        yield self._maker.failure(place, what, wanted, actual, last, states[:1])

    # -- in this order ----------------------------------------------------------------------------------

    def _passes(self) -> Iterator[ScenarioFailure]:
        """Search an entry of each state after one of the state before, within its time limits."""
        before = [-1]
        for number, node in enumerate(self._expect.passes):
            found = self._entries(node, before)
            if not found:
                yield self._not_passed(number, before)
                return
            before = found

    def _entries(self, node: PassNode, before: list[int]) -> list[int]:
        """Return the numbers of the entries that can follow one of those before."""
        named = (
            n for n in range(before[0] + 1, len(self._entered)) if is_named(self._entered[n][1], node.state)
        )
        if not _limits(node):
            return list(named)
        return [n for n in named if any(self._is_in_time(node, earlier, n) for earlier in before)]

    def _is_in_time(self, node: PassNode, earlier: int, number: int) -> bool:
        time = self._entered[number][0].time
        since = time - (self._entered[earlier][0].time if earlier >= 0 else 0.0)
        at_least, within, by = map(seconds, (node.at_least, node.within, node.by))
        return (
            earlier < number
            and (at_least is None or since >= at_least - ROUNDING)
            and (within is None or since <= within + ROUNDING)
            and (by is None or time <= by + ROUNDING)
        )

    def _not_passed(self, number: int, before: list[int]) -> ScenarioFailure:
        """Return the failure of a state that is not entered, or at a wrong time."""
        nodes = self._expect.passes
        node, names = nodes[number], [one.state for one in nodes]
        place, states = self._expect.at("passes", number), self._maker.called(node.state)
        last = self._entered[before[0]][0] if before[0] >= 0 else None
        late = [step for step, name in self._entered[before[0] + 1 :] if is_named(name, node.state)]
        what = f"passes: {node.state} is not entered{_limits(node)}{_after(names, number)}"
        if not late:
            entered = list(dict.fromkeys(name.rpartition(".")[2] for _, name in self._entered if name))
            actual = f"{', '.join(entered)}{until}" if (until := self._maker.until) else entered
            return self._maker.failure(place, what, names, actual, last, states)
        since = f", counted from {last.time:.1f} s" if last is not None else ""
        actual = f"{node.state} at {', '.join(f'{step.time:.1f} s' for step in late)}"
        return self._maker.failure(
            place, what, f"{node.state}{_limits(node)}{since}", actual, late[0], states
        )

    # -- each followed by another -----------------------------------------------------------------------

    def _leads(self) -> Iterator[ScenarioFailure]:
        for index, node in enumerate(self._expect.leads_to):
            found = next(self._left_alone(node), None)
            if found is not None:
                number, later = found
                step, name = self._entered[number]
                limit = f" within {node.within}" if node.within is not None else ""
                follows = (
                    f"{node.to} {later:.1f} s later" if later is not None else f"{node.to} never after that"
                )
                place, what = self._expect.at("leads_to", index), f"leads_to: {node.to}"
                expected = f"{node.to} follows every {node.from_}{limit}"
                actual = f"{node.from_} at {step.time:.1f} s, {follows}"
                yield self._maker.failure(place, what, expected, actual, step, [name])

    def _left_alone(self, node: LeadsNode) -> Iterator[tuple[int, float | None]]:
        """Yield the entries that are not followed in time, and after how long they are; None: never."""
        limit = seconds(node.within)
        for number, (step, name) in enumerate(self._entered):
            if is_named(name, node.from_):
                followers = (s.time for s, n in self._entered[number + 1 :] if is_named(n, node.to))
                first = next(followers, None)
                if first is None:
                    yield number, None
                elif limit is not None and first - step.time > limit + ROUNDING:
                    yield number, first - step.time

    # -- never ------------------------------------------------------------------------------------------

    def _never(self) -> Iterator[ScenarioFailure]:
        for index, node in enumerate(self._expect.never):
            found = self._unwanted(node)
            if found is not None:
                step, name = found
                since = f" after {node.after}" if node.after else ""
                place, expected = self._expect.at("never", index), f"{node.state} is not entered{since}"
                actual = f"entered {name} at {step.time:.1f} s"
                yield self._maker.failure(place, f"never: {node.state}", expected, actual, step, [name])

    def _unwanted(self, node: NeverNode) -> Entry | None:
        """Return the first entry that `never` forbids; None where there is none."""
        counts = node.after is None
        for step, name in self._entered:
            if counts and is_named(name, node.state):
                return step, name
            counts = counts or is_named(name, node.after or "")
        return None


def _after(names: Sequence[str], number: int) -> str:
    return f" after {names[number - 1]}" if number else ""


def _limits(node: PassNode) -> str:
    """Return the limits of time that were written, as words."""
    words = (("within", "within"), ("after at least", "at_least"), ("by", "by"))
    given = [f"{word} {getattr(node, key)}" for word, key in words if getattr(node, key) is not None]
    return f" {' and '.join(given)}" if given else ""
