"""What `lupin new` does."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import click

from lupin_engine.cli.files import nearest_name, title_of, write_text
from lupin_engine.errors import Problems, UsageError
from lupin_engine.missions.load import (
    LIFECYCLE,
    PARTS,
    default_missions_folder,
    find_mission,
    inspect_chart,
    is_missions_folder,
    lifecycle_of,
)
from lupin_engine.plugin.registry import NAME, load_catalog
from lupin_engine.ros.launch.mission import LOCAL
from lupin_engine.sim import SUFFIX

#: What a file's name may be: it is also how the mission is called on the command line.

MISSION = """\
mission: {title}
summary: Wait a little and come home.
initial: PREPARE
states:
  PREPARE:                                 # before the robot moves
    after: {{2 s: WORKING}}
  WORKING:                                 # what the robot does stands here
    after: {{5 s: done}}
  done: {{type: final}}                      # the end: the lifecycle takes the robot home
"""

SCENARIO = """\
scenario: the mission runs to its end
mission: {name}
expect:
  passes: [PREPARE, WORKING, done]         # in this order, others between them
  never: [FAULT]
"""

#: Of a mission that is like another one nothing else is known.
SCENARIO_LIKE = """\
scenario: the mission runs to its end
mission: {name}
expect:
  never: [FAULT]
"""


def work(name: str, like: str | None) -> int:
    """Do what the options of `lupin new` say, and return the exit code."""
    written, kept = write_mission(name, like, Path())
    for file in written:
        click.echo(f"wrote {file}")
    for file in kept:
        click.echo(f"kept  {file}")
    click.echo(f"next: lupin check missions; lupin simulate {name}; lupin test")
    return 0


def write_mission(name: str, like: str | None, folder: Path) -> tuple[list[Path], list[Path]]:
    """Write what a mission needs below `folder`.

    Returns:
        The files that were written, and those that stood there already.

    Raises:
        UsageError: the name cannot be one, the mission exists, or there is none to be `like`.
    """
    missions = folder / LOCAL
    scenario = folder / "scenarios" / f"{name}{SUFFIX}"
    problems = Problems(UsageError)
    with problems.collecting():
        _check_name(name, (missions / f"{name}.yaml", scenario))
    with problems.collecting():
        model = None if like is None else _model(like, folder)
    problems.tell()
    own = {
        missions / f"{name}.yaml": MISSION.format(title=title_of(name)),
        scenario: (SCENARIO_LIKE if like else SCENARIO).format(name=name),
    }
    source = default_missions_folder()
    lifecycle, others = source / LIFECYCLE, list[str]()
    if model is not None:
        file, parts = model
        source, lifecycle = file.parent, lifecycle_of(file)
        own[missions / f"{name}.yaml"] = _renamed(file.read_text(encoding="utf-8"), title_of(name))
        others += parts
    origins = {missions / LIFECYCLE: lifecycle, **{missions / other: source / other for other in others}}
    shared = {file: origin.read_text(encoding="utf-8") for file, origin in origins.items()}
    kept = [file for file in shared if file.exists()]
    written = {file: text for file, text in {**shared, **own}.items() if file not in kept}
    for file, text in written.items():
        write_text(file, text)
    return list(written), kept


def _check_name(name: str, files: Iterable[Path]) -> None:
    """Look whether a mission can be called so, and these files be its own."""
    if not NAME.fullmatch(name) or name == Path(LIFECYCLE).stem:
        wanted = "lower-case letters, digits and underscores, such as water_beds"
        raise UsageError(
            f"{name!r} cannot be the name of a mission's file: write {wanted}{nearest_name(name)}"
        )
    for file in files:
        if file.exists():
            raise UsageError(f"{str(file)!r} exists; choose another name, or remove it")


def _model(like: str, folder: Path) -> tuple[Path, list[str]]:
    """Return the file of a mission and its parts, as named beside it."""
    local = folder / LOCAL
    folders = [local] if is_missions_folder(local) else []
    file = find_mission(like, [*folders, default_missions_folder()])
    documents = inspect_chart(lifecycle_of(file), [file], load_catalog()).documents
    parts = sorted(path.name for path in documents if path.parent.name == PARTS)
    return file, [f"{PARTS}/{part}" for part in parts]


def _renamed(text: str, title: str) -> str:
    return re.sub(r"^mission:.*", f"mission: {title}", text, count=1, flags=re.MULTILINE)
