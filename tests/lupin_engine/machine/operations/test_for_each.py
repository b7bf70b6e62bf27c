"""`for_each`: one operation for every new element of a collection, each dealt with once in a mission."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.step import Step
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart, expression, fails

TOLD = ("set", {"told": lambda env: [*env["context"]["told"], (env["item"], dict(env["event"]))]})
FAILED = ("set", {"told": lambda env: [*env["context"]["told"], (env["item"], dict(env["error"]))]})


def collecting(*, state: dict[str, Any] | None = None, **rule: Any) -> Bench:
    """Return a bench in a state that reads every element of `input.seen`."""
    described = {
        "do": "bridge.read",
        "items": lambda env: env["input"]["seen"],
        "on_done": TOLD,
        "on_error": FAILED,
    }
    look = {"for_each": {**described, **rule}, "on": {"out": "Z"}, **(state or {})}
    states = {"LOOK": look, "Z": {"on": {"back": "LOOK", "mission.start": "SLOT"}}, "SLOT": SLOT, "FAULT": {}}
    return Bench(
        chart(
            states,
            inputs={"seen": {}},
            context={"told": []},
            missions={"M": {"state": "SLOT.M"}},
            holds={"pause": PAUSE},
        )
    )


SLOT = {"slot": True, "states": {"M": {"mission": "M"}}, "on": {"back": "LOOK"}}


def see(bench: Bench, *items: Any) -> list[str]:
    """Let the collection be `items`; return what is commanded."""
    bench.observe("seen", list(items))
    return bench.commands


def attempt_of(bench: Bench, item: Any) -> str:
    """Return the last attempt that was started for an element."""
    return [start.attempt for start in bench.started if start.arguments["item"] == item][-1]


def finish(bench: Bench, item: Any, **result: Any) -> Step:
    """Let the operation for an element succeed."""
    return bench.send(events.done(attempt_of(bench, item), result))


def items_started(bench: Bench) -> list[Any]:
    """Return the elements for which operations were started, in their order."""
    return [start.arguments["item"] for start in bench.started]


def test_every_element_has_an_operation_of_its_own() -> None:
    """All at once, in the order of the collection, each with its element."""
    bench = collecting()
    assert bench.commands == []
    see(bench, "a", "b")
    assert items_started(bench) == ["a", "b"]
    assert sorted(bench.machine.memory.invocations) == ["LOOK[a]", "LOOK[b]"]


def test_an_element_that_appears_later_is_taken_up_then() -> None:
    """The collection is looked at after every step; what runs already is left alone."""
    bench = collecting()
    see(bench, "a")
    see(bench, "a", "b")
    finish(bench, "a")
    see(bench, "b", "c")
    assert items_started(bench) == ["a", "b", "c"]


def test_no_element_is_dealt_with_twice_in_a_mission() -> None:
    """Whether it succeeded or failed, and however often it is seen."""
    bench = collecting()
    see(bench, "a", "b")
    finish(bench, "a")
    bench.send(events.failed(attempt_of(bench, "b"), "dark"))
    see(bench, "a", "b", "a")
    bench.send("out")
    bench.send("back")
    assert items_started(bench) == ["a", "b"]


def test_what_was_not_finished_when_the_state_was_left_is_done_again() -> None:
    """Leaving cancels; coming back takes up what has no end yet."""
    bench = collecting()
    see(bench, "a", "b")
    finish(bench, "a")
    bench.send("out")
    assert bench.commands == [f"cancel {attempt_of(bench, 'b')}"]
    bench.send("back")
    assert items_started(bench) == ["a", "b", "b"]


def test_the_next_mission_deals_with_all_of_them_again() -> None:
    """What was handled is the mission's own."""
    bench = collecting()
    see(bench, "a")
    finish(bench, "a")
    bench.send("out")
    bench.send("mission.start", mission_type="M")
    bench.send("back")
    assert items_started(bench) == ["a", "a"]


def test_at_most_so_many_at_once() -> None:
    """`limit` bounds what runs; the next one follows when one has ended."""
    bench = collecting(limit=2)
    see(bench, "a", "b", "c", "d")
    assert items_started(bench) == ["a", "b"]
    finish(bench, "b")
    assert items_started(bench) == ["a", "b", "c"]


