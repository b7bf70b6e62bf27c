"""Several robots behind one server: below `/robots/NAME` is each one's gateway, elsewhere the first one's.

Each has its own access, connections, limits, stop and audit log; the server's ports and places are shared.
"""

from __future__ import annotations

from collections.abc import Mapping

from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from lupin_gateway.entry.entrance import BASE
from lupin_gateway.server import Gateway


class Robots:
    """The gateways of one server, by the names of their robots; they share a gate."""

    def __init__(self, gateways: Mapping[str, Gateway]) -> None:
        self._all = dict(gateways)
        first = next(iter(self._all.values()))
        self.gate, self.tls = first.gate, first.tls
        for gateway in self._all.values():
            gateway.siblings, gateway.gate = self._all, self.gate

    def application(self) -> ASGIApp:
        """Return the ASGI application of the first port."""
        applications = {name: gateway.application() for name, gateway in self._all.items()}
        first = next(iter(applications))

        async def route(scope: Scope, receive: Receive, send: Send) -> None:
            _, word, name, rest = [*scope.get("path", "").split("/", 3), "", "", ""][:4]
            if word == "robots" and name in applications and scope["path"].count("/") > 2:
                inner = {**scope, "path": f"/{rest}", BASE: f"/robots/{name}"}
                await applications[name](inner, receive, send)
            elif scope["type"] == "http" and (word == "" or name in applications):
                target = name if name in applications else first
                await RedirectResponse(f"/robots/{target}/")(scope, receive, send)
            else:
                await applications[first](scope, receive, send)

        return route

    def protocol_only(self) -> ASGIApp:
        """Return the ASGI application of the second port, which is of the first robot."""
        return next(iter(self._all.values())).protocol_only()

    def warn(self, text: str) -> None:
        """Log what is wrong for a while."""
        next(iter(self._all.values())).warn(text)

    def start(self) -> None:
        """Begin to work; on the event loop."""
        for gateway in self._all.values():
            gateway.start()

    def tick(self) -> None:
        """Publish each robot's stop; one that fails keeps no other from it."""
        first: Exception | None = None
        for gateway in self._all.values():
            try:
                gateway.tick()
            except Exception as defect:
                first = first or defect
        if first is not None:
            raise first

    def look(self) -> None:
        """See `Gateway.look`."""
        for gateway in self._all.values():
            gateway.look()
