"""`lupin import scxml`: a chart of others is a mission that can be checked and simulated at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_cli.main import main

#: A traffic light as others write one.
LIGHT = """\
<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" initial="red" datamodel="ecmascript">
  <datamodel><data id="rounds" expr="0"/></datamodel>
  <state id="red">
    <onentry><send event="go" id="t" delay="3s"/></onentry>
    <onexit><cancel sendid="t"/></onexit>
    <transition event="go" target="green"/>
  </state>
  <state id="green">
    <onentry>
      <assign location="rounds" expr="rounds + 1"/>
      <send event="stop" delay="2s"/>
    </onentry>
    <transition event="stop" cond="rounds &lt; 2" target="red"/>
    <transition event="stop" target="off"/>
  </state>
  <final id="off"/>
</scxml>
"""
BUTTON = '<transition event="press" target="off"/></state>'


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stand in an empty folder with the document."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "Traffic-light.scxml").write_text(LIGHT)
    return tmp_path


def test_it_writes_a_mission_that_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the lifecycle around it; names and idioms are told, then what the checker says."""
    assert main(["import", "scxml", "Traffic-light.scxml"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "wrote missions/lifecycle.yaml",
        "wrote missions/traffic_light.yaml",
        "named red: RED",
        "named green: GREEN",
        "Traffic-light.scxml:4: note: a delayed send that its state waits for is `after`: leaving it ends it",
        "Traffic-light.scxml:5: note: a cancel as the state is left is not written: its timers end then",
        "1 mission, no errors, no warnings",
        "next: lupin simulate traffic_light -i; lupin diagram traffic_light",
    ]
    assert (
        (folder / "missions" / "traffic_light.yaml").read_text()
        == """\
# Made from Traffic-light.scxml by 'lupin import scxml'.
mission: TrafficLight
context: {rounds: {type: number, default: 0}}
initial: RED
states:
  RED: {after: {3 s: GREEN}}
  GREEN:
    entry:
      - {set: {rounds: "${ rounds + 1 }"}}
    after: {2 s: [{target: RED, guard: "rounds < 2"}, "off"]}
  "off": {type: final}
"""
    )
    assert main(["simulate", "traffic_light"]) == 0


def test_what_is_left_out_is_told_with_its_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And the exit code says that there is something to do."""
    document = folder / "other.scxml"
    document.write_text(LIGHT.replace("<final", "<script>beep()</script>\n  <final"))
    assert main(["import", "scxml", "other.scxml", "--name", "second"]) == 1
    told = "other.scxml:16: not said: a script cannot be said; it is left out"
    assert told in capsys.readouterr().out.splitlines()
    assert (folder / "missions" / "second.yaml").exists()


def test_events_from_outside_are_a_binding(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """So that the mission is whole, and can be tried by hand; what stands there already is kept."""
    document = folder / "other.scxml"
    document.write_text(LIGHT.replace("</state>", BUTTON, 1))
    assert main(["import", "scxml", "other.scxml"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert ("wrote missions/bindings/other.yaml" in out, out[-2]) == (
        True,
        "1 mission, no errors, no warnings",
    )
    binding = (folder / "missions" / "bindings" / "other.yaml").read_text()
    assert 'topic: {name: "/other/press", type: std_msgs/msg/Empty}' in binding
    assert main(["simulate", "other", "--until", "1 s"]) == 0


def test_a_mission_that_exists_is_kept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is written over, and a file that is no SCXML writes nothing."""
    assert main(["import", "scxml", "Traffic-light.scxml"]) == 0
    assert main(["import", "scxml", "Traffic-light.scxml"]) == 2
    kept = "'missions/traffic_light.yaml' exists; choose another name, or remove it"
    assert kept in capsys.readouterr().err
    (folder / "no.scxml").write_text("<a>")
    assert main(["import", "scxml", "no.scxml"]) == 2
    assert "no.scxml: line 1: no XML: no element found" in capsys.readouterr().err
