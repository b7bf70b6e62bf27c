"""The profile of the warehouse's robots."""

from lupin_engine.plugin.profile import (
    Channel,
    Flag,
    OperatorRequest,
    Profile,
    Rating,
    RequestField,
    Stages,
    StartService,
    TargetOutcome,
    Terminal,
    Wire,
)
from lupin_engine.plugin.types import TEXT, list_of
from lupin_warehouse import messages
from lupin_warehouse.messages import LEFT, MISSING, PICKED

STATUS = "diagnostic_msgs/msg/DiagnosticStatus"

PROFILE = Profile(
    name="warehouse",
    doc="Robots that fetch parcels from shelves.",
    outcomes=(
        TargetOutcome(PICKED, "picked", "picked", Rating.GOOD),
        TargetOutcome(MISSING, "missing", "missing"),
        TargetOutcome(LEFT, "left", "left", Rating.LEFT_OUT),
    ),
    request={"shelves": RequestField(list_of(TEXT), "--shelves", "A1,B2", "The shelves of the order.")},
    requests={
        "halt": OperatorRequest("The operator stops the robot where it is.", however_late=True, key="h"),
        "go_on": OperatorRequest("The operator lets the robot go on.", verb="go-on", key="g"),
        "call_off": OperatorRequest(
            "The operator ends the order.", however_late=True, verb="call-off", key="c"
        ),
    },
    resume="go_on",
    abort="call_off",
    stages=Stages(
        starting=("WAKING",), ready=("IDLE",), returning=("PARKING",), ended=("PARKED",), faulted=("FAULT",)
    ),
    terminal=Terminal(
        target="shelf",
        targets="shelves",
        read="parcel",
        columns={"width": "m", "force": "N"},
        flags={"halted": Flag("HALTED", "halted", "goes on")},
    ),
    values_of=messages.gripped,
    wire=Wire(
        state=Channel("/picker/state", STATUS, "LATCHED"),
        outcomes=Channel("/picker/outcomes", STATUS, "BACKLOG"),
        start=StartService(
            name="/picker/order",
            type="diagnostic_msgs/srv/AddDiagnostics",
            request_fields=messages.order_fields,
            read_request=messages.read_order,
            answer_fields=messages.answer_fields,
            read_answer=messages.read_answer,
        ),
        requests="/picker/{}",
        state_fields=messages.state_fields,
        outcome_fields=messages.outcome_fields,
        read_state=messages.read_state,
        read_outcome=messages.read_outcome,
    ),
)
