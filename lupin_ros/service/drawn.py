"""Answers displays' requests to draw or explain a chart. Needs no ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.diagram import folded_svg
from lupin_engine.errors import LupinError
from lupin_engine.missions import LoadedMissions
from lupin_ros.service import names
from lupin_ros.service.chart_record import check_chart


def drawn(loaded: LoadedMissions, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
    """Draw a chart by the fields of `lupin_engine_msgs/srv/Draw`.

    Raises:
        LupinError: `folded` is no list. Other problems are in the response's `message`.
    """
    folded = arguments.get("folded", [])
    if not isinstance(folded, list):
        raise LupinError(f"{names.DRAW_SERVICE}: folded must be a list of states")

    def svg() -> dict[str, str]:
        return {"svg": folded_svg(loaded.chart, frozenset(map(str, folded)))}

    return shown(loaded, arguments, "svg", svg)


def shown(
    loaded: LoadedMissions, arguments: Mapping[str, Any], field: str, show: Callable[[], Mapping[str, str]]
) -> Mapping[str, Any]:
    """Return the response with the result of `show` in `field`; on a LupinError '' and its message."""
    response = {"success": False, "message": "", "chart": loaded.hash, field: ""}
    try:
        check_chart(str(arguments.get("chart", "")), loaded)
        return {**response, "success": True, **show()}
    except LupinError as problem:
        return {**response, "message": str(problem)}
