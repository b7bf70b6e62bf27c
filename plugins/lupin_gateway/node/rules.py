"""Builds the gateway's rules from the node's parameters: access control, allow list, stops, and audit log."""

from __future__ import annotations

import ssl
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from std_msgs.msg import Bool, String

from lupin_engine.errors import LupinError, Problems, UsageError
from lupin_engine.plugin import (
    BOOL,
    TEXT,
    Access,
    Catalog,
    Parameter,
    declared_access,
    list_of,
    load_catalog,
    one_of,
    read_robot,
)
from lupin_gateway.access import (
    AccessControl,
    AllowList,
    IssuedToken,
    open_problems,
    read_tokens,
)
from lupin_gateway.audit import AuditLog, last_lines
from lupin_gateway.entry.invitations import GatewayAddress, Invitations, state_folder
from lupin_gateway.guard import OWN_ACCESS, STOPS_TOPIC, ClockPair, GatewayRules, RuleOutputs
from lupin_gateway.motion import BASE_TOPIC, MotionGate
from lupin_gateway.node.kept import StateFile
from lupin_gateway.node.ros import RosAdapter
from lupin_gateway.people import MOST_COMMANDS, NOTIFICATIONS_TOPIC, PEOPLE_TOPIC, People
from lupin_gateway.ports import CallFailed, RosPort
from lupin_gateway.stop import KeptStops, OnLinkLost, StopArbiter
from lupin_greenhouse import HMI_TOPIC, PAGES_TOPIC
from lupin_ros.adapter import Qos, RosNode
from lupin_ros.service import MissionsFolder, names

#: Addresses at which only this machine is heard.
LOOPBACK = ("127.0.0.1", "localhost", "::1")
#: The request that `on_link_lost: pause` sends, and how long its answer may take, in seconds.
PAUSE, PAUSE_S = "pause", 5.0
#: Seconds for which a stop left by an earlier gateway is published at least. Others take a dead gateway for
#: alive for up to 3 s (the discovery lease).
TAKEN_OVER_S = 4.0

PARAMETERS = {
    "open": Parameter(
        BOOL, False, "whether other machines may reach it; then it needs tls_certificate, tls_key and tokens"
    ),
    "tls_certificate": Parameter(TEXT, "", "file with the certificate of this machine (PEM)"),
    "tls_key": Parameter(TEXT, "", "file with its key (PEM)"),
    "tokens": Parameter(
        TEXT,
        "",
        "file of who may come in: lines of NAME ROLE EXPIRES TOKEN; empty: all of this machine; "
        "{robot} in it is the name of each of several robots",
    ),
    "robots": Parameter(
        list_of(TEXT), [], "names of robots below this node's namespace that are served; empty: its own"
    ),
    "origins": Parameter(
        list_of(TEXT), [], "origins of pages that other servers serve, such as https://hmi.example:8443"
    ),
    "viewer_names": Parameter(
        list_of(TEXT), [], "topics that viewers may read beside those that are declared; * is any letters"
    ),
    "operator_names": Parameter(
        list_of(TEXT), [], "topics, services and actions that operators may use beside those declared"
    ),
    "engineer_names": Parameter(
        list_of(TEXT), [], "topics, services and actions that engineers may use beside those declared"
    ),
    "motion_names": Parameter(
        list_of(TEXT), [], "topics and services that move the robot, beside those that are declared"
    ),
    "viewers_stop": Parameter(BOOL, True, "whether a viewer may stop the robot, too"),
    "shared_false": Parameter(
        BOOL,
        False,
        f"whether {HMI_TOPIC} is told steadily, and not only once at a release, that no page stops the robot",
    ),
    "on_link_lost": Parameter(
        one_of(*(one.value for one in OnLinkLost)),
        OnLinkLost.CONTINUE.value,
        "what is done when the last operator's page is gone",
    ),
    "audit_file": Parameter(
        TEXT, "", "file with a line for each command; empty: one in the user's state folder"
    ),
    "missions_path": Parameter(
        TEXT, "", "folder whose bindings name more; empty: the orchestrator's default"
    ),
}


def check(values: Mapping[str, Any]) -> None:
    """Check the parameters together.

    Raises:
        UsageError: all errors at once.
    """
    problems = Problems(UsageError)
    if values["robots"]:
        if values["audit_file"]:
            problems.add("audit_file: each of several robots has a file of its own: leave it out")
        for robot in values["robots"]:
            with problems.collecting():
                check(of_robot(values, robot))
        problems.raise_any()
        return
    if values["open"]:
        problems.add(*open_problems(values["tls_certificate"], values["tls_key"], values["tokens"]))
    elif values["host"] not in LOOPBACK:
        problems.add(f"host {values['host']}: others can reach it there: write open: true, or leave host out")
    if values["tokens"] and Path(values["tokens"]).is_file():
        with problems.collecting():
            read_tokens(Path(values["tokens"]))
    if not problems:
        with problems.collecting():
            tls(values)
    problems.raise_any()