def test_without_a_limit_what_has_vanished_keeps_nobody_waiting() -> None:
    """Operations for elements that are no longer seen run on beside the new ones."""
    bench = collecting()
    see(bench, "a", "b", "c")
    see(bench, "d")
    assert items_started(bench) == ["a", "b", "c", "d"]


def test_a_limit_counts_elements_only() -> None:
    """The state's own operation is none of them."""
    bench = collecting(limit=1, state={"invoke": "nav.go", "on_done": "Z"})
    see(bench, "a", "b")
    assert [start.operation for start in bench.started] == ["nav.go", "bridge.read"]


def test_a_limit_of_none_starts_nothing() -> None:
    """Zero and less hold everything back."""
    bench = collecting(limit=lambda env: -1)
    assert see(bench, "a") == []


def test_elements_are_told_apart_by_their_key() -> None:
    """Two elements with one key are one; the first that has it counts."""
    bench = collecting(key=lambda env: env["item"]["id"])
    see(bench, {"id": 7, "x": 1}, {"id": 8}, {"id": 7, "x": 2})
    assert items_started(bench) == [{"id": 7, "x": 1}, {"id": 8}]
    assert sorted(bench.machine.memory.invocations) == ["LOOK[7]", "LOOK[8]"]


def test_only_what_is_wanted_is_taken_up() -> None:
    """`when` is asked for each element, again after every step."""
    bench = collecting(when=lambda env: env["item"] < len(env["input"]["seen"]))
    see(bench, 1, 2)
    see(bench, 1, 2, 3)
    assert items_started(bench) == [1, 2]


def test_an_element_that_cannot_be_judged_yet_waits_alone() -> None:
    """An unknown input in `when` holds back the elements that ask for it, and no others."""

    def known_to_be_wanted(env: Any) -> bool:
        return env["item"] == "a" or bool(env["input"]["absent"])

    inputs: dict[str, Any] = {"seen": {}, "absent": {}}
    rule = {"do": "bridge.read", "items": lambda env: env["input"]["seen"], "when": known_to_be_wanted}
    bench = Bench(chart({"LOOK": {"for_each": rule}}, inputs=inputs))
    see(bench, "b", "a")
    assert items_started(bench) == ["a"]
    bench.observe("absent", True)
    assert items_started(bench) == ["a", "b"]


def test_what_became_of_an_element_is_told_with_it() -> None:
    """`on_done` sees the element and the result, `on_error` the element and the error."""
    bench = collecting()
    see(bench, "a", "b")
    finish(bench, "b", value=3)
    bench.send(events.failed(attempt_of(bench, "a"), "dark", "no light"))
    assert bench.context["told"] == [("b", {"value": 3}), ("a", {"code": "dark", "detail": "no light"})]
    assert (bench.machine.view.code, bench.leaves) == ("dark", ["LOOK"])


def test_a_failed_element_is_tried_again() -> None:
    """With the state's own `retry`; only the last failure is told."""
    bench = collecting(attempts=2, backoff=1.0)
    see(bench, "a")
    step = bench.send(events.failed(attempt_of(bench, "a"), "dark"))
    assert step.notes == ("try 1 failed (dark); next in 1 s",)
    bench.wait(1.0)
    assert items_started(bench) == ["a", "a"]
    bench.send(events.failed(attempt_of(bench, "a"), "dark"))
    assert bench.context["told"] == [("a", {"code": "dark", "detail": ""})]


def test_an_element_that_takes_too_long_has_failed() -> None:
    """Its timeout is its own."""
    bench = collecting(timeout=lambda env: 2.0 if env["item"] == "a" else 9.0, timeout_code="late")
    see(bench, "a", "b")
    bench.wait(2.0)
    assert bench.context["told"] == [("a", {"code": "late", "detail": ""})]
    assert list(bench.machine.memory.invocations) == ["LOOK[b]"]


def test_a_blocked_element_holds_up_no_other() -> None:
    """One waits for a resource; those after it and beside it go on."""
    bench = collecting(do="nav.go", limit=3)
    see(bench, "a", "b", "c")
    assert items_started(bench) == ["a"]
    finish(bench, "a")
    assert items_started(bench) == ["a", "b"]
    bench.send(events.failed(attempt_of(bench, "b"), "blocked"))
    finish(bench, "c")
    assert [item for item, _ in bench.context["told"]] == ["a", "b", "c"]


