"""The table: every source of motion, every stop, the orders, and the motion that is allowed. Data only.

A source that comes later adds one `Source` to `SOURCES`, with the method of the bench that asks for it, and
a `Rule` where its motion is allowed or a cell makes no sense. Everything else must be 0 until a person says
so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

#: The parts of a cell in which motion is measured: while the stop is engaged, after it was let go, and while
#: it is engaged once more.
HELD, LET_GO, AGAIN = "held", "let go", "engaged again"
PARTS = (HELD, LET_GO, AGAIN)
#: When the stop comes: before the motion is asked for, while it is under way, right after the request.
BEFORE, DURING, AFTER = ORDERS = ("before", "during", "after")


@dataclass(frozen=True)
class Source:
    """Something that moves the robot.

    `begin` and `finish` are methods of the bench: a motion that is under way at once has no `finish`; of one
    that comes late it is what lets it come. `answers`: whoever asks hears of a refusal. `mission`: it needs
    one under way. `follows`: it moves by itself once it has begun.
    """

    name: str
    title: str
    begin: str
    finish: str = ""
    #: What a person lets go of before the stop is let go, such as a joystick.
    hands_off: str = ""
    #: What a person does before he asks again.
    again: str = ""
    #: Whether the motion is that of the mission: then its state must say that it is held.
    mission: bool = False
    arm: bool = False
    answers: bool = False
    follows: bool = True
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Stop:
    """Something that holds the robot.

    `engage` and `let_go` are methods of the bench. `bound` is in seconds from `engage` until what moves must
    stand, without the time that it brakes. `of_mission`: it holds the mission, so there must be one.
    `is_stop`: one that the robot's state calls the e-stop.
    """

    name: str
    title: str
    engage: str
    let_go: str
    bound: float
    #: What a person does to let it go; '' where nobody needs to.
    person: str
    of_mission: bool = False
    is_stop: bool = False
    #: What is so before the cell begins.
    prepare: str = ""
    settings: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


CONTINUE = {"mission_orchestrator": {"resume_policy": "continue"}}

SOURCES = (
    Source("mission", "mission's goal", "start_mission", mission=True, answers=True),
    Source("run_action", "mission by an action client", "run_mission", mission=True, answers=True),
    Source("page_goal", "goal by a page", "goal_of_page", answers=True),
    Source("goal_pose", "`/goal_pose` by a page", "click_of_page", answers=True),
    Source("cmd_vel", "`/cmd_vel` by a page", "joystick_of_page", hands_off="joystick_free", answers=True),
    Source("base_taken", "goal by a page that takes the base", "goal_of_page_with_base", answers=True),
    Source("plain_goal", "goal by a plain action client", "goal_of_stranger"),
    Source("plain_twist", "`/cmd_vel` by a program", "twists_of_stranger", hands_off="joystick_free"),
    Source("arm_preset", "arm preset", "arm_preset", arm=True, answers=True),
    Source("arm_sequence", "arm sequence", "arm_sequence", arm=True, answers=True),
    Source("calibration", "calibration", "calibrate", arm=True, answers=True, again="servos_on"),
    Source(
        "resume_policy",
        "`resume_policy: continue`",
        "kill_orchestrator",
        "start_orchestrator",
        mission=True,
        follows=False,
        settings=CONTINUE,
    ),
    Source("late_answer", "a late answer", "goal_to_frozen_base", "thaw_base", mission=True, follows=False),
)

STOPS = (
    Stop("stop_a", "STOP of page A", "stop_of_a", "a_lets_go", 0.05, "release on page A", is_stop=True),
    Stop(
        "stop_b",
        "STOP of page B, which is closed",
        "stop_of_b",
        "page_resets_stops",
        0.05,
        "reset its stop on page A",
        is_stop=True,
    ),
    Stop(
        "stop_roslib", "STOP by roslib", "stop_of_roslib", "roslib_lets_go", 0.05, "its false", is_stop=True
    ),
    Stop(
        "stop_foreign",
        "STOP by a foreign publisher",
        "stop_of_stranger",
        "stranger_is_silent",
        0.05,
        "2 s without a true",
        is_stop=True,
        prepare="strangers_come",
    ),
    Stop(
        "e_stop_state",
        "`/e_stop_state`",
        "press_button",
        "release_button",
        0.05,
        "release the button",
        is_stop=True,
    ),
    Stop("pause", "pause", "pause", "resume", 0.03, "resume", of_mission=True),
    Stop("restarted", "`restarted`", "restart_orchestrator", "resume", 2.25, "resume", of_mission=True),
    Stop(
        "link_lost",
        "link lost (`stop`)",
        "leave_page",
        "page_resets_stops",
        2.25,
        "reset the stop `link`",
        is_stop=True,
        settings={"lupin_gateway": {"on_link_lost": "stop"}},
    ),
    Stop("link_gone", "link lost (`continue`)", "leave_page", "page_is_back", 2.05, ""),
    Stop(
        "battery", "battery low", "drain_battery", "charge_battery", 0.25, "charge, resume", of_mission=True
    ),
    Stop(
        "orchestrator_dead",
        "orchestrator dead",
        "kill_orchestrator",
        "start_orchestrator",
        2.25,
        "start it, resume",
        of_mission=True,
    ),
    Stop(
        "stop_left",
        "STOP of page B, gateway dead",
        "stop_of_b_and_kill",
        "gateway_and_reset",
        0.05,
        "start it, reset the stop",
        is_stop=True,
    ),
    Stop("gateway_dead", "gateway dead", "kill_gateway", "start_gateway", 2.0, "start it"),
)

SOURCE_OF = {source.name: source for source in SOURCES}
STOP_OF = {stop.name: stop for stop in STOPS}
EVERY_SOURCE, EVERY_STOP = tuple(SOURCE_OF), tuple(STOP_OF)
#: Those that a page is at the far end of.
OF_PAGES = ("page_goal", "goal_pose", "cmd_vel", "base_taken", "arm_sequence")
OF_PROGRAMS = ("plain_goal", "plain_twist", "arm_preset", "calibration")
BY_HAND = (*OF_PAGES, *OF_PROGRAMS)
OF_MISSION = ("mission", "run_action", "resume_policy", "late_answer")


@dataclass(frozen=True)
class Rule:
    """What holds in cells: parts in which motion is `allowed`, or why there is no such cell."""

    why: str
    sources: tuple[str, ...]
    stops: tuple[str, ...]
    orders: tuple[str, ...] = ORDERS
    #: A letter for the page; '' where the cell does not apply.
    letter: str = ""
    allowed: tuple[str, ...] = ()

    def covers(self, source: str, stop: str, order: str) -> bool:
        """Whether it is about a cell."""
        return source in self.sources and stop in self.stops and order in self.orders


#: The first rule that covers a cell counts; without one its motion is 0 in all parts.
RULES = (
    # -- what does not apply ---------------------------------------------------------------------------
    Rule("the simulated button hangs with the base", ("late_answer",), ("e_stop_state", "battery")),
    Rule("a pause is asked of an orchestrator that runs", ("resume_policy",), ("pause",), (DURING,)),
    Rule(
        "it is the end of the same process that is asked for",
        ("resume_policy",),
        ("restarted", "orchestrator_dead"),
        (BEFORE, DURING),
    ),
    Rule(
        "a page that is gone asks for nothing",
        OF_PAGES,
        ("link_lost", "link_gone", "gateway_dead", "stop_left"),
        (BEFORE,),
    ),
    Rule("a low battery holds missions; drives of people are their own", BY_HAND, ("battery",)),
    Rule(
        "while a mission is under way nothing of this moves",
        (*OF_PAGES, "calibration"),
        ("pause", "restarted", "orchestrator_dead"),
        (DURING,),
    ),
    Rule(
        "no mission is under way yet that could be held",
        ("mission", "run_action", "late_answer"),
        ("restarted", "orchestrator_dead", "pause", "battery"),
        (BEFORE,),
    ),
    Rule(
        "a base that hangs for so long ends itself",
        ("late_answer",),
        ("restarted", "orchestrator_dead"),
        (DURING,),
    ),
    # -- motion that is allowed ------------------------------------------------------------------------
    Rule(
        "a mission or a program of which link and gateway are no part",
        (*OF_MISSION, *OF_PROGRAMS),
        ("link_gone", "gateway_dead"),
        letter="m",
        allowed=PARTS,
    ),
    Rule(
        "the arm ends the motion that it was sent on",
        ("arm_sequence",),
        ("link_gone", "gateway_dead"),
        letter="m",
        allowed=PARTS,
    ),
    Rule(
        "the base drives to the point that was clicked: nobody can cancel it but by a stop",
        ("goal_pose",),
        ("link_gone",),
        letter="g",
        allowed=PARTS,
    ),
    Rule("the way home on a low battery", OF_MISSION, ("battery",), letter="h", allowed=PARTS),
    Rule(
        "the release of `restarted` alone under `continue`",
        ("resume_policy",),
        ("restarted", "orchestrator_dead"),
        letter="c",
        allowed=PARTS,
    ),
    Rule(
        "what an operator or a program explicitly moves while the mission is held",
        ("base_taken", "plain_goal", "plain_twist", "arm_preset"),
        ("pause", "restarted"),
        letter="x",
        allowed=PARTS,
    ),
    Rule(
        "what an operator or a program explicitly moves while the mission is held",
        ("plain_twist",),  # each message asks anew
        ("orchestrator_dead",),
        letter="x",
        allowed=PARTS,
    ),
    Rule(
        "what an operator or a program explicitly moves while the mission is held",
        ("base_taken", "plain_goal", "arm_preset"),
        ("orchestrator_dead",),
        (BEFORE,),
        letter="x",
        allowed=PARTS,
    ),
    Rule(
        "somebody has resumed the mission",
        EVERY_SOURCE,
        ("pause", "restarted"),
        letter="r",
        allowed=(LET_GO,),
    ),
)

#: Each source once and each stop once, for `make test`: the cells that say most.
SMALL = (
    ("page_goal", "e_stop_state", BEFORE),
    ("goal_pose", "stop_foreign", DURING),
    ("cmd_vel", "stop_b", DURING),
    ("base_taken", "pause", BEFORE),
    ("plain_goal", "stop_roslib", BEFORE),
    ("arm_preset", "stop_a", BEFORE),
    ("mission", "battery", DURING),
    ("run_action", "restarted", DURING),
    ("arm_sequence", "gateway_dead", DURING),
    ("late_answer", "link_gone", DURING),
    ("calibration", "stop_left", BEFORE),
    ("plain_twist", "link_lost", DURING),
    ("resume_policy", "orchestrator_dead", AFTER),
)


@dataclass(frozen=True)
class Cell:
    """A source, a stop and an order, with the rule that covers it, if there is one."""

    source: Source
    stop: Stop
    order: str
    rule: Rule | None

    @property
    def name(self) -> str:
        """How it is called in results."""
        return f"{self.source.name}/{self.stop.name}/{self.order}"

    @property
    def applies(self) -> bool:
        """Whether there is anything to carry out."""
        return self.rule is None or bool(self.rule.letter)

    @property
    def allowed(self) -> tuple[str, ...]:
        """The parts in which motion is allowed."""
        return self.rule.allowed if self.rule is not None else ()

    @property
    def settings(self) -> Mapping[str, Mapping[str, Any]]:
        """Parameters of nodes, beside the usual ones."""
        return {**self.source.settings, **self.stop.settings}


def cell(source: str, stop: str, order: str) -> Cell:
    """Return a cell by its names."""
    rule = next((rule for rule in RULES if rule.covers(source, stop, order)), None)
    return Cell(SOURCE_OF[source], STOP_OF[stop], order, rule)


def cells(
    sources: tuple[str, ...] = EVERY_SOURCE,
    stops: tuple[str, ...] = EVERY_STOP,
    orders: tuple[str, ...] = ORDERS,
) -> Iterator[Cell]:
    """Yield the cells of some rows and columns: those with the same settings follow each other."""
    found = [cell(source, stop, order) for source in sources for stop in stops for order in orders]
    yield from sorted(found, key=lambda each: (len(each.settings), str(each.settings)))
