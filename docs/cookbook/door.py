"""A plugin for the cookbook: it tells when somebody opens the door of the greenhouse."""

from lupin_engine.plugin import TEXT, EventKind, Plugin

PLUGIN = Plugin(
    name="door",
    doc="The door of the greenhouse.",
    events={"opened": EventKind("Somebody opened the door.", {"who": TEXT})},
)
