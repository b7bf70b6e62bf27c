"""Behavior trees as skeletons of missions: they check, and walk the tree's two outcomes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from lupin_cli.verbs.import_ import import_
from lupin_engine.errors import Severity, UsageError
from lupin_engine.missions.load import check_chart
from lupin_engine.replay import yaml_text
from lupin_scxml import from_tree
from tests import shipped

LIFECYCLE = Path(__file__).parents[3] / "missions" / "lifecycle.yaml"


def tree(inside: str, more: str = "") -> bytes:
    """Return a document with one tree, and more of them."""
    main = '<root BTCPP_format="4" main_tree_to_execute="Main">' if more.count("BehaviorTree") else "<root>"
    return f'{main}<BehaviorTree ID="Main">{inside}</BehaviorTree>{more}</root>'.encode()


def states(inside: str, more: str = "") -> dict[str, Any]:
    """Return the states of the mission that a tree becomes."""
    found: dict[str, Any] = from_tree(tree(inside, more), "M").mission["states"]
    return found


def ways(state: dict[str, Any]) -> tuple[str, str]:
    """Return where a leaf leads, when it succeeds and when it fails."""
    success, failure = state["on"].values()
    return success, failure


def test_a_leaf_is_a_question_that_says_what_is_to_be_written() -> None:
    found = from_tree(tree('<Spin name="TurnRound" spin_dist="1.57" error_code_id="{code}"/>'), "M")
    leaf = found.mission["states"]["TURN_ROUND"]
    assert leaf["summary"] == "To be written: Spin (spin_dist=1.57, error_code_id={code})"
    assert ways(leaf) == ("done", "TREE_FAILED")
    assert leaf["ask"]["default"] == "turn_round_failed"  # nothing succeeds that is not written
    assert [(note.text, note.to_write) for note in found.notes] == [
        ("TURN_ROUND: Spin (spin_dist=1.57, error_code_id={code})", True)
    ]


def test_a_sequence_ends_with_the_first_failure_a_fallback_with_the_first_success() -> None:
    row = states("<Sequence><A/><Fallback><B/><C/></Fallback><D/></Sequence>")["SEQUENCE"]["states"]
    assert ways(row["A"]) == ("FALLBACK", "TREE_FAILED")
    choice = row["FALLBACK"]["states"]
    assert (ways(choice["B"]), ways(choice["C"])) == (("D", "C"), ("D", "TREE_FAILED"))
    assert ways(row["D"]) == ("done", "TREE_FAILED")


@pytest.mark.parametrize(
    ("decorator", "expected"),
    [
        ("Inverter", ("TREE_FAILED", "done")),
        ("ForceSuccess", ("done", "done")),
        ("ForceFailure", ("TREE_FAILED", "TREE_FAILED")),
        ("RateController", ("done", "TREE_FAILED")),
    ],
)
def test_a_decorator_changes_where_its_child_leads(decorator: str, expected: tuple[str, str]) -> None:
    assert ways(states(f"<{decorator}><A/></{decorator}>")["A"]) == expected


def test_a_recovery_comes_after_a_failure_so_many_times() -> None:
    found = states('<RecoveryNode number_of_retries="6" name="Go"><A/><B/></RecoveryNode>')["GO"]
    inside = found["states"]
    assert found["initial"] == "GO_BEGIN"
    assert inside["GO_BEGIN"] == {"always": {"target": "A", "do": {"set": {"go_count": 0}}}}
    assert (ways(inside["A"]), ways(inside["B"])) == (("done", "GO_AGAIN"), ("A", "TREE_FAILED"))
    assert inside["GO_AGAIN"]["always"] == [
        {"target": "B", "guard": "go_count < 6", "do": {"set": {"go_count": "${ go_count + 1 }"}}},
        "TREE_FAILED",
    ]


@pytest.mark.parametrize(
    ("written", "again", "guard"),
    [
        ('<RetryUntilSuccessful num_attempts="3" name="R"><A/></RetryUntilSuccessful>', 1, "r_count < 2"),
        ('<Repeat num_cycles="3" name="R"><A/></Repeat>', 0, "r_count < 2"),
        ('<Repeat num_cycles="-1" name="R"><A/></Repeat>', 0, ""),
    ],
)
def test_a_loop_comes_again_after_one_outcome(written: str, again: int, guard: str) -> None:
    inside = states(written)["R"]["states"]
    assert ways(inside["A"])[again] == "R_AGAIN"
    assert (
        inside["R_AGAIN"]["always"] == "A" if not guard else inside["R_AGAIN"]["always"][0]["guard"] == guard
    )


def test_a_subtree_stands_where_it_is_used_and_one_of_another_file_is_left_to_write() -> None:
    other = '<BehaviorTree ID="Two"><A/></BehaviorTree>'
    row = states('<Sequence><SubTree ID="Two"/><SubTree ID="Three"/></Sequence>', other)["SEQUENCE"]["states"]
    assert ways(row["TWO"]["states"]["A"]) == ("THREE", "TREE_FAILED")
    assert row["THREE"]["summary"] == "To be written: SubTree Three"


def test_the_ports_of_a_subtree_stand_where_its_leaves_use_them() -> None:
    other = '<BehaviorTree ID="GoTo"><Move goal="{target}" speed="{speed}" to="{map}"/></BehaviorTree>'
    used = '<SubTree ID="GoTo" target="dock" speed="{fast}"/><SubTree ID="GoTo" target="{where}"/>'
    row = states(f"<Sequence>{used}</Sequence>", other)["SEQUENCE"]["states"]
    leaves = [leaf for each in row.values() for leaf in each["states"].values()]
    assert [leaf["summary"] for leaf in leaves] == [
        "To be written: Move (goal=dock, speed={fast}, to={map})",
        "To be written: Move (goal={where}, speed={speed}, to={map})",
    ]


def test_a_round_robin_goes_on_with_the_next_child_and_fails_when_all_have() -> None:
    inside = states('<RoundRobin name="Turns"><A/><B/></RoundRobin>')["TURNS"]["states"]
    assert (ways(inside["A"]), ways(inside["B"])) == (("done", "TURNS_AGAIN"), ("done", "TURNS_AGAIN"))
    assert inside["TURNS_TURN"]["always"] == [
        {"target": "A", "guard": "turns_next == 0", "do": {"set": {"turns_next": 1}}},
        {"target": "B", "do": {"set": {"turns_next": 0}}},
    ]
    assert inside["TURNS_AGAIN"]["always"][0]["guard"] == "turns_count < 1"


def test_a_limit_and_a_delay_are_times_of_the_state() -> None:
    found = states('<Timeout msec="1500" name="T"><Delay delay_msec="500" name="D"><A/></Delay></Timeout>')[
        "T"
    ]
    assert found["after"] == {"1.5 s": "TREE_FAILED"}
    assert found["states"]["D"]["states"]["D_BEGIN"] == {"after": {"0.5 s": "A"}}


def test_a_switch_asks_which_case_it_is() -> None:
    found = states('<Switch2 variable="{x}" case_1="a" case_2="b" name="S"><A/><B/><C/></Switch2>')["S"]
    choose = found["states"]["S_CASE"]
    assert choose["summary"] == "To be written: which case is {x}?"
    assert choose["ask"]["choices"] == {"s_1": "a", "s_2": "b", "s_3": "another"}
    assert choose["on"] == {"answer.s_1": "A", "answer.s_2": "B", "answer.s_3": "C"}


EVERYTHING = """
<Sequence name="all of it">
  <Parallel name="both" success_count="2"><A/><Sequence><B/><Wait wait_duration="5.0"/></Sequence></Parallel>
  <ReactiveFallback><Action ID="Old"/><RoundRobin name="turns"><C/><D/></RoundRobin></ReactiveFallback>
  <IfThenElse><Asked/><Yes/><No/></IfThenElse>
  <WhileDoElse><Drive name="über"/><Drive name="FAULT"/></WhileDoElse>
  <Fallback><RecoveryNode><F/><G/></RecoveryNode><AlwaysSuccess/></Fallback>
  <RetryUntilSuccessful num_attempts="2"><KeepRunningUntilFailure><E _skipIf="x"/></KeepRunningUntilFailure>
  </RetryUntilSuccessful>
