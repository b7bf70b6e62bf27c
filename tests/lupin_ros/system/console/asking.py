"""Services of the robot, asked for from a page as any other page of this gateway does."""

from __future__ import annotations

from typing import Any

from playwright.sync_api import Page

_ASK = """([service, args]) => new Promise((done, failed) => {
  const socket = new WebSocket(`ws://${location.host}/_ros`);
  socket.onopen = () => socket.send(JSON.stringify({op: "call_service", id: "ask", service, args}));
  socket.onerror = () => failed(new Error("no connection"));
  socket.onmessage = ({data}) => {
    const frame = JSON.parse(data);
    if (frame.op === "service_response") (done(frame.values), socket.close());
  };
})"""


def ask(page: Page, service: str, **arguments: Any) -> Any:
    """Return the answer of a service: its fields, or why there are none."""
    return page.evaluate(_ASK, [service, arguments])


def command(page: Page, verb: str, mission: str = "", request: str = "") -> Any:
    """Command the orchestrator, and return its answer; it is asked again while it is starting up."""
    service = "/mission_orchestrator/command"
    sent = {"verb": verb, "mission": mission, "request": request}
    for _ in range(100):
        answer = ask(page, service, **sent)
        if isinstance(answer, dict) and "starting up" not in answer["message"]:
            return answer
        page.wait_for_timeout(100)
    raise AssertionError(f"{verb}: {answer}")
