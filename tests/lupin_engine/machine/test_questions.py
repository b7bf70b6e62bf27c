"""Questions to the operator: open until they are answered, in time or by default, or their state is left."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.machine.reload import successor
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Step
from tests.lupin_engine.machine.charts import Bench, chart

HOLDS = {"pause": {"engage": "operator.pause", "release": ("operator.resume",), "code": "paused"}}


def asking(**more: Any) -> Bench:
    """Return a bench in a state that asks; `more` are further parts of that state."""
    ask = {"question": lambda env: f"deeper than {env['context']['depth']} m?", "choices": ["no", "yes"]}
    by = ("set", {"by": lambda env: env["event"]["by"]})
    on = {"answer.no": {"target": "N", "do": [by]}, "answer.yes": {"target": "Y", "do": [by]}, "out": "Z"}
    states = {"A": {"ask": ask, "on": on, **more}, "N": {}, "Y": {}, "Z": {"on": {"back": "A"}}}
    return Bench(chart(states, holds=HOLDS, context={"depth": 2, "by": ""}))


def test_who_passes_through_a_state_is_asked_nothing() -> None:
    """The log names no question that nobody could answer."""
    bench = asking(always="Z")
    assert (bench.leaves, bench.steps[0].notes, bench.machine.view.asking) == (["Z"], (), ())


def refusal(step: Step) -> str:
    """Return why a request was refused."""
    assert step.accepted is False
    assert step.refusal is not None
    return f"{step.refusal.code}: {step.refusal.text}"


def test_a_question_is_open_with_its_choices_and_its_time() -> None:
    """What it says is worked out when it is asked."""
    bench = asking()
    (question,) = bench.machine.view.asking
    assert (question.state, question.question, question.default) == ("A", "deeper than 2 m?", "no")
    assert [(choice.name, choice.label) for choice in question.choices] == [("no", "NO"), ("yes", "YES")]
    assert (question.deadline, question.left) == (10.0, None)
    assert bench.steps[0].notes == ("asks: deeper than 2 m?",)


def test_an_answer_is_a_request_that_is_accepted_once() -> None:
    """Then nothing is asked any more."""
    bench = asking()
    step = bench.send("answer.yes")
    assert (step.accepted, bench.leaves, bench.context["by"]) == (True, ["Y"], "operator")
    assert bench.machine.view.asking == ()
    assert refusal(bench.send("answer.yes")) == "not_possible: the answer 'yes' is refused: nothing is asked"
    assert bench.machine.next_deadline is None


def test_what_is_no_choice_is_refused_with_those_that_are() -> None:
    """The question stays open."""
    bench = asking()
    told = "not_possible: the answer 'yse' is refused: it is no choice; did you mean 'yes'?"
    assert refusal(bench.send("answer.yse")) == told
    assert len(bench.machine.view.asking) == 1


def test_nobody_answers() -> None:
    """The default counts, exactly at the deadline."""
    bench = asking()
    assert bench.wait(9.9) == []
    (step,) = bench.wait(0.1)
    assert (step.event.name, bench.leaves, bench.context["by"]) == ("timer.ask", ["N"], "default")
    assert bench.machine.view.asking == ()


def test_a_hold_stops_the_clock_and_the_answer() -> None:
    """The time that was left is left after it; whoever answers meanwhile is told why not."""
    bench = asking()
    bench.wait(4.0)
    bench.send("operator.pause")
    (question,) = bench.machine.view.asking
    assert (question.deadline, question.left) == (None, 6.0)
    assert refusal(bench.send("answer.yes")) == "paused: yes refused: paused by the operator"
    assert bench.wait(100.0) == []
    bench.send("operator.resume")
    assert bench.machine.view.asking[0].deadline == 110.0
    bench.wait(6.0)
    assert bench.leaves == ["N"]


def test_an_answer_that_says_so_passes_a_hold() -> None:
    """By `during`, as every transition does."""
    bench = asking(on={"answer.no": {"target": "N", "during": ["pause"]}, "answer.yes": "Y"})
    bench.send("operator.pause")
    assert bench.send("answer.no").accepted
    assert bench.leaves == ["N"]


@pytest.mark.parametrize("way", ["out", "answer.no"])
def test_a_state_that_is_left_asks_no_more(way: str) -> None:
    """And one that is entered again asks anew, with all of its time."""
    bench = asking(on={"answer.no": "Z", "answer.yes": "Y", "out": "Z"})
    bench.wait(3.0)
    bench.send(way)
    assert bench.machine.view.asking == ()
    bench.send("back")
    assert bench.machine.view.asking[0].deadline == 13.0


def test_an_answer_without_a_way_closes_the_question() -> None:
    """A transition without a target is carried out, and nothing is asked after it."""
    bench = asking(on={"answer.no": "N", "answer.yes": {"do": [("set", {"depth": 3})]}})
    assert bench.send("answer.yes").accepted
    assert (bench.leaves, bench.context["depth"], bench.machine.view.asking) == (["A"], 3, ())
    assert bench.wait(100.0) == []


def test_a_question_survives_a_restart() -> None:
    """With its deadline."""
    bench = asking()
    bench.wait(4.0)
    bench.restart()
    assert bench.machine.view.asking[0].deadline == 10.0
    assert bench.send("answer.yes").accepted


def test_a_question_that_cannot_be_worked_out_is_an_error() -> None:
    """With its place, and nothing is asked."""
    ask = {"question": lambda env: env["absent"], "choices": ["no"]}
    bench = Bench(chart({"A": {"ask": ask, "on": {"answer.no": "B"}}, "B": {}, "FAULT": {}}))
    assert bench.leaves == ["FAULT"]
    assert bench.machine.view.detail == "test.yaml:1:1: ask: there is no 'absent'"


def test_what_can_be_answered_is_explained() -> None:
    """As every request is."""
    bench = asking()
    told = {found.event: found for found in bench.machine.explain(0.0)}
    assert told["answer.yes"].possible
    bench.send("out")
    told = {found.event: found for found in bench.machine.explain(0.0)}
    assert str(told["answer.yes"]) == "answer.yes: the answer 'yes' is refused: nothing is asked"


def test_an_answer_counts_for_every_question_that_has_the_choice() -> None:
    """Two regions may ask at the same time; what only one of them can be answered leaves the other open."""

    def region(*choices: str) -> dict[str, Any]:
        states = {
            "ASK": {
                "ask": {"question": "so?", "choices": choices},
                "on": {f"answer.{choice}": "OVER" for choice in choices},
            },
            "OVER": {},
        }
        return {"states": states}

    both = {"kind": "parallel", "states": {"L": region("yes", "no"), "R": region("yes", "later")}}
    for answer, still in (("yes", []), ("later", ["P.L.ASK"])):
        bench = Bench(chart({"P": both}))
        assert bench.send(f"answer.{answer}").accepted
        assert [question.state for question in bench.machine.view.asking] == still


def test_a_default_counts_for_every_question_that_has_the_choice() -> None:
    """As an answer does: nobody is asked again for what was carried out already."""

    def region(after: float) -> dict[str, Any]:
        ask = {"question": "so?", "choices": ["no"], "after": after}
        count = ("set", {"count": lambda env: env["context"]["count"] + 1})
        return {"states": {"ASK": {"ask": ask, "on": {"answer.no": {"do": [count]}}}}}

    both = {"kind": "parallel", "states": {"L": region(5.0), "R": region(8.0)}}
    bench = Bench(chart({"P": both}, context={"count": 0}))
    bench.wait(5.0)
    assert (bench.context["count"], bench.machine.view.asking) == (2, ())
    assert bench.wait(100.0) == []


@pytest.mark.parametrize(("choices", "deadlines"), [(["no", "yes"], [10.0]), (["no", "later"], [])])
def test_a_question_goes_on_in_missions_that_are_loaded_anew(
    choices: list[str], deadlines: list[float]
) -> None:
    """Where they ask the same; another question is asked when its state is entered again."""

    def deeper(given: list[str]) -> Bench:
        return asking(ask={"question": "deeper?", "choices": given}, on={"answer.no": "N"})

    bench = deeper(["no", "yes"])
    bench.wait(4.0)
    bench.machine = successor(bench.machine, World(deeper(choices).machine.chart, {}))
    bench.machine.go_on(bench.now)
    assert [question.deadline for question in bench.machine.view.asking] == deadlines
    bench.wait(6.0)
    assert bench.leaves == (["N"] if deadlines else ["A"])
