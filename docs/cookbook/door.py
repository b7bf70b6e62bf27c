"""A plugin for the cookbook: it tells when somebody opens the door of the greenhouse."""

from lupin_engine.plugin.contract import EventKind, Plugin
from lupin_engine.plugin.types import TEXT

PLUGIN = Plugin(
    name="door",
    doc="The door of the greenhouse.",
    events={"opened": EventKind("Somebody opened the door.", {"who": TEXT})},
)
