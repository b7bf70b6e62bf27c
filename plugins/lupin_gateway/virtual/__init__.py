"""Serves the same pages for a simulation or a recording: without ROS, and on this machine only."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from lupin_engine.plugin import Access, PageSource, declared_access, load_catalog
from lupin_gateway.access import AccessControl, AllowList
from lupin_gateway.entry.gate import GateListener
from lupin_gateway.guard import OWN_ACCESS, STOPS_TOPIC, ClockPair, GatewayRules, RuleOutputs
from lupin_gateway.hub import Backlog, Hub
from lupin_gateway.people import People
from lupin_gateway.ports import CallFailed
from lupin_gateway.server import Address, Gateway, serve
from lupin_gateway.session import Limits
from lupin_gateway.stop import StopArbiter
from lupin_gateway.virtual.adapter import SourceAdapter, SourceHistory

#: How many of its last messages a topic of events keeps for pages that come later: the rest is their history.
LAST_EVENTS = 50


def serve_pages(source: PageSource, port: int, announce: Callable[[str], object]) -> None:
    """Serve the pages of a source until SIGINT or SIGTERM; `announce` gets their address.

    Raises:
        UsageError: the port is taken.
    """
    address = Address(port=port)
    sockets = address.sockets()
    announce(f"pages at http://{address.host}:{sockets[0].getsockname()[1]}")
    asyncio.run(_serve(source, sockets))


async def _serve(source: PageSource, sockets: Sequence[GateListener]) -> None:
    loop = asyncio.get_running_loop()
    until: asyncio.Future[None] = loop.create_future()

    def end(_: object = None) -> None:
        if not until.done():
            until.set_result(None)

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, end)
    port = SourceAdapter(source, time.monotonic)
    kept = {topic: Backlog(LAST_EVENTS, events=True) for topic in source.events}
    hub = Hub(port.listen, lambda topic: kept.get(topic, Backlog()))
    port.forgotten = hub.forget
    gateway = Gateway(port, hub, Limits(), _rules(source, port), {}, SourceHistory(source))
    working = asyncio.ensure_future(port.work())
    working.add_done_callback(end)
    await serve(gateway, sockets, until)
    if working.done():
        working.result()  # it never ends but by a defect
    working.cancel()


def _rules(source: PageSource, port: SourceAdapter) -> GatewayRules:
    """Return the rules as on a robot, but without audit log and saved state: nothing here moves."""
    outputs = RuleOutputs(
        publish_stop=port.stop,
        publish_stops=partial(port.publish_text, STOPS_TOPIC),
        pause=lambda done: done(CallFailed("nothing is lost with the link")),
        keep=lambda kept: None,
    )
    allowed = AllowList(_access(source))
    clocks = ClockPair(time.monotonic, time.time)
    rules = GatewayRules(AccessControl(), allowed, StopArbiter(), None, clocks, outputs)
    rules.people = People(port.publish_text)
    return rules


def _access(source: PageSource) -> Iterator[Access]:
    yield from declared_access(load_catalog())
    yield OWN_ACCESS
    yield source.access
