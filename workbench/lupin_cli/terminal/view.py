"""Renders a run: pure functions from a monitor and a chart to pictures, tables and lines.

`picture` is the live view, `results_table` and `summary` its end, `plain_state` the line that stands for a
change where there is no terminal. Symbols are plain ASCII where the terminal cannot show others.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from rich.box import ROUNDED, SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from lupin_cli.terminal.words import clock as clock
from lupin_cli.terminal.words import default_text
from lupin_engine.chart import Chart, Kind
from lupin_engine.errors import Severity
from lupin_engine.plugin import Profile, Progress, Rating, TargetOutcome, TargetResult
from lupin_ros.launch import ALL_VISITED, NOT_DONE, SOME_MISSED, RunEvent, RunMonitor, RunningOperation

STYLES: Mapping[Severity, str] = {
    Severity.INFO: "cyan",
    Severity.WARN: "yellow",
    Severity.ERROR: "bold red",
}
_VERDICT_STYLES: Mapping[int, str] = {
    ALL_VISITED: "bold green",
    SOME_MISSED: "bold yellow",
    NOT_DONE: "bold red",
}
RATING_STYLES: Mapping[Rating, str] = {Rating.GOOD: "green", Rating.BAD: "red", Rating.LEFT_OUT: "yellow"}

#: Events that the live view shows.
SHOWN_EVENTS = 6
#: Width of the state tree, and of bars, in cells.
TREE_WIDTH, BAR_WIDTH = 28, 24
#: Cells of a line of the picture's frame that belong to the frame itself.
FRAME = 6


@dataclass(frozen=True)
class Symbols:
    """Marks of the state tree and of counters."""

    active: str
    path: str
    idle: str
    ok: str
    missed: str
    left_out: str
    dot: str
    more: str
    degree: str


UNICODE = Symbols(
    active="●", path="▾", idle="○", ok="✔", missed="✘", left_out="↷", dot="·", more="…", degree="°"
)
ASCII = Symbols(
    active="*", path="v", idle="o", ok="+", missed="x", left_out=">", dot="-", more="...", degree=""
)


@dataclass(frozen=True)
class TreeLine:
    """A state in the tree: how deep, its name, and `active` (it is a leaf), `path` (above one) or `idle`."""

    depth: int
    name: str
    role: str


def tree_lines(chart: Chart, configuration: Sequence[str]) -> list[TreeLine]:
    """Return the states to show: the outer ones always, the inner ones only where the chart is active."""
    active = set(configuration)
    return list(_lines_below("", 0, chart, active))


def _lines_below(parent: str, depth: int, chart: Chart, active: set[str]) -> Iterator[TreeLine]:
    for name in chart.states[parent].children:
        state = chart.states[name]
        if state.kind is Kind.HISTORY or (state.kind is Kind.FINAL and name not in active):
            continue  # helpers: nobody waits in them
        if state.slot:
            yield from _lines_below(name, depth, chart, active)
            continue
        yield TreeLine(depth, state.local_name, _role(name, chart, active))
        if name in active or chart.states[state.parent or ""].slot:
            yield from _lines_below(name, depth + 1, chart, active)


def _role(name: str, chart: Chart, active: set[str]) -> str:
    if name not in active:
        return "idle"
    return "path" if any(child in active for child in chart.states[name].children) else "active"


def picture(monitor: RunMonitor, chart: Chart, now: float) -> RenderableType:
    """Return the live view at `now` (seconds of the monotonic clock)."""
    return _Fitting(monitor, chart, now)


class _Fitting:
    """The live view, in the symbols that the console can show."""

    def __init__(self, monitor: RunMonitor, chart: Chart, now: float) -> None:
        self._story, self._chart, self._now = monitor, chart, now

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        symbols = ASCII if options.ascii_only else UNICODE
        monitor = self._story
        body = Table.grid(padding=(0, 2), expand=True)
        body.add_column(width=TREE_WIDTH)
        body.add_column(ratio=1)
        body.add_row(_tree(self._chart, monitor, symbols), _details(monitor, self._now, symbols))
        yield Panel(
            Group(body, Text(), *_events(monitor.happenings)),
            title=_title(monitor, self._now, symbols),
            title_align="left",
            subtitle=_strip(monitor, symbols, options.max_width - FRAME),
            subtitle_align="left",
            border_style=_border(monitor),
            box=ROUNDED,
        )


def _title(monitor: RunMonitor, now: float, symbols: Symbols) -> Text:
    mission = monitor.progress.mission or "mission"
    phase = f" {symbols.dot} ".join(filter(None, (monitor.lifecycle, monitor.progress.phase)))
    title = Text.assemble((mission, "bold"), (f" {monitor.mission_id}", "dim"), "  ", (phase, "bold green"))
    title.append(f"  {clock(monitor.elapsed(now))}", "dim")
    for name, style in pills(monitor):
        title.append("  ")
        title.append(f" {name} ", style)
    return title


def pills(monitor: RunMonitor) -> list[tuple[str, str]]:
    """Return the flags that are up, each with its style."""
    up = [flag for name, flag in monitor.profile.terminal.flags.items() if monitor.progress.flags.get(name)]
    return [(flag.pill, "bold white on red" if flag.alarm else "black on yellow") for flag in up]


def _border(monitor: RunMonitor) -> str:
    flags = monitor.profile.terminal.flags
    if monitor.faulted or any(flags[name].alarm for name, up in monitor.progress.flags.items() if up):
        return "red"
    return "yellow" if monitor.waits else "green"


def _tree(chart: Chart, monitor: RunMonitor, symbols: Symbols) -> RenderableType:
    marks = {
        "active": (symbols.active, "bold green"),
        "path": (symbols.path, "green"),
        "idle": (symbols.idle, "dim"),
    }
    lines = []
    for line in tree_lines(chart, monitor.view.get("configuration", ())):
        mark, style = marks[line.role]
        text = f"{'  ' * line.depth}{mark} {line.name}"
        lines.append(Text(text, style=style, no_wrap=True, overflow="crop"))
    return Group(*lines)


def _details(monitor: RunMonitor, now: float, symbols: Symbols) -> RenderableType:
    grid = Table.grid(padding=(0, 1), expand=True)
    grid.add_column(style="dim", width=10)
    grid.add_column(ratio=1)
    grid.add_row("target", _target(monitor))
    grid.add_row("progress", _progress(monitor))
    grid.add_row("", _counts(monitor, symbols))
    # This row is there even when it is empty, so that the picture does not jump.
    waits = f"for {_resume(monitor.profile)}, or Ctrl-C" if monitor.waits else ""
    grid.add_row("waits" if waits else "", Text(waits, "yellow"))
    numbers = itertools.count(1)
    for asked in monitor.asking(now):
        grid.add_row("asks", Text(asked.question, "bold yellow"))
        for name, label in asked.choices:
            grid.add_row("", Text(f"{next(numbers)}, or lupin answer {name}: {label}"))
        grid.add_row("", Text(default_text(asked), "dim"))
    under_way: list[RunningOperation | None] = [*monitor.running(now)]
    for running in under_way or [None]:
        grid.add_row("operation", _operation(running))
        grid.add_row("", _deadline(running))
        grid.add_row("", Text(running.detail if running else "", "dim", no_wrap=True, overflow="crop"))
    for name, low in monitor.profile.terminal.gauges.items():
        share = monitor.progress.gauges.get(name, 0.0)
        style = "red" if monitor.progress.flags.get(low) else "green"
        grid.add_row(name, _measure(share, 1.0, style, f"{share:.0%}"))
    return grid


def _resume(profile: Profile) -> str:
    """Return the command that resumes a held mission."""
    if not profile.resume:
        return "the operator"
    key = profile.requests[profile.resume].key
    return " or ".join(filter(None, (key, f"lupin {profile.verbs[profile.resume]}")))


def _progress(monitor: RunMonitor) -> RenderableType:
    if monitor.searching:
        return _measure(monitor.progress.found, monitor.progress.goal, "green", monitor.finds)
    if not monitor.total:
        return Text("no targets", "dim")
    return _measure(
        monitor.closed, monitor.total, "green", f"{_share(monitor.closed, monitor.total)} targets"
    )


def _share(closed: int, total: int) -> str:
    """Return the numbers of visits and targets in words; with several sweeps there are more visits."""
    return f"{closed}/{total}" if closed <= total else f"{closed} visits to {total}"


def _target(monitor: RunMonitor) -> Text:
    target, word = monitor.progress.target, monitor.profile.terminal.target
    return Text(f"{word} {target}", "bold") if target else Text("none", "dim")


def _counts(monitor: RunMonitor, symbols: Symbols) -> Text:
    text = Text(no_wrap=True, overflow="crop")
    for outcome in monitor.profile.outcomes:
        count = monitor.count(outcome.name)
        if count or outcome.is_good:
            style = RATING_STYLES[outcome.rating] if count else "dim"
            text.append(f"{_mark(outcome, symbols)} {count} {outcome.word}  ", style)
    return text


def _mark(outcome: TargetOutcome | None, symbols: Symbols) -> str:
    marks = {Rating.GOOD: symbols.ok, Rating.BAD: symbols.missed, Rating.LEFT_OUT: symbols.left_out}
    return marks[outcome.rating] if outcome else symbols.missed


def _style(outcome: TargetOutcome | None) -> str:
    return RATING_STYLES[outcome.rating] if outcome else ""


def _operation(running: RunningOperation | None) -> Text:
    if running is None:
        return Text("none", "dim")
    text = Text(running.operation, "bold")
    if running.tries > 1:
        text.append(f"  try {running.tries}", "yellow")
    if running.phase in ("waiting", "cancelling"):
        text.append(f"  {running.phase}", "dim")
    return text


def _deadline(running: RunningOperation | None) -> RenderableType:
    if running is None:
        return Text()
    if running.limit is None:
        return Text(f"{running.since:.1f} s, no limit", "dim")
    share = running.since / running.limit if running.limit else 1.0
    style = "green" if share < 0.6 else "yellow" if share < 0.9 else "red"
    return _measure(running.since, running.limit, style, f"{running.since:.1f} s of {running.limit:.0f} s")


def _measure(value: float, total: float, style: str, text: str) -> RenderableType:
    """Return a bar with its figures beside it."""
    row = Table.grid(padding=(0, 1))
    end = total or 1.0
    bar = ProgressBar(end, min(value, total), BAR_WIDTH, complete_style=style, finished_style=style)
    row.add_row(bar, Text(text))
    return row


def _events(happenings: Sequence[RunEvent]) -> Iterator[Text]:
    shown = list(happenings[-SHOWN_EVENTS:])
    for happening in shown:
        yield event_line(happening)
    for _ in range(SHOWN_EVENTS - len(shown)):  # so that the picture does not grow while it is watched
        yield Text()


def event_line(happening: RunEvent) -> Text:
    """Return one event as a line, in the colour of its severity."""
    line = Text(no_wrap=True, overflow="crop")
    line.append(f"{clock(happening.elapsed)}  ", "dim")
    return line.append(happening.text, STYLES[happening.severity])


def _strip(monitor: RunMonitor, symbols: Symbols, width: int) -> Text:
    """Return the targets so far in one line, each with the mark of its outcome.

    The current one is highlighted and always visible: without room, targets before it are left out.
    """
    current = monitor.progress.target
    pieces, last = [], 0
    for target in dict.fromkeys([*monitor.results, *filter(None, [current])]):
        result = monitor.results.get(target)
        outcome = monitor.profile.outcome(result.status) if result else None
        mark = _mark(outcome, symbols) if result else symbols.more
        style = _style(outcome) if result else ""
        pieces.append(Text(f" {target}{mark} ", f"bold {style}" if target == current else style))
        last = len(pieces) if target == current or not current else last
    first, room = 0, width - len(symbols.more)
    while first < last - 1 and sum(piece.cell_len for piece in pieces[first:last]) > room:
        first += 1
    left_out = Text(symbols.more, "dim") if first else Text()
    strip = Text.assemble(left_out, *pieces[first:])
    strip.no_wrap, strip.overflow = True, "crop"
    return strip


# -- the end --------------------------------------------------------------------------------------------


def results_table(results: Iterable[TargetResult], profile: Profile, symbols: Symbols = UNICODE) -> Table:
    """Return the table of results, a row for each target; a dot where a target lacks a value."""
    rows, units = list(results), profile.terminal.columns
    columns = value_columns(rows, profile)
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column(profile.terminal.target, justify="right")
    table.add_column("status")
    for column in columns:
        unit = units.get(column, "").replace("°", symbols.degree)
        table.add_column(f"{column}\n[dim]{unit}[/]" if unit else column, justify="right")
    table.add_column("reason")
    for row in rows:
        values = (_value(row.values.get(column), symbols) for column in columns)
        status = Text(row.status, _style(profile.outcome(row.status)))
        table.add_row(row.target, status, *values, Text(row.reason))
    return table


def value_columns(results: Iterable[TargetResult], profile: Profile) -> list[str]:
    """Return the columns that occur: the profile's in their order, then the others as they came."""
    known, found = profile.terminal.columns, dict.fromkeys(name for each in results for name in each.values)
    return [*(name for name in known if name in found), *(name for name in found if name not in known)]


