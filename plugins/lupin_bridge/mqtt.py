"""The backend of a real greenhouse's sensors over MQTT: subscribes only, and opens no port.

The MQTT library's thread keeps the connection: a missing broker is retried with growing pauses, and values
are served until they are too old. Unusable messages are dropped, counted, and reported once for each topic
and reason, up to `MAX_REPORTED`. Retained messages need a stamp that is not of the future, else they are
refused: their age is unknown.
"""

from __future__ import annotations

import os
import re
import ssl
import stat
import sys
import threading
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lupin_bridge.backend import (
    REAL_CLOCKS,
    Clocks,
    ReadingFailed,
    Report,
    Sensors,
    TagValues,
    fresh_only,
    unknown_tag,
)
from lupin_bridge.latest import Latest
from lupin_bridge.stamps import time_of_day
from lupin_bridge.topics import Rejected, SensorSample, Template, samples
from lupin_bridge.units import given_units
from lupin_engine.errors import LupinError, Problems, Severity, shortened

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage

PORT, TLS_PORT = 1883, 8883

#: Where user and password are looked for when no file is named.
USER, PASSWORD = "LUPIN_MQTT_USER", "LUPIN_MQTT_PASSWORD"

#: Seconds without a word after which the broker is asked whether it is there; half as long again is the end.
KEEPALIVE_S = 30

#: Seconds that an attempt to connect may take, and the leave.
CONNECTING_S, CLOSING_S = 5.0, 2.0

#: Values are delivered at least once while the connection stands.
_QOS = 1

#: Seconds that a clock may be ahead before its stamps say nothing about the age of what the broker has kept.
AHEAD_S = 60.0

#: Characters that no host has: the setting is a URL.
_NO_HOST = re.compile(r"[/\s]")

#: The most topics whose mistakes are reported one by one.
MAX_REPORTED = 100


@dataclass(frozen=True)
class MqttSettings:
    """Broker, topics and credentials; `port` 0 is the usual one.

    `units` are `SENSOR=UNIT` of sensors whose messages have no unit. `max_age` is in seconds; `retry` is the
    first and the longest pause between attempts to connect, in seconds.
    """

    host: str = "localhost"
    port: int = 0
    topic: str = "greenhouse/{tag}/{sensor}"
    units: tuple[str, ...] = ()
    max_age: float = 900.0
    tls: bool = False
    ca_file: str = ""
    certificate_file: str = ""
    key_file: str = ""
    credentials_file: str = ""
    retry: tuple[int, int] = (1, 30)


def check(settings: MqttSettings) -> None:
    """Check the settings, without a connection.

    Raises:
        LupinError: all errors; also that the library is not installed.
    """
    client = _new_client()
    problems = Problems()
    with problems.collecting():
        Template(settings.topic)
    with problems.collecting():
        given_units(settings.units)
    with problems.collecting():
        _aim(client, settings)
    with problems.collecting():
        _credentials(settings.credentials_file)
    with problems.collecting():
        _secure(client, settings)
    problems.raise_any()


