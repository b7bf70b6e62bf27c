"""The clients of the plugins that the missions use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import BUILTIN, Driver, make_client
from lupin_ros.adapter.node import RosNode
from lupin_ros.orchestrator.binding_client import BoundClient
from lupin_ros.orchestrator.outlet import RosOutlet
from lupin_ros.orchestrator.readiness import Readiness


class PluginClients:
    """The drivers of the engine by plugin, kept as long as the missions use them as they are."""

    def __init__(
        self,
        ros: RosNode,
        loaded: LoadedMissions,
        outlet: RosOutlet,
        parameters: Mapping[str, Any],
        is_resumed: bool,
    ) -> None:
        """Make the clients; `is_resumed` is whether the machine goes on from another process."""
        self._ros = ros
        #: Where they report.
        self.outlet = outlet
        self._loaded = loaded
        self.drivers: dict[str, Driver] = dict(self._made(loaded, loaded.chart.clients, parameters))
        self.drivers[BUILTIN] = self.readiness = Readiness(self, outlet, ros, is_resumed)

    def in_use(self) -> list[Driver]:
        """Return the drivers of the plugins that the missions use."""
        return [self.drivers[name] for name in self._loaded.chart.plugins if name in self.drivers]

    def prepared(self, loaded: LoadedMissions, parameters: Mapping[str, Any]) -> dict[str, Driver]:
        """Return the clients that other missions need besides; `switch` takes them.

        Raises:
            LupinError: one does not fit; nothing has changed.
        """
        changed = self._changed(loaded)
        new = [name for name in loaded.chart.clients if name not in self.drivers or name in changed]
        return dict(self._made(loaded, new, parameters))

    def switch(self, loaded: LoadedMissions, clients: Mapping[str, Driver]) -> None:
        """Go by other missions, with the clients that were prepared; close those that are not needed."""
        now, changed = {*loaded.chart.clients, BUILTIN}, self._changed(loaded)
        for name in [name for name in self.drivers if name not in now or name in changed]:
            self.drivers.pop(name).close()
        self.drivers.update(clients)
        self._loaded = loaded

    def _changed(self, loaded: LoadedMissions) -> set[str]:
        before = self._loaded.bindings
        return {name for name in loaded.chart.clients if before.get(name) is not loaded.bindings.get(name)}

    def _made(
        self, loaded: LoadedMissions, names: Iterable[str], parameters: Mapping[str, Any]
    ) -> Iterator[tuple[str, Driver]]:
        """Yield the clients of the named plugins: a binding's, or the plugin's own where it has one."""
        for name in names:
            if name in loaded.bindings:
                yield name, BoundClient(self._ros, loaded.bindings[name], self.outlet, parameters)
                continue
            plugin = loaded.chart.catalog.plugins[name]
            if plugin.client:
                yield name, make_client(plugin, self._ros, self.outlet, parameters)

    def close(self) -> None:
        """Close all."""
        for driver in self.drivers.values():
            driver.close()