def of_robot(values: Mapping[str, Any], robot: str) -> Mapping[str, Any]:
    """Return the parameters for one of several robots.

    Raises:
        UsageError: it is no name of a robot.
    """
    if "/" in read_robot(robot, "robots:")[1:]:
        raise UsageError(f"robots: {robot!r} is below another one: a gateway in that namespace serves it")
    return {**values, "robots": [], "audit_file": "", "tokens": values["tokens"].replace("{robot}", robot)}


def tls(values: Mapping[str, Any]) -> Mapping[str, str]:
    """Return the certificate and key by uvicorn's names; nothing where TLS is off.

    Raises:
        UsageError: the files are no certificate with its key.
    """
    certificate, key = values["tls_certificate"], values["tls_key"]
    if not (certificate and key):
        return {}
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as problem:
        reason = problem.strerror or str(problem)
        raise UsageError(f"{certificate} and {key} are no certificate with its key: {reason}") from None
    return {"ssl_certfile": certificate, "ssl_keyfile": key}


def host(values: Mapping[str, Any]) -> str:
    """Return the address to listen on: all addresses for an open gateway, unless one is named."""
    named: str = values["host"]
    return "0.0.0.0" if values["open"] and named in LOOPBACK else named


def gateway_rules(ros: RosNode, port: RosAdapter, values: Mapping[str, Any], paths: str = "") -> GatewayRules:
    """Return the rules, with the stops that an earlier gateway of this robot has left engaged.

    `paths` is what stands before those of its pages.
    """
    catalog, folder = load_catalog(), state_folder(robot=ros.namespace)
    tokens = Path(values["tokens"]) if values["tokens"] else None
    access = AccessControl(_TokensFile(ros, tokens) if tokens else None, values["origins"])
    stops = StopArbiter(OnLinkLost(values["on_link_lost"]), values["viewers_stop"])
    stops_file = StateFile(ros, folder / "stops.json", "stops")
    stops.restore(_kept_stops(ros, stops_file), time.monotonic())
    shown = ros.publisher(String, STOPS_TOPIC, Qos.LATCHED)
    base = ros.publisher(String, BASE_TOPIC, Qos.LATCHED)
    outputs = RuleOutputs(
        publish_stop=_stop_publisher(ros, values["shared_false"], stops.stopped),
        publish_stops=lambda state: shown.publish(String(data=state)),
        pause=_pausing(port, catalog),
        keep=lambda kept: stops_file.keep(asdict(kept)),
        publish_base=lambda state: base.publish(String(data=state)),
        halt=port.halt,
    )
    audit_file = Path(values["audit_file"]) if values["audit_file"] else folder / "audit.jsonl"
    log = AuditLog(audit_file, ros.log.error)
    allowed = AllowList([*declared_access(catalog), *_own(ros, catalog, values)])
    ros.on_stop(log.close)
    rules = GatewayRules(access, allowed, stops, log, ClockPair(time.monotonic, time.time), outputs)
    rules.people = _people(ros, folder, audit_file)
    wire = catalog.profile.wire
    rules.motion = MotionGate((names.COMMAND_SERVICE, *([wire.requests.format("*")] if wire else ())))
    port.moving = allowed.moving
    port.commands = partial(_commands, rules.motion)
    ros.on_inactive(port.end_all_motion, partial(_what_moves, rules.motion, port))
    rules.warn = ros.log.warning
    if tokens:
        rules.invitations = Invitations(folder)
        certificate = _absolute(values["tls_certificate"])
        files = _absolute(values["tokens"]), certificate
        GatewayAddress(host(values), values["port"], *files, paths).keep(folder)
    return rules


def _commands(motion: MotionGate, service: str, data: Any) -> bool:
    """Return whether a call commands the mission, other than to pause."""
    verb = data.get("verb") if isinstance(data, Mapping) else ""
    return motion.is_command(service) and PAUSE not in (verb, service.rpartition("/")[2])


def _what_moves(motion: MotionGate, port: RosAdapter) -> str:
    """Return why the gateway may not be deactivated: it would leave a robot that moves to nobody."""
    if motion.hindrance == "mission":
        return motion.state()["reason"]
    by = port.what_moves()
    return by and f"a page moves the robot by {by}"


