"""What is wrong with a command: collected from all its parts, and told at once."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator

from lupin_engine.errors import LupinError, UsageError


class Problems:
    """Every problem once, in the order of finding; false while there is none."""

    def __init__(self) -> None:
        self._texts: dict[str, None] = {}

    def add(self, texts: Iterable[str]) -> None:
        """Take notice of problems."""
        self._texts.update(dict.fromkeys(texts))

    @contextlib.contextmanager
    def collecting(self) -> Iterator[None]:
        """Take notice of what the body refuses, and go on behind it."""
        try:
            yield
        except LupinError as problem:
            self.add([str(problem)])

    def tell(self) -> None:
        """Tell all of them.

        Raises:
            UsageError: there are some.
        """
        if self._texts:
            raise UsageError("\n".join(self._texts))

    def __bool__(self) -> bool:
        return bool(self._texts)
