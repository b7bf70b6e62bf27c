"""What the console costs the browser and the gateway, and how soon it shows something.

    .venv/bin/python benchmarks/console.py                       # all but the hour, some three minutes
    .venv/bin/python benchmarks/console.py --minutes 60 --only memory

`lupin up --hmi` runs on a private domain; Chromium, without a screen, opens the console of it.

* paint: fresh profiles, one after the other: from the request of the page to the first frame in which the
  lifecycle of the mission is to be read;
* idle: processor time of all processes of the browser, each view open in READY, and during a mission;
* five: processor time of the gateway with five consoles open during a mission, and the delay of a stop, from
  the page to a reader of `/lupin/hmi/estop`;
* memory: JavaScript's heap after collecting garbage, every minute of missions that follow each other.
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
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from idle_cpu import LUPIN, cpu_seconds
from playwright.sync_api import Browser, Page, sync_playwright
from std_msgs.msg import Bool

from lupin_engine.ros.adapter.node import Qos, RosNode

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


@contextmanager
def running(speed: str) -> Iterator[int]:
    """Start all nodes; yields the gateway's process."""
    with tempfile.TemporaryDirectory() as home:
        os.environ |= {"ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
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


def five(browser: Browser, gateway: int, seconds: float) -> dict[str, float]:
    """Measure the gateway with five consoles open."""
    pages = [opened(browser, view) for view in ("control", "chart", "map", "log", "twin")]
    used = share(lambda: [gateway], seconds)
    node, heard = RosNode("listener"), [(False, 0.0)]

    def hear(message: Bool) -> None:
        if message.data is not heard[-1][0]:
            heard.append((message.data, time.time()))

    node.subscribe(Bool, "/lupin/hmi/estop", Qos.EVENT, hear)
    node.spin_once(1.0)
    delays = []
    for _ in range(20):
        for button in ("#stop", "#release"):
            before = len(heard)
            press = f"document.querySelector('{button}').click()"
            pressed = pages[0].evaluate(f"[performance.timeOrigin + performance.now(), {press}][0]")
            while len(heard) == before:
                node.spin_once(1.0)
            delays.append(1000 * heard[-1][1] - float(pressed))
    node.close()
    for page in pages:
        page.context.close()
    return {"gateway": used, "stop p50": statistics.median(delays), "stop slowest": max(delays)}


def memory(browser: Browser, minutes: float) -> list[float]:
    """Return the heap in MB after each minute of missions."""
    page = opened(browser, "chart")
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.enable")
    found, end = [], time.monotonic() + 60 * minutes
    while time.monotonic() < end:
        start("inspection")
        page.wait_for_timeout(60_000)
        session.send("HeapProfiler.collectGarbage")
        found.append(float(page.evaluate("performance.memory.usedJSHeapSize")) / 1e6)
        print(f"{len(found):3d} min {found[-1]:.1f} MB", flush=True)
    page.context.close()
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--speed", default="1", help="of the simulated robot")
    parser.add_argument("--minutes", type=float, default=0.0, help="of the measurement of memory")
    parser.add_argument("--only", choices=["paint", "idle", "five", "memory"])
    given = parser.parse_args()
    found: dict[str, Any] = {}
    chromium = shutil.which("chromium")
    with running(given.speed) as gateway, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        if given.only in (None, "paint"):
            found["paint, ms"] = paint(browser, 10)
        if given.only in (None, "idle"):
            found["idle, % of a core"] = idle(browser, given.seconds)
            start("inspection")
            found["in a mission, % of a core"] = idle(browser, given.seconds)
        if given.only in (None, "five"):
            start("inspection")
            found["five consoles, % of a core, ms"] = five(browser, gateway, given.seconds)
        if given.minutes:
            found["heap, MB"] = memory(browser, given.minutes)
        browser.close()
    print(json.dumps(found, indent=2, default=lambda number: round(number, 2)))


if __name__ == "__main__":
    main()
