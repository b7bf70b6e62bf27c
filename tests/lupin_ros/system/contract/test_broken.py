"""The harness finds what is wrong with drivers: a good one keeps every rule, each bad one breaks one."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool

from lupin_engine.errors import LupinError
from lupin_engine.plugin.contract import (
    Action,
    Argument,
    Code,
    LiveValue,
    Operation,
    Outlet,
    Parameter,
    Plugin,
)
from lupin_engine.plugin.types import BOOL, COUNT, DURATION
from lupin_harness import bench as benches
from lupin_harness.bench import Lab, Setting
from lupin_harness.live import apply, live_cases
from lupin_harness.referee import ContractBroken, NeedsArguments, Untried
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.adapter.service_driver import Done, Failed, ServiceDriver, ServiceOperation
from tests.lupin_ros.launch.processes import until
from tests.processes import ended

pytestmark = pytest.mark.timeout(120)

#: Where the drivers below are found.
MODULE = "driver_on_trial"
COUNTED = Parameter(COUNT, 2, "how many")
ON = {"on": Argument(BOOL, "whether it is to be on")}
VALUES = {"trial.on": LiveValue("whether it is on", BOOL)}
LAMP = Plugin(
    name="trial_lamp",
    doc="A lamp.",
    operations={
        "switch": Operation("Switch it.", ON, {"is_on": BOOL}, (Code("lamp_broken", "lamp broken"),)),
    },
    actions={"flash": Action("Flash once.")},
    values=VALUES,
    client=f"{MODULE}:Client",
)


class Good(ServiceDriver):
    """Keeps the contract."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        service = ros.service(SetBool, "/trial_lamp/switch")
        self.ros, self.outlet = ros, outlet
        operation = ServiceOperation(service, lambda given: SetBool.Request(data=given["on"]), self.outcome)
        super().__init__("trial_lamp", outlet, {"switch": operation})

    def outcome(self, arguments: Mapping[str, Any], answer: Any) -> Done | Failed:
        """Say what an answer means."""
        if isinstance(answer, SetBool.Response):
            return Done({"is_on": answer.success})
        return Failed("lamp_broken", answer.detail)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Flash."""


class Blocks(Good):
    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        threading.Event().wait(benches.AT_ONCE_S * 1.2)
        super().start(attempt, operation, arguments)


class Raises(Good):
    def cancel(self, attempt: str) -> None:
        self._calls.pop(attempt).cancel()
        self.outlet.cancelled(attempt)


class EndsTwice(Good):
    def _answered(self, attempt: str, *about: Any) -> None:
        super()._answered(attempt, *about)
        self.outlet.done(attempt, {"is_on": True})


class NeverEnds(Good):
    def cancel(self, attempt: str) -> None:
        self._calls.pop(attempt, None)


class DropsWhatIsCancelled(Good):
    def cancel(self, attempt: str) -> None:
        call = self._calls.pop(attempt, None)
        if call is not None:
            call.cancel()


class CancelsAll(Good):
    def cancel(self, attempt: str) -> None:
        for known in list(self._calls) if attempt in self._calls else ():
            super().cancel(known)


class WaitsForNobody(Good):
    def missing(self) -> list[str]:
        return []


class WaitsForSomething(Good):
    def missing(self) -> list[str]:
        return [""]


class TalksOn(Good):
    def close(self) -> None:
        """Forget to let go of the calls."""


class BelievesInItsServer(Good):
    seen = False

    def missing(self) -> list[str]:
        self.seen = self.seen or not super().missing()
        return [] if self.seen else super().missing()


class Invents(Good):
    def outcome(self, arguments: Mapping[str, Any], answer: Any) -> Done | Failed:
        return Failed("lamp_brocken")


class ForgetsTheResult(Good):
    def outcome(self, arguments: Mapping[str, Any], answer: Any) -> Done | Failed:
        return Done()


class TellsNonsense(Good):
    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        super().start(attempt, operation, arguments)
        self.outlet.value("trial.on", "yes", self.ros.now())


class IgnoresCancels(Good):
    """Does the work all the same, half a second after it was begun."""

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        self.outlet.accepted(attempt)
        self.ros.call_later(0.5, lambda: self.outlet.done(attempt, {"is_on": True}))

    def cancel(self, attempt: str) -> None:
        """Let it go on."""


class ChangesTheCatalog(Good):
    """Declares a value as it goes."""

    def missing(self) -> list[str]:
        VALUES["trial.hot"] = VALUES["trial.on"]
        return super().missing()


class CannotBeMade(Good):
    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        raise KeyError("lamp_topic")


class HearsNothing(Good):
    """Wants every message of a topic that is told best effort."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        super().__init__(ros, outlet, parameters)
        ros.subscribe(Bool, "/trial_lamp/on", Qos.EVENT, lambda _: None)


