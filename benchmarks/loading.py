"""How long a mission of 10, 100 and 1,000 states takes from the file to a structure that a machine can run.

    .venv/bin/python benchmarks/loading.py [--rounds 15] [--states 10 100 1000] [--write FILE]

The missions are generated: areas of groups of steps, in the shipped lifecycle, about 6.6 lines a state; every
fifth step has a guard over parameters, every fifth invokes an operation. Each figure is the median of the
rounds in milliseconds, the fastest in brackets; everything is imported before, and the garbage of one round
is collected before the next. "whole" is from the files to a structure that a machine can run, "from the
cache" the same when nothing has changed, "without collection" the whole while no garbage is collected.
"""

from __future__ import annotations

import argparse
import gc
import itertools
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from lupin_engine.chart.compose.compose import Composed, compose
from lupin_engine.chart.documents import LifecycleNode, MissionNode
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.rules.checks import check_composed
from lupin_engine.chart.source import Map, read
from lupin_engine.chart.validation import read_document
from lupin_engine.machine.structure import DispatchTable, Structure, dispatch_table
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.missions.load import forget, load_chart
from lupin_engine.plugin.registry import Catalog, load_catalog

STEPS_IN_GROUP = 10
GROUPS_IN_AREA = 9

HEAD = """\
mission: Generated
summary: A mission as large as it is asked for.
params:
  drive_timeout_s: {type: duration, default: 60 s, min: 1 s, summary: longest drive}
  dwell_s: {type: duration, default: 2 s, summary: time to stay}
  travel_preset: {type: text, default: home, summary: arm preset to drive with}
  variance: {type: number, default: 0.25, min: 0, summary: largest variance to set off with}
  patience: {type: count, default: 3, summary: failures until a group is left}
codes:
  drive_timeout: {label: the drive took too long, severity: warn}
context:
  failures: {type: count, default: 0, summary: drives that failed}
  visited: {type: count, default: 0, summary: steps that were done}
initial: PREPARE
states:
  PREPARE:
    after: {1 s: AREA_1}
"""

#: One step of each kind. GROUP is the group's name in small letters, NEXT the step that follows; NUMBER is
#: another one in each step, so that no two of these expressions are the same.
STEPS = (
    """\
phase: DRIVING
entry:
  - arm.preset: {name: "${ param.travel_preset }"}
invoke:
  do: nav.go_to
  with: {pose: "${ home }", max_variance: "${ max(param.variance, NUMBER / 1000) }"}
  timeout: {after: "${ param.drive_timeout_s }", code: drive_timeout}
  retry: {attempts: 2, backoff: 1 s}
on_done: NEXT
on_error: {target: NEXT, do: [set: {failures: "${ failures + 1 }"}]}
""",
    """\
summary: Stays for a while, or until the operator has seen enough.
phase: DWELLING
after: {"${ param.dwell_s + 'NUMBER ms' }": NEXT}
on:
  operator.skip_current: {target: NEXT, during: pause}
""",
    """\
summary: Enough failures send the robot on.
always:
  - {target: NEXT, guard: "failures >= param.patience and visited > NUMBER"}
after: {5 s: NEXT}
""",
    """\
summary: Counts what was done and says so.
entry:
  - set: {visited: "${ visited + 1 }"}
  - raise: {event: GROUP.visited}
on:
  GROUP.visited: NEXT
""",
    """\
summary: Waits for the operator.
on:
  operator.skip_current: NEXT
after: {1 min: NEXT}
""",
)

_T = TypeVar("_T")


def mission(states: int) -> str:
    """Return the text of a mission with that many states, those that hold others included."""
    areas = list(_areas(states - 2))
    lines = []
    numbers = itertools.count(1)
    for number, groups in enumerate(areas, 1):
        leave = f"AREA_{number + 1}" if number < len(areas) else "done"
        lines += [f"  AREA_{number}:", f"    initial: GROUP_{number}_1", "    states:"]
        for index, steps in enumerate(groups, 1):
            name = f"GROUP_{number}_{index}"
            following = f"GROUP_{number}_{index + 1}" if index < len(groups) else leave
            lines += [f"      {name}:", f"        summary: Group {index} of area {number}."]
            lines += [f"        initial: {name}_STEP_1", "        states:"]
            lines += [f"          {line}" for line in _steps(name, steps, following, numbers)]
    return HEAD + "\n".join([*lines, "  done: {type: final}"]) + "\n"


