"""Hover: the description of the name under the mouse, as Markdown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lupin_engine.chart import Meaning, MissionNode, Node, builtin_actions
from lupin_lsp import docs
from lupin_lsp.folder import Folder
from lupin_lsp.grammar import shapes_of, spot_at
from lupin_lsp.mentions import STATES, Mention, mention_at
from lupin_lsp.model import Model, type_of, with_elements
from lupin_lsp.places import meant


@dataclass(frozen=True)
class Hover:
    """The text to show, and the range that it is about."""

    text: str
    start: int
    end: int


def hover(folder: Folder, path: Path, offset: int) -> Hover | None:
    """Return the description of the name at an offset; None where there is no name or nothing to say."""
    root = folder.kind(path)
    if root is None:
        return None
    mention = mention_at(folder.scan(path), root, offset)
    if mention is None:
        return None
    text = _text(folder, path, root, mention)
    return Hover(text, mention.start, mention.end) if text else None


def _text(folder: Folder, path: Path, root: type[Node], mention: Mention) -> str:
    meaning, model = meant(mention), folder.model
    if meaning in (Meaning.KEY, Meaning.WORD, Meaning.FILE, Meaning.LIFECYCLE):
        return _word(root, mention)
    if meaning in STATES:
        return _state(model, path, mention) if model else ""
    if meaning is Meaning.PART:
        return _part(folder, mention.name)
    found = _of_plugin(folder, meaning, mention)
    if found or model is None:
        return found
    return _of_chart(folder, model, path, meaning, mention)


def _word(root: type[Node], mention: Mention) -> str:
    """Describe a key of the language; for one of its fixed words, the key that it stands under."""
    spot = spot_at(root, mention.path)
    if spot is None or spot.holder is None or spot.field is None:
        return ""
    return docs.key(spot.key, spot.field, shapes_of(spot.holder)[spot.key].words)


def _state(model: Model, path: Path, mention: Mention) -> str:
    """Describe a state; in a part, a name may mean a different one for each use."""
    found = {draft.name: draft for draft in model.find(path, mention)}
    texts = []
    for name, draft in found.items():
        state = model.composed.chart.states[name]
        texts.append(docs.state(name or "(root)", state, model.composed.chart.file_of(draft.place)))
    return "\n\n---\n\n".join(texts)


def _part(folder: Folder, name: str) -> str:
    part = folder.model.part(name) if folder.model else None
    if part is None:
        return ""
    if isinstance(part, MissionNode):
        fields = ", ".join(f"`{key}`" for key in part.request)
        details = f"Fields of its request: {fields}." if fields else ""
        return docs.paragraphs(docs.code(f"mission {part.name}"), part.summary, details)
    needs = f"Needs: {part.needs}." if part.needs else ""
    names = ", ".join(f"`{key}`" for key in part.params)
    return docs.paragraphs(
        docs.code(f"part {name}"), part.summary, needs, f"Parameters: {names}." if names else ""
    )


def _of_plugin(folder: Folder, meaning: Meaning, mention: Mention) -> str:
    catalog, name = folder.catalog, mention.name
    match meaning:
        case Meaning.OPERATION if name in catalog.operations:
            return docs.operation(name, catalog.operations[name])
        case Meaning.ACTION if name in catalog.actions:
            return docs.action(name, catalog.actions[name])
        case Meaning.ACTION if name in docs.builtin_actions_of(catalog.profile):
            return docs.builtin_action(name, catalog.profile)
        case Meaning.FUNCTION if mention.whole in catalog.functions:
            return docs.function(mention.whole, catalog.functions[mention.whole])
        case Meaning.FUNCTION if mention.whole in docs.CALLS:
            return docs.call(mention.whole)
        case Meaning.EVENT if name in catalog.events:
            return docs.event(name, catalog.events[name])
        case Meaning.EVENT if name in catalog.profile.events:
            return docs.paragraphs(docs.code(f"request {name}"), catalog.profile.events[name])
        case Meaning.LIVE_VALUE if name in catalog.values:
            return docs.live_value(name, catalog.values[name])
        case Meaning.TYPE if name in catalog.known_types:
            return docs.code(f"type {docs.type_text(catalog.known_types[name])}")
        case Meaning.ARGUMENT:
            return _argument(folder, mention)
    return ""


def _argument(folder: Folder, mention: Mention) -> str:
    catalog = folder.catalog
    owner = catalog.operations.get(mention.of) or catalog.actions.get(mention.of)
    wanted = owner.arguments if owner else builtin_actions(catalog.profile).get(mention.of, {})
    argument = wanted.get(mention.name)
    return docs.argument_line(mention.name, argument) if argument else ""


def _of_chart(folder: Folder, model: Model, path: Path, meaning: Meaning, mention: Mention) -> str:
    declared, name = model.composed.declared, mention.name
    match meaning:
        case Meaning.PARAMETER | Meaning.BINDING:
            return _parameter(folder, model, path, mention)
        case Meaning.TYPE if name in declared.records:
            return docs.code(f"type {docs.type_text(declared.records[name])}")
        case Meaning.CODE if name in model.composed.chart.codes:
            return docs.reason(model.composed.chart.codes[name])
        case Meaning.EVENT if name in model.composed.chart.answers:
            label = model.composed.chart.answers[name].label
            return docs.paragraphs(docs.code(f"request {name}"), label)
        case Meaning.HOLD if name in declared.holds:
            return docs.hold(declared.holds[name], _summary(folder, "holds", name))
        case Meaning.INPUT if name in declared.inputs:
            found = declared.inputs[name]
            source = folder.catalog.values.get(found.value)
            return docs.live_input(found, _summary(folder, "inputs", name), source)
        case Meaning.VARIABLE if name in declared.context:
            return docs.variable(declared.context[name], _summary(folder, "context", name))
        case Meaning.FIELD:
            return _field(folder, model, path, mention)
        case Meaning.INVARIANT | Meaning.PROPERTY:
            section = "invariants" if meaning is Meaning.INVARIANT else "properties"
            return docs.paragraphs(docs.code(f"{meaning.value} {name}"), _summary(folder, section, name))
        case Meaning.ROOT | Meaning.ATTRIBUTE | Meaning.LEVEL | Meaning.VARIABLE:
            return _typed(folder, model, path, mention)
    return ""


def _parameter(folder: Folder, model: Model, path: Path, mention: Mention) -> str:
    """Describe a parameter: the file's, the used part's, the lifecycle's, or a plugin's."""
    by_file = model.composed.declared.by_file
    used = model.part(mention.of) if mention.meaning is Meaning.BINDING else None
    if isinstance(used, MissionNode):
        mission = model.composed.chart.missions.get(used.name)
        field = mission.request.get(mention.name) if mission else None
        return docs.request_field(field, used.request[mention.name].summary) if field else ""
    if mention.meaning is Meaning.BINDING:
        files = [(used.title, f"part {used.name}")] if used else []
    else:
        own, lifecycle = model.file(path), model.file(folder.lifecycle)
        files = [(file.title, Path(file.place.file).name) for file in (own, lifecycle) if file is not None]
    for title, origin in files:
        if mention.name in by_file.get(title, {}):
            return docs.parameter(mention.name, by_file[title][mention.name], origin)
    found = folder.catalog.parameters.get(mention.name)
    if found is None:
        return ""
    return docs.parameter(mention.name, found, f"plugin {folder.catalog.owners['parameter', mention.name]}")


def _field(folder: Folder, model: Model, path: Path, mention: Mention) -> str:
    """Describe a field of the request; a part reads those of the missions that use it."""
    for mission in model.composed.chart.missions.values():
        found = mission.request.get(mention.name)
        if found is not None and (
            Path(mission.file) == path or not isinstance(model.file(path), MissionNode)
        ):
            summary = folder.scan(Path(mission.file)).value("request", mention.name, "summary") or ""
            return docs.request_field(found, summary)
    return ""


def _typed(folder: Folder, model: Model, path: Path, mention: Mention) -> str:
    """Return the type of a name in an expression."""
    scan = folder.scan(path)
    scope = with_elements(model.scope(path, mention.path, scan), scan.value(*mention.path) or "")
    kind = type_of(scope, mention.so_far.split("."))
    if kind is None:
        return ""
    if mention.index == 0 and mention.name in docs.ROOTS:
        shown = docs.code(f"{mention.name}: {docs.type_text(kind)}") if mention.name == "target" else ""
        return docs.paragraphs(f"**{mention.name}** — {docs.ROOTS[mention.name]}", shown)
    values = f"One of {', '.join(f'`{value}`' for value in kind.values)}." if kind.values else ""
    return docs.paragraphs(docs.code(f"{mention.so_far}: {docs.type_text(kind)}"), values)


def _summary(folder: Folder, section: str, name: str) -> str:
    """Return the summary in a declaration."""
    texts = (folder.scan(file).value(section, name, "summary") for file in folder.files())
    return next((text for text in texts if text), "")
