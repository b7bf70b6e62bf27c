"""What `lupin up` does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from lupin_engine.cli import view
from lupin_engine.cli.bring_up import Options, Wanted
from lupin_engine.cli.exit_codes import not_done
from lupin_engine.cli.observers import Heard, PlainObserver
from lupin_engine.errors import LupinError, Severity
from lupin_engine.plugin.registry import Catalog, load_catalog
from lupin_engine.ros.launch.environment import current_domain
from lupin_engine.ros.launch.interrupts import Interrupted, Interrupts
from lupin_engine.ros.launch.mission import Loaded, load_missions
from lupin_engine.ros.launch.story import NOT_DONE
from lupin_engine.runtime.setup import make_world

if TYPE_CHECKING:
    from lupin_engine.ros.launch.session import Observer, Session


@not_done()
def work(missions: tuple[str, ...], **wanted: Any) -> int:
    """Do what the options of `lupin up` say, and return the exit code.

    Raises:
        LupinError: nothing was started.
    """
    catalog = load_catalog()
    loaded = load_missions(missions, catalog)
    given = Options(Wanted(**wanted), loaded, catalog)
    with given.problems.collecting():
        make_world(loaded.chart, given.values)
    settings = given.settings()
    from lupin_engine.ros.launch.session import Session  # needs rclpy

    with Interrupts() as interrupts:
        observer = Heard(PlainObserver(), interrupts.stop)
        with Session(settings, observer, interrupts) as session:
            return _serve(session, observer, loaded, catalog)


def _serve(session: Session, observer: Observer, loaded: Loaded, catalog: Catalog) -> int:
    try:
        session.bring_up(loaded.plugins, catalog)
        observer.note("\n".join(served(loaded, str(current_domain()))))
        session.watch(_StateLines(observer))
    except Interrupted:
        return 0  # the way to end it
    except LupinError as problem:
        observer.note(str(problem), Severity.ERROR)
    return NOT_DONE


class _StateLines:
    """Writes a line when the published state is another one."""

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._last: tuple[Any, ...] = ()

    def __call__(self, state: Mapping[str, Any]) -> None:
        if state and (key := view.changed_key(state)) != self._last:
            self._last = key
            self._observer.note(view.plain_state(state))


def served(loaded: Loaded, domain: str) -> list[str]:
    """Return what to tell an operator: the missions, and how each is started."""
    lines = [f"ready in ROS domain {domain}; start a mission from the HMI, or with"]
    for name, file in zip(loaded.names, loaded.files, strict=True):
        request = f'"{{mission_type: {name}}}"'
        lines.append(f"  lupin run {file.stem} --domain {domain}")
        lines.append(f"  ros2 service call /mission/start lupin_msgs/srv/StartMission {request}")
    return [*lines, "Ctrl-C stops everything"]
