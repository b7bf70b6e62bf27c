"""Each rule of the catalog tells what breaks it."""

from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from lupin_engine.errors import UsageError
from lupin_engine.plugin.contract import (
    Action,
    Argument,
    Code,
    EventKind,
    Function,
    LiveValue,
    Mock,
    Operation,
    Parameter,
    Plugin,
    Reader,
)
from lupin_engine.plugin.discovery import EntryPoint, entry_points
from lupin_engine.plugin.types import BOOL, COUNT, DURATION, NUMBER, POSE, TEXT, Type, convert, list_of
from lupin_harness.examples import arguments_for, defaults_of, example
from lupin_harness.rules import RULES, PluginUnderTest, find_subject, findings, problems_with

NAMES = sorted(point.name for point in entry_points())
LEVEL = Argument(NUMBER, "how bright")
LAMP = Plugin(
    name="odd_lamp",
    doc="A lamp.",
    operations={
        "dim": Operation(
            "Dim it.",
            arguments={"level": LEVEL},
            result={"left": NUMBER},
            codes=(Code("lamp_broken", "lamp broken"),),
            mock=Mock(result={"left": 1.0}, values={"odd.on": True}),
        )
    },
    actions={"flash": Action("Flash once.")},
    functions={
        "odd.glow": Function("How it glows.", NUMBER, lambda _: lambda level: 2.0 * level, {"level": LEVEL})
    },
    values={"odd.on": LiveValue("whether it is on", BOOL)},
    events={"burnt": EventKind("It has burnt out.")},
    types={"odd_colour": Type("text", "odd_colour")},
    readers={"odd_colour": Reader(Code("odd_unknown", "no such colour"), lambda _: _read_colour)},
    parameters={"odd_watt": Parameter(NUMBER, 10.0, "how strong it is", minimum=0.0)},
)
MODULE = "odd_lamp_catalog"


def _read_colour(given: Any) -> str:
    if given != "red":
        raise ValueError(f"there is no colour {given!r}")
    return "red"


