"""The orchestrator's write-ahead journal.

It chooses the file, one for each mission, publishes outcomes only after they are flushed, and reports disk
faults.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial

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
)
from lupin_engine.runtime import Journal, JournalHead, Keep, Leftover, Refusals, journal_folder
from lupin_ros.adapter.host import Slices
from lupin_ros.adapter.node import RosNode
from lupin_ros.orchestrator.resuming import LookBack
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
#: What mends a journal that cannot be written.
WHAT_TO_DO = (
    "make room there or make it writable, or name another folder: XDG_STATE_HOME=FOLDER, or the parameter "
    "journal_path of mission_orchestrator"
)
#: How often it is tried again to write, in seconds.
RETRY_S = 5.0


class Keeping:
    """The journal of one orchestrator; `work` has its loop drained."""

    def __init__(
        self, ros: RosNode, boot: str, work: Callable[[], None], tell: Callable[[Event], None]
    ) -> None:
        """Open the journal; `tell` queues an event of the machine."""
        self._ros = ros
        self._boot = boot
        self._work = work
        self._tell = tell
        given = ros.parameters()
        self.required = bool(given["journal_required"] and not given["may_repeat_outcomes"])
        if not given["journal_required"]:
            ros.log.warning("journal_required", problem="false is written may_repeat_outcomes:=true now")
        self.folder = journal_folder(str(given["journal_path"] or ""))
        size = 1_000_000 * int(given["journal_megabytes"])
        keep = Keep(int(given["journal_missions"]), float(given["journal_days"]), size)
        self.journal = Journal(self.folder, keep, self._post, ros.guarded(self._changed))
        self._refusals = Refusals(self.journal.refused)
        #: What is written of many targets at once, and what is published of them.
        self._writes, self._slices = Slices(ros.post), Slices(ros.post)
        #: What writes an outcome again that could not be written and is not published.
        self._unkept: list[Callable[[], None]] = []
        self._loaded: LoadedMissions | None = None
        self._retry_at = 0.0
        self._part = 1
        #: Which targets the file knows of, and by what it is seen that there are others.
        self._targets: set[str] = set()
        self._walks: tuple[object, ...] = ()
        self._is_returning = False

    def refusal(self, request: Event, foreseen: Possibility, profile: Profile) -> Refusal | None:
        """Say why a request is refused without a step; None where it is the machine's to answer.

        While nothing can be written down none is taken, unless it stops something; and what is foreseen to be
        refused is only counted where that was written many times already.
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
        """Have all that was noted on the disk, and end."""
        self._refusals.report_all()
        self._writes.finish()
        self._slices.finish()
        self.journal.close()

    def when_flushed(self, then: Callable[[], None]) -> None:
        """Call `then` when what was recorded is flushed; at once while no file is open or the disk fails."""
        self.journal.when_flushed(self._ros.guarded(then))

    # -- which file -------------------------------------------------------------------------------------

    def begin(
        self, loaded: LoadedMissions, machine: Machine, mission: str = "", mission_id: str = ""
    ) -> None:
        """Begin a file with the memory of a machine as it is, for a mission or for the time between them."""
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
            )
        )
        self._targets, self._walks = set(), ()
        self._note_targets(machine)
        unkept, self._unkept = self._unkept, []
        for write_again in unkept:
            write_again()

    def before(self, request: Event, foreseen: Possibility, machine: Machine) -> None:
        """Begin a mission's file where a request is about to start it."""
        if request.name == START and foreseen.possible and self._loaded is not None:
            data = request.data
            self.begin(self._loaded, machine, str(data["mission_type"]), str(data.get("mission_id", "")))

    def after(self, step: Step, view: View, machine: Machine) -> None:
        """Note new targets; close a mission's file where a step ended it, when all it published is out."""
        self._is_returning = view.lifecycle in machine.chart.profile.stages.returning
        self._note_targets(machine)
        head = self.journal.head
        profile = machine.chart.profile
        if head is None or not head.mission_id or not step.changed:
            return
        if view.lifecycle not in profile.stages.without_mission or view.mission_id != head.mission_id:
            return
        counts = {outcome.counter: view.counts.get(outcome.name, 0) for outcome in profile.outcomes}
        self.journal.ended({"state": view.lifecycle, "code": view.code, "total": view.total, **counts})
        self.when_flushed(lambda: self._writes.add(lambda: self._rest(head.mission_id, machine)))

    def _note_targets(self, machine: Machine) -> None:
        """Write the targets that are new in a mission's file."""
        head, memory = self.journal.head, machine.memory
        if head is None or not head.mission_id or memory.mission_id != head.mission_id:
            return
        walks = memory.itineraries.items()
        found = tuple((name, w.begun, w.before, w.sweep, len(w.items)) for name, w in walks)
        if found == self._walks:
            return
        self._walks = found
        visits = [visit for visit in memory.outcomes if not visit.closed]
        new = [target for target in dict.fromkeys(v.target for v in visits) if target not in self._targets]
        self._targets.update(new)
        if new:
            self.journal.targets(memory.mission, head.mission_id, new)

    def _rest(self, mission_id: str, machine: Machine) -> None:
        """Write into a file about no mission, unless the next one has begun meanwhile."""
        head = self.journal.head
        if head is not None and head.mission_id == mission_id and self._loaded is not None:
            self.begin(self._loaded, machine)

    def tend(self, machine: Machine) -> None:
        """Write a snapshot, or begin another file, where one is due; to be called between steps.

        Not while outcomes wait to be written: who begins at the snapshot would not know of them.
        """
        if self._writes.is_done and self.journal.compact(machine):
            self._begin_anew(machine)

    def look(self, machine: Machine) -> None:
        """Notice a disk that does not answer, and try again where it has failed; called now and then."""
        self.journal.check_disk()
        self._refusals.report_due(self._ros.elapsed())
        if self.journal.problem and self._ros.elapsed() >= self._retry_at:
            self._retry_at = self._ros.elapsed() + RETRY_S
            self._begin_anew(machine)

    def _begin_anew(self, machine: Machine) -> None:
        head = self.journal.head
        if head is not None and self._loaded is not None:
            self.begin(self._loaded, machine, head.mission, head.mission_id)

    def go_on(self, found: LookBack, loaded: LoadedMissions, shift: float, now: float) -> None:
        """Go on with the file that was found, as far as it can be used; otherwise `begin` must follow.

        `shift` is how far the clock, which says `now`, is ahead of the one of the file.
        """
        self.journal.count_from(found.left.outcomes)
        if found.machine is None and not found.closing:
            return
        if not found.left.file.damaged:
            self._loaded, self._part = loaded, found.left.file.head.part
            self.journal.go_on(found.left.file, shift, now, self._boot)

    def publish_again(
        self, found: LookBack, new: Iterable[tuple[Publish, Fields]], send: Callable[[Fields], None]
    ) -> None:
        """Publish what was told, and what is new; a repeat has the same fields."""

        def send_again(fields: Fields) -> None:
            try:
                send(fields)
            except Exception as problem:  # the journal has fields that are none of the message
                self._ros.log.warning("an outcome cannot be published again", problem=str(problem))

        for number, fields in found.left.newest.items():
            self._send_when_kept(number, fields, send_again)
        for told, fields in new:
            self.publish([told], partial(_given, fields), send)

    def remember(self, left: Leftover, commands: CommandMemory) -> None:
        """Have commands known that another process was given: none is carried out twice."""
        ahead = self.journal.wall_ns() * 1e-9 - time.monotonic()
        for command_id, kept in left.commands.items():
            commands.remember(command_id, kept.wall - ahead, kept.what, kept.answer)

    def closed(self, why: str) -> None:
        """Write why the mission ends that was under way."""
        self.journal.ended({"state": "", "code": CLOSED_CODE, "detail": why})

    # -- what leaves when it is kept ----------------------------------------------------------------------

    def publish(
        self,
        outcomes: Iterable[Publish],
        fields_of: Callable[[Publish], Fields],
        send: Callable[[Fields], None],
    ) -> None:
        """Publish outcomes when they are kept, and note that they were; of many at once some in each turn."""

        self._writes.add_each(partial(self._write, told, fields_of, send) for told in outcomes)

    def _write(
        self, told: Publish, fields_of: Callable[[Publish], Fields], send: Callable[[Fields], None]
    ) -> None:
        fields = fields_of(told)
        again = partial(self._write, told, partial(_given, fields), send)
        self._send_when_kept(self.journal.outcome(told, fields), fields, send, again)

    def _send_when_kept(
        self,
        number: int,
        fields: Fields,
        send: Callable[[Fields], None],
        again: Callable[[], None] | None = None,
    ) -> None:
        """Publish an outcome when it is flushed; one that is not is written `again`, later.

        With `may_repeat_outcomes` it is published all the same: who replays the journal does not know of it,
        and publishes the target once more.
        """

        def publish() -> None:
            send(fields)
            self.journal.published(number)

        def kept() -> None:
            if again is not None and self.required and self.journal.problem:
                self._unkept.append(again)
            else:
                self._slices.add(publish)

        self.when_flushed(kept)

    # -- the disk -----------------------------------------------------------------------------------------

    def _post(self, call: Callable[[], None]) -> None:
        def run() -> None:
            call()
            self._work()

        self._ros.post(run)

    def _changed(self, problem: str) -> None:
        """Report that the journal cannot be written, or can again; hold the mission, but not its way home."""
        where = f"{problem}: {self.folder}"
        self._ros.trouble("journal", problem and f"the journal cannot be written: {where}")
        if not problem:
            self._ros.log.info("the journal is written again", folder=str(self.folder))
            self._tell(Event(CODE_REPORTED, {"code": RECORDED_CODE, "detail": ""}))
            return
        self._ros.log.error("the journal cannot be written", problem=problem, folder=str(self.folder))
        self._retry_at = self._ros.elapsed() + RETRY_S
        head = self.journal.head
        if self.required and head is not None and head.mission_id and not self._is_returning:
            self._tell(Event(HELD_BACK, {"hold": UNRECORDED, "detail": where}))
        else:
            self._tell(Event(CODE_REPORTED, {"code": UNRECORDED_CODE, "detail": where}))
        self._work()  # before what has waited goes on


def _given(fields: Fields, _: Publish) -> Fields:
    return fields
