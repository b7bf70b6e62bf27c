"""One engine in a process of its own: answers the driver's requests, a line of JSON each.

    python worker.py ADAPTER [MODE]

`prepare` makes a chart, `run` times a block, `reached` says where the chart is, `weigh` how many bytes a
further instance takes. An error is an answer too, so that one engine's trouble is not the others'.
"""

from __future__ import annotations

import gc
import importlib
import json
import sys
import time
import tracemalloc
from dataclasses import asdict
from types import ModuleType
from typing import Any

from bench import Bench, Unsupported


class Worker:
    """The requests that the driver can make."""

    def __init__(self, adapter: ModuleType, mode: str) -> None:
        self._adapter = adapter
        self._options = {"mode": mode} if mode else {}
        self._bench: Bench | None = None

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to one request."""
        name = request.pop("do")
        try:
            found: dict[str, Any] = getattr(self, name)(**request)
        except Unsupported as reason:
            return {"unsupported": str(reason)}
        except Exception as problem:  # an engine's fault is told in its row, whatever it is
            return {"error": f"{type(problem).__name__}: {problem}"}
        return found

    def prepare(self, chart: str) -> dict[str, Any]:
        """Make a chart and start it."""
        self._bench = None
        gc.collect()
        self._bench = self._adapter.make(chart, **self._options)
        return {}

    def run(self, number: int) -> dict[str, Any]:
        """Time a block. Garbage is collected as it is in use."""
        assert self._bench is not None
        work = self._bench.run
        begun = time.perf_counter()
        work(number)
        return {"seconds": time.perf_counter() - begun}

    def reached(self) -> dict[str, Any]:
        """Say where the chart is."""
        assert self._bench is not None
        return asdict(self._bench.reached())

    def weigh(self, chart: str, number: int) -> dict[str, Any]:
        """Say how many bytes each further instance of a chart takes."""
        if not hasattr(self._adapter, "further"):
            raise Unsupported("one instance only")
        further = self._adapter.further(chart)
        kept: list[object] = [further() for _ in range(10)]  # what is made once is not a further instance's
        gc.collect()
        tracemalloc.start()
        before = tracemalloc.get_traced_memory()[0]
        kept.extend(further() for _ in range(number))
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
        return {"bytes": round(grown / number)}


def main() -> None:
    """Import the adapter, say its version, then answer until nobody asks any more."""
    name, mode = (*sys.argv[1:], "")[:2]
    try:
        adapter = importlib.import_module(name)
    except ImportError as problem:
        print(json.dumps({"missing": str(problem)}), flush=True)
        return
    print(json.dumps({"version": adapter.VERSION}), flush=True)
    worker = Worker(adapter, mode)
    for line in sys.stdin:
        print(json.dumps(worker.answer(json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
