"""Replaces `sequence` and `times` in a file by the ordinary states that they stand for.

The parsed mapping is changed in place before it is validated, and every value keeps its place in the file.

    CLEANING:                     CLEANING:
      sequence:                     initial: begin
        - WIPE: {invoke: ...}       resume_at: WIPE
        - RINSE: {use: rinse}       states:
      times: 3                        begin:
      on_done: DRYING                   always: {target: CLEANING.WIPE, do: {set: {cleaning_round: 1}}}
      on_error: FAULT                 WIPE: {invoke: ..., on_done: CLEANING.RINSE, on_error: FAULT}
                                      RINSE: {use: rinse, on_done: CLEANING.again}
                                      again:
                                        always:
                                          - target: CLEANING.WIPE
                                            guard: cleaning_round < (3)
                                            do: {set: {cleaning_round: "${ cleaning_round + 1 }"}}
                                          - CLEANING.over
                                      over: {type: final}
                                    on_done: DRYING

The counter is set in `begin` and not on entering: history comes back to the beginning of the same round.
Without `times` the first step is the initial state, and the last one leads to `over`.
"""

from __future__ import annotations

from typing import Any

from lupin_engine.chart.documents import StateNode
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import keys_of, show
from lupin_engine.chart.source import Map, Seq, Text, data_at, text_at
from lupin_engine.errors import Place

BEGIN, AGAIN, OVER = "begin", "again", "over"
#: Keys by which a state has an end, which leads from a step to the next one.
_ENDING = frozenset({"invoke", "use", "for_each", "states", "sequence"})
#: Keys of steps for which the sequence says what a failure leads to.
_FAILING = frozenset({"invoke", "sequence"})
#: Keys by which a state without an end is left.
_WAYS_ON = frozenset({"after", "always", "on", "every", "at", "budget"})
_STATE_KEYS = frozenset(keys_of(StateNode))
#: Keys that say what a state does, of which `sequence` is another.
_INSTEAD = ("initial", "states", "use", "invoke", "for_each", "ask", "type", "slot")


def write_out(raw: Map, findings: Findings) -> None:
    """Replace every `sequence` in the states of a file; a malformed one stays, for the model to report."""
    _write_out_in(raw, raw, (), findings)


def _write_out_in(holder: Map, file: Map, path: tuple[str, ...], findings: Findings) -> None:
    states = holder.get("states")
    for name, state in states.items() if isinstance(states, Map) else ():
        if isinstance(state, Map):
            inner = (*path, name)
            if "sequence" in state or "times" in state:
                _SequenceState(state, file, inner, findings).write_out()
            _write_out_in(state, file, inner, findings)


