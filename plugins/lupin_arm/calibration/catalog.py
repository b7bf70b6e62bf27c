"""The catalog of the calibration chart's operations; only the arm's own process executes them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_arm.calibration.offsets import HOMES
from lupin_engine.plugin import (
    ANGLE,
    BOOL,
    DURATION,
    INTEGER,
    TEXT,
    Argument,
    Code,
    LiveValue,
    Mock,
    OnHold,
    Operation,
    Plugin,
    Type,
    list_of,
)

#: The offset of a servo, in hundredths of a degree.
SERVO_OFFSET = Type("record", "servo_offset", fields={"joint": TEXT, "centidegrees": INTEGER})
#: The correction of a servo; see `offsets.Correction`.
CORRECTION = Type(
    "record",
    "correction",
    fields={"joint": TEXT, "difference": INTEGER, "in_place": BOOL, "refused": TEXT},
)

_OFFSETS, _CORRECTIONS = list_of(SERVO_OFFSET), list_of(CORRECTION)
_FAILED = Code(
    "servo_failed",
    "a servo did not do what it was asked for",
    advice="Look at the servo that the detail names, its cable and its power, then begin anew.",
)


def _each(**fields: Any) -> list[Mapping[str, Any]]:
    return [{"joint": joint, **fields} for joint in HOMES]


PLUGIN = Plugin(
    name="calibration",
    doc="What the calibration of the arm does to the servos; for the arm's own chart only.",
    types={kind.name: kind for kind in (SERVO_OFFSET, CORRECTION)},
    operations={
        "take_arm": Operation(
            doc="Keep everybody else from moving the arm, and its controller from moving the servos.",
            codes=(
                Code("arm_not_free", "the arm cannot be had", advice="Wait until nobody else moves the arm."),
                _FAILED,
            ),
            mock=Mock(after=0.1),
        ),
        "read_offsets": Operation(
            doc="Read the offsets of all servos.",
            result={"offsets": _OFFSETS},
            codes=(_FAILED,),
            mock=Mock(after=0.1, result={"offsets": _each(centidegrees=0)}),
        ),
        "clear_offsets": Operation(
            doc="Write an offset of zero to all servos.",
            arguments={"before": Argument(_OFFSETS, "what they have, and must get back")},
            codes=(_FAILED,),
            mock=Mock(after=0.1),
        ),
        "write_offsets": Operation(
            doc="Write offsets to servos.",
            arguments={"offsets": Argument(_OFFSETS, "the servos and what is written to them")},
            codes=(_FAILED,),
            mock=Mock(after=0.1),
        ),
        "move_to_zero": Operation(
            doc="Send all servos to zero; ends when they were sent.",
            codes=(_FAILED,),
            on_hold=OnHold.CANCEL,
            mock=Mock(after=0.1),
        ),
        "release": Operation(doc="Switch the torque of the arm off.", codes=(_FAILED,), mock=Mock(after=0.1)),
        "measure": Operation(
            doc="Look for a while where the servos stand, and reckon what offsets they need.",
            arguments={
                "window": Argument(DURATION, "how long is looked"),
                "largest": Argument(ANGLE, "the largest offset that may be written"),
            },
            result={"corrections": _CORRECTIONS},
            codes=(
                Code(
                    "no_position",
                    "a servo does not tell where it is",
                    advice="Look at the cables of the servos, then begin anew.",
                ),
            ),
            mock=Mock(
                after=2.0,
                result={"corrections": _each(difference=0, in_place=True, refused="")},
            ),
        ),
        "correct": Operation(
            doc="Write the offsets that were reckoned, and send to zero the servos that are right now.",
            arguments={
                "corrections": Argument(_CORRECTIONS, "what was reckoned"),
                "before": Argument(_OFFSETS, "what servos that cannot be corrected get back"),
            },
            codes=(_FAILED,),
            on_hold=OnHold.CANCEL,
            mock=Mock(after=0.2),
        ),
        "enable": Operation(
            doc="Switch the torque on where the arm is, and let others move it again.",
            codes=(
                Code(
                    "still_limp",
                    "the arm is still without torque; support it, and switch torque on",
                    advice="Support the arm with your hand, then switch its torque on.",
                ),
            ),
            mock=Mock(after=0.1),
        ),
    },
    internal=True,
    values={"calibration.stopped": LiveValue("whether the arm is stopped", BOOL, initial=False)},
)
