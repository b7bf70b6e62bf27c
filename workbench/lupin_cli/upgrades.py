"""What `lupin upgrade` would change in a folder, so that no row of `chart.strictness` warns of its files.

Every edit is tried before it is offered: the missions are checked with it, and the scenarios are run.
"""

from __future__ import annotations

import codecs
import difflib
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lupin_cli.edits import PlacedEdit, edited, first_key, is_flow, key_after, list_edits, maps_in
from lupin_engine.chart import Chart, Findings, Map, as_of, parse_bytes
from lupin_engine.errors import ChartError, Diagnostic, LupinError, Place, Severity, UsageError, near
from lupin_engine.missions import (
    forget,
    inspect_chart,
    is_missions_folder,
    lifecycle_in,
    lifecycle_of,
    mission_files,
)
from lupin_engine.plugin import Catalog
from lupin_engine.sim import SUFFIX, Comparison, Missions, Scenario, load_scenario_text, rewritten

#: The action that closes the open visits of an itinerary.
_CLOSE = "itinerary.close_rest"
#: The code that a mission is closed with where it fails, and its declaration.
_FAILED = "mission_failed"
_DECLARED = f"{_FAILED}: {{label: mission failed, severity: error}}"
_NUMBER = re.compile(r"[-+.\w]+")
#: What a scenario's word for an outcome needs quotes for.
_SPECIAL = re.compile(r"[^\w .-]")


@dataclass
class FolderUpgrade:
    """The files of a folder: `before` as they are, `after` as they would be, by path.

    `rows` are the rows of `chart.strictness` that a file's changes are about, `left` the findings that a
    person must mend. `missions` and `scenarios` count the files that were looked at.
    """

    folder: Path
    before: dict[Path, bytes] = field(default_factory=dict)
    after: dict[Path, bytes] = field(default_factory=dict)
    rows: dict[Path, list[str]] = field(default_factory=dict)
    left: list[Diagnostic] = field(default_factory=list)
    missions: int = 0
    scenarios: int = 0

    @property
    def changed(self) -> list[Path]:
        """The files that would change, by name."""
        return sorted(path for path, raw in self.after.items() if raw != self.before[path])

    def shown(self, path: Path) -> str:
        """Return a file's name, relative to the current folder where it lies below it."""
        return near(str(path))

    def diff(self, path: Path) -> str:
        """Return a file's change as a unified diff."""
        old, new = (raw[path].decode().splitlines(keepends=True) for raw in (self.before, self.after))
        name = self.shown(path)
        lines = difflib.unified_diff(old, new, f"{name} (now)", f"{name} (upgraded)")
        return "".join(
            line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines
        )

    def now(self, path: Path) -> bytes:
        """Return a file as it would be now."""
        if path not in self.before:
            self.before[path] = path.read_bytes()
        return self.after.get(path, self.before[path])

    def change(self, path: Path, raw: bytes, rows: list[str]) -> None:
        """Let a file become `raw`."""
        self.after[path] = raw
        self.rows.setdefault(path, []).extend(rows)


def upgrade_folder(folder: Path, catalog: Catalog) -> FolderUpgrade:
    """Find the changes for a folder, also for files that this engine refuses by now.

    Raises:
        UsageError: it is no folder, or has no missions and no scenarios.
    """
    if not folder.is_dir():
        raise UsageError(f"{str(folder)!r} is no folder")
    found = FolderUpgrade(Path(os.path.abspath(folder)))
    below = dict(_walk(found.folder))
    folders = [path for path in sorted(below) if is_missions_folder(path)]
    scenarios = sorted(
        path / name for path, names in below.items() for name in names if name.endswith(SUFFIX)
    )
    if not folders and not scenarios and mission_files(found.folder):
        folders = [found.folder]  # one of missions, whatever it is called
    if not folders and not scenarios:
        raise UsageError(f"there are no missions and no scenarios in {str(folder)!r}")
    forget()
    with as_of(""):
        for each in folders:
            _MissionsUpgrade(found, each, catalog).upgrade()
        for file in scenarios:
            _ScenarioUpgrade(found, file, catalog).upgrade()
    forget()
    found.left = sorted(dict.fromkeys(found.left), key=lambda one: (one.place, one.rule, one.problem))
    return found


def _walk(folder: Path) -> Iterator[tuple[Path, list[str]]]:
    """Yield a folder and those in it, each with the names of its files; hidden ones are left out."""
    for path, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".") and name != "node_modules"]
        yield Path(path), names


