"""The greenhouse behind the bridge, and what the plugin tells missions: without ROS."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lupin_bridge.backend import Clocks, ReadingFailed, UnknownTag
from lupin_bridge.catalog import NODE_PARAMETERS, PLUGIN, READING, mock_reading
from lupin_bridge.greenhouse import Greenhouse, SimulatorSettings
from lupin_bridge.recording import load_recording
from lupin_bridge.topics import samples
from lupin_bridge.units import QUANTITIES
from lupin_engine.errors import LupinError
from lupin_engine.plugin.types import convert

simulator = pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")


@pytest.fixture
def layout(tmp_path: Path) -> Path:
    """A layout of two tags: one sound, one with a sensor that the climate lacks."""
    tags = {
        "7": {"x": 1.0, "y": 1.0, "sensors": ["light", "temperature"]},
        "9": {"x": 1.0, "y": 2.0, "sensors": ["temperature", "radiation"]},
    }
    file = tmp_path / "layout.json"
    file.write_text(json.dumps({"units": "m", "tags": tags, "tables": {}}))
    return file


def test_a_tag_has_its_own_sensors_in_the_order_of_the_layout(layout: Path) -> None:
    bundled, own = Greenhouse(), Greenhouse(SimulatorSettings(str(layout)))
    assert [one.sensor for one in bundled.read("12").sensors] == ["temperature", "humidity", "co2"]
    assert [one.sensor for one in own.read("7").sensors] == ["light", "temperature"]


def test_a_reading_is_of_now_and_has_its_unit(layout: Path) -> None:
    greenhouse = Greenhouse(SimulatorSettings(str(layout)), Clocks(wall=lambda: 1000.0))
    found = [(one.sensor, one.unit, one.stamp, one.age) for one in greenhouse.read("7").sensors]
    assert found == [("light", "lx", 1000.0, 0.0), ("temperature", "°C", 1000.0, 0.0)]


def test_the_bundled_layout_has_29_tags_that_can_all_be_read() -> None:
    greenhouse = Greenhouse()
    assert len(greenhouse.tags) == 29
    assert greenhouse.unmeasurable() == {}
    assert all(0.0 <= greenhouse.read(tag).time_of_day < 86400.0 for tag in greenhouse.tags)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ("8", "'8'"),
        ("", "''"),
        ("01", "'01'"),
        (" 1", "' 1'"),
        ("../1", "'../1'"),
        ("1\x00\n", r"'1\x00\n'"),
        ("9" * 100_000, f"'{'9' * 40}...'"),
    ],
)
def test_an_unknown_tag_is_named_and_a_long_name_is_cut(asked: str, told: str) -> None:
    with pytest.raises(UnknownTag) as refused:
        Greenhouse().read(asked)
    assert str(refused.value) == f"unknown tag {told}; the layout has 29 tags"


def test_a_sensor_without_climate_is_named(layout: Path) -> None:
    greenhouse = Greenhouse(SimulatorSettings(str(layout)))
    assert greenhouse.unmeasurable() == {"9": ["radiation"]}
    with pytest.raises(ReadingFailed, match=r"tag '9': the climate file does not .* radiation"):
        greenhouse.read("9")
    assert greenhouse.read("7").sensors


@pytest.mark.parametrize("sensors", [{"sensors": []}, {}])
def test_a_tag_without_sensors_has_no_reading(tmp_path: Path, sensors: dict[str, list[str]]) -> None:
    """A reading of nothing would be booked as a success."""
    file = tmp_path / "bare.json"
    file.write_text(json.dumps({"tags": {"7": {"x": 1.0, "y": 1.0, **sensors}}}))
    with pytest.raises(ReadingFailed, match=r"^tag '7': the layout gives it no sensors$"):
        Greenhouse(SimulatorSettings(str(file))).read("7")


def test_any_failure_of_the_simulator_is_a_failed_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    greenhouse = Greenhouse()

    def fail(tag_id: str) -> None:
        raise ZeroDivisionError("decay")

    monkeypatch.setattr(greenhouse._simulator, "get_sensor_data", fail)
    with pytest.raises(ReadingFailed, match="ZeroDivisionError: decay"):
        greenhouse.read("1")


def test_a_reading_that_is_no_number_is_a_failed_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    greenhouse = Greenhouse()
    poisoned = {"timestamp": 1.0, "co2": float("nan")}
    monkeypatch.setattr(greenhouse._simulator, "get_sensor_data", lambda tag_id: poisoned)
    with pytest.raises(ReadingFailed, match="co2"):
        greenhouse.read("1")


@pytest.mark.parametrize(("hours", "seconds"), [(0.0, 0.0), (12.5, 45000.0), (24.0, 0.0)])
def test_the_time_of_day_can_be_fixed(hours: float, seconds: float) -> None:
    assert Greenhouse(SimulatorSettings(debug_time_of_day=hours)).read("1").time_of_day == seconds


def test_a_seed_makes_the_noise_repeatable() -> None:
    def readings(seed: int) -> list[object]:
        greenhouse = Greenhouse(SimulatorSettings(debug_seed=seed), Clocks(wall=lambda: 0.0))
        return [greenhouse.read(tag) for tag in greenhouse.tags]

    assert readings(3) == readings(3)
    assert readings(3) != readings(4)


def test_the_speed_of_the_clock_can_be_given() -> None:
    greenhouse = Greenhouse(SimulatorSettings(speedup_factor=7.0))
    assert greenhouse._simulator.sim_config["time"]["speedup_factor"] == 7.0


@pytest.mark.parametrize("what", ["tag_file", "sim_config_file"])
def test_a_missing_file_is_named(what: str) -> None:
    with pytest.raises(LupinError, match=r"file nowhere\.json does not exist"):
        Greenhouse(SimulatorSettings(**{what: "nowhere.json"}))


@pytest.mark.parametrize("content", ["{", "[1]", "{}"])
def test_a_file_that_is_no_layout_is_named(tmp_path: Path, content: str) -> None:
    file = tmp_path / "layout.json"
    file.write_text(content)
    with pytest.raises(LupinError, match=r"layout\.json"):
        Greenhouse(SimulatorSettings(tag_file=str(file)))


def test_the_mock_depends_on_the_tag_and_fits_the_declared_type() -> None:
    first, second = (mock_reading({"tag_id": tag}, {})["reading"] for tag in ("1", "2"))
    assert first == mock_reading({"tag_id": "1"}, {})["reading"]
    assert first["readings"] != second["readings"]
    assert convert(first, READING) == first


def test_the_page_about_the_bridge_has_every_parameter_with_its_default() -> None:
    page = (Path(__file__).parents[3] / "docs" / "bridge.md").read_text(encoding="utf-8")
    rows = [row for row in page.partition("## Parameters")[2].splitlines() if row.startswith("| `")]
    told = {
        name: default.strip().strip("`")
        for row in rows
        for name in re.findall(r"`(\w+)`", row.split("|")[1])
        for default in [row.split("|")[2]]
    }
    hidden = {"tag_locations_file": ""}  # told beside tag_file
    assert told | hidden == {name: str(spec.default) for name, spec in NODE_PARAMETERS.items()}


def test_the_page_about_the_bridge_has_every_sensor_with_its_units() -> None:
    page = (Path(__file__).parents[3] / "docs" / "bridge.md").read_text(encoding="utf-8")
    rows = [row.split("|") for row in page.partition("## Units")[2].splitlines() if row.startswith("| `")]
    named = {row[1].strip().strip("`"): row for row in rows[: len(QUANTITIES)]}
    assert list(named) == list(QUANTITIES)
    for sensor, quantity in QUANTITIES.items():
        _, _, unit, others, limits, _ = named[sensor]
        assert unit.split()[0] == quantity.unit
        assert {re.sub(r" \(.*", "", other.strip()).lower() for other in others.split(",")} == set(
            quantity.others
        )
        assert limits.strip() == f"{quantity.minimum:.0f} to {quantity.maximum:.0f}"


def test_the_examples_on_the_page_are_understood(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "bridge.md").read_text(encoding="utf-8")
    tables = re.findall(r"```csv\n(.*?)```", page, re.DOTALL)
    assert len(tables) == 2
    for table in tables:
        file = tmp_path / "example.csv"
        file.write_text(table, encoding="utf-8")
        assert set(load_recording(str(file)).series) == {"1", "2"}
    messages = re.findall(r"-t (\S+) (?:\\\n +)?-m (?:'([^']+)'|(\S+))", page)
    assert len(messages) == 3
    for topic, quoted, bare in messages:
        sensor = topic.split("/")[2] if topic.startswith("greenhouse/") else ""
        found, wrong = samples((quoted or bare).encode(), sensor)
        assert found
        assert not wrong


def test_the_catalog_loads_without_ros_and_without_the_simulator() -> None:
    code = "import lupin_bridge.catalog, sys; print({'rclpy', 'greenhouse_sim'} & set(sys.modules))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "set()"
    assert PLUGIN.operations["read_tag"].mock.after == 0.2
