"""The sensors behind a real broker, which is absent, killed, started again, and picky about who comes in."""

from __future__ import annotations

import itertools
import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed here")

from lupin_bridge import mqtt
from lupin_bridge.backend import ReadingFailed, UnknownTag
from lupin_bridge.backend import Sensors as Layout
from lupin_bridge.mqtt import PASSWORD, USER, Mqtt, MqttSettings
from lupin_engine.errors import LupinError, Severity
from tests.broker import PATIENCE, Broker, Sensors, free_port, mosquitto, sockets_of

LAYOUT = {"7": ("temperature", "humidity"), "9": ("co2",)}
QUICK = (1, 1)
FENCES = itertools.count()


class Listener:
    """A backend whose words can be waited for."""

    def __init__(self, port: int, sensors: Layout | None = None, **settings: Any) -> None:
        self.told: list[tuple[Severity, str]] = []
        self._news = threading.Condition()
        given = {"host": "127.0.0.1", "port": port, "retry": QUICK, **settings}
        self.backend = Mqtt(MqttSettings(**given), sensors, self._tell)

    def _tell(self, severity: Severity, text: str) -> None:
        with self._news:
            self.told.append((severity, text))
            self._news.notify_all()

    def until(self, said: str, times: int = 1) -> str:
        """Wait until something with these words was told so often; return the last of it."""

        def found() -> list[str]:
            return [text for _, text in self.told if said in text]

        with self._news:
            assert self._news.wait_for(lambda: len(found()) >= times, PATIENCE), f"{said!r}: {self.told}"
        return found()[-1]

    def count(self, said: str) -> int:
        return sum(said in text for _, text in self.told)

    def values(self, tag: str = "7") -> dict[str, float]:
        return {one.sensor: one.value for one in self.backend.read(tag).sensors}


class Sender(Sensors):
    """Somebody who publishes; `send` returns when the listener has got everything that was sent before."""

    def send(self, listener: Listener, *messages: tuple[str, Any]) -> None:
        for topic, payload in messages:
            self.publish(topic, payload)
        fence = f"greenhouse/fence/{next(FENCES)}"  # a message that is told about, and comes last
        self.publish(fence, "")
        listener.until(fence)


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    broker = Broker(tmp_path)
    yield broker
    broker.kill()


@pytest.fixture
def listen() -> Iterator[Callable[..., Listener]]:
    """Make listeners (arguments as for `Listener`), which are closed after the test."""
    made: list[Listener] = []

    def make(*arguments: Any, **named: Any) -> Listener:
        made.append(Listener(*arguments, **named))
        return made[-1]

    yield make
    for listener in made:
        listener.backend.close()


@contextmanager
def sender(broker: Broker) -> Iterator[Sender]:
    made = Sender(broker.port)
    try:
        yield made
    finally:
        made.close()


Listen = Callable[..., Listener]


