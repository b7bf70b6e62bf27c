"""Publishes JSON records beside the profile's channels: steps, missions, available requests, the chart.

A step's record has its time by three clocks (the node's steady one, ROS, the wall), the id of the process
instance and the hash of the chart. Steps and codes are written to the node's log as well.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from std_msgs.msg import String

from lupin_engine.machine import Machine, Report, Step, View
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import COUNT, TEXT, Parameter
from lupin_engine.runtime import Clock, PossibleRecord, domain_folder, missions_record
from lupin_ros.adapter.host import Slices
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.orchestrator.displays import short_switch_interval
from lupin_ros.orchestrator.single import new_boot
from lupin_ros.service import messages
from lupin_ros.service.commands import INACTIVE, counts_however_late
from lupin_ros.service.names import CHART_TOPIC, MISSIONS_TOPIC, NODE, POSSIBLE_TOPIC, STEPS_TOPIC
from lupin_ros.service.reports import PossibleNews, StepMoment, StepNews, published_step

#: The node's parameters about its log.
LOG_PARAMETERS: Mapping[str, Parameter] = {
    "log_path": Parameter(TEXT, "", "folder of the log; empty: the user's state folder, by ROS domain"),
    "log_bytes": Parameter(COUNT, 10_000_000, "how large a file of the log grows, in bytes", minimum=100_000),
    "log_files": Parameter(COUNT, 5, "how many earlier files of the log are kept", minimum=1),
}


class RecordPublisher:
    """Publishes the records and logs the steps; the charts are drawn on a thread of their own."""

    def __init__(self, ros: RosNode, clock: Clock, loaded: LoadedMissions) -> None:
        self._ros = ros
        self._clock = clock
        self._loaded = loaded
        #: The id of this process instance: readers of records see by it that memory was lost.
        self.boot = new_boot()
        self._steps = ros.publisher(String, STEPS_TOPIC, Qos.BACKLOG)
        self._missions = ros.publisher(String, MISSIONS_TOPIC, Qos.LATCHED)
        self._possible = ros.publisher(String, POSSIBLE_TOPIC, Qos.LATCHED)
        self._chart = ros.publisher(String, CHART_TOPIC, Qos.LATCHED)
        self._slices = Slices(ros)
        self._open_log(ros.parameters())
        #: What was published last, as text; as many steps as late readers get.
        self._last_steps: deque[str] = deque(maxlen=self._steps.qos_profile.depth)
        self._last_missions = self._last_possible = "{}"
        self._possible_news = PossibleNews(self.boot)
        #: Why the node refused requests when the last of these was made.
        self._inactive = ""
        self.is_news = StepNews().is_news

    def _open_log(self, given: Mapping[str, Any]) -> None:
        folder = domain_folder("log", str(given["log_path"] or ""), robot=self._ros.namespace)
        self._ros.log_book.about = {"boot": self.boot}
        try:
            self._ros.log_book.write_to(folder / f"{NODE}.jsonl", given["log_bytes"], given["log_files"])
        except OSError as problem:
            self._ros.log.warning("the log is written to the console only", problem=str(problem))

    def switch_chart(self, loaded: LoadedMissions) -> None:
        """Publish records of another chart from now on."""
        self._loaded = loaded
        self._possible_news.forget()
        self.publish_chart()

    # -- steps ------------------------------------------------------------------------------------------

    def publish_step(self, step: Step, view: View, origin: Mapping[str, str]) -> None:
        """Log a step and publish its record; `origin` names who commanded it, where that is known."""
        ids = {"mission_id": view.mission_id, "target": view.target, "step": step.sequence}
        self._ros.log_book.about = {"boot": self.boot, **ids}
        self._log(step, view)
        at = StepMoment(self._clock.now(), self._ros.now(), time.time_ns())
        record = published_step(step, view, self._loaded, self.boot, at, origin)
        text = _text(record)
        self._last_steps.append(text.data)
        self._steps.publish(text)

    def _log(self, step: Step, view: View) -> None:
        log, chart = self._ros.log, self._loaded.chart
        if step.taken:
            now = " ".join(filter(None, (view.lifecycle, view.phase)))
            target = f"{chart.profile.terminal.target}_id"
            ids = {target: view.target or "-", "mission_id": view.mission_id or "-"}
            log.info("step", on=step.event.name, taken=list(step.taken), now=now, **ids)
        for code in step.codes:
            say = (log.info, log.warning, log.error)[code.severity]
            say(code.label, code=code.code, detail=code.detail, target=code.target or "-")
        for note in step.notes:
            log.info(note)

    def log_report(self, report: Report, view: View) -> None:
        """Log the final summary: counts over all sweeps, as published, and the targets of the last one."""
        profile = self._loaded.chart.profile
        counts = {outcome.counter: view.counts[outcome.name] for outcome in profile.outcomes}
        self._ros.log.info("mission ended", mission_id=report.mission_id, total=view.total, **counts)
        self._slices.add_each(partial(self._log_visit, visit) for visit in report.visits)

    def _log_visit(self, visit: Mapping[str, Any]) -> None:
        self._ros.log.info("target", **messages.visit_record(visit, self._loaded.chart.profile))

    # -- missions ---------------------------------------------------------------------------------------

    def publish_missions(self, machine: Machine, problems: Sequence[str]) -> None:
        """Publish the mission catalogue and log the files' problems, where either has changed."""
        text = _text(missions_record(machine, self._clock.now(), problems))
        if text.data != self._last_missions:
            self._last_missions = text.data
            self._missions.publish(text)
            for problem in problems:
                self._ros.log.error("missions stay as they were", problem=problem)

    # -- available requests -----------------------------------------------------------------------------

    def publish_possible(self, machine: Machine) -> None:
        """Publish a dry run of each request, where its result has changed.

        Must be called after steps and periodically, because guards may read the time of day. It is cheap
        where nothing can have changed.
        """
        inactive, self._inactive = self._inactive, self._ros.inactive
        if inactive != self._inactive:
            self._possible_news.forget()
        found = self._possible_news.news(machine, self._loaded.hash, self._clock.now())
        if found is not None:
            requests = [self._while_inactive(one) for one in found["requests"]]
            text = _text({**found, "requests": requests})
            self._last_possible = text.data
            self._possible.publish(text)

    def _while_inactive(self, one: PossibleRecord) -> PossibleRecord:
        """Return a dry run as the node's lifecycle state answers it (see `RequestServer`)."""
        stops = counts_however_late(one["request"], self._loaded.chart) and not one["releases"]
        if stops or not self._inactive:
            return one
        reason = f"{one['request'].rpartition('.')[2]} refused: {self._inactive}"
        refused: PossibleRecord = {**one, "possible": False, "fields": False, "engages": [], "releases": []}
        return {**refused, "code": INACTIVE, "reason": reason}

    def status(self) -> str:
        """Return the last steps, available requests and missions that were published, as a JSON object."""
        steps = ", ".join(self._last_steps)
        return f'{{"steps": [{steps}], "possible": {self._last_possible}, "missions": {self._last_missions}}}'

    # -- the chart --------------------------------------------------------------------------------------

    def publish_chart(self) -> None:
        """Publish the chart's record soon, and again with its drawing: that may take a minute."""
        threading.Thread(target=self._draw, args=[self._loaded], name="chart", daemon=True).start()

    def _draw(self, loaded: LoadedMissions) -> None:
        """Make and publish the record of a chart; runs on a thread of its own."""
        # Drawing is nearly all that this imports, and the start of the node does not wait for it.
        from lupin_ros.service.chart_record import chart_picture, chart_record

        try:
            record = {"boot": self.boot, **chart_record(loaded)}
            self._publish_record(record, loaded)
            with short_switch_interval():
                picture = chart_picture(loaded)
            self._publish_record({**record, **picture}, loaded)
        except Exception as problem:
            self._ros.post(partial(self._ros.log.error, "the chart cannot be told", problem=repr(problem)))

    def _publish_record(self, record: Mapping[str, Any], loaded: LoadedMissions) -> None:
        message = _text(record)
        self._ros.post(lambda: self._chart.publish(message) if loaded is self._loaded else None)


def _text(data: Any) -> String:
    return String(data=json.dumps(data, default=str))
