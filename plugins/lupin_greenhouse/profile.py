"""The profile `greenhouse`: vocabulary and wire types of robots that visit tags and read sensors there."""

from __future__ import annotations

from lupin_engine.plugin import (
    ANY,
    TEXT,
    Access,
    Argument,
    Channel,
    Flag,
    OperatorRequest,
    Profile,
    Publication,
    RequestField,
    StartService,
    Terminal,
    Type,
    Wire,
    list_of,
)
from lupin_greenhouse import messages
from lupin_greenhouse.mission import STAGES
from lupin_greenhouse.readings import SENSOR_UNITS

#: The types that every run uses, as the rest of the system has them.
HASHES = {
    "lupin_msgs/srv/StartMission": "59ff907d315644687e47037362f4c73841fdbdd594d97c6fd357ab1bb5394485",
    "lupin_msgs/msg/MissionState": "502295af37b7d3b1b27d22ebdaa3c2e05294201b5e8039e26499b719b2fe51d0",
    "lupin_msgs/msg/Observation": "34d7b6947cec3ae85a04251102711bcf38e2f21cfa1fb583c3dbe6544137ffd9",
    "lupin_msgs/srv/GetTagReading": "c907cf6b8204d5687fc9499bd2f7233af5ca609e16b2df0291a3c66964c1a49b",
    "nav2_msgs/action/NavigateToPose": "a56dba8a3234a1215e610180dc703ae25bbf406dded8b54887891c9732857eab",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}

WIRE = Wire(
    state=Channel("/mission/state", "lupin_msgs/msg/MissionState", "LATCHED"),
    outcomes=Channel("/floranova/observations", "lupin_msgs/msg/Observation", "BACKLOG"),
    start=StartService(
        "/mission/start",
        "lupin_msgs/srv/StartMission",
        request_fields=messages.start_fields,
        read_request=messages.read_start,
        answer_fields=messages.answer_fields,
        read_answer=messages.read_answer,
    ),
    requests="/mission/{}",
    state_fields=messages.state_fields,
    outcome_fields=messages.observation_fields,
    read_state=messages.read_state,
    read_outcome=messages.read_observation,
    urgent=("estop_engaged", "battery_low"),
    hashes=HASHES,
)

PROFILE = Profile(
    name="greenhouse",
    doc="Robots that visit tags in a greenhouse and read the sensors there.",
    outcomes=messages.OUTCOMES,
    request={
        "tag_sequence": RequestField(
            list_of(TEXT), "--tags", "1,5,12", "The tags to visit; default: the mission's own."
        ),
        "discovery_goal": RequestField(
            Type("integer", "count", minimum=0, maximum=messages.HIGHEST_COUNT),
            "--goal",
            doc="How many tags to discover.",
        ),
    },
    requests={
        "abort": OperatorRequest("The operator ends the mission.", however_late=True, key="a"),
        "dock": OperatorRequest("The operator sends the robot to the dock.", however_late=True, key="d"),
        "pause": OperatorRequest("The operator suspends the mission.", however_late=True, key="p"),
        "reset": OperatorRequest("The operator leaves FAULT."),
        "resume": OperatorRequest("The operator lets the mission go on.", key="r"),
        "skip_current": OperatorRequest("The operator skips the current target.", verb="skip", key="s"),
    },
    resume="resume",
    abort="abort",
    publications={
        "publish.reading": Publication(
            "Publish a reading that belongs to no visit.",
            outcome="OK",
            target=("tag", Argument(TEXT, "id of the tag")),
            reading=("reading", Argument(ANY, "what was read")),
        )
    },
    stages=STAGES,
    terminal=Terminal(
        target="tag",
        targets="tags",
        read="sensors",
        columns=SENSOR_UNITS,
        flags={
            "estop_engaged": Flag("E-STOP", "e-stop engaged", "e-stop released", alarm=True),
            "paused": Flag("PAUSED", "paused", "resumed"),
            "battery_low": Flag("BATTERY LOW", "battery low", "battery charged"),
        },
        gauges={"battery": "battery_low"},
    ),
    values_of=messages.values_of,
    stop="estop",
    projections=messages.PROJECTIONS,
    wire=WIRE,
    access=Access(
        viewer=("/scan", "/odom", "/io/imu/movement/data", "/rosout"),
        operator=("/cmd_vel", "/cmd_vel_manual", "/lupin/leds/set", "/lupin/leds/auto"),
        engineer=("/lupin/nav/clear_map",),
        velocities=("/cmd_vel*",),
    ),
)
