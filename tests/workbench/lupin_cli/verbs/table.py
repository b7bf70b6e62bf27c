"""How each verb is called with a mission, and what its exit code may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import click

#: The case whose package is installed for it.
OWN_PROFILE = "own profile"
#: Stand for the mission of a case, what is simulated of it, and the folder that it is in.
MISSION, RUN, FOLDER = "{mission}", "{run}", "{folder}"


@dataclass(frozen=True)
class Call:
    """Words after `lupin`, and the exit code.

    `codes` is that of a good mission, several where the machine decides; `but` has those of single cases, and
    `broken` is that of a mission with errors. In a folder without missions it is 2. `keep` is a file for what
    is printed. What reaches `ros` goes on in a network (`tests/lupin_ros/launch/test_verbs.py`); `asks`
    means that the mission's name is looked for there.
    """

    words: Sequence[str]
    codes: Sequence[int] = (0,)
    but: Mapping[str, int] = field(default_factory=dict)
    broken: int = 1
    keep: str = ""
    ros: bool = False
    asks: bool = False


#: Examples of which targets are missed where their servers are not described by a scenario.
_MISSED = {"binding": 1, "question": 1}
_PROVE = ("--budget", "200 ms", "--targets", "1", "--no-restarts", "-j", "1")

_OF_A_JOURNAL = {
    "learn": ["learn"],
    "missions": ["missions"],
    "why": ["why", "tag", "12"],
    "replay": ["replay"],
}

#: What is called, by verb; of several calls each goes on with what the ones before have written.
CALLS: Mapping[str, Sequence[Call]] = {
    "check": [Call(["check", MISSION]), Call(["check", FOLDER, "--json"])],
    "simulate": [
        Call(["simulate", MISSION], but={**_MISSED, OWN_PROFILE: 2}, broken=2),
        Call(["simulate", RUN, "--timeline", "run.svg", "-q"], but={**_MISSED, OWN_PROFILE: 1}),
    ],
    "test": [
        Call(["simulate", RUN, "--json"], but={**_MISSED, OWN_PROFILE: 1}, broken=2, keep="run.json"),
        Call(["test", "--record", "run.json", "-o", "again.scenario.yaml"]),
        Call(["test", "again.scenario.yaml"]),
    ],
    "prove": [Call(["prove", MISSION, *_PROVE], (0, 3), broken=2)],  # 3: its time was up
    "campaign": [
        Call(["campaign", MISSION, "--seeds", "1", "-j", "1"], but={OWN_PROFILE: 2}, broken=2),
    ],
    "diagram": [
        Call(["diagram", MISSION]),
        Call(["diagram", MISSION, "-o", "chart.svg"]),
        Call(["diagram", "--all", FOLDER, "-o", "drawn"]),
    ],
    # A lifecycle and its missions as one foreign chart has findings, which are told.
    "import": [
        Call(["diagram", MISSION, "-o", "chart.scxml"]),
        Call(["import", "scxml", "chart.scxml", "--name", "imported"], (1,)),
    ],
    "bundle": [Call(["bundle", MISSION, "-o", "made.lupin"]), Call(["check", "made.lupin"])],
    "new": [Call(["new", "patrol"]), Call(["check", "missions/patrol.yaml"])],
    "run": [Call(["run", MISSION], broken=2, ros=True)],
    "up": [Call(["up", MISSION], broken=2, ros=True)],
    "security": [Call(["security", "policy", MISSION], ros=True)],
    "types": [Call(["types", "ts"], (0, 2))],  # 2: without ROS
    "interfaces": [Call(["interfaces", "add", "--help"])],
    "plugin": [Call(["plugin", "list"])],
    "twin": [Call(["twin", "missions"], (1,))],
    "schema": [Call(["schema"])],
    # Nothing was learned yet, and there is no journal yet.
    "expect": [Call(["expect", "inspection"], (2,))],
    **{verb: [Call(words, (2,))] for verb, words in _OF_A_JOURNAL.items()},
    "doctor": [Call(["doctor"], (0, 1))],
    "upgrade": [Call(["upgrade", FOLDER])],
    "node": [Call(["node"])],
    "invite": [Call(["invite", "anna"], (2,))],
    # These ask a network, and serve until they are ended.
    **{verb: [Call([verb], ros=True)] for verb in ("state", "answer", "record", "graph")},
    "lsp": [Call(["lsp"])],
    "start": [Call(["start", MISSION], ros=True, asks=True)],
}


def calls_of(verb: str, command: click.Command) -> Sequence[Call]:
    """Return how a verb is called; one that nobody has thought of gets the mission, if it takes anything."""
    takes = any(isinstance(each, click.Argument) for each in command.params)
    return CALLS.get(verb) or [Call([verb, MISSION] if takes else [verb], (0, 1, 2))]
