"""Converts between the engine's data, a profile's data, and ROS messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from lupin_engine.errors import LupinError
from lupin_engine.plugin import Code, Fields, Profile, Situation, Wire, classify
from lupin_ros.interfaces.definitions import element_of

if TYPE_CHECKING:
    from lupin_engine.machine import View


def wire_of(profile: Profile) -> Wire:
    """Return a profile's wire format.

    Raises:
        LupinError: it has none.
    """
    if profile.wire is None:
        what = f"the profile {profile.name!r} has no wire" if profile.name else "no profile is installed"
        raise LupinError(f"{what}: its missions can be simulated, but not run")
    return profile.wire


def situation(
    view: View,
    codes: Mapping[str, Code],
    request: Mapping[str, Any],
    value: Callable[[str], Any],
    started: Fields | None,
    stamp: Fields,
) -> Situation:
    """Return the data for a state message; `codes` are the declared ones.

    `started` is when the mission was accepted, by the same clock as `stamp`; the view's own time is the
    loop's and means nothing to others.
    """
    code = classify(view.code, codes)
    return Situation(
        mission=view.mission,
        mission_id=view.mission_id,
        lifecycle=view.lifecycle,
        phase=view.phase,
        target=view.target,
        total=view.total,
        counts=view.counts,
        code=view.code,
        detail=view.detail,
        label=code.label,
        severity=code.severity,
        paused=view.paused,
        request=request,
        value=value,
        started=started,
        stamp=stamp,
    )


def write(message: Any, fields: Fields) -> Any:
    """Write plain data into a message; fields that are not named keep their values."""
    types = message.get_fields_and_field_types()
    for name, value in fields.items():
        declared = types[name]
        if isinstance(value, Mapping):
            write(getattr(message, name), value)
        elif isinstance(value, (list, tuple)) and value and isinstance(value[0], Mapping):
            setattr(message, name, [write(element_of(declared), each) for each in value])
        else:
            setattr(message, name, bytes([value]) if declared == "octet" else value)
    return message


def read(message: Any) -> Any:
    """Return a message as dictionaries, lists and scalars."""
    if hasattr(message, "get_fields_and_field_types"):
        return {name: read(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if isinstance(message, bytes):
        return message[0]  # an octet
    if isinstance(message, str) or not hasattr(message, "__iter__"):
        return message
    return [read(element) for element in message]


def visit_record(visit: Mapping[str, Any], profile: Profile) -> dict[str, Any]:
    """Return the log's record of a target at the end: outcome, tries, and the reading or the reason."""
    words = profile.terminal
    record = {
        words.target: visit["target"],
        "status": visit["status"] or "open",
        "tries": dict(visit["tries"]),
    }
    if profile.is_good(visit["status"]):
        return {**record, words.read: list(profile.values_of(visit["reading"] or {}))}
    return {**record, "reason": visit["detail"] or visit["code"] or "?"}