</Sequence>
"""


def test_a_tree_of_everything_checks(tmp_path: Path) -> None:
    found = from_tree(tree(EVERYTHING), "M")
    file = tmp_path / "m.yaml"
    file.write_text(yaml_text(found.mission), "utf-8")
    chart, diagnostics = check_chart(LIFECYCLE, [file], shipped.catalog())
    assert [each for each in diagnostics if each.severity is Severity.ERROR] == []
    assert chart is not None
    assert [note.text for note in found.notes if note.line == 3] == [
        "A: A",
        "B: B",
    ]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (b"<scxml/>", "line 1: the document is <scxml> without a <BehaviorTree>"),
        (
            b'<root main_tree_to_execute="X"><BehaviorTree ID="Y"/></root>',
            "line 1: the document has no tree 'X'; write main_tree_to_execute=... of one of these: 'Y'",
        ),
        (
            b'<root><BehaviorTree ID="Y"/><BehaviorTree ID="Z"/></root>',
            "line 1: the document does not say which tree is executed; "
            "write main_tree_to_execute=... of one of these: 'Y', 'Z'",
        ),
        (tree(""), "line 1: <BehaviorTree> has 0 children; one is wanted"),
        (tree("<Inverter><A/><B/></Inverter>"), "line 1: <Inverter> has 2 children; one is wanted"),
        (tree("<RecoveryNode><A/></RecoveryNode>"), "line 1: <RecoveryNode> has 1 children; two are wanted"),
        (tree("<A>"), "line 1: no XML: mismatched tag"),
    ],
)
def test_what_is_no_tree_is_refused(text: bytes, problem: str) -> None:
    with pytest.raises(UsageError) as refused:
        from_tree(text, "M")
    assert str(refused.value) == problem


def test_the_command_lists_what_is_left_to_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("nav.xml").write_bytes(tree("<Sequence><ComputePath/><Wait wait_duration='5'/></Sequence>"))
    done = CliRunner().invoke(import_, ["tree", "nav.xml"])
    assert done.stdout.splitlines() == [
        "wrote missions/lifecycle.yaml",
        "wrote missions/nav.yaml",
        "nav.xml:1: to be written: COMPUTE_PATH: ComputePath",
        "1 mission, no errors, no warnings",
        "next: lupin simulate nav -i; lupin diagram nav",
    ]
    assert (
        (tmp_path / "missions" / "nav.yaml")
        .read_text("utf-8")
        .startswith("# Made from nav.xml by 'lupin import tree'.\n")
    )
