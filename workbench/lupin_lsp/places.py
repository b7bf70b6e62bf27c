"""Go to definition: the declaration of a thing, in the folder or in its plugin's catalog."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from lupin_engine.bindings import binding_files
from lupin_engine.chart import WRITING, Draft, Kind, Meaning
from lupin_engine.missions import PARTS
from lupin_engine.plugin import builtin, entry_points, import_plugin, source_file
from lupin_lsp.folder import Folder
from lupin_lsp.mentions import STATES, Mention
from lupin_lsp.model import steps_of
from lupin_lsp.scan import Steps, Token


@dataclass(frozen=True)
class Spanned:
    """A range in a file."""

    file: Path
    start: int
    end: int


#: The mapping of a file that declares such a thing.
_SECTIONS: Mapping[Meaning, str] = {
    Meaning.PARAMETER: "params",
    Meaning.INPUT: "inputs",
    Meaning.CODE: "codes",
    Meaning.VARIABLE: "context",
    Meaning.HOLD: "holds",
    Meaning.FIELD: "request",
    Meaning.INVARIANT: "invariants",
    Meaning.PROPERTY: "properties",
    Meaning.TYPE: "types",
}
#: The class of such a thing in a plugin's catalog, and its family among the owners of the registry.
_MADE_BY: Mapping[Meaning, tuple[str, str]] = {
    Meaning.OPERATION: ("Operation", ""),
    Meaning.ACTION: ("Action", ""),
    Meaning.EVENT: ("EventKind", ""),
    Meaning.FUNCTION: ("Function", "function"),
    Meaning.LIVE_VALUE: ("LiveValue", "value"),
    Meaning.PARAMETER: ("Parameter", "parameter"),
    Meaning.TYPE: ("Type", "type"),
}


def definition(folder: Folder, path: Path, mention: Mention) -> list[Spanned]:
    """Return the declarations of a mentioned thing; several when its uses differ."""
    meaning = meant(mention)
    if meaning in STATES:
        return _states(folder, path, mention)
    if meaning is Meaning.PART:
        return _part(folder, mention.name)
    if meaning is Meaning.LIFECYCLE:
        base = folder.base
        return [] if base is None else _spanned(base, folder.scan(base).value_token(("lifecycle",)))
    if meaning is Meaning.LEVEL:
        return _declared(folder, path, ("inputs", mention.of, "levels", mention.name))
    if meaning is Meaning.BINDING:
        file = folder.used(mention.of)
        section = "params" if file.parent.name == PARTS else "request"
        return _key(
            folder, file, ("out" if is_reported(folder, file, mention.name) else section, mention.name)
        )
    if meaning is Meaning.VARIABLE and is_reported(folder, path, mention.name):
        return _key(folder, path, ("out", mention.name))
    if meaning in _SECTIONS:
        found = _declared(folder, path, (_SECTIONS[meaning], mention.name))
        if found or meaning not in (Meaning.PARAMETER, Meaning.CODE, Meaning.TYPE):
            return found
    return _in_plugin(folder, meaning, mention)


def is_reported(folder: Folder, file: Path, name: str) -> bool:
    """Return whether a file is a part that reports a variable by a name."""
    return folder.scan(file).key_token(("out", name)) is not None


def meant(mention: Mention) -> Meaning:
    """Return the meaning of a mention; an argument of `set` and the like is a variable."""
    if mention.meaning is Meaning.ARGUMENT and mention.of in WRITING:
        return Meaning.VARIABLE
    return mention.meaning


# -- in the folder -------------------------------------------------------------------------------------------


def place_of(folder: Folder, draft: Draft) -> Spanned | None:
    """Return the range of a state's name in the present text; None where it has none any more."""
    if folder.model is None:
        return None
    file, local = folder.model.written(draft)
    if file == folder.lifecycle and folder.base is not None and local:
        steps = steps_of(local if draft.node is not None else local[:-1])
        file = file if folder.scan(file).key_token(steps) else folder.base
    scan = folder.scan(file)
    if draft.node is None and draft.kind is not Kind.HISTORY:
        head = next((key for key in scan.keys(()) if key.text in ("mission", "lifecycle")), None)
        token = scan.value_token(head.path) if head else None
    elif draft.node is None:
        token = scan.key_token((*steps_of(local[:-1]), "history"))
    else:
        token = scan.key_token(steps_of(local))
    return next(iter(_spanned(file, token)), None)


def _states(folder: Folder, path: Path, mention: Mention) -> list[Spanned]:
    drafts = folder.model.find(path, mention) if folder.model else []
    return list(dict.fromkeys(place for draft in drafts if (place := place_of(folder, draft)) is not None))


def _part(folder: Folder, name: str) -> list[Spanned]:
    file = folder.used(name)
    scan = folder.scan(file)
    return _spanned(file, scan.value_token(("part",)) or scan.value_token(("mission",)))


