"""What is learned from journals: rows, hours, failures, drain and drift; and what is expected by it."""

from __future__ import annotations

import importlib
import math
import random
from pathlib import Path
from types import ModuleType

import pytest

from lupin_engine.errors import ChartError
from lupin_engine.missions.selection import load_missions
from lupin_engine.replay.yaml_text import yaml_text
from lupin_engine.runtime.history import TIMED_OUT
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.scripted import AnyOf, Between, MockOutcome
from lupin_verify.drift import drifts
from lupin_verify.expecting import expect, learned_script
from lupin_verify.learning import (
    Drained,
    Evidence,
    ObservedAttempt,
    bands,
    fail_more,
    table,
)
from lupin_verify.rates import Rates, read_rates
from tests import shipped
from tests.benchmarking import BENCHMARKS

LOADED = load_missions(["inspection"], shipped.catalog())


@pytest.fixture
def robots(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The benchmark with the hidden robots."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module("learning")


def drives(
    target: str, took: list[float], metres: float = 2.2, hour: int = 9, begin: float = 0.0
) -> list[ObservedAttempt]:
    """Return drives to a target, one an hour; infinity is a failure."""
    return [
        ObservedAttempt(
            "nav.go_to", target, metres, hour, begin + 3600.0 * number, min(one, 3.0), "nav_status_6"
        )
        if math.isinf(one)
        else ObservedAttempt("nav.go_to", target, metres, hour, begin + 3600.0 * number, one, "")
        for number, one in enumerate(took)
    ]


def noisy(count: int, seconds: float = 10.0, seed: int = 1) -> list[float]:
    """Return durations around `seconds`."""
    dice = random.Random(seed)
    return [seconds * dice.lognormvariate(0.0, 0.1) for _ in range(count)]


def rates_of(seen: list[ObservedAttempt], folder: Path, **more: object) -> Rates:
    """Return what was learned, written to a file and read back."""
    file = folder / "learned.yaml"
    found = Evidence(seen, missions=3, first="2026-03-01 08:00", last="2026-03-02 09:00")
    file.write_text(yaml_text({**table(found), **more}), encoding="utf-8")
    return read_rates(file, LOADED.chart)


# -- rows -------------------------------------------------------------------------------------------------


def test_the_slowest_tenth_has_a_row_of_its_own() -> None:
    """One drive in fifty that took five times as long makes no tenth of all slow."""
    (body, fast), (tail, slow) = bands([*noisy(49), 50.0])
    assert (body, tail) == (45, 5)
    assert fast[-1] == slow[0] < 13.0
    assert slow[-1] == 50.0
    assert list(bands([2.0, 1.0])) == [(2, [1.0, 2.0])]


def test_the_finest_row_with_enough_answers(tmp_path: Path) -> None:
    """To tag 1 five drives of 2 to 3 m are known, to tag 7 three: they count for drives of that length."""
    seen = drives("1", [4.0] * 5) + drives("7", [9.0] * 3) + drives("1", [20.0], metres=7.0)
    rules = [rule for rule in rates_of(seen, tmp_path).own.rules if rule.hour is None]
    assert [(rule.target, rule.metres and rule.metres.low) for rule in rules] == [
        ("1", 2.0),
        (None, 2.0),
        (None, None),
    ]
    assert rules[0].outcomes == (MockOutcome(after=4.0),)
    assert rules[1].outcomes == (MockOutcome(after=Between(4.0, 9.0, (4.0,) * 4 + (9.0,) * 2)),)


def test_failures_are_pooled_but_for_a_target_that_fails_more(tmp_path: Path) -> None:
    """One failure among five drives is no fifth; all of 8 are."""
    seen = [one for tag in range(1, 6) for one in drives(str(tag), [4.0] * 20)]
    seen += drives("6", [4.0] * 5 + [math.inf]) + drives("7", [math.inf] * 8)
    rules = {rule.target: rule.outcomes[0] for rule in rates_of(seen, tmp_path).own.rules}
    like_others, worse = rules["6"], rules["7"]
    assert isinstance(like_others, AnyOf)
    assert like_others.weights == (5.0, pytest.approx(5 / 105, rel=0.01))
    assert worse == MockOutcome(after=3.0, code="nav_status_6")
    assert not fail_more(1, 5, 1, 100)
    assert fail_more(3, 5, 1, 100)
    assert not fail_more(0, 5, 0, 0)


def test_a_timeout_is_learned_as_a_server_that_falls_silent(tmp_path: Path) -> None:
    seen = [*drives("1", [4.0] * 9), ObservedAttempt("nav.go_to", "1", 2.2, 9, 0.0, 60.0, TIMED_OUT)]
    outcome = rates_of(seen, tmp_path).own.rules[0].outcomes[0]
    assert isinstance(outcome, AnyOf)
    assert outcome.outcomes[1] == MockOutcome(never=True)


def test_an_hour_has_rows_of_its_own_where_there_are_enough(tmp_path: Path) -> None:
    """At 14 h drives take longer and fail; at 8 h too few were done for a row of a target in that hour."""
    seen = [one for hour in range(9, 14) for one in drives("1", [10.0] * 5, hour=hour)]
    seen += drives("1", [10.0] * 4, hour=8) + drives("2", [10.0], hour=8)
    seen += drives("1", [*[15.0] * 6, *[math.inf] * 6], hour=14)
    rates = rates_of(seen, tmp_path)

    def outcome(target: str, hour: int) -> MockOutcome | AnyOf:
        covers = (rule for rule in rates.own.rules if rule.covers("nav.go_to", {}, target, 2.2, hour))
        return next(covers).outcomes[0]

    late, early = outcome("1", 14), outcome("1", 8)
    assert isinstance(late, AnyOf)
    assert late.outcomes == (MockOutcome(after=15.0), MockOutcome(after=3.0, code="nav_status_6"))
    assert late.weights == (6.0, 6.0)
    assert isinstance(early, AnyOf)
    assert {isinstance(one, MockOutcome) and one.code for one in early.outcomes} == {""}
    assert outcome("2", 8) == outcome("9", 8) == MockOutcome(after=10.0)
    assert outcome("1", 9) == MockOutcome(after=10.0)


def test_driving_and_standing_drain_apart_where_they_can_be_told() -> None:
    assert Drained(100.0, 10.0, 0.15, 10.0, 0.05).rates == (pytest.approx(0.001), pytest.approx(0.005))
    assert Drained(100.0, 10.0, 0.15, 0.1, 0.05).rates == (0.0, pytest.approx(0.2 / 10.1))
    assert Drained().rates == (0.0, 0.0)


# -- drift -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("newest", [[15.0] * 5, [math.inf] * 5])
def test_a_target_that_became_slow_or_fails_is_reported_with_its_beginning(newest: list[float]) -> None:
    others = [one for tag in range(1, 4) for one in drives(str(tag), noisy(50, seed=tag))]
    (found,) = drifts([*others, *drives("7", [*noisy(50), *newest])])
    assert (found.operation, found.target, found.newest, found.before) == ("nav.go_to", "7", 5, 50)
    assert found.since == 50 * 3600.0
    assert found.slower == pytest.approx(newest[0] / 10.0 - 1.0, abs=0.1)


def test_a_slow_down_is_measured_beside_the_way_to_the_target() -> None:
    """Longer drives than before are not slower ones."""
    ways = [number * 7 % 10 + 1.0 for number in range(50)] + [9.0] * 10
    far = [one for n, way in enumerate(ways) for one in drives("7", [2.0 + way], way, 9, 3600.0 * n)]
    assert drifts(far) == []
    slow = [one._replace(seconds=one.seconds * 1.5) if one.wall >= 55 * 3600.0 else one for one in far]
    assert [(one.target, one.newest) for one in drifts(slow)] == [("7", 5)]


def test_chance_a_little_slower_outliers_and_too_few_are_not_reported() -> None:
    assert drifts(drives("7", noisy(500))) == []
    assert drifts(drives("7", [*noisy(50), *[11.9] * 10])) == []
    assert drifts(drives("7", [*noisy(50), 9.0, 50.0, 10.0, 50.0, 11.0])) == []
    assert drifts(drives("7", [*noisy(19), *[20.0] * 5])) == []
    assert len(drifts(drives("7", [*noisy(20), *[20.0] * 5]))) == 1
    assert drifts([]) == drifts(drives("7", [math.inf] * 3)) == []


# -- the file ----------------------------------------------------------------------------------------------


def test_a_file_that_was_edited_badly_tells_every_mistake_with_its_place(tmp_path: Path) -> None:
    wrong = {
        "mocks": [{"do": "nav.fly", "hour": 9, "then": {}}],
        "drain": [
            {"value": "robot.batery", "per_metre": "much"},
            {"value": "robot.battery", "per_metre": "-5 %"},
        ],
    }
    with pytest.raises(ChartError) as told:
        rates_of(drives("1", [4.0] * 5), tmp_path, **wrong)
    text = str(told.value)
    assert "unknown operation 'nav.fly'" in text
    assert "expected a share from 0 on, got -5 %" in text
    assert "unknown value 'robot.batery'; did you mean 'robot.battery'?" in text
    assert text.count("learned.yaml:") == 3


def test_too_little_is_told_instead_of_guessed(tmp_path: Path) -> None:
    """A target with three drives, and an operation that was never done."""
    at_tag_1 = drives("1", [4.0] * 20, metres=1.2) + drives("1", [4.0] * 20, metres=0.7)
    rates = rates_of(at_tag_1 + drives("7", [9.0] * 3, metres=7.0), tmp_path)
    script = learned_script(rates, LOADED.names[0], {"tag_sequence": ["7"]})
    found = expect(LOADED, rates, script, make_world(LOADED.chart, rates.parameters), range(10))
    assert "nav.go_to at 7 (3 seen): fewer than 5; those to any tag are used" in found.remarks
    assert "bridge.read_tag: never seen; it answers as the mock of its plugin does" in found.remarks


def test_a_battery_that_is_not_full_sends_the_robot_home(tmp_path: Path) -> None:
    drain = [{"value": "robot.battery", "per_metre": "1 %", "per_minute": "0 %"}]
    rates = rates_of(drives("1", [4.0] * 5), tmp_path, drain=drain)
    script = learned_script(rates, LOADED.names[0], {"tag_sequence": ["1", "7"]}, {"robot.battery": 0.205})
    found = expect(LOADED, rates, script, make_world(LOADED.chart, {}), range(10))
    assert found.stuck
    assert "battery_low" in next(iter(found.stuck))


# -- robots that the learner does not see --------------------------------------------------------------------


@pytest.fixture
def played(robots: ModuleType, tmp_path: Path) -> Path:
    """A folder with the journals of six missions to the same tags."""
    robot, asked = robots.HiddenRobot(3), robots.tours(3, ["1", "5", "12"])
    for number in range(6):
        robot.play(number, next(asked), tmp_path)
    return tmp_path


def test_a_journal_tells_what_the_robot_did(robots: ModuleType, played: Path) -> None:
    robot, found = robots.HiddenRobot(3), robots.gather(played, shipped.catalog())
    assert found.missions == 6
    assert not found.left_out
    assert (found.first, found.last[:10]) == ("2026-03-01 08:00", "2026-03-01")
    assert {one.target for one in found.seen if one.operation == "nav.go_to"} == {"1", "5", "12"}
    per_metre, per_minute = found.drained["robot.battery"].rates
    drained = found.drained["robot.battery"]
    minutes = drained.driving + drained.standing
    lost = per_metre * drained.metres + per_minute * minutes
    assert lost == pytest.approx(robot.per_metre * 1.2 * drained.metres + robot.per_minute * minutes, rel=0.3)


def test_damage_and_other_versions_are_left_out_and_told(robots: ModuleType, played: Path) -> None:
    first, second, third, *_ = sorted(played.glob("*.journal"))
    data = bytearray(first.read_bytes())
    data[len(data) // 2] ^= 0xFF
    first.write_bytes(data)
    second.write_bytes(b"lupin journal 7\n" + second.read_bytes()[16:])
    third.write_bytes(b"no journal at all")
    found = robots.gather(played, shipped.catalog())
    assert found.missions == 3
    assert len(found.left_out) == 3
    text = "\n".join(found.left_out)
    assert "is damaged at byte" in text
    assert "another version of the engine" in text


@pytest.mark.long
def test_durations_are_predicted_within_a_tenth(robots: ModuleType) -> None:
    off, line = robots.predicted(3, missions=50, then=200)
    assert max(map(abs, off)) < 0.1, line


@pytest.mark.long
def test_a_slow_down_at_one_tag_is_told_within_five_missions(robots: ModuleType) -> None:
    visits, found = robots.told(3, missions=50, share=1.5, most=5)
    assert 1 <= visits <= 5
    assert [one.target for one in found] == [robots.TAGS[3]]
