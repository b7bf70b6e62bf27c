"""The catalog of the charts' tests."""

from __future__ import annotations

from tests.chart.conftest import catalog

__all__ = ["catalog"]
