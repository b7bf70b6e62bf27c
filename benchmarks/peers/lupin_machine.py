"""Our machine as users have it: the missions stand in the shipped lifecycle, with the shipped catalog.

So each event meets the lifecycle's holds, the level of the battery, and two more levels of states. Modes:
none (the event is made once, outside the timed loop; the Step is returned and dropped), `fresh` (a new Event
for every step). Time stands still but for the timed chart.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from bench import FIRST_EVENTS, FOLDER, Bench, Reached, Unsupported, is_load, loading, reached

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Event, Start, done, observed
from lupin_engine.machine.machine import Machine
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.missions.load import forget, load_chart
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.runtime.setup import make_machine, make_world

VERSION = f"lupin-engine {version('lupin-engine')}"

_CHARTS = Path(__file__).resolve().parents[1] / "charts"
#: What a robot at rest reports.
_REPORTED = {"robot.estop": False, "robot.battery": 80.0, "plugins.missing": []}


def make(chart: str, mode: str = "") -> Bench:
    """Return a chart, running, its mission started."""
    if is_load(chart):
        return _load(int(chart.removeprefix("load-")))
    machine = _started(make_machine(_chart(chart), {}), chart)
    if chart == "timed":
        return _timed(machine, mode)
    run = {"": _plain, "fresh": _fresh}[mode](machine)
    return Bench(run, lambda: _reached(machine))


def further(chart: str) -> Callable[[], object]:
    """Return what makes one more machine of the same chart: parameters and compiled chart are shared."""
    world = make_world(_chart(chart), {})
    go = Event("go")

    def one() -> Machine:
        machine = _started(Machine(world), chart)
        for _ in range(FIRST_EVENTS):
            machine.handle(go, 0.0)
        return machine

    return one


def _chart(name: str) -> Chart:
    return load_chart(default_missions_folder() / LIFECYCLE, [_CHARTS / f"{name}.yaml"], load_catalog())


def _started(machine: Machine, chart: str) -> Machine:
    machine.start(0.0)
    machine.handle(done(next(iter(machine.memory.attempts)), {}), 0.0)  # the servers that BOOT waits for
    for name, value in _REPORTED.items():
        machine.handle(observed(name, value, 0.0), 0.0)
    _request(machine, chart.capitalize())
    return machine


def _request(machine: Machine, mission: str) -> None:
    request = Event("mission.start", {"mission_type": mission, "mission_id": "1"})
    assert machine.handle(request, 0.0).accepted, "the mission was refused"


def _leaves(machine: Machine) -> list[str]:
    active = machine.memory.configuration
    return [name for name in active if name and not any(other.startswith(f"{name}.") for other in active)]


def _reached(machine: Machine, count: int | None = None) -> Reached:
    return reached(_leaves(machine), machine.memory.context.get("count", count))


# -- what is timed ---------------------------------------------------------------------------------------


def _plain(machine: Machine) -> Callable[[int], None]:
    event, handle = Event("go"), machine.handle

    def run(number: int) -> None:
        for _ in range(number):
            handle(event, 0.0)

    return run


def _fresh(machine: Machine) -> Callable[[int], None]:
    handle = machine.handle

    def run(number: int) -> None:
        for _ in range(number):
            handle(Event("go"), 0.0)

    return run


def _timed(machine: Machine, mode: str) -> Bench:
    """Fire each deadline at its time, as a simulation does."""
    if mode == "fresh":
        raise Unsupported("no event")
    now, advance = 0.0, machine.advance

    def run(number: int) -> None:
        nonlocal now
        for _ in range(number):
            now = machine.next_deadline or 0.0
            advance(now)

    return Bench(run, lambda: _reached(machine, round(now)))


# -- loading ---------------------------------------------------------------------------------------------


def _load(states: int) -> Bench:
    """Load the mission that benchmarks/loading.py generates, in the shipped lifecycle, with all plugins."""
    sys.path.append(str(_CHARTS.parent))
    from loading import mission

    catalog = load_catalog()
    folder = Path(tempfile.mkdtemp(dir=FOLDER))
    lifecycle, file = folder / LIFECYCLE, folder / "generated.yaml"
    lifecycle.write_bytes((default_missions_folder() / LIFECYCLE).read_bytes())
    file.write_text(mission(states), encoding="utf-8")

    def load() -> Machine:
        forget()  # nothing may come from the cache
        machine = make_machine(load_chart(lifecycle, [file], catalog), {})
        machine.start(0.0)
        return machine

    return loading(load, _look)


def _look(machine: Machine) -> Reached:
    """Bring the loaded chart to the mission's first step."""
    first = next(iter(machine.memory.attempts))
    step = machine.handle(done(first, {}), 0.0)
    assert not any(isinstance(command, Start) for command in step.commands), "BOOT has more to wait for"
    _request(machine, "Generated")
    machine.advance(machine.next_deadline or 0.0)
    slot = machine.chart.missions["Generated"].state
    states = [name for name in machine.chart.states if name.startswith(f"{slot}.")]
    return reached(_leaves(machine), len(states))
