"""The formats of pictures."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

#: Format -> ending of its files. The function of that name in the module of that name writes it.
FORMATS: Mapping[str, str] = MappingProxyType(
    {"mermaid": ".mmd", "scxml": ".scxml", "svg": ".svg", "png": ".png"}
)
