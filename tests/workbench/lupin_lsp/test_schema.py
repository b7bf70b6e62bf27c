"""The schemas: those in the repository are those of the models, and they accept what the checker accepts."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import CliRunner

from lupin_cli.verbs.schema import schema as verb
from lupin_cli.verbs.schema import schemas
from lupin_engine.chart import source
from lupin_engine.chart.documents import StateNode, TransitionNode
from lupin_engine.chart.expressions.values import plain
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import Node
from lupin_engine.errors import UsageError
from lupin_lsp.grammar import FILES
from lupin_lsp.schema import ANY_KIND, file_name, text_of
from lupin_lsp.snippets import EXAMPLES, SNIPPETS

jsonschema = pytest.importorskip("jsonschema")

ROOT = Path(__file__).parents[3]
KEPT = ROOT / "docs" / "schema"
CHARTS = ROOT / "tests" / "charts"


def kind_of(file: Path) -> str:
    """Return which kind of file it is; nothing for those of others."""
    raw = source.read(file, Findings()) or {}
    return next((kind for kind in ("scenario", *FILES) if isinstance(raw.get(kind), str)), "")


#: Every file of ours in the repository that is not broken on purpose, nor of another profile.
GOOD = sorted(
    file
    for folder in ("missions", "examples", "docs", "plugins", "benchmarks", "lupin_engine", "tests")
    for file in (ROOT / folder).rglob("*.yaml")
    if not {"broken", "warehouse", "node_modules"} & set(file.relative_to(ROOT).parts) and kind_of(file)
)
#: By model that reads something else than its mapping, what may stand for it; some only say what is wrong.
SHORT: dict[str, list[Any]] = {
    "ActionNode": ["report.clear", {"itinerary.advance": None}, {"itinerary.close": {"status": "SKIPPED"}}],
    "BeforeDivertNode": ["60 s", "${ param.wait }"],
    "ChoiceNode": ["Yes, go on"],
    "CountNode": [3],
    "ElementEndNode": [],
    "EndNode": ["nav.go_to"],
    "EndpointNode": [],
    "EventNode": ["plugin.event", {"plugin.event": {"field": 1}}, {"plugin.event": None}],
    "IfNode": [],
    "InvariantNode": ["held(pause)", True],
    "InvokeNode": [],
    "NeverNode": ["FAULT"],
    "OutcomeNode": ["done", "never"],
    "PassNode": ["DONE"],
    "RaiseNode": [],
    "RecordFieldNode": ["text", "list of pose"],
    "RefusedNode": ["not_localized"],
    "RequestNode": ["operator.dock", {"operator.dock": {"field": 1}}, {"operator.dock": None}],
    "RestartNode": ["5 s"],
    "TransitionNode": ["A"],
    "VisitNode": ["7 PUBLISHED", "7 FAILED nav_failed"],
}
#: What a schema sees: the shape of a file.
SEEN = {"unknown-key", "missing-key", "wrong-shape"}
#: Broken charts of which the shape is wrong in a way that needs more than one mapping to see.
NOT_SEEN = {
    "beginnings", "budgets", "carried_fields", "code_details", "contradictions", "copied_answers", "every",
    "for_each_beside", "holds", "inputs", "invoke_with_states", "level_without_target", "lifecycle_names",
    "no_slot", "not_a_mission", "plugin_events", "properties", "request_carried", "request_fields", "retries",
    "slots", "unused_and_unfilled", "words_in_their_place",
}  # fmt: skip


def seen(file: Path) -> bool:
    """Tell whether the shape of a broken chart is wrong in a way that a schema can see."""
    rules = re.findall(r"\[([a-z-]+)\]$", file.with_suffix(".txt").read_text(encoding="utf-8"), re.MULTILINE)
    return bool(SEEN & set(rules)) and file.stem not in NOT_SEEN and source.read(file, Findings()) is not None


BROKEN = [file for file in sorted((CHARTS / "broken").glob("*.yaml")) if seen(file)]


@pytest.fixture(scope="module")
def made() -> dict[str, dict[str, Any]]:
    """The schemas of today's models."""
    return schemas()


