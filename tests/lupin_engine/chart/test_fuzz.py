"""Whatever stands in files and expressions: our own findings come out or a chart does, soon and small.

In CI the same few hundred examples are tried every time. LUPIN_FUZZ=20000 tries that many new ones instead.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from types import CodeType
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lupin_engine.chart.expressions.checker import compile_expression
from lupin_engine.chart.expressions.evaluation import Compiled, UnknownValue
from lupin_engine.chart.expressions.scope import Fragment, Scope
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import text_at
from lupin_engine.errors import Diagnostic, Place, Severity
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import ANY, BOOL, COUNT, DURATION, POSE, TEXT, Type, list_of
from tests.lupin_engine.chart.expressions.test_expressions import (
    ESCAPES,
    EXHAUSTIONS,
    environment,
    wide_scope,
)
from tests.lupin_engine.chart.test_words import wide_catalog

ROOT = Path(__file__).parents[3]
GOOD = ROOT / "tests" / "charts" / "good"
MINI = ROOT / "tests" / "charts" / "mini"
#: Missions with everything that they need around them: lifecycle, missions, parts.
FOLDERS = ((ROOT / "missions" / LIFECYCLE, ROOT / "missions"), (MINI / LIFECYCLE, GOOD))

#: What is drawn may be long; that is no reason to warn.
pytestmark = pytest.mark.filterwarnings("ignore:Generating overly large repr")

EXAMPLES = int(os.environ.get("LUPIN_FUZZ", "100"))
#: A shared machine stops for a while now and then; what never ends takes longer than this.
SECONDS = 3.0
FUZZED = settings(
    max_examples=EXAMPLES,
    derandomize="LUPIN_FUZZ" not in os.environ,
    database=None,
    deadline=timedelta(seconds=SECONDS),
    suppress_health_check=[
        HealthCheck.too_slow,
        HealthCheck.data_too_large,
        HealthCheck.function_scoped_fixture,
    ],
)


# -- files ---------------------------------------------------------------------------------------------------


def _texts() -> list[str]:
    folders = {folder for lifecycle, missions in FOLDERS for folder in (lifecycle.parent, missions)}
    return [
        path.read_text(encoding="utf-8")
        for folder in sorted(folders)
        for path in sorted(folder.rglob("*.yaml"))
    ]


TEXTS = _texts()
LINES = sorted({line for text in TEXTS for line in text.splitlines()})
WORD = re.compile(r"\w+|[^\w\s]")
WORDS = sorted({word for text in TEXTS for word in WORD.findall(text)})
#: What files are never meant to contain.
STRANGE = [
    "",
    " ",
    "\t",
    "\n",
    "\r\n",
    "\x00",
    "\x07",
    "\x85",
    "\u2028",
    "\ufeff",
    "\ud800",
    "\U0001f916",
    "- ",
    ": ",
    "? ",
    "| ",
    ">-\n",
    "[",
    "]",
    "{",
    "}",
    "&a ",
    "*a",
    "<<: *a",
    "!!python/object/apply:os.system ",
    "%YAML 1.1\n---\n",
    "---\n",
    "...\n",
    "# ",
    "'",
    '"',
    "\\",
    "9" * 39,
    "9" * 400,
    "1e999",
    "-1e-999",
    "0x" + "f" * 38,
    ".nan",
    "NaN",
    "-0",
    "1_000",
    "null",
    "true",
    "${ 1 / 0 }",
    "${ " + "(" * 150,
    "${ " + "not " * 150 + "true }",
    "${ param.x ",
    "{{ x }}",
    "list of " * 1200 + "text",
    "a." * 1200 + "a",
    "[" * 200,
    "{a: " * 59 + "1" + "}" * 59,
    "x" * 5000,
    "-1 s",
    "1e300 h",
    "__class__",
    "MISSION.history",
    "../../etc/passwd",
]
PIECES = st.sampled_from(STRANGE) | st.sampled_from(WORDS) | st.text(max_size=8)
EDITS = st.tuples(
    st.sampled_from(
        ["drop", "double", "swap", "line", "indent", "token", "insert", "cut", "value", "deepen"]
    ),
    st.integers(0, 10_000),
    st.integers(0, 10_000),
    PIECES,
)


def edited(text: str, edit: tuple[str, int, int, str]) -> str:
    """Change a text in one way, at a place that is there."""
    kind, first, second, piece = edit
    lines = text.split("\n")
    at, other = first % len(lines), second % len(lines)
    line = lines[at]
    if kind == "drop":
        del lines[at : at + 1 + second % 3]
    elif kind == "double":
        lines.insert(other, line)
    elif kind == "swap":
        lines[at], lines[other] = lines[other], line
    elif kind == "line":
        lines[at] = LINES[second % len(LINES)]
    elif kind == "indent":
        lines[at] = " " * (second % 9) + line.lstrip()
    elif kind == "deepen":
        lines[at:] = ["  " * (second % 3) + later for later in lines[at:]]
    elif kind == "value":
        lines[at] = f"{line.partition(':')[0]}: {piece}"
    elif kind == "cut":
        lines[at] = line[: second % (len(line) + 1)]
    elif kind == "insert":
        column = second % (len(line) + 1)
        lines[at] = line[:column] + piece + line[column:]
    else:
        words = list(WORD.finditer(line))
        if words:
            word = words[second % len(words)]
            lines[at] = line[: word.start()] + piece + line[word.end() :]
    return "\n".join(lines)


class Folder:
    """A copy of missions with everything around them, in which one file at a time is broken."""

    def __init__(self, lifecycle: Path, missions: Path, copy: Path) -> None:
        self._original = {path.relative_to(missions): path.read_bytes() for path in missions.rglob("*.yaml")}
        self._original[Path(LIFECYCLE)] = lifecycle.read_bytes()
        self.path = copy
        self.files = sorted(self._original)
        for name in self.files:
            self.write(name, self._original[name])
        self.missions = [
            copy / name for name in self.files if len(name.parts) == 1 and name.name != LIFECYCLE
        ]

    def text(self, name: Path) -> str:
        """Return what a file says before it is broken."""
        return self._original[name].decode()

    def write(self, name: Path, content: bytes) -> None:
        """Write another content into a file."""
        (self.path / name).parent.mkdir(parents=True, exist_ok=True)
        (self.path / name).write_bytes(content)

    def check(self, name: Path, content: bytes, catalog: Catalog) -> tuple[Diagnostic, ...]:
        """Check the missions while a file has another content: the one that is broken, or all of them."""
        self.write(name, content)
        try:
            missions = [path for path in self.missions if path == self.path / name] or self.missions
            chart, found = check_chart(self.path / LIFECYCLE, missions, catalog)
        finally:
            self.write(name, self._original[name])
        assert (chart is None) == any(diagnostic.severity is Severity.ERROR for diagnostic in found)
        return found


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Folder]:
    """Copies of the shipped missions and of those that the tests have."""
    return [Folder(*origin, tmp_path_factory.mktemp("fuzz")) for origin in FOLDERS]


@pytest.fixture(scope="module")
def catalog() -> Catalog:
    """Everything that these missions use."""
    return wide_catalog()


def told_well(found: tuple[Diagnostic, ...]) -> None:
    """Check that findings are what a person can read: each with a place, and none of a novel's length."""
    for diagnostic in found:
        assert diagnostic.place.line >= 1
        assert diagnostic.place.column >= 1
        assert len(str(diagnostic)) < 20_000


