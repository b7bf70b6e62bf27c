"""Decides the conversion of a document's sends to itself: a `raise`, an `after` of a state, or a region.

A deadline of the language belongs to a state. A delayed `send` whose event may come after its state was left,
or that may be cancelled while it is active, becomes a region beside the rest, with events that start and stop
its clock. A second send meanwhile restarts that clock, where SCXML would deliver both.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from lupin_engine.chart import MIN_PERIOD
from lupin_engine.plugin import parse_quantity
from lupin_scxml.data import measure
from lupin_scxml.elements import Element
from lupin_scxml.events import QUOTED, STATES, Events, is_to_itself, params_of, snake
from lupin_scxml.expressions import read
from lupin_scxml.notes import AlwaysFails, CannotSay


class Delay(NamedTuple):
    """The delay of a `send`: a literal, or an expression; both are empty without one."""

    literal: str = ""
    computed: str = ""


@dataclass
class Region:
    """A timer as a region beside the chart, and the event that it raises."""

    name: str
    word: str
    event: str
    delay: str = ""
    is_stopped: bool = False
    #: By field of its event, the variable that keeps it meanwhile.
    kept: dict[str, str] = field(default_factory=dict)

    def state(self) -> dict[str, Any]:
        """Return the states of the region."""
        kept = {name: f"${{ event.{param} }}" for param, name in self.kept.items()}
        fields = {param: f"${{ {name} }}" for param, name in self.kept.items()}
        raised = {"event": self.event, **({"with": fields} if fields else {})}
        on = {f"{self.word}.start": "TICKING"} | ({f"{self.word}.stop": "IDLE"} if self.is_stopped else {})
        ticking = {
            **({"entry": [{"set": kept}]} if kept else {}),
            "on": on,
            "after": {self.delay: {"target": "IDLE", "do": [{"raise": raised}]}},
        }
        return {
            "initial": "IDLE",
            "states": {"IDLE": {"on": {f"{self.word}.start": "TICKING"}}, "TICKING": ticking},
        }


class DelayedSends:
    """The sends of one document to itself."""

    def __init__(self, root: Element, own: bool, events: Events) -> None:
        """Decide the conversion of each."""
        self._own = own
        self._events = events
        self._cancels: defaultdict[str, list[Element]] = defaultdict(list)
        for cancel in root.every("cancel"):
            self._cancels[cancelled(cancel)].append(cancel)
        #: By `send`, the region that waits for it; several sends of one event and delay share one.
        self.regions: dict[Element, Region] = {}
        taken = {snake(state.get("id")).upper() for state in root.every(*STATES)}
        shared: dict[tuple[object, ...], Region] = {}
        #: By state, the events that it sends itself again and again, with the first `send`.
        self.ticks: dict[Element, dict[str, Element]] = {}
        self._ticking: set[Element] = set()
        for block in root.every("onentry"):
            self._find_ticks(block)
        self._sends: defaultdict[str, list[Element]] = defaultdict(list)
        for send in root.every("send"):
            for sent in {send.get("id"), send.get("idlocation")} - {""}:
                self._sends[sent].append(send)
            if self.wanted(send) == "region":
                event = next(iter(events.raised_by(send).values()))
                key = (
                    event,
                    send.get("id") or send.get("idlocation"),
                    self.delay(send),
                    *sorted(params_of(send)),
                )
                if key not in shared:
                    shared[key] = self._region(event, taken)
                self.regions[send] = shared[key]

    def _find_ticks(self, block: Element) -> None:
        """Find the events that a state sends itself on entry, and again whenever one comes."""
        state, delays = block.around[0], Counter(map(self.delay, block.all("send")))
        for first in block.all("send"):
            event = self._events.name(first.get("event"))
            again = [send for send in self._events.sent(event) if send is not first]
            rules = [rule for rule in state.all("transition") if self._events.matches(rule, event)]
            blocks = {send.parent for send in again}
            if (
                self.delay(first) != Delay()
                and _can_repeat(self.delay(first))
                and (self._own or delays[self.delay(first)] == 1)
                and again
                and blocks <= set(rules)
                and len(blocks) == len(again)
                and all(
                    self.delay(send) == self.delay(first) and not params_of(send) for send in (first, *again)
                )
                and all(rule.get("target") or rule in blocks for rule in rules)
                and (self._own or self._events.heard_by(event) | self._events.listening["*"] == {state})
            ):
                self.ticks.setdefault(state, {})[event] = first
                self._ticking |= {first, *again}

    def _region(self, event: str, taken: set[str]) -> Region:
        base = f"{snake(event.replace('.', '_'))}_timer"
        name = base
        number = 2
        while name.upper() in taken:
            name, number = f"{base}_{number}", number + 1
        taken.add(name.upper())
        return Region(name.upper(), name, event)

    def wanted(self, send: Element) -> str:
        """Return the conversion of a `send`: `raise`, `after`, `region`, `tick`; '' is none to itself."""
        events = self._events.raised_by(send)
        if not is_to_itself(send) or not events:
            return ""
        if send in self._ticking:
            return "tick"
        if self.delay(send) == Delay() and (len(events) > 1 or not self._is_overtaken(send)):
            return "raise"
        block, state, *_ = (*send.around, send)
        if self._own:
            return "after"
        if block.kind != "onentry" or state.kind == "final" or not self._is_plain(send):
            return "region"
        stops = [c for sent in {send.get("id"), send.get("idlocation")} - {""} for c in self._cancels[sent]]
        if stops:
            at_exit = all(c.around[0].kind == "onexit" and c.around[1] is state for c in stops)
            return "after" if at_exit else "region"
        heard = {state for event in events.values() for state in self._events.heard_by(event)}
        return "after" if all(state in (one, *one.around) for one in heard) else "region"

    @staticmethod
    def delay(send: Element) -> Delay:
        """Return the delay of a `send`."""
        literal, computed = send.get("delay").strip(), send.get("delayexpr").strip()
        if not literal and QUOTED.fullmatch(computed):
            literal, computed = computed[1:-1], ""
        return Delay(literal, computed)

    def _is_overtaken(self, send: Element) -> bool:
        """Return whether later actions of its block raise internal events, which come first."""
        siblings = send.parent.children if send.parent is not None else []
        later = siblings[siblings.index(send) + 1 :] if send in siblings else []
        if self._own or send.get("target") == "#_internal":
            return False
        return any(self._is_internal(each) for one in later for each in one.every())

    def _is_internal(self, action: Element) -> bool:
        return (
            action.kind == "raise" or action.get("target") == "#_internal" or action in self._events.failing
        )

    def _is_plain(self, send: Element) -> bool:
        """Return whether an event's fields are constant."""
        given = [param.get("expr") for param in send.all("param")]
        return not send.get("namelist") and all(map(_is_literal, given)) and not send.all("content")

    def stopped_by(self, cancel: Element) -> list[Element]:
        """Return the sends that a `cancel` stops."""
        return self._sends[cancelled(cancel)] if cancelled(cancel) else []


def cancelled(cancel: Element) -> str:
    """Return the id in a `cancel`, or the variable that has it."""
    computed = cancel.get("sendidexpr").strip()
    return cancel.get("sendid") or (computed[1:-1] if QUOTED.fullmatch(computed) else computed)


def _can_repeat(delay: Delay) -> bool:
    """Return whether a delay is long enough for `every`."""
    quantity = parse_quantity(measure(delay.literal)) if delay.literal else None
    return quantity is None or quantity[0] >= MIN_PERIOD


def _is_literal(text: str) -> bool:
    def nothing(_: object) -> Any:
        raise CannotSay

    try:
        read(text, nothing)
    except (CannotSay, AlwaysFails):
        return False
    return True
