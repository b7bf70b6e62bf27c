"""What the console costs the browser and the gateway, and how soon it shows something.

    .venv/bin/python benchmarks/console.py                       # all but the hour, some three minutes
    .venv/bin/python benchmarks/console.py --only memory --minutes 60 --speed 8 --csv heap.csv --compare 5 10

`lupin up --hmi` runs on a private domain; Chromium, without a screen, opens the console of it.

* paint: fresh profiles, one after the other: from the request of the page to the first frame in which the
  lifecycle of the mission is to be read;
* idle: processor time of all processes of the browser, each view open in READY, and during a mission;
* five: processor time of the gateway and of the browser with five consoles open in a mission, and how long
  a stop takes to a reader of `/lupin/gateway/stop`: of a client that draws nothing, alone and beside them,
  also with pages that draw when nobody else wants the processor, as on other computers, and of one of the
  pages;
* memory: JavaScript's heap after collecting garbage, every half minute of missions that follow each other,
  while the page shows one view after the other; `--compare 5 10` tells which objects became more between two
  minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import statistics
import subprocess
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from idle_cpu import LUPIN, cpu_seconds
from playwright.sync_api import Browser, CDPSession, Page, sync_playwright
from std_msgs.msg import Bool
from websockets.sync.client import connect

from lupin_ros.adapter.node import Qos, RosNode

DOMAIN, PORT = "93", 8193
URL = f"http://127.0.0.1:{PORT}/"
VIEWS = ("control", "chart", "map", "log", "twin", "arm", "health", "people")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"]
FLAGS += ["--disable-background-networking", "--disable-component-update", "--js-flags=--expose-gc"]
#: Notes when the lifecycle is to be read for the first time, after the frame in which it is.
WATCH = """
const look = () => {
  const word = document.querySelector(".bar .where b");
  const seen = () => (window.shownAt = performance.now());
  requestAnimationFrame(word && /^[A-Z]{3}/.test(word.textContent) ? seen : look);
};
requestAnimationFrame(look);
"""
PATIENCE_MS = 60_000
#: Seconds for which a release is held.
HOLD_S = 1.0
#: Seconds between two presses.
BETWEEN_S = 0.1


@contextmanager
def running(speed: str) -> Iterator[int]:
    """Start all nodes; yields the gateway's process."""
    with tempfile.TemporaryDirectory() as home:
        os.environ.setdefault("ROS_DOMAIN_ID", DOMAIN)
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        os.environ |= {"XDG_STATE_HOME": home, "XDG_CONFIG_HOME": home}
        options = [
            "--hmi",
            "--speed",
            speed,
            "--set",
            f"lupin_gateway.port={PORT}",
            "--log-dir",
            f"{home}/logs",
        ]
        process = subprocess.Popen([LUPIN, "up", *options], stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        next(line for line in process.stdout if "Ctrl-C stops everything" in line)
        threading.Thread(target=process.stdout.read, daemon=True).start()
        try:
            yield next(pid for pid in descendants(process.pid) if "lupin_gateway" in command_line(pid))
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(60)


def command_line(pid: int) -> str:
    """Return how a process was started."""
    return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")


def descendants(root: int) -> list[int]:
    """Return all processes that a process started, and those that they started."""
    found, parents = [], {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except (OSError, IndexError):
            continue
    waiting = [root]
    while waiting:
        children = [pid for pid, parent in parents.items() if parent == waiting[0]]
        found += children
        waiting = [*waiting[1:], *children]
    return found


def share(processes: Callable[[], list[int]], seconds: float) -> float:
    """Return what processes take of one core, in per cent; they live all the time."""
    pids = processes()
    before, began = sum(map(cpu_seconds, pids)), time.monotonic()
    time.sleep(seconds)
    return 100 * (sum(map(cpu_seconds, pids)) - before) / (time.monotonic() - began)


def browser_pids() -> list[int]:
    """Return the processes of the browser that this process started."""
    return [pid for pid in descendants(os.getpid()) if "chromium" in command_line(pid).partition(" ")[0]]


def opened(browser: Browser, view: str = "") -> Page:
    """Open the console in a fresh profile, and wait until it shows something."""
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.add_init_script(WATCH)
    page.goto(f"{URL}#{view}")
    while not page.evaluate("window.shownAt"):
        page.wait_for_timeout(20)
    return page


def start(mission: str, *options: str) -> None:
    """Start a mission; one that is under way goes on."""
    command = [LUPIN, "start", mission, *options]
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)


def paint(browser: Browser, times: int) -> dict[str, float]:
    """Measure from the request of the page to the first state that it shows, in ms."""
    found = []
    for _ in range(times):
        page = opened(browser)
        found.append(float(page.evaluate("window.shownAt")))
        page.context.close()
    return {"median": statistics.median(found), "slowest": max(found)}


def idle(browser: Browser, seconds: float) -> dict[str, float]:
    """Measure what each view takes of a core."""
    found = {}
    for view in VIEWS:
        page = opened(browser, view)
        page.wait_for_timeout(2000)
        found[view] = share(browser_pids, seconds)
        page.context.close()
    return found


def yield_to_others(pids: list[int]) -> None:
    """Give processes the processor only when nobody else wants it: pages are usually on other computers."""
    for pid in pids:
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.setpriority(os.PRIO_PROCESS, int(thread.name), 19)


class Listener:
    """A reader of the stop, and how soon it hears what somebody presses."""

    def __init__(self, presses: int) -> None:
        self._presses = presses
        self._node = RosNode("listener")
        self._heard = [(False, 0.0)]
        self._node.subscribe(Bool, "/lupin/gateway/stop", Qos.LATCHED, self._hear)
        self._node.spin_once(1.0)

    def _hear(self, message: Bool) -> None:
        if message.data is not self._heard[-1][0]:
            self._heard.append((message.data, time.time()))

    def delays(self, press: Callable[[bool], float]) -> dict[str, float]:
        """Return the ms from presses, alternately of stop and of its release, until each is heard.

        `press` returns when that was, in seconds since 1970.
        """
        found = []
        for number in range(self._presses):
            before = len(self._heard)
            pressed = press(number % 2 == 0)
            while len(self._heard) == before:
                self._node.spin_once(1.0)
            found.append(1000 * (self._heard[-1][1] - pressed))
            until = time.monotonic() + BETWEEN_S
            while (left := until - time.monotonic()) > 0:
                self._node.spin_once(left)
        ordered = sorted(found)
        return {
            "p50": statistics.median(found),
            "p99": ordered[int(0.99 * len(ordered))],
            "slowest": ordered[-1],
        }


def press(page: Page, stopped: bool) -> float:
    """Press STOP of a page, or hold its release; return when that counts, in seconds since 1970."""
    key = "new KeyboardEvent('keydown', {key: 'Enter'})"
    act = "#stop').click()" if stopped else f"#release').dispatchEvent({key})"
    now = f"[performance.timeOrigin + performance.now(), document.querySelector('{act}][0]"
    return float(page.evaluate(now)) / 1000 + (0 if stopped else HOLD_S)


def five(browser: Browser, gateway: int, seconds: float, presses: int) -> dict[str, Any]:
    """Measure the gateway with five consoles open, and a stop: of a client without a page, and of a page."""
    listener = Listener(presses)
    with connect(f"{URL.replace('http', 'ws')}_ros", compression=None) as client:

        def send(stopped: bool) -> float:
            message = {"op": "publish", "topic": "/lupin/hmi/estop", "type": "std_msgs/msg/Bool"}
            pressed = time.time()
            client.send(json.dumps({**message, "msg": {"data": stopped}}))
            return pressed

        found: dict[str, Any] = {"stop of a client alone": listener.delays(send)}
        pages = [opened(browser, view) for view in ("control", "chart", "map", "log", "twin")]
        found["gateway"] = share(lambda: [gateway], seconds)
        found["browser"] = share(browser_pids, seconds)
        found["stop of a client beside five consoles"] = listener.delays(send)
        found["stop of a page, one of five"] = listener.delays(partial(press, pages[0]))
        yield_to_others(browser_pids())
        found["the same, as if they were drawn elsewhere"] = listener.delays(send)

    for page in pages:
        page.context.close()
    return found


def memory(
    browser: Browser, minutes: float, csv: Path | None, compared: list[float]
) -> dict[str, float | str]:
    """Measure the heap in MB while missions follow each other and the page shows one view after the other."""
    page = opened(browser, VIEWS[0])
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.enable")
    found: list[tuple[float, float]] = []
    counts: list[Counter[str]] = []
    began = time.monotonic()
    lines = ["minutes,heap_mb,dom_nodes,listeners"]
    for number in range(int(2 * minutes)):
        start("inspection")
        page.evaluate(f"location.hash = '{VIEWS[number % len(VIEWS)]}'")
        page.wait_for_timeout(1000 * max(0, began + 30 * (number + 1) - time.monotonic()))
        session.send("HeapProfiler.collectGarbage")
        passed, used = (number + 1) / 2, session.send("Runtime.getHeapUsage")["usedSize"] / 1e6
        dom = session.send("Memory.getDOMCounters")
        found.append((passed, used))
        lines.append(f"{passed},{used:.2f},{dom['nodes']},{dom['jsEventListeners']}")
        print(lines[-1], flush=True)
        if csv:
            csv.write_text("\n".join(lines) + "\n", encoding="utf-8")
        if passed in compared:
            counts.append(bytes_by_class(session))
    page.context.close()
    for before, after in pairwise(counts):
        more = {name: after[name] - before[name] for name in after}
        for name in sorted(more, key=lambda each: -more[each])[:25]:
            print(f"{more[name] / 1e3:9.1f} kB more of {name} ({after[name] / 1e3:.1f} kB)")
    halves = [used for passed, used in found if passed > minutes / 2]
    return {"after a minute": found[1][1], "second half, least": min(halves), "most": max(halves)}


def bytes_by_class(session: CDPSession) -> Counter[str]:
    """Take a snapshot of the heap; return the bytes of all objects of each kind and constructor."""
    parts: list[str] = []
    session.on("HeapProfiler.addHeapSnapshotChunk", lambda part: parts.append(part["chunk"]))
    session.send("HeapProfiler.takeHeapSnapshot", {"reportProgress": False})
    whole = json.loads("".join(parts))
    fields = whole["snapshot"]["meta"]["node_fields"]
    kinds = whole["snapshot"]["meta"]["node_types"][fields.index("type")]
    found: Counter[str] = Counter()
    for at in range(0, len(whole["nodes"]), len(fields)):
        node = dict(zip(fields, whole["nodes"][at : at + len(fields)], strict=True))
        kind = kinds[node["type"]]
        name = whole["strings"][node["name"]][:60] if kind in ("object", "closure", "native") else ""
        found[f"{kind} {name}".strip()] += node["self_size"]
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--profiles", type=int, default=10, help="fresh ones, for the first paint")
    parser.add_argument("--presses", type=int, default=200, help="of stop and release, for one figure")
    parser.add_argument("--speed", default="1", help="of the simulated robot")
    parser.add_argument("--minutes", type=float, default=0.0, help="of the measurement of memory")
    parser.add_argument("--csv", type=Path, help="where the measured heaps go")
    parser.add_argument("--compare", type=float, nargs="*", default=[], help="minutes, between two of them")
    parser.add_argument("--only", choices=["paint", "idle", "five", "memory"])
    given = parser.parse_args()
    found: dict[str, Any] = {}
    chromium = shutil.which("chromium")
    with running(given.speed) as gateway, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        if given.only in (None, "paint"):
            found["paint, ms"] = paint(browser, given.profiles)
        if given.only in (None, "idle"):
            found["idle, % of a core"] = idle(browser, given.seconds)
            start("inspection")
            found["in a mission, % of a core"] = idle(browser, given.seconds)
        if given.only in (None, "five"):
            start("inspection")
            found["five consoles, % of a core, ms"] = five(browser, gateway, given.seconds, given.presses)
        if given.minutes:
            found["heap, MB"] = memory(browser, given.minutes, given.csv, given.compare)
        browser.close()
    print(json.dumps(found, indent=2, default=lambda number: round(number, 2)))


if __name__ == "__main__":
    main()
