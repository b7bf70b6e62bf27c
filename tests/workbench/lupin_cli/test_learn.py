"""`lupin learn`, `lupin expect` and `lupin simulate --rates` as they are typed."""

from __future__ import annotations

import importlib
import json
import struct
import sys
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.runtime.journal.journal import CHARTS
from lupin_ros.recording.file import JOURNAL_TYPE, RecordingFile
from lupin_ros.service import names
from tests.benchmarking import BENCHMARKS

TAGS = ["1", "5", "12"]


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The journal of eight missions of a robot."""
    folder = tmp_path_factory.mktemp("journal")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sys, "path", [str(BENCHMARKS), *sys.path])
        robot = importlib.import_module("learning").HiddenRobot(3)
    for number in range(8):
        robot.play(number, TAGS, folder)
    return folder


@pytest.fixture
def learned(journal: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which was learned."""
    monkeypatch.chdir(tmp_path)
    assert main(["learn", "--journal", str(journal)]) == 0
    return tmp_path


def test_learn_tells_a_table_and_writes_a_file(
    learned: Path, journal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert main(["learn", "--journal", str(journal)]) == 0  # what learn wrote it may write anew
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split("  ")[0] == "operation"
    assert any(line.startswith("nav.go_to ") for line in lines)
    assert any(line.startswith("robot.battery: loses ") for line in lines)
    assert lines[-1] == "wrote learned.yaml: learned from 8 missions, 2026-03-01 to 2026-03-01"
    text = (learned / "learned.yaml").read_text(encoding="utf-8")
    assert text.startswith('campaign: "learned from 8 missions')


def test_learn_prints_the_same_as_json(
    learned: Path, journal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert main(["learn", "--journal", str(journal), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["file"], found["drift"], found["left_out"]) == ("learned.yaml", [], [])
    assert found["rates"]["learned"]["seen"]["bridge.read_tag"]["5"] >= 1


def test_drift_writes_nothing(
    journal: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["learn", "--journal", str(journal), "--drift"]) == 0
    few = "not compared: 8 of 8 operations at a target have fewer than 25 attempts"
    assert capsys.readouterr().out == f"nothing has become slower in 8 missions; {few}\n"
    assert not list(tmp_path.iterdir())


def test_a_file_of_others_is_kept(learned: Path, journal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = learned / "rates.yaml"
    other.write_text("campaign: mine\n", encoding="utf-8")
    assert main(["learn", "--journal", str(journal), "-o", str(other)]) == 2
    assert "is there and was not written by learn; name another file" in capsys.readouterr().err
    assert other.read_text(encoding="utf-8") == "campaign: mine\n"


def test_a_journal_of_damage_alone_teaches_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["learn", "--journal", str(tmp_path)]) == 2
    assert "there is no journal in" in capsys.readouterr().err
    (tmp_path / "20260301T080000.000Z_a.journal").write_bytes(b"lupin journal 7\n")
    (tmp_path / "20260301T080000.001Z_b.journal").write_bytes(b"nothing of ours")
    assert main(["learn", "--journal", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert "could be learned from" in told
    assert "another version of the engine" in told
    assert "is no journal" in told


def recorded(file: Path, journal: Path, chosen: slice) -> Path:
    """Record some missions of a journal: their files are attached, and the charts published."""
    recording = RecordingFile(file)
    charts = recording.add_topic(names.CHART_TOPIC, "std_msgs/msg/String", "string data", {})
    for folder in (journal / CHARTS).iterdir():
        files = {str(one.relative_to(folder)): one.read_text() for one in folder.rglob("*.yaml")}
        text = json.dumps({"hash": folder.name, "files": files}).encode() + b"\0"
        recording.add(charts, b"\0\1\0\0" + struct.pack("<I", len(text)) + text, 1, 1)
    recording.flush()
    for one in sorted(journal.glob("*.journal"))[chosen]:
        recording.attach(one.name, one.read_bytes(), 1, JOURNAL_TYPE)
    recording.finish()
    return file


def test_recordings_are_read_in_place_of_the_journal(
    learned: Path, journal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each mission counts once, also if two recordings have it."""
    files = [
        recorded(learned / "a.mcap", journal, slice(5)),
        recorded(learned / "b.mcap", journal, slice(3, 8)),
    ]
    assert main(["learn", *map(str, files), "-o", "recorded.yaml"]) == 0
    assert (learned / "recorded.yaml").read_bytes() == (learned / "learned.yaml").read_bytes()
    assert main(["learn", str(files[0]), "--journal", str(journal)]) == 2
    refused = "--journal: recordings are read in place of a journal; name either"
    assert capsys.readouterr().err.strip().endswith(refused)


def test_a_recording_without_a_journal_is_left_out_with_the_reason(
    learned: Path, journal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = recorded(Path("b.mcap"), journal, slice(8))
    recorded(Path("none.mcap"), journal, slice(0))
    cut = Path("cut.mcap")
    cut.write_bytes(other.read_bytes()[:-2000])
    capsys.readouterr()
    assert main(["learn", "none.mcap", "cut.mcap", "no.mcap"]) == 2
    hint = "messages alone leave out the poses and charges that changed no state"
    assert capsys.readouterr().err.splitlines() == [
        "lupin: no mission in these recordings could be learned from",
        f"    none.mcap has no journal, because it was not made beside an orchestrator; {hint}",
        f"    cut.mcap has no journal, because it is cut off; {hint}",
        "    'no.mcap' cannot be read: No such file or directory",
    ]
    assert main(["learn", "none.mcap", "b.mcap"]) == 0
    assert capsys.readouterr().err.startswith("left out: none.mcap has no journal, because it was not made")


def test_expect_tells_durations_the_battery_and_what_is_missed(
    learned: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert main(["expect", "inspection", "--tags", "1,5,12", "--seeds", "20"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("InspectionMission, 3 tags: 20 runs in virtual time, learned from 8 missions")
    assert [line.split("  ")[0] for line in lines[1:5]] == [
        "",
        "duration",
        "robot.battery left",
        "tags missed",
    ]
    assert main(["expect", "inspection", "--tags", "1,5,12", "--seeds", "20", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert 0.0 < found["seconds"]["p50"] <= found["seconds"]["p90"]
    assert 1.0 > found["left"]["robot.battery"]["p50"] >= found["left"]["robot.battery"]["p90"]
    assert found["learned"] == {"missions": 8, "from": "2026-03-01 08:00", "to": found["learned"]["to"]}


def test_expect_says_what_it_was_not_taught(learned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["expect", "inspection", "--tags", "7", "--seeds", "10"]) == 0
    assert "nav.go_to at 7 (0 seen): fewer than 5" in capsys.readouterr().out


def test_runs_that_do_not_end_are_told(learned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    words = ["--tags", "1", "--seeds", "10", "--value", "battery=10 %"]
    assert main(["expect", "inspection", *words]) == 1
    text = "10 of 10 runs did not come to an end: READY; start refused: battery low"
    assert text in capsys.readouterr().out


def test_all_wrong_options_of_expect_are_told_at_once(
    learned: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = ["--value", "batery=1", "--value", "battery=full", "--clock", "noon", "--rates", "no.yaml"]
    assert main(["expect", "inspection", "--tags", "1", *wrong]) == 2
    told = capsys.readouterr().err
    assert "--value: unknown parameter 'batery'; did you mean 'battery'?" in told
    assert "--value: parameter 'battery': expected number, got 'full'" in told
    assert "--clock: expected a date with a time of day, got 'noon'" in told
    assert "--rates: no file 'no.yaml'; 'lupin learn' writes one from the journal" in told


def test_simulate_draws_from_what_was_learned(learned: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lasts = set()
    for seed in "12":
        main(["simulate", "inspection", "--tags", "1,5", "--rates", "learned.yaml", "--seed", seed, "-q"])
        lasts.add(capsys.readouterr().out.splitlines()[-1])
    assert len(lasts) == 2
    scenario = str(Path(__file__).parents[2] / "scenarios/exploration/rough_day.scenario.yaml")
    assert main(["simulate", scenario, "--rates", "learned.yaml"]) == 2
    assert "a scenario says how its servers answer; --rates is for missions" in capsys.readouterr().err


def test_a_campaign_takes_the_learned_file(learned: Path) -> None:
    assert main(["campaign", "inspection", "--rates", "learned.yaml", "--seeds", "2", "-j", "1"]) == 0