@pytest.mark.slow
@FUZZED
@given(which=st.integers(0, 1000), edits=st.lists(EDITS, min_size=1, max_size=5))
def test_a_file_broken_by_hand_is_answered(
    which: int, edits: list[tuple[str, int, int, str]], folders: list[Folder], catalog: Catalog
) -> None:
    """Lines lost, doubled and moved, words replaced, strange characters: a chart, or findings."""
    folder = folders[which % len(folders)]
    name = folder.files[which // len(folders) % len(folder.files)]
    text = folder.text(name)
    for edit in edits:
        text = edited(text, edit)
    told_well(folder.check(name, text.encode("utf-8", "surrogatepass"), catalog))


@pytest.mark.slow
@FUZZED
@given(
    which=st.integers(0, 1000),
    at=st.integers(0, 10_000),
    octets=st.binary(max_size=6),
    drop=st.integers(0, 40),
)
def test_a_file_broken_by_a_disk_is_answered(
    which: int, at: int, octets: bytes, drop: int, folders: list[Folder], catalog: Catalog
) -> None:
    """Bytes that are no text."""
    folder = folders[which % len(folders)]
    name = folder.files[which // len(folders) % len(folder.files)]
    content = folder.text(name).encode()
    at %= len(content)
    told_well(folder.check(name, content[:at] + octets + content[at + drop :], catalog))


KEYS = st.sampled_from([word for word in WORDS if word.isidentifier()])
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.sampled_from(STRANGE)
    | st.sampled_from(WORDS)
    | st.sampled_from(["5 s", "done", "${ param.x }", "nav.go_to", "never", "parallel", "operator.pause"])
)
#: Any nesting of the language's words.
NODES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(KEYS | st.text(max_size=5), inner, max_size=5)
    ),
    max_leaves=30,
)


