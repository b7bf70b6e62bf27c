"""When what has died is started again: time is an argument."""

from __future__ import annotations

from lupin_ros.launch.respawn import BACK_AFTER_S, FORGIVEN_AFTER_S, Respawns


def test_three_times_and_no_more() -> None:
    """After 1, 4 and 10 seconds; then it is said since when it is gone."""
    respawns, now, told = Respawns(), 100.0, []
    for _ in range(4):
        told.append(respawns.died("twin", now, f"12:00:{now - 100:02.0f}"))
        now += 20.0
        assert respawns.due(now) == (["twin"] if "started again in" in told[-1] else [])
        assert respawns.due(now) == []
    assert told == [
        "twin is started again in 1 s (1 of 3)",
        "twin is started again in 4 s (2 of 3)",
        "twin is started again in 10 s (3 of 3)",
        "twin is gone since 12:00:00, and is not started again: it has died 4 times",
    ]


def test_not_before_its_time() -> None:
    """Each waits for itself."""
    respawns = Respawns()
    respawns.died("twin", 100.0, "12:00:00")
    respawns.died("arm", 100.5, "12:00:00")
    assert respawns.due(100.9) == []
    assert respawns.due(101.2) == ["twin"]
    assert respawns.due(101.5) == ["arm"]


def test_who_is_back() -> None:
    """Once, when it has run for a while; a death before that counts on."""
    respawns = Respawns()
    respawns.died("twin", 100.0, "12:00:00")
    assert respawns.back({"twin"}, 200.0) == []
    assert respawns.due(101.0) == ["twin"]
    assert respawns.back({"twin"}, 101.0 + BACK_AFTER_S / 2) == []
    respawns.died("twin", 104.0, "12:00:04")
    assert respawns.due(108.0) == ["twin"]
    assert respawns.back(set(), 108.0 + BACK_AFTER_S) == []
    assert respawns.back({"twin"}, 108.0 + BACK_AFTER_S) == ["twin is back; it was gone since 12:00:00"]
    assert respawns.back({"twin"}, 120.0) == []


def test_a_long_life_is_a_new_beginning() -> None:
    """A node that dies once a day is started again every day."""
    respawns, now = Respawns(), 0.0
    for _ in range(10):
        assert respawns.died("twin", now, "12:00:00") == "twin is started again in 1 s (1 of 3)"
        assert respawns.due(now + 1.0) == ["twin"]
        assert respawns.back({"twin"}, now + 60.0)
        now += 1.0 + FORGIVEN_AFTER_S


def test_what_others_start_again() -> None:
    """With --no-respawn nothing is, and that is said."""
    respawns = Respawns(respawn=False)
    told = respawns.died("twin", 100.0, "12:00:00")
    assert told == "twin is gone since 12:00:00; something else is to start it again (--no-respawn)"
    assert respawns.due(1000.0) == []