@pytest.mark.parametrize("kind", [*FILES, "scenario"])
def test_the_published_schema_is_that_of_the_models(kind: str, made: dict[str, dict[str, Any]]) -> None:
    """Editors read the one in the repository."""
    file = KEPT / file_name(kind)
    kept = file.read_text(encoding="utf-8") if file.is_file() else ""
    if kept != text_of(made[kind]):
        pytest.fail(f"{file.relative_to(ROOT)} is old; run: lupin schema --write docs/schema", pytrace=False)
    jsonschema.Draft7Validator.check_schema(made[kind])


def mistakes(found: dict[str, Any], file: Path) -> list[str]:
    """Return what a schema says of a file."""
    raw = source.read(file, Findings())
    assert raw is not None
    return [error.message for error in jsonschema.Draft7Validator(found).iter_errors(plain(raw))]


@pytest.mark.slow
@pytest.mark.parametrize("file", GOOD, ids=lambda file: str(file.relative_to(ROOT)))
def test_accepts_what_is_good(file: Path, made: dict[str, dict[str, Any]]) -> None:
    """The schema of its kind, and the one for all."""
    raw = source.read(file, Findings())
    assert raw is not None
    kind = next(kind for kind in ("scenario", *FILES) if kind in raw)
    assert mistakes(made[kind], file) == []
    assert mistakes(made[ANY_KIND], file) == []


def test_accepts_every_short_form(made: dict[str, dict[str, Any]]) -> None:
    """A model that reads a short form has one in the list above, and its schema takes it."""
    models, waiting = set[type[Node]](), [Node]
    while waiting:
        models |= (found := {*waiting.pop().__subclasses__()} - models)
        waiting += found
    ours = [model for model in models if model.__module__.startswith("lupin_engine.")]
    assert sorted(model.__name__ for model in ours if "_long_form" in vars(model)) == sorted(SHORT)
    schema = made[ANY_KIND]
    for name, forms in SHORT.items():
        there = name.removesuffix("Node") if name == "ActionNode" else name
        part = {"definitions": schema["definitions"], "$ref": f"#/definitions/{there}"}
        for form in forms:
            # What may stand for a choice is said where choices are.
            assert name == "ChoiceNode" or jsonschema.Draft7Validator(part).is_valid(form), (name, form)


@pytest.mark.parametrize("file", BROKEN, ids=lambda file: file.stem)
def test_sees_wrong_shapes(file: Path, made: dict[str, dict[str, Any]]) -> None:
    """Unknown keys, missing keys, a list where a mapping belongs."""
    assert mistakes(made[ANY_KIND], file)


def test_every_key_is_described(made: dict[str, dict[str, Any]]) -> None:
    """It is what hover shows."""
    holders = [made[ANY_KIND], *made[ANY_KIND]["definitions"].values()]
    silent = [
        (holder.get("title"), key)
        for holder in holders
        for node in [holder, *holder.get("anyOf", [])]
        for key, found in node.get("properties", {}).items()
        if "description" not in found
    ]
    assert silent == []


def test_snippets_and_examples_belong_to_keys_that_exist(made: dict[str, dict[str, Any]]) -> None:
    """A key that is renamed in the models must be renamed there."""
    definitions = made[ANY_KIND]["definitions"]
    for name in [*SNIPPETS, *EXAMPLES]:
        model, _, key = name.partition(".")
        if key:
            found = definitions[model]
            assert any(key in node.get("properties", {}) for node in [found, *found.get("anyOf", [])]), name
        else:
            assert model == ANY_KIND or model in definitions


def filled(body: Any) -> Any:
    """Return a form as it is before anything is filled in, read back from YAML as an editor writes it."""
    text = yaml.safe_dump(body, sort_keys=False)
    text = re.sub(r"'?\$\{\d+:?((?:\\.|[^\\}])*)\}'?", lambda match: match.group(1) or "x", text)
    return yaml.safe_load(text.replace("\\", "").replace("''", "'"))