@pytest.mark.broker
class TestWithABroker:
    """Everything over a real connection."""

    def test_each_tag_has_its_own_sensors(self, broker: Broker, listen: Listen) -> None:
        listener = listen(broker.start().port, LAYOUT)
        listener.until("connected to the broker at")
        with sender(broker) as sensors:
            sensors.send(
                listener,
                ("greenhouse/7/humidity", "61"),
                ("greenhouse/7/temperature", '{"value": 294.65, "unit": "K"}'),
                ("greenhouse/7/co2", "400"),
                ("greenhouse/8/co2", "400"),
            )
        assert listener.backend.tags == ("7", "9")
        assert listener.values() == {"temperature": pytest.approx(21.5), "humidity": 61.0}
        assert listener.backend.rejected["not in the layout"] == 3  # and the fence
        assert 0.0 <= listener.backend.read("7").time_of_day < 86400.0
        assert all(one.age < PATIENCE for one in listener.backend.read("7").sensors)

    def test_what_was_never_heard_is_no_reading(self, broker: Broker, listen: Listen) -> None:
        listener = listen(broker.start().port, LAYOUT)
        listener.until("connected to the broker at")
        with sender(broker) as sensors:
            sensors.send(listener, ("greenhouse/7/humidity", "61"))
        assert listener.values() == {"humidity": 61.0}
        with pytest.raises(ReadingFailed) as refused:
            listener.backend.read("9")
        assert str(refused.value) == "tag '9': nothing measured in the last 900 s (no co2)"
        with pytest.raises(UnknownTag, match=r"^unknown tag '8'; the layout has 2 tags$"):
            listener.backend.read("8")

    def test_without_a_layout_a_tag_is_what_is_heard(self, broker: Broker, listen: Listen) -> None:
        listener = listen(broker.start().port)
        listener.until("connected to the broker at")
        with pytest.raises(UnknownTag, match=r"^unknown tag '7'; the topics told of 0 tags$"):
            listener.backend.read("7")
        with sender(broker) as sensors:
            sensors.send(listener, ("greenhouse/7/wind", "3"))
        assert listener.backend.tags == ("7",)
        assert listener.values() == {"wind": 3.0}

    def test_one_topic_for_all_sensors_of_a_tag(self, broker: Broker, listen: Listen) -> None:
        listener = listen(broker.start().port, LAYOUT, topic="greenhouse/fence/{tag}")
        listener.until("connected to the broker at")
        with sender(broker) as sensors:
            payload = b'{"temperature": 20, "humidity": 300, "battery": 5}'
            sensors.send(listener, ("greenhouse/fence/7", payload))
        assert listener.values() == {"temperature": 20.0}
        listener.until("value cannot be: 300 % is outside of 0 ... 110 %")

    def test_a_retained_message_is_as_old_as_it_says(self, broker: Broker, listen: Listen) -> None:
        broker.start()
        now = time.time()
        with sender(broker) as sensors:
            for name, value in (
                ("7/temperature", f'{{"value": 20, "stamp": {now - 30}}}'),
                ("7/humidity", f'{{"value": 60, "stamp": {now - 5000}}}'),
                ("9/co2", "400"),
            ):
                sensors.publish(f"greenhouse/{name}", value, retain=True)
            listener = listen(broker.port, LAYOUT)
            listener.until("connected to the broker at")
            sensors.send(listener)
        assert listener.values() == {"temperature": 20.0}
        (value,) = listener.backend.read("7").sensors
        assert value.stamp == pytest.approx(now - 30)
        assert 30.0 <= value.age < 30.0 + PATIENCE
        listener.until(
            "'greenhouse/9/co2' not used: retained, but without a stamp: nobody knows how old it is"
        )
        with pytest.raises(ReadingFailed, match=r"\(no co2\)"):
            listener.backend.read("9")

    def test_a_retained_message_of_the_future_is_of_no_age(self, broker: Broker, listen: Listen) -> None:
        """A robot whose clock is not set yet: what was kept since yesterday would count as new."""
        broker.start()
        now = time.time()
        with sender(broker) as sensors:
            for name, ahead in (("7/temperature", 3600), ("7/humidity", 30)):
                value = f'{{"value": 20, "stamp": {now + ahead}}}'
                sensors.publish(f"greenhouse/{name}", value, retain=True)
            listener = listen(broker.port, LAYOUT)
            listener.until("connected to the broker at")
            sensors.send(listener)
            assert listener.values() == {"humidity": 20.0}
            listener.until("not used: retained, with a stamp of the future: one of two clocks is wrong")
            sensors.send(listener, ("greenhouse/7/temperature", f'{{"value": 21, "stamp": {now + 3600}}}'))
        assert listener.values() == {"temperature": 21.0, "humidity": 20.0}, "what is told just now is of now"

    def test_a_value_that_is_too_old_is_not_served(self, broker: Broker, listen: Listen) -> None:
        listener = listen(broker.start().port, LAYOUT, max_age=600.0)
        listener.until("connected to the broker at")
        with sender(broker) as sensors:
            old = f'{{"value": 20, "stamp": {time.time() - 700}}}'
            sensors.send(listener, ("greenhouse/7/temperature", old))
        with pytest.raises(ReadingFailed) as refused:
            listener.backend.read("7")
        text = str(refused.value)
        assert text.startswith("tag '7': nothing measured in the last 600 s (temperature is 70")
        assert text.endswith(" s old, no humidity)")

    def test_hostile_messages_are_counted_and_told_once_and_change_nothing(
        self, broker: Broker, listen: Listen
    ) -> None:
        hostile = [b"NaN", b"1e999", b"\xff\xfe", b"[" * 4000, b"9" * 100_000, b"{}", b"true", b"", b"500"]
        listener = listen(broker.start().port, LAYOUT)
        listener.until("connected to the broker at")
        topic = "greenhouse/7/temperature"
        with sender(broker) as sensors:
            sensors.send(listener, (topic, "20"), *[(topic, payload) for payload in hostile * 3])
            sensors.send(listener, ("greenhouse/7/x y", "1"), (f"greenhouse/{'7' * 90}/co2", "1"))
            assert listener.values() == {"temperature": 20.0}
            sensors.send(listener, (topic, "22"))
        assert listener.values() == {"temperature": 22.0}
        assert dict(listener.backend.rejected) == {
            "value cannot be": 9,
            "payload is not UTF-8": 3,
            "payload is neither a number nor JSON": 6,
            "payload too long": 3,
            "no 'value' in it": 3,
            "value is no number": 3,
            "no name of a tag or sensor": 2,
            "not in the layout": 3,
        }
        assert listener.count(f"message on '{topic}' not used: value cannot be") == 1
        listener.backend.close()
        assert listener.until("messages that could not be used").startswith(
            "messages that could not be used: 3 no 'value' in it, 2 no name of a tag or sensor, 3 not in"
        )

    def test_names_without_end_have_no_room(
        self, broker: Broker, listen: Listen, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Without a layout any topic could be a tag; those that are known go on."""
        monkeypatch.setattr("lupin_bridge.latest.MAX_TAGS", 1)
        listener = listen(broker.start().port)
        listener.until("connected to the broker at")
        with sender(broker) as sensors:
            sensors.send(listener, ("greenhouse/7/co2", "400"), ("greenhouse/8/co2", "500"))
            sensors.send(listener, ("greenhouse/7/co2", "410"))
        assert (listener.backend.tags, listener.values()) == (("7",), {"co2": 410.0})
        assert listener.count("message on 'greenhouse/8/co2' not used: too many tags or sensors") == 1

    def test_a_broker_that_is_absent_at_the_start_is_waited_for(self, broker: Broker, listen: Listen) -> None:
        listener = listen(broker.port, LAYOUT)
        gone = (
            f"the broker at 127.0.0.1:{broker.port} cannot be reached (Connection refused); it is tried again"
        )
        listener.until(gone)
        with pytest.raises(ReadingFailed) as refused:
            listener.backend.read("9")
        assert str(refused.value) == f"tag '9': nothing measured in the last 900 s (no co2); {gone}"
        broker.start()
        listener.until("connected to the broker at")
        assert listener.count("cannot be reached") == 1

    def test_a_broker_that_is_killed_and_comes_back_is_listened_to_again(
        self, broker: Broker, listen: Listen
    ) -> None:
        """Meanwhile what was heard is served: it is as fresh as it is."""
        listener = listen(broker.start().port, LAYOUT)
        listener.until(f"connected to the broker at 127.0.0.1:{broker.port}")
        with sender(broker) as sensors:
            sensors.send(listener, ("greenhouse/9/co2", "400"))
        broker.kill()
        listener.until("is lost; it is tried again")
        assert listener.values("9") == {"co2": 400.0}
        with pytest.raises(ReadingFailed, match=r"\(no temperature, no humidity\); the (connection|broker)"):
            listener.backend.read("7")
        broker.start()
        listener.until("connected to the broker at 127", times=2)
        with sender(broker) as sensors:
            sensors.send(listener, ("greenhouse/9/co2", "500"))
        assert listener.values("9") == {"co2": 500.0}

    def test_a_broker_that_hangs_is_noticed_and_listened_to_again(
        self, broker: Broker, listen: Listen, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """As with a cable that was pulled: nobody closes the connection, and nothing comes."""
        monkeypatch.setattr("lupin_bridge.mqtt.KEEPALIVE_S", 1)
        listener = listen(broker.start().port, LAYOUT)
        listener.until("connected to the broker at")
        broker.signal(signal.SIGSTOP)
        listener.until("is lost; it is tried again")
        broker.signal(signal.SIGCONT)
        listener.until("connected to the broker at", times=2)
        with sender(broker) as sensors:
            sensors.send(listener, ("greenhouse/9/co2", "500"))
        assert listener.values("9") == {"co2": 500.0}

    def test_a_value_is_delivered_at_least_once(
        self, broker: Broker, listen: Listen, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """What sensors publish with a quality of service of 1 comes with it."""
        qualities: list[int] = []
        take = Mqtt._on_message

        def taken(backend: Mqtt, client: Any, data: Any, message: Any) -> None:
            qualities.append(message.qos)
            take(backend, client, data, message)

        monkeypatch.setattr(Mqtt, "_on_message", taken)
        listener = listen(broker.start().port, LAYOUT)
        listener.until("connected to the broker at")
        with sender(broker) as sensors:
            sensors.send(listener, ("greenhouse/9/co2", "500"))
        assert set(qualities) == {1}

    def test_a_broker_that_wants_a_password(
        self, broker: Broker, listen: Listen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        passwords = tmp_path / "passwords"
        _run_beside_the_broker("mosquitto_passwd", "-b", "-c", str(passwords), "robot", "secret: 7")
        broker.settings = ("allow_anonymous false", f"password_file {passwords}")
        broker.start()
        refusal = (
            f"the broker at 127.0.0.1:{broker.port} refuses us: Not authorized; set LUPIN_MQTT_USER and"
            " LUPIN_MQTT_PASSWORD, or mqtt_credentials_file"
        )
        stranger = listen(broker.port, LAYOUT)
        assert stranger.until("refuses us") == refusal
        with pytest.raises(ReadingFailed, match="refuses us: Not authorized"):
            stranger.backend.read("7")
        monkeypatch.setenv(USER, "robot")
        monkeypatch.setenv(PASSWORD, "wrong")
        mistaken = listen(broker.port, LAYOUT)
        assert mistaken.until("refuses us") == refusal
        monkeypatch.setenv(PASSWORD, "secret: 7")
        known = listen(broker.port, LAYOUT)
        known.until("connected to the broker at")
        monkeypatch.delenv(USER)
        file = tmp_path / "credentials"
        file.write_text("robot\nsecret: 7\n")
        file.chmod(0o600)
        by_file = listen(broker.port, LAYOUT, credentials_file=str(file))
        by_file.until("connected to the broker at")
        told = [text for one in (stranger, mistaken, known, by_file) for _, text in one.told]
        assert not any("secret" in text or "wrong" in text for text in told)

    def test_a_broker_that_lets_nobody_listen_there(
        self, broker: Broker, listen: Listen, tmp_path: Path
    ) -> None:
        """Its file of access rules hides messages and says nothing; its plugin for them refuses."""
        rules = tmp_path / "rules.json"
        rules.write_text('{"defaultACLAccess": {"subscribe": false}}')
        plugin = _library_of_the_broker("mosquitto_dynamic_security.so")
        broker.settings = ("allow_anonymous true", f"plugin {plugin}", f"plugin_opt_config_file {rules}")
        listener = listen(broker.start().port, LAYOUT)
        told = listener.until("does not let us")
        assert told == f"the broker at 127.0.0.1:{broker.port} does not let us listen to greenhouse/+/+"

    # The library leaves the socket of a failed handshake to the garbage collector.
    @pytest.mark.filterwarnings("ignore:Exception ignored in. <ssl.SSLSocket")
    def test_an_encrypted_connection_to_the_right_broker_only(
        self, broker: Broker, listen: Listen, tmp_path: Path
    ) -> None:
        key, certificate = _certificate(tmp_path, "right")
        _, another = _certificate(tmp_path, "another")
        broker.settings = ("allow_anonymous true", f"certfile {certificate}", f"keyfile {key}")
        broker.start()
        right = listen(broker.port, LAYOUT, tls=True, ca_file=str(certificate))
        right.until("connected to the broker at")
        wrong = listen(broker.port, LAYOUT, tls=True, ca_file=str(another))
        assert "certificate verify failed" in wrong.until("cannot be reached")

    def test_the_bridge_only_calls_out(self, broker: Broker, listen: Listen) -> None:
        before = _doors()
        listener = listen(broker.start().port, LAYOUT)
        listener.until("connected to the broker at")
        assert _doors() == before


def _doors() -> set[str]:
    """The sockets of this process that wait for connections."""
    mine = sockets_of(os.getpid())
    rows = [line.split() for name in ("tcp", "tcp6") for line in _table(name)]
    return {row[1] for row in rows if row[3] == "0A" and row[9] in mine}


def _table(name: str) -> list[str]:
    return Path(f"/proc/self/net/{name}").read_text().splitlines()[1:]


def _run_beside_the_broker(program: str, *arguments: str) -> None:
    server, libraries = mosquitto()
    path = Path(server).parents[1] / "bin" / program
    environment = {"LD_LIBRARY_PATH": libraries} if libraries else None
    subprocess.run([str(path), *arguments], env=environment, check=True, capture_output=True)


def _library_of_the_broker(name: str) -> Path:
    found = Path(mosquitto()[0]).parents[1].glob(f"lib/**/{name}")
    return next(found)


def _certificate(folder: Path, name: str) -> tuple[Path, Path]:
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("openssl is not installed")
    key, certificate = folder / f"{name}.key", folder / f"{name}.crt"
    command = [openssl, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", f"/CN={name}"]
    command += ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(command, check=True, capture_output=True)
    return key, certificate


# --- settings


def refused(**settings: Any) -> str:
    """Return what is said of settings."""
    with pytest.raises(LupinError) as error:
        Mqtt(MqttSettings(**settings), None, lambda severity, text: None)
    return str(error.value)


def test_files_that_are_missing_or_useless_are_named(tmp_path: Path) -> None:
    for name in ("ca_file", "certificate_file", "key_file"):
        assert refused(**{name: "x.pem"}) == f"mqtt_{name} is given, but mqtt_tls is not set"
        assert refused(tls=True, **{name: "nowhere"}) == f"mqtt_{name}: file nowhere does not exist"
    rubbish = tmp_path / "rubbish.pem"
    rubbish.write_text("rubbish")
    assert refused(tls=True, ca_file=str(rubbish)).startswith(f"TLS cannot use mqtt_ca_file {rubbish}: ")
    assert refused(topic="x").startswith("mqtt_topic 'x': expected {tag} once")
    assert refused(host="a" * 64).startswith(f"mqtt_host '{'a' * 64}', port 1883: ")
    assert refused(host="").startswith("mqtt_host '', port 1883: ")
    assert refused(host="", tls=True).startswith("mqtt_host '', port 8883: ")
    assert refused(host="", tls=True, port=9).startswith("mqtt_host '', port 9: ")


@pytest.mark.parametrize("host", ["mqtt://broker", "broker:1883", "bro ker", "broker/path"])
def test_a_host_is_a_name_and_no_more(host: str) -> None:
    """Else it would be looked for in vain, again and again."""
    assert refused(host=host) == (
        f"mqtt_host {host!r}: expected a name or an address, such as broker.local; "
        "the port goes into mqtt_port"
    )


def test_everything_that_is_wrong_with_settings_is_told() -> None:
    """At once, and without a connection; an address of the sixth version is none of it."""
    told = refused(topic="x", host="a b", ca_file="ca.pem", credentials_file="nowhere").splitlines()
    assert [line.partition(" ")[0] for line in told] == [
        "mqtt_topic",
        "mqtt_host",
        "mqtt_credentials_file",
        "mqtt_ca_file",
    ]
    assert refused(host="::1", topic="x").splitlines() == [
        "mqtt_topic 'x': expected {tag} once, and {sensor} at most once, such as greenhouse/{tag}/{sensor}"
    ]


@pytest.mark.parametrize(
    ("content", "mode", "told"),
    [
        ("robot\nsecret\n", 0o644, " can be read by others: chmod 600 "),
        ("robot\n", 0o600, ": expected two lines, the user and the password"),
        ("robot\n\n", 0o600, ": expected two lines, the user and the password"),
        ("", 0o600, ": expected two lines, the user and the password"),
    ],
)
def test_a_file_of_credentials_is_private_and_has_two_lines(
    tmp_path: Path, content: str, mode: int, told: str
) -> None:
    file = tmp_path / "credentials"
    file.write_text(content)
    file.chmod(mode)
    assert told in refused(credentials_file=str(file))
    file.write_bytes(b"robot\nsecret\xff\n")
    file.chmod(0o600)
    assert refused(credentials_file=str(file)) == f"mqtt_credentials_file {file} is not in UTF-8"
    assert refused(credentials_file="nowhere") == "mqtt_credentials_file nowhere: No such file or directory"


def test_a_password_in_clear_over_the_network_is_warned_about(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(USER, "robot")
    monkeypatch.setenv(PASSWORD, "secret")
    told: list[str] = []
    # An address that is nobody's, by its standard.
    backend = Mqtt(MqttSettings(host="192.0.2.1"), None, lambda severity, text: told.append(text))
    backend.close()
    assert told[0] == "the MQTT password goes over the network in clear: set mqtt_tls"


def test_a_host_that_does_not_answer_holds_up_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mqtt, "CLOSING_S", 0.5)
    begin = time.monotonic()
    backend = Mqtt(MqttSettings(host="192.0.2.1"), LAYOUT, lambda severity, text: None)
    with pytest.raises(ReadingFailed, match=r"no connection yet|cannot be reached"):
        backend.read("7")
    backend.close()
    assert time.monotonic() - begin < mqtt.CONNECTING_S


def test_without_layout_and_connection_nobody_says_that_there_is_no_such_tag() -> None:
    """The topics would tell which tags there are."""
    listener = Listener(free_port())
    with pytest.raises(ReadingFailed, match=r"^tag '7': .*(no connection yet to|cannot be reached)"):
        listener.backend.read("7")
    listener.backend.close()


def test_a_port_that_nobody_serves_is_told_once() -> None:
    port = free_port()
    listener = Listener(port, LAYOUT)
    assert listener.until("cannot be reached").startswith(
        f"the broker at 127.0.0.1:{port} cannot be reached ("
    )
    listener.backend.close()
    assert listener.count("cannot be reached") == 1
