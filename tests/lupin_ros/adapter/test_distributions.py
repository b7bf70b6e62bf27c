"""What is used of rclpy beside its public interface, which another distribution may have otherwise."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy

from lupin_ros.adapter.environment import distribution

ROOT = Path(__file__).parents[3]
#: By file the names, with the reason why nothing public does. In Jazzy 7.1.5 and Kilted 9.1.2 all are there.
PRIVATE = {
    "lupin_ros/adapter/actions.py": {
        "_feedback_callbacks": "a goal that another process sent, and one that was rejected",
        "_remove_pending_cancel_request": "a cancel request that nobody answers is kept for ever otherwise",
    },
    "lupin_ros/adapter/executor.py": {
        "_guard": "wakes the wait set",
        "_sigint_gc": "wakes the wait set",
        "_is_shutdown": "whether to go on",
        "_take_client": "takes an answer",
        "_take_guard_condition": "takes a wake-up",
        "_take_service": "takes a request of rclpy's own services",
        "_take_subscription": "takes a message",
        "_take_timer": "takes a tick",
        "_take_waitable": "takes what actions and events have",
    },
    "lupin_ros/adapter/lifecycle.py": {
        "_state_machine": "its services would stay until it is collected",
    },
    "lupin_ros/adapter/parameters.py": {
        "_parameter_overrides": "those that are not declared are known nowhere else",
    },
    "lupin_ros/adapter/wait_set.py": {
        "rclpy.impl.implementation_singleton": "the wait set, which rclpy makes anew at each wake-up",
    },
}
#: Gone or renamed since 7.1.5, by the pull request of ros2/rclpy; `_call_task_in_next_spin` came with 1469.
GONE = {"_tasks": 1469}


def private_names() -> set[str]:
    """The private names of rclpy's classes."""
    found: set[str] = set()
    for file in Path(rclpy.__file__).parent.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        found.update(re.findall(r"\bself\.(_[a-z]\w*)", text), re.findall(r"\bdef (_[a-z]\w*)", text))
    return found


def is_own(value: ast.expr) -> bool:
    """Whether an attribute is one of the object itself, or of a class of ours."""
    return bool(re.fullmatch(r"self|cls|super\(\)|[A-Z]\w*", ast.unparse(value)))


def used_in(tree: ast.Module, private: set[str]) -> Iterator[str]:
    """Yield the private names of rclpy that a module reads, sets or overrides, and its private modules."""
    of_rclpy: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "rclpy":
            of_rclpy.update(alias.name for alias in node.names)
            if re.search(r"\.(_|impl\b)", str(node.module)):
                yield str(node.module)
        if isinstance(node, ast.Attribute) and node.attr in private and not is_own(node.value):
            yield node.attr
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and of_rclpy & {ast.unparse(base) for base in node.bases}:
            for part in ast.walk(node):
                if isinstance(part, ast.Attribute) and part.attr in private and is_own(part.value):
                    yield part.attr


def test_nothing_private_is_used_but_what_is_listed() -> None:
    private, found = private_names(), {}
    for folder in ("lupin_ros", "plugins"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            names = set(used_in(ast.parse(file.read_text(encoding="utf-8")), private))
            if names:
                found[str(file.relative_to(ROOT))] = names
    assert found == {file: set(names) for file, names in PRIVATE.items()}


def test_nothing_is_used_that_newer_versions_do_not_have() -> None:
    assert not GONE.keys() & {name for names in PRIVATE.values() for name in names}


def test_the_distribution_is_known() -> None:
    assert distribution() in ("jazzy", "kilted", "lyrical")


@pytest.mark.parametrize("code", ["self._client._tasks", "class A(Node):\n def a(self): super()._tasks"])
def test_a_private_name_is_found(code: str) -> None:
    tree = ast.parse(f"from rclpy.node import Node\n{code}")
    assert set(used_in(tree, {"_tasks"})) == {"_tasks"}
    assert set(used_in(ast.parse("self._tasks"), {"_tasks"})) == set()
