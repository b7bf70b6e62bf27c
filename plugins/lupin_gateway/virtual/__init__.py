"""The same pages on a simulation or a recording: without ROS, and on this machine only."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from lupin_engine.plugin import Access, PageSource, declared_access, load_catalog
from lupin_gateway.doors import AllowList, Doors
from lupin_gateway.entry.gate import GateListener
from lupin_gateway.guard import OWN_ACCESS, STOPS_TOPIC, Hands, HouseRules, TwoClocks
from lupin_gateway.hub import Backlog, Hub
from lupin_gateway.people import People
from lupin_gateway.server import Address, Gateway, serve
from lupin_gateway.session import Limits
from lupin_gateway.sides import CallFailed
from lupin_gateway.stop import StopArbiter
from lupin_gateway.virtual.side import SourceHistory, SourceSide

#: How many of its last messages a topic of events keeps for pages that come later: the rest is their history.
LAST_EVENTS = 50


def serve_pages(source: PageSource, port: int, told: Callable[[str], object]) -> None:
    """Serve pages on a source until SIGINT or SIGTERM; `told` gets where they are.

    Raises:
        UsageError: the port is taken.
    """
    address = Address(port=port)
    sockets = address.sockets()
    told(f"pages at http://{address.host}:{sockets[0].getsockname()[1]}")
    asyncio.run(_serve(source, sockets))


async def _serve(source: PageSource, sockets: Sequence[GateListener]) -> None:
    loop = asyncio.get_running_loop()
    until: asyncio.Future[None] = loop.create_future()

    def end(_: object = None) -> None:
        if not until.done():
            until.set_result(None)

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, end)
    side = SourceSide(source, time.monotonic)
    kept = {topic: Backlog(LAST_EVENTS, events=True) for topic in source.events}
    hub = Hub(side.listen, lambda topic: kept.get(topic, Backlog()))
    side.forgotten = hub.forget
    gateway = Gateway(side, hub, Limits(), _rules(source, side), {}, SourceHistory(source))
    working = asyncio.ensure_future(side.work())
    working.add_done_callback(end)
    await serve(gateway, sockets, until)
    if working.done():
        working.result()  # it never ends but by a defect
    working.cancel()


def _rules(source: PageSource, side: SourceSide) -> HouseRules:
    """Return the rules of a robot's gateway, without its log and what outlives it: nothing here moves."""
    hands = Hands(
        tell_stop=side.stop,
        tell_state=partial(side.tell, STOPS_TOPIC),
        pause=lambda done: done(CallFailed("nothing is lost with the link")),
        keep=lambda kept: None,
    )
    allowed = AllowList(_access(source))
    clocks = TwoClocks(time.monotonic, time.time)
    rules = HouseRules(Doors(), allowed, StopArbiter(), None, clocks, hands)
    rules.people = People(side.tell)
    return rules


def _access(source: PageSource) -> Iterator[Access]:
    yield from declared_access(load_catalog())
    yield OWN_ACCESS
    yield source.access