class Mqtt:
    """The sensors behind a broker.

    Raises:
        LupinError: a setting cannot be used, or the library is not installed. An absent broker is no error.
    """

    def __init__(
        self, settings: MqttSettings, sensors: Sensors | None, report: Report, clocks: Clocks = REAL_CLOCKS
    ) -> None:
        """`sensors` are those of a layout, and only they are served; without one every sensor is."""
        check(settings)
        self._settings = settings
        self._sensors = sensors
        self._report = report
        self._clocks = clocks
        self._template = Template(settings.topic)
        self._units = given_units(settings.units)
        self._latest = Latest(clocks)
        self._connection = ""
        self._reported: set[tuple[str, str]] = set()
        #: How many messages could not be used, by the reason.
        self.rejected: Counter[str] = Counter()
        self._broker = f"{settings.host}:{_port(settings)}"
        self._client = self._connected()

    # --- what the bridge asks

    @property
    def tags(self) -> tuple[str, ...]:
        """All tags of the layout; without one, those with a value."""
        return self._latest.tags() if self._sensors is None else tuple(self._sensors)

    def read(self, tag_id: str) -> TagValues:
        """Return the latest values of a tag that are not too old; raises as `Backend.read` does."""
        heard = self._latest.of(tag_id)
        if self._sensors is None:
            if not heard and self._connection:
                raise ReadingFailed(f"tag {shortened(tag_id)!r}: {self._connection}")
            expected = tuple(heard)
        else:
            expected = self._sensors.get(tag_id, ())
        if not heard and tag_id not in self.tags:
            where = "the topics told of" if self._sensors is None else "the layout has"
            raise unknown_tag(tag_id, len(self.tags), where)
        found = [heard[sensor] for sensor in expected if sensor in heard]
        absent = [sensor for sensor in expected if sensor not in heard]
        try:
            values = fresh_only(tag_id, found, absent, self._settings.max_age)
        except ReadingFailed as error:
            raise ReadingFailed("; ".join(filter(None, (str(error), self._connection)))) from None
        return TagValues(time_of_day(self._clocks.wall()), values)

    def close(self) -> None:
        """Disconnect, and report the number of unusable messages."""
        self._client.on_disconnect = None
        self._client.disconnect()
        # A thread that looks for a host that does not answer is not waited for; it ends with the process.
        stopping = threading.Thread(target=self._client.loop_stop, daemon=True)
        stopping.start()
        stopping.join(CLOSING_S)
        if self.rejected:
            counts = ", ".join(f"{number} {kind}" for kind, number in sorted(self.rejected.items()))
            self._report(Severity.INFO, f"messages that could not be used: {counts}")

    # --- the connection; what follows runs on the library's thread

    def _connected(self) -> Client:
        client = _new_client()
        client.on_connect = self._on_connect
        client.on_connect_fail = self._on_connect_fail
        client.on_disconnect = self._on_disconnect
        client.on_subscribe = self._on_subscribe
        client.on_message = self._on_message
        client.connect_timeout = CONNECTING_S
        client.reconnect_delay_set(*self._settings.retry)
        _aim(client, self._settings)
        self._identify(client)
        _secure(client, self._settings)
        self._note(Severity.INFO, f"no connection yet to the broker at {self._broker}")
        client.loop_start()
        return client

    def _identify(self, client: Client) -> None:
        user, password = _credentials(self._settings.credentials_file)
        if user:
            client.username_pw_set(user, password)
        local = self._settings.host in ("localhost", "127.0.0.1", "::1")
        if password and not self._settings.tls and not local:
            text = "the MQTT password goes over the network in clear: set mqtt_tls"
            self._report(Severity.WARN, text)

    def _note(self, severity: Severity, connection: str) -> None:
        """Store the state of the connection ('': connected), and report a change."""
        if connection != self._connection:
            self._connection = connection
            self._report(severity, connection or f"connected to the broker at {self._broker}")

    def _on_connect(self, client: Client, _: Any, __: Any, reason: Any, ___: Any) -> None:
        if not reason.is_failure:
            client.subscribe(self._template.filter, _QOS)  # anew each time: the broker may have forgotten
            return
        hint = ""
        if str(reason) in ("Not authorized", "Bad user name or password"):
            hint = f"; set {USER} and {PASSWORD}, or mqtt_credentials_file"
        self._note(Severity.ERROR, f"the broker at {self._broker} refuses us: {reason}{hint}")

    def _on_connect_fail(self, _: Client, __: Any) -> None:
        # The library calls this while it handles the exception, and does not hand it over.
        error = sys.exc_info()[1]
        reason = getattr(error, "strerror", None) or error
        text = f"the broker at {self._broker} cannot be reached ({reason}); it is tried again"
        self._note(Severity.WARN, text)

    def _on_disconnect(self, _: Client, __: Any, ___: Any, ____: Any, _____: Any) -> None:
        if not self._connection:
            text = f"the connection to the broker at {self._broker} is lost; it is tried again"
            self._note(Severity.WARN, text)

    def _on_subscribe(self, _: Client, __: Any, ___: Any, reasons: Any, ____: Any) -> None:
        if any(reason.is_failure for reason in reasons):
            text = f"the broker at {self._broker} does not let us listen to {self._template.filter}"
            self._note(Severity.ERROR, text)
        else:
            self._note(Severity.INFO, "")

    # --- messages

    def _on_message(self, _: Client, __: Any, message: MQTTMessage) -> None:
        try:
            topic = message.topic
        except UnicodeDecodeError:
            self._reject("", Rejected("topic is not UTF-8"))
            return
        try:
            self._take(topic, message)
        except Rejected as reason:
            self._reject(topic, reason)

    def _take(self, topic: str, message: MQTTMessage) -> None:
        tag, sensor = self._template.names(topic)
        own = None if self._sensors is None else self._sensors.get(tag, ())
        if own is not None and sensor not in (*own, ""):
            raise Rejected("not in the layout")
        found, wrong = samples(bytes(message.payload), sensor, own, self._units)
        for reason in wrong:
            self._reject(topic, reason)
        for sample in found:
            if message.retain:
                self._refuse_ageless(sample)
            if not self._latest.put(tag, sample):
                raise Rejected("too many tags or sensors")

    def _refuse_ageless(self, sample: SensorSample) -> None:
        """Raise Rejected for a retained message of unknown age: it would look new at each connection."""
        if sample.stamp is None:
            raise Rejected("retained, but without a stamp", "nobody knows how old it is")
        if sample.stamp > self._clocks.wall() + AHEAD_S:
            raise Rejected("retained, with a stamp of the future", "one of two clocks is wrong")

    def _reject(self, topic: str, reason: Rejected) -> None:
        """Count an unusable message; each reason is reported once for each topic."""
        self.rejected[reason.kind] += 1
        if (reason.kind, topic) not in self._reported and len(self._reported) < MAX_REPORTED:
            self._reported.add((reason.kind, topic))
            self._report(Severity.WARN, f"message on {shortened(topic)!r} not used: {reason}")


