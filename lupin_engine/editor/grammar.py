"""What the models of the language allow at a path: keys, names, elements; and what a text there stands for.

The models in `chart.documents` say what may be written. What they cannot say is what a text means: that
`target` is the name of a state and `guard` an expression. That is the one table here, `MEANINGS`.
"""

from __future__ import annotations

import enum
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pydantic.fields import FieldInfo

from lupin_engine.bindings import file as binding_file
from lupin_engine.bindings.file import (
    ArgumentNode,
    BindingNode,
    BoundOperationNode,
    BoundValueNode,
    ResultNode,
)
from lupin_engine.chart.documents import (
    KINDS,
    ActionNode,
    BudgetNode,
    FileNode,
    ForEachNode,
    HoldNode,
    InputNode,
    InvariantNode,
    InvokeNode,
    ItineraryNode,
    LevelNode,
    LifecycleNode,
    LimitNode,
    MissionNode,
    Node,
    ParameterNode,
    PartNode,
    RequestFieldNode,
    RetryNode,
    StateNode,
    TransitionNode,
    VariableNode,
)
from lupin_engine.editor.scan import Scan, Steps


class Meaning(enum.Enum):
    """What a text stands for."""

    KEY = "key"  #: a word of the language
    STATE = "state"  #: looked for in the nearest enclosing scope
    CHILD = "child"  #: a state inside the one that this is said of
    PART = "part"
    OPERATION = "operation"
    ACTION = "action"
    ARGUMENT = "argument"  #: of the operation or action around it; of `set`: a variable
    BINDING = "binding"  #: a parameter of the part that is used
    EVENT = "event"
    REQUEST = "request"
    ENGAGE = "engage"  #: a request, or a level
    CODE = "code"
    HOLD = "hold"
    TYPE = "type"
    UNIT = "unit"
    LIVE_VALUE = "live value"
    VALUE = "value"  #: plain data, or `${ an expression }`
    CONDITION = "condition"  #: an expression
    WORD = "word"  #: one of a few
    TEXT = "text"  #: anything
    PARAMETER = "parameter"
    INPUT = "input"
    LEVEL = "level"
    VARIABLE = "variable"
    FIELD = "field"
    INVARIANT = "invariant"
    FILE = "file"  #: the name that a file gives itself
    FUNCTION = "function"
    ROOT = "root"  #: what an expression begins to read: a record, a variable, an element
    ATTRIBUTE = "attribute"  #: what is read of it
    ANYWHERE = "anywhere"  #: a state, by the end of its full name: in_state


#: What a file is, by the key that says so.
FILES: Mapping[str, type[Node]] = {**KINDS, binding_file.KIND: BindingNode}

