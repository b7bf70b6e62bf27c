"""The services of the library: its entries, recordings, replays, and its published state."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
from typing import Any

from std_msgs.msg import String
from std_srvs.srv import Trigger

from lupin_arm.joints import ARM, JAW, JAW_CLOSED, JAW_CLOSED_DEG, JAW_OPEN, JAW_OPEN_DEG
from lupin_arm.library import Library, NotInLibrary, StoredPose, StoreFailed, checked_pose, valid_name
from lupin_arm.node.arm import Arm
from lupin_arm.node.gates import MissionGate
from lupin_arm.node.player import Player, if_on
from lupin_arm.node.recorder import Recorder, RecorderResult
from lupin_arm.node.serving import STALE_AFTER_S, ArmRequestRefused, refuse
from lupin_arm.presets import PRESETS
from lupin_arm.trajectory import clamp_speed, move
from lupin_engine.errors import nearest, shortened
from lupin_engine.plugin import user_folder
from lupin_msgs.srv import (
    ArmLibraryEdit,
    ArmRecord,
    GetArmLibrary,
    PlayArmSequence,
    SaveArmPose,
    SetArmPreset,
)
from lupin_ros.adapter import Qos, RosNode

#: The name under which saved poses move the arm.
OWNER = "library"
BASE = "/lupin/arm/library"
#: Seconds that a move to a saved pose takes, longer where it is far; and between two published states.
MOVE_S, PUBLISH_EVERY_S = 3.0, 0.2

#: The exceptions whose text is the answer to a request.
PROBLEMS = (ArmRequestRefused, NotInLibrary, StoreFailed)

ACTIONS = ("start", "save", "cancel")


class LibraryServer:
    """The services of the library; only one of them moves the arm at a time."""

    def __init__(self, ros: RosNode, arm: Arm, mission: MissionGate, path: Path) -> None:
        self._ros = ros
        self._arm = arm
        self._library = Library(path)
        self._logged: list[str] = []
        self._mission = mission
        self._player = Player(ros, arm)
        self._recorder = Recorder(ros, arm, self._library, _now)
        self._waits = False  # a move to a pose waits for torque
        self._called_off = ""  # why that is not wanted any more
        self._states = ros.publisher(String, f"{BASE}/state", Qos.LATCHED)
        self._mission.listen(self._mission_began)
        self._serve()
        ros.steady_timer(PUBLISH_EVERY_S, self._publish_state)
        self._publish_state()
        ros.log.info("arm library ready", file=str(self._library.path))

    def _serve(self) -> None:
        now = partial(self._ros.serve, stale_after=STALE_AFTER_S)
        later = partial(self._ros.serve_later, stale_after=STALE_AFTER_S, refuse=refuse)
        now(GetArmLibrary, f"{BASE}/list", self._list, refuse=_refuse_list, in_every_state=True)
        now(SaveArmPose, f"{BASE}/save_pose", _answering(self._save_pose), refuse=refuse)
        edit = _answering(lambda asked: self._library.edit(asked.kind, asked.name, asked.new_name))
        now(ArmLibraryEdit, f"{BASE}/delete", edit, refuse=refuse)
        later(SetArmPreset, f"{BASE}/goto_pose", _answering_later(self._go_to))
        later(PlayArmSequence, f"{BASE}/play", _answering_later(self._play))
        later(ArmRecord, f"{BASE}/record", self._record)
        # Stopping late is better than not at all.
        self._ros.serve_later(Trigger, f"{BASE}/stop", _answering_later(self._stop), in_every_state=True)

    # --- the entries --------------------------------------------------------------------------------------

    def _list(self, _: GetArmLibrary.Request, response: GetArmLibrary.Response) -> GetArmLibrary.Response:
        try:
            found: dict[str, Any] = dict(self._library.listing())
            response.success = True
        except NotInLibrary:
            found = {"poses": [], "sequences": []}
        response.json = json.dumps(found | _built_in() | self._notices())
        return response

    def _notices(self) -> dict[str, list[str]]:
        """Return the notices for people under their key; log new ones."""
        notices = [*self._library.notices, *filter(None, [self._recorder.notice()])]
        for notice in notices:
            if notice not in self._logged:
                self._logged.append(notice)
                self._ros.log.error(notice)
        return {"notices": notices} if notices else {}

    def _save_pose(self, request: SaveArmPose.Request) -> str:
        if request.from_current:
            arm, jaw = self._arm.pose(), self._arm.jaw()
            if arm is None:
                raise ArmRequestRefused(
                    "it is not known where the arm is: no joint states with all its joints just now"
                )
            pose, changed = checked_pose(arm, jaw, _now())
        else:
            jaw = request.gripper_rad if request.has_gripper else None
            pose, changed = checked_pose(request.arm_rad, jaw, _now())
        name = self._library.save_pose(request.name, pose, request.overwrite)
        return "; ".join([f"saved {name!r}", *changed])

    # --- moving -------------------------------------------------------------------------------------------

    def _must_be_free(self) -> None:
        reason = self._mission.refusal() or self._recorder.refusal()
        if self._player.name:
            reason = f"{self._player.name!r} is being played; stop it first"
        if reason is not None:
            raise ArmRequestRefused(reason)

    def _go_to(self, request: SetArmPreset.Request, answer: Callable[[str | None, str], None]) -> None:
        self._must_be_free()
        name, pose = valid_name(request.name), self._library.pose(request.name)
        self._waits, self._called_off = True, ""

        def on(problem: str | None) -> None:
            self._waits = False
            answer(*self._went(name, pose, problem or self._called_off))

        try:
            if_on(self._arm, OWNER, on)
        except ArmRequestRefused:
            self._waits = False
            raise

    def _went(self, name: str, pose: StoredPose, problem: str) -> tuple[str | None, str]:
        """Send the arm to a pose now that it has torque; return the problem, or None and a message."""
        if problem:
            return problem, ""
        try:
            self._must_be_free()  # torque took its time
            motion = move(pose.arm, MOVE_S, self._arm.here(OWNER))
            self._arm.send(motion, OWNER)
        except ArmRequestRefused as reason:
            return str(reason), ""
        return None, f"{name}: sent, there in {motion.duration:.1f} s{self._jaw(pose.gripper)}"

    def _jaw(self, angle: float | None) -> str:
        try:
            if angle is not None:
                self._arm.move_jaw(angle, OWNER)
        except ArmRequestRefused as reason:
            return f"; the jaw stays where it is: {reason}"
        return ""

    def _play(self, request: PlayArmSequence.Request, answer: Callable[[str | None, str], None]) -> None:
        self._must_be_free()
        if self._recorder.recording:
            raise ArmRequestRefused("a recording is under way; save or cancel it first")
        name, sequence = valid_name(request.name), self._library.sequence(request.name)
        try:
            speed = clamp_speed(request.speed)
        except ValueError as reason:
            raise ArmRequestRefused(str(reason)) from None

        def sent(problem: str | None) -> None:
            answer(problem, f"playing {name!r} at {speed:g}, {self._player.duration:.1f} s in all")

        self._player.play(name, sequence, speed, sent)

    def _stop(self, _: Trigger.Request, answer: Callable[[str | None, str], None]) -> None:
        def on(problem: str | None) -> None:
            servos = f"; the servos are still off: {problem}" if problem else ", the servos are on"
            answer(None, f"stopped; the recording by hand is discarded{servos}")

        reason = "stopped by the operator"
        if self._player.stop(reason) or self._stop_moving(reason):
            answer(None, "stopped; the arm stays where it is")
        elif self._recorder.call_off(reason):
            answer(None, "stopped; nothing is recorded, the servos are being switched on again")
        elif not self._recorder.stop(on):
            answer(None, "there was nothing to stop")

    def _stop_moving(self, reason: str) -> bool:
        """End a move to a saved pose, or one that waits for torque; return whether there was one."""
        if self._waits:
            self._called_off = reason
        elif self._arm.moves(OWNER):
            self._arm.hold()
        else:
            return False
        return True

    def _mission_began(self, reason: str) -> None:
        self._player.stop(reason)
        self._stop_moving(reason)
        self._recorder.leave(reason)

    # --- recording ----------------------------------------------------------------------------------------

    def _record(
        self,
        request: ArmRecord.Request,
        response: ArmRecord.Response,
        answer: Callable[[ArmRecord.Response], None],
    ) -> None:
        def reply(result: RecorderResult) -> None:
            response.success, response.message = result.success, result.message
            if result.sequence is not None:
                response.duration_s = result.sequence.duration_s
                response.n_waypoints = len(result.sequence.waypoints)
            answer(response)

        try:
            self._recorded(request, reply)
        except PROBLEMS as reason:
            reply(RecorderResult(False, str(reason)))

    def _recorded(self, request: ArmRecord.Request, answer: Callable[[RecorderResult], None]) -> None:
        action = request.action.strip().lower()
        if action == "start":
            if self._player.name:
                raise ArmRequestRefused(f"{self._player.name!r} is being played; stop it first")
            reason = self._mission.refusal()
            if reason is not None:
                raise ArmRequestRefused(reason)
            self._recorder.start(request.mode, request.name, request.include_gripper, answer)
        elif action == "save":
            self._recorder.save(request.name, request.overwrite, answer)
        elif action == "cancel":
            self._recorder.cancel(answer)
        else:
            raise ArmRequestRefused(
                f"unknown action {shortened(action)!r}; {nearest(shortened(action), ACTIONS)}"
            )

    # --- what is going on ---------------------------------------------------------------------------------

    def _publish_state(self) -> None:
        self._states.publish(String(data=json.dumps(self.state())))

    def state(self) -> dict[str, Any]:
        """Return the published state."""
        player, recorder = self._player, self._recorder
        played, duration = player.sequence, player.duration
        progress = min(player.elapsed / duration, 1.0) if duration else 0.0
        return {
            "recording": recorder.recording,
            "playing": bool(player.name),
            "name": player.name or recorder.name,
            "mode": played.mode if played else recorder.mode,
            "progress": round(progress, 3),
            "elapsed_s": round(player.elapsed if played else recorder.elapsed, 2),
            "n_waypoints": len(played.waypoints) if played else recorder.waypoints,
            "torque": self._arm.torque is not False,
            "unsaved": recorder.unsaved,
            **self._notices(),
        }


def serve_library(ros: RosNode, arm: Arm, mission: MissionGate, given_path: str) -> LibraryServer:
    """Offer the services of the library in the file `given_path`, '' for the user's own."""
    return LibraryServer(ros, arm, mission, library_path(given_path, ros.namespace))


