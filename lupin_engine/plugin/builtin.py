"""The built-in plugin: operations, values and parameters of the engine itself.

`plugins.missing` is the list of servers and topics that the plugins of the loaded missions wait for;
`plugins.ready` ends as soon as it is empty. The runner of a chart answers both, so there is no client. Charts
that read the clock have the parameter of the time zone, and those with lists in requests the one that limits
them.
"""

from __future__ import annotations

from lupin_engine.plugin.contract import LiveValue, Mock, OnHold, Operation, Parameter, Plugin
from lupin_engine.plugin.types import COUNT, TEXT, ZONE, list_of

#: The name of the built-in plugin; charts do not list it among the plugins they need.
BUILTIN = "plugins"
#: The full names of what it offers.
READY, MISSING = f"{BUILTIN}.ready", f"{BUILTIN}.missing"
#: The parameter that says in which time zone the clock is read.
TIME_ZONE = "time_zone"
#: The parameter that limits the lists of requests, and what it is where nobody says otherwise.
MAX_TARGETS, DEFAULT_MAX_TARGETS = "max_targets", 1000

PLUGIN = Plugin(
    name=BUILTIN,
    doc="What the engine itself offers.",
    operations={
        "ready": Operation(
            doc="Wait until the servers and topics of all plugins that the loaded missions use are there.",
            on_hold=OnHold.FINISH,
            mock=Mock(after=0.0),
        )
    },
    values={
        MISSING: LiveValue(
            "the servers and topics that the plugins of the loaded missions wait for; empty: all are there",
            list_of(TEXT),
        )
    },
    parameters={
        TIME_ZONE: Parameter(ZONE, "UTC", "zone of `at` and of the clock, such as Europe/Amsterdam"),
        MAX_TARGETS: Parameter(
            COUNT, DEFAULT_MAX_TARGETS, "how many elements a list of a mission's request may have", minimum=1
        ),
    },
)


def is_builtin(operation: str) -> bool:
    """Say whether the engine itself offers an operation, by its full name."""
    return operation.partition(".")[0] == BUILTIN
