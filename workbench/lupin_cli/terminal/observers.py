"""Three ways to follow a run: a picture in the terminal, plain lines, JSON lines."""

from __future__ import annotations

import io
import json
import re
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.live import Live
from rich.text import Text

from lupin_cli.terminal import view
from lupin_cli.terminal.tty import hang_up
from lupin_engine.chart import Chart
from lupin_engine.errors import Severity
from lupin_engine.plugin import TargetResult
from lupin_ros.launch import RunMonitor

if TYPE_CHECKING:
    from lupin_ros.recording import TopicRecorder

#: Pictures a second in the terminal.
PICTURES_HZ = 8.0
#: Width of saved pictures, in cells.
SAVED_WIDTH = 100


def _line(text: str) -> None:
    print(text, flush=True)


class PlainObserver:
    """One line for every change; for files, pipes and simple terminals."""

    def __init__(self, write: Callable[[str], None] = _line) -> None:
        self._write = write
        self._last: tuple[Any, ...] = ()
        self._shown = 0

    def note(self, text: str, severity: Severity = Severity.INFO) -> None:
        """Write a line about the run itself."""
        if severity is Severity.ERROR:
            print(f"lupin: {text}", file=sys.stderr, flush=True)
        else:
            self._write(text)

    def arrived(self, kind: str, data: Mapping[str, Any], monitor: RunMonitor) -> None:
        """Write a line when state, phase or target changed, and one for each event."""
        self.show(monitor)
        if kind == "state" and (key := view.changed_key(monitor.progress)) != self._last:
            self._last = key
            line = view.plain_state(monitor.progress, monitor.profile, monitor.searching)
            self._write(f"{view.clock(monitor.elapsed(monitor.heard))}  {line}")

    def show(self, monitor: RunMonitor) -> None:
        """Write the events that are new."""
        for happening in monitor.happenings[self._shown :]:
            mark = "" if happening.severity is Severity.INFO else f"  [{happening.severity.name.lower()}]"
            self._write(f"{view.clock(happening.elapsed)}    {happening.text}{mark}")
        self._shown = len(monitor.happenings)

    def close(self, monitor: RunMonitor | None, code: int) -> None:
        """Write the table of readings and the summary."""
        if monitor is None:
            return
        self.show(monitor)
        console = Console(file=sys.stdout, width=120, color_system=None)
        _finish(console, monitor)


class LiveObserver:
    """The picture, redrawn in place; notes of the run scroll above it."""

    def __init__(self, console: Console, chart: Chart) -> None:
        self._console = console
        self._chart = chart
        self._live: Live | None = None
        self._drawn = 0.0

    def note(self, text: str, severity: Severity = Severity.INFO) -> None:
        """Print above the picture."""
        style = "dim" if severity is Severity.INFO else view.STYLES[severity]
        self._console.print(Text(text, style))

    def arrived(self, kind: str, data: Mapping[str, Any], monitor: RunMonitor) -> None:
        """Draw at once for everything but a published state."""
        if kind != "state":
            self._draw(monitor)

    def show(self, monitor: RunMonitor) -> None:
        """Draw when it is time for another picture."""
        if time.monotonic() - self._drawn >= 1.0 / PICTURES_HZ:
            self._draw(monitor)

    def _draw(self, monitor: RunMonitor) -> None:
        self._drawn = time.monotonic()
        if self._live is None:
            self._live = Live(console=self._console, auto_refresh=False, transient=False)
            self._live.start()
        self._live.update(view.picture(monitor, self._chart, self._drawn), refresh=True)

    def close(self, monitor: RunMonitor | None, code: int) -> None:
        """Leave the last picture standing and print the table under it."""
        if self._live is not None:
            if monitor is not None:
                self._draw(monitor)
            self._live.stop()
        if monitor is not None:
            _finish(self._console, monitor)


def _finish(console: Console, monitor: RunMonitor) -> None:
    symbols = view.ASCII if console.options.ascii_only else view.UNICODE
    if monitor.results:
        console.print(view.results_table(monitor.results.values(), monitor.profile, symbols))
    console.print(view.summary(monitor, time.monotonic()))


