"""From the parameters of the node to the backend that they choose."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_bridge import greenhouse, mqtt, recorded
from lupin_bridge.backend import Backend, Clocks, Sensors, Tell
from lupin_bridge.catalog import BACKENDS
from lupin_engine.errors import LupinError, Severity, nearest
from lupin_engine.world import layout

Parameters = Mapping[str, Any]


def make_backend(parameters: Parameters, clocks: Clocks, tell: Tell) -> Backend:
    """Return the backend that the node's parameters choose; `tell` gets what people should know of it.

    Raises:
        LupinError: a parameter cannot be used; the text names it.
    """
    name = parameters["backend"]
    if name not in _MAKERS:
        raise LupinError(f"unknown backend {name!r}; {nearest(name, BACKENDS)}")
    return _MAKERS[name](parameters, clocks, tell)


def _layout(parameters: Parameters) -> str:
    """Return the layout file: every node must load the same, whatever it is called."""
    return str(parameters["tag_file"] or parameters["tag_locations_file"])


def _sensors(parameters: Parameters) -> Sensors | None:
    """Return the sensors of every tag of the layout; None without one, when any tag may have any sensor."""
    file = _layout(parameters)
    if not file:
        return None
    known = layout.load(file, "tag_file" if parameters["tag_file"] else "tag_locations_file")
    return {tag_id: tag.sensors for tag_id, tag in known.tags.items()}


def _simulator(parameters: Parameters, clocks: Clocks, tell: Tell) -> Backend:
    backend = greenhouse.Greenhouse(
        greenhouse.Settings(
            tag_file=_layout(parameters),
            sim_config_file=parameters["sim_config_file"],
            debug_time_of_day=parameters["debug_time_of_day"],
            debug_seed=parameters["debug_seed"],
            speedup_factor=parameters["speedup_factor"],
        ),
        clocks,
    )
    for tag, sensors in backend.unmeasurable().items():
        tell(Severity.WARN, f"tag {tag} cannot be read: no climate for its sensors {', '.join(sensors)}")
    return backend


def _recorded(parameters: Parameters, clocks: Clocks, _: Tell) -> Backend:
    settings = recorded.Settings(
        file=parameters["recording_file"],
        clock=parameters["recording_clock"],
        max_age=parameters["max_age"],
        fixed_hour=parameters["debug_time_of_day"],
        speed=parameters["speedup_factor"] or 1.0,
    )
    return recorded.Recorded(settings, _sensors(parameters), clocks)


def _mqtt(parameters: Parameters, _: Clocks, tell: Tell) -> Backend:
    settings = mqtt.Settings(
        host=parameters["mqtt_host"],
        port=parameters["mqtt_port"],
        topic=parameters["mqtt_topic"],
        max_age=parameters["max_age"],
        tls=parameters["mqtt_tls"],
        ca_file=parameters["mqtt_ca_file"],
        certificate_file=parameters["mqtt_certificate_file"],
        key_file=parameters["mqtt_key_file"],
        credentials_file=parameters["mqtt_credentials_file"],
    )
    # Real sensors know no simulated time.
    return mqtt.Mqtt(settings, _sensors(parameters), tell)


_MAKERS: Mapping[str, Callable[[Parameters, Clocks, Tell], Backend]] = {
    "simulator": _simulator,
    "recorded": _recorded,
    "mqtt": _mqtt,
}