class HearsAnotherType(Good):
    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        super().__init__(ros, outlet, parameters)
        self.heard = False
        ros.subscribe(String, "/trial_lamp/on", Qos.SENSOR, self.hear)

    def hear(self, _: String) -> None:
        """Never called."""
        self.heard = True

    def missing(self) -> list[str]:
        return [] if self.heard else ["topic /trial_lamp/on"]


class RefusesToAct(Good):
    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        raise KeyError(action)


def offer(ros: RosNode) -> None:
    """Offer a lamp."""

    def switch(request: Any, response: Any) -> Any:
        response.success = request.data
        return response

    ros.serve(SetBool, "/trial_lamp/switch", switch)
    told = ros.publisher(Bool, "/trial_lamp/on", Qos.SENSOR)
    ros.timer(0.05, lambda: told.publish(Bool(data=True)))


@pytest.fixture
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait a moment only for what never comes."""
    monkeypatch.setattr(benches, "PATIENCE_S", 8.0)


def lab_of(driver: type[Good], monkeypatch: pytest.MonkeyPatch) -> Lab:
    """Return where a driver is tried."""
    module = ModuleType(MODULE)
    module.Client = driver  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, MODULE, module)
    return Lab(Setting(LAMP, offer=offer))


def verdict(lab: Lab, rule: str, operation: str) -> str:
    """Try a rule; return what is wrong, or ''."""
    with lab.open():
        try:
            apply(rule, operation, lab)
        except ContractBroken as broken:
            return str(broken)
    return ""


@pytest.mark.parametrize(("rule", "operation"), list(live_cases(LAMP)))
def test_a_good_driver_keeps_every_rule(
    rule: str, operation: str, monkeypatch: pytest.MonkeyPatch, ros_domain: int
) -> None:
    """So that each of the others breaks the rule by what it changes."""
    assert verdict(lab_of(Good, monkeypatch), rule, operation) == ""


@pytest.mark.parametrize(
    ("driver", "rule", "problem"),
    [
        (Blocks, "ends_once", "start of 'switch' blocks: it took # s; call back when there is an answer"),
        (Raises, "ignores_strangers", "cancel of 'nobody_knows_this_one' raises KeyError"),
        (Raises, "ends_once", "cancel of 'switch_1' raises KeyError"),
        (EndsTwice, "ends_once", "switch_1 reports 'done' after its end ['accepted', 'done']"),
        (
            NeverEnds,
            "survives_its_servers",
            "the end of switch_1: not within 8 s; reports so far: switch_1: acc",
        ),
        (DropsWhatIsCancelled, "is_cancelled", "the end of switch_1: not within 8 s"),
        (DropsWhatIsCancelled, "is_cancelled_at_once", "the end of switch_1: not within 8 s"),
        (CancelsAll, "keeps_attempts_apart", "switch_2 is cancelled, and only switch_1 was to be"),
        (WaitsForNobody, "waits_alone", "missing() is empty although nobody is there; set `waits = False`"),
        (WaitsForSomething, "waits_alone", "missing() must name what is missing, in words; it returns ['']"),
        (TalksOn, "is_silent_when_closed", "'done' of switch_1 is reported after close"),
        (BelievesInItsServer, "finds_its_servers_again", "missing() is to name the servers that have died"),
        (
            Invents,
            "ends_once",
            "switch_1: accepted, failed (lamp_brocken: ); give arguments with which it succe",
        ),
        (
            Invents,
            "is_cancelled",
            "fails with 'lamp_brocken', which is no code of its operation; did you mean",
        ),
        (ForgetsTheResult, "ends_once", "switch_1 is done, but leaves out 'is_on' of the result"),
        (TellsNonsense, "is_cancelled", "value 'trial.on': expected bool, got 'yes'"),
        (RefusesToAct, "acts", "action 'flash' raises KeyError: 'flash'"),
        (
            IgnoresCancels,
            "is_cancelled",
            "the cancel of switch_1 changes nothing: it is done # s later, as if left alone (# s); end ",
        ),
        (ChangesTheCatalog, "comes_to_work", "the driver changes the catalog: value 'trial.hot'; it is data"),
        (
            CannotBeMade,
            "comes_to_work",
            "plugin 'trial_lamp': driver_on_trial:Client cannot be made: KeyError: 'lamp_topic'",
        ),
        (
            HearsNothing,
            "comes_to_work",
            "/trial_lamp/on: /harness_trial_lamp hears nothing of /harness_stand_ins: best effort publisher ",
        ),
        (HearsAnotherType, "comes_to_work", "/trial_lamp/on: different definitions (/harness_"),
    ],
    ids=lambda value: value.__name__ if isinstance(value, type) else "",
)
def test_a_bad_driver_breaks_a_rule(
    driver: type[Good],
    rule: str,
    problem: str,
    monkeypatch: pytest.MonkeyPatch,
    patience: None,
    ros_domain: int,
) -> None:
    """And is told in what; `#` stands for what was measured, which differs from machine to machine."""
    operation = next(operation for name, operation in live_cases(LAMP) if name == rule)
    try:
        told = verdict(lab_of(driver, monkeypatch), rule, operation)
        assert problem in re.sub(r"\d+\.\d s", "# s", told)
    finally:
        VALUES.pop("trial.hot", None)


def test_who_takes_no_update_is_found(
    monkeypatch: pytest.MonkeyPatch, patience: None, ros_domain: int
) -> None:
    """The rule is about operations that declare it."""

    class KeepsToTheFirst(Good):
        begun = 0

        def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
            self.begun += 1
            if self.begun == 1:
                super().start(attempt, operation, arguments)

    switch = replace(LAMP.operations["switch"], updates=True)
    lamp = replace(LAMP, operations={"switch": switch})
    assert ("takes_updates", "switch") in live_cases(lamp)
    assert ("keeps_attempts_apart", "switch") not in live_cases(lamp)
    lab_of(KeepsToTheFirst, monkeypatch)
    told = verdict(Lab(Setting(lamp, offer=offer)), "takes_updates", "switch")
    assert told.startswith("the end of switch_2: not within")


def test_a_driver_that_gets_no_processor_does_not_block(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, ros_domain: int
) -> None:
    """On a busy machine a call takes seconds in which the driver has done nothing, and no wrong."""
    counted = tmp_path / "schedstat"
    counted.write_text("5000000 0 1\n")
    monkeypatch.setattr(benches, "SCHEDULED", counted)

    class Starved(Blocks):
        def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
            super().start(attempt, operation, arguments)
            ran, waited, slices = map(int, counted.read_text().split())
            counted.write_text(f"{ran} {waited + int(benches.AT_ONCE_S * 1.2e9)} {slices}\n")

    assert verdict(lab_of(Starved, monkeypatch), "ends_once", "switch") == ""


@pytest.mark.parametrize("told", ["", "0 0", "what?"], ids=["nothing", "no waiting", "something else"])
def test_who_blocks_is_told_also_where_waiting_is_not_counted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, ros_domain: int, told: str
) -> None:
    """Another system, or a kernel that was built without it."""
    counted = tmp_path / "schedstat"
    counted.write_text(told)
    monkeypatch.setattr(benches, "SCHEDULED", counted)
    assert "blocks: it took" in verdict(lab_of(Blocks, monkeypatch), "ends_once", "switch")


def test_a_cancel_that_is_late_once_is_no_breach(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> None:
    """On a busy machine the work may be over before the cancel comes to its turn; a second look decides."""

    class LateOnce(IgnoresCancels):
        def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
            self.ended = False
            self.outlet.accepted(attempt)
            if attempt != "switch_3":
                self.ros.call_later(0.5, lambda: self.outlet.done(attempt, {"is_on": True}))

        def cancel(self, attempt: str) -> None:
            if attempt == "switch_3" and not self.ended:  # the second one that is cancelled
                self.ended = True
                self.outlet.cancelled(attempt)

    assert verdict(lab_of(LateOnce, monkeypatch), "is_cancelled", "switch") == ""


def test_what_keeps_a_driver_from_its_work_is_told_once(
    monkeypatch: pytest.MonkeyPatch, patience: None, ros_domain: int
) -> None:
    """Each of the other rules would wait for it in vain."""
    lab = lab_of(CannotBeMade, monkeypatch)
    with lab.open():
        with pytest.raises(ContractBroken, match="cannot be made: KeyError"):
            apply("comes_to_work", "", lab)
        with pytest.raises(Untried, match=r"^not tried: the driver does not come to work among its servers$"):
            apply("ends_once", "switch", lab)


class NotLikeThis(Good):
    def outcome(self, arguments: Mapping[str, Any], answer: Any) -> Done | Failed:
        return Failed("lamp_broken")


class NotLikeThisAlone(NotLikeThis, WaitsForNobody):
    """The same, and it waits for no server."""


@pytest.mark.parametrize("driver", [NotLikeThis, NotLikeThisAlone])
def test_a_declared_failure_asks_for_arguments_and_breaks_nothing(
    driver: type[Good], monkeypatch: pytest.MonkeyPatch, patience: None, ros_domain: int
) -> None:
    """`lupin plugin check --live` has none to give: it reports the rule as not tried."""
    with lab_of(driver, monkeypatch).open() as lab:
        lab.find_out_whether_it_waits()
        assert lab.setting.waits is (driver is NotLikeThis)
        apply("waits_alone", "", lab)
        with pytest.raises(NeedsArguments, match=r"failed \(lamp_broken: \); give arguments with which"):
            apply("ends_once", "switch", lab)


def test_a_problem_that_comes_again_and_again_is_told_once(
    monkeypatch: pytest.MonkeyPatch, patience: None, ros_domain: int
) -> None:
    """A value that is wrong is wrong with every message."""
    told = verdict(lab_of(TellsNonsense, monkeypatch), "ignores_strangers", "")
    assert told == "value 'trial.on': expected bool, got 'yes'; write true or false"


@pytest.mark.parametrize(
    ("log", "words"),
    [
        ("", "it said nothing"),
        ("one\ntwo\n", "one\ntwo"),
        ("1\n2\n3\n4\n5\n6", "2\n3\n4\n5\n6"),
        (
            'Traceback (most recent call last):\n  File "a.py", line 3, in main\n    f()\n'
            '  File "b.py", line 7, in f\n'
            "    1 / 0\n    ~~^~~\nZeroDivisionError: division by zero\n",
            "ZeroDivisionError: division by zero; at b.py:7",
        ),
    ],
)
def test_the_last_words_of_a_node(log: str, words: str) -> None:
    """Of a traceback what it is and where."""
    assert benches.last_words(log) == words


def test_parameters_of_a_test_are_as_missions_write_them() -> None:
    """With their units; those of missions are handed on."""
    plugin = replace(LAMP, parameters={"trial_rest": Parameter(DURATION, 1.0, "rest"), "trial_n": COUNTED})
    given = {"trial_rest": "500 ms", "of_the_mission": True}
    assert Setting(plugin, given).parameter_values() == {**given, "trial_rest": 0.5, "trial_n": 2}
    with pytest.raises(
        LupinError, match=r"^parameter 'trial_n' of plugin 'trial_lamp': expected count, got "
    ):
        Setting(plugin, {"trial_n": "x"}).parameter_values()


def test_a_plugin_without_a_client_has_no_driver_to_try() -> None:
    """Said before anything is started."""
    with pytest.raises(LupinError, match="plugin 'x' has no client: there is no driver to try"):
        Lab(Setting(Plugin("x", "X.")))


def test_nodes_do_not_outlive_a_harness_that_is_killed(tmp_path: Path) -> None:
    """`kill -9`, or a machine's limit on tests: nobody is left on the network."""
    (tmp_path / "stubborn.py").write_text(
        "import os, signal, threading\n"
        "from pathlib import Path\n"
        "def main(arguments):\n"
        f"    made = Path({str(tmp_path / 'made')!r})\n"
        "    made.write_text(str(os.getpid()))\n"
        f"    made.rename({str(tmp_path / 'pid')!r})\n"
        "    threading.Event().wait()\n"
    )
    program = (
        "from lupin_harness.bench import Servers, Setting\n"
        "from lupin_engine.plugin.contract import Plugin\n"
        "Servers(Setting(Plugin('x', 'X.'), nodes={'sim': 'stubborn:main'})).start()\n"
        "input()\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-c", program]
    with ended(subprocess.Popen(command, stdin=subprocess.PIPE, env=environment)) as harness:
        until((tmp_path / "pid").exists, "the node has begun")
        harness.kill()
    pid = int((tmp_path / "pid").read_text())
    until(lambda: not Path(f"/proc/{pid}").exists(), "the node ends by itself")


def test_a_node_that_ends_by_itself_is_told_with_its_last_words(
    monkeypatch: pytest.MonkeyPatch, ros_domain: int
) -> None:
    """Not after the whole patience, and not as something that the driver has done."""
    lab = lab_of(Good, monkeypatch)
    lab = Lab(replace(lab.setting, nodes={"sim": "no_such_module:main"}, offer=None))
    told = verdict(lab, "acts", "")
    assert told.startswith("node 'sim' has ended with code 1: ")
    assert "No module named 'no_such_module'" in told