def _declared(folder: Folder, path: Path, steps: Steps) -> list[Spanned]:
    """Search the file itself, then the lifecycle, then the others."""
    for file in dict.fromkeys([path, *folder.files()]):
        found = _key(folder, file, steps)
        if found:
            return found
    return []


def _key(folder: Folder, file: Path, steps: Steps) -> list[Spanned]:
    return _spanned(file, folder.scan(file).key_token(steps))


def _spanned(file: Path, token: Token | None) -> list[Spanned]:
    return [Spanned(file, token.inner, token.inner + len(token.text))] if token else []


def _in_binding(folder: Folder, meaning: Meaning, mention: Mention) -> list[Spanned]:
    """Return the declaration in a binding."""
    plugin, _, local = (mention.of if meaning is Meaning.ARGUMENT else mention.name).partition(".")
    of_it: dict[Meaning, tuple[Steps, ...]] = {
        Meaning.OPERATION: (("operations", local),),
        Meaning.ACTION: (("actions", local),),
        Meaning.EVENT: (("events", local),),
        Meaning.ARGUMENT: tuple(
            (family, local, "arguments", mention.name) for family in ("operations", "actions")
        ),
    }
    of_any: dict[Meaning, tuple[Steps, ...]] = {
        Meaning.CODE: (("codes", mention.name),),
        Meaning.LIVE_VALUE: (("values", mention.name),),
        Meaning.PARAMETER: (("params", mention.name),),
        Meaning.TYPE: (("types", mention.name),),
    }
    files = [f for f in binding_files(folder.path) if meaning in of_any or f.stem == plugin]
    steps = of_it.get(meaning, ()) + of_any.get(meaning, ())
    return next(filter(None, (_key(folder, f, way) for f in files for way in steps)), [])


# -- in plugins ----------------------------------------------------------------------------------------------


def _in_plugin(folder: Folder, meaning: Meaning, mention: Mention) -> list[Spanned]:
    catalog = folder.catalog
    bound = _in_binding(folder, meaning, mention)
    if bound:
        return bound
    if meaning is Meaning.CODE:
        return [place for plugin in catalog.plugins for place in _code(plugin, mention.name)][:1]
    if meaning is Meaning.ARGUMENT:
        plugin, _, name = mention.of.partition(".")
        return _made(plugin, name, ("Operation", "Action"), mention.name)
    if meaning not in _MADE_BY:
        return []
    maker, family = _MADE_BY[meaning]
    name = mention.whole or mention.name if meaning is Meaning.FUNCTION else mention.name
    plugin, _, local = name.partition(".")
    if family:
        plugin, local = catalog.owners.get((family, name), ""), name
    return _made(plugin, local, (maker,))


def _made(plugin: str, name: str, makers: tuple[str, ...], argument: str = "") -> list[Spanned]:
    file = catalog_file(plugin)
    if file is None:
        return []
    found = next((node for node in _pairs(file, name, makers)), None)
    if found is None:
        return [Spanned(file, 0, 0)]
    key, value = found
    inner = next((k for k, _ in _keys_in(value) if k.value == argument), None) if argument else None
    return [_span(file, inner or key)]


def _code(plugin: str, name: str) -> list[Spanned]:
    """Return the place where a catalog makes a code: `Code("name", ...)`."""
    file = catalog_file(plugin)
    for node in ast.walk(_tree(file)) if file else ():
        if isinstance(node, ast.Call) and _called(node) == "Code" and node.args and file:
            first = node.args[0]
            if isinstance(first, ast.Constant) and first.value == name:
                return [_span(file, first)]
    return []


def _pairs(file: Path, name: str, makers: tuple[str, ...]) -> Iterator[tuple[ast.Constant, ast.expr]]:
    """Yield the pairs of a catalog's mappings that make a thing of that name; other pairs come last."""
    pairs = [pair for pair in _keys_in(_tree(file)) if pair[0].value == name]
    yield from (pair for pair in pairs if isinstance(pair[1], ast.Call) and _called(pair[1]) in makers)
    yield from (pair for pair in pairs if not isinstance(pair[1], ast.Call))


def _keys_in(tree: ast.AST) -> Iterator[tuple[ast.Constant, ast.expr]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if isinstance(key, ast.Constant):
                    yield key, value


def _called(node: ast.Call) -> str:
    return node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")


def _span(file: Path, node: ast.Constant) -> Spanned:
    """Return a text in quotes, without them."""
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    before = lines[node.lineno - 1].encode()[: node.col_offset].decode()
    start = sum(map(len, lines[: node.lineno - 1])) + len(before) + 1
    return Spanned(file, start, start + len(str(node.value)))


@lru_cache(32)
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@lru_cache(32)
def catalog_file(plugin: str) -> Path | None:
    """Return the file that makes the `Plugin` of that name; None where none is installed."""
    if plugin == builtin.BUILTIN:
        return Path(builtin.__file__)
    modules = (point.module for point in entry_points() if import_plugin(point).name == plugin)
    file = next(map(source_file, modules), None)
    return Path(file) if file else None
