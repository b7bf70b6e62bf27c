"""Generates JSON Schemas of the files from their models, for editors with YAML support.

pydantic gives keys, descriptions, words. Added here are the short forms that a model accepts in place of a
mapping, snippets, and, with a catalog, the names that plugins offer. A schema knows only the syntax; the
meaning of names is for `lupin check` and `lupin lsp`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel

from lupin_engine.chart import WRITING, IfNode, RaiseNode, builtin_actions
from lupin_engine.plugin import NO_PROFILE, UNITS, Argument, Catalog, Profile, Type
from lupin_lsp import docs
from lupin_lsp.grammar import FILES
from lupin_lsp.snippets import EXAMPLES, SNIPPETS, Snippet

Schema = dict[str, Any]

DIALECT = "http://json-schema.org/draft-07/schema#"
#: The schema that serves every kind of file: it chooses by the key that says what the file is.
ANY_KIND = "lupin"

#: What stands for a mapping in short, by model: a target, an action, a condition.
SHORT_FORMS: Mapping[str, Schema] = MappingProxyType(
    {
        "TransitionNode": {"type": "string", "description": "state to go to"},
        "InvariantNode": {"type": ["string", "boolean"], "description": "condition"},
        "RecordFieldNode": {"type": "string", "description": "type"},
        "BeforeDivertNode": {"type": "string", "description": "how long a divert waits at most"},
    }
)


#: What a lifecycle that extends another one writes as a whole.
_REPLACED = frozenset({"TransitionNode", "HoldNode", "OriginNode", "RaiseNode", "IfNode"})

#: Actions with models of their own.
_STRUCTURED: Mapping[str, type[BaseModel]] = MappingProxyType({"raise": RaiseNode, "if": IfNode})


def kinds(further: Mapping[str, type[BaseModel]] | None = None) -> dict[str, type[BaseModel]]:
    """Return the kinds of files, by characteristic key; a scenario names its mission, so it comes first."""
    return {**(further or {}), **FILES}


def schema(
    kind: str,
    model: type[BaseModel],
    short_forms: Mapping[str, Schema] | None = None,
    one_alone: Iterable[str] = (),
    catalog: Catalog | None = None,
    profile: Profile = NO_PROFILE,
) -> Schema:
    """Return the schema of one kind of file; with a catalog also the names that plugins offer.

    `short_forms` are the alternatives to a mapping, by model; `one_alone` are lists, as `Model.key`, whose
    only element can be written without the list. pydantic knows neither.
    """
    made = model.model_json_schema(by_alias=True, ref_template="#/definitions/{model}")
    definitions = made.pop("$defs", {})
    forms = {**SHORT_FORMS, **(short_forms or {})}
    if "VisitNode" in definitions:
        _, whole = definitions["VisitNode"]["anyOf"]
        whole["properties"]["status"]["enum"] = [*profile.statuses, "open"]
    for each in _STRUCTURED.values():
        definitions[each.__name__] = each.model_json_schema(
            by_alias=True, ref_template="#/definitions/{model}"
        )
    for name, definition in definitions.items():
        _finish(name, definition)
    _finish(model.__name__, made)
    for name in one_alone:
        holder, _, key = name.partition(".")
        if holder in definitions:
            node = definitions[holder]["properties"][key]
            several = {"type": node.pop("type"), "items": node.pop("items")}
            node["anyOf"] = [several, several["items"]]
    definitions["Action"] = _action(profile)
    if catalog is not None:
        _add_names(made, definitions, catalog.for_missions)
    definitions = {
        name: _with_short_form(name, definition, forms) for name, definition in definitions.items()
    }
    made["title"] = f"Lupin {kind}"
    whole = {"$schema": DIALECT, **made, "definitions": dict(sorted(definitions.items()))}
    return _without_required(whole) if "extends" in made["properties"] else whole


def _without_required(whole: Schema) -> Schema:
    """Return the schema of a lifecycle, which may extend another: then a record has only what differs."""
    names = [name for name in whole["definitions"] if name.endswith("Node") and name not in _REPLACED]
    text = json.dumps(whole)
    for name in names:
        text = text.replace(f'"#/definitions/{name}"', f'"#/definitions/Extending{name}"')
    found: Schema = json.loads(text)
    found["required"].remove("states")
    found["definitions"] = {
        f"Extending{name}" if name in names else name: definition
        for name, definition in found["definitions"].items()
    }
    for name in names:
        definition = found["definitions"][f"Extending{name}"]
        for each in (definition, *definition.get("anyOf", ())):
            each.pop("required", None)
    return found


def any_kind(schemas: Mapping[str, Schema]) -> Schema:
    """Return one schema for all kinds of files; it selects by the characteristic key."""
    definitions: Schema = {}
    for found in schemas.values():
        definitions.update(found["definitions"])  # what two kinds share is of the same model
    chosen: Schema = {
        "anyOf": [{"required": [kind]} for kind in schemas],
        "properties": {kind: found["properties"][kind] for kind, found in schemas.items()},
        "defaultSnippets": _plain(SNIPPETS[ANY_KIND]),
    }
    for kind, found in reversed(list(schemas.items())):
        definitions[kind] = {k: v for k, v in found.items() if k not in ("$schema", "definitions")}
        chosen = {"if": {"required": [kind]}, "then": {"$ref": f"#/definitions/{kind}"}, "else": chosen}
    title = {"title": "Lupin file", "description": "A lifecycle, a mission, a part, a binding or a scenario."}
    return {"$schema": DIALECT, **title, "type": "object", **chosen, "definitions": definitions}


# -- what pydantic does not say ------------------------------------------------------------------------------


def _finish(name: str, definition: Schema) -> None:
    """Adapt the definition of a model to editors."""
    definition["description"] = " ".join(definition.get("description", "").split())
    definition["title"] = _title(name)
    for key, node in definition.get("properties", {}).items():
        node.pop("title", None)
        node.pop("default", None) if node.get("default") in (None, "", [], {}) else None
        _drop_null(node)
        _point_to_actions(node)
        examples = EXAMPLES.get(f"{name}.{key}")
        if examples:
            node["examples"] = list(examples)
        if "description" in node:
            node["markdownDescription"] = _markdown(key, node)
    snippets = SNIPPETS.get(name)
    if snippets:
        definition["defaultSnippets"] = _plain(snippets)


def _title(name: str) -> str:
    words = re.findall(r"[A-Z][a-z]+", name.removesuffix("Node"))
    return " ".join(words).capitalize() or name


def _markdown(key: str, node: Schema) -> str:
    words = node.get("enum") or ([node["const"]] if "const" in node else [])
    one_of = f"\n\nOne of {', '.join(f'`{word}`' for word in words)}." if words else ""
    examples = "".join(f"\n\n```yaml\n{key}: {example}\n```" for example in node.get("examples", [])[:1])
    return f"{node['description']}{one_of}{examples}"


def _drop_null(node: Schema) -> None:
    """Forbid null for optional keys: `key:` without a value is a mistake."""
    choices = [choice for choice in node.get("anyOf", ()) if choice != {"type": "null"}]
    if len(choices) == 1:
        del node["anyOf"]
        node.update({key: value for key, value in choices[0].items() if key != "description"})
    elif choices:
        node["anyOf"] = choices


def _point_to_actions(node: Schema) -> None:
    """Let lists of actions and of transitions be written as one alone, too."""
    if node.get("type") == "array" and node.get("items", {}).get("maxProperties") == 1:
        del node["type"], node["items"]
        one = {"$ref": "#/definitions/Action"}
        node["anyOf"] = [{"type": "array", "items": one}, one]


def _action(profile: Profile) -> Schema:
    """Return the schema of an action: its name, or a mapping of its name to its arguments."""
    known, docs_of = builtin_actions(profile), docs.builtin_actions_of(profile)
    takes = {name: wanted for name, wanted in known.items() if wanted}
    mapping: Schema = {
        "type": "object",
        "minProperties": 1,
        "maxProperties": 1,
        "properties": {name: _arguments(wanted, docs_of[name]) for name, wanted in takes.items()},
        "additionalProperties": {"type": ["object", "null"]},
    }
    for name in WRITING:
        about = docs.ACTIONS[name]
        mapping["properties"][name] = {"type": "object", "minProperties": 1, "description": about}
    for name, model in _STRUCTURED.items():
        node = {"$ref": f"#/definitions/{model.__name__}"}
        mapping["properties"][name] = {"description": docs.ACTIONS[name], "allOf": [node]}
    mapping["properties"]["itinerary.close"]["properties"]["status"]["enum"] = list(profile.statuses)
    return {
        "title": "Action",
        "description": "An action: a name, or a mapping of one name to its arguments.",
        "anyOf": [{"type": "string", "examples": [*known]}, mapping],
        "defaultSnippets": _plain(SNIPPETS["Action"]),
    }


def _arguments(wanted: Mapping[str, Argument], doc: str) -> Schema:
    must = [name for name, argument in wanted.items() if argument.default is None and not argument.optional]
    found: Schema = {
        "type": ["object", "null"] if not must else "object",
        "description": doc,
        "additionalProperties": False,
        "properties": {name: _value(argument.type, argument.doc) for name, argument in wanted.items()},
    }
    if must:
        found["required"] = must
    return found


def _value(kind: Type, doc: str) -> Schema:
    """Return the schema of a type: an expression is always a text."""
    shapes = {
        "bool": ["boolean", "string"],
        "integer": ["integer", "string"],
        "number": ["number", "string"],
        "text": ["string"],
        "list": ["array", "string"],
        "record": ["object", "string"],
    }
    shown = docs.type_text(kind)
    found: Schema = {"description": f"{doc} ({shown})", "markdownDescription": f"{doc}\n\n`{shown}`"}
    return {"type": shapes[kind.kind], **found} if kind.kind in shapes else found


def _with_short_form(name: str, definition: Schema, forms: Mapping[str, Schema]) -> Schema:
    """Allow a scalar in place of a mapping where the model accepts one."""
    if name not in forms:
        return definition
    kept: Schema = {key: definition.pop(key) for key in ("title", "description") if key in definition}
    return {**kept, "anyOf": [definition, dict(forms[name])]}


# -- names of plugins ----------------------------------------------------------------------------------------


def _add_names(made: Schema, definitions: dict[str, Schema], catalog: Catalog) -> None:
    """Add the names that plugins offer to the schemas of their keys."""
    owners = {name.removesuffix("Node"): each for name, each in definitions.items()}
    for holder in [made, *definitions.values()]:
        for key, node in holder.get("properties", {}).items():
            if key == "on" and "additionalProperties" in node:
                node["properties"] = dict(_events(node["additionalProperties"], catalog))
            elif key in ("guard", "when", "that", "engage_guard", "release_guard"):
                node["markdownDescription"] = f"{node['description']}\n\n{_functions(catalog)}"
    if "Invoke" in owners:
        _add_operations(owners["Invoke"], catalog)
    if "Input" in owners:
        values = {n: docs.live_value(n, value) for n, value in catalog.values.items()}
        owners["Input"]["properties"]["value"].update(_named(values))
    for name in ("RecordField", "Parameter", "Variable", "RequestField", "Argument", "Result", "BoundValue"):
        if name in owners:
            owners[name]["properties"]["type"].update(_types(catalog))
            owners[name]["properties"]["unit"].update(_named({unit: docs.unit(unit) for unit in UNITS}))
    _add_actions(definitions["Action"], catalog)


def _named(found: Mapping[str, str]) -> Schema:
    return {"enum": list(found), "markdownEnumDescriptions": list(found.values())}


def _types(catalog: Catalog) -> Schema:
    known = catalog.known_types
    shown = {name: docs.type_text(kind) for name, kind in known.items()}
    lists = {f"{gathered} of {name}": "" for gathered in ("list", "set") for name in known}
    # Lists of lists, and record types of the files themselves.
    others = {"type": "string", "pattern": "^((list|set) of )*[a-z][a-z0-9_]*$"}
    return {"anyOf": [_named({**shown, **lists}), others]}


def _add_operations(invoke: Schema, catalog: Catalog) -> None:
    operations = {name: docs.operation(name, found) for name, found in catalog.operations.items()}
    invoke["properties"]["do"].update(_named(operations))
    invoke["allOf"] = [
        {
            "if": {"properties": {"do": {"const": name}}, "required": ["do"]},
            "then": {"properties": {"with": _arguments(found.arguments, found.doc)}},
        }
        for name, found in catalog.operations.items()
    ]


def _add_actions(action: Schema, catalog: Catalog) -> None:
    alone, mapping = action["anyOf"]
    for name, found in catalog.actions.items():
        mapping["properties"][name] = _arguments(found.arguments, found.doc)
        mapping["properties"][name]["markdownDescription"] = docs.action(name, found)
    names = [*builtin_actions(catalog.profile), *catalog.actions]
    alone.pop("examples")
    alone["enum"] = [name for name in names if not mapping["properties"].get(name, {}).get("required")]
    mapping["additionalProperties"] = False
    for name in alone["enum"]:
        mapping["properties"].setdefault(name, {"type": ["object", "null"], "maxProperties": 0})


def _events(each: Schema, catalog: Catalog) -> Iterator[tuple[str, Schema]]:
    for name, doc in catalog.profile.events.items():
        yield name, {**each, "description": doc}
    for name, found in catalog.events.items():
        shown = docs.event(name, found)
        yield name, {**each, "description": found.doc, "markdownDescription": shown}


def _functions(catalog: Catalog) -> str:
    calls = [signature for signature, _ in docs.CALLS.values()]
    calls += [docs.signature(name, found) for name, found in catalog.functions.items()]
    return "An expression may call:\n\n" + "\n".join(f"- `{call}`" for call in calls)


# -- files ---------------------------------------------------------------------------------------------------


def text_of(found: Schema) -> str:
    """Return a schema as the text of its file."""
    return json.dumps(found, indent=2, ensure_ascii=False) + "\n"


def write(folder: Path, schemas: Mapping[str, Schema], done: Callable[[Path], None]) -> None:
    """Write one file for each kind."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, found in schemas.items():
        path = folder / file_name(name)
        path.write_text(text_of(found), encoding="utf-8")
        done(path)


def file_name(kind: str) -> str:
    """Return the file name of a schema."""
    return f"{kind}.schema.json"


def all_schemas(
    models: Mapping[str, type[BaseModel]],
    short_forms: Mapping[str, Schema] | None = None,
    one_alone: Iterable[str] = (),
    catalog: Catalog | None = None,
    profile: Profile = NO_PROFILE,
) -> dict[str, Schema]:
    """Return the schema of every kind, and last the one for all of them."""
    found = {
        kind: schema(kind, model, short_forms, one_alone, catalog, profile) for kind, model in models.items()
    }
    return {**found, ANY_KIND: any_kind(found)}


def _plain(snippets: Iterable[Snippet]) -> list[Schema]:
    return [dict(snippet) for snippet in snippets]
