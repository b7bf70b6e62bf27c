"""The orchestrator's write-ahead journal.

It chooses the file, one for each mission, publishes outcomes only after they are flushed, and reports disk
faults.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Protocol

from lupin_engine import __version__
from lupin_engine.machine import CODE_REPORTED, HELD_BACK, Event, Machine, Possibility, Refusal, Step, View
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import (
    BOOL,
    CLOSED_CODE,
    COUNT,
    NUMBER,
    RECORDED_CODE,
    START,
    TEXT,
    UNRECORDED,
    UNRECORDED_CODE,
    Fields,
    Parameter,
    Profile,
    Publish,
    classify,
)
from lupin_engine.runtime import Journal, JournalHead, Keep, Refusals, journal_folder
from lupin_ros.adapter.host import Slices
from lupin_ros.adapter.node import RosNode
from lupin_ros.orchestrator.outlet import Worker
from lupin_ros.orchestrator.recovery import Recovery
from lupin_ros.service.commands import CommandMemory

#: The node's parameters about its journal.
JOURNAL_PARAMETERS: Mapping[str, Parameter] = {
    "journal_path": Parameter(
        TEXT, "", "folder of the journal; empty: the user's state folder, by ROS domain"
    ),
    "may_repeat_outcomes": Parameter(
        BOOL,
        False,
        "whether missions run while the journal cannot be written; after a restart the mission may then be "
        "forgotten, or a target published twice",
    ),
    "journal_required": Parameter(BOOL, True, "the older name: false is may_repeat_outcomes"),
    "journal_missions": Parameter(COUNT, 200, "of how many missions the journal is kept", minimum=1),
    "journal_megabytes": Parameter(COUNT, 1000, "how large all that is kept is together, in MB", minimum=50),
    "journal_days": Parameter(NUMBER, 60.0, "for how many days the journal is kept", minimum=0.01),
}
#: The advice in refusals while the journal cannot be written.
WHAT_TO_DO = (
    "make room there or make it writable, or name another folder: XDG_STATE_HOME=FOLDER, or the parameter "
    "journal_path of mission_orchestrator"
)
#: The period of new attempts to write, in seconds.
RETRY_S = 5.0


class Outcomes(Protocol):
    """The channel of outcomes."""

    def fields(self, outcome: Publish) -> Fields:
        """Return the message about a target."""

    def publish(self, fields: Fields) -> None:
        """Publish a message."""


class JournalGate:
    """Puts the journal between one orchestrator and the world."""

    def __init__(self, ros: RosNode, boot: str, loop: Worker) -> None:
        self._ros = ros
        self._boot = boot
        self._loop = loop
        given = ros.parameters()
        self.required = bool(given["journal_required"] and not given["may_repeat_outcomes"])
        if not given["journal_required"]:
            ros.log.warning("journal_required", problem="false is written may_repeat_outcomes:=true now")
        self.folder = journal_folder(str(given["journal_path"] or ""), robot=ros.namespace)
        size = 1_000_000 * int(given["journal_megabytes"])
        keep = Keep(int(given["journal_missions"]), float(given["journal_days"]), size)
        self.journal = Journal(self.folder, keep, self)
        self._refusals = Refusals(self.journal)
        #: Outcomes to write, and flushed ones to publish: some in each turn of the node's thread.
        self._writes, self._slices = Slices(ros), Slices(ros)
        #: Write unpublished outcomes again that a disk fault kept from being flushed.
        self._unflushed: list[Callable[[], None]] = []
        #: What the watch over the properties remembers, for the journal.
        self.watched: Callable[[], Mapping[str, Any]] = dict
        self._loaded: LoadedMissions | None = None
        self._retry_at = 0.0
        self._part = 1
        #: The targets that are in the file; the state of the itineraries when they were written.
        self._targets: set[str] = set()
        self._itineraries: tuple[object, ...] = ()
        self._is_returning = False

    def admit(self, request: Event, machine: Machine, now: float) -> Refusal | None:
        """Look at a request once, before the machine does; return why it is refused without a step.

        Else it begins the file of a mission that the request is about to start.
        """
        foreseen = machine.dry_run(request, now)
        refusal = self.refusal(request, foreseen, machine.chart.profile)
        if refusal is None and request.name == START and foreseen.possible and self._loaded is not None:
            data = request.data
            self.begin(self._loaded, machine, str(data["mission_type"]), str(data.get("mission_id", "")))
        return refusal

    def refusal(self, request: Event, foreseen: Possibility, profile: Profile) -> Refusal | None:
        """Return why a request is refused without a step; None where the machine answers it.

        While a required journal cannot be written, every request is refused but those that stop something.
        Requests that the machine would refuse are rate-limited: beyond 64 KiB in 10 s they are counted, not
        recorded.
        """
        if not (self.required and self.journal.failing):
            found, now = foreseen.refusal, self._ros.elapsed()
            return found if found and self._refusals.is_one_more(request, found.code, now) else None
        name = request.name.rpartition(".")[2]
        known = profile.requests.get(name) if request.name.startswith("operator.") else None
        if known is not None and known.however_late:
            return None
        why = f"the journal cannot be written: {self.journal.failing}: {self.folder}"
        return Refusal(UNRECORDED_CODE, f"{name} refused: {why}; {WHAT_TO_DO}")

    def close(self) -> None:
        """Write and flush all queued records, and close the file."""
        self._refusals.report_all()
        self._writes.finish()
        self._slices.finish()
        self.journal.close()

    def when_flushed(self, then: Callable[[], None]) -> None:
        """Call `then` when all records are flushed; at once while no file is open or the disk fails."""
        self.journal.when_flushed(self._ros.guarded(then))

    # -- which file -------------------------------------------------------------------------------------

    def begin(
        self, loaded: LoadedMissions, machine: Machine, mission: str = "", mission_id: str = ""
    ) -> None:
        """Begin a file with a snapshot of the machine, for a mission or for the time between two."""
        self._refusals.report_all()
        self._writes.finish()  # the outcomes of a file's steps are in that file
        if loaded is not self._loaded or self.journal.problem:  # the folder may have been removed
            names = loaded.short_names
            self.journal.keep_files(loaded.hash, {names[name]: raw for name, raw in loaded.sources.items()})
        self._loaded = loaded
        head, now = self.journal.head, self._ros.elapsed()
        self._part = (
            self._part + 1 if head is not None and mission_id and head.mission_id == mission_id else 1
        )
        self.journal.begin(
            JournalHead(
                boot=self._boot,
                engine=__version__,
                chart=loaded.hash,
                chart_name=loaded.chart.name,
                profile=loaded.chart.profile.name,
                parameters=dict(machine.world.parameters),
                time=now,
                ahead_ns=self.journal.wall_ns() - round(now * 1e9),
                files=tuple(loaded.short_names[str(file)] for file in loaded.files),
                mission=mission,
                mission_id=mission_id,
                part=self._part,
                lineage=self._ros.lineage,
                seed=machine.world.seed,
                snapshot=machine.snapshot() if machine.memory.sequence else "",
                watched=self.watched(),
            )
        )
        self._targets, self._itineraries = set(), ()
        self._record_targets(machine)
        unflushed, self._unflushed = self._unflushed, []
        for write_again in unflushed:
            write_again()

    def after_step(self, step: Step, view: View, machine: Machine) -> None:
        """Record new targets; where the step ended the mission, leave its file after its outcomes."""
        self._is_returning = view.lifecycle in machine.chart.profile.stages.returning
        self._record_targets(machine)
        head = self.journal.head
        profile = machine.chart.profile
        if head is None or not head.mission_id or not step.changed:
            return
        if view.lifecycle not in profile.stages.without_mission or view.mission_id != head.mission_id:
            return
        counts = {outcome.counter: view.counts.get(outcome.name, 0) for outcome in profile.outcomes}
        self.journal.ended({"state": view.lifecycle, "code": view.code, "total": view.total, **counts})
        self.when_flushed(lambda: self._writes.add(lambda: self._begin_idle_file(head.mission_id, machine)))

    def _record_targets(self, machine: Machine) -> None:
        """Record the mission's targets that the file does not have yet."""
        head, memory = self.journal.head, machine.memory
        if head is None or not head.mission_id or memory.mission_id != head.mission_id:
            return
        itineraries = memory.itineraries.items()
        found = tuple((name, w.begun, w.before, w.sweep, len(w.items)) for name, w in itineraries)
        if found == self._itineraries:
            return
        self._itineraries = found
        visits = [visit for visit in memory.outcomes if not visit.closed]
        new = [target for target in dict.fromkeys(v.target for v in visits) if target not in self._targets]
        self._targets.update(new)
        if new:
            self.journal.targets(memory.mission, head.mission_id, new)

    def _begin_idle_file(self, mission_id: str, machine: Machine) -> None:
        """Begin a file for the time without a mission, unless the next mission has begun meanwhile."""
        head = self.journal.head
        if head is not None and head.mission_id == mission_id and self._loaded is not None:
            self.begin(self._loaded, machine)

    def maintain(self, machine: Machine) -> None:
        """Write a snapshot, or begin the next file, where one is due; must be called between steps.

        It does nothing while outcomes wait to be written: a replay from the snapshot would lack them.
        """
        if self._writes.is_done and self.journal.compact(machine, self.watched):
            self._rotate(machine)

    def check_disk(self, machine: Machine) -> None:
        """Detect a disk that does not answer, and retry a failed one every `RETRY_S`; called periodically."""
        self.journal.check_disk()
        self._refusals.report_due(self._ros.elapsed())
        if self.journal.problem and self._ros.elapsed() >= self._retry_at:
            self._retry_at = self._ros.elapsed() + RETRY_S
            self._rotate(machine)

    def _rotate(self, machine: Machine) -> None:
        head = self.journal.head
        if head is not None and self._loaded is not None:
            self.begin(self._loaded, machine, head.mission, head.mission_id)

    def continue_file(self, found: Recovery, loaded: LoadedMissions, shift: float, now: float) -> None:
        """Append to the file whose mission goes on or is closed; if none or damaged, `begin` must follow.

        `shift` is the difference of this process's clock, at `now`, to the file's clock.
        """
        self.journal.count_from(found.left.outcomes)
        if found.machine is None and not found.closing:
            return
        if not found.left.file.damaged:
            self._loaded, self._part = loaded, found.left.file.head.part
            self.journal.go_on(found.left.file, shift, now, self._boot)

    def republish(self, found: Recovery, new: Iterable[tuple[Publish, Fields]], channel: Outcomes) -> None:
        """Publish the newest recorded outcomes again, published before or not, then new ones.

        A repeat is the same message. Fields that the message type does not take are logged and left out.
        """

        def resend(fields: Fields) -> None:
            try:
                channel.publish(fields)
            except Exception as problem:  # the journal has fields that are none of the message
                self._ros.log.warning("an outcome cannot be published again", problem=str(problem))

        for number, fields in found.left.newest.items():
            self._send_when_flushed(number, fields, resend)
        for outcome, fields in new:
            self._writes.add(partial(self._write, outcome, channel, fields))

    def commands_of(self, found: Recovery | None) -> CommandMemory:
        """Return the commands with their answers, recorded ones too, so that none is carried out twice."""
        commands = CommandMemory(self)
        ahead = self.journal.wall_ns() * 1e-9 - time.monotonic()
        for command_id, kept in found.left.commands.items() if found is not None else ():
            commands.remember(command_id, kept.wall - ahead, kept.what, kept.answer)
        return commands

    def answered(self, command_id: str, what: str, answer: Mapping[str, Any]) -> None:
        """Record the answer to a command; an exception is logged."""
        self._ros.guarded(self.journal.answered)(command_id, what, answer)

    def record_closed(self, why: str) -> None:
        """Record that recovery closes the mission, and why."""
        self.journal.ended({"state": "", "code": CLOSED_CODE, "detail": why})

    # -- the outbox ---------------------------------------------------------------------------------------

    def publish(self, outcomes: Iterable[Publish], channel: Outcomes) -> None:
        """Record outcomes, publish each after its flush, and record that; many are spread over turns."""
        self._writes.add_each(partial(self._write, outcome, channel) for outcome in outcomes)

    def _write(self, outcome: Publish, channel: Outcomes, fields: Fields | None = None) -> None:
        """Write an outcome with its message, or with `fields` that were its message."""
        if fields is None:
            fields = channel.fields(outcome)
        write_again = partial(self._write, outcome, channel, fields)
        number = self.journal.outcome(outcome, fields)
        self._send_when_flushed(number, fields, channel.publish, write_again)

    def _send_when_flushed(
        self,
        number: int,
        fields: Fields,
        send: Callable[[Fields], None],
        write_again: Callable[[], None] | None = None,
    ) -> None:
        """Publish an outcome after its flush; after a disk fault keep `write_again` for the next file.

        With `may_repeat_outcomes` it is published in spite of the fault: a replay of the journal then
        publishes the target a second time.
        """

        def publish() -> None:
            send(fields)
            self.journal.published(number)

        def flushed() -> None:
            if write_again is not None and self.required and self.journal.problem:
                self._unflushed.append(write_again)
            else:
                self._slices.add(publish)

        self.when_flushed(flushed)

    # -- the disk -----------------------------------------------------------------------------------------

    def post(self, call: Callable[[], None]) -> None:
        """Run a call of the journal on the node's thread, and step what it has queued."""

        def run() -> None:
            call()
            self._loop.work()

        self._ros.post(run)

    def disk_changed(self, problem: str) -> None:
        """Report a disk fault or its end; an exception is logged."""
        self._ros.guarded(self._fault_changed)(problem)

    def _fault_changed(self, problem: str) -> None:
        """Report a disk fault or its end; a fault holds the mission where required, unless it returns."""
        where = f"{problem}: {self.folder}"
        code = classify(UNRECORDED_CODE, {})
        self._ros.trouble("journal", problem and f"{code.label}: {where}", code)
        if not problem:
            self._ros.log.info("the journal is written again", folder=str(self.folder))
            self._loop.post(Event(CODE_REPORTED, {"code": RECORDED_CODE, "detail": ""}))
            return
        self._ros.log.error("the journal cannot be written", problem=problem, folder=str(self.folder))
        self._retry_at = self._ros.elapsed() + RETRY_S
        head = self.journal.head
        if self.required and head is not None and head.mission_id and not self._is_returning:
            self._loop.post(Event(HELD_BACK, {"hold": UNRECORDED, "detail": where}))
        else:
            self._loop.post(Event(CODE_REPORTED, {"code": UNRECORDED_CODE, "detail": where}))
        self._loop.work()  # before the waiting callbacks run