def library_path(given: str, robot: str = "") -> Path:
    """Return the file of the library: the given one, else that of a namespace in the user's configuration.

    Raises:
        UsageError: none is given, and the user has no home folder.
    """
    if given:
        return Path(os.path.expanduser(given))
    return user_folder("XDG_CONFIG_HOME", ".config") / f"arm_library{robot.replace('/', '-')}.json"


def _now() -> str:
    """Return the wall clock's time, as in entries of the library."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")


def _answering(do: Callable[[Any], str]) -> Callable[[Any, Any], Any]:
    """Return a service that answers with the text of `do`, or with its refusal."""

    def answer(request: Any, response: Any) -> Any:
        try:
            response.message = do(request)
            response.success = True
        except PROBLEMS as reason:
            return refuse(response, str(reason))
        return response

    return answer


def _answering_later(
    do: Callable[[Any, Callable[[str | None, str], None]], None],
) -> Callable[[Any, Any, Callable[[Any], None]], None]:
    """Return a service that answers when `do` calls back: with a problem, or with None and a text."""

    def serve_it(request: Any, response: Any, answer: Callable[[Any], None]) -> None:
        def reply(problem: str | None, done: str = "") -> None:
            response.success, response.message = problem is None, done if problem is None else problem
            answer(response)

        try:
            do(request, reply)
        except PROBLEMS as reason:
            reply(str(reason))

    return serve_it


def _refuse_list(response: GetArmLibrary.Response, reason: str) -> GetArmLibrary.Response:
    response.json = json.dumps({"poses": [], "sequences": [], "notices": [reason]})
    return response


def _built_in() -> dict[str, Any]:
    """Return constants for displays: the presets, and the joints with their limits in degrees."""
    joints = [
        {"name": each.name, "state": each.state_name, "low": each.window_deg[0], "high": each.window_deg[1]}
        for each in ARM
    ]
    jaw = {"state": JAW, "low": JAW_OPEN_DEG, "high": JAW_CLOSED_DEG, "state_low": JAW_OPEN}
    return {"presets": sorted(PRESETS), "joints": joints, "jaw": {**jaw, "state_high": JAW_CLOSED}}
