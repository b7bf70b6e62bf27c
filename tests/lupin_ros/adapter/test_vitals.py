"""What every node tells of itself on /diagnostics, over real DDS."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Int32

from lupin_engine.errors import Severity
from lupin_engine.plugin.contract import Code
from lupin_ros.adapter import vitals
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.helpers import spin_until

MakeNode = Callable[..., RosNode]
PUBLISH_S = 0.05


def heard_by(node: RosNode) -> list[DiagnosticStatus]:
    """Return a list that fills with what `/talker` reports."""
    found: list[DiagnosticStatus] = []

    def take(array: DiagnosticArray) -> None:
        found.extend(status for status in array.status if status.name == "/talker")

    node.subscribe(DiagnosticArray, "/diagnostics", Qos.EVENT, take)
    return found


def test_a_node_tells_its_process_its_machine_and_the_rates_of_its_topics(make_node: MakeNode) -> None:
    talker, listener = make_node("talker"), make_node("listener")
    publisher = talker.publisher(Int32, "/numbers", Qos.EVENT)
    talker.steady_timer(PUBLISH_S, lambda: publisher.publish(Int32()))
    found = heard_by(listener)
    spin_until([talker, listener], lambda: len(found) >= 3)
    last = found[-1]
    values = {each.key: each.value for each in last.values}
    assert (last.level, last.message, last.hardware_id) == (b"\0", "running", socket.gethostname())
    assert values["pid"] == str(os.getpid())
    assert 10 < float(values["/numbers (Hz)"]) < 25
    assert 20 < float(values["memory (MB)"]) < float(values["machine memory (MB)"])
    assert 0 < float(values["processor (%)"]) < 400
    assert 0 <= float(values["machine processor (%)"]) <= 100
    assert 0 < float(values["disk free (GB)"]) <= float(values["disk (GB)"])


def test_each_trouble_has_a_status_with_its_cause_and_advice(make_node: MakeNode) -> None:
    """By REP 107: `NODE: SUBJECT`; the node's own has the worst level. What is over is reported as OK."""
    talker, listener = make_node("talker"), make_node("listener")
    found: dict[str, DiagnosticStatus] = {}

    def take(array: DiagnosticArray) -> None:
        found.update((status.name, status) for status in array.status if status.name.startswith("/talker"))

    listener.subscribe(DiagnosticArray, "/diagnostics", Qos.EVENT, take)
    pump = Code("pump_dry", "the pump is dry", Severity.ERROR, "Fill the tank.")
    talker.trouble("pump", "the pump is dry: tank 2", pump)
    talker.trouble("lamp", "one lamp of two is dark")
    spin_until([talker, listener], lambda: "/talker: pump" in found)
    assert {name: (one.level, one.message) for name, one in found.items()} == {
        "/talker": (DiagnosticStatus.ERROR, "the pump is dry: tank 2; one lamp of two is dark"),
        "/talker: machine": (DiagnosticStatus.OK, "no trouble"),
        "/talker: pump": (DiagnosticStatus.ERROR, "the pump is dry: tank 2"),
        "/talker: lamp": (DiagnosticStatus.WARN, "one lamp of two is dark"),
    }
    assert {one.hardware_id for one in found.values()} == {socket.gethostname()}
    told = {each.key: each.value for each in found["/talker: pump"].values}
    assert told == {"code": "pump_dry", "cause": "the pump is dry: tank 2", "advice": "Fill the tank."}
    talker.trouble("pump", "", pump)
    spin_until([talker, listener], lambda: found["/talker: pump"].message == "no trouble")
    assert (found["/talker: pump"].level, found["/talker"].level) == (b"\0", DiagnosticStatus.WARN)


def test_a_node_that_ends_as_it_should_says_so(make_node: MakeNode) -> None:
    talker, listener = RosNode("talker"), make_node("listener")
    found = heard_by(listener)
    spin_until([talker, listener], lambda: found)
    talker.stop()
    talker.spin()
    spin_until([listener], lambda: found[-1].message == vitals.ENDED)
    assert found[-1].level == DiagnosticStatus.STALE


def test_a_report_costs_less_than_a_thousandth_of_a_core(make_node: MakeNode) -> None:
    talker = make_node("talker")
    reports = vitals.Vitals(talker.node, "/diagnostics", 0.0)
    reports.report(1.0)
    used = time.process_time()
    for second in range(100):
        reports.report(2.0 + second)
    assert (time.process_time() - used) / 100 < 0.001 * vitals.REPORT_S


def test_a_machine_that_runs_out_of_something_is_warned_about() -> None:
    memory = {"MemTotal": 8_000_000, "MemAvailable": 200_000}
    assert list(vitals.shortages(memory, 0.4e9)) == [
        "the memory of this machine is nearly used up: 200 MB are left",
        "the disk of this machine is nearly full: 0.4 GB are left",
    ]
    assert list(vitals.shortages({**memory, "MemAvailable": 4_000_000}, 9e9)) == []


def test_the_disk_is_looked_at_where_the_state_will_be(tmp_path: Path) -> None:
    assert vitals.nearest_folder(tmp_path / "not" / "yet") == tmp_path
