"""A simulation driven by recorded actions, which can be undone by replay.

Undoing replays the remaining actions on a new simulation. The same actions give the same steps, so its event
queue and random state are restored, too, which a snapshot of the machine does not have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lupin_engine.sim import Effect, Simulation


@dataclass(frozen=True)
class Move:
    """A recorded action on a simulation; `action` returns False where it had nothing to act on."""

    text: str
    action: Callable[[Simulation], bool]


def go_on(times: int) -> Move:
    """Return the move that carries out the next `times` deadlines or actions."""

    def action(simulation: Simulation) -> bool:
        return all(simulation.advance() for _ in range(times))

    return Move("step", action)


def wait_until(time: float) -> Move:
    """Return the move that sets the clock forward to `time` (s); all that is due before must be done."""

    def action(simulation: Simulation) -> bool:
        simulation.wait_until(time)
        return True

    return Move(f"wait until {time:.1f} s", action)


def effect(text: str, what: Effect) -> Move:
    """Return the move that applies an effect now."""
    return Move(text, lambda simulation: simulation.do(what))


class Rewindable:
    """A simulation with the moves that led to its present state."""

    def __init__(self, make: Callable[[], Simulation]) -> None:
        """Begin.

        Args:
            make: makes the simulation, begun; called again when moves are taken back.
        """
        self._make = make
        self.simulation = make()
        self.moves: list[Move] = []

    def do(self, move: Move) -> bool:
        """Make a move; one that finds nothing to act on is not remembered."""
        done = move.action(self.simulation)
        if done:
            self.moves.append(move)
        return done

    def join(self, count: int) -> None:
        """Join the last `count` moves, each a `go_on(1)`, to one move."""
        if count > 1:
            self.moves[-count:] = [go_on(count)]

    def back(self, count: int) -> list[Move]:
        """Take back the last `count` moves, or as many as there are, and return them."""
        kept = max(0, len(self.moves) - count)
        taken = self.moves[kept:]
        self.again(kept)
        return taken

    def again(self, count: int | None = None) -> None:
        """Discard the moves after the first `count` (None: none), and replay the rest on a new simulation.

        It also repairs a simulation that Ctrl-C interrupted within a move.
        """
        del self.moves[len(self.moves) if count is None else count :]
        self.simulation = self._make()
        for move in self.moves:
            move.action(self.simulation)
