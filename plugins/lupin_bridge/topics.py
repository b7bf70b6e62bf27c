"""Parses topics and payloads of MQTT sensors to samples of tags. Pure.

A topic template is such as `greenhouse/{tag}/{sensor}`. The payload is a number, or a JSON object with
`value` and optionally `unit` and `stamp`. Without `{sensor}` a message has several sensors of a tag: a JSON
object with a number for each, and optionally `stamp`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from lupin_bridge.stamps import seconds_since_1970
from lupin_bridge.units import QUANTITIES, checked, units_that_fit
from lupin_engine.errors import LupinError, shortened

#: The largest payload, in bytes.
MAX_PAYLOAD = 4096
#: Names of tags and sensors are no longer than this.
MAX_NAME = 64

_PLACEHOLDER = re.compile(r"\{(\w*)\}")
#: What C's printf writes for what is no number; JSON has no word for it.
_NO_NUMBER = re.compile(r"(?<=[:,\[\s])[-+]?(?:nan|inf(?:inity)?)(?=\s*[,}\]])", re.IGNORECASE)
_NAME = re.compile(rf"[^\s/+#\x00-\x1f\x7f]{{1,{MAX_NAME}}}")


class Rejected(ValueError):
    """An unusable message; `kind` is the reason in fixed words, by which they are counted."""

    def __init__(self, kind: str, detail: str = "") -> None:
        super().__init__(f"{kind}: {detail}" if detail else kind)
        self.kind = kind


@dataclass(frozen=True)
class SensorSample:
    """A value in the unit of its sensor; `stamp` is when it was measured, if the message has it."""

    sensor: str
    value: float
    stamp: float | None = None


class Template:
    """A topic template.

    Raises:
        LupinError: the text is no valid template.
    """

    def __init__(self, text: str) -> None:
        names = _PLACEHOLDER.findall(text)
        if sorted(names) not in (["tag"], ["sensor", "tag"]):
            raise LupinError(
                f"mqtt_topic {text!r}: expected {{tag}} once, and {{sensor}} at most once,"
                " such as greenhouse/{tag}/{sensor}"
            )
        if re.search(r"[+#\x00]", text):
            raise LupinError(
                f"mqtt_topic {text!r}: wildcards are made of {{tag}} and {{sensor}}; leave + and # out"
            )
        levels = text.split("/")
        self.text = text
        #: What to subscribe to.
        self.filter = "/".join("+" if _PLACEHOLDER.search(level) else level for level in levels)
        # Split keeps the names of the placeholders at the odd places.
        parts = _PLACEHOLDER.split(text)
        self._topic = re.compile(
            "".join(f"(?P<{part}>[^/]+?)" if i % 2 else re.escape(part) for i, part in enumerate(parts))
        )

    def names(self, topic: str) -> tuple[str, str]:
        """Return tag and sensor of a topic; the sensor is '' where the template has none.

        Raises:
            Rejected: the topic does not match, or a name is invalid.
        """
        match = self._topic.fullmatch(topic)
        if match is None:
            raise Rejected("topic of another form")
        found = match.groupdict()
        for name in found.values():
            if not _NAME.fullmatch(name):
                raise Rejected("no name of a tag or sensor", repr(shortened(name)))
        return found["tag"], found.get("sensor", "")


def samples(
    payload: bytes,
    sensor: str,
    allowed: Iterable[str] | None = None,
    units: Mapping[str, str] = MappingProxyType({}),
) -> tuple[list[SensorSample], list[Rejected]]:
    """Parse a payload: of one `sensor`, or, where that is '', of the `allowed` sensors that it names.

    `units` are those of sensors whose messages have none; the others then use the bridge's own unit. Returns
    the samples, and why other values were rejected; with `sensor` '' all may be.

    Raises:
        Rejected: the payload is unreadable or names no sensor, or the value of `sensor` is unusable.
    """
    data = _decoded(payload)
    if sensor:
        return [_one(data, sensor, units.get(sensor, ""))], []
    if not isinstance(data, dict):
        raise Rejected("no JSON object", "the topic has no {sensor}, so the payload must name them")
    stamp = _stamp(data)
    found: list[SensorSample] = []
    wrong: list[Rejected] = []
    for name in QUANTITIES if allowed is None else allowed:
        try:
            if data.get(name) is not None:  # gateways write null for what they do not know
                found.append(SensorSample(name, _checked(name, data[name], units.get(name, "")), stamp))
        except Rejected as reason:
            wrong.append(reason)
    if not found and not wrong:
        raise Rejected("no sensor in it")
    return found, wrong


def _one(data: object, sensor: str, usual: str) -> SensorSample:
    if not isinstance(data, dict):
        return SensorSample(sensor, _checked(sensor, data, usual))
    if "value" not in data:
        raise Rejected("no 'value' in it")
    unit = data.get("unit", usual)
    if not isinstance(unit, str):
        raise Rejected("unit is no text")
    return SensorSample(sensor, _checked(sensor, data["value"], unit), _stamp(data))


def _decoded(payload: bytes) -> object:
    if len(payload) > MAX_PAYLOAD:
        raise Rejected("payload too long", f"{len(payload)} bytes, at most {MAX_PAYLOAD}")
    try:
        text = payload.decode("utf-8")
    except UnicodeDecodeError:
        raise Rejected("payload is not UTF-8") from None
    try:
        # Whole numbers as well become floats, infinite if need be: Python's own are without bounds.
        try:
            return json.loads(text, parse_int=float)
        except ValueError:
            return json.loads(_NO_NUMBER.sub("null", text), parse_int=float)
    except (ValueError, RecursionError):
        raise Rejected("payload is neither a number nor JSON", repr(shortened(text))) from None


def _checked(sensor: str, value: object, unit: str) -> float:
    if not isinstance(value, float):
        raise Rejected("value is no number", shortened(repr(value)))
    try:
        return checked(sensor, value, unit)
    except ValueError as error:
        others = [] if unit else units_that_fit(sensor, value)
        hint = f"; if it is in {others[0]}, write {sensor}={others[0]} into mqtt_units" if others else ""
        raise Rejected("value cannot be", f"{error}{hint}") from None


def _stamp(data: dict[str, object]) -> float | None:
    written = data.get("stamp")
    if written is None:
        return None
    if not isinstance(written, (str, float)):
        raise Rejected("stamp is no time", shortened(repr(written)))
    try:
        return seconds_since_1970(written)
    except ValueError as error:
        raise Rejected("stamp is no time", str(error)) from None
