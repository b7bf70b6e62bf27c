"""`/lupin/arm/preset`: the arm to a named pose. It says yes when the arm was sent, not when it is there."""

from __future__ import annotations

from lupin_arm.node.arm import Arm
from lupin_arm.node.refused import Refused
from lupin_arm.node.serving import STALE_AFTER_S, refuse
from lupin_arm.presets import UnknownPreset, find_preset
from lupin_arm.trajectory import move
from lupin_engine.ros.adapter.node import RosNode
from lupin_msgs.srv import SetArmPreset

#: The name under which presets move the arm.
OWNER = "preset"


def serve(ros: RosNode, arm: Arm, duration: float) -> None:
    """Offer the service; a preset takes `duration` seconds, or longer where the arm has to go far."""

    def go(request: SetArmPreset.Request, response: SetArmPreset.Response) -> SetArmPreset.Response:
        try:
            name, pose = find_preset(request.name)
            motion = move(pose, duration, arm.here(OWNER))
            arm.send(motion, OWNER)
        except (UnknownPreset, Refused) as reason:
            response.message = str(reason)
            return response
        response.success = True
        response.message = f"{name}: sent, there in {motion.duration:.1f} s"
        return response

    ros.serve(SetArmPreset, "/lupin/arm/preset", go, stale_after=STALE_AFTER_S, refuse=refuse)
