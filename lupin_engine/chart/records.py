"""Records that a large chart has thousands of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dataclasses import dataclass as record
else:

    def record(*, frozen: bool) -> Callable[[type], type]:
        """Make a dataclass that is frozen for the type checker only.

        One that is frozen at run time takes three times as long to make, and a large chart has thousands.
        """
        return dataclass(unsafe_hash=frozen, slots=True)


__all__ = ["record"]
