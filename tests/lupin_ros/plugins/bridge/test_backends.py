"""The node `greenhouse_bridge` as a process over each backend, and what it says to strange requests."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed here")

from lupin_bridge.node import STATUS_READING_FAILED
from lupin_msgs.msg import Observation, TagReading
from lupin_msgs.srv import GetTagReading
from lupin_ros.adapter.node import CallFailure
from tests.broker import Broker, Sensors, sockets_of
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

SERVICE = "/greenhouse_bridge/get_tag_reading"
OK, UNKNOWN = GetTagReading.Response.STATUS_OK, GetTagReading.Response.STATUS_UNKNOWN_TAG
NOTHING = TagReading()


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    broker = Broker(tmp_path)
    yield broker
    broker.kill()


def ask(operator: Operator, tag: str) -> GetTagReading.Response:
    return operator.call(GetTagReading, SERVICE, GetTagReading.Request(tag_id=tag))


def is_readable(operator: Operator, tag: str) -> bool:
    """Say whether there is a reading; a bridge that was killed is found missing after a second."""
    caller, answers = operator.ros.service(GetTagReading, SERVICE), []
    operator.until(caller.ready, "a bridge")
    caller.call(GetTagReading.Request(tag_id=tag), 1.0, answers.append)
    operator.until(lambda: answers, "an answer or none")
    caller.close()
    return not isinstance(answers[0], CallFailure) and answers[0].status == OK


def values(response: GetTagReading.Response) -> dict[str, float]:
    assert response.status == OK, response.error_message
    return {one.name: one.value for one in response.reading.readings}


def layout(folder: Path) -> str:
    tags = {
        "1": {"x": 1.6, "y": 1.3, "sensors": ["temperature", "co2"]},
        "2": {"x": 2.6, "y": 0.3, "sensors": ["temperature", "soil_moisture"]},
    }
    file = folder / "layout.json"
    file.write_text(json.dumps({"units": "m", "tags": tags, "tables": {}}))
    return str(file)


@pytest.mark.core
def test_strange_requests_are_answered_and_change_nothing(world: World, operator: Operator) -> None:
    world.start("greenhouse_bridge", debug_time_of_day=6.0)
    strange = [
        "",
        " ",
        "0",
        "01",
        "1 ",
        "-1",
        "1.0",
        "nan",
        "../../etc/passwd",
        "1\n",
        "ß" * 3,
        "7" * 1_000_000,
    ]
    for tag in strange:
        answer = ask(operator, tag)
        assert (answer.status, answer.reading) == (UNKNOWN, NOTHING)
        assert answer.error_message.startswith("unknown tag '")
        assert answer.error_message.endswith("; the layout has 29 tags")
        assert len(answer.error_message) < 250
    answer = ask(operator, "1")
    assert set(values(answer)) == {"temperature", "co2"}
    assert (answer.error_message, answer.reading.sim_time_of_day_seconds) == ("", 6 * 3600.0)
    log = world.log("greenhouse_bridge").read_text()
    assert "Traceback" not in log


def test_a_recording_is_served_like_a_greenhouse(world: World, operator: Operator, tmp_path: Path) -> None:
    file = tmp_path / "day.csv"
    file.write_text(
        "tag_id,sensor,value,unit,stamp\n"
        "1,temperature,295.15,K,2026-05-01T08:00:00\n"
        "2,soil_moisture,40,%,2026-05-01T08:00:00\n"
        "2,temperature,19,°C,2026-05-01T06:00:00\n"
    )
    world.start("greenhouse_bridge", backend="recorded", recording_file=file, debug_time_of_day=8.1)
    before = time.time()
    answer = ask(operator, "1")
    assert values(answer) == {"temperature": pytest.approx(22.0)}
    assert answer.reading.sim_time_of_day_seconds == pytest.approx(8.1 * 3600.0)
    assert before - 1.0 <= answer.reading.stamp.sec <= time.time()
    assert values(ask(operator, "2")) == {"soil_moisture": pytest.approx(0.4)}
    answer = ask(operator, "3")
    assert (answer.status, answer.error_message) == (UNKNOWN, "unknown tag '3'; the recording has 2 tags")


def test_a_recording_with_mistakes_ends_the_node_with_all_of_them(world: World, tmp_path: Path) -> None:
    file = tmp_path / "day.csv"
    file.write_text("tag_id,sensor,value,stamp\n1,co2,much,2026-05-01T08:00:00\n1,co2,400,noon\n")
    process = world.start("greenhouse_bridge", backend="recorded", recording_file=file)
    assert process.wait(60.0) == 1
    log = world.log("greenhouse_bridge").read_text()
    assert f"{file}:2:7: 'much' is no number" in log
    assert f"{file}:3:11: 'noon' is no time" in log
    assert "Traceback" not in log


@pytest.mark.core
@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            {"backend": "mqt"},
            "parameter 'backend': expected one of simulator, recorded, mqtt, got 'mqt'; did you mean 'mqtt'?",
        ),
        ({"backend": "recorded"}, "backend 'recorded' needs the parameter recording_file, a CSV file"),
        ({"backend": "mqtt", "mqtt_topic": "greenhouse"}, "mqtt_topic 'greenhouse': expected {tag} once"),
        (
            {"backend": "mqtt", "tag_file": "nowhere"},
            "tag_file 'nowhere' cannot be used: No such file or directory",
        ),
        (
            {"backend": "recorded", "recording_file": "x", "tag_locations_file": "~nobody-here/x.json"},
            "tag_locations_file '~nobody-here/x.json' cannot be used: No such file or directory",
        ),
    ],
)
def test_settings_that_cannot_be_used_end_the_node_with_a_sentence(
    world: World, settings: dict[str, str], told: str
) -> None:
    process = world.start("greenhouse_bridge", **settings)
    assert process.wait(60.0) == 1
    log = world.log("greenhouse_bridge").read_text()
    assert told in log
    assert "Traceback" not in log


@pytest.mark.broker
def test_a_bridge_without_a_broker_says_so_and_finds_it_when_it_comes(
    world: World, operator: Operator, broker: Broker, tmp_path: Path
) -> None:
    gone = f"the broker at 127.0.0.1:{broker.port} cannot be reached (Connection refused); it is tried again"
    file = layout(tmp_path)
    world.start(
        "greenhouse_bridge", backend="mqtt", mqtt_host="127.0.0.1", mqtt_port=broker.port, tag_file=file
    )
    operator.until(lambda: gone in world.log("greenhouse_bridge").read_text(), "the bridge misses its broker")
    answer = ask(operator, "1")
    assert (answer.status, answer.reading) == (STATUS_READING_FAILED, NOTHING)
    told = "tag '1': nothing measured in the last 900 s (no temperature, no co2)"
    assert answer.error_message == f"{told}; {gone}"
    assert ask(operator, "3").error_message == "unknown tag '3'; the layout has 2 tags"
    broker.start()
    sensors = Sensors(broker.port)
    stamped = json.dumps({"value": 21.5, "stamp": time.time()})
    sensors.publish("greenhouse/1/temperature", stamped, retain=True)
    sensors.publish("greenhouse/1/co2", "NaN", retain=True)
    operator.until(lambda: is_readable(operator, "1"), "the bridge has heard of tag 1")
    assert values(ask(operator, "1")) == {"temperature": 21.5}
    sensors.close()


@pytest.mark.broker
def test_a_mission_over_mqtt_goes_on_when_bridge_and_broker_are_killed(
    world: World, operator: Operator, broker: Broker, tmp_path: Path
) -> None:
    """What sensors keep at their broker with a stamp is there again for the bridge that comes back."""
    file = layout(tmp_path)
    given = {"mqtt_host": "127.0.0.1", "mqtt_port": broker.port, "tag_file": file}
    broker.start()
    sensors = Sensors(broker.port)
    for tag, value in (("1", 21.0), ("2", 22.0)):
        stamped = json.dumps({"value": value, "stamp": time.time()})
        sensors.publish(f"greenhouse/{tag}/temperature", stamped, retain=True)
    sensors.close()
    world.start("greenhouse_bridge", backend="mqtt", **given)
    operator.until(lambda: is_readable(operator, "2"), "the bridge has heard of tag 2")
    world.start("lupin_sim", speed=0.5)  # so slow that a pause comes in time before tag 2
    # A robot that a busy machine does not let tell its emergency stop for two seconds would be held.
    world.start("mission_orchestrator", scan_timeout_s=20.0, estop_timeout_s=20.0)
    operator.in_state("READY")
    assert not operator.ask("pause").success  # the service is found: the next request is there at once
    broker.kill()
    assert operator.start("1", "2").accepted
    operator.until(lambda: operator.observations, "the reading of tag 1, which was heard before")
    assert operator.ask("pause").success
    world.processes["greenhouse_bridge"].send_signal(signal.SIGKILL)
    world.processes["greenhouse_bridge"].wait(10.0)
    broker.start()
    world.start("greenhouse_bridge", backend="mqtt", **given)
    sensors = Sensors(broker.port)
    sensors.publish(
        "greenhouse/2/temperature", json.dumps({"value": 23.0, "stamp": time.time()}), retain=True
    )
    operator.until(lambda: is_readable(operator, "2"), "the second bridge has heard of tag 2")
    operator.set_parameter("lupin_sim", "speed", 10.0)
    assert operator.ask("resume").success
    operator.until_done(2)
    sensors.close()
    found = [
        (o.tag_reading.tag_id, o.status, [r.value for r in o.tag_reading.readings])
        for o in operator.observations
    ]
    assert found == [("1", Observation.STATUS_OK, [21.0]), ("2", Observation.STATUS_OK, [23.0])]


@pytest.mark.core
@pytest.mark.broker
def test_the_node_of_a_greenhouse_opens_no_port_for_its_sensors(
    world: World, operator: Operator, broker: Broker
) -> None:
    """No TCP socket of the process waits for anybody; it calls its broker."""
    process = world.start(
        "greenhouse_bridge", backend="mqtt", mqtt_host="127.0.0.1", mqtt_port=broker.start().port
    )
    log = world.log("greenhouse_bridge")
    operator.until(lambda: "connected to the broker at 127.0.0.1" in log.read_text(), "a connection")
    own = sockets_of(process.pid)
    tables = [
        Path(f"/proc/{process.pid}/net/{name}").read_text().splitlines()[1:] for name in ("tcp", "tcp6")
    ]
    rows = [row.split() for table in tables for row in table]
    states = [row[3] for row in rows if row[9] in own]
    assert set(states) == {"01"}, "connections that are established, and nothing that listens"
