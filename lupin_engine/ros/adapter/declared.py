"""The parameters of a node: declared with type and range, given at the start, changed while it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from structlog.typing import FilteringBoundLogger

from lupin_engine.errors import LupinError, nearest
from lupin_engine.plugin.contract import Parameter
from lupin_engine.ros.adapter import parameters as ros_parameters

#: Parameters by name.
Declared = Mapping[str, Parameter]
#: Gets new values by name; returns None to take them or a text that says why not.
OnChange = Callable[[Mapping[str, Any]], str | None]

#: Parameters that ROS itself reads from the command line.
_ROS_OWN = ("use_sim_time", "start_type_description_service")


class DeclaredParameters:
    """What `RosNode` knows of its parameters; see there for what the methods promise."""

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
        self._refuse_unknown(_names_said(arguments))
        values = self.starting_values(self._specs)
        for name, spec in self._specs.items():
            self._declare(name, spec, values[name])
        node.add_pre_set_parameters_callback(self._before_set)
        node.add_on_set_parameters_callback(self._on_set)

    def values(self) -> dict[str, Any]:
        """Return the current values as plain data in base units."""
        return {
            name: ros_parameters.read(name, spec, self._node.get_parameter_or(name).value)
            for name, spec in self._specs.items()
        }

    def on_change(self, callback: OnChange) -> None:
        """Allow changes at run time, if `callback` takes them."""
        self._on_change.append(callback)

    def set(self, name: str, value: Any) -> None:
        """Correct a parameter from inside the node."""
        self._node.set_parameters([ros_parameters.to_ros(name, self._specs[name], value)])

    def starting_values(self, specs: Declared) -> dict[str, Any]:
        """Return what parameters would be if the node was started with them; nothing changes."""
        for name, spec in specs.items():
            ros_parameters.ros_type(name, spec.type)
        return ros_parameters.starting_values(specs, self._given())

    def declare_anew(self, specs: Declared) -> None:
        """Have exactly these parameters: new and changed ones as at a start, the others as they are."""
        values = self.starting_values(specs)
        kept = {name for name, spec in self._specs.items() if specs.get(name) == spec}
        for name in set(self._specs) - kept:
            self._node.undeclare_parameter(name)
        # What is set here was checked just now, and is no change of what somebody reads.
        self._node.remove_on_set_parameters_callback(self._on_set)
        try:
            self._specs = dict(specs)
            for name in specs:
                if name not in kept:
                    self._declare(name, specs[name], values[name])
        finally:
            self._node.add_on_set_parameters_callback(self._on_set)

    def _declare(self, name: str, spec: Parameter, value: Any) -> None:
        kind = ros_parameters.ros_type(name, spec.type)
        # Declared without the override, which may be an integer for a double, and then set.
        self._node.declare_parameter(name, kind, ros_parameters.descriptor(spec), ignore_override=True)
        given = ros_parameters.to_ros(name, spec, value)
        if given.type_ != RosParameter.Type.NOT_SET:
            self._node.set_parameters([given])

    # --- at the start

    def _given(self) -> dict[str, Any]:
        return {name: override.value for name, override in self._node._parameter_overrides.items()}

    def _refuse_unknown(self, said: Iterable[str]) -> None:
        """Refuse unknown names of `-p`; one that a parameter file has may be meant for other nodes."""
        problems = []
        for name in self._given():
            if name in self._specs or self._is_ros_own(name):
                continue
            problem = f"parameter {name!r} is not known to this node; {nearest(name, self._specs)}"
            if name in said:
                problems.append(problem)
            else:
                self._log.warning(problem)
        if problems:
            raise LupinError("\n".join(problems))

    def _is_ros_own(self, name: str) -> bool:
        own = name in _ROS_OWN or name.startswith("qos_overrides.")
        return own or bool(self._node.has_parameter(name))

    # --- while the node runs

    def _before_set(self, changes: list[RosParameter]) -> list[RosParameter]:
        return [self._retyped(change) for change in changes]

    def _retyped(self, change: RosParameter) -> RosParameter:
        """Return an integer given for a double as a double; what cannot be read stays as it is."""
        spec = self._specs.get(change.name)
        if spec is None:
            return change
        try:
            value = ros_parameters.read(change.name, spec, change.value)
        except (ValueError, TypeError):
            return change  # refused later, with the reason
        return ros_parameters.to_ros(change.name, spec, value)

    def _on_set(self, changes: list[RosParameter]) -> SetParametersResult:
        mine = [change for change in changes if change.name in self._specs]
        reason = self._refusal(mine) if mine else None
        return SetParametersResult(successful=reason is None, reason=reason or "")

    def _refusal(self, changes: list[RosParameter]) -> str | None:
        names = ", ".join(change.name for change in changes)
        if not self._on_change:
            return f"{names}: read at the start of the node only; restart it with -p"
        try:
            values = {c.name: ros_parameters.read(c.name, self._specs[c.name], c.value) for c in changes}
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