FORMS = [
    (name, snippet["label"], snippet["body"]) for name, snippets in SNIPPETS.items() for snippet in snippets
]


@pytest.mark.parametrize(
    ("name", "label", "body"), FORMS, ids=[f"{name}: {label}" for name, label, _ in FORMS]
)
def test_a_form_is_a_piece_of_a_mission(
    name: str, label: str, body: Any, made: dict[str, dict[str, Any]]
) -> None:
    """Before anything is filled in, the schema has nothing to say against it."""
    found = made[ANY_KIND]
    if name != ANY_KIND:
        found = {"definitions": found["definitions"], "$ref": f"#/definitions/{name}"}
    assert [error.message for error in jsonschema.Draft7Validator(found).iter_errors(filled(body))] == []


def test_knows_the_plugins_when_asked() -> None:
    """Operations with their arguments, actions, events, live values, types, units."""
    found = schemas(with_names=True)["mission"]
    jsonschema.Draft7Validator.check_schema(found)
    invoke = found["definitions"]["InvokeNode"]
    assert "nav.go_to" in invoke["properties"]["do"]["enum"]
    assert len(invoke["properties"]["do"]["markdownEnumDescriptions"]) == len(
        invoke["properties"]["do"]["enum"]
    )
    assert "robot.pose" in found["definitions"]["InputNode"]["properties"]["value"]["enum"]
    assert "operator.pause" in found["definitions"]["StateNode"]["properties"]["on"]["properties"]
    guard = found["definitions"]["TransitionNode"]["anyOf"][0]["properties"]["guard"]
    assert "approach(target: tag) -> pose" in guard["markdownDescription"]
    validator = jsonschema.Draft7Validator(found)
    mission = plain(source.read(ROOT / "missions" / "inspection.yaml", Findings()))
    assert list(validator.iter_errors(mission)) == []
    state = mission["states"]["PREPARE"]["states"]["LOCALIZING"]
    state["invoke"]["with"]["max_varance"] = state["invoke"]["with"].pop("max_variance")
    said = " ".join(error.message for error in validator.iter_errors(mission))
    assert "max_varance" in said or "is not valid under any" in said


@pytest.mark.parametrize("word", ["Parameter", "Argument", "Result", "BoundValue"])
def test_knows_the_units_wherever_one_is_written(word: str) -> None:
    """Of a binding, in everything that has a number on the other side."""
    binding = schemas(with_names=True)["binding"]
    found = binding["definitions"][f"{word}Node"]["properties"]["unit"]
    assert {"deg", "mm", "%"} <= set(found["enum"])
    assert found["markdownEnumDescriptions"][found["enum"].index("mm")] == "1 mm is 0.001 m"


def test_the_verb_prints_and_writes(tmp_path: Path, made: dict[str, dict[str, Any]]) -> None:
    """One kind, or the one for all, on standard output; each kind into a folder."""
    printed = CliRunner().invoke(verb, ["part"]).output
    assert json.loads(printed) == made["part"]
    assert json.loads(CliRunner().invoke(verb, []).output) == made[ANY_KIND]
    done = CliRunner().invoke(verb, ["--write", str(tmp_path / "new")])
    assert done.exit_code == 0
    written = sorted(path.name for path in (tmp_path / "new").iterdir())
    assert written == sorted(file_name(kind) for kind in made if kind != ANY_KIND)
    refused = CliRunner().invoke(verb, ["misson"])
    assert isinstance(refused.exception, UsageError)
    assert str(refused.exception) == "no kind of file 'misson'; did you mean 'mission'?"


def test_short_forms_are_those_of_the_models() -> None:
    """A target, a condition and an action may stand alone."""
    assert TransitionNode.model_validate("A").target == "A"
    assert StateNode.model_validate({"entry": "report.clear"}).entry[0].name == "report.clear"
