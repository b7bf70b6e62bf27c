"""Rules for a driver, tested over ROS 2 on a `bench`; each raises `ContractBroken` where it is violated."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from lupin_engine.plugin import Plugin
from lupin_harness.referee import ContractBroken

if TYPE_CHECKING:
    from lupin_harness.bench import Bench, Lab

#: Seconds that an operation must take, to distinguish a cancel without effect from a late one.
NOTICEABLE_S = 0.3
#: How often it is looked: on a busy machine one attempt may be late for no fault of its driver.
LOOKS = 3


def waits_alone(lab: Lab) -> None:
    """Without servers the driver names what it misses, and attempts end, at the latest when cancelled."""
    with lab.lonely_bench() as bench:
        missing = bench.missing()
        if lab.setting.waits and not missing:
            raise ContractBroken(
                "missing() is empty although nobody is there; set `waits = False` if so meant"
            )
        if not all(isinstance(name, str) and name for name in missing):
            raise ContractBroken(f"missing() must name what is missing, in words; it returns {missing}")
        for action in lab.plugin.actions:
            bench.act(action)
        for operation in lab.plugin.operations:
            _give_up(bench, operation)


def comes_to_work(lab: Lab) -> None:
    """Among its servers the driver can be made, misses nothing, and no endpoint has other QoS or types."""
    with lab.bench() as bench:
        bench.look_around()
        problems = bench.network_problems()
    if problems:
        raise ContractBroken("\n".join(problems))


def ends_once(lab: Lab, operation: str) -> None:
    """An attempt that is left alone is done, with the declared result; a cancel afterwards is ignored."""
    with lab.bench() as bench:
        attempt = bench.succeed(operation)
        bench.cancel(attempt)
        bench.succeed(operation)


def is_cancelled(lab: Lab, operation: str) -> None:
    """An attempt that was accepted ends, once, when it is cancelled; twice does no harm."""
    with lab.bench() as bench:
        in_vain = [_cancelled_in_vain(bench, operation)]
        while in_vain[-1] and len(in_vain) < LOOKS:
            in_vain.append(_cancelled_in_vain(bench, operation))
        if in_vain[-1]:
            raise ContractBroken(in_vain[0])


def _cancelled_in_vain(bench: Bench, operation: str) -> str:
    """Cancel an attempt, and leave another alone; return a problem when both took the same time."""
    bench.prepare(operation)
    attempt = bench.begin(operation)
    bench.until_heard(attempt)
    begun = time.monotonic()
    bench.cancel(attempt)
    bench.cancel(attempt)
    ended = bench.until_ended(attempt)
    cancelled_s = time.monotonic() - begun
    left_alone = bench.begin_prepared(operation)
    begun = time.monotonic()
    bench.until_done(left_alone)
    whole_s = time.monotonic() - begun
    if "done" not in ended.reports or whole_s <= NOTICEABLE_S or cancelled_s <= whole_s / 2:
        return ""
    return (
        f"the cancel of {attempt} changes nothing: it is done {cancelled_s:.1f} s later, as if left "
        f"alone ({whole_s:.1f} s); end the work and report `cancelled`"
    )


def is_cancelled_at_once(lab: Lab, operation: str) -> None:
    """An attempt that is cancelled before a server took it ends, once; what comes after it works."""
    with lab.bench() as bench:
        bench.prepare(operation)
        attempt = bench.begin(operation)
        bench.cancel(attempt)
        bench.until_ended(attempt)
        bench.succeed(operation)


def keeps_attempts_apart(lab: Lab, operation: str) -> None:
    """Of two attempts at the same time each ends once, and cancelling one leaves the other alone."""
    with lab.bench() as bench:
        bench.prepare(operation)
        first, second = bench.begin(operation), bench.begin(operation)
        bench.cancel(first)
        bench.until_ended(first)
        if "cancelled" in bench.until_ended(second).reports:
            raise ContractBroken(f"{second} is cancelled, and only {first} was to be")


def takes_updates(lab: Lab, operation: str) -> None:
    """Of an operation that `updates`, a second attempt ends the one that was accepted, and is done."""
    with lab.bench() as bench:
        bench.prepare(operation)
        first = bench.begin(operation)
        bench.until_heard(first)
        second = bench.begin(operation)
        bench.until_done(second)
        bench.until_ended(first)


def ignores_strangers(lab: Lab) -> None:
    """A cancel of an unknown attempt is ignored."""
    with lab.bench() as bench:
        bench.cancel("nobody_knows_this_one")
        for operation in lab.plugin.operations:
            bench.succeed(operation)


def acts(lab: Lab) -> None:
    """Actions are sent and not waited for."""
    with lab.bench() as bench:
        for action in lab.plugin.actions:
            bench.act(action)
            bench.act(action)


def is_silent_when_closed(lab: Lab) -> None:
    """After close no report follows, whatever was under way; another driver on the node is not disturbed."""
    with lab.bench() as bench:
        for operation in lab.plugin.operations:
            bench.prepare(operation)
        for operation in _together(lab.plugin):
            bench.begin(operation)
        closed = bench.referee
        bench.close_driver()
        bench.referee, bench.driver = bench.make_driver()
        bench.until_ready()
        for operation in lab.plugin.operations:  # by then the answers to the first driver have come
            bench.succeed(operation)
        if closed.problems:
            raise ContractBroken("\n".join(dict.fromkeys(closed.problems)))


def survives_its_servers(lab: Lab) -> None:
    """When the servers die, attempts end at the latest when cancelled, and the driver names what is gone."""
    with lab.bench() as bench:
        for operation in lab.plugin.operations:
            bench.prepare(operation)
        attempts = [bench.begin(operation) for operation in _together(lab.plugin)]
        for attempt in attempts:
            bench.until_heard(attempt)
        lab.servers.kill()
        for attempt in attempts:
            bench.cancel(attempt)
        for attempt in attempts:
            bench.until_ended(attempt)
        if lab.setting.waits:
            bench.until(bench.missing, "missing() is to name the servers that have died")
            for operation in lab.plugin.operations:
                _give_up(bench, operation)
        for action in lab.plugin.actions:
            bench.act(action)


def finds_its_servers_again(lab: Lab) -> None:
    """Servers that are started anew are found, and work is done as before."""
    with lab.bench() as bench:
        for operation in lab.plugin.operations:
            bench.prepare(operation)
        lab.servers.kill()
        if lab.setting.waits:
            bench.until(bench.missing, "missing() is to name the servers that have died")
        lab.restart()
        bench.until_ready()
        for operation in lab.plugin.operations:
            bench.succeed(operation)


def _give_up(bench: Bench, operation: str) -> None:
    """Begin an attempt without servers, and cancel it at once."""
    attempt = bench.begin(operation)
    bench.cancel(attempt)
    bench.until_ended(attempt)


def _together(plugin: Plugin) -> Iterator[str]:
    """Yield operations that may run at the same time: none shares a resource with another."""
    used: set[str] = set()
    for name, operation in plugin.operations.items():
        if not used.intersection(operation.uses):
            used.update(operation.uses)
            yield name


#: Rules about the whole driver, and rules about each of its operations.
RULES: Mapping[str, Callable[[Lab], None]] = MappingProxyType(
    {
        rule.__name__: rule
        for rule in (
            comes_to_work,
            waits_alone,
            ignores_strangers,
            acts,
            is_silent_when_closed,
            survives_its_servers,
            finds_its_servers_again,
        )
    }
)
OPERATION_RULES: Mapping[str, Callable[[Lab, str], None]] = MappingProxyType(
    {
        rule.__name__: rule
        for rule in (ends_once, is_cancelled, is_cancelled_at_once, keeps_attempts_apart, takes_updates)
    }
)


def live_cases(plugin: Plugin) -> Iterator[tuple[str, str]]:
    """Yield the rules that apply to a plugin, each with its operation, or ''."""
    for rule in RULES:
        if rule != acts.__name__ or plugin.actions:
            yield rule, ""
    for rule in OPERATION_RULES:
        for name, operation in plugin.operations.items():
            # Of two attempts that use the same, the engine lets the second wait for the end of the first.
            is_shared = not operation.uses and not operation.updates
            about = {keeps_attempts_apart.__name__: is_shared, takes_updates.__name__: operation.updates}
            if about.get(rule, True):
                yield rule, name


def apply(rule: str, operation: str, lab: Lab) -> None:
    """Run one case.

    Raises:
        ContractBroken: the driver violates the rule.
    """
    if operation:
        OPERATION_RULES[rule](lab, operation)
    else:
        RULES[rule](lab)
