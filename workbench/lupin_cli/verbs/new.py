"""`lupin new`: writes a new mission, with its lifecycle and a scenario.

Files that exist are left as they are; an existing mission is an error.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import click

from lupin_cli.files import nearest_name, title_of, write_text
from lupin_engine.errors import Problems, UsageError, shortened
from lupin_engine.plugin import NAME, PROFILES, entry_points, load_catalog, source_file
from lupin_engine.sim import SUFFIX

MISSION = """\
mission: {title}
summary: Wait a little and come home.
properties:                                # what lupin prove shows of every run
  {name}_prepares: {{never: in_state('WORKING'), until: in_state('PREPARE')}}
  {name}_works: {{visit_all: [in_state('PREPARE'), in_state('WORKING')]}}
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

#: The longest name of a mission or a profile.
MAX_NAME = 60

LIFECYCLE = """\
lifecycle: my-robot
extends: {name}
# Write only what differs here; lupin check --expand prints the whole. For example:
# params: {{PARAMETER: {{default: 90 s}}}}             # one key of one parameter, and all others stay
# states: {{STATE: {{on: {{EVENT: OTHER_STATE}}}}}}      # one transition, or a state of your own
"""

#: The scenario of a mission that is copied from another one.
SCENARIO_LIKE = """\
scenario: the mission runs to its end
mission: {name}
expect:
  never: [FAULT]
"""

#: What `--profile` writes beside the mission and its scenario: a package with the profile, and a lifecycle.
PROFILE_TEMPLATE = Path(__file__).parents[1] / "profile_template"
PROFILE_FILES = {
    "lupin-%name%/pyproject.toml": "pyproject.toml.txt",
    "lupin-%name%/lupin_%name%/__init__.py": "package/__init__.py.txt",
    "lupin-%name%/lupin_%name%/profile.py": "package/profile.py.txt",
    "lupin-%name%/lupin_%name%/messages.py": "package/messages.py.txt",
    "missions/lifecycle.yaml": "lifecycle.yaml.txt",
    "missions/%mission%.yaml": "mission.yaml.txt",
    "scenarios/%mission%.scenario.yaml": "scenario.yaml.txt",
}


@click.command(short_help="Begin a mission: its file, the lifecycle around it, a scenario.")
@click.argument("name")
@click.option("--like", metavar="MISSION", help="Begin with a copy of this mission, and the parts it uses.")
@click.option("--copy", is_flag=True, help="Write the whole lifecycle: a copy, which ages.")
@click.option(
    "--profile", metavar="KIND", help="Begin a kind of robot too: its words, messages and lifecycle."
)
def new(name: str, like: str | None, copy: bool, profile: str | None) -> int:
    """Begin a mission: its file, the lifecycle around it, a scenario.

    NAME is that of the file, such as water_beds. In the current folder this writes
    missions/NAME.yaml and scenarios/NAME.scenario.yaml. Where there is no missions/lifecycle.yaml it writes
    one that extends the shipped one, which is written for the profile that it names; with --copy it copies
    that, and the copy says of which version it is. An existing mission is an error; other existing files are
    left as they are.

    With --profile, the lifecycle is one of your own, for another kind of robot: the package lupin-KIND has
    its outcomes, requests and messages. Then no file that is written may exist.

    Example: lupin new my_inspection --like inspection
    """
    if profile is not None:
        if like is not None or copy:
            raise UsageError("--profile excludes --like and --copy: it comes with a lifecycle of its own")
        for file in write_profile(name, profile, Path()):
            click.echo(f"wrote {file}")
        click.echo(f"next: pip install --editable lupin-{profile}; lupin check; lupin test; lupin run {name}")
        return 0
    written, kept = write_mission(name, like, Path(), copy=copy)
    for file in written:
        click.echo(f"wrote {file}")
    for file in kept:
        click.echo(f"kept  {file}")
    click.echo(f"next: lupin check missions; lupin simulate {name}; lupin test; lupin prove {name}")
    return 0


def write_mission(
    name: str,
    like: str | None,
    folder: Path,
    text: str | None = None,
    binding: str = "",
    *,
    copy: bool = False,
) -> tuple[list[Path], list[Path]]:
    """Write the files of a mission below `folder`; a given `text` is the mission, without a scenario.

    A `binding` is written beside it under the same name. The shipped lifecycle is extended, or on request
    copied.

    Returns:
        The files that were written, and those that existed already.

    Raises:
        UsageError: the name cannot be one, the mission exists, or there is none to be `like`.
    """
    from lupin_engine.bindings import BINDINGS, LUPIN_FILE
    from lupin_engine.missions import LOCAL, folders

    missions = folder / LOCAL
    scenario = folder / "scenarios" / f"{name}{SUFFIX}"
    problems = Problems(UsageError)
    with problems.collecting():
        _check_name(name, (missions / f"{name}.yaml", *(() if text else (scenario,))))
    with problems.collecting():
        model = None if like is None else _model(like, folder)
    problems.raise_any()
    own = {
        missions / f"{name}.yaml": MISSION.format(title=title_of(name), name=name),
        scenario: (SCENARIO_LIKE if like else SCENARIO).format(name=name),
    }
    if text is not None:
        own = {missions / f"{name}.yaml": text}
    source = folders.default_missions_folder()
    lifecycle, others = source / folders.LIFECYCLE, list[str]()
    if model is not None:
        file, parts = model
        source, lifecycle = file.parent, folders.lifecycle_of(file)
        own[missions / f"{name}.yaml"] = _renamed(file.read_text(encoding="utf-8"), file.stem, name)
        others += parts
    shared = {
        missions / folders.LIFECYCLE: _lifecycle(lifecycle, copy=copy),
        **{missions / other: (source / other).read_text(encoding="utf-8") for other in others},
    }
    if binding:
        shared[missions / BINDINGS / f"{name}.yaml"] = binding
        shared[folder / LUPIN_FILE] = f"allow:\n  subscribe: /{name}/*\n"
    kept = [file for file in shared if file.exists()]
    written = {file: text for file, text in {**shared, **own}.items() if file not in kept}
    for file, text in written.items():
        write_text(file, text)
    return list(written), kept