#: What the value of a key stands for, or each element of its list. What is not here is data or free text.
MEANINGS: Mapping[tuple[type[Node], str], Meaning] = {
    (TransitionNode, "target"): Meaning.STATE,
    (TransitionNode, "guard"): Meaning.CONDITION,
    (TransitionNode, "refuse"): Meaning.CODE,
    (TransitionNode, "during"): Meaning.HOLD,
    (TransitionNode, "releases"): Meaning.HOLD,
    (TransitionNode, "code"): Meaning.CODE,
    (TransitionNode, "use"): Meaning.STATE,
    (LimitNode, "after"): Meaning.VALUE,
    (LimitNode, "code"): Meaning.CODE,
    **{(RetryNode, key): Meaning.VALUE for key in ("attempts", "backoff", "factor", "jitter")},
    (RetryNode, "unless"): Meaning.CODE,
    (InvokeNode, "do"): Meaning.OPERATION,
    **{(ForEachNode, key): Meaning.VALUE for key in ("in", "key", "limit")},
    (ForEachNode, "when"): Meaning.CONDITION,
    (BudgetNode, "after"): Meaning.VALUE,
    (BudgetNode, "code"): Meaning.CODE,
    (BudgetNode, "target"): Meaning.STATE,
    **{(ItineraryNode, key): Meaning.VALUE for key in ("items", "order", "sweeps")},
    (StateNode, "initial"): Meaning.CHILD,
    (StateNode, "use"): Meaning.PART,
    (ParameterNode, "type"): Meaning.TYPE,
    (ParameterNode, "unit"): Meaning.UNIT,
    (VariableNode, "type"): Meaning.TYPE,
    (VariableNode, "default"): Meaning.VALUE,
    **{(LevelNode, key): Meaning.VALUE for key in ("below", "above", "hysteresis")},
    (InputNode, "value"): Meaning.LIVE_VALUE,
    (InputNode, "unit"): Meaning.UNIT,
    (HoldNode, "engage"): Meaning.ENGAGE,
    (HoldNode, "release"): Meaning.REQUEST,
    (HoldNode, "code"): Meaning.CODE,
    (HoldNode, "engage_guard"): Meaning.CONDITION,
    (HoldNode, "engage_code"): Meaning.CODE,
    (HoldNode, "release_guard"): Meaning.CONDITION,
    (RequestFieldNode, "type"): Meaning.TYPE,
    (RequestFieldNode, "default"): Meaning.VALUE,
    (RequestFieldNode, "not_empty"): Meaning.CODE,
    (InvariantNode, "that"): Meaning.CONDITION,
    (FileNode, "initial"): Meaning.CHILD,
    (LifecycleNode, "lifecycle"): Meaning.FILE,
    (MissionNode, "mission"): Meaning.FILE,
    (PartNode, "part"): Meaning.PART,
    (ActionNode, "name"): Meaning.ACTION,
    (BindingNode, "binding"): Meaning.FILE,
    **{(node, "type"): Meaning.TYPE for node in (ArgumentNode, ResultNode)},
    **{(node, "unit"): Meaning.UNIT for node in (ArgumentNode, ResultNode)},
    **{(BoundOperationNode, key): Meaning.CODE for key in ("code", "unavailable", "rejected")},
    (BoundValueNode, "type"): Meaning.TYPE,
    (BoundValueNode, "unit"): Meaning.UNIT,
}
#: What the keys stand for in a mapping of names.
NAMES: Mapping[str, Meaning] = {
    "states": Meaning.STATE,
    "params": Meaning.PARAMETER,
    "inputs": Meaning.INPUT,
    "levels": Meaning.LEVEL,
    "codes": Meaning.CODE,
    "context": Meaning.VARIABLE,
    "invariants": Meaning.INVARIANT,
    "holds": Meaning.HOLD,
    "request": Meaning.FIELD,
    "on": Meaning.EVENT,
    "after": Meaning.VALUE,
}
#: Where those names are declared, and not only mentioned.
DECLARING = frozenset({*NAMES} - {"on", "after"})
#: What one scalar stands for where a mapping could be written.
SHORT: Mapping[type[Node], str] = {TransitionNode: "target", ActionNode: "name", InvariantNode: "that"}


@dataclass(frozen=True)
class Shape:
    """What may be written: the keys of a model, names with something under each, elements, or words."""

    model: type[Node] | None = None
    names: Shape | None = None
    item: Shape | None = None
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Spot:
    """A place in the language.

    `holder` and `key` are the model and the key that a path went through last, `mapping` the path of the
    mapping with that key (for the arguments of an action: the path of the action's name). `name` is set below
    a mapping of names: the one that the path went through.
    """

    shape: Shape
    holder: type[Node] | None = None
    key: str = ""
    mapping: Steps = ()
    name: str = ""

    @property
    def field(self) -> FieldInfo | None:
        """The model's own word on the key."""
        return fields_of(self.holder).get(self.key) if self.holder else None

    @property
    def value_meaning(self) -> Meaning:
        """What a scalar here stands for."""
        short = SHORT.get(self.shape.model or (self.shape.item or Shape()).model or Node)
        if short is not None:
            model = self.shape.model or (self.shape.item or Shape()).model
            assert model is not None
            return Meaning.CHILD if self._is_child(short) else MEANINGS[model, short]
        if self.name:
            return Meaning.VALUE  # an argument, or a value for a part's parameter
        if self._is_child(self.key):
            return Meaning.CHILD
        found = _meaning(self.holder, self.key) if self.holder else None
        return found or (Meaning.WORD if self.shape.words else Meaning.TEXT)

    @property
    def name_meaning(self) -> Meaning | None:
        """What the keys of the mapping here stand for, when they are names."""
        if self.shape.model is ActionNode or (self.shape.item and self.shape.item.model is ActionNode):
            return Meaning.ACTION
        if self.shape.names is None:
            return None
        if self.key in ("with", "arguments"):
            return Meaning.BINDING if self.holder is StateNode else Meaning.ARGUMENT
        return NAMES.get(self.key)

    def _is_child(self, key: str) -> bool:
        return key == "target" and "resume_at" in (self.key, *self.mapping[-2:])