class _SequenceState:
    """A state with `sequence` or `times`, which is rewritten."""

    def __init__(self, state: Map, file: Map, path: tuple[str, ...], findings: Findings) -> None:
        self._state = state
        self._file = file
        self._name = path[-1]
        self._path = ".".join(f"states.{name}" for name in path)
        self._counter = "_".join((*path, "round")).lower()
        self._findings = findings

    def write_out(self) -> None:
        """Replace the keys; after a finding the state is left without `times`."""
        state, limit = self._state, self._limit()
        if self._is_wrong():
            return
        place = state.key_place("sequence")
        steps = {next(iter(step)): step for step in state["sequence"]}
        states, names = Map(state.file, state.key_starts["sequence"]), [*steps]
        if limit:
            self._put(states, BEGIN, {"always": self._to(names[0], 1)}, place)
        for (name, step), following in zip(
            steps.items(), [*names[1:], AGAIN if limit else OVER], strict=True
        ):
            self._link(step[name], following, step.key_place(name))
            states.put(name, step[name], step.key_starts[name])
        if limit:
            self._repeat(states, names[0], limit)
        self._put(states, OVER, {"type": "final"}, place)
        self._put(state, "initial", BEGIN if limit else names[0], place)
        state.put("states", states, state.key_starts["sequence"])
        for key in ("sequence", "on_error"):
            if key in state:
                state.drop(key)

    def _link(self, step: Any, following: str, place: Place) -> None:
        """Lead the end of a step to the following one, unless it says itself where it leads.

        Where it does not say what a failure leads to, that is what the sequence says.
        """
        if not isinstance(step, Map) or not _ENDING & step.keys():
            return
        to = self._path_to(following)
        if "on_done" not in step:
            self._put(step, "on_done", to, place)
        ends = step["on_done"]
        for end in ends if isinstance(ends, Seq) else [ends]:
            if isinstance(end, Map) and "target" not in end:
                self._put(end, "target", to, end.place)
        if "on_error" in self._state and "on_error" not in step and _FAILING & step.keys():
            step.put("on_error", self._state["on_error"], self._state.key_starts["on_error"])

    def _repeat(self, states: Map, first: str, limit: str) -> None:
        """Add the state in which it is decided whether another round follows."""
        state, place = self._state, self._state.key_place("times")
        guard = text_at(f"{self._counter} < ({limit})", state.value_place("times"))
        next_round = {**self._to(first, f"${{ {self._counter} + 1 }}"), "guard": guard}
        self._put(states, AGAIN, {"always": [next_round, self._path_to(OVER)]}, place)
        if "resume_at" not in state:
            self._put(state, "resume_at", first, place)
        self._declare_counter(place)
        state.drop("times")

    def _path_to(self, step: str) -> str:
        """Return the target by which a step is found from inside another one, too."""
        return f"{self._name}.{step}"

    def _limit(self) -> str:
        """Return the expression of `times`; '' where there is none, after a finding where it is wrong."""
        times = self._state.get("times")
        if "times" not in self._state:
            return ""
        if isinstance(times, Text) and times.startswith("${") and times.endswith("}"):
            return times[2:-1].strip()
        if isinstance(times, int) and not isinstance(times, bool) and times >= 1:
            return str(int(times))
        problem = f"expected a whole number of 1 or more, or an expression, got {show(times)}"
        self._add("times", "wrong-shape", problem, "write how often the sequence is walked, such as 3")
        self._state.drop("times")
        return ""

    def _is_wrong(self) -> bool:
        """Say whether there is no sequence to write out, after the findings that say why."""
        state = self._state
        if "sequence" not in state:
            if "times" in state:
                hint = "write what is repeated as a list of states under 'sequence'"
                self._add("times", "missing-key", "'times' repeats a sequence, and there is none", hint)
                state.drop("times")
            return True
        steps = state["sequence"]
        if not isinstance(steps, Seq) or not steps:
            problem = f"expected a list of states, got {show(steps)}"
            self._add("sequence", "wrong-shape", problem, "write one line '- NAME: {...}' for each")
        elif not self._has_wrong_steps(steps):
            self._drop_others()
            return False
        state.drop("sequence")
        return True

    def _drop_others(self) -> None:
        for other in [key for key in _INSTEAD if key in self._state]:
            problem = f"a state has 'sequence' or {other!r}, not both"
            self._add(other, "conflicting-definition", problem, "put one of them into a state of its own")
            self._state.drop(other)

    def _has_wrong_steps(self, steps: Seq) -> bool:
        """Say whether a step is no named state, or has a name that is taken, after a finding for each."""
        taken = dict.fromkeys((BEGIN, AGAIN, OVER), "is a state that the sequence adds")
        path, count = f"{self._path}.sequence", len(self._findings.all)
        for step, place in zip(steps, steps.places, strict=True):
            if not isinstance(step, Map) or len(step) != 1:
                problem = f"expected one state by its name, got {show(step)}"
                self._findings.add(place, "wrong-shape", path, problem, "write '- NAME: {...}'")
                continue
            name = next(iter(step))
            if name in _STATE_KEYS:
                problem = f"expected one state by its name, got the key {str(name)!r}"
                self._findings.add(place, "wrong-shape", path, problem, f"write '- NAME: {{{name}: ...}}'")
            elif name in taken:
                problem = f"the step {str(name)!r} {taken[name]}"
                self._findings.add(step.key_place(name), "bad-name", path, problem, "give it another name")
            elif not _is_left(step[name]):
                problem = f"the step {str(name)!r} never ends"
                hint = "write an operation, a part, or a way on such as 'after: {5 s: NEXT_STEP}'"
                self._findings.add(step.key_place(name), "unhandled-outcome", path, problem, hint)
            taken[name] = "stands there twice"
        return len(self._findings.all) > count

    def _to(self, first: str, value: str | int) -> dict[str, Any]:
        """Return the transition into a round."""
        return {"target": self._path_to(first), "do": [{"set": {self._counter: value}}]}

    def _declare_counter(self, place: Place) -> None:
        file = self._file
        if not isinstance(file.get("context"), Map):
            self._put(file, "context", {}, place)
        if self._counter in file["context"]:
            problem = f"{self._counter!r} is the counter of 'times', and a variable of this file"
            self._add("times", "conflicting-definition", problem, "rename the variable or the state")
            return
        self._put(file["context"], self._counter, {"type": "count", "default": 0}, place)

    def _put(self, holder: Map, key: str, value: Any, place: Place) -> None:
        made = data_at({key: value}, place)
        holder.put(key, made[key], made.key_starts[key])

    def _add(self, key: str, rule: str, problem: str, hint: str) -> None:
        place = self._state.key_place(key)
        self._findings.add(place, rule, f"{self._path}.{key}", problem, hint)


def _is_left(step: Any) -> bool:
    """Say whether a step has an end, or a way on; one of another shape is for its model."""
    return not isinstance(step, Map | None) or bool(step and (_ENDING | _WAYS_ON) & step.keys())
