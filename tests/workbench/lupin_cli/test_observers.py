"""Who follows a run: what is written of it, line by line, and the picture that is saved."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from lupin_cli.terminal.observers import Heard, JsonObserver, SavingPicture
from lupin_engine.chart.model import Chart
from lupin_engine.errors import Severity
from lupin_greenhouse.profile import PROFILE
from lupin_ros.launch.monitor import RunMonitor
from tests import shipped
from tests.lupin_ros.launch.messages import MISSION_ID, observation, state


class Notes:
    """An observer that keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[str, Severity]] = []

    def note(self, text: str, severity: Severity = Severity.INFO) -> None:
        self.told.append((text, severity))

    def arrived(self, kind: str, data: Mapping[str, Any], monitor: RunMonitor) -> None:
        self.told.append((kind, Severity.INFO))

    def show(self, monitor: RunMonitor) -> None:
        self.told.append(("show", Severity.INFO))

    def close(self, monitor: RunMonitor | None, code: int) -> None:
        self.told.append((f"close {code}", Severity.INFO))


@pytest.fixture(scope="module")
def chart() -> Chart:
    """The inspection mission."""
    return shipped.mission("inspection")


@pytest.fixture
def monitor() -> RunMonitor:
    """A mission that has read one of two tags."""
    monitor = RunMonitor(PROFILE, MISSION_ID, 100.0)
    monitor.take(*state(current_target="1", targets_completed=1, targets_total=2), at=103.0)
    monitor.take(*observation("1", {"co2": 412.0}), at=103.0)
    return monitor


def test_a_short_mission_is_drawn_at_its_end(chart: Chart, monitor: RunMonitor, tmp_path: Path) -> None:
    """One without a middle; folders are made, and nothing is fetched from the web."""
    inner, file = Notes(), tmp_path / "deep" / "run.svg"
    saving = SavingPicture(inner, chart, file)
    saving.show(monitor)
    saving.close(monitor, 0)
    assert file.read_text(encoding="utf-8").startswith("<svg")
    assert "http" not in file.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "").replace(
        "https://www.textualize.io", ""
    )
    assert [text for text, _ in inner.told] == ["show", "close 0"]


def test_a_picture_that_cannot_be_saved_ends_no_run(
    chart: Chart, monitor: RunMonitor, tmp_path: Path
) -> None:
    """The robot may be on its way: it is told, and everything goes on."""
    (tmp_path / "file").touch()
    inner = Notes()
    SavingPicture(inner, chart, tmp_path / "file" / "run.svg").close(monitor, 0)
    said, ended = inner.told
    assert said == (f"no picture in {str(tmp_path / 'file' / 'run.svg')!r}: File exists", Severity.WARN)
    assert ended == ("close 0", Severity.INFO)


def test_programs_get_a_state_only_when_it_is_another(monitor: RunMonitor) -> None:
    """The stamp is no news: it changes five times a second."""
    lines: list[dict[str, Any]] = []
    observer = JsonObserver(lambda line: lines.append(json.loads(line)))
    kind, data = state(current_target="5")
    for stamp in (1, 2):
        observer.arrived(kind, {**data, "header": {"stamp": stamp}}, monitor)
    kind, data = observation("1", {"co2": 412.0})
    observer.arrived(kind, data, monitor)
    observer.close(monitor, 1)
    assert [line["type"] for line in lines] == ["state", "observation", "result"]
    assert (lines[0]["current_target"], "header" in lines[0]) == ("5", False)
    assert (lines[1]["tag"], lines[1]["values"]) == ("1", {"co2": 412.0})
    assert (lines[2]["exit_code"], lines[2]["counts"]["OK"]) == (1, 1)


def test_an_observer_that_nobody_hears_stops_the_run_once(monitor: RunMonitor) -> None:
    """A closed terminal, or a pipe whose reader has left; nothing more is written there."""

    class Unheard(Notes):
        def note(self, text: str, severity: Severity = Severity.INFO) -> None:
            super().note(text, severity)
            raise BrokenPipeError

    inner = Unheard()
    stops: list[str] = []
    heard = Heard(inner, lambda: stops.append("stop"))
    heard.show(monitor)
    heard.arrived("state", {}, monitor)
    heard.note("one")
    heard.note("two")
    heard.close(monitor, 130)
    assert [text for text, _ in inner.told] == ["show", "state", "one"]
    assert stops == ["stop"]
