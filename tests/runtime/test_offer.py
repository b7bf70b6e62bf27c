"""What is told of the missions that can be asked for."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.runtime.offer import offered
from lupin_engine.runtime.setup import make_machine
from tests import shipped

FIELDS: dict[str, dict[str, Any]] = {
    "exploration": {
        "name": "discovery_goal",
        "type": "count",
        "kind": "integer",
        "required": False,
        "default": 5,
        "computed": "param.discovery_goal",
        "minimum": 1,
    },
    "inspection": {
        "name": "tag_sequence",
        "type": "list of tag",
        "kind": "name",
        "required": False,
        "computed": "tags.named(param.tag_sequence) if len(param.tag_sequence) > 0 else tags.numeric_order()",
        "may_be_empty": False,
    },
}


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_of_a_request_is_told_with_its_bounds(name: str) -> None:
    """The default of the tags is every tag of the layout, which is not written here."""
    (told,) = offered(make_machine(shipped.mission(name), {}), 0.0)
    assert told["summary"]
    (field,) = told["request"]
    assert field == {**FIELDS[name], "default": FIELDS[name].get("default", field["default"])}
