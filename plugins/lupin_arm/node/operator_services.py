"""The operator's services: presets, sliders, and the power of the servos.

`/lupin/arm/preset` answers when the motion was sent, not when it ends; `/lupin/arm/set_torque` when the
switch is confirmed. The sliders convert degrees to joint angles. The vendor's own services must not be used
beside them: its hardware interface restores targets that it did not command itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from mirte_msgs.srv import SetServoAngleWithSpeed
from std_srvs.srv import SetBool, Trigger

from lupin_arm.joints import ARM, farthest, jaw_from_degrees
from lupin_arm.node.arm import Arm
from lupin_arm.node.serving import STALE_AFTER_S, ArmRequestRefused, refuse
from lupin_arm.presets import UnknownPreset, find_preset
from lupin_arm.trajectory import move, time_for
from lupin_msgs.srv import SetArmPreset
from lupin_ros.adapter import RosNode

#: The names under which operators move and switch the arm.
SLIDER, PRESET, OPERATOR = "slider", "preset", "operator"

#: Where `/lupin/arm/init` sends the arm.
ZERO = (0.0, 0.0, 0.0, 0.0)

#: Requests that may wait for their answer; each may take seconds, and nobody wants the hundredth any more.
#: Who switches the servos for something of his own has the arm for himself, asks once, and is not counted.
MOST_WAITING = 8


def serve_presets(ros: RosNode, arm: Arm, duration: float) -> None:
    """Offer `/lupin/arm/preset`; a motion takes `duration` seconds, or longer for a long way.

    A name that is unknown and a motion that the arm refuses are answered with the reason.
    """

    def go(request: SetArmPreset.Request, response: SetArmPreset.Response) -> SetArmPreset.Response:
        try:
            name, pose = find_preset(request.name)
            motion = move(pose, duration, arm.here(PRESET))
            arm.send(motion, PRESET)
        except (UnknownPreset, ArmRequestRefused) as reason:
            response.message = str(reason)
            return response
        response.success = True
        response.message = f"{name}: sent, there in {motion.duration:.1f} s"
        return response

    ros.serve(SetArmPreset, "/lupin/arm/preset", go, stale_after=STALE_AFTER_S, refuse=refuse)


def serve_torque(ros: RosNode, arm: Arm) -> None:
    """Offer `/lupin/arm/set_torque`; refusals, and requests beyond `MOST_WAITING`, get the reason at once."""
    waiting = 0

    def switch(request: SetBool.Request, response: Any, answer: Callable[[Any], None]) -> None:
        nonlocal waiting
        on = bool(request.data)

        def reply(problem: str | None) -> None:
            response.success = problem is None
            response.message = problem or f"the servos are {'on' if on else 'off: support the arm'}"
            answer(response)

        def done(problem: str | None) -> None:
            nonlocal waiting
            waiting -= 1
            reply(problem)

        if waiting >= MOST_WAITING:
            reply(f"{waiting} torque requests wait already; try again when they are answered")
            return
        waiting += 1
        try:
            arm.set_torque(on, OPERATOR, done)
        except ArmRequestRefused as reason:
            done(str(reason))

    ros.serve_later(SetBool, "/lupin/arm/set_torque", switch, stale_after=STALE_AFTER_S, refuse=refuse)


class Sliders:
    """The vendor-compatible services; they answer `status` only, so refusals are logged with their reason."""

    def __init__(self, ros: RosNode, arm: Arm, init_duration: float) -> None:
        self._ros = ros
        self._arm = arm
        self._init_duration = init_duration
        own: dict[str, Any] = {"stale_after": STALE_AFTER_S, "refuse": _refuse_status}
        for index, joint in enumerate(ARM):
            name = f"/lupin/arm/{joint.name}/set_angle_with_speed"
            ros.serve(SetServoAngleWithSpeed, name, partial(self._turn, index), **own)
        ros.serve_later(SetServoAngleWithSpeed, "/lupin/gripper/set_angle_with_speed", self._move_jaw, **own)
        ros.serve(Trigger, "/lupin/arm/init", self._init, stale_after=STALE_AFTER_S, refuse=refuse)

    def _turn(self, index: int, request: Any, response: Any) -> Any:
        """Turn one joint at a rate; the others keep their commanded angles."""
        try:
            angle, rate = _in_radians(request)
            here = self._arm.here(SLIDER)
            target = list(self._arm.commanded())
            target[index] = ARM[index].clamp(angle)
            # Those that are still under way keep to the rate as well.
            motion = move(target, 0.0, here)
            seconds = time_for(farthest(here, motion.target), rate)
            self._arm.send(move(target, seconds, here), SLIDER)
        except (ValueError, ArmRequestRefused) as reason:
            self._ros.log.warning(f"{ARM[index].name} not moved: {reason}")
        else:
            response.status = True
        return response

    def _move_jaw(self, request: Any, response: Any, answer: Callable[[Any], None]) -> None:
        """Send the jaw to an angle; its controller ignores the requested rate."""

        def done(problem: str | None) -> None:
            if problem is not None:
                self._ros.log.warning(f"jaw not moved: {problem}")
            response.status = problem is None
            answer(response)

        try:
            degrees = request.angle if request.degrees else math.degrees(request.angle)
            self._arm.move_jaw(jaw_from_degrees(degrees), SLIDER, done)
        except (ValueError, ArmRequestRefused) as reason:
            done(str(reason))

    def _init(self, request: Any, response: Any) -> Any:
        try:
            motion = move(ZERO, self._init_duration, self._arm.here(SLIDER))
            self._arm.send(motion, SLIDER)
        except ArmRequestRefused as reason:
            return refuse(response, str(reason))
        response.success = True
        response.message = f"zero pose: sent, there in {motion.duration:.1f} s"
        return response


def _in_radians(request: Any) -> tuple[float, float]:
    if not request.degrees:
        return request.angle, request.rate
    return math.radians(request.angle), math.radians(request.rate)


def _refuse_status(response: Any, _reason: str) -> Any:
    response.status = False
    return response


def serve_sliders(ros: RosNode, arm: Arm, init_duration: float) -> None:
    """Offer the vendor-compatible services of joints and jaw (`Sliders`)."""
    Sliders(ros, arm, init_duration)
