"""The plugin that is always there: operations of the engine itself.

`plugins.ready` ends when every plugin that the loaded missions use says that it can work; whoever runs the
chart answers it, so it has no client.
"""

from __future__ import annotations

from lupin_engine.plugin.contract import Mock, OnHold, Operation, Plugin

#: The name of the built-in plugin; charts do not list it among the plugins they need.
BUILTIN = "plugins"

PLUGIN = Plugin(
    name=BUILTIN,
    doc="Operations of the engine itself.",
    operations={
        "ready": Operation(
            doc="Wait until the servers and topics of all plugins that the loaded missions use are there.",
            on_hold=OnHold.FINISH,
            mock=Mock(after=0.0),
        )
    },
)