HEADS = [
    *("summary", "params", "inputs", "codes", "context", "request", "holds", "invariants"),
    *("initial", "entry", "exit", "on", "needs", "resume_at"),
]


def flow(value: Any) -> str:
    """Write plain data as a YAML author might who loves braces."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{flow(key)}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(flow(item) for item in value) + "]"
    if isinstance(value, str):
        return "'" + value.replace("'", "''").replace("\n", "\n\n") + "'" if value else "''"
    return {None: "", True: "true", False: "false"}.get(value, repr(value))


@pytest.mark.slow
@FUZZED
@given(
    states=st.dictionaries(KEYS, NODES, max_size=4),
    keys=st.dictionaries(st.sampled_from(HEADS), NODES, max_size=4),
    kind=st.sampled_from(["mission", "lifecycle"]),
)
def test_words_in_any_order_are_answered(
    states: dict[str, Any], keys: dict[str, Any], kind: str, folders: list[Folder], catalog: Catalog
) -> None:
    """A file in which every word is one of the language's and nothing makes sense."""
    folder = folders[1]
    text = flow({kind: "Fuzzed", **keys, "states": states})
    name = Path(LIFECYCLE) if kind == "lifecycle" else folder.missions[0].relative_to(folder.path)
    told_well(folder.check(name, text.encode("utf-8", "surrogatepass"), catalog))


# -- expressions ---------------------------------------------------------------------------------------------


def split(words: str) -> list[str]:
    """Return the words of a text that is too long for a list of them."""
    return words.split()


ATOMS = split("""
    1 0 2.5 0.0 17 9007199254740992 'a' '5s' '1m' '20%' true false done reason visits param.patience param.far
    param.ratio param.goal param.names request.goal input.estop input.pose input.pose.x input.battery
    input.battery.value input.battery.low event event.x event.pose.x target target.id target.x itinerary.open
    itinerary.remaining known(input.pose) held(pause) in_state('READY') in_state(A.READY) approach(target).yaw
    tags.named(param.names) tags.numeric_order() [] () [1] ['a','b'] ('battery','dock') visits*visits -visits
    e e.x e.id t t.x t.id t=='a' e!='a' find(param.names,t=='a') known(find(tags.numeric_order(),t.id=='a'))
""")
TOKENS = split("""
    and or not in is if else for lambda None yield await async import as with : := , . ; = == != < <= > >= + -
    * / // % ** << >> & | ^ ~ @ ( ) [ ] { } ... -> ' " # $ ! ? ` f'{x}' b'x' u'x' 1j 0x1F 0b1 0o7 1_0 1e999
    1if 01 len min max abs round any all known held __class__ _x x.__dict__ ().x param._y é print eval
""")
#: The ligature and the wide letter are two names that Python reads as others: `fi`, and `param`.
TOKENS += [
    *ATOMS,
    "\uff50aram",
    "\ufb01.\ufb01",
    "\\",
    "r'\\'",
    "'''",
    "\t",
    "\n",
    "\x00",
    "\ud800",
    "\u2028",
]
SOUPS = st.lists(st.sampled_from(TOKENS), max_size=25).flatmap(
    lambda tokens: st.sampled_from([" ".join(tokens), "".join(tokens)])
)


