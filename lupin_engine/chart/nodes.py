"""The base of every model of a mapping: its place, and the meaning of its texts."""

from __future__ import annotations

import enum
import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, ModelWrapValidatorHandler, model_validator
from pydantic_core import PydanticCustomError

from lupin_engine.chart.source import Map, Seq, Text
from lupin_engine.errors import Place

_M = TypeVar("_M", bound="Node")

#: The version of the language that this engine speaks: `lupin: 1`.
LANGUAGE = 1

_NUMBER = re.compile(r"(\d+(?:\.\d+)?)\s*([a-z]+)?")


class Meaning(enum.Enum):
    """The meaning of a text."""

    KEY = "key"  #: a word of the language
    STATE = "state"  #: looked for in the nearest enclosing scope
    CHILD = "child"  #: a state inside the one that this is said of
    LIFECYCLE = "lifecycle"  #: one that is shipped
    PART = "part"  #: or a mission that is used as one
    OPERATION = "operation"
    ACTION = "action"
    ARGUMENT = "argument"  #: of the operation or action around it; of `set`: a variable
    BINDING = "binding"  #: a parameter of the part that is used, a field of the mission's request
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
    PROPERTY = "property"
    FILE = "file"  #: the name that a file gives itself
    FUNCTION = "function"
    ROOT = "root"  #: what an expression begins to read: a record, a variable, an element
    ATTRIBUTE = "attribute"  #: what is read of it
    ANYWHERE = "anywhere"  #: a state, by the end of its full name: in_state


class Keyed(NamedTuple):
    """Marks a mapping with the meaning of its keys."""

    meaning: Meaning


class Named(NamedTuple):
    """Marks a mapping that declares its keys, with their meaning."""

    meaning: Meaning


class Node(BaseModel):
    """A mapping of the language that remembers where it was read.

    `ELSEWHERE` holds keys that belong somewhere else, each with the problem and the hint of its message.
    `SHAPE` is the expected form in the message about a value that is no mapping; `LINE` is the correct line
    for a number alone, with another number in its place.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType({})
    SHAPE: ClassVar[str] = ""
    LINE: ClassVar[str] = ""

    # A slot and no private attribute of pydantic's, which would take as long to set as all the rest to read.
    __slots__ = ("_raw",)
    if TYPE_CHECKING:
        _raw: Any

    @model_validator(mode="wrap")
    @classmethod
    def _remember(cls: type[_M], data: Any, handler: ModelWrapValidatorHandler[_M]) -> _M:
        if isinstance(data, Map):
            data.model = cls
        node = handler(cls._long_form(data))
        object.__setattr__(node, "_raw", data)
        return node

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        """Return the mapping that a short form stands for; raises `wrong_shape` where a mapping is needed."""
        if cls.SHAPE and not isinstance(data, Map):
            raise wrong_shape(f"expected {cls.SHAPE}, got {show(data)}{cls._line_for(data)}")
        return data

    @classmethod
    def _line_for(cls, data: Any) -> str:
        """Return a corrected line for a number alone, with the unit that the line has where it has none."""
        given = _NUMBER.fullmatch(str(data)) if isinstance(data, (str, int, float)) else None
        if given is None or not cls.LINE:
            return ""
        number, unit = given.groups()
        line = re.sub(r"\d+( s)?", lambda m: number + (f" {unit}" if unit else m[1] or ""), cls.LINE)
        return f"; write '{line}'"

    @property
    def place(self) -> Place:
        """Where this mapping, or the text that stands for it, begins."""
        raw = self._raw
        found: Place = raw.file.place(raw.start)
        return found

    @property
    def content(self) -> Map:
        """This mapping as it was read."""
        raw: Map = self._raw
        return raw

    @property
    def written(self) -> bool:
        """Say whether this was read as a mapping, not as a short form."""
        return isinstance(self._raw, Map)

    def at(self, key: str, index: int | None = None) -> Place:
        """Return where the value of `key` stands (or its element `index`), else where this mapping begins."""
        if not isinstance(self._raw, Map) or key not in self._raw:
            return self.place
        value = self._raw[key]
        if index is not None and isinstance(value, Seq):
            return value.place_of(index)
        return self._raw.value_place(key)

    def key_at(self, key: str, *inner: str) -> Place:
        """Return where the key itself stands, or a key in its mapping, as deep as there is one."""
        holder, last = self._deepest(key, *inner)
        return self.place if holder is None else holder.key_place(last)

    def text_of_key(self, key: str, inner: str) -> Text:
        """Return a key of the mapping under `key` as it was written."""
        text: Text = self._raw[key].key_text(inner)
        return text

    def mapping(self, key: str) -> Map | None:
        """Return the mapping under `key` as it was read, with its places; None where there is no mapping."""
        found = self._raw.get(key) if isinstance(self._raw, Map) else None
        return found if isinstance(found, Map) else None

    def value_at(self, key: str, *inner: str) -> Place:
        """Return where a value in nested mappings stands, as deep as there is one."""
        holder, last = self._deepest(key, *inner)
        return self.place if holder is None else holder.value_place(last)

    def _deepest(self, *words: str) -> tuple[Map | None, str]:
        """Follow keys into nested mappings; return the last mapping that had its key, and that key.

        None and '' where not even the first key is there.
        """
        raw, holder, last = self._raw, None, ""
        for name in words:
            if not isinstance(raw, Map) or name not in raw:
                break
            holder, last, raw = raw, name, raw[name]
        return holder, last


def wrong_shape(text: str) -> PydanticCustomError:
    """Return the exception of a model for a value of another shape; `text` is problem and hint."""
    return PydanticCustomError("wrong-shape", "{text}", {"text": text})


def _spoken(value: Any) -> Any:
    """Return the language's version that a file names; raises `wrong_shape` for any but this engine's."""
    if isinstance(value, int) and not isinstance(value, bool):
        if value == LANGUAGE:
            return value
        this = f"this engine speaks version {LANGUAGE} of the language, and the file is of version {value}"
        if value > LANGUAGE:
            raise wrong_shape(f"{this}; update the engine: pip install --upgrade lupin-engine")
        raise wrong_shape(f"{this}; write 'lupin: {LANGUAGE}'")
    raise wrong_shape(f"expected the version of the language, got {show(value)}; write 'lupin: {LANGUAGE}'")


#: The key `lupin` of a file.
Version = Annotated[int | None, BeforeValidator(_spoken, json_schema_input_type=Literal[1])]
VERSION_HELP = "version of the language; without it the current one"


def keys_of(model: type[Node]) -> tuple[str, ...]:
    """Return the keys that a mapping of this model may have."""
    return tuple(field.alias or name for name, field in model.model_fields.items())


def show(value: Any) -> str:
    """Return a value as a person would recognise it: short, without the machinery around it."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a mapping" + (f" with {_some(value)}" if value else "")
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = repr(str(value)) if isinstance(value, Text) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _some(names: Iterable[str]) -> str:
    shown = [repr(name) for name in names]
    return ", ".join(shown[:4]) + (", ..." if len(shown) > 4 else "")
