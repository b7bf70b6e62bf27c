"""Makes the backend that the node's parameters select, and checks them without a connection."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_bridge import greenhouse, mqtt, recorded
from lupin_bridge.backend import REAL_CLOCKS, Backend, Clocks, Report, Sensors
from lupin_bridge.recording import load_recording
from lupin_engine.errors import Problems, Severity
from lupin_greenhouse import layout

Parameters = Mapping[str, Any]


def make_backend(parameters: Parameters, clocks: Clocks, report: Report) -> Backend:
    """Return the selected backend; `report` gets its messages for people.

    Raises:
        LupinError: a parameter cannot be used; the text names it.
    """
    return _MAKERS[parameters["backend"]](parameters, clocks, report)


def check(parameters: Parameters) -> None:
    """Check that the parameters make a backend, without a connection.

    Raises:
        LupinError: all errors.
    """
    _CHECKS[parameters["backend"]](parameters)


def _layout(parameters: Parameters) -> str:
    """Return the layout file of the parameters."""
    return str(parameters["tag_file"] or parameters["tag_locations_file"])


def _sensors(parameters: Parameters) -> Sensors | None:
    """Return the sensors of every tag of the layout; None without one, when any tag may have any sensor."""
    file = _layout(parameters)
    if not file:
        return None
    known = layout.load(file, "tag_file" if parameters["tag_file"] else "tag_locations_file")
    return {tag_id: tag.sensors for tag_id, tag in known.tags.items()}


def _simulator(parameters: Parameters, clocks: Clocks, report: Report) -> Backend:
    backend = _greenhouse(parameters, clocks)
    for tag, sensors in backend.unmeasurable().items():
        report(Severity.WARN, f"tag {tag} cannot be read: no climate for its sensors {', '.join(sensors)}")
    return backend


def _greenhouse(parameters: Parameters, clocks: Clocks = REAL_CLOCKS) -> greenhouse.Greenhouse:
    settings = greenhouse.SimulatorSettings(
        tag_file=_layout(parameters),
        sim_config_file=parameters["sim_config_file"],
        debug_time_of_day=parameters["debug_time_of_day"],
        debug_seed=parameters["debug_seed"],
        speedup_factor=parameters["speedup_factor"],
    )
    return greenhouse.Greenhouse(settings, clocks)


def _recorded(parameters: Parameters, clocks: Clocks, _: Report) -> Backend:
    settings = recorded.ReplaySettings(
        file=parameters["recording_file"],
        clock=parameters["recording_clock"],
        max_age=parameters["max_age"],
        fixed_hour=parameters["debug_time_of_day"],
        speed=parameters["speedup_factor"] or 1.0,
    )
    return recorded.Recorded(settings, _sensors(parameters), clocks)


def _check_recorded(parameters: Parameters) -> None:
    problems = Problems()
    with problems.collecting():
        _sensors(parameters)
    with problems.collecting():
        load_recording(parameters["recording_file"])
    problems.raise_any()


def _mqtt(parameters: Parameters, _: Clocks, report: Report) -> Backend:
    # Real sensors know no simulated time.
    return mqtt.Mqtt(_broker(parameters), _sensors(parameters), report)


def _check_mqtt(parameters: Parameters) -> None:
    problems = Problems()
    with problems.collecting():
        _sensors(parameters)
    with problems.collecting():
        mqtt.check(_broker(parameters))
    problems.raise_any()


def _broker(parameters: Parameters) -> mqtt.MqttSettings:
    return mqtt.MqttSettings(
        host=parameters["mqtt_host"],
        port=parameters["mqtt_port"],
        topic=parameters["mqtt_topic"],
        units=tuple(parameters["mqtt_units"]),
        max_age=parameters["max_age"],
        tls=parameters["mqtt_tls"],
        ca_file=parameters["mqtt_ca_file"],
        certificate_file=parameters["mqtt_certificate_file"],
        key_file=parameters["mqtt_key_file"],
        credentials_file=parameters["mqtt_credentials_file"],
    )


_MAKERS: Mapping[str, Callable[[Parameters, Clocks, Report], Backend]] = {
    "simulator": _simulator,
    "recorded": _recorded,
    "mqtt": _mqtt,
}

_CHECKS: Mapping[str, Callable[[Parameters], object]] = {
    "simulator": _greenhouse,
    "recorded": _check_recorded,
    "mqtt": _check_mqtt,
}
