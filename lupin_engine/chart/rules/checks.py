"""Runs the rules about a composed chart, which go beyond the correctness of each piece.

A rule is a small function in `chart.rules`, by subject. It sees parts expanded and targets resolved. Rules
that follow transitions through the whole chart run only when all of them could be resolved: after a misspelt
target, half the chart would seem unreachable. Rules about unused declarations run only when every possible
use was understood.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lupin_engine.chart.compose.compose import Composed
from lupin_engine.chart.rules.choices import both_can_win, never_wins, regions_clash, unhandled_outcome
from lupin_engine.chart.rules.events import event_field
from lupin_engine.chart.rules.index import Index, Rule
from lupin_engine.chart.rules.inputs import unknown_input_read
from lupin_engine.chart.rules.loops import always_loop, no_time
from lupin_engine.chart.rules.regions import region_leak, shared_resource, shared_variable
from lupin_engine.chart.rules.unused import (
    never_set,
    one_way_switch,
    unheard_event,
    unused_code,
    unused_field,
    unused_input,
    unused_parameter,
    unused_variable,
)
from lupin_engine.chart.rules.visits import published_twice, visits
from lupin_engine.chart.rules.walks import begins_anew, silent_fault, untold_rest
from lupin_engine.chart.rules.ways import (
    dead_end,
    names_no_mission,
    never_happens,
    unreachable_state,
    waits_for_ever,
    waits_for_the_world,
)
from lupin_engine.errors import Diagnostic, Severity

#: After one of these the ways through the chart are not known.
_BROKEN_WAYS = (
    "unknown-state",
    "unknown-operation",
    "no-initial",
    "part-loop",
    "wrong-shape",
    "too-large",
    "bad-name",
    "unknown-key",
)
#: After one of these it is not known what is read.
_BROKEN_READS = ("partial-expression", "unknown-parameter", *_BROKEN_WAYS)
#: After one of these it is not known what is used: a misspelt name looks like one that nobody uses.
_BROKEN_USES = (
    "bad-expression",
    "unknown-name",
    "unknown-event",
    "unknown-function",
    "unknown-action",
    "unknown-argument",
    "unknown-value",
    "unknown-hold",
    "unknown-type",
    "undeclared-code",
    "missing-argument",
    "missing-itinerary",
    "wrong-type",
    "wrong-unit",
    "no-unit",
    *_BROKEN_READS,
)

#: Rules that look at what stands side by side.
LOCAL: tuple[Rule, ...] = (
    never_wins,
    both_can_win,
    unhandled_outcome,
    unknown_input_read,
    shared_resource,
    shared_variable,
)
#: Rules that follow transitions through the chart, or ask what a state contains.
GLOBAL: tuple[Rule, ...] = (
    never_happens,
    names_no_mission,
    waits_for_ever,
    waits_for_the_world,
    unreachable_state,
    dead_end,
    always_loop,
    no_time,
    regions_clash,
    region_leak,
    visits,
    published_twice,
    begins_anew,
    untold_rest,
    silent_fault,
    event_field,
)
#: Rules about what is declared and not used.
UNUSED: tuple[Rule, ...] = (
    unheard_event,
    unused_code,
    unused_input,
    unused_variable,
    never_set,
    one_way_switch,
    unused_field,
)


def check_composed(
    composed: Composed, known: Iterable[Diagnostic] = (), whole: bool = True
) -> Iterator[Diagnostic]:
    """Yield the findings of every rule that makes sense beside those `known` already.

    Without `whole`, parts of the chart were left out, whose content is unknown.
    """
    rules = [*LOCAL]
    if whole:
        broken = {found.rule for found in known if found.severity is Severity.ERROR}
        rules += GLOBAL if broken.isdisjoint(_BROKEN_WAYS) else ()
        rules += (unused_parameter,) if broken.isdisjoint(_BROKEN_READS) else ()
        rules += UNUSED if broken.isdisjoint(_BROKEN_USES) else ()
    index = Index(composed)
    for rule in rules:
        yield from rule(index)
