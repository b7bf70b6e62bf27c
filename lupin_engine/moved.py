"""Redirects import paths of earlier versions to today's modules, with a DeprecationWarning."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Mapping, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import CodeType, MappingProxyType, ModuleType

#: Package of old -> package of today.
MOVED: Mapping[str, str] = MappingProxyType(
    {
        "lupin_engine.ros": "lupin_ros",
        "lupin_engine.harness": "lupin_harness",
        "lupin_engine.verify": "lupin_verify",
        "lupin_engine.editor": "lupin_lsp",
        "lupin_engine.cli": "lupin_cli",
    }
)
_BEGINNINGS = tuple(MOVED)


class MovedFinder(MetaPathFinder, Loader):
    """Answers an old path with the module that stands at the new one: the same object, not a second copy."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec for a module of an old package that is in the new one; None for any other name."""
        if not fullname.startswith(_BEGINNINGS) or (new := _today(fullname)) is None:
            return None
        found = find_spec(new)
        is_package = found is not None and found.submodule_search_locations is not None
        return ModuleSpec(fullname, self, is_package=is_package) if found else None

    def exec_module(self, module: ModuleType) -> None:
        """Put the module of today in the place of the empty one."""
        name = module.__name__
        new = _today(name)
        assert new is not None
        warnings.warn(f"{name} is now {new}: import that", DeprecationWarning, stacklevel=2)
        sys.modules[name] = importlib.import_module(new)

    def get_code(self, fullname: str) -> CodeType | None:
        """Return the code of the module of today, for `python -m`; None where there is none."""
        spec = find_spec(_today(fullname) or fullname)
        get_code = getattr(spec and spec.loader, "get_code", None)
        return get_code(spec.name) if spec and get_code else None


def _today(name: str) -> str | None:
    """Return the path of today; None for a name that only begins like an old one."""
    old = ".".join(name.split(".")[:2])
    return MOVED[old] + name[len(old) :] if old in MOVED else None
