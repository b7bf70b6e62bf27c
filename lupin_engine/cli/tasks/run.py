"""What `lupin run` does."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from lupin_engine.cli.bring_up import Options, Wanted
from lupin_engine.cli.exit_codes import not_done
from lupin_engine.cli.observers import Heard, JsonObserver, LiveObserver, PlainObserver, SavingPicture
from lupin_engine.cli.options import PATIENCE_S
from lupin_engine.cli.terminal import quiet_terminal
from lupin_engine.errors import LupinError, Severity
from lupin_engine.plugin.registry import Catalog, load_catalog
from lupin_engine.ros.launch.folders import writable
from lupin_engine.ros.launch.interrupts import Interrupted, Interrupts
from lupin_engine.ros.launch.mission import Loaded, check_request, load_missions
from lupin_engine.ros.launch.story import INTERRUPTED, NOT_DONE

if TYPE_CHECKING:
    from lupin_engine.ros.launch.session import Session


@not_done()
def work(
    mission: str,
    tags: tuple[str, ...],
    goal: int,
    patience: float | None,
    as_json: bool,
    save_svg: Path | None,
    **wanted: Any,
) -> int:
    """Do what the options of `lupin run` say, and return the exit code.

    Raises:
        LupinError: nothing was started.
    """
    catalog = load_catalog()
    loaded = load_missions([mission], catalog)
    given = Options(Wanted(**wanted), loaded, catalog)
    with given.problems.collecting():
        check_request(loaded, given.values, tags, goal)
    with given.problems.collecting():
        if save_svg is not None:
            writable(save_svg.parent, "picture")
    if patience is None and (as_json or not sys.stdout.isatty()):
        patience = PATIENCE_S
    settings = given.settings(patience)
    from lupin_engine.ros.launch.session import Session  # needs rclpy

    with quiet_terminal(), Interrupts() as interrupts:
        observer = _observer(as_json, save_svg, loaded, interrupts)
        with Session(settings, observer, interrupts) as session:
            code = _carry_out(session, observer, loaded, catalog, tags, goal)
        observer.close(session.story, code)
    return code


def _carry_out(
    session: Session, observer: Any, loaded: Loaded, catalog: Catalog, tags: tuple[str, ...], goal: int
) -> int:
    """Run the mission; whatever goes wrong, it is told here and the mission is aborted."""
    try:
        session.bring_up(loaded.plugins, catalog)
        story = session.start(loaded.names[0], tags, goal)
        session.follow(story)
        return story.verdict
    except Interrupted:
        code = INTERRUPTED
    except LupinError as problem:
        observer.note(str(problem), Severity.ERROR)
        code = NOT_DONE
    if session.story is not None and not session.story.ended:
        session.abort(session.story)
    return code


def _observer(as_json: bool, save_svg: Path | None, loaded: Loaded, interrupts: Interrupts) -> Any:
    observer: Any
    console = Console(highlight=False)
    if as_json:
        observer = JsonObserver()
    elif console.is_terminal and not console.is_dumb_terminal:
        observer = LiveObserver(console, loaded.chart)
    else:
        observer = PlainObserver()
    observer = Heard(observer, interrupts.stop)
    return SavingPicture(observer, loaded.chart, save_svg) if save_svg else observer
