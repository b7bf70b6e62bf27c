"""What the sources of clients and nodes tell without ROS: names that no catalog has, calls that fail."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.harness.sources import client_problems, node_problems, undeclared
from lupin_engine.plugin.contract import Code, EventKind, LiveValue, Operation, Parameter, Plugin
from lupin_engine.plugin.types import BOOL, TEXT

MODULE = "sources_on_trial"
LAMP = Plugin(
    "lamp",
    "A lamp.",
    operations={"switch": Operation("Switch it.", codes=(Code("lamp_broken", "it is broken"),))},
    values={"lamp.on": LiveValue("whether it is on", BOOL)},
    events={"burnt": EventKind("It has burnt out.", {"why": TEXT})},
    parameters={"lamp_topic": Parameter(TEXT, "/lamp", "topic of it")},
    client=f"{MODULE}:Client",
)
DRIVER = """\
class Client:
    def __init__(self, ros, outlet, parameters): ...
    def missing(self): ...
    def start(self, attempt, operation, arguments): ...
    def cancel(self, attempt): ...
    def act(self, action, arguments): ...
    def close(self): ...
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the file of the client's module."""
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path / f"{MODULE}.py"


@pytest.mark.parametrize(
    ("source", "problem"),
    [
        (
            "o.failed(a, 'lamp_brokn')",
            "1: 'lamp_brokn' is no code of the catalog; did you mean 'lamp_broken'?",
        ),
        ("o.failed(a, 'dark', why)", "1: 'dark' is no code of the catalog; allowed: 'lamp_broken'"),
        ("\nFailed('dark')", "2: 'dark' is no code of the catalog; allowed: 'lamp_broken'"),
        ("o.value('on', True, t)", "1: 'on' is no live value of the catalog; allowed: 'lamp.on'"),
        ("o.event('burnt', {})", "1: 'burnt' is no event of the catalog; did you mean 'lamp.burnt'?"),
        (
            "o.event('lamp.burnt', {'wy': 1})",
            "1: event 'lamp.burnt' is told with other fields than it declares: why",
        ),
        (
            "self._parameters['lamp_tpic']",
            "1: 'lamp_tpic' is no parameter of the catalog; did you mean 'lamp_topic'?",
        ),
        ("parameters['x']", "1: 'x' is no parameter of the catalog; allowed: 'lamp_topic'"),
    ],
)
def test_a_name_that_the_catalog_lacks_is_told_with_its_line(module: Path, source: str, problem: str) -> None:
    """Also where no attempt that is tried would come by."""
    module.write_text(source)
    assert list(undeclared(LAMP)) == [f"{MODULE}.py:{problem}"]


@pytest.mark.parametrize(
    "source",
    [
        "o.failed(a, 'lamp_broken'); o.failed(a, CODE.name); Failed(code)",
        "o.value('lamp.on', True, t); enum.value; cell.value('x')",
        "o.event('lamp.burnt', {'why': 'old'}); o.event('lamp.burnt', data); o.event('lamp.burnt', {**data})",
        "parameters['lamp_topic']; parameters[name]; arguments['x']",
        "this is no Python",
    ],
)
def test_what_is_declared_or_cannot_be_seen_is_let_pass(module: Path, source: str) -> None:
    """Constants and names that are put together are for the rules that try the driver."""
    module.write_text(source)
    assert list(undeclared(LAMP)) == []


@pytest.mark.parametrize(
    ("before", "after", "problem"),
    [
        (
            "outlet, parameters)",
            "outlet)",
            "Client.__init__ in line 2 must be callable as __init__(self, ros, outlet, parameters)",
        ),
        ("missing", "mising", "Client in line 1 has no method missing(); did you mean 'mising'?"),
        (
            "    def act(self, action, arguments): ...\n",
            "",
            "Client in line 1 has no method act(action, arguments)",
        ),
        (
            "(self, attempt):",
            "(self, attempt, *, why):",
            "Client.cancel in line 5 must be callable as cancel(self, attempt)",
        ),
        ("close(self)", "close(self, now)", "Client.close in line 7 must be callable as close(self)"),
        (
            "class Client",
            "class Cleint",
            "there is no 'Client' in 'sources_on_trial'; did you mean 'Cleint'?",
        ),
        (
            "class Client:",
            "class Client",
            "the module 'sources_on_trial' cannot be read: expected ':' (sources_on",
        ),
    ],
)
def test_a_class_that_is_no_driver(module: Path, before: str, after: str, problem: str) -> None:
    """Each of the methods is called by the engine, with what it is called with."""
    assert before in DRIVER
    module.write_text(DRIVER.replace(before, after, 1))
    (only,) = client_problems(LAMP.client)
    assert only.startswith(problem)


@pytest.mark.parametrize(
    "source",
    [
        DRIVER,
        "class Client(ServiceDriver):\n    def __init__(self, ros, outlet, parameters): ...\n",
        "@made\nclass Client: ...",
        "from somewhere import Client",
        DRIVER.replace("(self, attempt):", "(self, attempt, why='', *more, **others):"),
    ],
    ids=["plain", "derived", "decorated", "imported", "with more"],
)
def test_a_class_that_may_be_a_driver(module: Path, source: str) -> None:
    """What it has from elsewhere is not seen here."""
    module.write_text(source)
    assert list(client_problems(LAMP.client)) == []


@pytest.mark.parametrize(
    ("source", "problems"),
    [
        ("def main(arguments): ...", []),
        ("def main(*arguments): ...", []),
        ("def main(arguments=None): ...", []),
        ("from somewhere import main", []),
        ("def main(): ...", ["main in line 1 must be callable as main(arguments)"]),
        ("\ndef main(a, b): ...", ["main in line 2 must be callable as main(arguments)"]),
        ("def man(arguments): ...", ["there is no 'main' in 'sources_on_trial'; did you mean 'man'?"]),
    ],
)
def test_a_node_is_run_with_the_ros_arguments(module: Path, source: str, problems: list[str]) -> None:
    """By position, as one list."""
    module.write_text(source)
    assert list(node_problems(f"{MODULE}:main")) == problems