def write_profile(name: str, profile: str, folder: Path) -> list[Path]:
    """Write a mission with a profile and a lifecycle of its own below `folder`, and return the files.

    Raises:
        UsageError: a name cannot be one, or is taken; a file exists. The text has all of that.
    """
    words = {"%name%": profile, "%mission%": name, "%Title%": title_of(name)}
    texts = {
        folder / _filled(file, words): _filled((PROFILE_TEMPLATE / source).read_text(encoding="utf-8"), words)
        for file, source in PROFILE_FILES.items()
    }
    problems = Problems(UsageError)
    with problems.collecting():
        _check_name(name, ())
    with problems.collecting():
        _check_profile(profile)
    problems.add(*(f"{str(file)!r} exists; begin in another folder" for file in texts if file.exists()))
    problems.raise_any()
    for file, text in texts.items():
        write_text(file, text)
    return list(texts)


def _filled(text: str, words: Mapping[str, str]) -> str:
    for placeholder, word in words.items():
        text = text.replace(placeholder, word)
    return text


def _check_profile(profile: str) -> None:
    """Check that a profile can have this name, and that none has it."""
    if not _is_name(profile):
        wanted = f"at most {MAX_NAME} lower-case letters, digits and underscores, such as courier"
        raise UsageError(
            f"{shortened(profile)!r} cannot be the name of a profile: write {wanted}{nearest_name(profile)}"
        )
    taken = {point.name: point for point in entry_points(PROFILES)}
    if profile in taken:
        whose = taken[profile].distribution
        raise UsageError(f"there is a profile {profile!r} already, from {whose}; choose another name")
    if source_file(f"lupin_{profile}") is not None:
        raise UsageError(f"there is a package lupin_{profile} already; choose another name for the profile")


def _lifecycle(file: Path, *, copy: bool) -> str:
    """Return the lifecycle of a new folder: one that extends a shipped one, or a copy of it or of another."""
    from lupin_engine.missions import folders
    from lupin_engine.replay import yaml_text

    text = file.read_text(encoding="utf-8")
    if file not in folders.shipped_lifecycles().values():
        return text
    origin = folders.origin_of(file)
    if not copy:
        return LIFECYCLE.format(name=origin["lifecycle"])
    first, line, rest = text.partition("\n")
    return first + line + yaml_text({"origin": origin}) + rest


def _is_name(name: str) -> bool:
    """Return whether files and keys can have a name: YAML reads it as text, and a file system takes it."""
    import yaml

    return bool(NAME.fullmatch(name)) and len(name) <= MAX_NAME and isinstance(yaml.safe_load(name), str)


def _check_name(name: str, files: Iterable[Path]) -> None:
    """Check the name of a mission, and that its files do not exist."""
    from lupin_engine.missions import folders

    if not _is_name(name) or name == Path(folders.LIFECYCLE).stem:
        wanted = f"at most {MAX_NAME} lower-case letters, digits and underscores, such as water_beds"
        raise UsageError(
            f"{shortened(name)!r} cannot be the name of a mission's file: write {wanted}{nearest_name(name)}"
        )
    for file in files:
        if file.exists():
            raise UsageError(f"{str(file)!r} exists; choose another name, or remove it")


def _model(like: str, folder: Path) -> tuple[Path, list[str]]:
    """Return the file of a mission, and the parts and missions that it uses, as named beside it."""
    from lupin_engine.missions import LOCAL, inspect_chart
    from lupin_engine.missions import folders as files

    local = folder / LOCAL
    folders = [local] if files.is_missions_folder(local) else []
    file = files.find_mission(like, [*folders, files.default_missions_folder()])
    documents = inspect_chart(files.lifecycle_of(file), [file], load_catalog()).documents
    own = (files.lifecycle_of(file), file)
    used = sorted(path.relative_to(file.parent) for path in documents if path not in own)
    return file, [path.as_posix() for path in used]


def _renamed(text: str, old: str, name: str) -> str:
    """Return a mission under another name, and its properties, of which no two missions have one name."""
    text = re.sub(r"^mission:.*", f"mission: {title_of(name)}", text, count=1, flags=re.MULTILINE)
    head, found, rest = text.partition("\nproperties:")
    block = re.match(r"(?:.*\n)(?:[ #].*\n|\n)*", rest)
    if not found or block is None:
        return text
    named = re.sub(rf"^  (?:{old}_)?(\w+:)", rf"  {name}_\1", block[0], flags=re.MULTILINE)
    return head + found + named + rest[block.end() :]