def _new_client() -> Client:
    try:
        from paho.mqtt import client as mqtt
        from paho.mqtt.enums import CallbackAPIVersion
    except ImportError as error:
        raise LupinError("the MQTT library is not installed: pip install 'lupin-engine[mqtt]'") from error
    return mqtt.Client(CallbackAPIVersion.VERSION2)


def _port(settings: MqttSettings) -> int:
    return settings.port or (TLS_PORT if settings.tls else PORT)


def _aim(client: Client, settings: MqttSettings) -> None:
    """Set the broker's address; the client connects once its loop runs. LupinError: it is no address."""
    host, port = settings.host, _port(settings)
    if _NO_HOST.search(host) or host.count(":") == 1:  # an address of IPv6 has more
        hint = "expected a name or an address, such as broker.local; the port goes into mqtt_port"
        raise LupinError(f"mqtt_host {host!r}: {hint}")
    try:
        host.encode("idna")  # what the library does later, on its thread, where it would end it
        client.connect_async(host, port, KEEPALIVE_S)
    except (UnicodeError, ValueError) as error:
        raise LupinError(f"mqtt_host {host!r}, port {port}: {error}") from None


def _secure(client: Client, settings: MqttSettings) -> None:
    """Set up TLS where that is wanted.

    Raises:
        LupinError: a file is given and not used, is missing, or is of another kind; the text names it.
    """
    given = {
        "mqtt_ca_file": settings.ca_file,
        "mqtt_certificate_file": settings.certificate_file,
        "mqtt_key_file": settings.key_file,
    }
    files = {name: file for name, file in given.items() if file}
    if not settings.tls:
        for name in files:
            raise LupinError(f"{name} is given, but mqtt_tls is not set")
        return
    paths = {name: os.path.expanduser(file) for name, file in files.items()}
    for name, path in paths.items():
        if not Path(path).is_file():
            raise LupinError(f"{name}: file {files[name]} does not exist")
    try:
        authority, certificate, key = map(paths.get, given)
        client.tls_set(authority, certificate, key)
    except (ssl.SSLError, ValueError, OSError) as error:
        used = ", ".join(f"{name} {file}" for name, file in files.items()) or "the system's authorities"
        raise LupinError(f"TLS cannot use {used}: {error}") from None


def _credentials(file: str, environment: Mapping[str, str] = os.environ) -> tuple[str, str | None]:
    """Return user and password: of the file, one a line, else of the environment; '' and None where unset.

    Raises:
        LupinError: the file cannot be used.
    """
    if not file:
        return environment.get(USER, ""), environment.get(PASSWORD)
    path = Path(os.path.expanduser(file))
    try:
        if path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise LupinError(f"mqtt_credentials_file {file} can be read by others: chmod 600 {file}")
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise LupinError(f"mqtt_credentials_file {file}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise LupinError(f"mqtt_credentials_file {file} is not in UTF-8") from None
    if len(lines) != 2 or not all(lines):
        raise LupinError(f"mqtt_credentials_file {file}: expected two lines, the user and the password")
    return lines[0], lines[1]