class _MissionsUpgrade:
    """The missions of a folder, with their lifecycle, parts and bindings."""

    def __init__(self, upgrade: FolderUpgrade, folder: Path, catalog: Catalog) -> None:
        self._upgrade, self._catalog = upgrade, catalog
        self._files = mission_files(folder)
        self._lifecycle = lifecycle_in(folder)
        upgrade.missions += len(self._files)

    def upgrade(self) -> None:
        """Mend all that can be mended; a person mends the rest."""
        found = self._found({})
        edits: dict[Path, list[PlacedEdit]] = {}
        rows: dict[Path, list[str]] = {}
        for one in found:
            path, mend = Path(one.place.file), _MENDS.get(one.stricter)
            raw = _parsed(self._upgrade.now(path), path) if mend else None
            made = mend(raw, one, self._catalog) if mend and raw is not None else []
            if made:
                edits.setdefault(path, []).extend(made)
                rows.setdefault(path, []).append(one.stricter)
        texts = {path: _with(self._upgrade.now(path), each) for path, each in edits.items()}
        whole = {path: raw for path, raw in texts.items() if raw is not None}
        left = self._found(whole)
        if _errors(left) > _errors(found):
            whole, left = {}, found
        for path, text in whole.items():
            self._upgrade.change(path, text, rows[path])
        self._upgrade.left += [one for one in left if one.stricter or one.severity is Severity.ERROR]

    def _found(self, texts: Mapping[Path, bytes]) -> list[Diagnostic]:
        """Return the findings in files of the folder, with some of them as `texts` say."""
        if not self._files and not self._lifecycle.is_relative_to(self._upgrade.folder):
            return []
        found = inspect_chart(self._lifecycle, self._files, self._catalog, texts).found
        return [one for one in found if Path(one.place.file).is_relative_to(self._upgrade.folder)]


class _ScenarioUpgrade:
    """One scenario, and the mission that it is about."""

    def __init__(self, upgrade: FolderUpgrade, file: Path, catalog: Catalog) -> None:
        self._upgrade, self._file = upgrade, file
        self._missions = _EditedMissions(catalog, upgrade.after)
        self._catalog = catalog
        upgrade.scenarios += 1

    def upgrade(self) -> None:
        """Mend its words, then the outcomes that it expects."""
        try:
            self._words()
            self._outcomes()
        except ChartError as problem:
            self._upgrade.left += [one for one in problem.diagnostics if one.place.file == str(self._file)]
        except (LupinError, OSError) as problem:
            self._upgrade.left.append(Diagnostic(Place(str(self._file), 1, 1), "no-file", "", str(problem)))

    def _loaded(self, raw: bytes) -> Scenario:
        return load_scenario_text(raw.decode("utf-8-sig"), self._file, self._missions)

    def _words(self) -> None:
        raw, findings = self._upgrade.now(self._file), Findings()
        if parse_bytes(raw, str(self._file), findings) is None:
            raise ChartError(findings.all)
        warnings = [one for one in self._loaded(raw).warnings if one.stricter]
        parsed = _parsed(raw, self._file)
        edits = []
        for one in warnings:
            mend = _MENDS.get(one.stricter)
            made = mend(parsed, one, self._catalog) if mend and parsed is not None else []
            edits += made
            if not made:
                self._upgrade.left.append(one)
        changed = _with(raw, edits)
        if edits and changed is not None:
            self._loaded(changed)
            self._upgrade.change(self._file, changed, [one.stricter for one in warnings])

    def _outcomes(self) -> None:
        """Write the outcomes that there are, where those that are expected were all there was once."""
        raw = self._upgrade.now(self._file)
        was = _ComparedRun(load_scenario_text(raw.decode("utf-8-sig"), self._file, Missions(self._catalog)))
        scenario = self._loaded(raw)
        compared = _ComparedRun(scenario)
        if was.fails or not (compared.dated or compared.fails):
            return
        parsed, changed = _parsed(raw, self._file), None
        if parsed is not None and isinstance(parsed.get("expect"), Map):
            changed = _with(raw, _outcome_edits(parsed["expect"], scenario, compared))
        if changed is not None:
            again = _ComparedRun(self._loaded(changed))
            if not again.fails and not again.dated:
                self._upgrade.change(self._file, changed, ["early-outcomes"])
                return
        self._upgrade.left += compared.dated or was.dated or [self._broken(scenario)]

    def _broken(self, scenario: Scenario) -> Diagnostic:
        problem = "this expects something else of the upgraded missions than there is"
        hint = "see what 'lupin test' says after 'lupin upgrade --write'"
        place = scenario.node.at("expect")
        return Diagnostic(place, "wrong-type", "expect", problem, hint, Severity.WARN, "early-outcomes")


