"""The parameters of a node: declared with type and range, given at the start, changed while it runs.

ROS knows bool, integer, double, string and flat lists of them. A record of numbers (a pose) travels as the
list of its fields in their order, metres and radians; an empty list stands for a record that is not given.
Any other record, and records in a list, travel as a text of JSON, numbers in base units or with their unit.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from lupin_engine.errors import LupinError, PluginError, nearest, shortened
from lupin_engine.plugin import (
    MAX_INTEGER,
    Parameter,
    Type,
    broken_text,
    carried_as,
    elements_of,
    is_json,
    named,
    narrowed,
    sorted_out,
    without_repetition,
)
from lupin_ros.adapter.frames import FRAME_PREFIX

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

_ROS_TYPES = {
    "bool": RosParameter.Type.BOOL,
    "integer": RosParameter.Type.INTEGER,
    "number": RosParameter.Type.DOUBLE,
    "text": RosParameter.Type.STRING,
    "list of bool": RosParameter.Type.BOOL_ARRAY,
    "list of integer": RosParameter.Type.INTEGER_ARRAY,
    "list of number": RosParameter.Type.DOUBLE_ARRAY,
    "list of text": RosParameter.Type.STRING_ARRAY,
}


#: The most problems of one value that are reported.
MAX_REPORTED = 8


def ros_type(name: str, kind: Type) -> RosParameter.Type:
    """Return the ROS type that carries `kind`.

    Raises:
        PluginError: ROS has no parameter type for it.
    """
    carried = carried_as(kind)
    if carried:
        return _ROS_TYPES[carried]
    raise PluginError(f"parameter {name!r}: type {kind} cannot be a ROS parameter")


def descriptor(spec: Parameter) -> ParameterDescriptor:
    """Return the descriptor that `ros2 param describe` shows: documentation, unit and range or choice."""
    kind, unit = spec.type, _unit(spec.type)
    described = ParameterDescriptor(description=f"{spec.doc} [{unit}]" if unit else spec.doc)
    if kind.values:
        described.additional_constraints = f"one of {', '.join(kind.values)}"
    low, high = narrowed(spec).minimum, narrowed(spec).maximum
    if low is None and high is None:
        return described
    if kind.kind == "list":
        described.additional_constraints = elements_of(kind)
    if kind.kind == "integer":
        from_value = -MAX_INTEGER if low is None else math.ceil(low)
        to_value = MAX_INTEGER if high is None else math.floor(high)
        described.integer_range = [IntegerRange(from_value=from_value, to_value=to_value, step=0)]
    elif kind.kind == "number":
        from_float = -math.inf if low is None else float(low)
        to_float = math.inf if high is None else float(high)
        described.floating_point_range = [
            FloatingPointRange(from_value=from_float, to_value=to_float, step=0.0)
        ]
    return described


def _unit(kind: Type) -> str:
    """Return the unit of a number; of a record, which is sent as a list, each field's; of JSON its form."""
    if is_json(kind):
        return f"JSON, numbers in base units: {_form(kind)}"
    fields = (f"{name} {field.unit}".rstrip() for name, field in kind.fields.items())
    return ", ".join(fields) if kind.kind == "record" else kind.unit


def _form(kind: Type) -> str:
    """Return how a value of a type is written as JSON, with types or units for values."""
    if kind.item is not None:
        return f"[{_form(kind.item)}, ...]"
    if kind.kind == "record":
        return "{" + ", ".join(f"{name}: {_form(field)}" for name, field in kind.fields.items()) + "}"
    return kind.unit or kind.name


def read(name: str, spec: Parameter, value: Any) -> Any:
    """Return a value from ROS as plain checked data in base units.

    Integers are taken for numbers, `60 s` in text for a number with that unit, a list of three numbers for
    a pose, JSON for other records. None and an empty list mean "not given" where the default is None; else
    None is an empty list.

    Raises:
        ValueError: wrong type or out of range; the text names parameter, value and allowed values.
    """
    if spec.default is None and _is_nothing(spec, value):
        return None
    try:
        unpacked = _unpacked(spec.type, value)
    except ValueError as error:
        raise ValueError(f"parameter {name!r}: {error}{_hint(spec.type, value)}") from None
    try:
        return named(name, spec, unpacked)
    except ValueError as error:
        first, *more = str(error).split("\n")
        told = [first, *more[: MAX_REPORTED - 1]]
        if len(more) >= MAX_REPORTED:
            told.append(f"and {len(more) + 1 - MAX_REPORTED} more")
        raise ValueError("\n".join(told) + _hint(spec.type, value)) from None


