"""What the live chart of the console costs: a mission of 200 states in a browser, served by real nodes.

    .venv/bin/python benchmarks/chart_view.py [--states 200] [--seconds 15]

* draw: how long a drawing with a state folded takes, each time another one, from the page and back;
* explain: how long an explanation takes, from the page and back, while nothing else is asked, and while the
  orchestrator draws: what the node's thread has to spare is seen by that;
* pan: the time between two frames (requestAnimationFrame) while a hand draws the chart to and fro;
* step: from the step's `wall_ns` and from its arrival in the page's socket until after the frame in which the
  state is lit, while the mission takes five steps a second;
* idle: processor time of all processes of the browser, in percent of one core, while nothing happens.

All on one machine, so that its clock is the page's, too. The browser has no graphics card.
"""

from __future__ import annotations

import argparse
import shutil
import socket
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from idle_cpu import cpu_seconds
from playwright.sync_api import Page, sync_playwright

from console import browser_pids, share

sys.path.insert(0, str(Path(__file__).parents[1]))

from lupin_harness.domains import claimed_domain
from tests.lupin_ros.launch.processes import Lupin
from tests.lupin_ros.system.console.conftest import DESK, FLAGS
from tests.lupin_ros.system.console.large import large_missions

DRAWINGS = 20
#: Notes for each step when it was made, when it came and when it was seen, in milliseconds since 1970.
WATCH = """
window.seen = [];
const now = () => performance.timeOrigin + performance.now();
const waiting = [];
window.WebSocket = class extends WebSocket {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", ({ data }) => {
      const frame = JSON.parse(data);
      if (frame.op !== "publish" || !frame.topic.endsWith("/steps")) return;
      const { wall_ns, step } = JSON.parse(frame.msg.data);
      if (step.entered) waiting.push({ made: wall_ns / 1e6, came: now() });
    });
  }
};
addEventListener("DOMContentLoaded", () => new MutationObserver((changes) => {
  if (!changes.some(({ target }) => target.classList?.contains("innermost"))) return;
  const lit = waiting.splice(0);
  requestAnimationFrame(() => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = () => lit.forEach((each) => seen.push({ ...each, seen: now() }));
    port2.postMessage(0);
  });
}).observe(document, { subtree: true, attributes: true, attributeFilter: ["class"] }));
"""
CALL = """([service, args]) => new Promise((done) => {
  window.calls ??= new Promise((open) => {
    const socket = new WebSocket(`ws://${location.host}/_ros`);
    socket.waiting = new Map();
    socket.addEventListener("message", ({ data }) => {
      const frame = JSON.parse(data);
      socket.waiting.get(frame.id)?.(frame);
    });
    socket.onopen = () => open(socket);
  });
  calls.then((socket) => {
    const id = String(Math.random());
    const asked = performance.now();
    socket.waiting.set(id, (frame) => done([performance.now() - asked, frame.result && frame.values]));
    const called = `/mission_orchestrator/${service}`;
    socket.send(JSON.stringify({ op: "call_service", id, service: called, args }));
  });
})"""
FRAMES = """() => {
  window.frames_ms = [];
  let last;
  const note = (at) => {
    if (last !== undefined) frames_ms.push(at - last);
    last = at;
    window.noting = requestAnimationFrame(note);
  };
  window.noting = requestAnimationFrame(note);
}"""


def told(name: str, values: list[float], unit: str = "ms") -> None:
    """Print the middle, the 95th percentile and the largest of some figures."""
    ordered = sorted(values)
    p95 = ordered[min(len(ordered) - 1, int(0.95 * len(ordered)))]
    middle = statistics.median(ordered)
    print(f"| {name} | {len(ordered)} | {middle:.1f} {unit} | {p95:.1f} {unit} | {ordered[-1]:.1f} {unit} |")


def call(page: Page, service: str, **fields: Any) -> tuple[float, Any]:
    """Call a service of the orchestrator from the page; return milliseconds and the answer."""
    took, values = page.evaluate(CALL, [service, fields])
    assert values, f"{service} failed"
    assert values.get("success", values.get("accepted")), values
    return took, values


