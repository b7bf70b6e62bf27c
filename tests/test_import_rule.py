"""Who may import whom: the rule of docs/design.md, read off the source of every module.

A room is a folder of a shelf. `A <- B` there means that B may import A and all that A may; what is not
listed here is forbidden. Imports inside functions count as well, and those that only the type checker sees.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLUGINS = ROOT / "plugins"
WORKBENCH = ROOT / "workbench"
#: Folders whose packages are imported by their own names.
SOURCE_ROOTS = (PLUGINS, WORKBENCH)
SHELVES = (ROOT / "lupin_engine", ROOT / "lupin_ros", *SOURCE_ROOTS)

#: Room -> the rooms right below it. A room may import these and all that they may; the rest is forbidden.
RULE = {
    "lupin_engine.errors": (),
    "lupin_engine.moved": (),
    "lupin_engine.plugin": ("lupin_engine.errors",),
    "lupin_engine.chart": ("lupin_engine.plugin",),
    "lupin_engine.bindings": ("lupin_engine.chart",),
    "lupin_engine.missions": ("lupin_engine.bindings",),
    "lupin_engine.machine": ("lupin_engine.chart",),
    "lupin_engine.runtime": ("lupin_engine.machine",),
    "lupin_engine.properties": ("lupin_engine.machine",),
    "lupin_engine.sim": ("lupin_engine.runtime", "lupin_engine.missions", "lupin_engine.properties"),
    "lupin_engine.replay": ("lupin_engine.sim",),
    "lupin_engine.diagram": ("lupin_engine.chart",),
    "lupin_engine.api": ("lupin_engine.sim",),
    "lupin_engine.pytest_plugin": ("lupin_engine.replay",),
    "lupin_ros.adapter": ("lupin_engine.plugin",),
    "lupin_ros.interfaces": ("lupin_engine.plugin",),
    "lupin_ros.service": ("lupin_ros.interfaces", "lupin_engine.sim", "lupin_engine.diagram"),
    "lupin_ros.recording": ("lupin_ros.service", "lupin_ros.adapter"),
    "lupin_ros.orchestrator": ("lupin_ros.service", "lupin_ros.adapter"),
    "lupin_ros.launch": ("lupin_ros.service", "lupin_ros.adapter"),
    "lupin_harness": ("lupin_ros.launch",),
    "lupin_verify": ("lupin_engine.replay",),
    "lupin_scxml": ("lupin_engine.missions", "lupin_engine.diagram"),
    "lupin_lsp": ("lupin_verify",),
    "lupin_cli": (
        "lupin_engine.replay",
        "lupin_engine.diagram",
        "lupin_ros.orchestrator",
        "lupin_ros.recording",
        "lupin_ros.launch",
        "lupin_harness",
        "lupin_scxml",
        "lupin_verify",
        "lupin_lsp",
    ),
}
#: Outside packages that belong to certain rooms only.
OWNED = {
    "rclpy": {"lupin_ros.adapter", "lupin_ros.orchestrator"},
    "transitions": {"lupin_engine.machine"},
    "click": {"lupin_cli"},
    "rich": {"lupin_cli"},
    "yaml": {"lupin_engine.chart", "lupin_cli"},
    "pygls": {"lupin_lsp"},
    "lsprotocol": {"lupin_lsp"},
    "resvg_py": {"lupin_engine.diagram"},
    "mcap": {"lupin_ros.recording"},
    "mcap_ros2": {"lupin_ros.recording"},
    "structlog": {"lupin_ros.adapter", "lupin_ros.launch", "lupin_cli"},
}
#: Pages of names for people outside.
FOR_OTHERS = ("contract.md", "plugins.md", "python.md")
#: Rooms that depend on nothing but their inputs.
PURE = ("lupin_engine.chart", "lupin_engine.machine")
#: What would make a chart or a machine depend on more than its inputs.
IMPURE = {"asyncio", "datetime", "logging", "multiprocessing", "os", "queue", "random", "secrets", "socket"}
IMPURE |= {"subprocess", "sys", "threading", "time", "uuid"}
#: The plugin that the others may know: the words that they share.
PROFILE = "lupin_greenhouse"
#: What the modules of a plugin that know ROS may know beside the contract.
ON_ROS = {"lupin_ros.adapter"}
#: And some of them more: the calibration is a chart of its own, pages show the service.
KNOWN = {
    "lupin_arm": {f"lupin_engine.{room}" for room in ("chart", "missions", "machine", "runtime")},
    "lupin_gateway": {"lupin_ros.service"},
}
#: Modules of a plugin that may know ROS.
ROS_SIDE = ("client", "node")


def module_name(file: Path) -> str:
    """Return what Python calls a file."""
    base = next((root for root in SOURCE_ROOTS if root in file.parents), ROOT)
    return ".".join(file.relative_to(base).with_suffix("").parts).removesuffix(".__init__")


@cache
def modules() -> dict[str, Path]:
    """Return every module of the shelves and the plugins."""
    files = sorted(file for shelf in SHELVES for file in shelf.rglob("*.py"))
    return {module_name(file): file for file in files if "__pycache__" not in file.parts}


@cache
def packages() -> frozenset[str]:
    """Return the packages of the shelves and the plugins."""
    return frozenset(name for name in modules() if "." not in name)


@cache
def nodes(name: str) -> list[ast.AST]:
    """Return all nodes of a module's source."""
    return list(ast.walk(ast.parse(modules()[name].read_text(encoding="utf-8"))))


