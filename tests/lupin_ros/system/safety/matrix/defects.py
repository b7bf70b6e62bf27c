"""Planted defects: one interlock at a time is taken away in the nodes, and the table must notice it.

A defect is a piece of Python that runs in a module of the product right after its import, in every node of
the bench, and in no file of the product. The cell where its row and its column cross is run first, then the
others of both, until one of them is wrong.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.lupin_ros.system.safety.matrix.table import BEFORE, DURING, Cell, cell, cells

#: What Python does first in each node: where the module is imported, plant the defect, and note that.
SITE = """\
import importlib.util, os, sys
class _Planter:
    def find_spec(self, name, path=None, target=None):
        if name != {module!r}:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module
        def exec_module(module):
            load(module)
            exec({code!r}, module.__dict__)
            with open({planted!r}, "a") as file:
                file.write(f"{{os.getpid()}}\\n")
        spec.loader.exec_module = exec_module
        return spec
sys.meta_path.insert(0, _Planter())
"""


@dataclass(frozen=True)
class Defect:
    """An interlock that is taken away: `code` runs in `module`; its row, column and order must notice it."""

    name: str
    what: str
    module: str
    code: str
    source: str
    stop: str
    order: str

    def cells(self) -> Iterator[Cell]:
        """Yield the cell where it must be seen, then the rest of its row and column."""
        first = cell(self.source, self.stop, self.order)
        yield first
        for each in [*cells(sources=(self.source,)), *cells(stops=(self.stop,))]:
            if each.applies and each.name != first.name and not each.allowed:
                yield each


DEFECTS = (
    Defect(
        "mission_deaf",
        "the orchestrator does not hear the stop",
        "lupin_nav.client",
        "NavClient._on_estop = lambda self, state: None",
        "mission",
        "stop_a",
        DURING,
    ),
    Defect(
        "base_without_brake",
        "the simulated base does not brake under a stop",
        "lupin_sim.node.robot",
        "SimNode._estop = property(lambda self: False)",
        "plain_twist",
        "stop_a",
        BEFORE,
    ),
    Defect(
        "arm_deaf",
        "the arm does not stop its motion",
        "lupin_arm.node.arm",
        "Arm._stop = lambda self, state: None",
        "arm_preset",
        "stop_a",
        DURING,
    ),
    Defect(
        "arm_willing",
        "the arm takes motions under a stop",
        "lupin_arm.node.arm",
        "Arm.refusal = lambda self, owner: self._claim_reason(owner) or self._torque_reason()",
        "arm_preset",
        "stop_b",
        BEFORE,
    ),
    Defect(
        "calibration_willing",
        "a calibration begins under a stop",
        "lupin_arm.node.calibration.servos",
        "Servos.publish_stopped = lambda self: None\nArm.claim = lambda self, owner, *_: None",
        "calibration",
        "stop_a",
        BEFORE,
    ),
    Defect(
        "calibration_any_time",
        "a calibration begins while a mission is under way",
        "lupin_arm.node.gates",
        "MissionGate.refusal = lambda self: None",
        "calibration",
        "pause",
        BEFORE,
    ),
    Defect(
        "arm_outlives",
        "the arm goes on when the orchestrator is dead",
        "lupin_arm.node.arm",
        "Arm.halt = lambda self, reason: None",
        "arm_preset",
        "orchestrator_dead",
        DURING,
    ),
    Defect(
        "no_watchdog",
        "nobody notices that the orchestrator is silent",
        "lupin_greenhouse.node.watchdog",
        "SilenceWatchdog.heard = lambda self, must_speak: None",
        "mission",
        "orchestrator_dead",
        DURING,
    ),
    Defect(
        "goals_wait",
        "navigation's watchdog does not act on a stop",
        "lupin_nav.node",
        "NavWatchdog._on_stop = lambda self, *_: None",
        "plain_goal",
        "stop_roslib",
        BEFORE,
    ),
    Defect(
        "left_stop_forgotten",
        "the stop of a page that is closed is let go",
        "lupin_gateway.stop",
        "StopArbiter._leave = lambda self, *_: None",
        "page_goal",
        "stop_b",
        DURING,
    ),
    Defect(
        "link_ignored",
        "a lost link engages nothing",
        "lupin_gateway.stop",
        "StopArbiter.link_lost = lambda self, now: None",
        "mission",
        "link_lost",
        DURING,
    ),
    Defect(
        "any_false",
        "a stop is let go by another's false",
        "lupin_greenhouse.stops",
        "_Source._releases = lambda self, *_: True",
        "mission",
        "stop_foreign",
        DURING,
    ),
    Defect(
        "stop_misread",
        "what a page tells is not taken for a stop",
        "lupin_gateway.stop",
        "StopArbiter.report = lambda self, *_: ''",
        "page_goal",
        "stop_roslib",
        BEFORE,
    ),
    Defect(
        "door_open_for_goals",
        "pages send goals whatever holds the mission",
        "lupin_gateway.motion",
        "MotionGate.refusal = lambda self, page: ''",
        "page_goal",
        "pause",
        BEFORE,
    ),
    Defect(
        "door_open_for_twists",
        "pages drive under a stop",
        "lupin_gateway.motion.names",
        "MotionNames.published = lambda self, *_: False",
        "cmd_vel",
        "e_stop_state",
        BEFORE,
    ),
    Defect(
        "goals_outlive_page",
        "the goals of a page that is closed go on",
        "lupin_gateway.session",
        "_close = Session.close\nSession.close = lambda self: (self._goals.clear(), _close(self))",
        "page_goal",
        "link_gone",
        DURING,
    ),
    Defect(
        "cancels_lost",
        "a mission that is held cancels nothing",
        "lupin_ros.adapter.actions",
        "Goal.cancel = lambda self: None",
        "mission",
        "pause",
        DURING,
    ),
    Defect(
        "late_goal_runs",
        "a goal that is accepted late is not cancelled",
        "lupin_ros.adapter.action_driver",
        "ActionAttempts._on_accepted = lambda self, attempt: None",
        "late_answer",
        "pause",
        DURING,
    ),
    Defect(
        "no_hold_after_restart",
        "an orchestrator that starts again does not hold the mission",
        "lupin_engine.runtime.journal.recovery",
        "_event = resumed_event\n"
        "def resumed_event(*given):\n"
        "    found = _event(*given)\n"
        "    return Event(found.name, {**found.data, 'held': False})",
        "mission",
        "restarted",
        DURING,
    ),
    Defect(
        "borrowed_resume",
        "the orchestrator resumes in a person's name, as `resume_policy: continue` did",
        "lupin_ros.orchestrator.node",
        "Orchestrator._continue = lambda self: "
        "self._loop.machine.memory.held and self._requests.ask(Event('operator.resume'))",
        "resume_policy",
        "e_stop_state",
        BEFORE,
    ),
)


@contextmanager
def planted(defect: Defect) -> Iterator[Path]:
    """Plant a defect in all nodes that are started meanwhile; yield the file that names them."""
    before = os.environ.get("PYTHONPATH")
    with TemporaryDirectory(prefix="defect-") as folder:
        noted = Path(folder) / "planted"
        text = SITE.format(module=defect.module, code=defect.code, planted=str(noted))
        (Path(folder) / "sitecustomize.py").write_text(text)
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [folder, before]))
        try:
            yield noted
        finally:
            if before is None:
                del os.environ["PYTHONPATH"]
            else:
                os.environ["PYTHONPATH"] = before


def find(defect: Defect, folder: Path, most: int) -> Mapping[str, object]:
    """Run the row and the column of a defect until a cell notices it, at most so many."""
    from tests.lupin_ros.system.safety.matrix.run import carried_out

    begun, ran = time.monotonic(), 0
    with planted(defect) as noted:
        for ran, fields in enumerate(carried_out(list(defect.cells())[:most], folder), 1):  # noqa: B007
            print(f"  {fields['cell']}: {fields['verdict']} {'; '.join(fields['problems'])}", flush=True)
            if fields["verdict"] == "wrong":
                by, problems = fields["cell"], fields["problems"]
                break
        else:
            by, problems = "", []
        nodes = len(noted.read_text().split()) if noted.exists() else 0
    seconds = round(time.monotonic() - begun, 1)
    return {
        "defect": defect.name,
        "found_by": by,
        "problems": problems,
        "cells": ran,
        "planted_in": nodes,
        "seconds": seconds,
    }


def hunt(folder: Path, only: list[str], most: int = 8) -> int:
    """Plant each defect in turn and look for it; return how many were not found."""
    missed = 0
    for defect in DEFECTS:
        if only and defect.name not in only:
            continue
        row = find(defect, folder, most)
        with (folder / "defects.jsonl").open("a") as lines:
            lines.write(json.dumps(row) + "\n")
        missed += not row["found_by"]
        told = f"found by {row['found_by']}: {row['problems']}" if row["found_by"] else "NOT FOUND"
        cost = f"{row['cells']} cells, {row['seconds']} s, in {row['planted_in']} processes"
        print(f"{defect.name}: {told} ({cost})", flush=True)
    return missed