def _larger(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    signs = st.sampled_from(
        ["+", "-", "*", "/", "//", "%", "==", "!=", "<", "<=", ">", ">=", "in", "and", "or"]
    )
    calls = st.sampled_from(["len", "min", "max", "abs", "round", "any", "all", "sum", "first", "sorted"])
    return st.one_of(
        st.tuples(inner, signs, inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
        st.tuples(inner, signs, inner, signs, inner).map(" ".join),
        st.tuples(inner, inner, inner).map(lambda t: f"({t[0]} if {t[1]} else {t[2]})"),
        st.tuples(st.sampled_from(["not ", "-"]), inner).map("".join),
        st.tuples(calls, st.lists(inner, max_size=3)).map(lambda t: f"{t[0]}({', '.join(t[1])})"),
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]"),
        st.tuples(inner, inner).map(lambda t: f"{t[0]}[{t[1]}]"),
        st.tuples(inner, st.sampled_from(["x", "id", "value", "_x", "__class__"])).map(".".join),
        inner.map(lambda text: f"round({text}, 2)"),
        st.tuples(inner, inner).map(lambda t: f"[{t[0]} for e in {t[1]}]"),
        st.tuples(inner, inner, inner).map(lambda t: f"[{t[0]} for e in {t[1]} if {t[2]}]"),
        st.tuples(st.sampled_from(["find", "sorted", "first"]), inner, inner).map(
            lambda t: f"{t[0]}({t[1]}, {t[2]})"
        ),
    )


SENTENCES = st.recursive(st.sampled_from(ATOMS), _larger, max_leaves=12)
SLIPS = st.lists(st.tuples(st.integers(0, 500), st.sampled_from(TOKENS) | st.text(max_size=3)), max_size=3)


def slipped(text: str, slips: list[tuple[int, str]]) -> str:
    """Overwrite a text here and there."""
    for at, piece in slips:
        at %= len(text) + 1
        text = text[:at] + piece + text[at + 1 :]
    return text


@pytest.fixture(scope="module")
def scope(catalog: Catalog) -> Scope:
    """A scope with one of everything."""
    return wide_scope(catalog)


def codes(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object and those inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes(constant)


#: All that compiled code may name besides its environment.
NAMES = {"len", "min", "max", "abs", "round", "any", "all", "_times", "_over", "_same", "sum", "sorted"}
NAMES |= {"_bounded", "_short", "_first", "_found", "_known", "_number"}
#: What an expression may raise, and what more when it has read something of which nothing is known.
RAISED = (UnknownValue, ZeroDivisionError, IndexError, OverflowError, ValueError)
RAISED_BY_ANY = (*RAISED, KeyError, TypeError)
FUNCTIONS = {
    "approach": lambda target: {"x": target["x"], "y": 0.0, "yaw": 0.0},
    "tags.named": list,
    "tags.numeric_order": list,
}
WANTED = st.sampled_from([ANY, BOOL, COUNT, DURATION, TEXT, POSE, list_of(TEXT)])
ENVIRONMENTS = st.sampled_from(
    [
        environment(),
        environment(
            event=7,
            target={"id": "", "x": 0.0, "y": -0.0},
            context={"reason": "", "visits": 0, "done": False},
        ),
        environment(event={}, context={"reason": "a", "visits": 10**15, "done": True}),
        environment(param={"patience": 1e308, "far": -1e308, "ratio": 0.0, "goal": 0, "names": []}),
    ]
)


def evaluate(source: str, wanted: Type, scope: Scope, env: Any) -> None:
    """Compile whatever a text is and evaluate it when it was accepted."""
    findings = Findings()
    text = text_at(source, Place("m.yaml", 3, 5))
    expression = compile_expression(Fragment(source, text), scope, wanted, findings, "here")
    told_well(findings.all)
    assert (expression is None) == bool(findings.errors)
    if expression is None:
        return
    env = {**env, "functions": FUNCTIONS}
    for function in (expression.evaluate, *(part for _, part in expression.parts)):
        assert isinstance(function, Compiled)
        for code in codes(function.compiled().__code__):
            assert set(code.co_names) <= NAMES
        allowed = RAISED_BY_ANY if "event" in source else RAISED
        try:
            result = function(env)
        except allowed:
            continue
        assert len(repr(result)) < 100_000


@FUZZED
@given(source=SOUPS, wanted=WANTED, env=ENVIRONMENTS)
def test_a_soup_of_tokens_is_answered(source: str, wanted: Type, env: Any, scope: Scope) -> None:
    """Tokens of Python and of ours in any order."""
    evaluate(source, wanted, scope, env)


@FUZZED
@given(source=SENTENCES, slips=SLIPS, wanted=WANTED, env=ENVIRONMENTS)
def test_a_sentence_with_slips_is_answered(
    source: str, slips: list[tuple[int, str]], wanted: Type, env: Any, scope: Scope
) -> None:
    """Expressions that are mostly right, and some of them slips of the pen."""
    evaluate(source, wanted, scope, env)
    evaluate(slipped(source, slips), wanted, scope, env)


@FUZZED
@given(source=st.sampled_from(ESCAPES + EXHAUSTIONS), slips=SLIPS, env=ENVIRONMENTS)
def test_an_attempt_to_escape_with_slips_is_answered(
    source: str, slips: list[tuple[int, str]], env: Any, scope: Scope
) -> None:
    """What is refused as it stands may become something else by a letter."""
    evaluate(slipped(source, slips), ANY, scope, env)
