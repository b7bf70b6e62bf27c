"""The grammar of the language's files by path: allowed keys, names, elements; and the meaning of a text.

Most of it is derived from the models of missions, scenarios and bindings; actions have entries of their own.
"""

from __future__ import annotations

import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pydantic.fields import FieldInfo

from lupin_engine.bindings import BindingNode
from lupin_engine.bindings import file as binding_file
from lupin_engine.chart import (
    KINDS,
    ActionNode,
    BeforeDivertNode,
    InvariantNode,
    Keyed,
    Meaning,
    Named,
    Node,
    RaiseNode,
    RecordFieldNode,
    StateNode,
    TransitionNode,
)
from lupin_lsp.scan import Scan, Steps

#: What a file is, by the key that says so.
FILES: Mapping[str, type[Node]] = {**KINDS, binding_file.KIND: BindingNode}

#: What one scalar stands for where a mapping could be written.
SHORT: Mapping[type[Node], str] = {
    TransitionNode: "target",
    ActionNode: "name",
    InvariantNode: "that",
    RecordFieldNode: "type",
    BeforeDivertNode: "within",
}


@dataclass(frozen=True)
class Shape:
    """The permitted content: the keys of a model, named entries, elements, or fixed words."""

    model: type[Node] | None = None
    names: Shape | None = None
    item: Shape | None = None
    words: tuple[str, ...] = ()


@dataclass(frozen=True)
class Spot:
    """A position in the grammar.

    `holder` and `key` are the last model and key on its path, `mapping` the path of the mapping with that key
    (for the arguments of an action: the path of the action's name). `name` is set below named entries: the
    name on the path.
    """

    shape: Shape
    holder: type[Node] | None = None
    key: str = ""
    mapping: Steps = ()
    name: str = ""

    @property
    def field(self) -> FieldInfo | None:
        """The model's field for the key; None where the model has none, and at the top."""
        return fields_of(self.holder).get(self.key) if self.holder else None

    @property
    def value_meaning(self) -> Meaning:
        """The meaning of a scalar here."""
        short = SHORT.get(self.shape.model or (self.shape.item or Shape()).model or Node)
        if short is not None:
            model = self.shape.model or (self.shape.item or Shape()).model
            assert model is not None
            return Meaning.CHILD if self._is_child(short) else meaning_of(model, short) or Meaning.TEXT
        if self.name and self.holder is StateNode and self.key == "out":
            return Meaning.VARIABLE
        if self.name:
            return Meaning.VALUE  # an argument, or a value for a part's parameter
        if self._is_child(self.key):
            return Meaning.CHILD
        found = meaning_of(self.holder, self.key) if self.holder else None
        return found or (Meaning.WORD if self.shape.words else Meaning.TEXT)

    @property
    def name_meaning(self) -> Meaning | None:
        """The meaning of the mapping's keys here, when they are names; else None."""
        if self.shape.model is ActionNode or (self.shape.item and self.shape.item.model is ActionNode):
            return Meaning.ACTION
        if self.shape.names is None:
            return None
        if self.name and self.key == "types":
            return Meaning.ATTRIBUTE
        if self.key in ("with", "arguments") and self.holder is not RaiseNode:
            return Meaning.BINDING if self.holder is StateNode else Meaning.ARGUMENT
        found = self._keys
        return found.meaning if found is not None else None

    @property
    def declares(self) -> bool:
        """Whether names here are declarations, not references."""
        return isinstance(self._keys, Named)

    @property
    def _keys(self) -> Keyed | Named | None:
        metadata = self.field.metadata if self.field else ()
        return next((found for found in metadata if isinstance(found, (Keyed, Named))), None)

    def _is_child(self, key: str) -> bool:
        return key == "target" and "resume_at" in (self.key, *self.mapping[-2:])


@cache
def meaning_of(model: type[Node], key: str) -> Meaning | None:
    """Return the meaning of a text, or of each in a list, under a key; None for data or free text."""
    field = fields_of(model).get(key)
    return next((found for found in field.metadata if isinstance(found, Meaning)), None) if field else None


@cache
def fields_of(model: type[Node]) -> Mapping[str, FieldInfo]:
    """Return the fields of a model by key."""
    return {found.alias or name: found for name, found in model.model_fields.items()}


@cache
def shapes_of(model: type[Node]) -> Mapping[str, Shape]:
    """Return the shape of each key of a model."""
    return {key: shape_of(field.annotation) for key, field in fields_of(model).items()}


def shape_of(annotation: Any) -> Shape:
    """Return the shape of a type annotation of the models."""
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
    """Return the kind of a file, by its characteristic key; None where it has none."""
    words = {token.text for token in found.keys(())}
    return next((model for word, model in FILES.items() if word in words), None)


def spot_at(root: type[Node], path: Steps) -> Spot | None:
    """Return the position in the grammar at a path; None where the path is not allowed."""
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
    if shape.model is ActionNode and step in ("raise", "if"):
        return Spot(shapes_of(ActionNode)[step], ActionNode, step, mapping)
    if shape.model is ActionNode:
        return Spot(Shape(names=Shape()), ActionNode, "arguments", (*mapping, step))
    if shape.model is not None:
        inner = shapes_of(shape.model).get(step)
        return Spot(inner, shape.model, step, mapping) if inner else None
    if shape.names is not None:
        return replace(spot, shape=shape.names, name=step)
    return None