def _meaning(holder: type[Node], key: str) -> Meaning | None:
    return next((MEANINGS[base, key] for base in holder.__mro__ if (base, key) in MEANINGS), None)


@cache
def fields_of(model: type[Node]) -> Mapping[str, FieldInfo]:
    """Return what a model says of each of its keys."""
    return {found.alias or name: found for name, found in model.model_fields.items()}


@cache
def shapes_of(model: type[Node]) -> Mapping[str, Shape]:
    """Return what may be written under each key of a model."""
    return {key: shape_of(field.annotation) for key, field in fields_of(model).items()}


def shape_of(annotation: Any) -> Shape:
    """Return what a type of the models lets one write."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return shape_of(arguments[0])
    if origin is typing.Literal:
        return Shape(words=tuple(str(word) for word in arguments))
    if origin is list:
        return Shape(item=shape_of(arguments[0]))
    if origin is dict:
        return Shape(names=shape_of(arguments[1]))
    if origin in (typing.Union, types.UnionType):
        return _joined([shape_of(kind) for kind in arguments if kind is not type(None)])
    if isinstance(annotation, type) and issubclass(annotation, Node):
        return Shape(model=annotation)
    return Shape(words=("true", "false")) if annotation is bool else Shape()


def _joined(shapes: Sequence[Shape]) -> Shape:
    found = Shape()
    for shape in shapes:
        found = Shape(
            model=found.model or shape.model,
            names=found.names or shape.names,
            item=found.item or shape.item,
            words=found.words + shape.words,
        )
    return found


def kind_of(found: Scan) -> type[Node] | None:
    """Return what a file is, by the key that says so."""
    words = {token.text for token in found.keys(())}
    return next((model for word, model in FILES.items() if word in words), None)


def spot_at(root: type[Node], path: Steps) -> Spot | None:
    """Return the place in the language at a path; None where the language has nothing."""
    spot = Spot(Shape(model=root))
    for at, step in enumerate(path):
        below = _below(spot, step, path[:at])
        if below is None:
            return None
        spot = below
    return spot


def _below(spot: Spot, step: str | int, mapping: Steps) -> Spot | None:
    shape = spot.shape
    if isinstance(step, int):
        return replace(spot, shape=shape.item) if shape.item else None
    if shape.item is not None and shape.names is None and shape.model is None:
        return _below(replace(spot, shape=shape.item), step, mapping)  # one alone stands for the list
    if shape.model is ActionNode:
        return Spot(Shape(names=Shape()), ActionNode, "arguments", (*mapping, step))
    if shape.model is not None:
        inner = shapes_of(shape.model).get(step)
        return Spot(inner, shape.model, step, mapping) if inner else None
    if shape.names is not None:
        return replace(spot, shape=shape.names, name=step)
    return None


__all__ = [
    "DECLARING",
    "FILES",
    "MEANINGS",
    "NAMES",
    "SHORT",
    "Meaning",
    "Shape",
    "Spot",
    "fields_of",
    "kind_of",
    "shape_of",
    "shapes_of",
    "spot_at",
]
