"""Rules about parallel states: shared resources of their regions, and transitions between them."""

from __future__ import annotations

from collections.abc import Iterator

from lupin_engine.chart.compose.tree import Draft
from lupin_engine.chart.findings import warning
from lupin_engine.chart.model import Kind, State
from lupin_engine.chart.rules.index import Index, Work, local
from lupin_engine.errors import Diagnostic, Place


def shared_resource(index: Index) -> Iterator[Diagnostic]:
    """Find operations that can be active at the same time and use the same: one of them waits."""
    users = [work for work in index.works if work.invoke.operation.uses]
    by_resource: dict[str, list[Work]] = {}
    for work in users:
        for resource in work.invoke.operation.uses:
            by_resource.setdefault(resource, []).append(work)
    for resource, works in by_resource.items():
        yield from _waits_for_region(index, resource, works)
        yield from _waits_for_outer(index, resource, works)


def _waits_for_region(index: Index, resource: str, works: list[Work]) -> Iterator[Diagnostic]:
    """Compare each work with the first one in every other region beside it."""
    first: dict[str, dict[str, Work]] = {}
    for work in works:
        for parallel, region in index.region_of.get(work.state.name, ()):
            known = first.setdefault(parallel, {})
            other = next((found for name, found in known.items() if name != region), None)
            if other is not None:
                yield _finding(work, other, resource)
            known.setdefault(region, work)


def _waits_for_outer(index: Index, resource: str, works: list[Work]) -> Iterator[Diagnostic]:
    """Compare each operation with those of the states around it, which run meanwhile."""
    holders = {work.state.name: work for work in works if work.state.children}
    for work in works if holders else ():
        for name in index.lineage[work.state.name][1:]:
            if name in holders:
                yield _finding(work, holders[name], resource)


def _finding(work: Work, other: Work, resource: str) -> Diagnostic:
    there = f"{other.invoke.name} in {other.state.local_name!r}"
    problem = (
        f"{work.invoke.name} uses {resource!r} as {there} does, and both can be active: one waits until the"
        " other has ended"
    )
    hint = "do them one after the other"
    return warning(work.invoke.place, "shared-resource", work.state.name, problem, hint)


def _final_region(parallel: State, region: State) -> Diagnostic:
    problem = (
        f"the region {region.local_name!r} is a final state: {parallel.local_name!r} is over as"
        " soon as it is entered, and its other regions with it"
    )
    hint = "remove it, or let it be a state with a final one inside: then the others are waited for"
    return warning(region.place, "region-leak", region.name, problem, hint)


def shared_variable(index: Index) -> Iterator[Diagnostic]:
    """Find a variable that two parts report which can be active at the same time."""
    first: dict[tuple[str, str], dict[str, Draft]] = {}
    drafts = index.composed.drafts.values() if index.parallel else ()
    for draft, name, variable in ((d, *each) for d in drafts for each in d.out.items() if each[1]):
        for parallel, region in index.region_of.get(draft.name, ()):
            known = first.setdefault((parallel, variable), {})
            other = next((found for there, found in known.items() if there != region), None)
            known.setdefault(region, draft)
            if other is not None and draft.node is not None:
                place = draft.node.value_at("out", name)
                yield _both_write(f"{draft.name}.out.{name}", variable, other, place)


def _both_write(path: str, variable: str, other: Draft, place: Place) -> Diagnostic:
    there = f"the part that {other.local!r} uses"
    problem = (
        f"{there} reports into {variable!r} as well, and both can be active: what is written last counts"
    )
    return warning(place, "shared-variable", path, problem, "give each a variable of its own")


def region_leak(index: Index) -> Iterator[Diagnostic]:
    """Find an exit from all regions of a parallel state at once: a way into a region, a final region."""
    for parallel in index.parallel:
        yield from (_final_region(parallel, one) for one in index.regions(parallel) if one.kind is Kind.FINAL)
    for name, around in index.region_of.items():
        for transition in index.chart.states[name].transitions:
            if transition.target is None:
                continue
            there = dict(index.region_of.get(transition.target, ()))
            crossed = next((p for p, region in around if there.get(p, region) != region), None)
            if crossed is not None:
                problem = (
                    f"this leads from one region of {local(crossed)!r} into another: the whole state is left"
                    " and entered anew"
                )
                hint = "raise an event that the other region listens to, or go to the whole state"
                yield warning(transition.place, "region-leak", transition.id, problem, hint)
