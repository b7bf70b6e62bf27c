"""The classes of tests that authors of plugins derive from, when what they test is not there."""

from __future__ import annotations

import pytest

from lupin_harness.cases import CatalogContract, DriverContract
from lupin_harness.rules import RULES


def of(contract: type, name: str) -> type:
    """Return a class of tests of the plugin `name`."""
    return type("TestIt", (contract,), {"plugin": name})


def test_a_plugin_that_is_not_installed_is_told_in_one_line() -> None:
    """With the nearest one, and what to do; pytest shows no traceback of the harness."""
    how = "it is tested as it is installed: pip install --editable FOLDER"
    for contract, try_it in (
        (CatalogContract, lambda made: made().test_catalog(next(iter(RULES)))),
        (DriverContract, lambda made: made.node_entries()),
    ):
        with pytest.raises(pytest.fail.Exception) as caught:
            try_it(of(contract, "brigde"))
        assert caught.value.msg == f"no plugin is called 'brigde'; did you mean 'bridge'?; {how}"
        assert not caught.value.pytrace
        assert caught.value.__context__ is None