def _absolute(file: str) -> str:
    return str(Path(file).absolute()) if file else ""


def _stop_publisher(ros: RosNode, shared_false: bool, is_taken_over: bool) -> Callable[[bool], None]:
    """Return the function that publishes the stop, on the gateway's topic and on the one that HMIs share.

    A stop that `is_taken_over` from an earlier gateway is published for at least `TAKEN_OVER_S`: until then
    listeners may take the earlier gateway for alive, and would not count a release.

    On the shared topic false is published once, after a stop: a reader that keeps the last value, such as the
    bridge of today's robot, needs it, while repeated ones would release the stops of other HMIs
    (`shared_false` repeats it all the same).
    """
    own, shared = ros.publisher(Bool, PAGES_TOPIC, Qos.LATCHED), ros.publisher(Bool, HMI_TOPIC, Qos.EVENT)
    was_stopped, stays_until = False, time.monotonic() + TAKEN_OVER_S * is_taken_over

    def publish(stopped: bool) -> None:
        nonlocal was_stopped
        stopped = stopped or time.monotonic() < stays_until
        own.publish(Bool(data=stopped))
        if stopped or was_stopped or shared_false:
            shared.publish(Bool(data=stopped))
        was_stopped = stopped

    return publish


def _own(ros: RosNode, catalog: Catalog, values: Mapping[str, Any]) -> Iterator[Access]:
    """Yield the access that no catalog declares: of the gateway, the engine, bindings, settings."""
    yield names.ACCESS
    yield OWN_ACCESS
    kinds = ("viewer", "operator", "engineer", "motion")
    yield Access(*(tuple(values[f"{kind}_names"]) for kind in kinds))
    try:
        bindings = MissionsFolder(values, catalog).load()
    except LupinError as problem:
        ros.log.warning(f"names of bindings are not offered to pages: {problem}")
        return
    calls = [call for one in bindings.bindings.values() for call in one.calls.values()]
    called = tuple(call.endpoint.name for call in calls)
    moving = tuple(call.endpoint.name for call in calls if call.moves)
    yield Access(viewer=tuple(bindings.heard), engineer=called, motions=moving)


class _TokensFile:
    """Reads the file of tokens at each call; an error is logged once."""

    def __init__(self, ros: RosNode, file: Path) -> None:
        self._ros = ros
        self._file = file
        self._logged = ""

    def __call__(self) -> tuple[IssuedToken, ...]:
        try:
            tokens = read_tokens(self._file)
        except LupinError as problem:
            if str(problem) != self._logged:
                self._logged = str(problem)
                self._ros.log.error(self._logged)
            raise
        self._logged = ""
        return tokens


def _pausing(port: RosPort, catalog: Catalog) -> Callable[[Callable[[Any], None]], None]:
    wire = catalog.profile.wire
    if wire is None or PAUSE not in catalog.profile.requests:
        return lambda done: done(CallFailed("no request of this profile pauses a mission"))
    service = wire.requests.format(PAUSE)
    return lambda done: port.call(service, {}, PAUSE_S, done)


def _kept_stops(ros: RosNode, file: StateFile) -> KeptStops:
    """Return the saved stops; a file that cannot be read counts as one engaged stop, 'unknown'."""
    try:
        kept = file.read()
        if kept is None:
            return KeptStops()
        stops = tuple((str(name), str(browser)) for name, browser in kept["stops"])
        return KeptStops(stops, bool(kept["operator"]))
    except (OSError, ValueError, TypeError, KeyError) as problem:
        ros.log.error(
            f"{file.file}: {problem}: the robot is stopped until somebody resets the stop 'unknown'"
        )
        return KeptStops((("unknown", ""),))


def _people(ros: RosNode, folder: Path, audit_file: Path) -> People:
    """Return the people, with saved notifications and commands of this domain's last gateway."""
    file = StateFile(ros, folder / "notifications.json", "notifications")
    publishers = {
        topic: ros.publisher(String, topic, Qos.LATCHED) for topic in (PEOPLE_TOPIC, NOTIFICATIONS_TOPIC)
    }
    people = People(lambda topic, text: publishers[topic].publish(String(data=text)), file.keep)
    for line in last_lines(audit_file, MOST_COMMANDS):
        people.commanded(line)
    try:
        people.restore(file.read() or {})
    except (OSError, ValueError, TypeError, KeyError) as problem:
        ros.log.error(f"{file.file}: {problem}: earlier notifications are not shown any more")
    return people
