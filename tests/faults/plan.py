"""What goes wrong in a run, and when: made of a seed, the same each time. Pure."""

from __future__ import annotations

import random
from dataclasses import dataclass

ORCHESTRATOR, ROBOT, BRIDGE, TWIN = "mission_orchestrator", "lupin_sim", "greenhouse_bridge", "lupin_twin"
AGGREGATOR, ARM, ARM_SIM = "perception_aggregator", "lupin_arm", "lupin_arm_sim"
GATEWAY, WATCHDOG = "lupin_gateway", "nav_watchdog"
OTHERS = (ROBOT, BRIDGE, TWIN, AGGREGATOR, ARM, ARM_SIM, GATEWAY, WATCHDOG)
NODES = (ORCHESTRATOR, *OTHERS)
TAGS = tuple(str(number) for number in range(1, 31) if number != 8)

#: What can go wrong, each as often as the others.
KINDS = (
    "kill",
    "stop",
    "terminate",
    "power",
    "disk full",
    "disk slow",
    "cut",
    "lossy",
    "slow",
    "clock",
    "flood",
    "foreign stop",
    "second battery",
    "refused cancel",
    "long list",
    "bit flip",
    "stranger's goal",
)
#: Those of the cable between the orchestrator's computer and the robot's.
OF_THE_LINK = ("cut", "lossy", "slow")
#: A stop and a navigation that refuses to stop: the base moves when the stop is let go, and that is reported.
OF_STOPS = ("foreign stop", "refused cancel")
#: Those that are put on two computers, and on a disk that is nobody else's: only root has them.
NEED_ROOT = (*OF_THE_LINK, "disk full")
#: Metres a second; a run at the lowest speed has one target less. Who searches is fast.
SPEEDS = (1.0, 2.0, 5.0)
#: The share of runs that search for tags; the others are told which.
SEARCHES = 0.3
#: Within so many seconds of a mission a fault begins.
BEGINS_S = 4.0


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong `at` seconds after the start of a mission.

    `lasts` is in seconds, 0 for what is over at once. `amount` is the share of packets that are lost, the
    seconds that a packet or the disk takes longer, the seconds that the clock is set ahead, whether a stop is
    taken back (1) or falls silent (0), the charge of a battery, the entries of a list, or the place of the
    bit in the journal, as a share of it.
    """

    kind: str
    at: float
    node: str = ""
    lasts: float = 0.0
    amount: float = 0.0

    @property
    def end(self) -> float:
        """When it is over, in seconds after the start of the mission."""
        return self.at + self.lasts

    def __str__(self) -> str:
        words = [f"{self.at:.2f} s: {self.kind}"]
        words += [self.node] if self.node else []
        words += [f"by {self.amount:g}"] if self.amount else []
        words += [f"for {self.lasts:.1f} s"] if self.lasts else []
        return " ".join(words)


@dataclass(frozen=True)
class Plan:
    """A run: targets, speed of the robot (m/s), faults, and how long a person waits before resume (s).

    Or instead of the targets `search`: how many tags are searched for.
    """

    seed: int
    tags: tuple[str, ...]
    speed: float
    faults: tuple[Fault, ...]
    waits: float
    search: int = 0

    def __str__(self) -> str:
        what = f"search for {self.search}" if self.search else f"tags {','.join(self.tags)}"
        head = f"seed {self.seed}: {what} at {self.speed:g} m/s, resume after {self.waits:.1f} s"
        return "\n".join([head, *(f"  {fault}" for fault in self.faults)])


def plan(seed: int, *, root: bool = True) -> Plan:
    """Return the run of a seed; without `root` its faults are of other kinds."""
    chance = random.Random(seed)
    kinds = [kind for kind in KINDS if root or kind not in NEED_ROOT]
    chosen = [kinds[seed % len(kinds)]]
    while len(chosen) < 3 and chance.random() < 0.3:
        # One at a time of the cable, and one of each other kind: what mends one would mend the other.
        same = set(chosen)
        for group in (OF_THE_LINK, OF_STOPS):
            same |= set(group) if same & set(group) else set()
        chosen.append(chance.choice([kind for kind in kinds if kind not in same]))
    speed = chance.choice(SPEEDS)
    tags = tuple(chance.sample(TAGS, 1 if speed == SPEEDS[0] else chance.choice((2, 3))))
    faults = sorted((fault(kind, chance) for kind in chosen), key=lambda each: each.at)
    waits = round(chance.uniform(0.2, 2.0), 2)
    if chance.random() < SEARCHES:
        return Plan(seed, (), SPEEDS[-1], tuple(faults), waits, chance.choice((2, 4, 6)))
    return Plan(seed, tags, speed, tuple(faults), waits)


#: Of each kind: how long it lasts at least and at most, and what its amount may be.
_MEASURES: dict[str, tuple[float, float, tuple[float, ...]]] = {
    "stop": (0.5, 6.0, (0.0,)),
    "disk full": (0.5, 5.0, (0.0,)),
    "disk slow": (1.0, 5.0, (0.05, 0.5, 2.0)),
    "cut": (2.0, 30.0, (0.0,)),
    "lossy": (2.0, 8.0, (0.05, 0.2, 0.5)),
    "slow": (2.0, 8.0, (0.05, 0.3, 1.0)),
    "clock": (1.0, 5.0, (-3600.0, 3600.0)),
    "flood": (1.0, 4.0, (0.0,)),
    "foreign stop": (0.5, 5.0, (0.0, 1.0)),
    "second battery": (1.0, 6.0, (0.05, 0.15)),
    "refused cancel": (1.0, 6.0, (0.0,)),
    "long list": (1.0, 4.0, (3000.0, 10_000.0)),
    "bit flip": (0.0, 0.0, (0.3, 0.6, 0.9)),
}


def fault(kind: str, chance: random.Random) -> Fault:
    """Make a fault of a kind."""
    least, most, amounts = _MEASURES.get(kind, (0.0, 0.0, (0.0,)))
    lasts = chance.uniform(least, most)
    if kind == "cut":  # most are short
        lasts = min(most, least * chance.paretovariate(1.2))
    node = _node(chance) if kind in ("kill", "stop", "terminate") else ""
    node = ORCHESTRATOR if kind == "bit flip" else node
    return Fault(kind, round(chance.uniform(0.0, BEGINS_S), 2), node, round(lasts, 1), chance.choice(amounts))


def _node(chance: random.Random) -> str:
    """Return a node: the orchestrator half of the time."""
    return ORCHESTRATOR if chance.random() < 0.5 else chance.choice(OTHERS)