def _areas(states: int) -> Iterator[list[int]]:
    """Yield for each area how many steps its groups have; areas and groups are states themselves."""
    while states > 0:
        states -= 1
        groups = []
        while states > 0 and len(groups) < GROUPS_IN_AREA:
            steps = max(1, min(STEPS_IN_GROUP, states - 1))
            groups.append(steps)
            states -= steps + 1
        yield groups


def _steps(group: str, count: int, following: str, numbers: Iterator[int]) -> Iterator[str]:
    for index in range(count):
        name, after = f"{group}_STEP_{index + 1}", f"{group}_STEP_{index + 2}"
        text = STEPS[index % len(STEPS)].replace("NEXT", after if index + 1 < count else following)
        text = text.replace("NUMBER", str(next(numbers)))
        yield f"{name}:"
        yield from (f"  {line}" for line in text.replace("GROUP.", f"{group.lower()}.").splitlines())


class Loading:
    """The phases of loading one generated mission, each with what the ones before it made."""

    def __init__(self, text: str, folder: Path, catalog: Catalog) -> None:
        self._catalog = catalog
        self._lifecycle = folder / LIFECYCLE
        self._lifecycle.write_text((default_missions_folder() / LIFECYCLE).read_text(encoding="utf-8"))
        self._mission = folder / "generated.yaml"
        self._mission.write_text(text, encoding="utf-8")

    def parse(self) -> list[Map]:
        """Read both files into mappings with places."""
        return [_there(read(path, Findings())) for path in (self._lifecycle, self._mission)]

    def documents(self, raw: list[Map]) -> tuple[LifecycleNode, MissionNode]:
        """Read the mappings as documents."""
        lifecycle, generated = raw
        return (
            _there(read_document(lifecycle, LifecycleNode, Findings())),
            _there(read_document(generated, MissionNode, Findings())),
        )

    def compose(self, documents: tuple[LifecycleNode, MissionNode]) -> Composed:
        """Compose the chart."""
        findings = Findings()
        composed = _there(compose(documents[0], [documents[1]], {}, self._catalog, findings))
        assert not findings.all, findings.all[0]
        return composed

    def check(self, composed: Composed) -> Composed:
        """Run the rules."""
        found = list(check_composed(composed))
        assert not found, found[0]
        return composed

    def structure(self, composed: Composed) -> DispatchTable:
        """Build what a machine runs on."""
        return DispatchTable(Structure(composed.chart))

    def whole(self) -> DispatchTable:
        """Do all of it, as for a mission that nobody has read yet."""
        forget()
        return self.again()

    def again(self) -> DispatchTable:
        """Load what may have been loaded before."""
        return dispatch_table(load_chart(self._lifecycle, [self._mission], self._catalog))


def _there(found: _T | None) -> _T:
    assert found is not None
    return found


def measure(rounds: int, work: Callable[[], object]) -> str:
    """Return how long `work` takes, in milliseconds: the median, the fastest in brackets."""
    taken = []
    for _ in range(rounds):
        gc.collect()
        begun = time.perf_counter()
        work()
        taken.append(1e3 * (time.perf_counter() - begun))
    return f"{statistics.median(taken):9.1f} ({min(taken):.1f})"


def phases(text: str, rounds: int, catalog: Catalog) -> dict[str, str]:
    """Measure every phase for one mission."""
    with tempfile.TemporaryDirectory() as folder:
        loading = Loading(text, Path(folder), catalog)
        found = {"parse": measure(rounds, loading.parse)}
        raw = loading.parse()
        found["documents"] = measure(rounds, lambda: loading.documents(raw))
        documents = loading.documents(raw)
        found["compose"] = measure(rounds, lambda: loading.compose(documents))
        composed = loading.compose(documents)
        found["checks"] = measure(rounds, lambda: loading.check(composed))
        found["machine structure"] = measure(rounds, lambda: loading.structure(composed))
        found["whole"] = measure(rounds, loading.whole)
        found["from the cache"] = measure(rounds, loading.again)
        gc.disable()
        found["without collection"] = measure(rounds, loading.whole)
        gc.enable()
    return found


def main() -> None:
    """Measure each size and print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--states", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--write", type=Path, help="write the largest mission there and measure nothing")
    given = parser.parse_args()
    if given.write is not None:
        given.write.write_text(mission(max(given.states)), encoding="utf-8")
        return
    catalog = load_catalog()
    columns = {}
    for states in given.states:
        text = mission(states)
        print(f"{states} states: {text.count(chr(10))} lines, {len(text)} characters")
        columns[states] = phases(text, given.rounds, catalog)
    for name in next(iter(columns.values())):
        print(f"{name:20}" + "".join(f"{columns[states][name]:>20}" for states in columns))


if __name__ == "__main__":
    main()
