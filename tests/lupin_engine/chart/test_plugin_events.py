"""Events of plugins: declared as data, verified like everything else, told through the outlet."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.errors import PluginError
from lupin_engine.plugin.contract import EventKind, Plugin
from lupin_engine.plugin.registry import RESERVED_EVENTS, Catalog, build_catalog
from lupin_engine.plugin.types import DURATION, POSE, TEXT


def test_a_catalog_names_events_in_full(catalog: Catalog) -> None:
    """As operations and actions are."""
    assert {name: dict(kind.fields) for name, kind in catalog.events.items()} == {
        "nav.battery_silent": {"source": TEXT},
        "nav.blocked": {"where": POSE, "seconds": DURATION},
    }


@pytest.mark.parametrize(
    ("events", "reason"),
    [
        ({"Door": EventKind("D.")}, "event 'Door': the name must be lower case"),
        ({"door.open": EventKind("D.")}, "event 'door.open': the name must be lower case"),
        ({"door": EventKind("D.", {"How": POSE})}, "event 'door': the field 'How' must be lower case"),
        ({"door": EventKind("D.", {"how": "pose"})}, "event 'door': the field 'how' must have a Type"),  # type: ignore[dict-item]
    ],
)
def test_an_event_that_no_mission_could_read_is_refused(events: dict[str, Any], reason: str) -> None:
    """Named, with the reason."""
    with pytest.raises(PluginError, match=reason):
        build_catalog([Plugin("hand", "A hand.", events=events)])


@pytest.mark.parametrize("name", sorted(RESERVED_EVENTS))
def test_no_plugin_is_called_as_the_engines_events_are(name: str) -> None:
    """Its events could not be told from them."""
    with pytest.raises(PluginError, match=f"plugin '{name}': its name is a word of the language"):
        build_catalog([Plugin(name, "A plugin.")])
