"""What an older engine accepted and this one does not: one row for each such rule, with its dates.

A finding of a row is a warning in every engine that was released before the row's `refused` day, 90 days
after the rule came, and an error from then on. The engine's own release day decides, never a clock: the same
files and the same engine give the same findings. A row that is `at_once` says why there is no such time: the
file could move the robot or hold it for ever, falsify what is published, or end the orchestrator.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType

from lupin_engine.errors import Diagnostic, Place, Severity

#: The day on which this engine was released; it is set with each release.
RELEASED = "2026-11-30"


@dataclass(frozen=True)
class StricterRule:
    """A rule that came later than files that break it.

    Days are written as in ISO 8601. `wrote` is what an older author wrote, `instead` what to write;
    `upgrades` says whether `lupin upgrade` can write it.
    """

    rule: str
    since: str
    refused: str
    wrote: str
    instead: str
    upgrades: bool = True
    at_once: str = ""


#: By name, in the order in which the rules came.
STRICTER: Mapping[str, StricterRule] = MappingProxyType(
    {
        "bare-quantity": StricterRule(
            "no-unit",
            "2026-11-21",
            "2027-02-19",
            "a number without a unit for a length or an angle in a scenario",
            "the unit: `2.4 m`, `1.3 rad`",
        ),
        "restart-true": StricterRule(
            "wrong-shape",
            "2026-11-23",
            "2027-02-21",
            "`restart: true` in a scenario: the machine goes on at once, and nothing is held",
            "`restart: 1 s`, and a request `operator.resume` after it: a robot is held after a restart",
            upgrades=False,
        ),
        "event-field": StricterRule(
            "unknown-name",
            "2026-11-23",
            "2027-02-21",
            "a field of an event where another event may have led",
            "a variable that is set where the event is seen",
            upgrades=False,
        ),
        "wait-in-fault": StricterRule(
            "unhandled-outcome",
            "2026-11-23",
            "2027-02-21",
            "an operation in FAULT without `on_error`, whose failure leads nowhere",
            "`on_error: {}`, which says so, or a state that tries again",
        ),
        "silent-fault": StricterRule(
            "untold-rest",
            "2026-11-23",
            "2027-02-21",
            "a lifecycle whose FAULT publishes nothing about the targets that are left",
            "`itinerary.close_rest` under `entry` of FAULT",
        ),
        "early-outcomes": StricterRule(
            "wrong-type",
            "2026-11-23",
            "2027-02-21",
            "`published` and `visits` of a scenario without targets whose visit had not begun",
            "these too: every target of an accepted request has an outcome, however early the mission ends",
        ),
        "part-and-mission": StricterRule(
            "conflicting-definition",
            "2026-11-23",
            "2027-02-21",
            "a part and a mission of one name, of which the part was used",
            "another name for one of the files",
            upgrades=False,
        ),
        "property-name": StricterRule(
            "conflicting-definition",
            "2026-11-30",
            "2027-02-28",
            "a property with a name that has become that of a built-in one",
            "`my_NAME`, which is also its name until then",
        ),
        "bare-setting": StricterRule(
            "no-unit",
            "2026-11-30",
            "2027-02-28",
            "a number without a unit in the `request` or the `parameters` of a scenario",
            "the unit: `90 s`, `2.4 m`",
        ),
        "ignored-field": StricterRule(
            "unknown-argument",
            "2026-11-30",
            "2027-02-28",
            "a field in the `request` of a scenario that its mission does not have",
            "the name of one that it has",
            upgrades=False,
        ),
        "first-visit-open": StricterRule(
            "open-visit",
            "2026-11-29",
            "2027-02-27",
            "an itinerary whose first step advances, which the robot refuses",
            "`initial` with the state that works on a target",
            upgrades=False,
        ),
        "target-without-id": StricterRule(
            "wrong-type",
            "2026-11-23",
            "2026-11-23",
            "targets without an `id`, or of several types in one list",
            "an `id` in each, and the same fields",
            upgrades=False,
            at_once="falsifies what is published: outcomes name their target by its id",
        ),
        "rights": StricterRule(
            "not-allowed",
            "2026-11-23",
            "2026-11-23",
            "a binding that reaches what no plugin offers, or by `*` what a plugin publishes",
            "its name under `allow` in `lupin.yaml`, by the robot's owner",
            upgrades=False,
            at_once="moves the robot: a binding can command anything that has a name",
        ),
        "bounds": StricterRule(
            "wrong-type",
            "2026-11-28",
            "2026-11-28",
            "whole numbers beyond ±(2^53 - 1), durations beyond 100 years",
            "smaller ones",
            upgrades=False,
            at_once="falsifies what is published: JSON and clocks do not hold them",
        ),
        "ros-parameters": StricterRule(
            "wrong-type",
            "2026-11-29",
            "2026-11-29",
            "a parameter of a type that ROS cannot hold, or with a name of the orchestrator's own",
            "`bool`, `integer`, `number`, `text`, a list of these, or a record of numbers; another name",
            upgrades=False,
            at_once="ends the orchestrator: it cannot declare them",
        ),
        "folder-size": StricterRule(
            "too-large",
            "2026-11-29",
            "2026-11-29",
            "a folder of more than 200 missions or 1 MB",
            "several folders",
            upgrades=False,
            at_once="ends the orchestrator: it reads for so long that nobody hears it",
        ),
        "refused-release": StricterRule(
            "held-for-ever",
            "2026-11-30",
            "2026-11-30",
            "a mission that refuses, without a guard, the request that releases a hold",
            "a `guard`, or no answer: the hold has a `release_guard`",
            upgrades=False,
            at_once="holds the robot for ever: nobody can let it go on",
        ),
    }
)


@contextmanager
def as_of(released: str) -> Iterator[None]:
    """Judge as an engine that was released on another day; charts that are remembered are of the day before.

    `""` is before all days: what `lupin upgrade` mends has to be read, however old it is.
    """
    global RELEASED
    own, RELEASED = RELEASED, released
    try:
        yield
    finally:
        RELEASED = own


def is_dated(name: str) -> bool:
    """Say whether this engine still accepts what the row `name` is about."""
    return STRICTER[name].refused > RELEASED


def stricter(name: str, place: Place, path: str, problem: str, hint: str) -> Diagnostic:
    """Return a finding of the row `name`: a warning that says from when on it is an error, or an error."""
    row = STRICTER[name]
    if not is_dated(name):
        return Diagnostic(place, row.rule, path, problem, hint, stricter=name)
    mends = "; 'lupin upgrade' mends it" if row.upgrades else ""
    hint = f"{hint} (an error in versions from {row.refused} on{mends})"
    return Diagnostic(place, row.rule, path, problem, hint, Severity.WARN, name)