@cache
def imports(name: str) -> dict[str, int]:
    """Return what a module imports, as full module names, with the line; `from a import b` as `a.b` too."""
    found: dict[str, int] = {}
    for node in nodes(name):
        if isinstance(node, ast.Import):
            found.update({alias.name: node.lineno for alias in node.names})
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}:{node.lineno}: relative import"
            source = node.module or ""
            found[source] = node.lineno
            names = (f"{source}.{alias.name}" for alias in node.names)
            meant = (faces().get(full, full) for full in names)
            found.update({full: node.lineno for full in meant if full in modules()})
    return found


@cache
def faces() -> dict[str, str]:
    """Return the names that the faces of rooms and packages export, in full, each with its module."""
    found: dict[str, str] = {}
    for face, file in modules().items():
        stub = file.with_suffix(".pyi")
        if file.name != "__init__.py" or not stub.is_file():
            continue
        for node in ast.parse(stub.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom):
                source = f"{face}.{node.module}" if node.module else face
                module = {
                    alias.name: source if node.module else f"{face}.{alias.name}" for alias in node.names
                }
                found.update({f"{face}.{name}": where for name, where in module.items()})
            elif isinstance(node, ast.AnnAssign):
                found[f"{face}.{ast.unparse(node.target)}"] = face
    return found


def crossings(name: str) -> Iterator[tuple[str, int]]:
    """Yield what a module imports from other packages of the shelves, name by name, with the line."""
    others = packages() - {name.partition(".")[0]}
    for node in nodes(name):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in others:
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)
        elif isinstance(node, ast.Import):
            names = (alias.name for alias in node.names if "." in alias.name)
            yield from ((full, node.lineno) for full in names if full.partition(".")[0] in others)


def advice(full: str) -> str:
    """Say what to write in place of an import past a face."""
    name = full.rpartition(".")[2]
    there = [
        face for face, where in faces().items() if face.endswith(f".{name}") and full == f"{where}.{name}"
    ]
    if there:
        return f"import it from {there[0].rpartition('.')[0]}"
    return f"add it to the __init__.pyi of {room_of(full) or full.partition('.')[0]}, or do without"


def room_of(module: str) -> str:
    """Return the room of a module, the innermost one; '' for what is in none, such as a plugin."""
    rooms = (room for room in RULE if f"{module}.".startswith(f"{room}."))
    return max(rooms, key=len, default="")


@cache
def allowed(room: str) -> frozenset[str]:
    """Return the rooms that a room may import."""
    below = [allowed(lower) | {lower} for lower in RULE[room]]
    return frozenset({room}).union(*below)


def engine_modules() -> list[str]:
    """Return the modules that no plugin has, but for the packages that hold rooms."""
    shelves = {path.name for path in SHELVES}
    return [name for name, file in modules().items() if PLUGINS not in file.parents and name not in shelves]


def plugin_modules() -> list[str]:
    """Return the modules of the plugins."""
    return [name for name, file in modules().items() if PLUGINS in file.parents]


def breaches(name: str) -> Iterator[str]:
    """Yield what a module of a shelf imports against the rule."""
    room = room_of(name)
    plugins = {path.name for path in PLUGINS.iterdir() if path.is_dir()}
    for imported, line in imports(name).items():
        where = f"{name}:{line} imports {imported}"
        top = imported.partition(".")[0]
        if room_of(imported) and room_of(imported) not in allowed(room):
            yield f"{where}: {room} may not know {room_of(imported)}"
        if top in plugins:
            yield f"{where}: the engine names no plugin"
        if room not in OWNED.get(top, {room}):
            yield f"{where}: that is for {', '.join(sorted(OWNED[top]))}"
        if room in PURE and top in IMPURE:
            yield f"{where}: {room} depends on nothing but its inputs"


