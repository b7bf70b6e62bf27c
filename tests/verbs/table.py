"""How each verb is called with a mission, and what its exit code may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import click

#: Stand for the mission of a case, what is simulated of it, and the folder that it is in.
MISSION, RUN, FOLDER = "{mission}", "{run}", "{folder}"


@dataclass(frozen=True)
class Call:
    """Words after `lupin`, and the exit codes that a good mission may come to.

    `keep` is a file for what is printed. What reaches `ros` goes on in a network, see
    `tests/ros/launch/test_verbs.py`; `asks` means that the mission's name is looked for there.
    """

    words: Sequence[str]
    codes: Sequence[int] = (0,)
    keep: str = ""
    ros: bool = False
    asks: bool = False


_PROVE = ("--budget", "200 ms", "--targets", "1", "--no-restarts", "-j", "1")

#: What is called, by verb; of several calls each goes on with what the ones before have written.
CALLS: Mapping[str, Sequence[Call]] = {
    "check": [Call(["check", MISSION]), Call(["check", FOLDER, "--json"])],
    "simulate": [
        Call(["simulate", MISSION], (0, 1)),
        Call(["simulate", RUN, "--timeline", "run.svg", "-q"], (0, 1)),
    ],
    "test": [
        Call(["simulate", RUN, "--json"], (0, 1), keep="run.json"),
        Call(["test", "--record", "run.json", "-o", "again.scenario.yaml"]),
        Call(["test", "again.scenario.yaml"]),
    ],
    "prove": [Call(["prove", MISSION, *_PROVE], (0, 1, 3))],
    "campaign": [Call(["campaign", MISSION, "--seeds", "1", "-j", "1"], (0, 1))],
    "diagram": [
        Call(["diagram", MISSION]),
        Call(["diagram", MISSION, "-o", "chart.svg"]),
        Call(["diagram", "--all", FOLDER, "-o", "drawn"]),
    ],
    # A lifecycle and its missions as one foreign chart has findings, which are told.
    "import": [
        Call(["diagram", MISSION, "-o", "chart.scxml"]),
        Call(["import", "scxml", "chart.scxml", "--name", "imported"], (0, 1)),
    ],
    "bundle": [Call(["bundle", MISSION, "-o", "made.lupin"]), Call(["check", "made.lupin"])],
    "new": [Call(["new", "patrol"]), Call(["check", "missions/patrol.yaml"])],
    "run": [Call(["run", MISSION], ros=True)],
    "up": [Call(["up", MISSION], ros=True)],
    "security": [Call(["security", "policy", MISSION], ros=True)],
    "types": [Call(["types", "ts"], (0, 2))],
    "plugin": [Call(["plugin", "list"])],
    "twin": [Call(["twin", "missions"], (1,))],
    "schema": [Call(["schema"])],
    "missions": [Call(["missions"], (0, 1, 2))],
    "why": [Call(["why", "tag", "12"], (1, 2))],
    "replay": [Call(["replay"], (2,))],
    "doctor": [Call(["doctor"], (0, 1))],
    "node": [Call(["node"])],
    "invite": [Call(["invite", "anna"], (0, 1, 2))],
    # These ask a network, and serve until they are ended.
    **{verb: [Call([verb], ros=True)] for verb in ("state", "answer", "record", "graph")},
    "lsp": [Call(["lsp"])],
    "start": [Call(["start", MISSION], ros=True, asks=True)],
}


def calls_of(verb: str, command: click.Command) -> Sequence[Call]:
    """Return how a verb is called; one that nobody has thought of gets the mission, if it takes anything."""
    takes = any(isinstance(each, click.Argument) for each in command.params)
    return CALLS.get(verb) or [Call([verb, MISSION] if takes else [verb], (0, 1, 2))]
