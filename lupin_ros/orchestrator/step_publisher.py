"""Publishes each step: outcomes, codes, state and record; and the state again and again."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from lupin_engine.errors import Severity
from lupin_engine.machine import NOTHING, PROPERTY_BROKEN, Event, Machine, Moment, Report, Step, View
from lupin_engine.plugin import PROPERTY_CODE, START, Channel, Fields, Publish, Wire, classify
from lupin_engine.runtime import JournalRecord, outcomes_of
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.orchestrator.journal_gate import JournalGate
from lupin_ros.orchestrator.loop import Loop
from lupin_ros.orchestrator.outlet import NodeClock
from lupin_ros.orchestrator.records import RecordPublisher
from lupin_ros.orchestrator.recovery import Recovery
from lupin_ros.service import messages
from lupin_ros.service.reports import StateMessages


class StepPublisher:
    """The listener of the engine; an exception in one part keeps no other from running."""

    def __init__(
        self,
        ros: RosNode,
        clock: NodeClock,
        loop: Loop,
        gate: JournalGate,
        records: RecordPublisher,
    ) -> None:
        self._ros = ros
        self._loop = loop
        self._wire = wire = messages.wire_of(loop.chart.profile)
        self._gate = gate
        self._records = records
        self._state = _Publisher(ros, wire.state)
        ros.lifeline = ros.topic_name(wire.state.name)
        self._messages = StateMessages(wire, _Now(ros, clock, loop))
        self.outcomes = OutcomePublisher(ros, wire, self._messages)
        #: Takes each step with the view after it, for who runs the mission.
        self.follower: Callable[[Step, View], None] | None = None
        #: The request that is being carried out, and who asked for it.
        self.origin: tuple[Event | None, Mapping[str, str]] = (None, {})
        #: The properties that were broken since the last mission began, as troubles of the node.
        self._broken: set[str] = set()

    def stepped(self, step: Step) -> None:
        """Publish and record a step."""
        if step.event.name == START and step.accepted:
            self._messages.mission_started()
            self._show_broken("", "")
        elif step.event.name == PROPERTY_BROKEN:
            self._show_broken(step.event.data["property"], step.event.data["detail"])
        view = self._loop.machine.view
        parts = _PARTS if self._records.is_news(step) else (StepPublisher._publish_state,)
        for part in parts:
            self._ros.guarded(part)(self, step, view)

    def _show_broken(self, name: str, detail: str) -> None:
        """Add a broken property to the diagnostics; '' removes all."""
        for old in self._broken if not name else ():
            self._ros.trouble(f"property {old}", "")
        self._broken = {*self._broken, name} if name else set()
        if name:
            self._ros.trouble(f"property {name}", detail, classify(PROPERTY_CODE, {}))

    def _show_code(self, step: Step, view: View) -> None:
        """Show the mission's worst code in the diagnostics, until the next mission begins."""
        code = classify(view.code, self._loop.chart.codes)
        problem = ": ".join(filter(None, (code.label, view.detail)))
        self._ros.trouble("mission", problem if code.severity > Severity.INFO else "", code)

    def failed(self, problem: Exception) -> None:
        """Log an exception in the loop; the journal may lack a step, so a new file begins with a snapshot."""
        self._ros.log.error("the loop failed", exc_info=problem)
        self._gate.journal.discontinue(f"{type(problem).__name__}: {problem}")

    def mission_resumed(self, seconds: float) -> None:
        """Record that a mission goes on which was accepted so many seconds ago."""
        self._messages.mission_started(_stamp(self._ros, self._ros.now() - seconds))

    def unpublished(self, recovery: Recovery) -> list[tuple[Publish, Fields]]:
        """Return outcomes of replayed steps that were not recorded, and those of a closed mission."""
        old = recovery.recovered
        found = []
        for record, outcome in old.unreported if old is not None else ():
            then = _Then(self._ros, old.machine if old else self._loop.machine, record)
            found.append((outcome, StateMessages(self._wire, then).outcome(outcome)))
        return found + [(outcome, self._messages.outcome(outcome)) for outcome in recovery.left_out]

    def _publish_outcomes(self, step: Step, view: View) -> None:
        if outcomes := outcomes_of(step):
            self._gate.publish(outcomes, self.outcomes)

    def _log_reports(self, step: Step, view: View) -> None:
        for command in step.commands:
            if isinstance(command, Report):
                self._records.log_report(command, view)

    def _publish_moments(self, step: Step, view: View) -> None:
        for moment in step.trail[:-1]:
            self._publish_if_changed(view, moment)

    def _publish_state(self, step: Step, view: View) -> None:
        self._publish_if_changed(view)

    def _publish_step(self, step: Step, view: View) -> None:
        asked, origin = self.origin
        self._records.publish_step(step, view, origin if step.event is asked else NOTHING)

    def _record_step(self, step: Step, view: View) -> None:
        self._gate.after_step(step, view, self._loop.machine)

    def _follow(self, step: Step, view: View) -> None:
        if self.follower is not None:
            self.follower(step, view)

    def _publish_if_changed(self, view: View, moment: Moment | None = None) -> None:
        """Publish the state at once where it has changed."""
        fields = self._messages.news(view, moment)
        if fields is not None:
            self._state.publish(fields)

    def repeat_state(self) -> None:
        """Publish the state again, and the available requests where time alone has changed them."""
        self._state.publish(self._messages.fields(self._loop.machine.view))
        self._records.publish_possible(self._loop.machine)


#: The publications of a step that is news, in this order.
_PARTS = (
    StepPublisher._publish_outcomes,
    StepPublisher._log_reports,
    StepPublisher._publish_moments,
    StepPublisher._publish_state,
    StepPublisher._publish_step,
    StepPublisher._record_step,
    StepPublisher._show_code,
    StepPublisher._follow,
)


class _Publisher:
    """Publishes fields on a channel of the profile."""

    def __init__(self, ros: RosNode, channel: Channel) -> None:
        self._make = interface_class(channel.type)
        self._publisher = ros.publisher(self._make, channel.name, Qos[channel.qos])

    def publish(self, fields: Fields) -> None:
        """Publish them."""
        self._publisher.publish(messages.write(self._make(), fields))


class OutcomePublisher(_Publisher):
    """The profile's channel of outcomes, for the journal's outbox."""

    def __init__(self, ros: RosNode, wire: Wire, messages_: StateMessages) -> None:
        super().__init__(ros, wire.outcomes)
        self._messages = messages_

    def fields(self, outcome: Publish) -> Fields:
        """Return the message about a target."""
        return self._messages.outcome(outcome)


class _Now:
    """The machine as it is now (see `reports.Present`)."""

    def __init__(self, ros: RosNode, clock: NodeClock, loop: Loop) -> None:
        self._ros = ros
        self._clock = clock
        self._loop = loop

    @property
    def machine(self) -> Machine:
        return self._loop.machine

    def now(self) -> float:
        return self._clock.now()

    def stamp(self) -> Fields:
        return _stamp(self._ros)


class _Then:
    """A replayed machine at the time of a record."""

    def __init__(self, ros: RosNode, machine: Machine, record: JournalRecord) -> None:
        self._ros = ros
        self.machine = machine
        self._record = record

    def now(self) -> float:
        return self._record.time

    def stamp(self) -> Fields:
        return _stamp(self._ros, self._record.wall)


def _stamp(ros: RosNode, time: float | None = None) -> Fields:
    if time is not None:
        return {"sec": int(time), "nanosec": int(time % 1.0 * 1e9)}
    stamp = ros.stamp()
    return {"sec": stamp.sec, "nanosec": stamp.nanosec}