def browser_seconds() -> float:
    """Return the processor time of the browser so far."""
    return sum(map(cpu_seconds, browser_pids()))


def draw_and_explain(page: Page, groups: int) -> None:
    """Time drawings, and explanations beside them."""
    element = "MISSION.LargeMission.GROUP_0.A_1"
    told("explain", [call(page, "explain", element=element)[0] for _ in range(100)])
    drawn = [
        call(page, "draw", folded=[f"MISSION.LargeMission.GROUP_{number % groups}"])[0]
        for number in range(DRAWINGS)
    ]
    told("draw", drawn)
    beside: list[float] = page.evaluate(
        """async ([element, folds]) => {
          const ask = CALL;
          let drawing = true;
          Promise.all(folds.map((folded) => ask(["draw", { folded }]))).then(() => (drawing = false));
          const times = [];
          while (drawing) times.push((await ask(["explain", { element }]))[0]);
          return times;
        }""".replace("CALL", CALL),
        [
            element,
            [
                [f"MISSION.LargeMission.GROUP_{one}", f"MISSION.LargeMission.GROUP_{one + 1}"]
                for one in range(8)
            ],
        ],
    )
    told("explain, while 8 charts are drawn", beside)


def pan(page: Page, seconds: float) -> None:
    """Draw the chart to and fro by hand."""
    page.get_by_label("Depth").select_option("4")
    page.locator('[data-state$="GROUP_3.A_1"]').wait_for()
    box = page.locator(".stage").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.evaluate(FRAMES)
    before = browser_seconds()
    end, turn = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        turn += 1
        page.mouse.move(x + (300 if turn % 2 else -300), y + (200 if turn % 4 < 2 else -200), steps=40)
    frames: list[float] = page.evaluate("() => (cancelAnimationFrame(noting), frames_ms)")
    used = browser_seconds() - before
    page.mouse.up()
    told("pan: between two frames", frames)
    print(f"| pan: processor time of the browser for a frame | | {1000 * used / len(frames):.1f} ms | | |")
    print(f"| pan: frames a second | | {1000 / statistics.mean(frames):.1f} | | |")


def follow(page: Page, seconds: float) -> None:
    """Let the mission run, and see how soon its steps are seen."""
    call(page, "command", verb="start", mission="LargeMission")
    page.evaluate("() => void seen.splice(0)")
    page.wait_for_timeout(seconds * 1000)
    seen = page.evaluate("seen")
    told("step: from its making to the pixel", [each["seen"] - each["made"] for each in seen])
    told("step: from the wire to the pixel", [each["seen"] - each["came"] for each in seen])
    call(page, "command", verb="abort")
    page.locator(".bar .where", has_text="DONE").wait_for(timeout=60_000)


def idle(page: Page, seconds: float) -> None:
    """Let nothing happen."""
    page.wait_for_timeout(10_000)
    print(f"| idle: of one core | | {share(browser_pids, seconds):.1f} % | | |")


def main() -> None:
    """Measure all and print a table."""
    parser = argparse.ArgumentParser(description="Measure the live chart of the console.")
    parser.add_argument("--states", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=15.0)
    given = parser.parse_args()
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    with claimed_domain() as domain, tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = large_missions(Path(name) / "missions", given.states, seconds=0.2)
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        missions = [str(folder / file) for file in ("large.yaml", "inspection.yaml")]
        more = ("--hmi", "--set", f"lupin_gateway.port={port}")
        lupin = Lupin("up", *missions, *more, domain=domain, log_dir=Path(name) / "logs" / "run")
        try:
            lupin.until_line("Ctrl-C stops everything")
            browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
            page = browser.new_page(viewport=DESK, locale="en-GB")
            page.add_init_script(WATCH)
            page.goto(f"http://127.0.0.1:{port}/#chart")
            page.locator(".bar .where", has_text="READY").wait_for(timeout=60_000)
            print("| what | count | median | p95 | largest |\n|---|---|---|---|---|")
            draw_and_explain(page, given.states // 10)
            pan(page, given.seconds)
            follow(page, given.seconds)
            idle(page, given.seconds)
            browser.close()
        finally:
            lupin.kill()


if __name__ == "__main__":
    main()