def _value(value: float | None, symbols: Symbols) -> Text:
    return Text(symbols.dot, "dim") if value is None else Text(f"{value:.4g}")


def summary(monitor: RunMonitor, now: float) -> Text:
    """Return the last line of a run."""
    stage = monitor.lifecycle if monitor.ended else f"given up in {monitor.lifecycle or 'its beginning'}"
    text = Text(stage, _VERDICT_STYLES[monitor.verdict])
    outcome = _outcome(monitor)
    text.append(f"{f': {outcome}' if outcome else ''} in {monitor.elapsed(now):.1f} s", "not bold")
    if monitor.progress.error and monitor.verdict:
        text.append(f"; last: {monitor.progress.error}", "yellow")
    return text


def _outcome(monitor: RunMonitor) -> str:
    """Return the numbers of targets found and visited in words; '' for a mission without targets."""
    found = monitor.finds if monitor.progress.goal else ""
    if monitor.searching or not monitor.total:
        return found
    counts = counts_text(monitor.profile, monitor.progress.counts)
    return ", ".join(filter(None, (found, f"{counts or 'none visited'} of {monitor.total} targets")))


def counts_text(profile: Profile, counts: Mapping[str, int]) -> str:
    """Return how many visits ended how; '' where none has."""
    counted = ((counts.get(outcome.name, 0), outcome.word) for outcome in profile.outcomes)
    return ", ".join(f"{count} {word}" for count, word in counted if count)


# -- lines ----------------------------------------------------------------------------------------------


def plain_state(progress: Progress, profile: Profile, searching: bool = False) -> str:
    """Return a published state in one line; the counters of a search count found targets."""
    words, closed = profile.terminal, sum(progress.counts.values())
    parts = (
        f"{progress.lifecycle} {progress.phase}".strip(),
        f"{words.target} {progress.target}" if progress.target else "",
        _share(closed, progress.total) if progress.total else "",
    )
    return "  ".join(part for part in parts if part) + (f" {words.targets} found" if searching else "")


def changed_key(progress: Progress) -> tuple[str, ...]:
    """Return the fields whose change makes a new line."""
    return progress.lifecycle, progress.phase, progress.target
