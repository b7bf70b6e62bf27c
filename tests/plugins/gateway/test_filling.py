"""What a page sends, written into messages: what fits, and what is told where it does not."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_gateway.filling import DoesNotFit, filled
from lupin_gateway.shapes import Listed, MessageShape, NotCarried, shape_of

POINT = MessageShape("some_msgs/msg/Point", {"x": "double", "y": "double"}, SimpleNamespace)
ALL = MessageShape(
    "some_msgs/msg/All",
    {
        "name": "string", "flag": "boolean", "byte": "octet", "small": "int8", "large": "uint64",
        "ratio": "float", "number": "double", "where": POINT, "path": Listed(POINT),
        "names": Listed("string"), "data": Listed("uint8"), "id": Listed("uint8", 4),
        "few": Listed("int32", None, 2),
    },
    SimpleNamespace,
)  # fmt: skip

FITS: list[tuple[str, Any, Any]] = [
    ("small", 5.0, 5),
    ("small", -128, -128),
    ("large", 2**64 - 1, 2**64 - 1),
    ("byte", 255, b"\xff"),
    ("number", 1, 1.0),
    ("data", "AP8Q", [0, 255, 16]),
    ("data", [0, 255], [0, 255]),
    ("few", [1, 2], [1, 2]),
]


@pytest.mark.parametrize(("field", "given_", "expected"), FITS)
def test_what_fits(field: str, given_: Any, expected: Any) -> None:
    """JavaScript has one kind of number."""
    found = getattr(filled(ALL, {field: given_}), field)
    assert found == expected
    assert type(found) is type(expected)


def test_null_and_what_is_left_out() -> None:
    """Null is NaN where a number may be none; elsewhere the default stays, as for what is left out."""
    message = filled(ALL, {"number": None, "name": None, "where": None, "path": [None, {"x": 1}]})
    assert math.isnan(message.number)
    assert not hasattr(message, "name")
    assert message.path == [SimpleNamespace(), SimpleNamespace(x=1.0)]


def test_arguments_by_their_order() -> None:
    """The protocol allows a list."""
    assert filled(POINT, [1, 2]) == SimpleNamespace(x=1.0, y=2.0)
    with pytest.raises(DoesNotFit, match=r"^3 values for the 2 fields of some_msgs/msg/Point$"):
        filled(POINT, [1, 2, 3])


DOES_NOT_FIT = [
    (5, "a some_msgs/msg/All is an object of fields, not 5"),
    ({"nam": "x"}, "nam: some_msgs/msg/All has no such field; did you mean 'name'?"),
    ({"name": 5}, "name: expected a text, got 5"),
    ({"name": "a\0b"}, "name: expected a text, got 'a\\x00b'"),
    ({"flag": 1}, "flag: expected true or false, got 1"),
    ({"small": 128}, "small: 128 is not from -128 to 127"),
    ({"small": 1.5}, "small: expected a whole number, got 1.5"),
    ({"small": True}, "small: expected a whole number, got True"),
    ({"large": -1}, "large: -1 is not from 0 to 18446744073709551615"),
    ({"ratio": 1e39}, "ratio: 1e+39 is too large for a float32"),
    ({"number": "1"}, "number: expected a number, got '1'"),
    ({"where": {"z": 1}}, "where.z: some_msgs/msg/Point has no such field; allowed: 'x', 'y'"),
    ({"where": []}, "where: a some_msgs/msg/Point is an object of fields, not a list"),
    ({"path": [{}, {"x": "a"}]}, "path[1].x: expected a number, got 'a'"),
    ({"path": {}}, "path: expected a list, got an object"),
    ({"data": "?"}, "data: a list of bytes is base64, or a list of numbers from 0 to 255"),
    ({"data": [256]}, "data[0]: 256 is not from 0 to 255"),
    ({"id": [1, 2]}, "id: expected 4 elements, got 2"),
    ({"few": [1, 2, 3]}, "few: expected at most 2 elements, got 3"),
    ({"small": 500, "name": 1}, "small: 500 is not from -128 to 127; name: expected a text, got 1"),
]


@pytest.mark.parametrize(("data", "text"), DOES_NOT_FIT)
def test_what_does_not_fit(data: Any, text: str) -> None:
    """All at once, each with its field."""
    with pytest.raises(DoesNotFit) as told:
        filled(ALL, data)
    assert str(told.value) == text


def test_a_long_list_of_wrong_numbers_is_told_in_short() -> None:
    """Ten are enough to see what is wrong."""
    with pytest.raises(DoesNotFit) as told:
        filled(ALL, {"names": [1] * 100_000})
    assert str(told.value).count(";") == 9


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.sampled_from(list(ALL.fields)) | st.text(), inner),
)


@pytest.mark.slow
@given(ANYTHING | st.dictionaries(st.sampled_from(list(ALL.fields)), ANYTHING))
def test_nothing_else_is_raised(data: Any) -> None:
    """Whatever JSON can carry is written or told."""
    try:
        filled(ALL, data)
    except DoesNotFit as problem:
        text = str(problem)
    else:
        text = "fits"
    assert text


def test_types_that_cannot_be_carried() -> None:
    """Wide texts and long doubles are in no interface of a robot; who uses one is told which field it is."""
    kind = SimpleNamespace(get_fields_and_field_types=lambda: {"title": "wstring"})
    with pytest.raises(
        NotCarried, match=r"^a/msg/B.title is of type wstring, which the gateway cannot carry$"
    ):
        shape_of(kind, lambda name: pytest.fail(name), "a/msg/B")
