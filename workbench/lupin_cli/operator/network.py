"""Connects an operator's verbs to the orchestrator, and maps its answers to exit codes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from lupin_cli.exit_codes import ACCEPTED, REFUSED
from lupin_engine.errors import Problems, UsageError
from lupin_ros.launch import close_the_doors, current_place, published_here

if TYPE_CHECKING:
    from lupin_ros.launch import Answer, Attendant, Published


@contextlib.contextmanager
def attendant(domain: int | None) -> Iterator[Attendant]:
    """Join the network to look at the orchestrator and to command it, for as long as the body takes.

    Raises:
        UsageError: ROS is missing, or the shell's variables keep nodes from finding each other.
    """
    from lupin_ros.launch import prepare_ros

    problems = Problems(UsageError)
    with problems.collecting():
        close_the_doors(domain)
    with problems.collecting():
        prepare_ros()
    problems.raise_any()
    from lupin_ros.launch import Attendant  # needs rclpy

    found = Attendant()
    try:
        yield found
    finally:
        found.close()


def last_published(domain: int | None) -> Published:
    """Return what the orchestrator has published last; ROS is used only where none of this machine answers.

    Raises:
        UsageError: no orchestrator answers, or see `attendant`.
    """
    with contextlib.suppress(UsageError):  # `attendant` says that again, with what else is wrong
        close_the_doors(domain)
        if found := published_here():
            return found
    with attendant(domain) as orchestrator:
        if not orchestrator.hear():
            raise nobody()
        return orchestrator


def nobody() -> UsageError:
    """Return the error that no orchestrator of this robot answers in this ROS domain."""
    return UsageError(f"no orchestrator speaks in {current_place()}; give --domain, or `lupin up`")


def print_answer(answer: Answer) -> int:
    """Print the orchestrator's answer and return the exit code.

    Raises:
        UsageError: there is no orchestrator, or no answer in time.
    """
    if not answer.reached:
        raise UsageError(answer.text) if answer.found else nobody()
    click.echo(answer.text)
    return ACCEPTED if answer.accepted else REFUSED
