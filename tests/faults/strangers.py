"""Others in the robot's network: another HMI's stop, a second battery, a goal, a list that is too long."""

from __future__ import annotations

from typing import Any

from nav2_msgs.action import NavigateToPose
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool

from lupin_msgs.msg import DiscoveredTag, DiscoveredTags
from lupin_ros.adapter.node import GoalCallbacks, Qos, RosNode

#: Seconds between two stops of today's HMI, and between two charges of a battery.
STOP_PERIOD_S, BATTERY_PERIOD_S = 0.5, 1.0
#: Where a stranger sends the robot, in turn, in metres.
PLACES = ((0.5, 7.5), (0.5, 0.7))


class Strangers:
    """They speak on the thread of the operator."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        self.stops = False
        self.charge: float | None = None
        #: How many tags the list has that somebody tells; 0: none is told.
        self.entries = 0
        self._goals = 0
        self._stop = ros.publisher(Bool, "/lupin/hmi/estop", Qos.EVENT)
        self._battery = ros.publisher(BatteryState, "/battery", Qos.EVENT)
        self._lists = ros.publisher(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED)
        self._navigation = ros.action(NavigateToPose, "navigate_to_pose")
        self._parameters = ros.service(SetParameters, "/lupin_sim/set_parameters")
        ros.steady_timer(STOP_PERIOD_S, lambda: self._tell_stop(True) if self.stops else None)
        ros.steady_timer(BATTERY_PERIOD_S, self._tell_rest)

    def _tell_stop(self, engaged: bool) -> None:
        self._stop.publish(Bool(data=engaged))

    def end_stop(self, *, told: bool) -> None:
        """Say that it is over, or say nothing any more."""
        self.stops = False
        if told:
            self._tell_stop(False)

    def _tell_rest(self) -> None:
        if self.charge is not None:
            self._battery.publish(BatteryState(percentage=self.charge, present=True))
        if self.entries:
            tags = [DiscoveredTag(tag_id=f"stranger-{number}", sightings=9) for number in range(self.entries)]
            self._lists.publish(DiscoveredTags(tags=tags))

    def end_battery(self) -> None:
        """It is full again, and goes on saying so."""
        self.charge = 1.0

    def send_goal(self) -> None:
        """Send the robot somewhere, as a display does."""
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = "map"
        goal.pose.pose.position.x, goal.pose.pose.position.y = PLACES[self._goals % len(PLACES)]
        goal.pose.pose.orientation.w = 1.0
        self._goals += 1
        self._navigation.send(goal, GoalCallbacks())

    def set_fault(self, fault: str) -> None:
        """Set what goes wrong with the simulated robot; one that is not there is asked again by nobody."""
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=fault)
        request = SetParameters.Request(parameters=[Parameter(name="fault", value=value)])

        def answered(_: Any) -> None:
            pass

        self._parameters.call(request, 5.0, answered)
