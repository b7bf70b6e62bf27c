"""What a plugin that is known as data says of its calls and messages: see `chart.bindings`, which makes it.

`around` has what every expression may read: `param`, `constant` (of the interface) and `now`, in seconds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

Data = Mapping[str, Any]


class Endpoint(Protocol):
    """A service, action or topic; its type is installed and fits."""

    @property
    def name(self) -> str:
        """Return its name."""

    @property
    def type(self) -> str:
        """Return its type, such as std_srvs/srv/Trigger."""

    @property
    def kind(self) -> str:
        """Return srv, action or msg."""

    @property
    def place(self) -> object:
        """Return where all this is written, for people."""

    @property
    def deadline(self) -> float | None:
        """Return when a call counts as lost, in seconds."""

    @property
    def qos(self) -> str:
        """Return how a topic is carried: reliable, latched or sensor."""


class Sending(Protocol):
    """What is sent."""

    def sent(self, arguments: Data, around: Data) -> Data:
        """Return the fields of a request, goal or message."""


class Meaning(Protocol):
    """What an answer means: the result, or None with a code and a text that says why not."""

    @property
    def result(self) -> Data | None:
        """Return the result, None when the operation failed."""

    @property
    def code(self) -> str:
        """Return the code that it failed with."""

    @property
    def detail(self) -> str:
        """Return why it failed."""


class Call(Protocol):
    """How an operation becomes a call or a goal."""

    @property
    def endpoint(self) -> Endpoint:
        """Return the service or action."""

    @property
    def sending(self) -> Sending:
        """Return what is sent."""

    @property
    def code(self) -> str:
        """Return the code of what nobody foresaw."""

    @property
    def unavailable(self) -> str:
        """Return the code for a server that is not there."""

    @property
    def rejected(self) -> str:
        """Return the code for a goal that is not taken."""

    @property
    def moves(self) -> bool:
        """Tell whether it moves the robot."""

    def outcome(self, answer: Data, around: Data) -> Meaning:
        """Return what an answer means: `response`, or `status` and `result`."""

    def progress(self, feedback: Data, around: Data) -> str:
        """Return what feedback tells people."""


class Sent(Protocol):
    """How an action becomes a message."""

    @property
    def endpoint(self) -> Endpoint:
        """Return the topic."""

    @property
    def sending(self) -> Sending:
        """Return what is sent."""


class Heard(Protocol):
    """How a message becomes an event or a live value."""

    @property
    def endpoint(self) -> Endpoint:
        """Return the topic."""

    def heard(self, message: Data, around: Data) -> Data | None:
        """Return the fields of the event, or the field `value`; None when the message is passed over."""


class Bound(Protocol):
    """The plugin."""

    @property
    def name(self) -> str:
        """Return its name."""

    @property
    def calls(self) -> Mapping[str, Call]:
        """Return its operations by local name."""

    @property
    def sends(self) -> Mapping[str, Sent]:
        """Return its actions by local name."""

    @property
    def values(self) -> Mapping[str, Heard]:
        """Return its live values by their names."""

    @property
    def events(self) -> Mapping[str, Heard]:
        """Return its events by local name."""


__all__ = ["Bound", "Call", "Data", "Endpoint", "Heard", "Meaning", "Sending", "Sent"]