def test_the_engine_keeps_the_rule() -> None:
    """A room imports only what lies below it."""
    assert [name for name in engine_modules() if room_of(name) not in RULE] == []
    assert [breach for name in engine_modules() for breach in breaches(name)] == []


def test_between_packages_only_faces_are_imported() -> None:
    """A face is the `__init__` of a room of the engine, or of a package; `errors` is one as it is."""
    free = {"lupin_engine.__version__"}
    strangers = [
        f"{name}:{line} imports {full} past a face: {advice(full)}"
        for name in modules()
        for full, line in crossings(name)
        if full not in faces() and full not in free and not full.startswith("lupin_engine.errors.")
    ]
    assert strangers == []


def test_a_face_exports_what_others_use() -> None:
    """Other packages, authors of plugins by the page of the contract, and users by that of Python."""
    used = {full for name in modules() for full, _ in crossings(name)}
    hidden = {full: where for full, where in faces().items() if full in modules() and full != where}
    assert hidden == {}, "a module of that name would hide what the face exports"
    pages = "".join((ROOT / "docs" / page).read_text(encoding="utf-8") for page in FOR_OTHERS)
    unused = sorted(set(faces()) - used)
    alone = [full for full in unused if full.rpartition(".")[2] not in pages]
    assert alone == [], "nobody outside imports these: take them out of the __init__.pyi"


def plugin_breaches(name: str) -> Iterator[str]:
    """Yield what a module of a plugin imports against the rule."""
    own, _, rest = name.partition(".")
    knows_ros = rest.split(".")[0] in ROS_SIDE
    rooms = allowed("lupin_engine.plugin") | (
        KNOWN.get(own, set()) | {"lupin_ros.adapter"} if knows_ros else set()
    )
    for imported, line in imports(name).items():
        where = f"{name}:{line} imports {imported}"
        top = imported.partition(".")[0]
        if room_of(imported) and room_of(imported) not in rooms:
            yield f"{where}: a plugin may know {', '.join(sorted(rooms))} there"
        if top not in (own, PROFILE) and (PLUGINS / top).is_dir():
            yield f"{where}: plugins do not know each other"
        if top == "rclpy" and not knows_ros:
            yield f"{where}: only {' and '.join(ROS_SIDE)} may"


def test_plugins_keep_the_rule() -> None:
    """A plugin knows the contract and nobody else; its client and node know ROS too."""
    assert [breach for name in plugin_modules() for breach in plugin_breaches(name)] == []


def circle(graph: Mapping[str, set[str]]) -> list[str]:
    """Return a way from a module back to itself; none where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as found:
        return [str(name) for name in found.args[1]]
    return []


def all_imports() -> dict[str, set[str]]:
    """Return what each module imports of the engine and its plugins, packages left out."""
    packages = {name for name, file in modules().items() if file.name == "__init__.py"}
    return {name: set(imports(name)) & set(modules()) - {name} - packages for name in modules()}


def test_modules_do_not_go_in_circles() -> None:
    """No module imports itself by way of others, not for its types either."""
    assert circle(all_imports()) == []


def test_a_circle_of_types_is_one() -> None:
    """`cli.terminal.tables` imports `ros.adapter.network` for the type checker only."""
    user, used = "lupin_cli.terminal.tables", "lupin_ros.adapter.network"
    graph = all_imports()
    assert set(circle({**graph, used: graph[used] | {user}})) == {user, used}


def constants(name: str) -> set[str]:
    """Return the texts of a module, docstrings left out."""
    found = (node.value for node in nodes(name) if isinstance(node, ast.Constant))
    texts = {value for value in found if isinstance(value, str)}
    return texts - {ast.get_docstring(node, clean=False) for node in nodes(name) if _has_docstring(node)}


def test_the_engine_names_no_plugin() -> None:
    """No module of the engine holds the name of a plugin's package, not even as text."""
    plugins = [path.name for path in PLUGINS.iterdir() if path.is_dir()]
    texts = {(name, text) for name in engine_modules() for text in constants(name)}
    assert [(name, text) for name, text in texts if any(plugin in text for plugin in plugins)] == []


def _has_docstring(node: ast.AST) -> bool:
    return isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
