"""Makes recordings: of an arm that is moved by hand without torque, or of one that is commanded.

A recording by hand begins when the servos are confirmed off, and any end of it switches them on again. Its
data stays until it is saved or cancelled, also where saving fails, but not beyond the process.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

from lupin_arm.joints import Pose
from lupin_arm.library import MODES, Library, NotInLibrary, Sequence, StoreFailed, valid_name
from lupin_arm.node.arm import Arm
from lupin_arm.node.mark import RestoreMarker
from lupin_arm.node.serving import ArmRequestRefused
from lupin_arm.node.torque import Done
from lupin_arm.recorder import PoseRecording
from lupin_engine.errors import nearest, shortened
from lupin_ros.adapter import RosNode

#: The name under which the arm is kept for a recording by hand.
OWNER = "library: recording"
BY_HAND = "kinesthetic"
#: Seconds that the end of the process waits for the servos to be on again.
LAST_WAIT_S = 2.0

TORQUE_SERVICE = "/lupin/arm/set_torque"
#: Why everything else has to wait while they are.
SWITCHING = "the servos are being switched for a recording; try again in a moment"


@dataclass(frozen=True)
class RecorderResult:
    """The result of a request."""

    success: bool
    message: str
    sequence: Sequence | None = None


Answer = Callable[[RecorderResult], None]


class _RecorderPhase(enum.Enum):
    IDLE = "idle"
    SWITCHING = "switching"  #: the servos are being switched for a recording
    RECORDING = "recording"
    UNSAVED = "unsaved"  #: ended, not yet in the library


class Recorder:
    """Makes at most one recording at a time."""

    def __init__(self, ros: RosNode, arm: Arm, library: Library, created: Callable[[], str]) -> None:
        """`created` gives the time as in entries of the library."""
        self._ros = ros
        self._arm = arm
        self._library = library
        self._created = created
        self._phase = _RecorderPhase.IDLE
        self._recording: PoseRecording | None = None
        self._unsaved: Sequence | None = None
        self._remarks = ""  # what is to be said of it when it is saved
        self._called_off = ""  # why a recording that is about to begin is not wanted any more
        self._mark = RestoreMarker(ros, library.path.with_name(f"{library.path.stem}.limp"))
        self.name = ""
        arm.listen(self._on_feedback)
        ros.on_stop(self._close)

    # --- its state ----------------------------------------------------------------------------------------

    @property
    def recording(self) -> bool:
        """Whether poses are being recorded."""
        return self._phase is _RecorderPhase.RECORDING

    @property
    def unsaved(self) -> bool:
        """Whether a recording has ended and is not saved."""
        return self._phase is _RecorderPhase.UNSAVED

    @property
    def mode(self) -> str:
        """The mode of the recording, '' when there is none."""
        if self._unsaved is not None:
            return self._unsaved.mode
        return self._recording.mode if self._recording is not None else ""

    @property
    def waypoints(self) -> int:
        """How many poses there are."""
        if self._unsaved is not None:
            return len(self._unsaved.waypoints)
        return len(self._recording.waypoints) if self._recording is not None else 0

    @property
    def elapsed(self) -> float:
        """How long the recording is, in seconds."""
        if self._unsaved is not None:
            return self._unsaved.duration_s
        return self._recording.elapsed(self._ros.elapsed()) if self._recording is not None else 0.0

    def notice(self) -> str:
        """Return a notice that a recording has left the arm without torque; "" where it has not."""
        if self._mark.left_behind and self._arm.torque and self._phase is not _RecorderPhase.SWITCHING:
            self._mark.remove()
        if not self._mark.left_behind:
            return ""
        return (
            "a recording by hand has ended, and the arm may still be without torque: "
            f"support it, then switch torque on ({TORQUE_SERVICE})"
        )

    def refusal(self) -> str | None:
        """Return why nothing else may be begun with the arm now; None if it may."""
        if self._phase is _RecorderPhase.SWITCHING:
            return SWITCHING
        if self._phase is _RecorderPhase.RECORDING and self.mode == BY_HAND:
            return "a recording by hand is under way; save or cancel it first"
        return None

    # --- start --------------------------------------------------------------------------------------------

    def start(self, mode: str, name: str, include_gripper: bool, answer: Answer) -> None:
        """Begin to record; by hand as soon as the servos are confirmed off.

        Raises:
            ArmRequestRefused: it cannot begin now; `answer` is not called.
        """
        mode = mode.strip().lower() or "teleop"
        if mode not in MODES:
            raise ArmRequestRefused(f"unknown mode {shortened(mode)!r}; {nearest(shortened(mode), MODES)}")
        if self._phase is _RecorderPhase.UNSAVED:
            raise ArmRequestRefused("a recording is not saved yet; save it under a name, or cancel it")
        if self._phase is not _RecorderPhase.IDLE:
            raise ArmRequestRefused(self.refusal() or "a recording is under way; save or cancel it first")
        try:
            name = valid_name(name) if name.strip() else ""  # it may be given with the save
        except NotInLibrary as reason:
            raise ArmRequestRefused(str(reason)) from None
        recording = PoseRecording(mode, include_gripper)
        if mode == BY_HAND:
            self._let_go(recording, name, answer)
        else:
            self._begin(recording)
            self.name = name
            answer(RecorderResult(True, "recording; steer the arm, then save"))

    def _let_go(self, recording: PoseRecording, name: str, answer: Answer) -> None:
        self._arm.must_be_known()  # else nothing would be recorded, and torque could not come back
        self._arm.claim(OWNER, "a recording by hand", lambda _: None)  # without torque nothing moves it
        self._phase, self._called_off, self.name = _RecorderPhase.SWITCHING, "", name
        self._mark.set()
        try:
            self._arm.set_torque(False, OWNER, lambda problem: self._let_go_ended(recording, answer, problem))
        except ArmRequestRefused:
            self._mark.remove()
            self._end()
            raise

    def _let_go_ended(self, recording: PoseRecording, answer: Answer, problem: str | None) -> None:
        problem = problem or self._called_off
        if not problem:
            self._begin(recording)
            answer(RecorderResult(True, "recording; the arm has no torque: move it by hand, then save"))
            return

        def restored(still_off: str | None) -> None:
            self._end()
            on = f"; and the servos may be off: {still_off}" if still_off else "; the servos are on"
            answer(RecorderResult(False, f"not recording: {problem}{on}"))

        self._restore(restored)

    def _begin(self, recording: PoseRecording) -> None:
        self._recording, self._phase = recording, _RecorderPhase.RECORDING

    def _on_feedback(self, stamp: float, pose: Pose, jaw: float | None) -> None:
        if self._phase is _RecorderPhase.RECORDING and self._recording is not None:
            self._recording.sample(stamp, self._ros.elapsed(), pose, jaw)

    # --- save and cancel ----------------------------------------------------------------------------------

    def save(self, name: str, overwrite: bool, answer: Answer) -> None:
        """End the recording and save it; `answer` is called when the arm has torque again.

        Raises:
            ArmRequestRefused: there is nothing to save, or not under that name; the recording is not lost.
        """
        name = name or self.name
        if self._phase is _RecorderPhase.SWITCHING:
            raise ArmRequestRefused(SWITCHING)
        if self._phase is _RecorderPhase.IDLE:
            raise ArmRequestRefused("nothing is being recorded")
        try:
            self._library.check_free("sequence", name, overwrite)
            self._finish()
        except NotInLibrary as reason:
            raise ArmRequestRefused(f"{reason}; the recording is not lost") from None
        self._then_with_torque(lambda problem: answer(self._keep(name, overwrite, problem)))

    def _finish(self) -> None:
        recording = self._recording
        if recording is not None:
            self._unsaved = recording.finish(self._ros.elapsed(), self._created())
            beyond = f"{recording.clamped} waypoints beyond the limits were kept at them"
            remarks = filter(None, [recording.full, beyond if recording.clamped else ""])
            self._remarks = "".join(f", {remark}" for remark in remarks)

    def _keep(self, name: str, overwrite: bool, problem: str | None) -> RecorderResult:
        assert self._unsaved is not None
        sequence = self._unsaved
        self._phase = _RecorderPhase.UNSAVED
        self._recording = None
        still_off = f"; the servos are still off: {problem}" if problem else ""
        try:
            name = self._library.save_sequence(name, sequence, overwrite)
        except (NotInLibrary, StoreFailed) as reason:
            kept = "the recording is kept: save it again, or cancel it"
            return RecorderResult(False, f"{reason}; {kept}{still_off}", sequence)
        self._end()
        return RecorderResult(True, f"saved {name!r}{self._remarks}{still_off}", sequence)

    def cancel(self, answer: Answer) -> None:
        """Discard the recording; `answer` is called when the arm has torque again.

        Raises:
            ArmRequestRefused: there is none.
        """
        if self._phase is _RecorderPhase.IDLE:
            raise ArmRequestRefused("nothing is being recorded")
        if self._phase is _RecorderPhase.SWITCHING:
            raise ArmRequestRefused(SWITCHING)

        def ended(problem: str | None) -> None:
            self._end()
            still_off = f"; the servos are still off: {problem}" if problem else ""
            answer(RecorderResult(True, f"the recording is discarded{still_off}"))

        self._then_with_torque(ended)

    def call_off(self, reason: str) -> bool:
        """Cancel a recording by hand that waits for the servos; return whether there was one."""
        if self._phase is not _RecorderPhase.SWITCHING or self._recording is not None:
            return False
        self._called_off = reason
        return True

    def stop(self, then: Done) -> bool:
        """Discard a recording by hand; return whether there was one. `then` comes with the torque."""
        if self._phase is not _RecorderPhase.RECORDING or self.mode != BY_HAND:
            return False

        def ended(problem: str | None) -> None:
            self._end()
            then(problem)

        self._then_with_torque(ended)
        return True

    def leave(self, reason: str) -> None:
        """End a recording by hand, keep it for a save, and switch the torque on."""
        if self.call_off(reason) or self._phase is not _RecorderPhase.RECORDING or self.mode != BY_HAND:
            return
        try:
            self._finish()
        except NotInLibrary:
            self.stop(_nobody_waits)
            return
        self._ros.log.warning("recording ended, and not saved yet", reason=reason)
        self._then_with_torque(self._left)

    def _left(self, _: str | None) -> None:
        self._phase, self._recording = _RecorderPhase.UNSAVED, None

    # --- torque -------------------------------------------------------------------------------------------

    def _then_with_torque(self, then: Done) -> None:
        """Call `then` when the servos are on again, where this recording has switched them off."""
        if self._recording is None or self._recording.mode != BY_HAND:
            then(None)
            return
        self._phase = _RecorderPhase.SWITCHING
        self._restore(then)

    def _restore(self, then: Done) -> None:
        def switched(problem: str | None) -> None:
            if problem is None:
                self._mark.remove()
            else:
                self._mark.leave()
                self._ros.log.error(f"the servos are still off: {problem}", switch=TORQUE_SERVICE)
            self._arm.release(OWNER)
            then(problem)

        try:
            self._arm.set_torque(True, OWNER, switched)
        except ArmRequestRefused as reason:
            switched(str(reason))

    def _end(self) -> None:
        self._phase, self._recording, self._unsaved = _RecorderPhase.IDLE, None, None
        self.name = ""
        self._arm.release(OWNER)

    def _close(self) -> None:
        """Switch the torque on at the end of the process; an unsaved recording is lost."""
        if not self.call_off("the program ends"):
            self.stop(_nobody_waits)
        self._ros.work_until(lambda: self._phase is not _RecorderPhase.SWITCHING, LAST_WAIT_S)


def _nobody_waits(_: str | None) -> None:
    """Ignore the result; it is logged."""
