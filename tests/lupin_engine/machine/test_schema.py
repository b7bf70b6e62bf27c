"""How the fields of the memory are kept: each says it, and nobody else has a list of them."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.machine.memory import Memory
from lupin_engine.machine.schema import FieldKind, Life, MemoryField, kept

ROOT = Path(__file__).parents[3]


@dataclass(slots=True)
class Silent(Memory):
    """One that does not say how a field is kept."""

    marks: list[str] = field(default_factory=list)


@dataclass(slots=True)
class Ownerless(Memory):
    """One of which nobody knows under which names entries are kept."""

    marks: dict[str, str] = field(default_factory=dict, metadata=kept(Life.MISSION, FieldKind.BY_KEY))


@pytest.mark.parametrize("one", fields(Memory), ids=lambda one: one.name)
def test_a_field_says_how_it_is_kept(one: Field[Any]) -> None:
    """In its metadata, and a memory without is refused when it is first asked for."""
    assert isinstance(one.metadata.get("kept"), MemoryField)


def test_the_schema_has_every_field() -> None:
    """In their order, each with what it is when it is empty."""
    assert {one.name: one.empty() for one in Memory.schema()} == {
        one.name: getattr(Memory(), one.name) for one in fields(Memory)
    }


@pytest.mark.parametrize(
    ("kind", "lacks"), [(Silent, "how it is kept"), (Ownerless, "what owns its entries")]
)
def test_a_field_that_does_not_say_enough_is_refused(kind: type[Memory], lacks: str) -> None:
    """By name, with what to write."""
    with pytest.raises(TypeError, match=rf"marks does not say {lacks}: add "):
        kind.schema()


@pytest.mark.slow
def test_a_field_that_is_planted_is_kept_as_it_says() -> None:
    """Snapshot, clock, reload, the next mission and a proof: see the module, which looks at all of them."""
    command = [sys.executable, "-m", "tests.workbench.lupin_verify.planted.field"]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert found.returncode == 0, found.stderr
