"""Embedded missions: their request, and the variables that restart with them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from lupin_engine.chart.compose.actions import ActionReader
from lupin_engine.chart.compose.declare import read_refusals
from lupin_engine.chart.compose.transitions import CompositionContext, any_event, path_of
from lupin_engine.chart.compose.tree import Draft, each_once
from lupin_engine.chart.documents import MissionNode, StateNode
from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.expressions.values import read_value
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Field, Kind, UsedMission
from lupin_engine.plugin.types import ANY


class UsedMissionReader:
    """Reads how states use missions; `requests` are the fields of each mission by its name."""

    def __init__(
        self,
        context: CompositionContext,
        actions: ActionReader,
        requests: Mapping[str, Mapping[str, Field]],
    ) -> None:
        self._forest = context.forest
        self._variables = context.declared.context
        self._codes = context.codes
        self._findings = context.findings
        self._actions = actions
        self._requests = requests

    def read(self, draft: Draft, node: StateNode, mission: MissionNode) -> UsedMission:
        """Read a use of a mission; a field of its request with a finding has no value."""
        path, inside = path_of(draft.name, "use"), draft.inner
        assert inside is not None
        event = inside.with_event(ANY)
        begun = self._begun(draft)
        self._check_apart(draft, node, mission, begun)
        return UsedMission(
            mission.name,
            self._request(draft, node, mission),
            node.at("use"),
            tuple(name for name in begun if name in self._variables),
            self._actions.read(mission.entry, event, f"{path}.entry"),
            self._actions.read(mission.exit, event, f"{path}.exit"),
        )

    def _request(self, draft: Draft, node: StateNode, mission: MissionNode) -> dict[str, Field]:
        known = self._requests[mission.name]
        for name in node.with_:
            if name not in mission.request:
                at, path = node.key_at("with", name), path_of(draft.name, f"with.{name}")
                what = "field of the request"
                self._findings.unknown(at, "unknown-argument", path, what, name, mission.request)
        for name, field in known.items():
            if name not in node.with_ and field.default is None:
                hint = f"add 'with: {{{name}: ...}}'"
                problem = f"the mission {mission.name!r} needs the field {name!r} of its request"
                self._findings.add(node.at("use"), "missing-argument", f"{draft.name}.with", problem, hint)
        fields = {n: self._given(draft, node, f) if n in node.with_ else f for n, f in known.items()}
        return {name: self._refusing(draft, mission, field) for name, field in fields.items()}

    def _refusing(self, draft: Draft, mission: MissionNode, field: Field) -> Field:
        """Return a field whose refusals read what this use gives; their mistakes were reported before."""
        if not field.refusals:
            return field
        assert draft.inner is not None
        node, discarded = mission.request[field.name], Findings()
        return replace(field, refusals=read_refusals(node, draft.inner, self._codes, discarded, ""))

    def _given(self, draft: Draft, node: StateNode, field: Field) -> Field:
        """Return a field of a request with the value that a use gives it."""
        place, path = node.value_at("with", field.name), path_of(draft.name, f"with.{field.name}")
        scope, raw = any_event(draft), node.with_[field.name]
        value = read_value(raw, place, field.type, scope, self._findings, path)
        least = field.minimum
        if least is not None and isinstance(value, Constant) and value.value < least:
            problem = f"{field.name} must be at least {least:g} {field.type.unit}".rstrip()
            self._findings.add(place, "out-of-range", path, problem)
        return replace(field, place=place, default=value)

    # -- what begins anew --------------------------------------------------------------------------------

    def _begun(self, draft: Draft) -> dict[str, None]:
        """Return the variables of the mission that a state uses, and of missions embedded in that."""
        below = (d.part for d in self._using() if draft in d.up())
        return dict.fromkeys(name for part in below if part is not None for name in part.context)

    def _using(self) -> Iterable[Draft]:
        return (draft for draft in self._forest.drafts.values() if draft.part is not None)

    def _check_context(self, file: MissionNode, used: MissionNode) -> None:
        """Report a variable of one name in a mission and in one that it uses."""
        for name in (name for name in file.context if name in used.context):
            at, where = file.key_at("context", name), used.key_at("context", name)
            problem = f"the mission {used.name!r} is used here and has its own {name!r}, in {where}"
            self._findings.add(at, "conflicting-definition", f"context.{name}", problem, "rename one")

    def _check_apart(self, draft: Draft, node: StateNode, mission: MissionNode, begun: Iterable[str]) -> None:
        """Report variables that restart here and belong to a state that is active at the same time, too."""
        rule, around = "conflicting-definition", list(draft.up())
        for file in each_once(above.file for above in around if isinstance(above.file, MissionNode)):
            self._check_context(file, mission)
        for other in self._using():
            shared = [name for name in begun if other.part is not None and name in other.part.context]
            common = next(above for above in other.up() if above in around)
            if shared and common.kind is Kind.PARALLEL and other not in around:
                what = ", ".join(map(repr, shared))
                problem = f"{other.name!r} is active at the same time and has the same variables: {what}"
                hint = "let one be done after the other"
                self._findings.add(node.at("use"), rule, draft.name, problem, hint)
                break