def to_ros(name: str, spec: Parameter, value: Any) -> RosParameter:
    """Return checked data as a ROS parameter.

    A value has its type, since rclpy takes an empty list for a byte array; None may have none.

    Raises:
        PluginError: no ROS parameter can have this type.
    """
    kind = ros_type(name, spec.type)
    if value is not None and is_json(spec.type):
        value = json.dumps(value, ensure_ascii=False)
    elif isinstance(value, Mapping):
        value = [float(value[field]) for field in spec.type.fields]
    elif value is None and spec.type.kind in ("record", "list") and not is_json(spec.type):
        value = []
    if value is None:
        return RosParameter(name, RosParameter.Type.NOT_SET, None)
    return RosParameter(name, kind, value)


def starting_values(specs: Mapping[str, Parameter], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of every parameter: the given one where there is one, else the default.

    Raises:
        LupinError: some given values cannot be used; the text lists all of them, one a line.
    """
    wanted = {name: given.get(name, spec.default) for name, spec in specs.items()}
    values, problems = sorted_out(specs, wanted, read)
    if problems:
        raise LupinError("\n".join(problems))
    return values


def _is_nothing(spec: Parameter, value: Any) -> bool:
    # rcl hands over `[]` from the command line as "not set".
    return value is None or (spec.type.kind in ("record", "list") and _plain(value) == [])


def _from_json(text: str) -> Any:
    """Return JSON as data, and what is none as a text.

    Raises:
        ValueError: it begins as JSON and is broken; the text says where.
    """
    try:
        return json.loads(text, object_pairs_hook=without_repetition)
    except RecursionError:
        return shortened(text)  # refused as a text
    except json.JSONDecodeError as error:
        if not text.lstrip().startswith(("[", "{")):
            return shortened(text)
        at = len(text) if error.msg.startswith("Unterminated") else error.pos
        raise ValueError(broken_text(text, at, error.msg)) from None


def _unpacked(kind: Type, value: Any) -> Any:
    if is_json(kind) and isinstance(value, str):
        return _from_json(value)
    if kind.kind == "list":
        return [] if value is None else _plain(value)
    if kind.kind == "record" and not isinstance(value, Mapping):
        parts = _plain(value)
        if isinstance(parts, list) and len(parts) == len(kind.fields):
            return dict(zip(kind.fields, parts, strict=True))
    return value


def _plain(value: Any) -> Any:
    # rclpy delivers lists as array.array of the C type.
    return value if isinstance(value, str) or not hasattr(value, "__iter__") else list(value)


def _hint(kind: Type, value: Any) -> str:
    if is_json(kind):
        return f"; give it as JSON: {_form(kind)}"
    if kind.kind == "record":
        return f"; give it as [{', '.join(kind.fields)}]"
    wants_text = kind.kind == "text" or (kind.item is not None and kind.item.kind == "text")
    if wants_text and not isinstance(value, str):
        given = _plain(value)
        if kind.kind == "list":
            given = [str(v) for v in given] if isinstance(given, list) else [str(given)]
        return f"; write {json.dumps(given if kind.kind == 'list' else str(given))}"
    if kind.kind == "list" and isinstance(value, (str, int, float)):
        return f"; write [{value}]"
    return ""


# -- the parameters of one node ---------------------------------------------------------------------------

#: Parameters by name.
Declared = Mapping[str, Parameter]
#: Gets new values by name; returns None to accept them, or why not.
OnChange = Callable[[Mapping[str, Any]], str | None]
#: Gets values that ROS has stored.
Stored = Callable[[Mapping[str, Any]], None]

#: Parameters that ROS itself or the adapter reads from the command line.
_ROS_OWN = ("use_sim_time", "start_type_description_service", FRAME_PREFIX)


class DeclaredParameters:
    """The declared parameters of a `RosNode`, which documents the methods."""

    def __init__(
        self,
        node: Node,
        log: FilteringBoundLogger,
        arguments: Sequence[str],
        declared: Declared | Callable[[Mapping[str, Any]], Declared],
    ) -> None:
        self._node = node
        self._log = log
        self._specs = dict(declared(self._given()) if callable(declared) else declared)
        self._on_change: list[OnChange] = []
        self._hear_of_stored: list[Stored] = []
        self._refuse_unknown(_names_said(arguments))
        values = starting_values(self._specs, self._given())
        for name, spec in self._specs.items():
            self._declare(name, spec, values[name])
        node.add_pre_set_parameters_callback(lambda changes: [self._retyped(one) for one in changes])
        node.add_on_set_parameters_callback(self._on_set)
        node.add_post_set_parameters_callback(self._on_stored)

    def values(self) -> dict[str, Any]:
        """Return the current values as plain data in base units."""
        return {
            name: read(name, spec, self._node.get_parameter_or(name).value)
            for name, spec in self._specs.items()
        }

    def on_change(self, callback: OnChange, stored: Stored | None = None) -> None:
        """Allow changes at run time if `callback` accepts them; `stored` gets those that were made."""
        self._on_change.append(callback)
        if stored is not None:
            self._hear_of_stored.append(stored)

    def set(self, name: str, value: Any) -> None:
        """Correct a parameter from inside the node.

        Raises:
            LupinError: a callback refuses the value, or ROS does; the parameter is as before.
        """
        self._store(to_ros(name, self._specs[name], value))

    def _store(self, parameter: RosParameter) -> None:
        (result,) = self._node.set_parameters([parameter])
        if not result.successful:
            raise LupinError(f"parameter {parameter.name!r} was not set: {result.reason}")

    def values_with(self, specs: Declared) -> dict[str, Any]:
        """Return the values after a `declare_anew`, without changing anything.

        Raises:
            LupinError: the texts of all values that are wrong for these parameters.
        """
        for name, spec in specs.items():
            ros_type(name, spec.type)
        kept = {name: value for name, value in self.values().items() if specs.get(name) == self._specs[name]}
        return starting_values(specs, self._given()) | kept

    def declare_anew(self, specs: Declared) -> None:
        """Have exactly these parameters: new and changed ones as at a start, the others as they are.

        Errors as for `values_with`; then nothing has changed.
        """
        values = self.values_with(specs)
        kept = {name for name, spec in self._specs.items() if specs.get(name) == spec}
        for name in set(self._specs) - kept:
            self._node.undeclare_parameter(name)
        # These values were checked just now, and no callback needs to hear of them.
        self._node.remove_on_set_parameters_callback(self._on_set)
        self._node.remove_post_set_parameters_callback(self._on_stored)
        try:
            self._specs = dict(specs)
            for name in specs:
                if name not in kept:
                    self._declare(name, specs[name], values[name])
        finally:
            self._node.add_on_set_parameters_callback(self._on_set)
            self._node.add_post_set_parameters_callback(self._on_stored)

    def _declare(self, name: str, spec: Parameter, value: Any) -> None:
        kind = ros_type(name, spec.type)
        # Declared without the override, which may be an integer for a double, and then set.
        self._node.declare_parameter(name, kind, descriptor(spec), ignore_override=True)
        given = to_ros(name, spec, value)
        if given.type_ != RosParameter.Type.NOT_SET:
            self._store(given)

    # --- at the start

    def _given(self) -> dict[str, Any]:
        return {name: override.value for name, override in self._node._parameter_overrides.items()}

    def _refuse_unknown(self, said: Iterable[str]) -> None:
        """Raise LupinError for unknown names of `-p`; warn of those of a file, which has others' perhaps."""
        problems = []
        for name in self._given():
            own = name in _ROS_OWN or name.startswith("qos_overrides.") or self._node.has_parameter(name)
            if name in self._specs or own:
                continue
            problem = f"parameter {name!r} is not known to this node; {nearest(name, self._specs)}"
            if name in said:
                problems.append(problem)
            else:
                self._log.warning(problem)
        if problems:
            raise LupinError("\n".join(problems))

    # --- while the node runs

    def _retyped(self, change: RosParameter) -> RosParameter:
        """Return an integer given for a double as a double; a value that cannot be read is unchanged."""
        spec = self._specs.get(change.name)
        if spec is None:
            return change
        try:
            value = read(change.name, spec, change.value)
        except (ValueError, TypeError):
            return change  # refused later, with the reason
        return to_ros(change.name, spec, value)

    def _on_set(self, changes: list[RosParameter]) -> SetParametersResult:
        mine = [change for change in changes if change.name in self._specs]
        reason = self._refusal(mine) if mine else None
        return SetParametersResult(successful=reason is None, reason=reason or "")

    def _on_stored(self, changes: list[RosParameter]) -> None:
        mine = [change for change in changes if change.name in self._specs]
        values = {change.name: read(change.name, self._specs[change.name], change.value) for change in mine}
        for callback in self._hear_of_stored if values else ():
            callback(values)

    def _refusal(self, changes: list[RosParameter]) -> str | None:
        """Return why changes are refused: by their types, or by a callback; None where they are taken."""
        names = ", ".join(change.name for change in changes)
        if not self._on_change:
            return f"{names}: read at the start of the node only; restart it with -p"
        try:
            values = {c.name: read(c.name, self._specs[c.name], c.value) for c in changes}
            for callback in self._on_change:
                reason = callback(values)
                if reason is not None:
                    return reason
        except ValueError as error:
            return str(error)
        except Exception as error:
            self._log.exception("setting parameters failed", names=names)
            return f"{names}: {error}"
        return None


def _names_said(arguments: Sequence[str]) -> frozenset[str]:
    """Return the names of the parameters given by `-p [NODE:]NAME:=VALUE`."""
    rules = [rule for flag, rule in pairwise(arguments) if flag in ("-p", "--param")]
    return frozenset(rule.partition(":=")[0].rpartition(":")[2] for rule in rules)
