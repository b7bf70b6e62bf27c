"""Goes on from a complete proof to longer lists, as far as a fixed number of transitions lasts.

The number decides, not time, so the verdicts are the same on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from lupin_verify.proof import Proof, ProofVerdict, Proven
from lupin_verify.situations.explorer import Bounds
from lupin_verify.situations.found import ExplorationProgress

#: The most elements that lists have by default, and the transitions of all proofs of a mission together.
MOST_TARGETS = 4
MOST_TRANSITIONS = 2_000_000
#: One more element makes about so many times as many transitions: more than are left are not begun.
_FACTOR = 2

#: Makes a proof within bounds; its second argument is called now and then, and returns why to stop.
Prover = Callable[[Bounds, Callable[[ExplorationProgress], str]], Proof]


def widen(found: Proof, bounds: Bounds, prove: Prover) -> Proof:
    """Prove with one more element at a time; return the result of the longest lists explored completely.

    A property that breaks keeps its counterexample with the fewest elements. Breaches found in an
    exploration that stopped early stand.

    Args:
        found: a proof within the bounds; unless it is complete, it is the result.
        bounds: the bounds to begin with.
        prove: makes a proof.
    """
    left = MOST_TRANSITIONS - found.progress.transitions
    too_many = f"that takes more than {MOST_TRANSITIONS:,} transitions in all"

    def look(progress: ExplorationProgress) -> str:
        return too_many if progress.transitions > left else ""

    while found.complete and found.targets is not None and found.targets < MOST_TARGETS:
        if _FACTOR * found.progress.transitions > left:
            return _given_up(found, too_many)
        bounds = bounds._replace(targets=bounds.targets + 1)
        longer = prove(bounds, look)
        left -= longer.progress.transitions
        joined = replace(
            longer if longer.complete else found,
            properties=_joined(found, longer),
            seconds=found.seconds + longer.seconds,
            processor=found.processor + longer.processor,
        )
        if not longer.complete:
            return _given_up(joined, longer.stopped)
        found = joined
    return found


def _given_up(found: Proof, reason: str) -> Proof:
    """Return a proof with the reason why it has no longer lists."""
    assert found.targets is not None, "only a chart with lists can have longer ones"
    more = found.targets + 1
    text = f"Lists of {more} elements were not explored: {reason}; --targets {more} explores them."
    return replace(found, beyond=reason, bounds=(*found.bounds, text))


def _joined(found: Proof, longer: Proof) -> tuple[Proven, ...]:
    """Return the verdicts of two proofs, the second one with longer lists."""
    known = {one.name: one for one in found.properties}
    new = {one.name: one for one in longer.properties}
    names = dict.fromkeys((*known, *new))
    return tuple(_chosen(known.get(name), new.get(name), longer.complete) for name in names)


def _chosen(known: Proven | None, new: Proven | None, complete: bool) -> Proven:
    if known is None or new is None:
        one = known or new
        assert one is not None, "one of the proofs has it"
        return one
    if known.verdict is ProofVerdict.BROKEN:
        return known
    return new if complete or new.verdict is ProofVerdict.BROKEN else known