class JsonObserver:
    """One JSON object a line: notes, changed states, observations, steps, and the result."""

    def __init__(self, write: Callable[[str], None] = _line) -> None:
        self._write = write
        self._last: dict[str, Any] = {}
        self._shown = 0

    def _put(self, kind: str, **fields: Any) -> None:
        self._write(json.dumps({"type": kind, **fields}, ensure_ascii=False))

    def note(self, text: str, severity: Severity = Severity.INFO) -> None:
        """Write a note."""
        self._put("note", severity=severity.name.lower(), text=text)

    def arrived(self, kind: str, data: Mapping[str, Any], monitor: RunMonitor) -> None:
        """Write a state when anything but its stamp is new; every observation, finding and step."""
        elapsed = round(time.monotonic() - monitor.began, 3)
        if kind == "state":
            said = {name: value for name, value in data.items() if name != "header"}
            if said != self._last:
                self._last = said
                self._put("state", elapsed=elapsed, **said)
        elif kind == "observation" and monitor.received == self._shown:
            finding = monitor.happenings[-1]
            self._put("finding", elapsed=elapsed, severity=finding.severity.name.lower(), text=finding.text)
        elif kind == "observation":
            self._shown = monitor.received
            self._put("observation", elapsed=elapsed, **_result(monitor, list(monitor.results.values())[-1]))
        else:
            self._put("step", elapsed=elapsed, step=data.get("step"), view=data.get("view"))

    def show(self, monitor: RunMonitor) -> None:
        """Nothing: everything was written as it came."""

    def close(self, monitor: RunMonitor | None, code: int) -> None:
        """Write the result."""
        if monitor is None:
            self._put("result", exit_code=code)
            return
        self._put(
            "result",
            exit_code=code,
            mission_id=monitor.mission_id,
            lifecycle=monitor.lifecycle,
            seconds=round(monitor.elapsed(time.monotonic()), 3),
            total=monitor.total,
            counts={status: monitor.count(status) for status in monitor.profile.statuses},
            last_error=monitor.progress.error,
            readings=[_result(monitor, result) for result in monitor.results.values()],
        )


def _result(monitor: RunMonitor, result: TargetResult) -> dict[str, Any]:
    found = {monitor.profile.terminal.target: result.target, "status": result.status}
    return {**found, "reason": result.reason, "values": dict(result.values)}


class _Forwarding:
    """Forwards everything to another observer."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    def note(self, text: str, severity: Severity = Severity.INFO) -> None:
        """Forward."""
        self._pass_on(self._inner.note, text, severity)

    def arrived(self, kind: str, data: Mapping[str, Any], monitor: RunMonitor) -> None:
        """Forward."""
        self._pass_on(self._inner.arrived, kind, data, monitor)

    def show(self, monitor: RunMonitor) -> None:
        """Forward."""
        self._pass_on(self._inner.show, monitor)

    def close(self, monitor: RunMonitor | None, code: int) -> None:
        """Forward."""
        self._pass_on(self._inner.close, monitor, code)

    def _pass_on(self, call: Callable[..., None], *what: Any) -> None:
        call(*what)


class Heard(_Forwarding):
    """Forwards to another observer while its output can be written; then stops the run.

    A terminal that was closed, or a pipe whose reader has left, must not keep a robot from being stopped.
    """

    def __init__(self, inner: Any, stop: Callable[[], None]) -> None:
        """`stop` is called once, when the output can no longer be written."""
        super().__init__(inner)
        self._stop = stop
        self._gone = False

    def _pass_on(self, call: Callable[..., None], *what: Any) -> None:
        if self._gone:
            return
        try:
            call(*what)
        except OSError:
            self._gone = True
            hang_up()
            self._stop()


class RecordingReporter(_Forwarding):
    """Forwards to another observer, and reports news of the run's recording."""

    def __init__(self, inner: Any, recorder: TopicRecorder) -> None:
        super().__init__(inner)
        self._recorder = recorder

    def show(self, monitor: RunMonitor) -> None:
        """Forward, with the news of the recorder."""
        for text, severity in self._recorder.news():
            self.note(text, severity)
        super().show(monitor)


class SavingPicture(_Forwarding):
    """Forwards to another observer, and saves one picture when half of the targets are done."""

    def __init__(self, inner: Any, chart: Chart, path: Path) -> None:
        super().__init__(inner)
        self._chart, self._path = chart, path
        self._saved = False

    def show(self, monitor: RunMonitor) -> None:
        """Forward; save a picture when half of the targets are done and an operation has run for a moment."""
        super().show(monitor)
        now = time.monotonic()
        under_way = any(running.since > 1.0 for running in monitor.running(now))
        if not self._saved and under_way and monitor.total and 2 * monitor.closed >= monitor.total:
            self._save(monitor, now)

    def _save(self, monitor: RunMonitor, now: float) -> None:
        """Write the picture; an error is reported and does not end the run."""
        self._saved = True
        try:
            self.save(monitor, now)
        except OSError as problem:
            self._inner.note(f"no picture in {str(self._path)!r}: {problem.strerror}", Severity.WARN)

    def save(self, monitor: RunMonitor, now: float) -> None:
        """Write the picture as SVG."""
        console = Console(record=True, width=SAVED_WIDTH, file=io.StringIO(), force_terminal=True)
        console.print(view.picture(monitor, self._chart, now))
        self._path.parent.mkdir(parents=True, exist_ok=True)
        svg = console.export_svg(title="lupin run")
        # rich names a font on the web; a picture in a repository should not fetch anything.
        self._path.write_text(re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL), encoding="utf-8")

    def close(self, monitor: RunMonitor | None, code: int) -> None:
        """Forward; save the picture now if that has not happened yet."""
        if not self._saved and monitor is not None:
            self._save(monitor, time.monotonic())
        super().close(monitor, code)
