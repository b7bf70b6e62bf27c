"""The verb `lupin invite`: prints a one-time link that logs a person in at this machine's gateway."""

from __future__ import annotations

import socket
import ssl
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from lupin_engine.errors import UsageError, nearest
from lupin_engine.plugin import read_domain, ros_domain
from lupin_gateway.access import read_tokens
from lupin_gateway.entry.invitations import GOOD_FOR_S, GatewayAddress, Invitations, state_folder

#: Seconds that the gateway has for showing its certificate.
ANSWER_S = 5.0


@click.command()
@click.argument("name")
@click.option("--at", metavar="HOST", default="", help="Name or address of this machine in the link.")
@click.option(
    "--domain", type=read_domain, metavar="NUMBER", help="ROS domain; default: $ROS_DOMAIN_ID, else 0."
)
def invite(name: str, at: str, domain: int | None) -> int:
    """Print a link and its QR code, by which a person logs in without typing a token.

    NAME stands in the gateway's file of tokens; to take the line out ends the access. The link works once,
    within 10 minutes, and only for a gateway that this user has started on this machine. Without --at it
    leads to a host of the certificate: an address that this machine has, else a name.

    Exit code: 0 printed, 2 no line for this name, an expired one, or no gateway that asks for tokens.
    """
    folder, wall = state_folder(domain), time.time()
    served = GatewayAddress.read(folder)
    if served is None:
        number = ros_domain() if domain is None else domain
        raise UsageError(
            f"no gateway of this user has asked for tokens in ROS domain {number}; start one with "
            "lupin up --hmi --open, see docs/gateway.md"
        )
    visitors = {one.visitor.name: one.visitor for one in read_tokens(Path(served.tokens))}
    if name not in visitors:
        raise UsageError(f"{served.tokens} has no line for {name!r}; {nearest(name, visitors)}")
    if expired := visitors[name].has_expired(wall):
        raise UsageError(expired)
    host = at or next(_hosts(_certified(served)), socket.gethostname())
    scheme = "https" if served.certificate else "http"
    link = f"{scheme}://{host}:{served.port}{served.base}/login#{Invitations(folder).invite(name, wall)}"
    who = f"{name} ({visitors[name].role.word})"
    click.echo(f"{who} logs in with this link, once, within {GOOD_FOR_S // 60} minutes:\n\n  {link}\n")
    _draw(link)
    return 0


def _certified(served: GatewayAddress) -> list[tuple[str, str]]:
    """Return the kinds and names for which the gateway shows its certificate; this machine's without one.

    Raises:
        UsageError: it does not answer, or shows another certificate.
    """
    host = "127.0.0.1" if served.host == "0.0.0.0" else served.host
    try:
        with socket.create_connection((host, served.port), ANSWER_S) as plain:
            if not served.certificate:
                return [("DNS", "localhost")]
            trust = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            trust.check_hostname = False
            trust.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
            trust.load_verify_locations(served.certificate)
            with trust.wrap_socket(plain) as secured:
                shown = secured.getpeercert() or {}
    except ssl.SSLError as problem:
        reason = getattr(problem, "verify_message", "") or str(problem)
        raise UsageError(
            f"the gateway at port {served.port} does not show the certificate {served.certificate}: {reason}"
            "; when the file is right, start the gateway again"
        ) from None
    except OSError as problem:
        raise UsageError(f"no gateway answers at {host}:{served.port}: {problem}") from None
    names: Any = shown.get("subjectAltName", ())
    return [(str(kind), str(name)) for kind, name in names]


def _hosts(certified: list[tuple[str, str]]) -> Iterator[str]:
    """Yield the certified hosts for a link: addresses of this machine, then names; no wildcards."""
    yield from (name for kind, name in certified if kind == "IP Address" and _is_here(name))
    yield from (name for kind, name in certified if kind == "DNS" and "*" not in name)


def _is_here(address: str) -> bool:
    """Return whether this machine has an IPv4 address that others can reach."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
    return not address.startswith("127.")


def _draw(link: str) -> None:
    """Print a QR code, light on dark whatever the colours of the terminal."""
    try:
        import segno
    except ImportError:
        click.echo("for a QR code: pip install 'lupin-engine[hmi]'")
        return
    rows = [[*row] for row in segno.make(link, error="l", micro=False).matrix_iter(border=2)]
    rows += [[0] * len(rows[0])] * (len(rows) % 2)
    for above, below in zip(rows[::2], rows[1::2], strict=True):
        line = "".join(" ▄▀█"[2 * (not up) + (not down)] for up, down in zip(above, below, strict=True))
        click.echo(click.style(line, fg="bright_white", bg="black"))
