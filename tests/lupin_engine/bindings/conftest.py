"""The catalog of the charts' tests."""

from __future__ import annotations

from tests.lupin_engine.chart.conftest import catalog

__all__ = ["catalog"]