class _ComparedRun:
    """A scenario's run: whether it fails, and what holds of it only as an older engine meant it."""

    def __init__(self, scenario: Scenario) -> None:
        self.run = scenario.run()
        comparison = Comparison(scenario.node, self.run)
        self.fails = bool(list(comparison.failures()))
        self.dated = comparison.dated


class _EditedMissions(Missions):
    """Missions whose files are as an upgrade would leave them."""

    def __init__(self, catalog: Catalog, texts: Mapping[Path, bytes]) -> None:
        super().__init__(catalog)
        self._texts = texts

    def chart(self, mission: Path) -> Chart:
        """Return the chart of a mission file with its lifecycle; ChartError with all that is wrong."""
        path = Path(os.path.abspath(mission))
        inspection = inspect_chart(lifecycle_of(path), [path], self.catalog, self._texts, reaching=False)
        if inspection.chart is None:
            raise ChartError(one for one in inspection.found if one.severity is Severity.ERROR)
        return inspection.chart


def _outcome_edits(expect: Map, scenario: Scenario, compared: _ComparedRun) -> Iterator[PlacedEdit]:
    published = [publish for _, publish in compared.run.history.published]
    for word, actual in (("visits", compared.run.visits), ("published", published)):
        expected = getattr(scenario.node.expect, word)
        items = rewritten(expected or (), actual)
        if expected is not None and items != list(range(len(expected))):
            quoted = [f'"{one}"' if isinstance(one, str) and _SPECIAL.search(one) else one for one in items]
            yield from list_edits(expect, word, quoted)


# -- what mends a row ---------------------------------------------------------------------------------------


def _add_unit(raw: Map, found: Diagnostic, _: Catalog) -> list[PlacedEdit]:
    """Write the unit behind a number."""
    unit = re.match(r"write '\S+ (\S+)'", found.hint)
    number = _token(raw, found.place)
    return [_replaced(found.place, number, f"{number} {unit[1]}")] if unit and number else []


def _add_on_error(raw: Map, found: Diagnostic, _: Catalog) -> list[PlacedEdit]:
    """Say that nothing follows when an operation in FAULT has failed."""
    for holder in maps_in(raw):
        if "invoke" in holder and holder.value_place("invoke") == found.place:
            return [key_after(holder, "invoke", "on_error: {}")]
    return []


def _close_in_fault(raw: Map, _: Diagnostic, __: Catalog) -> list[PlacedEdit]:
    """Close the targets that are left in the entry of FAULT, as the lifecycle does elsewhere."""
    states = raw.get("states")
    fault = states.get("FAULT") if isinstance(states, Map) else None
    closes = [one[_CLOSE] for one in maps_in(raw) if isinstance(one.get(_CLOSE), Map)]
    status = next((one["status"] for one in closes if "status" in one), None)
    if not isinstance(fault, Map) or not fault or "entry" in fault or status is None:
        return []
    action = f"{_CLOSE}: {{status: {status}, code: {_FAILED}}}"
    edits = [first_key(fault, f"entry: [{action}]" if is_flow(fault) else f"entry:\n  - {action}")]
    codes = raw.get("codes")
    if not isinstance(codes, Map) or not codes:
        return [*edits, first_key(raw, f"codes: {{{_DECLARED}}}")] if codes is None else []
    if _FAILED not in codes:
        edits.append(key_after(codes, list(codes)[-1], _DECLARED))
    return edits


def _rename_property(raw: Map, found: Diagnostic, _: Catalog) -> list[PlacedEdit]:
    """Give a property the name that it has already."""
    name = _token(raw, found.place)
    return [_replaced(found.place, name, f"my_{name}")] if name else []


_MENDS: Mapping[str, Callable[[Map, Diagnostic, Catalog], list[PlacedEdit]]] = {
    "bare-quantity": _add_unit,
    "bare-setting": _add_unit,
    "wait-in-fault": _add_on_error,
    "silent-fault": _close_in_fault,
    "property-name": _rename_property,
}


def _token(raw: Map, place: Place) -> str:
    found = _NUMBER.match(raw.file.lines[place.line - 1], place.column - 1)
    return found[0] if found else ""


def _replaced(place: Place, old: str, new: str) -> PlacedEdit:
    return PlacedEdit(place.line - 1, place.column - 1, old, new)


def _parsed(raw: bytes, path: Path) -> Map | None:
    return parse_bytes(raw, str(path), Findings())


def _with(raw: bytes, edits: Any) -> bytes | None:
    mark = codecs.BOM_UTF8 if raw.startswith(codecs.BOM_UTF8) else b""
    text = edited(raw.decode("utf-8-sig"), edits)
    return None if text is None else mark + text.encode()


def _errors(found: list[Diagnostic]) -> int:
    return sum(one.severity is Severity.ERROR for one in found)