@pytest.fixture
def problems(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Return what tells the problems of a rule with a plugin that is changed from a good one."""

    def tell(rule: str, **changed: Any) -> list[str]:
        module = ModuleType(MODULE)
        module.PLUGIN = replace(LAMP, **changed)  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, MODULE, module)
        return list(RULES[rule](PluginUnderTest(EntryPoint("odd_lamp", f"{MODULE}:PLUGIN"))))

    return tell


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("rule", RULES)
def test_every_installed_plugin_keeps_the_rules(rule: str, name: str) -> None:
    """Those that come with the engine, at least."""
    assert list(RULES[rule](find_subject(name))) == []


@pytest.mark.parametrize("rule", [rule for rule in RULES if rule != "loads_without_ros"])
def test_a_good_plugin_breaks_no_rule(problems: Callable[..., list[str]], rule: str) -> None:
    """So that what the tests below change is what they are about."""
    assert problems(rule) == []


def dim(**changed: Any) -> dict[str, Any]:
    """Return the operations with another one."""
    return {"operations": {"dim": replace(LAMP.operations["dim"], **changed)}}


def glow(bind: Callable[..., Any]) -> dict[str, Any]:
    """Return the functions with another one."""
    return {"functions": {"odd.glow": replace(LAMP.functions["odd.glow"], bind=bind)}}


def counted(_: Any) -> Callable[[float], float]:
    numbers = itertools.count()
    return lambda level: level + next(numbers)


def read(reader: Callable[[Any], Any]) -> dict[str, Any]:
    """Return the readers with another one."""
    return {"readers": {"odd_colour": Reader(Code("odd_unknown", "no such colour"), lambda _: reader)}}


def speechless(_: Any) -> Any:
    raise ValueError


POSE_GLOW = Function(
    "It.", NUMBER, lambda _: lambda pose: pose.clear() or 1.0, {"pose": Argument(POSE, "where")}
)
BROKEN: list[tuple[str, dict[str, Any], str]] = [
    ("registered", {"name": "lamp"}, "the entry point 'odd_lamp' names a plugin that calls itself 'lamp'"),
    (
        "registered",
        dim(doc=5),
        "plugin 'odd_lamp': operation 'dim': doc must be a text, got 5",
    ),
    (
        "registered",
        dim(codes=(Code("no", ""),)),
        "plugin 'odd_lamp': operation 'dim': the code 'no' has no label for people",
    ),
    (
        "registered",
        {"values": {"robot.pose": LiveValue("where", POSE)}},
        "plugin 'odd_lamp': the value 'robot.pose' is already declared by plugin 'nav'",
    ),
    ("names_modules", {"client": "odd.gone:Client"}, "client: there is no module 'odd.gone'"),
    (
        "names_modules",
        {"nodes": {"sim": "lupin_engine.gone:main"}},
        "node 'sim': there is no module 'lupin_engine.gone'",
    ),
    (
        "documented",
        {"doc": "a lamp"},
        "the plugin: 'a lamp' is no sentence: begin with a capital, end with a full stop",
    ),
    ("documented", dim(doc=" "), "operation 'dim': nothing says what it is"),
    (
        "documented",
        dim(arguments={"level": Argument(NUMBER, "")}),
        "operation 'dim': argument 'level': nothing says what it is",
    ),
    (
        "documented",
        {"actions": {"flash": Action("Flash once")}},
        "action 'flash': 'Flash once' is no sentence: begin with a capital, end with a full stop",
    ),
    (
        "documented",
        {"events": {"burnt": EventKind("burnt out.")}},
        "event 'burnt': 'burnt out.' is no sentence: begin with a capital, end with a full stop",
    ),
    (
        "documented",
        {"values": {"odd.on": LiveValue("On or off.", BOOL)}},
        "value 'odd.on': 'On or off.' is a phrase: leave out the full stop",
    ),
    (
        "documented",
        {"parameters": {"odd_watt": Parameter(NUMBER, 1.0, "Watts.")}},
        "parameter 'odd_watt': 'Watts.' is a phrase: leave out the full stop",
    ),
    (
        "labelled",
        dim(codes=(Code("broken", "broken"),)),
        "operation 'dim': the label of the code 'broken' must say what happened",
    ),
    ("mocked", dim(mock=Mock()), "operation 'dim': the mock leaves out 'left' of the result"),
    (
        "mocked",
        dim(mock=Mock(result=lambda *_: {"left": "x"})),
        "operation 'dim': the mock 'left': expected number, got 'x'",
    ),
    (
        "mocked",
        dim(mock=Mock(result={"left": 1.0}, values={"odd.of": True})),
        "operation 'dim': the mock changes 'odd.of', which is no live value; did you mean 'odd.on'?",
    ),
    (
        "mocked",
        dim(mock=Mock(result={"left": 1.0}, values={"odd.on": 1})),
        "operation 'dim': the mock: 'odd.on': expected bool, got 1",
    ),
    (
        "mocked",
        dim(mock=Mock(result=lambda a, _: a["gone"])),
        "operation 'dim': the mock fails for {'level': 0.5}: KeyError: 'gone'",
    ),
    (
        "computes",
        glow(counted),
        "function 'odd.glow' returns another result for the same arguments {'level': 0.5}",
    ),
    ("computes", glow(lambda _: str), "function 'odd.glow': 'result': expected number, got '0.5'"),
    ("computes", glow(lambda p: p["gone"]), "function 'odd.glow' fails for {'level': 0.5}: KeyError: 'gone'"),
    (
        "computes",
        {"functions": {"odd.glow": POSE_GLOW}},
        "function 'odd.glow' changes its arguments or the parameters",
    ),
    (
        "reads",
        read(lambda given: given.r),
        "reader 'odd_colour' raises AttributeError for 0, not ValueError: 'int' object has no attribute 'r'",
    ),
    ("reads", read(speechless), "reader 'odd_colour' refuses '' without saying why"),
    (
        "reads",
        {"readers": {"odd_colour": Reader(Code("odd_unknown", "no such colour"), lambda p: p["gone"])}},
        "reader 'odd_colour' does not bind with the default parameters: KeyError: 'gone'",
    ),
]


@pytest.mark.parametrize(
    ("rule", "changed", "problem"), BROKEN, ids=[f"{rule}_{i}" for i, (rule, *_) in enumerate(BROKEN)]
)
def test_a_rule_tells_what_breaks_it(
    problems: Callable[..., list[str]], rule: str, changed: dict[str, Any], problem: str
) -> None:
    """With the place, what is wrong, and the nearest spelling."""
    assert problem in problems(rule, **changed)


def test_a_client_is_looked_for_without_importing_it(
    problems: Callable[..., list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It needs ROS; the rules of the driver import it."""
    (tmp_path / "odd_client.py").write_text("1 / 0")
    monkeypatch.syspath_prepend(tmp_path)
    assert problems("names_modules", client="odd_client:Client") == []


def test_a_plugin_that_no_rule_could_be_tried_on_is_told_by_all(
    problems: Callable[..., list[str]],
) -> None:
    """The first says why; the others do not fail with a traceback."""
    problems("registered", parameters={"odd_watt": Parameter(NUMBER, "x", "how strong it is")})
    subject = PluginUnderTest(EntryPoint("odd_lamp", f"{MODULE}:PLUGIN"))
    assert problems_with("registered", subject) == [
        "plugin 'odd_lamp': parameter 'odd_watt': the default: expected number, got 'x'"
    ]
    assert problems_with("mocked", subject) == ["it cannot be tried: ValueError: expected number, got 'x'"]


@pytest.mark.parametrize(
    ("source", "problem"),
    [
        (
            "import rosidl_parser",
            "loading odd_file imports rosidl_parser; import it in the client or the node only",
        ),
        ("1 / 0", "odd_file cannot be loaded in a process of its own: ZeroDivisionError: division by zero"),
        ("print('hello')", None),
    ],
    ids=["ros", "fails", "light"],
)
def test_loading_is_tried_in_a_process_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str, problem: str | None
) -> None:
    """Here much is imported already."""
    (tmp_path / "odd_file.py").write_text(f"{source}\nPLUGIN = None\n")
    (tmp_path / "rosidl_parser.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    found = list(RULES["loads_without_ros"](PluginUnderTest(EntryPoint("odd", "odd_file:PLUGIN"))))
    assert found == ([problem] if problem else [])


@pytest.mark.parametrize(
    ("source", "problems"),
    [
        (
            "PLUGIN = Plugin('far', f'Of process {os.getpid()}.')",
            ["doc is not the same each time it is loaded: '...', then '...'; write down what it is"],
        ),
        (
            "PLUGIN = Plugin('far', 'A.', nodes={f'n{os.getpid()}': 'far:main'})",
            ["node '...' is there in one process and not in another; write down what it is"] * 2,
        ),
        (
            "PLUGIN = Plugin('far', 'A.', values={'far.v': LiveValue('v', BOOL)}, client='far:' + str(len))",
            [],
        ),
    ],
    ids=["changed", "coming and going", "only elsewhere in memory"],
)
def test_a_catalog_is_the_same_each_time(
    source: str, problems: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was checked on a laptop is what the robot loads."""
    imports = (
        "import os\nfrom lupin_engine.plugin.contract import LiveValue, Plugin\n"
        "from lupin_engine.plugin.types import BOOL\n"
    )
    (tmp_path / "ever_new.py").write_text(imports + source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "ever_new", raising=False)
    told = problems_with("stays_the_same", PluginUnderTest(EntryPoint("far", "ever_new:PLUGIN")))
    assert [re.sub(r"'[^']*\d[^']*'|\"[^\"]*\"", "'...'", text) for text in told] == problems


def test_of_a_catalog_that_is_refused_only_what_can_be_seen_is_told(
    problems: Callable[..., list[str]],
) -> None:
    """The same mistake is not told once more by each rule that cannot be tried because of it."""
    problems("registered", parameters={"odd_watt": Parameter(NUMBER, "x", "How strong.")})
    found = findings(PluginUnderTest(EntryPoint("odd_lamp", f"{MODULE}:PLUGIN")))
    assert [rule for rule in RULES if rule not in found] == ["mocked", "computes"]
    assert found["registered"] == [
        "plugin 'odd_lamp': parameter 'odd_watt': the default: expected number, got 'x'"
    ]
    assert found["documented"] == ["parameter 'odd_watt': 'How strong.' is a phrase: leave out the full stop"]


def test_a_rival_of_an_installed_plugin_is_refused() -> None:
    """Also one that is not installed yet."""
    told = problems_with("registered", PluginUnderTest(EntryPoint("nav", "lupin_bridge.catalog:PLUGIN")))
    assert told[0] == "the entry point 'nav' names a plugin that calls itself 'bridge'"
    assert told[1].startswith(
        "plugin 'nav' is offered more than once: lupin_bridge.catalog:PLUGIN and lupin_nav."
    )


def test_findings_are_by_rule(problems: Callable[..., list[str]]) -> None:
    """All rules are told, also those that are kept."""
    problems("registered")
    found = findings(PluginUnderTest(EntryPoint("odd_lamp", f"{MODULE}:PLUGIN")))
    assert list(found) == list(RULES)
    assert {name for name, told in found.items() if told} == {"loads_without_ros"}  # it is in no file


def test_an_unknown_plugin_gets_the_nearest() -> None:
    """As every name does."""
    with pytest.raises(UsageError, match=r"no plugin is called 'nav1'; did you mean 'nav'\?"):
        find_subject("nav1")


@pytest.mark.parametrize(
    "kind",
    [
        BOOL,
        TEXT,
        NUMBER,
        COUNT,
        DURATION,
        POSE,
        list_of(POSE),
        Type("text", "hue", values=("red",)),
        Type("any", "any"),
        Type("number", "share", minimum=0.7, maximum=0.8),
        Type("integer", "low", maximum=-3),
    ],
    ids=str,
)
def test_an_example_has_its_type(kind: Type) -> None:
    """Whatever the limits are, and the same every time."""
    assert convert(example(kind), kind) == example(kind)


def test_arguments_are_given_default_or_made_up() -> None:
    """What may be left out is left out."""
    declared = {
        "given": Argument(DURATION, "one"),
        "default": Argument(NUMBER, "two", default=2.0),
        "needed": Argument(TEXT, "three"),
        "optional": Argument(TEXT, "four", optional=True),
    }
    assert arguments_for(declared, {"given": "1 min"}) == {"given": 60.0, "default": 2.0, "needed": "example"}
    assert defaults_of({"time": Parameter(DURATION, "2 s", "how long")}) == {"time": 2.0}