def test_another_region_moves_on_meanwhile() -> None:
    """Elements of one region are none of the other's business."""
    rule = {"do": "bridge.read", "items": ["a"], "on_done": ("raise", {"event": "read"})}
    regions = {
        "R": {"states": {"LOOK": {"for_each": rule}}},
        "S": {"states": {"x": {"on": {"go": "y"}}, "y": {"on": {"read": "z"}}, "z": {}}},
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}}))
    bench.send("go")
    assert bench.leaves == ["P.R.LOOK", "P.S.y"]
    finish(bench, "a")
    assert bench.leaves == ["P.R.LOOK", "P.S.z"]


# -- holds ------------------------------------------------------------------------------------------------


def test_what_moves_is_cancelled_by_a_hold_and_issued_again() -> None:
    """Each element on its own, without losing a try."""
    bench = collecting(do="nav.go")
    see(bench, "a")
    first = attempt_of(bench, "a")
    bench.send("operator.pause")
    assert bench.commands == [f"cancel {first}"]
    bench.send(events.cancelled(first))
    bench.send("operator.resume")
    assert items_started(bench) == ["a", "a"]
    assert bench.machine.memory.invocations["LOOK[a]"].tries == 1


def test_what_does_not_move_finishes_and_its_answer_waits() -> None:
    """`on_done` is carried out on the release."""
    bench = collecting()
    see(bench, "a")
    bench.send("operator.pause")
    step = finish(bench, "a", value=1)
    assert step.notes == ("the answer of bridge.read waits for the release",)
    assert bench.context["told"] == []
    bench.send("operator.resume")
    assert bench.context["told"] == [("a", {"value": 1})]


def test_nothing_new_is_taken_up_while_held() -> None:
    """What is seen meanwhile begins on the release."""
    bench = collecting()
    bench.send("operator.pause")
    assert see(bench, "a") == []
    bench.send("operator.resume")
    assert items_started(bench) == ["a"]


# -- errors -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rule",
    [
        {"items": fails},
        {"limit": fails},
        {"key": fails},
        {"when": fails},
    ],
    ids=["items", "limit", "key", "when"],
)
def test_what_cannot_be_computed_is_an_error_once_a_step(rule: dict[str, Any]) -> None:
    """Told with its place; the state's `on_error`, else FAULT, hears of it."""
    bench = collecting(**rule)
    see(bench, "a", "b")
    assert bench.leaves == ["FAULT"]
    assert bench.machine.view.detail.startswith("test.yaml:1:1: for_each: ")
    assert [note for step in bench.steps for note in step.notes if "for_each" in note] == [
        bench.machine.view.detail
    ]


def test_one_element_that_cannot_be_judged_is_an_error_and_the_others_go_on() -> None:
    """A chart that stays all the same works on what it can."""
    rule = {"do": "bridge.read", "items": ["a", 0, "b"], "key": lambda env: env["item"].upper()}
    state = {"for_each": rule, "on_error": {"do": "told"}}
    bench = Bench(chart({"LOOK": state}))
    assert bench.commands == ["start a3", "start a4", "act told"]


def test_a_collection_that_is_none_is_an_error() -> None:
    """A number has no elements."""
    bench = collecting(items=5)
    assert bench.machine.view.detail == "test.yaml:1:1: for_each: 'int' object is not iterable"


def test_arguments_that_cannot_be_computed_end_their_element() -> None:
    """The state hears of the mistake; the element is told as failed and not tried for ever."""
    rule = {"do": "bridge.read", "items": ["a"], "with": {"x": fails}, "on_error": FAILED}
    state = {"for_each": rule, "on_error": {"do": "told"}}
    bench = Bench(chart({"LOOK": state}, context={"told": []}))
    assert bench.commands == ["act told"]
    detail = "test.yaml:1:1: division by zero"
    assert bench.context["told"] == [("a", {"code": "execution_error", "detail": detail})]
    assert bench.machine.memory.handled == {"LOOK": ["a"]}
    assert bench.send("anything").changed is False


def test_an_error_in_what_is_done_about_an_element_is_the_states() -> None:
    """As in every action, with its place."""
    bench = collecting(on_done=("set", {"told": expression(fails)}))
    see(bench, "a")
    finish(bench, "a")
    assert (bench.leaves, bench.machine.view.detail) == (["FAULT"], "test.yaml:1:1: set: division by zero")
