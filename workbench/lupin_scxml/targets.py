"""Converts targets of transitions and initial states to paths of the language.

Several targets at once become their parallel state: if they are its initial states, or can be made so, it is
entered as such; else the transition is a fork, and variables choose the regions' initial states.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from lupin_scxml.elements import Element
from lupin_scxml.events import REGIONS, STATES
from lupin_scxml.notes import CannotSay


def first_way(parent: Element) -> Element | None:
    """Return a state's initial transition, if the state has an `initial` element."""
    return next((rule for each in parent.all("initial") for rule in each.all("transition")), None)


class Targets:
    """All targets of one document."""

    def __init__(self, root: Element, names: Mapping[Element, str]) -> None:
        """Index a document whose states have these names."""
        self._names = names
        self.states = {state.get("id"): state for state in names if state.get("id")}
        #: By state, the transitions that lead to it.
        self.ways: dict[Element, list[Element]] = {}
        #: Of regions that begin with another child than the document says, that child.
        self.begins: dict[Element, Element] = {}
        #: By several targets that are no beginning, the target in each of the regions.
        self.forks: dict[str, dict[Element, Element]] = {}
        self._together: dict[str, Element] = {}
        for rule in root.every("transition"):
            for target in rule.get("target").split():
                if target in self.states:
                    self.ways.setdefault(self.states[target], []).append(rule)
        several = [ids for ids in map(_beginning, root.every("scxml", *STATES, "transition")) if " " in ids]
        if several:
            single = [
                state for state, rules in self.ways.items() if any(" " not in _beginning(r) for r in rules)
            ]
            begun = {root, *self.begun(root)}.union(*map(self._led_to, single))
            for ids in several:
                self._begin_together(ids, begun)
            for ids in several:
                if self.together(ids) is None:
                    self._fork(ids)

    # -- several at once ------------------------------------------------------------------------------------

    def begun(self, state: Element) -> Iterator[Element]:
        """Yield a state and all that are entered with it by default."""
        yield state
        children, wanted = state.all(*REGIONS), _beginning(state)
        if state.kind != "parallel" and wanted:
            found = self.states.get(wanted)
            children = [found] if found is not None and state in found.around else []
        for child in children if state.kind == "parallel" else children[:1]:
            yield from self._led_to(child, state)

    def _led_to(self, target: Element, source: Element | None = None) -> Iterator[Element]:
        """Yield the states that are entered with a target, from `source` on."""
        yield from self.begun(target)
        inner = target
        for around in target.around:
            if around is source:
                break
            yield around
            if around.kind == "parallel":
                for region in around.all(*REGIONS):
                    if region is not inner:
                        yield from self.begun(region)
            inner = around

    def _parallel(self, ids: str) -> tuple[list[Element], Element | None]:
        """Return several targets, and their parallel state, if there is one."""
        targets = [self.states[one] for one in ids.split() if one in self.states]
        shared = (
            [one for one in targets[0].around if all(one in each.around for each in targets)]
            if targets
            else []
        )
        whole = shared[0] if len(targets) == len(ids.split()) and shared else None
        return targets, whole if whole is not None and whole.kind == "parallel" else None

    def _fork(self, ids: str) -> None:
        targets, whole = self._parallel(ids)
        regions = [(target, *target.around) for target in targets]
        found = {line[line.index(whole) - 1]: line[0] for line in regions} if whole is not None else {}
        if whole is not None and len(found) == len(targets):
            self.forks[ids] = {region: target for region, target in found.items() if region is not target}
            self._together[ids] = whole

    def forked_to(self, region: Element) -> list[Element]:
        """Return a region's initial states by forks."""
        return list(dict.fromkeys(fork[region] for fork in self.forks.values() if region in fork))

    def _begin_together(self, ids: str, begun: set[Element]) -> None:
        targets, whole = self._parallel(ids)
        if whole is None:
            return
        begins: dict[Element, Element] = {}
        for target in targets:
            inner = target
            for around in target.around[: target.around.index(whole)]:
                if (
                    begins.setdefault(around, inner) is not inner
                    or around.kind == "parallel"
                    or around in begun
                ):
                    return
                inner = around
        self.begins |= begins
        self._together[ids] = whole

    def together(self, ids: str) -> Element | None:
        """Return the parallel state that is entered for several targets; None where there is none."""
        wanted = {self.states.get(one) for one in ids.split()}
        parents = {state.parent if state else None for state in wanted}
        whole = parents.pop() if len(parents) == 1 else None
        if whole and whole.kind == "parallel" and wanted == set(whole.all(*REGIONS)):
            return whole
        return self._together.get(" ".join(ids.split()))

    # -- paths ----------------------------------------------------------------------------------------------

    def path(self, source: Element, ids: str) -> str:
        """Return the path of a target from the nearest ancestor-or-self of `source` that contains it.

        Raises:
            CannotSay: there is no such state, or no path to it.
        """
        several = len(ids.split()) > 1
        target = self.together(ids) if several else self.states.get(ids.strip())
        if target is None:
            missing = f"the target {ids!r}, which does not exist,"
            raise CannotSay(f"several targets at once ({ids})" if several else missing)
        nearer: set[str] = set()
        for scope in (source, *source.around):
            if scope in target.around:
                outer = reversed(target.around[: target.around.index(scope)])
                path = [self._names[state] for state in (*outer, target)]
                if path[0] not in nearer:
                    return ".".join(path)
            nearer |= {self._names[state] for state in scope.all(*STATES)}
        raise CannotSay(f"the target {ids!r}, whose name a nearer state has,")


def _beginning(state: Element) -> str:
    """Return a state's initial targets, or a transition's targets."""
    rule = first_way(state)
    found = state.get("target") or (rule.get("target") if rule is not None else "") or state.get("initial")
    return " ".join(found.split())
